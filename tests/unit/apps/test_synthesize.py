"""`h2nav synthesize` and `h2nav certify` from the command line."""

import json
from pathlib import Path

import pytest
from needs import REPOSITORY

from h2nav.cli import main
from h2nav.files import gain_files

MODEL = REPOSITORY / "gains" / "models" / "mpu9250.yaml"


def synthesize(output: Path, *words: str) -> int:
    return main(["synthesize", str(MODEL), "--rate", "100", "-o", str(output), *words])


def test_synthesis_is_repeatable_and_certified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "gains.yaml"
    assert synthesize(path, "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["ok"] is True
    assert summary["h2_norm"] == pytest.approx(7.0e-4, rel=1e-3)
    assert set(summary["certificate"]) == {"sha256", "loops"}
    assert summary["methods"]["attitude_and_bias"]["discrete"]["disagreement"] < 1e-5
    again, shipped = gain_files.load(path), gain_files.load("mpu9250_100hz")
    assert again.gains == shipped.gains
    assert again.model == shipped.model
    assert main(["certify", str(path), "--json"]) == 0
    (verdict,) = json.loads(capsys.readouterr().out)["files"].values()
    assert verdict["ok"] is True
    assert verdict["spectral_abscissa"] < 0.0
    assert verdict["h2_norm"] == pytest.approx(summary["h2_norm"], rel=1e-9)


def test_report_for_people(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "gains.yaml"
    assert synthesize(path) == 0
    streams = capsys.readouterr()
    for word in ("closed_form", "riccati", "lmi_clarabel", "lmi_scs", "0.0401 deg rms"):
        assert word in streams.out
    assert str(path) in streams.err
    assert main(["certify", str(path), "mpu9250_50hz"]) == 0
    assert capsys.readouterr().out.count("certified: spectral abscissa") == 2


def test_tampered_file_fails_with_status_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = gain_files.find("mpu9250_100hz").read_text()
    path = tmp_path / "gains.yaml"
    path.write_text(text.replace("  k_ee_rad2: [2.", "  k_ee_rad2: [3."))
    assert main(["certify", "mpu9250_100hz", str(path)]) == 1
    out = capsys.readouterr().out
    assert "mpu9250_100hz: certified" in out
    assert "stale" in out
    assert "not optimal" in out


def test_unreadable_file_fails_with_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["certify", str(tmp_path / "absent.yaml")]) == 2
    assert "no such gain file" in capsys.readouterr().out


def test_bad_input_is_one_line_each(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "m.yaml"
    model.write_text(MODEL.read_text().replace("dip_deg: 60", "dip_deg: 90"))
    output = str(tmp_path / "g.yaml")
    assert main(["synthesize", str(model), "--rate", "100", "-o", output]) == 2
    assert "parallel to gravity" in capsys.readouterr().err
    assert main(["synthesize", str(MODEL), "--rate", "0.1", "-o", output]) == 2
    assert "expected a rate from 1 to 4000 Hz" in capsys.readouterr().err
    assert not Path(output).exists()

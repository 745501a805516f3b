"""`h2nav synthesize` and `h2nav certify` from the command line."""

import dataclasses
import json
import math
import re
from pathlib import Path

import pytest
from needs import REPOSITORY

from h2nav.apps import synthesize as command
from h2nav.attitude.gains.envelope import GainFile
from h2nav.attitude.samples import EarthField
from h2nav.cli import main
from h2nav.errors import BadInput
from h2nav.files import earth_field, gain_files
from h2nav.files.plain_yaml import read_mapping
from h2nav.synthesis.certificate import CertificateError

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


METHODS = {
    "attitude": {
        "discrete": {
            "riccati": {"h2_norm": math.radians(0.5), "distance": 1.2e-9},
            "lmi_scs": {"refused": "did not converge"},
            "disagreement": 1e-9,
        },
        "note": "not a time",
    }
}


def made(**changes: object) -> GainFile:
    loops = {"first": {"h2_norm": math.radians(0.25)}, "second": {"h2_norm": 9.0}}
    file = gain_files.load("mpu9250_100hz")
    return dataclasses.replace(file, methods=METHODS, certificate={"loops": loops}, **changes)


def test_the_methods_stand_side_by_side_with_the_accuracy_of_the_first_loop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "gains.yaml"
    asked: list[tuple[Path, float]] = []
    files = [
        made(fixed_point={}),
        made(fixed_point={"refused": "too coarse"}),
        made(fixed_point={}),
    ]

    def synthesized(*words: object) -> tuple[GainFile, dict[str, float]]:
        asked.append(words)
        return files.pop(0), {"SCS": 0.5}

    monkeypatch.setattr(command, "_synthesize", synthesized)
    assert synthesize(path) == 0
    told = capsys.readouterr()
    assert told.out.splitlines() == [
        "plant              time        method        rms deg     distance",
        "attitude           discrete    riccati       0.500000    1.2e-09",
        "attitude           discrete    lmi_scs       refused: did not converge",
        "expected attitude error at rest: 0.2500 deg rms (three axes)",
    ]
    (line,) = told.err.splitlines()
    assert re.fullmatch(rf"{path}: written and certified in \d+\.\d s", line)
    assert synthesize(path) == 0
    first, _ = capsys.readouterr().err.splitlines()
    assert first == f"{path}: for floats only: too coarse"
    assert synthesize(path, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert 0.0 <= document.pop("wall_time_s") < 60.0
    assert document == {
        "ok": True, "file": str(path), "h2_norm": math.radians(0.25), "methods": METHODS,
        "certificate": made().certificate, "fixed_point": {}, "solver_wall_time_s": {"SCS": 0.5},
    }  # fmt: skip
    assert asked == [(MODEL, 100.0)] * 3


@pytest.mark.parametrize(
    ("rate", "is_taken"), [("1", True), ("4000", True), ("0.99", False), ("4001", False)]
)
def test_a_filter_has_a_rate_from_1_to_4000_hz(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    rate: str,
    is_taken: bool,
) -> None:
    def fails(*_: object) -> None:
        raise CertificateError("not stable")

    monkeypatch.setattr(command, "_synthesize", fails)
    status = main(["synthesize", str(MODEL), "--rate", rate, "-o", str(tmp_path / "g.yaml")])
    said = f"--rate {rate}: expected a rate from 1 to 4000 Hz"
    if is_taken:
        said = f"{MODEL}: no trustworthy gain: not stable"
    assert (status, capsys.readouterr().err) == (1 if is_taken else 2, f"h2nav: {said}\n")
    assert not (tmp_path / "g.yaml").exists()


def test_a_model_at_a_place_has_the_field_of_its_date(monkeypatch: pytest.MonkeyPatch) -> None:
    """The year counts from 1970 in mean years; no altitude is the sea's."""
    asked: list[tuple[float, ...]] = []
    mapping = read_mapping(MODEL)
    at = {"latitude_deg": 47.0, "longitude_deg": 8.0, "year": 1970.0 + 55.0}
    place = {**mapping, "field": at}

    def field(*words: float) -> EarthField | None:
        asked.append(words)
        return fields.pop(0)

    fields = [EarthField(48.0, 1.1, 0.05), None]
    monkeypatch.setattr(earth_field, "earth_field_at", field)
    model = command.sensor_model(place, "m.yaml")
    assert asked == [(47.0, 8.0, 0.0, pytest.approx(55.0 * 365.2425 * 86_400.0))]
    assert model.field.norm_ut == pytest.approx(48.0)
    with pytest.raises(BadInput) as caught:
        command.sensor_model(place, "m.yaml")
    assert str(caught.value) == (
        "m.yaml: field: at 47, 8 deg the field is nearly parallel to gravity, so heading cannot be "
        "observed; choose another place"
    )
    command.sensor_model(mapping, "m.yaml")
    assert len(asked) == 2

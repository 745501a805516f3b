import json
from pathlib import Path

import numpy as np
import pytest
from synthetic_imu import fly, slow

from h2nav import cli
from h2nav.maths import frames


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two short trials with truth and one without."""
    for seed in (1, 2, 3):
        flight = fly(slow, 20.0, seed)
        q_es = np.array([frames.attitude_enu_from_ned(q) for q in flight.q_nb])
        mask = np.arange(len(q_es)) > 1000
        truth = {"q": q_es, "mask": mask} if seed < 3 else {}
        np.savez(
            tmp_path / f"trial_{seed}.npz",
            fs=np.array(100.0),
            gyr=np.array([s.w_b for s in flight.samples]),
            acc=np.array([s.f_b for s in flight.samples]),
            mag=np.array([s.m_b_ut for s in flight.samples]),
            **truth,
        )
    return tmp_path


def test_json_has_the_promised_keys(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["evaluate", "dataset", str(folder), "--json"]) == 0
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert set(result["trials"]) == {"trial_1", "trial_2"}
    assert set(result["trials"]["trial_1"]) == {"total", "heading", "inclination"}
    totals = [row["total"] for row in result["trials"].values()]
    assert result["mean"]["total"] == pytest.approx(sum(totals) / 2)
    assert result["mean"]["total"] < 3.0
    assert result["us_per_sample"] > 0.0
    assert "trial_3: default: left out: " in err
    assert "trial_3.npz: no truth: key q" in err


def test_filters_side_by_side(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["evaluate", "dataset", str(folder), "--filter", "default", "--filter", "two_stage"]
    assert cli.main([*words, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert set(result["filters"]) == {"default", "two_stage"}
    assert result["filters"]["default"]["mean"] == result["mean"]
    assert cli.main(words) == 0
    table = capsys.readouterr().out
    assert "two_stage" in table
    assert "trial_2" in table


def test_plots(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    plots = tmp_path / "figures"
    assert cli.main(["evaluate", "dataset", str(folder), "--plots", str(plots)]) == 0
    assert sorted(path.name for path in plots.iterdir()) == [
        "trial_1.default.png",
        "trial_2.default.png",
    ]


def test_an_unknown_filter_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["evaluate", "dataset", str(folder), "--filter", "magic"]) == 2
    assert "--filter magic" in capsys.readouterr().err


def test_gps_without_rows_is_left_out(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["evaluate", "dataset", str(folder), "--gps"]) == 1
    assert "no gps rows" in capsys.readouterr().err

import functools
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from needs import DEG, absent
from synthetic_imu import FIELD, fly, slow

from h2nav import cli
from h2nav.attitude import native
from h2nav.attitude.filter import pass_on
from h2nav.attitude.samples import SensorDelays, VehicleState, VelocityFix
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.evaluation.dataset.filters import (
    Conditions,
    FilterTrack,
    run_velocity_aided,
    run_velocity_aided_integer,
    to_true_north,
)
from h2nav.evaluation.dataset.peers import SMOOTHED, installed
from h2nav.evaluation.dataset.scores import TrialTask, score_task
from h2nav.files import gain_files
from h2nav.maths import frames, quaternion
from h2nav.recordings.listener import Listener
from h2nav.recordings.trials import FilterInput, Trial, read_trial
from h2nav.service.autopilot import Identity


@pytest.fixture(autouse=True)
def one_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes would be started for seconds, to evaluate trials for a tenth of one."""
    monkeypatch.setattr(os, "cpu_count", lambda: 1)


flown = functools.cache(fly)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two short trials with truth and one without."""
    for seed in (1, 2, 3):
        flight = flown(slow, 20.0, seed)
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


def test_json_has_the_promised_keys(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    assert cli.main(["evaluate", "dataset", str(folder), "--json"]) == 0
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert set(result["trials"]) == {"trial_1", "trial_2"}
    assert set(result["trials"]["trial_1"]) == {"total", "heading", "inclination"}
    totals = [row["total"] for row in result["trials"].values()]
    assert result["mean"]["total"] == pytest.approx(sum(totals) / 2)
    assert result["mean"]["total"] < 3.0
    assert result["us_per_sample"] > 0.0
    assert result["backend"] == native.backend()
    assert "trial_3: default: left out: " in err
    assert "trial_3.npz: no truth: key q" in err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--declination-deg", "nan"), "expected a number within +-180"),
        (("--cruise-speed-m-s", "nan"), "expected a number from 0 to 300"),
        (("--cruise-speed-m-s", "-1"), "expected a number from 0 to 300"),
    ],
)
def test_a_number_that_is_none_is_one_line(
    words: tuple[str, str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["evaluate", "dataset", "trials", *words]) == 2
    assert capsys.readouterr().err == f"h2nav: {words[0]}: {said}\n"


@pytest.mark.thorough
def test_smoothed_results_stand_beside_the_causal_ones(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["evaluate", "dataset", str(folder), "--json"]
    assert cli.main(words) == 0
    causal = json.loads(capsys.readouterr().out)
    assert cli.main([*words, "--smooth"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["trials"] == causal["trials"], "the keys of one filter stay where they were"
    assert result["mean"] == causal["mean"]
    assert set(result["filters"]) == {"default", "default_smoothed"}
    smoothed = result["filters"]["default_smoothed"]
    assert set(smoothed["trials"]["trial_1"]) == {"total", "heading", "inclination"}
    assert smoothed["mean"]["inclination"] < 0.5
    assert smoothed["us_per_sample"] > 0.0


def test_every_filter_of_ours_can_be_smoothed(folder: Path) -> None:
    trial = read_trial(folder / "trial_1.npz")
    for name, smoothed in SMOOTHED.items():
        if name in installed():
            track = installed()[smoothed](trial, Conditions("multirotor"))
            assert np.isfinite(track.q_es).all()
            assert len(track.q_es) == len(trial.t_us)


@pytest.mark.thorough
def test_filters_side_by_side(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["evaluate", "dataset", str(folder), "--filter", "default", "--filter", "default_fixed"]
    assert cli.main([*words, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert set(result["filters"]) == {"default", "default_fixed"}
    assert result["filters"]["default"]["mean"] == result["mean"]
    assert cli.main(words) == 0
    table = capsys.readouterr().out
    assert "default_fixed" in table
    assert "trial_2" in table


def test_the_integers_stand_next_to_the_floats(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = ("default", "default_fixed")
    words = ["evaluate", "dataset", str(folder), *(w for name in names for w in ("--filter", name))]
    assert cli.main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["filters"]
    assert found["default_fixed"]["backend"] == found["default"]["backend"] == native.backend()
    for trial, row in found["default"]["trials"].items():
        for key, value in row.items():
            assert found["default_fixed"]["trials"][trial][key] == pytest.approx(value, abs=0.3)


@pytest.mark.thorough
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


@pytest.fixture
def trial(folder: Path) -> Trial:
    """A trial that an autopilot tells about; some samples bring no field."""
    found = read_trial(folder / "trial_1.npz")
    assert found.m_s is not None
    found.m_s[1::2] = np.nan
    field = FIELD._replace(declination_rad=0.2)
    told = (
        FilterInput(0, VehicleState(True)),
        FilterInput(137, field),
        FilterInput(900, VehicleState(False)),
    )
    return found._replace(inputs=(*told, FilterInput(len(found.t_us), VehicleState(True))))


@pytest.mark.parametrize("run", [run_velocity_aided, run_velocity_aided_integer])
def test_compiled_kernels_give_the_same_bits(
    trial: Trial, run: Callable[[Trial, Conditions], FilterTrack], monkeypatch: pytest.MonkeyPatch
) -> None:
    if native.backend() != "native":
        absent("the compiled kernels are not built from these sources")
    compiled = run(trial, Conditions("multirotor"))
    monkeypatch.setenv(native.SWITCH, "forbid")
    python = run(trial, Conditions("multirotor"))
    assert (compiled.backend, python.backend) == ("native", "python")
    assert np.array_equal(compiled.q_es, python.q_es)
    assert compiled.bias is not None
    assert python.bias is not None
    assert np.array_equal(compiled.bias, python.bias)


def test_what_a_batch_cannot_show_runs_sample_by_sample(trial: Trial) -> None:
    backend = native.backend()
    per_sample = "native, called per sample" if backend == "native" else "python"
    plotted = run_velocity_aided(trial, Conditions("handheld", shows_insides=True))
    assert plotted.backend == per_sample
    assert plotted.gain_set is not None
    still = (0.0, 0.0, float("nan"))
    fixes = [FilterInput(20 * k, VelocityFix(200_000 * k, still, 0.1)) for k in range(1, 50)]
    flying = trial._replace(inputs=tuple(fixes))
    assert run_velocity_aided(flying, Conditions("handheld", True)).backend == per_sample
    assert run_velocity_aided(flying, Conditions("handheld")).backend == backend


def test_a_clipped_sample_reaches_the_filter(trial: Trial) -> None:
    clipped = np.zeros(len(trial.t_us), dtype=bool)
    clipped[500:700] = True
    w_s = trial.w_s.copy()
    w_s[500:700] = 0.0
    plain = run_velocity_aided(trial._replace(w_s=w_s), Conditions("handheld"))
    marked = run_velocity_aided(trial._replace(w_s=w_s, clipped=clipped), Conditions("handheld"))
    assert not np.array_equal(plain.q_es, marked.q_es)


def test_the_declination_turns_clockwise() -> None:
    # Nose to magnetic north where the declination is 10 deg east: the true heading is 10 deg.
    magnetic = np.array([frames.attitude_enu_from_ned(quaternion.from_euler(0.1, 0.2, 0.0))])
    true = frames.attitude_enu_from_ned(quaternion.from_euler(0.1, 0.2, 10.0 * DEG))
    turned = to_true_north(magnetic, 10.0 * DEG)[0]
    assert turned * np.sign(turned[0]) == pytest.approx(true, abs=1e-12)


def test_plain_words_for_what_is_no_data_set(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "broken.npz"
    broken.write_bytes(b"PK\x03\x04 and then nothing")
    assert cli.main(["evaluate", "dataset", str(tmp_path)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        f"h2nav: {broken}: not a readable archive; expected numpy's .npz of plain arrays of numbers"
    ]
    notes = tmp_path / "notes.txt"
    notes.write_text("no recording")
    assert cli.main(["evaluate", "dataset", str(notes)]) == 2
    assert "expected an .npz file or a recording" in capsys.readouterr().err


def test_trials_of_one_name_are_told_apart(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "trial_1.tlog").write_bytes(b"no recording")
    assert cli.main(["evaluate", "dataset", str(folder), "--json"]) == 0
    out, err = capsys.readouterr()
    assert set(json.loads(out)["trials"]) == {"trial_1.npz", "trial_2"}
    assert "trial_1.tlog: default: left out" in err


def test_a_listener_gives_its_filter_what_it_keeps() -> None:
    flight = fly(slow, 2.0, 1)
    gains = velocity_aided_gains(gain_files.load("multirotor_100hz"), "multirotor_100hz")
    alone, wrapped = VelocityAidedFilter(gains), VelocityAidedFilter(gains)
    listener = Listener(lambda _: wrapped)
    chosen = listener.filter_for(Identity(1, 1, 3, 2))
    records = (VehicleState(False), FIELD, SensorDelays(0.01, 0.05))
    for each in (alone, chosen):
        for what in records:
            pass_on(each, what)
    for number, sample in enumerate(flight.samples):
        listener.arrives(1_000_000 * number)
        if number == 100:
            alone.restart()
            chosen.restart()
        assert chosen.update(sample) == alone.update(sample)
    assert wrapped.state() == alone.state()
    first, second = listener.stretches
    assert [*first.samples.records(), *second.samples.records()] == list(flight.samples)
    assert [len(first), len(second)] == [100, 100]
    assert second.arrived_us.tolist() == [1000 * number for number in range(100, 200)]
    assert [each.what for each in first.inputs] == [each.what for each in second.inputs]
    assert [each.what for each in second.inputs] == list(records)


def test_rows_of_zeros_are_no_truth_and_gps_rows_without_a_number_no_velocity(
    tmp_path: Path,
) -> None:
    count = 600
    arrays = {
        "fs": np.array(100.0),
        "gyr": np.zeros((count, 3)),
        "acc": np.tile([0.0, 0.0, 9.8], (count, 1)),
        "q": np.tile([0.0, 1.0, 0.0, 0.0], (count, 1)),  # upside down
    }
    gps = np.column_stack((np.arange(0.0, 6.0, 0.2), *np.zeros((3, 30))))
    gaps = [[np.nan, 1.0, 0.0, 0.0], [2.0, np.nan, 0.0, 0.0], [2.0, 1.0, np.inf, 0.0]]
    scores = []
    for rows, truth in ((gps, 1.0), (np.vstack((gps, gaps))[::-1], np.arange(count)[:, None] % 2)):
        path = tmp_path / "trial.npz"
        np.savez(path, **arrays | {"q": truth * arrays["q"], "gps": rows})
        conditions = Conditions("multirotor", use_gps=True)
        scores.append(
            score_task(TrialTask(path, read_trial, "trial", "velocity_aided", conditions))
        )
    assert scores[0].rms_deg is not None
    assert scores[0].rms_deg.total == pytest.approx(180.0)
    assert scores[1].rms_deg == scores[0].rms_deg

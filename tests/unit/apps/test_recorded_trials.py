import json
from pathlib import Path

import numpy as np
import pytest
from needs import DEG, need_package
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from replayed import TAKEOFF, Replayed, rewritten

from h2nav import cli
from h2nav.apps import configuration
from h2nav.apps.recorded_trials import read
from h2nav.attitude.samples import EarthField, VelocityFix
from h2nav.errors import BadInput
from h2nav.evaluation.dataset.filters import Conditions, run_velocity_aided
from h2nav.maths.attitude_errors import errors, rms
from h2nav.recordings.trials import Trial


@pytest.fixture(scope="module")
def takeoff() -> Trial:
    return read(TAKEOFF)


@pytest.mark.parametrize("use_gps", [True, False])
def test_it_is_what_the_service_gives_its_filter(takeoff: Trial, use_gps: bool) -> None:
    words = {"aiding": {"gps_velocity": use_gps}}
    replayed = Replayed(TAKEOFF, configuration.build(words, "test"))
    track = run_velocity_aided(takeoff, Conditions("multirotor", use_gps))
    assert takeoff.q_es is not None
    found = rms(errors(track.q_es, takeoff.q_es, takeoff.mask, True), takeoff.mask)
    expected = replayed.errors()
    assert takeoff.mask.sum() == pytest.approx(expected.compared, abs=5)
    assert (found.total, found.inclination) == pytest.approx(
        (expected.total, expected.tilt), rel=5e-3
    )


def test_times_are_the_messages_own(takeoff: Trial) -> None:
    steps = np.diff(takeoff.t_us)
    assert takeoff.t_us[0] == 0
    assert steps.min() > 0
    assert len(set(steps.tolist())) > 1
    assert takeoff.rate_hz == pytest.approx(100.0, abs=0.1)


def test_the_service_knows_field_and_velocity(takeoff: Trial) -> None:
    whats = [told.what for told in takeoff.inputs]
    fields = [what for what in whats if isinstance(what, EarthField)]
    assert takeoff.declination_rad == fields[-1].declination_rad
    assert takeoff.declination_rad == pytest.approx(12.7 * DEG, abs=0.2 * DEG)
    fixes = [told for told in takeoff.inputs if isinstance(told.what, VelocityFix)]
    assert len(fixes) > 100
    for told in fixes:
        assert isinstance(told.what, VelocityFix)
        row = min(told.row, len(takeoff.t_us) - 1)
        assert abs(told.what.t_us - int(takeoff.t_us[row])) < 600_000


@pytest.mark.thorough
def test_peers_are_turned_to_true_north(capsys: pytest.CaptureFixture[str]) -> None:
    need_package("vqf")
    words = ["evaluate", "dataset", str(TAKEOFF), "--filter", "vqf"]
    assert cli.main([*words, "--filter", "paper", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    # The declination there is 12.7 degrees.
    assert result["filters"]["vqf"]["mean"]["total"] < 1.0
    assert result["filters"]["paper"]["mean"]["total"] < 1.0
    assert "its class is multirotor" in result["notes"]["takeoff_40s"][0]
    assert result["notes"]["takeoff_40s"][1] == "against SIMSTATE"


def test_attitude_stands_in_for_the_truth_and_says_so(tmp_path: Path) -> None:
    path = rewritten(tmp_path / "flight.tlog", without=mavlink.MAVLINK_MSG_ID_SIMSTATE)
    trial = read(path)
    assert any("against ATTITUDE" in note and "no truth" in note for note in trial.notes)
    assert trial.q_es is not None
    track = run_velocity_aided(trial, Conditions("multirotor", True))
    assert rms(errors(track.q_es, trial.q_es, trial.mask, True), trial.mask).total < 1.5


def test_a_reboot_splits_the_recording(tmp_path: Path, takeoff: Trial) -> None:
    trial = read(rewritten(tmp_path / "twice.tlog", times=2))
    assert any("began anew 1 times" in note for note in trial.notes)
    # The second time the autopilot is known from the start, so no sample comes too early.
    assert len(takeoff.t_us) < len(trial.t_us) < 1.05 * len(takeoff.t_us)
    assert np.diff(trial.t_us).min() > 0


@pytest.mark.thorough
def test_the_same_from_our_own_log(
    tmp_path: Path, takeoff: Trial, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "log.mcap"
    assert cli.main(["replay", str(TAKEOFF), "-o", str(log)]) == 0
    capsys.readouterr()
    again = read(log)
    assert np.array_equal(again.t_us, takeoff.t_us)
    assert np.array_equal(again.w_s, takeoff.w_s)
    assert again.inputs == takeoff.inputs
    assert np.array_equal(again.mask, takeoff.mask)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("notes.txt", "expected an .npz file or a recording"), ("flight.tlog", "not a recording")],
)
def test_a_file_that_is_no_recording(tmp_path: Path, name: str, expected: str) -> None:
    path = tmp_path / name
    path.write_text("nothing of the kind\n")
    with pytest.raises(BadInput, match=expected):
        read(path)


def test_a_recording_without_samples(tmp_path: Path) -> None:
    path = rewritten(tmp_path / "flight.tlog", without=mavlink.MAVLINK_MSG_ID_HEARTBEAT)
    with pytest.raises(BadInput, match="no IMU samples of a known autopilot"):
        read(path)

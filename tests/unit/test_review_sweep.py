"""tools/review_sweep.py: faults do what they are named for, and what is told of them is judged."""

import needs
import numpy as np
import pytest
from made_logs import dataflash, made_flight
from needs import REPOSITORY

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import DEG
from h2nav.recordings.opening import open_flight
from h2nav.recordings.recording import open_recording
from h2nav.recordings.telemetry import read_context

TOOLS = REPOSITORY / "tools"
TAKEOFF = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"


@pytest.fixture(scope="module")
def tool():
    return needs.tool("review_sweep")


@pytest.fixture
def written(tool, tmp_path):
    """Writes a short flight with a fault, from 20 to 30 s, and reads it again."""
    number = 0

    def context(name, size):
        nonlocal number
        number += 1
        path = tmp_path / f"{number}.tlog"
        fault = next((each for each in tool.FAULTS if each.name == name), None)
        case = tool.Case(size, 20.0, 30.0, np.array([0.0, 0.0, 1.0]), 50.0, 1)
        tool.write_tlog(open_recording(TAKEOFF), path, fault, case, only_first=False)
        return read_context(open_recording(path))

    return context


def test_without_a_fault_nothing_is_changed(written):
    for mine, own in zip(
        written("", 0.0).imus, read_context(open_recording(TAKEOFF)).imus, strict=True
    ):
        for one, other in zip(mine, own, strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_bias_is_put_into_the_first_gyro_for_its_time(written):
    plain, faulty = written("", 0.0), written("gyro bias in flight", 2.0)
    extra = faulty.imus[0].w_b - plain.imus[0].w_b
    acts = (plain.imus[0].t_s >= 20.0) & (plain.imus[0].t_s < 30.0)
    np.testing.assert_allclose(extra[acts], [[0.0, 0.0, 2.0 * DEG]] * acts.sum(), atol=0.001)
    assert not extra[~acts].any()
    np.testing.assert_array_equal(faulty.imus[1].w_b, plain.imus[1].w_b)


def test_samples_are_taken_away_and_stamps_moved(written):
    plain = written("", 0.0).imus[0]
    assert len(written("samples missing", 0.5).imus[0].t_s) == len(plain.t_s) - 100
    moved = written("clock jumps", 1.5).imus[0]
    late_us = np.where((plain.t_s >= 20.0) & (plain.t_s < 30.0), 1_500_000, 0)
    np.testing.assert_array_equal(moved.stamp_us - plain.stamp_us, late_us)


def test_the_autopilots_heading_is_turned(written):
    plain, faulty = written("", 0.0).attitudes[0], written("autopilot's heading off", 10.0)
    turn = np.abs((plain.q_nb * faulty.attitudes[0].q_nb).sum(axis=1)).clip(max=1.0)
    angle = 2.0 * np.degrees(np.arccos(turn))
    acts = (plain.t_s >= 20.0) & (plain.t_s < 30.0)
    np.testing.assert_allclose(angle[acts], 10.0, atol=0.1)
    assert angle[~acts].max() < 0.1


# --- logs of the autopilots ---------------------------------------------------------------------


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "made.bin"
    path.write_bytes(dataflash(made_flight(duration_s=30.0)))
    return open_flight(path)


def in_log(tool, log, name, size):
    """Its context with a fault, from 10 to 20 s, and without."""
    fault = next(each for each in tool.FAULTS if each.name == name)
    case = tool.Case(size, 10.0, 20.0, np.array([0.0, 0.0, 1.0]), 50.0, 1)
    return tool.FaultyLog(log, fault, case).context(), log.context()


def test_of_a_log_samples_are_taken_away_with_all_that_they_hold(tool, log):
    faulty, plain = in_log(tool, log, "samples missing", 0.5)
    gone = len(plain.imus[0].t_s) - len(faulty.imus[0].t_s)
    assert gone == pytest.approx(100, abs=2)
    assert faulty.imus[0].device_ids == plain.imus[0].device_ids
    assert len(faulty.imus[1].t_s) == len(plain.imus[1].t_s)


def test_of_a_log_a_compass_shows_in_both_messages_what_its_fault_makes(tool, log):
    faulty, plain = in_log(tool, log, "hard iron in flight", 0.4)
    for mine, own in ((faulty.imus, plain.imus), (faulty.compasses, plain.compasses)):
        acts = (own[0].t_s >= 10.0) & (own[0].t_s < 20.0) & np.isfinite(own[0].m_b_ut[:, 0])
        extra = mine[0].m_b_ut - own[0].m_b_ut
        np.testing.assert_allclose(extra[acts], [[0.0, 0.0, 20.0]] * acts.sum(), atol=1e-6)
        np.testing.assert_array_equal(mine[1].m_b_ut, own[1].m_b_ut)


def test_a_compass_freezes_at_a_reading(tool, log):
    """Most samples of an IMU have none."""
    faulty, plain = in_log(tool, log, "compass frozen", 1.0)
    for mine, own in ((faulty.imus[0], plain.imus[0]), (faulty.compasses[0], plain.compasses[0])):
        known = np.isfinite(own.m_b_ut[:, 0])
        np.testing.assert_array_equal(np.isfinite(mine.m_b_ut[:, 0]), known)
        acts = known & (own.t_s >= 10.0) & (own.t_s < 20.0)
        assert not np.ptp(mine.m_b_ut[acts], axis=0).any()


# --- what is right --------------------------------------------------------------------------------

IMU_1 = Sensor(SensorKind.IMU, 1)


def found(kind, sensor, from_s, to_s):
    return Finding(Kind(kind), sensor, Severity.WARNING, from_s, to_s, 1.0, "", "text", "evidence")


def test_right_is_the_kind_of_the_sensor_at_its_time(tool):
    fault = next(each for each in tool.FAULTS if each.name == "gyro bias in flight")
    case = tool.Case(2.0, 50.0, tool.FOREVER, np.array([1.0, 0.0, 0.0]), 50.0, 1)
    assert tool.is_right(found("gyro_bias_step", IMU_1, 45.0, 55.0), fault, case)
    assert not tool.is_right(
        found("gyro_bias_step", Sensor(SensorKind.IMU, 2), 45.0, 55.0), fault, case
    )
    assert not tool.is_right(found("gyro_bias_step", IMU_1, 30.0, 55.0), fault, case)
    assert not tool.is_right(
        found("compass_field", Sensor(SensorKind.COMPASS), 50.0, 55.0), fault, case
    )


def test_what_the_flight_says_without_the_fault_is_not_held_against_it(tool):
    case = tool.Case(2.0, 50.0, tool.FOREVER, np.array([1.0, 0.0, 0.0]), 50.0, 1)
    usual = found("imu_slow", IMU_1, 0.0, 100.0)
    plain = tool.Outcome("flight", "", case, [usual])
    faulty = tool.Outcome(
        "flight",
        "gyro bias in flight",
        case,
        [
            usual,
            found("gyro_bias", IMU_1, 52.0, 100.0),
            found("gps_lag", Sensor(SensorKind.GPS), 0.0, 100.0),
        ],
    )
    (row,) = tool.judged([plain, faulty])
    assert [words.split()[2] for words in row["right"]] == ["gyro_bias"]
    assert [words.split()[2] for words in row["beside"]] == ["gps_lag"]


def test_recordings_of_one_name_are_not_compared_with_each_other(tool, monkeypatch):
    tasks: list = []
    monkeypatch.setattr(tool, "results", lambda _, given: tasks.extend(given) or ())
    monkeypatch.setattr("sys.argv", ["sweep", "a/1.bin", "b/1.bin", "--fault", "gyro"])
    tool.main()
    assert len({task.flight for task in tasks}) == 2
    assert len({(task.path, task.flight) for task in tasks}) == 2

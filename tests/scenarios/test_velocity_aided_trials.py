"""The default filter on recorded trials: the accuracy that the project promises, as bounds."""

import statistics
from pathlib import Path

import pytest
from needs import shared_data

from h2nav.evaluation.dataset.filters import Conditions
from h2nav.evaluation.dataset.scores import TrialScore, TrialTask, score_task
from h2nav.recordings.trials import read_trial

MAGNETIC_DECLINATION_DEG = 12.69  # of the simulated flights' truth, which points to magnetic north


def score(path: Path, conditions: Conditions) -> tuple[float, float, float]:
    found: TrialScore = score_task(TrialTask(path, read_trial, path.stem, "default", conditions))
    assert found.rms_deg is not None, found.remark
    return found.rms_deg


def test_broad_total_and_inclination() -> None:
    paths = sorted(shared_data("imu").glob("broad__*.npz"))
    assert len(paths) == 8
    rows = [score(path, Conditions("handheld")) for path in paths]
    assert statistics.fmean(row[0] for row in rows) <= 1.95
    assert statistics.fmean(row[2] for row in rows) <= 0.64


def test_tum_vi_inclination() -> None:
    paths = [shared_data(f"imu/tumvi__room{room}.npz") for room in (1, 4)]
    rows = [score(path, Conditions("handheld")) for path in paths]
    assert statistics.fmean(row[2] for row in rows) <= 0.62


@pytest.mark.parametrize(
    ("name", "total_deg", "inclination_deg"),
    [("calm", 1.0, 0.5), ("magnet_vibration", 3.29, 1.0)],
)
def test_simulated_flights_without_gps(name: str, total_deg: float, inclination_deg: float) -> None:
    found = score(shared_data(f"imu/sitl__{name}.npz"), Conditions("multirotor"))
    assert found[0] <= total_deg
    assert found[2] <= inclination_deg


@pytest.mark.parametrize(
    ("name", "total_deg", "inclination_deg"),
    [("calm", 0.4, 0.14), ("magnet_vibration", 1.0, 0.25)],
)
def test_simulated_flights_with_gps(name: str, total_deg: float, inclination_deg: float) -> None:
    conditions = Conditions("multirotor", True, MAGNETIC_DECLINATION_DEG)
    found = score(shared_data(f"imu/sitl__{name}.npz"), conditions)
    assert found[0] <= total_deg
    assert found[2] <= inclination_deg


@pytest.mark.parametrize(("speed_m_s", "inclination_deg"), [(None, 1.6), (0.0, 2.4)])
def test_fixed_wing_inclination(speed_m_s: float | None, inclination_deg: float) -> None:
    conditions = Conditions("fixed-wing", cruise_speed_m_s=speed_m_s)
    found = score(shared_data("imu/uav_gpsins__thor_flight75.npz"), conditions)
    assert found[2] <= inclination_deg


def test_real_copters_keep_to_their_autopilots() -> None:
    """Whose attitude is the only truth of these logs: what leaves it by more has to say why."""
    paths = sorted(shared_data("imu-2/ardupilot_real").glob("*.npz"))
    assert len(paths) == 3
    rows = [score(path, Conditions("multirotor")) for path in paths]
    assert statistics.fmean(row[0] for row in rows) <= 6.0
    spark = score(shared_data("imu/uav_ardupilot__copter35_spark404.npz"), Conditions("handheld"))
    assert spark[0] <= 4.6


def test_euroc_heading() -> None:
    paths = sorted(shared_data("imu-2/euroc").glob("*.npz"))
    assert len(paths) == 3
    rows = [score(path, Conditions("multirotor")) for path in paths]
    assert statistics.fmean(row[1] for row in rows) <= 0.9

"""Flights of a real PX4 through the service, against the simulator's truth on PX4's own clock."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from needs import shared_data
from replayed import QuicklyReplayed

from h2nav.apps.configuration import Configuration
from h2nav.maths.attitude_errors import errors, root_mean_square
from h2nav.maths.rows import from_euler

pytestmark = pytest.mark.thorough


def total_deg(replayed: QuicklyReplayed, truth: Path) -> float:
    """Rms angle of the whole error of the estimates that have a truth within a sample of it."""
    rows = np.genfromtxt(truth, delimiter=",", skip_header=1, usecols=range(5))
    ours = np.array([(r.t_us, r.roll_deg, r.pitch_deg, r.yaw_deg) for r in replayed.estimates])
    ours = ours[(ours[:, 0] > rows[0, 0]) & (ours[:, 0] < rows[-1, 0])]
    nearest = np.searchsorted(rows[:, 0], ours[:, 0])
    found = errors(
        from_euler(np.radians(ours[:, 1:])), rows[nearest, 1:], np.ones(len(ours), dtype=bool), True
    )
    return root_mean_square(found.total)


@pytest.mark.parametrize(("imu_message", "most_deg"), [("auto", 2.3), ("SCALED_IMU", 12.0)])
def test_a_hard_iron_that_px4_has_calibrated_away_is_none(imu_message, most_deg):
    """100 mG in the raw field: EKF2 is wrong by 3.3 deg."""
    chosen = Configuration()
    autopilot = dataclasses.replace(chosen.autopilot, imu_message=imu_message)
    recording = shared_data("flights/px4_hard_iron.tlog")
    replayed = QuicklyReplayed(recording, dataclasses.replace(chosen, autopilot=autopilot))
    truth = shared_data("flights/px4_hard_iron_truth.csv")
    assert 0.5 * most_deg < total_deg(replayed, truth) < most_deg
    is_alone = imu_message == "SCALED_IMU"
    assert replayed.pipeline.service.health.independent == is_alone
    said = [text for _, text in replayed.notices if "not independent" in text]
    assert said == ([] if is_alone else [
        "not independent: the field of HIGHRES_IMU holds the autopilot's own estimate"
    ])  # fmt: skip

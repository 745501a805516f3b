"""Errors beyond what a filter knows: opened, kept, faded and bounded."""

import math

import pytest

from h2nav.attitude.samples import AttitudeEstimate, SensorCorrection, SensorErrors, Trust
from h2nav.integrity.causes import DECIDED, Cause, Explained
from h2nav.integrity.corrected_sensor import CorrectedSensor
from h2nav.integrity.findings import Kind, Sensor, SensorKind
from h2nav.integrity.opened_errors import OpenedErrors, shown_by_difference

S = 1_000_000
G = 9.80665
ESTIMATE = AttitudeEstimate(
    7, (1.0, 0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0), 0.03,
    Trust.ALIGNED, 0.12,
)  # fmt: skip


def opened(errors):
    """Tilt and heading beyond those of the filter, rad."""
    found = errors.of(ESTIMATE)
    assert type(found) is AttitudeEstimate
    kept = {"sigma_tilt_rad": 0.0, "sigma_heading_rad": 0.0}
    assert found._replace(**kept) == ESTIMATE._replace(**kept)
    more = (
        math.sqrt(max(found.sigma_tilt_rad**2 - 0.03**2, 0.0)),
        math.sqrt(max(found.sigma_heading_rad**2 - 0.12**2, 0.0)),
    )
    assert errors.is_any == (max(more) > 1e-9)
    return pytest.approx(more, abs=1e-6)


def test_what_was_missed_at_once_stays_until_a_correction():
    errors = OpenedErrors()
    assert errors.of(ESTIMATE) is ESTIMATE
    errors.open(0.04, 0.0)
    assert opened(errors) == (0.04, 0.0)
    errors.open(0.01, 0.5)
    assert opened(errors) == (0.04, 0.5)
    errors.correct(0.02)
    assert opened(errors) == (0.02, 0.5)
    errors.correct(0.0, 0.3)
    assert opened(errors) == (0.0, 0.3)
    errors.correct(0.0, 0.0)
    assert errors.of(ESTIMATE) is ESTIMATE


def test_errors_that_are_shown_no_more_fade_within_ten_seconds():
    errors = OpenedErrors()
    errors.judge([0.1, 0.4], [0.2])
    assert opened(errors) == (0.4, 0.2)
    for _ in range(50):  # of a fifth of a second
        errors.judge([], [])
    assert opened(errors) == (0.4 / math.e, 0.2 / math.e)
    errors.judge([0.1], [9.0])
    assert opened(errors) == (0.4 * math.exp(-1.02), math.pi)
    errors.judge([9.0], [])
    assert opened(errors) == (math.pi, math.pi * math.exp(-0.02))


def test_a_suspected_drift_opens_the_tilt_by_which_it_would_bend():
    errors = OpenedErrors()
    errors.suspect_drift(20 * S, 0.2, is_suspicious=False)
    assert opened(errors) == (0.0, 0.0)
    errors.suspect_drift(20 * S, 0.2, is_suspicious=True)
    assert opened(errors) == (0.2 / G, 0.0)
    errors.suspect_drift(30 * S - 1, 0.3, is_suspicious=False)
    assert opened(errors) == (0.3 / G, 0.0)
    errors.suspect_drift(30 * S, 0.4, is_suspicious=False)
    assert opened(errors) == (0.3 / G, 0.0)
    errors.open(0.01, 0.0)  # the larger of both
    assert opened(errors) == (0.3 / G, 0.0)
    errors.open(0.05, 0.0)
    assert opened(errors) == (0.05, 0.0)


def test_a_drift_is_bounded_by_the_speed_of_the_vehicle():
    """A constant one of the tilt e leaves the speed v after v / (g e) seconds."""
    errors = OpenedErrors()
    errors.suspect_drift(S, 0.05 * G, is_suspicious=True)
    for _ in range(100):  # 20 s
        errors.bound_drift(15.0)
    assert opened(errors) == (1.0 / (1.0 / 0.05 + 20.0 * G / 15.0), 0.0)


# --- a sensor that was corrected ------------------------------------------------------------------

GYRO = Explained(math.log(DECIDED) + 1.0, ((Cause.GYRO, 0.9999),), step=0.2)
ACCELEROMETER = Explained(math.log(DECIDED) + 1.0, ((Cause.ACCELEROMETER, 0.9999),), step=1.0)
IMU = Sensor(SensorKind.IMU, 2)


class Row:
    """The row of a window in which a bias was right."""

    def __init__(self, rate_b=(0.0, 0.0, 0.0), force_b=(0.0, 0.0, 0.0)):
        self.errors = SensorErrors((0.0, 0.0, 0.0), force_b)
        self.begun = self.moment = self
        self.bias_b = rate_b


def off(force_b=(0.0, 0.0, 0.0)):
    nothing = (0.0, 0.0, 0.0)
    return SensorCorrection(nothing, force_b, nothing, nothing, (0.0, 0.0), 0.0, 0.0)


@pytest.mark.parametrize(("left", "is_told"), [(0.49, False), (0.51, True)])
def test_it_is_told_while_half_of_it_is_there(left, is_told):
    gyro = CorrectedSensor()
    gyro.take(Cause.GYRO, GYRO, off(), Row((0.0, 0.03, 0.0)), 5 * S)
    gyro.review(Row(force_b=(9.0, 9.0, 9.0)).errors, (0.0, 0.03 + left * 0.2, 0.0))
    assert bool(gyro.alarms(IMU, 9 * S, ())) == is_told
    force = CorrectedSensor()
    force.take(Cause.ACCELEROMETER, ACCELEROMETER, off(), Row(force_b=(0.1, 0.0, 0.0)), 5 * S)
    force.review(Row(force_b=(0.1 - left, 0.0, 0.0)).errors, (9.0, 9.0, 9.0))
    assert bool(force.alarms(IMU, 9 * S, ())) == is_told


def test_what_is_told_of_it():
    made = CorrectedSensor()
    made.review(Row().errors, (0.0, 0.0, 0.0))
    assert made.alarms(IMU, 9 * S, ()) == []
    made.take(Cause.GYRO, GYRO, off(), Row(), 5 * S)
    (alarm,) = made.alarms(IMU, 9 * S, ())
    assert (alarm.kind, alarm.sensor, alarm.since_s) == (Kind.GYRO_BIAS_STEP, IMU, 4.0)
    assert made.alarms(IMU, 9 * S, (Cause.GYRO,)) == []
    made.take(Cause.GYRO, GYRO._replace(is_seen=False), off(), Row(), 5 * S)
    assert made.alarms(IMU, 9 * S, ()) == []


def test_a_second_correction_counts_from_the_first():
    made = CorrectedSensor()
    made.take(Cause.GYRO, GYRO, off((0.1, 0.0, 0.2)), Row((0.0, 0.0, 0.01)), 5 * S)
    made.take(Cause.GYRO, GYRO, off((0.0, 0.3, 0.1)), Row((0.0, 0.0, 0.21)), 7 * S)
    assert made.force_b == pytest.approx((0.1, 0.3, 0.3))
    made.review(Row().errors, (0.0, 0.0, 0.21))
    (alarm,) = made.alarms(IMU, 9 * S, ())
    assert alarm.since_s == 4.0
    made.take(Cause.ACCELEROMETER, ACCELEROMETER, off(), Row(force_b=(0.5, 0.0, 0.0)), 8 * S)
    (alarm,) = made.alarms(IMU, 9 * S, ())
    assert (alarm.kind, alarm.since_s) == (Kind.ACCELEROMETER_BIAS_STEP, 4.0)
    made.review(Row(force_b=(0.6, 0.0, 0.0)).errors, (0.0, 0.0, 0.0))
    assert made.alarms(IMU, 9 * S, ()) == []


@pytest.mark.parametrize(
    ("apart", "first", "second", "found"),
    [
        (1.0, 0.3, 0.4, (0.0, 0.0)),
        (1.001, 0.3, 0.4, (0.6006, 0.8008)),
        (2.0, 0.0, 0.5, (0.0, 2.0)),
        (2.0, 0.0, 0.0, (0.0, 0.0)),
        (math.nan, 0.3, 0.4, (0.0, 0.0)),
        (2.0, math.nan, 0.4, (0.0, 0.0)),
    ],
)
def test_two_attitudes_that_differ_by_more_than_they_allow_are_off_by_their_shares(
    apart, first, second, found
):
    assert shown_by_difference(apart, first, second) == pytest.approx(found)

"""What is said of an attitude that is contradicted: just enough and just too little."""

import math
from types import SimpleNamespace

import pytest

from h2nav.attitude.samples import VelocityFix
from h2nav.integrity.contradiction_alarms import (
    field_alarm,
    force_alarm,
    force_size_alarm,
    no_velocity,
    turn_alarm,
    velocity_alarm,
)
from h2nav.integrity.findings import Kind, Sensor, SensorKind, Severity
from h2nav.integrity.force_size import ForceError
from h2nav.integrity.velocity_windows import Window
from h2nav.maths.units import DEG, GRAVITY_M_S2

LOST_M_S = 10.0 * GRAVITY_M_S2  # in ten seconds without any force


@pytest.mark.parametrize(
    ("tilt_deg", "told_deg", "explained"),
    [(30.0, 30.0, "30 deg of tilt"), (89.4, 89.4, "89 deg"), (90.1, 90.0, "as no tilt would")],
)
def test_a_velocity_is_explained_by_a_tilt_below_a_right_angle(tilt_deg, told_deg, explained):
    residual_m_s = 3.0 * GRAVITY_M_S2 * tilt_deg * DEG
    alarm = velocity_alarm(Window(3.0, residual_m_s, 0.1, 5.0, True), 2.0)
    assert (alarm.kind, alarm.severity, alarm.degrades) == (
        Kind.ATTITUDE_VELOCITY,
        Severity.ERROR,
        True,
    )
    assert (alarm.size, alarm.since_s) == (pytest.approx(told_deg), 2.0)
    assert f"{residual_m_s:.1f} m/s in 3 s" in alarm.evidence
    assert explained in alarm.evidence


def test_a_window_that_is_gone_still_has_an_alarm():
    assert velocity_alarm(None, 2.0).size == 0.0


@pytest.mark.parametrize(
    ("change_n", "share", "is_by_size"),
    [
        ((0.0, 0.0, -30.0), 1.0, True),  # no attitude lifts
        ((50.0, 0.0, -0.1), 1.0, True),
        ((0.0, 0.0, 30.0), 1.0, False),  # a fall with a force of the right size
        # half of the fall is missing from the force
        ((0.0, 0.0, 0.5 * LOST_M_S), 0.74, True),
        ((0.0, 0.0, 0.5 * LOST_M_S), 0.76, False),
        # by an attitude that is wrong by a right angle it falls and is carried off alike
        ((0.99 * LOST_M_S, 0.0, 0.5 * LOST_M_S), 0.5, True),
        ((0.0, 1.01 * LOST_M_S, 0.5 * LOST_M_S), 0.5, False),
        # what 80 mg explain, as the alarm fades, accuses no accelerometer
        ((0.0, 0.0, -0.079 * LOST_M_S), 1.0, False),
        ((0.0, 0.0, -0.081 * LOST_M_S), 1.0, True),
        ((1.7, -1.4, 1.4), 0.99, False),
    ],
)
def test_a_force_contradicts_gravity_by_its_direction_or_its_size(change_n, share, is_by_size):
    alarm = force_alarm(change_n, share * GRAVITY_M_S2, 1.0)
    assert (alarm.is_decided, alarm.text.startswith("force")) == (is_by_size, is_by_size)
    assert ("the accelerometer is wrong" in alarm.evidence) == is_by_size
    assert ("m/s up" in alarm.evidence) == (change_n[2] < 0.0)
    sideways = math.hypot(change_n[0], change_n[1])
    assert alarm.size == pytest.approx(sideways / LOST_M_S / DEG)


@pytest.mark.parametrize(
    ("is_scale", "share", "text"),
    [
        (False, 0.15, "accelerometer is off by 1.5 m/s^2"),
        (True, 0.15, "accelerometer's scale is off by 15%"),
        (True, -0.15, "accelerometer's scale is off by 15%"),
    ],
)
def test_a_force_of_another_size(is_scale, share, text):
    imu = Sensor(SensorKind.IMU, 2)
    alarm = force_size_alarm(ForceError(1.5, share, is_scale), imu, 3.0)
    assert (alarm.text, alarm.sensor, alarm.size, alarm.since_s) == (text, imu, 1.5, 3.0)
    assert f"{share:+.0%} along it" in alarm.evidence
    assert alarm.is_decided
    assert not alarm.degrades


def test_a_turn_of_the_field():
    alarm = turn_alarm(20.0 * DEG, 10, 4.0)
    assert (alarm.kind, alarm.size, alarm.degrades) == (Kind.GYRO_FIELD, pytest.approx(20.0), True)
    assert "20 deg in space in 10 s" in alarm.evidence


@pytest.mark.parametrize("heading_deg", [-40.0, 40.0, 5.0])
@pytest.mark.parametrize("matters", [False, True])
@pytest.mark.parametrize("has_norm", [False, True])
def test_a_field_that_is_not_the_earths(heading_deg, matters, has_norm):
    field = SimpleNamespace(
        heading_error_rad=heading_deg * DEG,
        dip_error_rad=-12.0 * DEG,
        norm_share=1.3,
        has_norm=has_norm,
    )
    alarm = field_alarm(field, None, matters=matters, since_s=1.0)
    assert alarm.size == pytest.approx(max(abs(heading_deg), 12.0))
    assert alarm.degrades == matters
    assert alarm.severity is (Severity.ERROR if matters else Severity.WARNING)
    # That the attitude is wrong is said of a field of the right size only.
    assert alarm.text.startswith("attitude") == (matters and has_norm)
    assert f"heading {heading_deg:+.0f} deg, dip -12 deg, norm 130%" in alarm.evidence
    turned = field_alarm(field, (30.0 * DEG, 1), matters=matters, since_s=1.0)
    assert turned.evidence.endswith(alarm.evidence)
    assert "turned by 30 deg in space in 1 s" in turned.evidence


@pytest.mark.parametrize(
    ("is_independent", "kind"), [(True, SensorKind.GPS), (False, SensorKind.AUTOPILOT)]
)
def test_velocities_that_do_not_come(is_independent, kind):
    alarm = no_velocity(VelocityFix(0, (0.0, 0.0, 0.0), 0.1, is_independent), 5.0)
    assert (alarm.sensor.kind, alarm.size, alarm.since_s) == (kind, 5.0, 5.0)
    assert not alarm.degrades

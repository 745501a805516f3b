"""The worst draws of a campaign, shrunk: whom a fault accuses, how soon, and what it does."""

import pytest

from h2nav.apps.campaign_flights import fly
from h2nav.evaluation.campaign.draw import CompassDraw, Draw, FlightDraw, ImuDraw, ReceiverDraw

pytestmark = pytest.mark.timeout(600)


def flown(fault: str, length_min: float = 1.9, **imu):
    """The result, and that of its only fault, which begins after 70 s."""
    calm = FlightDraw(length_min=length_min, rest_s=15.0, brisk_share=0.0)
    row = fly(Draw(1, calm, ImuDraw(**({"rate_hz": 50.0} | imu)), faults=(fault,)))
    (found,) = row["faults"]
    return row, found


def kinds(found) -> set[str]:
    return {told["kind"] for told in found["accused"]}


@pytest.mark.thorough
def test_an_accelerometer_off_by_3_is_named_within_three_seconds_and_alone():
    _, found = flown("accel-bias=3@70.0+20")
    assert found["outcome"] == "right"
    assert found["named_after_s"] < 3.0
    assert kinds(found) == set()


@pytest.mark.thorough
@pytest.mark.parametrize("vibration_m_s2", [1.0, 7.5])
def test_a_spoofed_velocity_stays_out_for_as_long_as_it_is_false(vibration_m_s2):
    """It was fused again when its beginning had left the window of 10 s: 10 deg of tilt."""
    imu = {"rate_hz": 100.0, "vibration_m_s2": vibration_m_s2}
    row, found = flown("gps-ramp=1.5@70.0+60", length_min=2.1, **imu)
    assert found["outcome"] == "right"
    assert kinds(found) == set()
    assert row["tilt_deg"]["p50"] < 1.5
    assert row["tilt_wrong_s"] < 5.0


@pytest.mark.thorough
@pytest.mark.parametrize(("step_m_s", "vibration_m_s2"), [(2.0, 1.0), (4.0, 4.0)])
def test_a_step_of_the_velocity_is_named_with_its_position(step_m_s, vibration_m_s2):
    """Beside vibration it might have been a blow that samples miss, and nobody was named."""
    imu = {"rate_hz": 100.0, "vibration_m_s2": vibration_m_s2}
    _, found = flown(f"gps-step={step_m_s}@70.0+20", **imu)
    assert found["outcome"] == "right"
    assert found["named_after_s"] < 2.0
    assert kinds(found) == set()


@pytest.mark.thorough
def test_a_plane_that_takes_off_without_a_heading_has_sound_sensors():
    """Speeding up into an unknown direction was an accelerometer that is off: 27 deg of tilt."""
    calm = FlightDraw("plane", 8.933, 52.84, 1.397, 0.3835, 5.356, 0.5352, -1.481)
    late = ReceiverDraw(delay_s=0.3517, noise_m_s=0.074, multipath_m_s=0.18)
    row = fly(Draw(631, calm, ImuDraw(rate_hz=50.0), compass=CompassDraw(count=0), receiver=late))
    assert row["false_accusations"] == []
    assert row["tilt_deg"]["p95"] < 3.0


def test_a_plane_that_takes_off_from_steel_has_sound_sensors_and_a_heading():
    """Speeding up by a heading that steel had turned was an accelerometer that is off."""
    calm = FlightDraw("plane", 1.4, 20.0, 0.5309, 0.8253, 1.056, 0.5387, 55.03)
    steel = CompassDraw(steel_ut=25.0, motor_ut=9.5)
    row = fly(Draw(3, calm, ImuDraw(rate_hz=50.0), compass=steel))
    assert row["false_accusations"] == []
    assert row["heading_wrong_s"] == row["tilt_wrong_s"] == 0.0
    assert row["tilt_deg"]["p95"] < 2.0


@pytest.mark.parametrize("seed", [1, pytest.param(3, marks=pytest.mark.thorough)])
def test_a_magnet_in_the_air_turns_no_heading(seed):
    """It was believed after 20 s, and the heading was off by 70 and 80 deg."""
    calm = FlightDraw(length_min=2.8, rest_s=15.0, brisk_share=0.0, manoeuvre_m_s2=2.0)
    row = fly(Draw(seed, calm, ImuDraw(rate_hz=50.0), faults=("hard-iron=25@70.0+60",)))
    (found,) = row["faults"]
    assert found["outcome"] == "right"
    assert kinds(found) == set()
    assert row["heading_deg"]["p100"] < 5.0


@pytest.mark.thorough
def test_a_step_of_one_metre_a_second_is_named_within_three_seconds():
    _, found = flown("gps-step=1@70.0+20", rate_hz=100.0)
    assert found["outcome"] == "right"
    assert found["named_after_s"] < 3.0
    assert kinds(found) == set()


@pytest.mark.thorough
def test_a_drift_that_an_accelerometers_bias_could_be_is_named_since_the_force_does_not_step():
    row, found = flown("gps-ramp=0.5@70.0+20", rate_hz=100.0)
    assert found["outcome"] in ("right", "late")
    assert found["named_after_s"] < 20.0
    assert kinds(found) == set()
    assert row["tilt_deg"]["p50"] < 1.0


@pytest.mark.thorough
def test_a_drift_that_leaves_no_trace_in_ten_seconds_is_told_by_a_longer_window():
    _, found = flown("gps-ramp=0.3@70.0+30", rate_hz=100.0)
    assert found["outcome"] in ("right", "late", "undecided")
    assert found["after_s"] < 30.0
    assert kinds(found) == set()


@pytest.mark.thorough
def test_the_receiver_is_not_lost_while_a_gyro_is_frozen():
    _, found = flown("gyro-frozen@70.0+15")
    assert found["outcome"] == "right"
    assert kinds(found) == set()


@pytest.mark.thorough
def test_a_ramp_in_strong_vibration_accuses_nobody_else():
    """The force's samples scatter by metres a second, its mean by tenths."""
    noisy = ReceiverDraw(rate_hz=1.0, delay_s=0.3, noise_m_s=0.035)
    calm = FlightDraw(length_min=1.7, rest_s=15.0, brisk_share=0.0)
    shaken = ImuDraw(count=2, rate_hz=50.0, vibration_m_s2=15.0)
    row = fly(Draw(1, calm, shaken, receiver=noisy, faults=("gps-ramp=1.4@70.0+20",)))
    (found,) = row["faults"]
    assert found["outcome"] in ("right", "undecided", "late")
    assert kinds(found) == set()


@pytest.mark.thorough
def test_an_attitude_lost_by_a_gyro_in_other_units_is_found_when_they_are_back():
    """It stayed 78 deg off until the end of the flight, and said so."""
    ground = FlightDraw("rover", 2.321, 30.9, 3.56, 0.3769, 7.361, 0.4879, -3.242)
    imu = ImuDraw(rate_hz=100.0, count=1)
    row = fly(Draw(1401, ground, imu, faults=("gyro-deg@86.3+20/1",)))
    assert row["heading_wrong_s"] < 10.0
    assert row["tilt_wrong_s"] < 10.0

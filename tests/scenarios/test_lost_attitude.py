"""An attitude that is wrong by far: clipped gyros, contradicting fixes, a start in mid-air."""

import dataclasses
import math

import pytest
from simulated_flight import SIMULATED, SimulatedFlight

from h2nav.attitude.samples import ImuSample, Trust, VehicleState, VelocityFix
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.shell import HEAD_SIZE
from h2nav.files import gain_files
from h2nav.service.settings import AidingSettings

RAW = dataclasses.replace(
    SIMULATED, autopilot=dataclasses.replace(SIMULATED.autopilot, imu_message="RAW_IMU")
)
WITHOUT_GPS = dataclasses.replace(RAW, aiding=AidingSettings(gps_velocity=False))
GAINS = "multirotor_100hz"
STEP_US = 10_000
WRONG = math.radians(60.0)


def level_tilt_deg(estimate):
    _, x, y, _ = estimate.q_nb
    return math.degrees(math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y)))))


def tampered(is_aided, on_ground):
    """Rest for 5 s, then the attitude in the filter's memory is rolled by 60 deg; goes on 6 s."""
    attitude_filter = VelocityAidedFilter(velocity_aided_gains(gain_files.load(GAINS), GAINS))
    attitude_filter.use_vehicle(VehicleState(on_ground=on_ground))
    estimates = []
    for number in range(1100):
        t_us = 1_000_000 + number * STEP_US
        if number == 500:
            state = attitude_filter.state()
            values = list(state.values)
            values[HEAD_SIZE : HEAD_SIZE + 4] = [math.cos(WRONG / 2), math.sin(WRONG / 2), 0.0, 0.0]
            attitude_filter.restore(state._replace(values=tuple(values)))
        if is_aided and number % 20 == 10:
            attitude_filter.use_velocity(VelocityFix(t_us - STEP_US, (0.0, 0.0, 0.0), 0.1))
        # Vibration of 2 m/s^2 hides the rest: fixes and force are then the witnesses.
        shake = (2.0 if number % 2 else -2.0) if is_aided else 0.0
        sample = ImuSample(t_us, (0.0, 0.0, 0.0), (0.0, 0.0, shake - 9.80665), (20.0, 0.0, 45.0))
        estimates.append(attitude_filter.update(sample))
    return estimates


@pytest.mark.parametrize("on_ground", [True, False, None])
@pytest.mark.parametrize("is_aided", [True, False])
def test_a_wrong_attitude_is_found_out(is_aided, on_ground):
    """60 deg at rest: right to a degree within 4 s."""
    estimates = tampered(is_aided, on_ground)
    assert level_tilt_deg(estimates[499]) < 0.1
    assert any(estimate.trust & Trust.RESTARTED for estimate in estimates[500:])
    if is_aided:
        assert level_tilt_deg(estimates[505]) > 50.0
        assert max(math.degrees(e.sigma_tilt_rad) for e in estimates[500:900]) > 30.0
    assert max(level_tilt_deg(e) for e in estimates[900:]) < 1.0


@pytest.mark.parametrize("configuration", [RAW, WITHOUT_GPS], ids=["gps", "no-gps"])
def test_a_clipped_gyro_in_hover(configuration):
    """0.3 s at the end of the range: the tilt's deviation says so, and it is mended in 10 s."""
    flight = SimulatedFlight(
        "hover", faults=("saturate=gyro-x@10+0.3",), configuration=configuration
    ).run(22.0)
    during = flight.estimates_between(10.2, 10.4)
    assert max(record.sigma_tilt_deg for record in during) > 45.0
    truth_free = flight.estimates_between(20.0, 22.0)
    assert max(math.hypot(r.roll_deg, r.pitch_deg) for r in truth_free) < 15.0


def test_samples_that_are_not_later_change_nothing():
    attitude_filter = VelocityAidedFilter(velocity_aided_gains(gain_files.load(GAINS), GAINS))
    sample = ImuSample(1_000_000, (0.1, 0.0, 0.0), (0.0, 0.0, -9.8), (20.0, 0.0, 45.0))
    assert attitude_filter.update(sample) is None
    assert attitude_filter.update(sample) is None
    for number in range(1, 50):
        last = attitude_filter.update(sample._replace(t_us=1_000_000 + number * STEP_US))
    state = attitude_filter.state()
    for t_us in (last.t_us, last.t_us - 1, 0):
        again = attitude_filter.update(sample._replace(t_us=t_us))
        assert (again.t_us, again.q_nb) == (last.t_us, last.q_nb)
        assert attitude_filter.state() == state

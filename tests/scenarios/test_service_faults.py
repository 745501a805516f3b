"""Faults between the sensors and the service, on the fake autopilot and a manual clock.

Each docstring states what is promised. Rows are those of the table in docs/faults.md.
"""

import dataclasses
import functools
import itertools
import math

import pytest
from lanes import few
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from simulated_flight import SIMULATED, SimulatedFlight

from h2nav.apps.configuration import FilterSettings
from h2nav.sim.personalities import PX4

# Arithmetics of the default one; what differs between them is below the service.
FILTERS = ("float", pytest.param("fixed", marks=pytest.mark.thorough))


def configured(**sections):
    return dataclasses.replace(SIMULATED, **sections)


def filtered(name, message="auto"):
    return configured(
        filter=FilterSettings(arithmetic=name),
        autopilot=dataclasses.replace(SIMULATED.autopilot, imu_message=message),
    )


def all_finite(flight):
    return all(
        math.isfinite(value)
        for _, record in flight.seen.estimates
        for name, value in record._asdict().items()
        if name not in ("sigma_tilt_deg", "sigma_heading_deg")
    )


def assert_time_grows(records):
    times = [record.t_us for record in records]
    assert all(before < after for before, after in itertools.pairwise(times))


@functools.cache
def calm(name):
    return SimulatedFlight("flight", configuration=filtered(name)).run(15.0)


@pytest.mark.parametrize("name", FILTERS)
def test_a_calm_flight_is_estimated_well(name):
    """No fault: active within half a second, every sample used, tilt within half a degree."""
    flight = calm(name)
    assert flight.seen.states[-1][1] == "active"
    assert next(t_s for t_s, state in flight.seen.states if state == "active") < 1.5
    errors = flight.errors()
    assert errors.tilt < 0.5
    assert errors.yaw < 2.0
    assert flight.health.samples_used > 1400
    assert sum(flight.rejected.values()) == 0


@pytest.mark.parametrize("reboot_s", few(1, [5, 6, 10]))
@pytest.mark.parametrize("name", FILTERS)
def test_reboot(name, reboot_s):
    """3: reboot event, new epoch, no negative dt, streams asked for again, estimate within 2 s."""
    faults = (f"reboot@{reboot_s}",)
    end_s = reboot_s + 7.0
    flight = SimulatedFlight("rest", faults=faults, configuration=filtered(name)).run(end_s)
    told_s = flight.first("rebooted")
    assert told_s is not None
    back_s = next(t_s for t_s, _ in flight.seen.estimates if t_s > told_s)
    # One second of silence, then the streams have to be asked for, then the alignment.
    assert back_s < reboot_s + 1.0 + 2.0
    assert_time_grows(flight.estimates_between(0.0, reboot_s))
    assert_time_grows(flight.estimates_between(told_s, end_s))
    asked = [t_s for t_s, m in flight.seen.sent if type(m).__name__ == "COMMAND_LONG"]
    assert any(t_s > reboot_s + 1.0 for t_s in asked)
    assert flight.seen.states[-1][1] == "active"
    assert abs(flight.seen.estimates[-1][1].roll_deg) < 1.0


@pytest.mark.parametrize(("clock", "message"), [("ms", "SCALED_IMU"), ("us", "RAW_IMU")])
def test_clock_wrap(clock, message):
    """4: a 32-bit clock passing its end is no reboot, and the steps stay as they were."""
    configuration = filtered("float", message)
    flight = SimulatedFlight(
        "rest", faults=(f"clock-wrap={clock}@5",), configuration=configuration
    ).run(10.0)
    assert flight.first("rebooted") is None
    records = flight.estimates_between(1.0, 10.0)
    assert_time_grows(records)
    steps_us = {after.t_us - before.t_us for before, after in itertools.pairwise(records)}
    assert max(steps_us) < 30_000
    assert len(records) > 850


@pytest.mark.parametrize("name", FILTERS)
def test_duplicates_reordering_and_delay(name):
    """7: nothing is integrated twice; each is counted; the attitude stays right."""
    faults = ("duplicate=0.2@0", "reorder=0.1@0", "delay=30@0")
    flight = SimulatedFlight("flight", faults=faults, configuration=filtered(name)).run(15.0)
    assert flight.rejected["duplicate"] > 100
    assert flight.rejected["late"] > 20
    assert_time_grows([record for _, record in flight.seen.estimates])
    assert flight.errors().tilt < 1.5


@pytest.mark.parametrize("name", FILTERS)
def test_loss(name):
    """8: a tenth of the samples lost costs little, because the true dt is used."""
    lossy = SimulatedFlight("flight", faults=("drop=0.1@0",), configuration=filtered(name))
    errors, without_loss = lossy.run(15.0).errors(), calm(name).errors()
    assert errors.tilt < without_loss.tilt + 0.3
    assert errors.yaw < without_loss.yaw + 1.0


@pytest.mark.thorough
def test_where_many_samples_are_lost_rates_are_of_their_steps():
    """The rate at the end of a step that is longer than usual is not its mean: 0.8 deg."""
    lossy = SimulatedFlight("aggressive", faults=("drop=0.3@0",)).run(24.0)
    assert lossy.reference.table(skip_s=10.0).total < 0.7


def test_the_imu_falling_silent_is_said_and_nothing_stale_is_sent():
    """8: no samples: `no_imu` after half a second, and no attitude goes out meanwhile."""
    flight = SimulatedFlight("rest", faults=("drop=1.0@5+3",)).run(12.0)
    assert ("no_imu") in [state for t_s, state in flight.seen.states if 5.4 < t_s < 5.8]
    silent = [m for t_s, m in flight.seen.sent if 5.6 < t_s < 7.9]
    assert not [m for m in silent if type(m).__name__.startswith("ATTITUDE")]
    assert flight.seen.states[-1][1] == "active"


@pytest.mark.parametrize("fault", ["nan=gyro-y@5+2", "nan=accel-x@5+2", "zero-accel@5+2"])
@pytest.mark.parametrize("name", FILTERS)
def test_samples_that_are_no_samples(name, fault):
    """10: NaN and an all-zero accelerometer are rejected and counted; the state is untouched."""
    configuration = filtered(name, "HIGHRES_IMU")
    flight = SimulatedFlight("rest", faults=(fault,), configuration=configuration).run(12.0)
    reason = "zero_force" if fault.startswith("zero") else "non_finite"
    assert flight.rejected[reason] > 150
    assert all_finite(flight)
    assert flight.seen.states[-1][1] == "active"
    assert abs(flight.seen.estimates[-1][1].pitch_deg) < 1.0


@pytest.mark.parametrize("axis", few(1, ["gyro-x", "accel-y"]))
@pytest.mark.parametrize("name", FILTERS)
def test_saturation(name, axis):
    """11: an axis at the end of its range is flagged, never overflows, and is recovered from."""
    configuration = filtered(name, "RAW_IMU")
    faults = (f"saturate={axis}@5+0.3",)
    flight = SimulatedFlight("rest", faults=faults, configuration=configuration).run(15.0)
    flagged = [r for _, r in flight.seen.estimates if r.trust & 256]
    assert flagged
    assert all_finite(flight)
    last = flight.seen.estimates[-1][1]
    assert math.hypot(last.roll_deg, last.pitch_deg) < 2.0


@pytest.mark.parametrize("name", FILTERS)
def test_stuck_gyro_axis(name):
    """9: named within 1.5 s after 9 s of motion; from then on nothing is learnt from it."""
    configuration = filtered(name, "RAW_IMU")
    faults = ("stuck=gyro-x@12+3",)
    flight = SimulatedFlight("aggressive", faults=faults, configuration=configuration).run(18.0)
    told_s = flight.first("gyro x is stuck")
    assert told_s is not None
    assert told_s < 12.0 + 1.5
    assert "degraded" in [state for _, state in flight.seen.states]
    assert flight.seen.states[-1][1] == "active"
    frozen = [record.bias_x_rad_s for record in flight.estimates_between(told_s + 0.1, 14.9)]
    assert max(frozen) - min(frozen) < math.radians(0.01)
    assert all_finite(flight)


def test_a_second_autopilot_is_told_and_not_used():
    """16 (in part): bound to the first; the other one's samples are counted and left alone."""
    flight = SimulatedFlight("rest", faults=("second-autopilot@3",)).run(10.0)
    assert flight.first("another autopilot 2/1") is not None
    assert flight.health.autopilot == "1/1"
    assert flight.errors().tilt < 0.5


def test_epoch_change_of_the_autopilots_clock():
    """6 (in part): boot time to UNIX time is a new epoch; no step spans the jump."""
    flight = SimulatedFlight("rest", faults=("epoch@5",)).run(10.0)
    assert flight.seen.states[-1][1] == "active"
    assert all_finite(flight)
    assert flight.errors().tilt < 0.5


def test_highres_field_a_million_times_too_large_keeps_its_heading():
    flight = SimulatedFlight("rest", faults=("mag-million@0",)).run(8.0)
    assert flight.errors().yaw < 2.0
    assert flight.seen.states[-1][1] == "active"


def test_a_denied_message_is_replaced_by_the_next_best():
    flight = SimulatedFlight("rest", faults=("deny=HIGHRES_IMU@0",)).run(6.0)
    assert flight.health.imu_message == "RAW_IMU"
    assert flight.health.imu_rate_hz == pytest.approx(100.0, rel=0.05)


def test_px4_feeds_the_message_without_removed_bias():
    flight = SimulatedFlight("flight", personality=PX4).run(10.0)
    assert flight.health.imu_message == "SCALED_IMU"
    assert flight.seen.states[-1][1] == "active"
    assert flight.errors().tilt < 1.0


def test_manners_on_the_wire():
    """Heartbeat at 1 Hz as 1/191, honest status; ATTITUDE at its rate; time sync locks."""
    flight = SimulatedFlight("rest").run(20.0)
    beats = [(t_s, m) for t_s, m in flight.seen.sent if type(m).__name__ == "HEARTBEAT"]
    assert len(beats) == pytest.approx(20, abs=1)
    assert beats[-1][1].system_status == mavlink.MAV_STATE_ACTIVE
    assert beats[-1][1].type == mavlink.MAV_TYPE_ONBOARD_CONTROLLER
    assert beats[-1][1].autopilot == mavlink.MAV_AUTOPILOT_INVALID
    attitudes = [t_s for t_s, m in flight.seen.sent if type(m).__name__ == "ATTITUDE"]
    assert len([t_s for t_s in attitudes if 10.0 <= t_s < 20.0]) == pytest.approx(500, abs=5)
    assert flight.pipeline.service.time_sync.is_locked

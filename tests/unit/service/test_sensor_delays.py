"""How old the sensors' values are, and how late an attitude is that follows from them."""

import itertools
import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.autopilot import Identity
from h2nav.service.parameter_request import PAUSES_NS, ParameterRequests
from h2nav.service.sensor_delays import GYRO_FILTER, SensorTiming, butterworth_delay_s
from h2nav.service.settings import AutopilotSettings
from h2nav.wire.imu import Ages
from h2nav.wire.vehicle import ParameterValue

COPTER = Identity(1, 1, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_QUADROTOR)
ROVER = COPTER._replace(vehicle_type=mavlink.MAV_TYPE_GROUND_ROVER)
PX4 = COPTER._replace(autopilot=mavlink.MAV_AUTOPILOT_PX4)
OTHER = COPTER._replace(autopilot=mavlink.MAV_AUTOPILOT_GENERIC)


def timing_of(identity, **chosen):
    return SensorTiming(AutopilotSettings(**chosen), identity)


def delays_at(timing, step_us, count=400, field_is_raw=False):
    for number in range(count):
        timing.sampled(1_000_000 + number * step_us, field_is_raw=field_is_raw)
    return timing.delays


def test_the_delay_of_a_butterworth_low_pass_is_that_of_its_step():
    """The mean delay of an impulse through 1 / (s^2 + sqrt 2 w s + w^2), integrated numerically."""
    omega, dt_s = 2.0 * math.pi * 20.0, 1e-6
    decay = omega / math.sqrt(2.0)
    times = [(number + 0.5) * dt_s for number in range(200_000)]
    impulse = [math.exp(-decay * t) * math.sin(decay * t) for t in times]
    mean_s = sum(t * h for t, h in zip(times, impulse, strict=True)) / sum(impulse)
    assert butterworth_delay_s(20.0) == pytest.approx(mean_s, rel=1e-4)
    assert butterworth_delay_s(20.0) == pytest.approx(0.01125, rel=1e-3)


@pytest.mark.parametrize(
    ("identity", "is_raw", "rates_s", "field_s"),
    [
        (COPTER, False, 0.01125, 0.05),
        (ROVER, False, 0.05627, 0.05),
        (PX4, False, 0.0025, 0.04),
        (PX4, True, 0.0025, 0.01),
        (OTHER, False, None, None),
    ],
)
def test_what_is_known_of_each_autopilot(identity, is_raw, rates_s, field_s):
    ages = timing_of(identity).ages(field_is_raw=is_raw)
    assert ages == (
        rates_s if rates_s is None else pytest.approx(rates_s, abs=1e-5),
        field_s,
    )


def test_ages_that_samples_carry_replace_those_of_the_make_but_not_the_chosen_ones():
    shown = Ages(0.004, 0.001)

    def delays(ages, **chosen):
        timing = timing_of(PX4, **chosen)
        for number in range(400):
            timing.sampled(1_000_000 + number * 10_000, field_is_raw=False, ages=ages)
        return timing.delays

    assert delays(None) == pytest.approx((0.0025 - 0.005, 0.04))
    assert delays(shown) == pytest.approx((0.004 - 0.005, 0.001))
    assert delays(shown, gyro_delay_s=0.03) == pytest.approx((0.03 - 0.005, 0.001))


@pytest.mark.parametrize("step_us", [2_500, 10_000, 25_000])
def test_a_rate_counts_as_the_mean_of_the_step_before_its_sample(step_us):
    delays = delays_at(timing_of(COPTER), step_us)
    assert delays.gyro_s == pytest.approx(0.01125 - 0.5e-6 * step_us, abs=1e-4)
    assert delays.field_s == 0.05


def test_the_delays_follow_the_rate_of_the_samples_and_not_a_gap():
    timing = timing_of(COPTER)
    delays_at(timing, 10_000)
    before = timing.delays
    timing.sampled(60_000_000, field_is_raw=False)
    assert timing.delays == pytest.approx(before, abs=2e-4)
    timing.restart()
    assert delays_at(timing, 20_000).gyro_s == pytest.approx(0.00125, abs=1e-4)


def test_nothing_is_led_where_nothing_is_known():
    assert delays_at(timing_of(OTHER), 10_000) == (0.0, 0.0)


def test_the_configuration_outweighs_what_is_known():
    chosen = {"gyro_delay_s": 0.02, "field_delay_s": 0.0}
    for identity in (COPTER, PX4, OTHER):
        timing = timing_of(identity, **chosen)
        assert timing.parameter == ""
        assert not timing.take_parameter(ParameterValue(GYRO_FILTER, 40.0))
        assert delays_at(timing, 10_000) == (pytest.approx(0.015, abs=1e-4), 0.0)


def test_the_parameter_of_the_low_pass_is_believed():
    timing = timing_of(COPTER)
    assert timing.parameter == GYRO_FILTER
    assert not timing.take_parameter(ParameterValue(GYRO_FILTER, 20.0)), "as expected"
    assert timing.take_parameter(ParameterValue(GYRO_FILTER, 80.0))
    assert timing.ages().rates_s == pytest.approx(0.01125 / 4, rel=1e-3)
    assert timing.take_parameter(ParameterValue(GYRO_FILTER, 0.0)), "the low-pass is off"
    assert timing.ages().rates_s == 0.0


@pytest.mark.parametrize("timing", [timing_of(PX4), timing_of(COPTER, gyro_delay_s=0.02)])
def test_a_parameter_without_a_name_is_none_where_none_is_asked_for(timing):
    assert not timing.take_parameter(ParameterValue("", 80.0))


@pytest.mark.parametrize("value", [None, -20.0, 0.001, 1.9, 1001.0, 1e30])
def test_an_absurd_parameter_is_not_believed(value):
    timing = timing_of(COPTER)
    assert not timing.take_parameter(ParameterValue(GYRO_FILTER, value))
    assert timing.ages().rates_s == pytest.approx(0.01125, rel=1e-3)


def test_other_parameters_and_other_autopilots_change_nothing():
    assert not timing_of(COPTER).take_parameter(ParameterValue("INS_ACCEL_FILTER", 10.0))
    assert not timing_of(PX4).take_parameter(ParameterValue(GYRO_FILTER, 10.0))


def test_a_parameter_is_asked_for_a_few_times_with_growing_pauses():
    request = ParameterRequests(GYRO_FILTER)
    asked_ns = [t_ns for t_ns in range(0, 200 * 10**9, 10**9) if request.next(t_ns, (1, 1))]
    assert len(asked_ns) == len(PAUSES_NS)
    pauses = [later - earlier for earlier, later in itertools.pairwise(asked_ns)]
    assert pauses == sorted(pauses)
    request.restart()
    message = request.next(10**12, (3, 4))
    assert (message.target_system, message.target_component) == (3, 4)
    assert (message.param_id, message.param_index) == (GYRO_FILTER, -1)


def test_a_parameter_that_has_come_is_not_asked_for():
    request = ParameterRequests(GYRO_FILTER)
    request.heard("SYSID_THISMAV")
    assert request.next(0, (1, 1)) is not None
    request.heard(GYRO_FILTER)
    assert request.next(10**12, (1, 1)) is None
    assert ParameterRequests().next(0, (1, 1)) is None


def test_several_parameters_are_asked_for_in_turn():
    request = ParameterRequests("FIRST", "SECOND")
    assert request.next(0, (1, 1)).param_id == "FIRST"
    assert request.next(1, (1, 1)) is None
    request.heard("FIRST")
    assert request.next(2, (1, 1)).param_id == "SECOND"
    asked = [t_s for t_s in range(1000) if request.next(t_s * 10**9, (1, 1))]
    assert len(asked) == len(PAUSES_NS) - 1


@pytest.mark.parametrize(
    ("value_hz", "is_taken"),
    [(0.0, True), (1.99, False), (2.0, True), (1000.0, True), (1000.1, False), (None, False)],
)
def test_a_low_pass_is_off_or_from_2_to_1000_hz(value_hz, is_taken):
    timing = timing_of(COPTER)
    assert timing.take_parameter(ParameterValue("INS_GYRO_FILTER", value_hz)) is is_taken
    expected_s = math.sqrt(2.0) / (2.0 * math.pi * (value_hz or math.inf)) if is_taken else 0.01125
    assert timing.ages().rates_s == pytest.approx(expected_s, rel=1e-3)
    assert timing.ages().field_s == 0.05


def test_a_rovers_low_pass_is_at_4_hz_until_it_is_known():
    assert timing_of(ROVER).ages().rates_s == butterworth_delay_s(4.0)
    assert not timing_of(COPTER).take_parameter(ParameterValue("INS_GYRO_FILTER", 20.0))
    assert timing_of(ROVER).take_parameter(ParameterValue("INS_GYRO_FILTER", 20.0))


def test_the_period_is_a_mean_over_fifty_samples_and_a_gap_counts_twice():
    timing = timing_of(PX4)
    times_us = [0, 10_000, 30_000, 1_030_000]
    periods_s = []
    for t_us in times_us:
        timing.sampled(t_us, field_is_raw=False)
        periods_s.append(timing.period_s)
    third_s = 0.010 + (0.020 - 0.010) / 50
    assert periods_s == [
        None,
        pytest.approx(0.010),
        pytest.approx(third_s),
        pytest.approx(third_s + third_s / 50),
    ]
    timing.restart()
    assert timing.period_s is None
    assert timing.delays == (0.0, 0.0)


@pytest.mark.parametrize(("moved_s", "is_told"), [(0.9e-4, False), (1.1e-4, True)])
@pytest.mark.parametrize("of_field", [False, True])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_tenth_of_a_millisecond_is_a_change(moved_s, is_told, of_field, sign):
    timing = timing_of(OTHER)
    for number in range(3):
        timing.sampled(number * 10_000, field_is_raw=False, ages=Ages(0.02, 0.05))
    assert timing.delays == (pytest.approx(0.015), 0.05)
    moved = sign * moved_s
    ages = Ages(0.02, 0.05 + moved) if of_field else Ages(0.02 + moved, 0.05)
    assert timing.sampled(30_000, field_is_raw=False, ages=ages) is is_told
    field_s = 0.05 + moved * (of_field and is_told)
    assert timing.delays[1] == pytest.approx(field_s)


def test_a_field_of_unknown_age_is_as_old_as_the_rates():
    timing = timing_of(OTHER)
    for number in range(3):
        timing.sampled(number * 10_000, field_is_raw=False, ages=Ages(0.02, None))
    assert timing.delays == (pytest.approx(0.015), pytest.approx(0.015))


@pytest.mark.parametrize(
    ("identity", "chosen", "name"),
    [
        (COPTER, {}, "INS_GYRO_FILTER"),
        (COPTER, {"gyro_delay_s": 0.01}, ""),
        (COPTER, {"field_delay_s": 0.01}, "INS_GYRO_FILTER"),
        (PX4, {}, ""),
        (OTHER, {}, ""),
    ],
)
def test_which_parameter_is_asked_for(identity, chosen, name):
    assert timing_of(identity, **chosen).parameter == name

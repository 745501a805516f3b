"""When outputs accuse a motor, as tables of what is just enough and what is just too little."""

import numpy as np
import pytest
from known_evidence import receiver_track

from h2nav.integrity.findings import Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import ChangedSetting, Context, Motors, Said, Series, Span
from h2nav.reviews.impacts import BIN_S, Bins
from h2nav.reviews.motors import detect_motors, outputs_beyond_others

T_S = np.arange(0.0, 60.0, BIN_S)
FLIGHT = (Span(0.0, 60.0, ""),)
MIN_PWM_US, MAX_PWM_US, HOVER_US = 1000.0, 2000.0, 1500.0


def bins(t_s=T_S):
    """A level flight in calm air that is never quite still."""
    random = np.random.default_rng(1)
    w_b = random.normal(0.0, 0.05, (len(t_s), 3))
    f_b = np.tile([0.0, 0.0, -9.81], (len(t_s), 1)) + random.normal(0.0, 0.05, (len(t_s), 3))
    ones = np.ones(len(t_s))
    return Bins(t_s, f_b, w_b, ones, 0.1 * ones, 0.5 * ones)


def found_in(pwm_us, lifted=FLIGHT, numbers=(1, 2, 3, 4), **changes):
    """The findings of outputs (N, k), or of their constant values."""
    pwm_us = np.broadcast_to(np.asarray(pwm_us, dtype=float), (len(T_S), len(numbers)))
    outputs = Motors(numbers, T_S, pwm_us, MIN_PWM_US, MAX_PWM_US)
    context = Context(motors=outputs, armed=FLIGHT, vehicle_type=2, **changes)
    return detect_motors(bins(), context, (), lifted)


def uneven(extra_us, **changes):
    """The one finding of outputs that differ by so much from those in hover; None without one."""
    found = found_in(HOVER_US + np.asarray(extra_us, dtype=float), **changes)
    assert all(one.kind is Kind.MOTOR_IMBALANCE for one in found)
    assert len(found) <= 1
    return found[0] if found else None


@pytest.mark.parametrize(
    ("extra_us", "motor"),
    [
        # beyond the mean of the others by 40 us
        ((41.0, 0.0, 0.0, 0.0), 1),
        ((39.0, 0.0, 0.0, 0.0), None),
        ((0.0, 0.0, 41.0, 0.0), 3),
        # 30 us more than the next one is
        ((60.0, 39.0, 0.0, 0.0), None),
        ((60.0, 30.0, 0.0, 0.0), 1),
        # the others are about even
        ((60.0, 20.0, -20.0, 0.0), 1),
        ((60.0, 25.0, -30.0, 0.0), None),
        ((60.0, 25.0, -25.0, 0.0), 1),
        # a pair that differs shows the yaw
        ((40.0, 40.0, 0.0, 0.0), None),
    ],
)
def test_one_motor_is_far_above_the_others_and_those_are_even(extra_us, motor):
    found = uneven(extra_us)
    assert (found and found.sensor) == (motor and Sensor(SensorKind.MOTOR, motor))


@pytest.mark.parametrize(
    ("extra_us", "severity"),
    [
        ((99.0, 0.0, 0.0, 0.0), Severity.WARNING),
        ((101.0, 0.0, 0.0, 0.0), Severity.ERROR),
        # the one across works as much less
        ((50.0, 0.0, -30.0, 0.0), Severity.WARNING),
        ((50.0, 0.0, -33.0, 0.0), Severity.NOTICE),
    ],
)
def test_how_bad_it_is(extra_us, severity):
    found = uneven(extra_us)
    assert found is not None
    assert found.severity is severity
    assert ("mirrors" in found.evidence) == (severity is Severity.NOTICE)
    own = (np.array(extra_us) - np.mean(extra_us)) * 4 / 3
    assert found.size == pytest.approx(own[0], abs=0.5)
    assert found.evidence.startswith("in the whole flight, ")
    assert ", ".join(f"{place + 1}: {us:+.0f}" for place, us in enumerate(own)) in found.evidence


@pytest.mark.parametrize(
    ("factors", "since"),
    [
        ((1.0, 1.0, 1.0), "in the whole flight"),
        ((0.0, 1.0, 1.0), "since 20 s"),
        ((1.0, 0.0, 1.0), "in the whole flight"),
        ((1.0, 1.0, 0.0), None),
        ((0.0, 0.0, 1.0), None),
        ((0.6, 1.0, 1.0), "in the whole flight"),
    ],
)
def test_it_lasts_for_most_of_the_flight_and_to_its_end(factors, since):
    over_time = np.repeat(factors, len(T_S) // 3)
    found = uneven(np.outer(over_time, [150.0, 0.0, 0.0, 0.0]))
    assert (found and found.evidence.split(",")[0]) == since


@pytest.mark.parametrize(("level_s", "is_told"), [(14.0, False), (16.5, True)])
def test_it_takes_a_quarter_of_a_minute_of_flight(level_s, is_told):
    lifted = (Span(20.0, 20.0 + level_s, ""),)
    assert (uneven((80.0, 0.0, 0.0, 0.0), lifted=lifted) is not None) == is_told


@pytest.mark.parametrize(("count", "severity"), [(3, Severity.NOTICE), (6, Severity.ERROR)])
def test_of_three_motors_a_load_off_the_centre_asks_the_same(count, severity):
    extra_us = [120.0, *np.zeros(count - 1)]
    found = uneven(extra_us, numbers=tuple(range(1, count + 1)))
    assert found.severity is severity
    assert ("load off the centre asks the same" in found.evidence) == (count == 3)


def test_of_two_motors_none_is_uneven():
    assert found_in([HOVER_US + 80.0, HOVER_US], numbers=(1, 2)) == []


def test_without_outputs_or_bins_nothing_is_found():
    outputs = Motors((1, 2, 3, 4), T_S, np.full((len(T_S), 4), HOVER_US), MIN_PWM_US, MAX_PWM_US)
    one_row = outputs._replace(t_s=T_S[:1], pwm_us=outputs.pwm_us[:1])
    for motors, made in ((None, bins()), (one_row, bins()), (outputs, bins(T_S[:0]))):
        context = Context(motors=motors, armed=FLIGHT)
        assert detect_motors(made, context, (), FLIGHT) == []
        assert outputs_beyond_others(made, context, ()) == {}
    context = Context(
        motors=outputs._replace(pwm_us=outputs.pwm_us + np.array([40.0, 0.0, 0.0, 0.0])),
        armed=FLIGHT,
    )
    beyond = outputs_beyond_others(bins(), context, ())
    assert beyond == pytest.approx({1: 40.0, 2: -40 / 3, 3: -40 / 3, 4: -40 / 3}, abs=0.5)


def saturated(length_s, us=MAX_PWM_US, others_us=HOVER_US):
    pwm_us = np.full((len(T_S), 4), others_us)
    pwm_us[(T_S > 30.0 - 0.5 * BIN_S) & (T_S - length_s < 30.0 - 0.5 * BIN_S), 1] = us
    return found_in(pwm_us)


@pytest.mark.parametrize(
    ("length_s", "us", "is_told"),
    [
        (0.8, MAX_PWM_US, False),
        (1.2, MAX_PWM_US, True),
        (3.0, 1980.0, False),
        (3.0, 1990.0, True),
    ],
)
def test_a_limit_is_told_after_a_second(length_s, us, is_told):
    found = [one for one in saturated(length_s, us) if one.kind is Kind.MOTOR_SATURATED]
    assert bool(found) == is_told
    if found:
        assert found[0].sensor == Sensor(SensorKind.MOTOR, 2)
        assert found[0].severity is Severity.WARNING
        assert found[0].from_s == pytest.approx(30.0, abs=BIN_S)
        assert f"at its limit for {length_s:.1f} s" in found[0].text


@pytest.mark.parametrize(
    ("name", "before", "after", "motor"),
    [
        ("SERVO3_FUNCTION", 33.0, 0.0, 1),
        ("SERVO12_FUNCTION", 40.0, 0.0, 8),
        ("SERVO9_FUNCTION", 82.0, 0.0, 9),
        ("SERVO9_FUNCTION", 85.0, 0.0, 12),
        ("PWM_MAIN_FUNC1", 101.0, 0.0, 1),
        ("PWM_AUX_FUNC2", 112.0, 0.0, 12),
        ("SERVO3_FUNCTION", 33.0, 33.0, None),
        ("SERVO3_FUNCTION", 32.0, 0.0, None),
        ("SERVO3_FUNCTION", 41.0, 0.0, None),
        ("PWM_MAIN_FUNC1", 113.0, 0.0, None),
        ("SERVO3_TRIM", 33.0, 0.0, None),
    ],
)
def test_an_output_that_gets_another_function_switches_a_motor_off(name, before, after, motor):
    change = ChangedSetting(30.0, name, before, after)
    found = [
        one for one in found_in([HOVER_US] * 4, changes=(change,)) if one.kind is Kind.MOTOR_FAILED
    ]
    assert [one.sensor.number for one in found] == ([] if motor is None else [motor])


@pytest.mark.parametrize(
    ("text", "others_us", "climb_m_s", "motor"),
    [
        ("Potential Thrust Loss (2)", HOVER_US, -1.0, 2),
        ("Potential Thrust Loss (2)", HOVER_US, 1.0, None),  # it climbs
        ("Potential Thrust Loss (2)", 1895.0, -1.0, 2),
        ("Potential Thrust Loss (2)", 1905.0, -1.0, None),  # another one is near its limit
        ("Potential Thrust Loss (3)", HOVER_US, -1.0, None),  # that one is not at its limit
        ("Potential Thrust Loss (9)", HOVER_US, -1.0, None),
        ("Thrust was fine (2)", HOVER_US, -1.0, None),
    ],
)
def test_a_loss_of_thrust_that_the_autopilot_reports(text, others_us, climb_m_s, motor):
    pwm_us = np.full((len(T_S), 4), others_us)
    pwm_us[np.abs(T_S - 30.0) < 1.0, 1] = MAX_PWM_US
    found = found_in(
        pwm_us,
        said=(Said(30.0, Severity.WARNING, text),),
        climb_m_s=Series(T_S, np.full(len(T_S), climb_m_s)),
        duration_s=60.0,
    )
    failed = [one.sensor.number for one in found if one.kind is Kind.MOTOR_FAILED]
    assert failed == ([] if motor is None else [motor])


@pytest.mark.parametrize(("turned_s", "is_weak"), [(8.0, False), (12.0, True)])
def test_what_the_autopilot_reports_after_a_tumble_convicts_no_motor(turned_s, is_weak):
    pwm_us = np.full((len(T_S), 4), HOVER_US)
    pwm_us[np.abs(T_S - 30.0) < 1.0, 1] = MAX_PWM_US
    context = Context(
        motors=Motors((1, 2, 3, 4), T_S, pwm_us, MIN_PWM_US, MAX_PWM_US),
        armed=FLIGHT,
        said=(Said(30.0, Severity.WARNING, "Potential Thrust Loss (2)"),),
        climb_m_s=Series(T_S, np.full(len(T_S), -1.0)),
        duration_s=60.0,
    )
    made = bins()
    turning = np.abs(made.t_s - (30.0 - turned_s)) < 0.5
    made.w_b[turning, 0] += np.pi
    found = detect_motors(made, context, (), FLIGHT)
    assert any(one.kind is Kind.MOTOR_FAILED for one in found) == is_weak


@pytest.mark.parametrize(("missing", "is_told"), [((), True), ((301,), False)])
def test_what_was_not_logged_shows_no_motor_in_vain(missing, is_told):
    """At full output for 0.3 s, the others low, while it turns and falls."""
    made = bins()
    place = slice(300, 303)
    made.w_b[299:310, 0], made.f_b[299:303] = 2.0, np.array([0.0, 0.0, -6.0])
    pwm_us = np.full((len(T_S), 4), HOVER_US)
    pwm_us[place] = [MAX_PWM_US, 1300.0, 1300.0, 1300.0]
    kept = np.setdiff1d(np.arange(len(T_S)), missing)
    outputs = Motors((1, 2, 3, 4), T_S, pwm_us, MIN_PWM_US, MAX_PWM_US)
    context = Context(motors=outputs, armed=FLIGHT, vehicle_type=2)
    found = detect_motors(made.part(kept), context, (), FLIGHT)
    assert [one.sensor.number for one in found if one.kind is Kind.MOTOR_FAILED] == [1] * is_told


@pytest.mark.parametrize(("gap_s", "told"), [
    (0.7, [Kind.MOTOR_FAILED]),
    (2.4, []),
])  # fmt: skip
def test_what_was_not_logged_shows_no_motor_at_its_limit(gap_s, told):
    """At full output for 3 s, alone, while it sinks."""
    pwm_us = np.full((len(T_S), 4), HOVER_US)
    pwm_us[300:330, 1] = MAX_PWM_US
    sinks = receiver_track(T_S, (0.0, 0.0, 1.0))
    context = Context(
        motors=Motors((1, 2, 3, 4), T_S, pwm_us, MIN_PWM_US, MAX_PWM_US),
        armed=FLIGHT,
        climb_m_s=Series(T_S, np.full(len(T_S), -1.0)),
        gps=(sinks,),
        duration_s=60.0,
    )
    kept = (T_S < 30.25) | (30.25 + gap_s < T_S)
    assert [one.kind for one in detect_motors(bins().part(kept), context, (), FLIGHT)] == told


@pytest.mark.parametrize(("across_g", "is_told"), [(0.9, True), (1.1, False)])
def test_what_is_struck_lifts_no_motor(across_g, is_told):
    """Braked alone, while it turns and the force rises; no motor pushes sideways."""
    made = bins()
    made.w_b[299:310, 0] = 2.0
    made.f_b[300:310] = [0.0, 0.0, -13.0]
    made.f_b[300, 0] = across_g * 9.80665
    pwm_us = np.full((len(T_S), 4), HOVER_US)
    pwm_us[300:310] = [1150.0, HOVER_US, HOVER_US, HOVER_US]
    outputs = Motors((1, 2, 3, 4), T_S, pwm_us, MIN_PWM_US, MAX_PWM_US)
    context = Context(motors=outputs, armed=FLIGHT, vehicle_type=2)
    found = detect_motors(made, context, (), FLIGHT)
    failed = [one for one in found if one.kind is Kind.MOTOR_FAILED]
    assert [one.sensor.number for one in failed] == [1] * is_told

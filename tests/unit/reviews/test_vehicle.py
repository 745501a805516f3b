"""What happened to the vehicle: crashes, motors, vibration, sensors at rest, and the chain."""

import numpy as np
import pytest
from reviewed_flights import DURATION_S, flight, ideal, with_gps, with_imu

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.rows import select_rows
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import (
    Battery,
    ChangedSetting,
    CompassRows,
    Context,
    ImuTrack,
    Motors,
    ReportedFault,
    Said,
    Series,
    Span,
)
from h2nav.recordings.rotations import roll_pitch_heading
from h2nav.reviews.analysis import Analysis, analyse
from h2nav.reviews.causes import first_causes
from h2nav.reviews.chain import chain
from h2nav.reviews.compass_motors import strength_by_throttle
from h2nav.reviews.control import detect_control
from h2nav.reviews.declared import FlightEvidence
from h2nav.reviews.estimators import judged
from h2nav.reviews.evidence import lifted
from h2nav.reviews.flight import Flight
from h2nav.reviews.impacts import Impact, binned
from h2nav.reviews.inertial import attitudes
from h2nav.reviews.standstill import NEVER
from h2nav.reviews.verdict import verdict

T_S = ideal("flight").t_us * 1e-6
HOVER_US = 1550.0
AGAINST_PATTERN = np.array([[1.0, 1.0, -1.0, -1.0], [-1.0, 1.0, 1.0, -1.0], [1.0, -1.0, 1.0, -1.0]])


def kinds(flown: Flight) -> dict[Kind, Finding]:
    return {one.kind: one for one in analyse(flown).findings}


def said_of(flown: Flight) -> str:
    analysis = analyse(flown)
    return verdict(flown, analysis, chain(flown, analysis)).text


def motors(extra_us: tuple[float, ...] = (0.0,) * 4, *, seed: int = 1) -> Motors:
    """Outputs that answer to rates and to the force across, each with something of its own."""
    truth, random = ideal("flight"), np.random.default_rng(seed)
    causes = np.column_stack((truth.f_b[:, 0], truth.w_b[:, 0], truth.w_b[:, 2]))
    answers = 40.0 * causes @ AGAINST_PATTERN
    noise = random.normal(0.0, 8.0, answers.shape)
    pwm_us = HOVER_US + answers + noise + np.array(extra_us)
    pwm_us[T_S < 3.0] = 1000.0
    return Motors((1, 2, 3, 4), T_S, pwm_us.clip(1000.0, 1950.0), 1000.0, 1950.0)


def multirotor(**changes: object) -> Flight:
    demand = Series(T_S, roll_pitch_heading(ideal("flight").q_nb))
    return flight(motors=motors(), demand=demand, vehicle_type=2, **changes)


def tipped(flown: Flight, at_s: float, axis: int = 0) -> Flight:
    """Turned over within half a second, struck with 8 g, then on its back until the log ends."""
    first = flown.context.imus[0]
    f_b, w_b = first.f_b.copy(), first.w_b.copy()
    turns = (first.t_s > at_s - 0.5) & (first.t_s <= at_s)
    w_b[turns, axis] += np.pi / 0.5
    lies = first.t_s > at_s
    f_b[lies], w_b[lies] = np.array([0.0, 0.0, GRAVITY_M_S2]), 0.0
    f_b[np.flatnonzero(lies)[:8]] = np.array([0.0, 20.0, -75.0])
    kept = first.t_s < at_s + 1.5
    short = ImuTrack(0, "IMU", *(column[kept] for column in first[2:4]), *(
        column[kept] for column in (w_b, f_b, first.m_b_ut)
    ))  # fmt: skip
    context = flown.context._replace(imus=(short,), armed=(Span(3.0, at_s + 1.5, "armed"),))
    return flown._replace(context=context)


# --- crashes ------------------------------------------------------------------------------------


def test_a_multirotor_without_a_fault_gives_no_finding():
    assert not analyse(multirotor()).findings


def test_a_tip_over_is_a_crash_however_short_the_log_is_afterwards():
    flown = tipped(multirotor(), 60.0)
    found = kinds(flown)
    crash = found[Kind.CRASH]
    assert crash.from_s == pytest.approx(60.0, abs=0.3)
    assert crash.severity is Severity.CRITICAL
    assert crash.size > 5.0 * GRAVITY_M_S2


@pytest.mark.parametrize(
    ("turned", "period_s", "is_crash"),
    [(1.0, 0.1, True), (0.1, 0.1, False), (1.0, 0.03, False)],
)
def test_seldom_samples_miss_the_blow_after_which_it_lies(turned, period_s, is_crash):
    """Turned over, or by a tenth of it, within half a second; then on its back."""
    flown = tipped(multirotor(), 60.0)
    first = flown.context.imus[0]
    f_b, w_b = first.f_b.copy(), first.w_b.copy()
    f_b[first.t_s > 60.0] = np.array([0.0, 0.0, GRAVITY_M_S2])
    w_b[(first.t_s > 59.5) & (first.t_s <= 60.0), 0] *= turned
    step = round(period_s / float(np.median(np.diff(first.t_s))))
    columns = (column[::step] for column in (*first[2:4], w_b, f_b, first.m_b_ut))
    seldom = ImuTrack(0, "IMU", *columns)
    context = flown.context._replace(imus=(seldom,), demand=None)
    found = analyse(flown._replace(context=context)).impacts
    assert [one.is_crash for one in found] == [True] * is_crash
    for one in found:
        assert one.t_s == pytest.approx(60.0, abs=0.2)
        assert one.turned_rad > 120.0 * DEG


@pytest.mark.parametrize("share", [0.05, 0.4])
def test_who_turns_a_vehicle_over_by_hand_crashes_nothing(share):
    flown = multirotor()
    first = flown.context.imus[0]
    f_b = first.f_b.copy()
    angle = np.clip((first.t_s - 60.0) / 4.0, 0.0, 1.0) * np.pi
    f_b[:] = GRAVITY_M_S2 * np.stack((0.0 * angle, np.sin(angle), -np.cos(angle)), axis=1)
    still = motors()._replace(pwm_us=np.full((len(T_S), 4), 1000.0 + 950.0 * share))
    flown = with_imu(flown, f_b=f_b, w_b=np.zeros_like(first.w_b))
    flown = flown._replace(context=flown.context._replace(motors=still))
    assert Kind.CRASH not in kinds(flown)


@pytest.mark.parametrize(("rate_deg_s", "is_crash"), [(2.0, True), (6.0, False)])
def test_a_plane_that_was_struck_lies_on_its_side_only_if_it_no_longer_turns(rate_deg_s, is_crash):
    flown = flight(vehicle_type=1)
    first = flown.context.imus[0]
    f_b, w_b = first.f_b.copy(), first.w_b.copy()
    after = first.t_s > 60.0
    f_b[after] = GRAVITY_M_S2 * np.array([0.0, np.sin(1.2), -np.cos(1.2)])
    f_b[np.flatnonzero(after)[:8]] = np.array([0.0, 20.0, -40.0])
    w_b[after] = np.array([0.0, 0.0, np.radians(rate_deg_s)])
    kept = first.t_s < 65.0
    short = ImuTrack(0, "IMU", *(column[kept] for column in first[2:4]), *(
        column[kept] for column in (w_b, f_b, first.m_b_ut)
    ))  # fmt: skip
    context = flown.context._replace(imus=(short,), armed=(Span(3.0, 65.0, "armed"),))
    assert (Kind.CRASH in kinds(flown._replace(context=context))) is is_crash


def landed_hard(flown: Flight, at_s: float, to_s: float) -> Flight:
    """Struck with 8 g, then upright on the ground for a while."""
    first = flown.context.imus[0]
    f_b, w_b = first.f_b.copy(), first.w_b.copy()
    down = (first.t_s > at_s) & (first.t_s < to_s)
    f_b[down], w_b[down] = np.array([0.0, 0.0, -GRAVITY_M_S2]), 0.0
    f_b[np.flatnonzero(down)[:6], 2], w_b[np.flatnonzero(down)[:6], 0] = -80.0, 7.0
    pwm_us = np.where(down[:, None], 1000.0, motors().pwm_us)
    flown = with_imu(flown, f_b=f_b, w_b=w_b)
    return flown._replace(context=flown.context._replace(motors=motors()._replace(pwm_us=pwm_us)))


def test_a_blow_that_leaves_it_upright_is_a_hard_landing():
    found = kinds(landed_hard(multirotor(), 100.0, np.inf))
    assert Kind.CRASH not in found
    assert found[Kind.HARD_LANDING].from_s == pytest.approx(100.0, abs=0.3)


@pytest.mark.parametrize(("vehicle_type", "is_told"), [(1, True), (10, False), (11, False)])
def test_what_drives_or_swims_does_not_land(vehicle_type, is_told):
    flown = landed_hard(multirotor(), 100.0, np.inf)
    context = flown.context._replace(vehicle_type=vehicle_type)
    assert (Kind.HARD_LANDING in kinds(flown._replace(context=context))) == is_told


@pytest.mark.parametrize(("touched_g", "from_s"), [(1.0, 60.0), (2.5, 59.5)])
def test_a_blow_begins_where_it_is_first_felt_and_turns_the_vehicle_from_then_on(touched_g, from_s):
    flown = tipped(multirotor(), 60.0)
    first = flown.context.imus[0]
    f_b = first.f_b.copy()
    touches = (first.t_s > 59.5) & (first.t_s <= 60.0)
    f_b[touches] = np.array([0.0, 0.0, -touched_g * GRAVITY_M_S2])
    (blow,) = analyse(with_imu(flown, f_b=f_b)).impacts
    assert blow.t_s == pytest.approx(from_s, abs=0.11)
    assert blow.is_crash
    assert (blow.turned_rad > 120.0 * DEG) == (touched_g < 2.0)


def test_a_second_impact_has_its_own_time():
    flown = tipped(landed_hard(multirotor(), 60.0, 70.0), 100.0)
    times = [impact.t_s for impact in analyse(flown).impacts]
    assert times == pytest.approx([60.0, 100.0], abs=0.3)


@pytest.mark.parametrize(
    ("climb_m_s", "other_m_s", "length_s", "is_crash"),
    [
        (-3.0, -3.0, 1.5, False),
        (3.0, 2.5, 1.5, False),
        (-1.5, -1.5, 1.5, True),
        (-3.0, 0.0, 1.5, True),
        (-3.0, -3.0, 0.2, True),
    ],
)
def test_what_two_sources_show_to_climb_or_sink_does_not_lie(
    climb_m_s, other_m_s, length_s, is_crash
):
    """However steady its force: seldom samples of a vibration may show any."""
    flown = tipped(multirotor(), 60.0)
    moves = (T_S > 60.2) & (60.2 + length_s > T_S)
    height = Series(T_S, 20.0 + np.cumsum(np.where(moves, other_m_s, 0.0)) * (T_S[1] - T_S[0]))
    climb = Series(T_S, np.where(moves, climb_m_s, 0.0))
    context = flown.context._replace(climb_m_s=climb, baro_height_m=height)
    first = context.imus[0]
    # It did not turn over.
    upright = first._replace(w_b=np.where((first.t_s > 59.0)[:, None], 0.0, first.w_b))
    found = analyse(flown._replace(context=context._replace(imus=(upright,)))).impacts
    assert any(one.is_crash for one in found) == is_crash


def test_a_crash_check_without_a_crash_is_false():
    fault = ReportedFault(60.0, "crash_check", 1, "crash detected")
    found = kinds(multirotor(faults=(fault,)))
    assert found[Kind.AUTOPILOT_CRASH_CHECK].from_s == 60.0
    crashed = tipped(multirotor(faults=(fault._replace(t_s=61.0),)), 60.0)
    assert Kind.AUTOPILOT_CRASH_CHECK not in kinds(crashed)


def test_a_vehicle_that_lies_after_the_first_seconds_of_a_log_had_not_stood_so():
    """The log begins in flight, and nothing shows how it had stood."""
    outputs = motors()
    outputs.pwm_us[T_S < 3.0] = HOVER_US
    outputs.pwm_us[T_S > 5.2] = 1000.0
    crashed = tipped(multirotor(), 5.0)
    context = crashed.context._replace(motors=outputs, armed=(Span(0.0, 6.5, "armed"),))
    text = said_of(crashed._replace(context=context))
    assert text.startswith("Crashed at 5 s and came to lie on its back.")


@pytest.mark.parametrize(("begins", "then", "lies"), [(0, 1, True), (0, 0, False), (1, 1, False)])
def test_a_vehicle_that_tips_over_as_the_log_begins_may_have_crashed_before(begins, then, lies):
    """Upright, or on its back; a board may be mounted so."""
    rests = GRAVITY_M_S2 * np.array([[0.0, 0.0, -1.0], [0.0, 0.2, 0.98]])
    flown = multirotor(faults=(ReportedFault(8.0, "crash_check", 1, "crash detected"),))
    uneven = flown.context._replace(motors=motors((60.0, -20.0, -20.0, -20.0)))
    flown = flown._replace(context=uneven)
    first = flown.context.imus[0]
    f_b = np.where((first.t_s < 5.0)[:, None], rests[begins], rests[then])
    f_b[first.t_s > 10.0] = first.f_b[first.t_s > 10.0]
    flown = with_imu(flown, f_b=f_b)
    assert (Kind.AUTOPILOT_CRASH_CHECK in kinds(flown)) != lies
    assert said_of(flown).startswith("No crash") != lies


@pytest.mark.parametrize("is_asked", [True, False])
def test_what_kept_to_its_demand_until_the_blow_was_not_lost(is_asked):
    """However far the gyro turned, by samples that are too seldom for what shook it."""
    context = multirotor().context._replace(**({} if is_asked else {"demand": None}))
    impact = Impact(60.0, 61.0, 20.0, 9.0, np.nan, 2.0, 58.5, is_crash=True)
    lost = detect_control(binned(context.imus[0], context), context, [impact], ())
    said = [] if is_asked else ["it turned over by 115 deg"]
    assert [one.text for one in lost] == said


# --- motors and control -------------------------------------------------------------------------


@pytest.mark.parametrize("motor", [0, 3])
def test_one_motor_that_works_harder_is_named(motor):
    extra = np.full(4, -20.0)
    extra[motor] = 60.0
    found = kinds(multirotor()._replace(context=multirotor().context._replace(
        motors=motors(tuple(extra))
    )))  # fmt: skip
    imbalance = found[Kind.MOTOR_IMBALANCE]
    assert imbalance.sensor == Sensor(SensorKind.MOTOR, motor + 1)
    assert imbalance.size == pytest.approx(80.0, abs=10.0)


@pytest.mark.parametrize("extra", [(30, 30, -30, -30), (40, -40, 0, 0), (15, -5, -5, -5)])
def test_pairs_loads_and_small_differences_are_no_imbalance(extra):
    flown = multirotor()
    flown = flown._replace(context=flown.context._replace(motors=motors(extra)))
    assert Kind.MOTOR_IMBALANCE not in kinds(flown)


# A height that never changes is none.
@pytest.mark.parametrize(("climbed_m", "is_told"), [(0.0, True), (0.2, False), (5.0, True)])
@pytest.mark.parametrize("name", ["baro_height_m", "height_m"])
def test_outputs_on_the_ground_say_nothing_of_a_motor(name, climbed_m, is_told):
    height = Series(T_S, np.clip(T_S - 5.0, 0.0, climbed_m))
    flown = multirotor(**{name: height})
    context = flown.context._replace(motors=motors((60.0, -20.0, -20.0, -20.0)))
    assert (Kind.MOTOR_IMBALANCE in kinds(flown._replace(context=context))) == is_told


@pytest.mark.parametrize(("period_s", "is_told"), [(1.0, True), (20.0, False)])
def test_what_outputs_hold_against_gusts_is_one_observation_each(period_s, is_told):
    pwm_us = motors((45.0, -15.0, -15.0, -15.0)).pwm_us
    pwm_us[:, 0] += 150.0 * np.sin(2.0 * np.pi * T_S / period_s)
    flown = multirotor()
    flown = flown._replace(context=flown.context._replace(motors=motors()._replace(pwm_us=pwm_us)))
    assert (Kind.MOTOR_IMBALANCE in kinds(flown)) == is_told


def test_a_motor_at_its_limit_is_told_with_how_long():
    pwm_us = motors().pwm_us
    pwm_us[(T_S > 50.0) & (T_S < 53.0), 1] = 1950.0
    flown = multirotor()
    flown = flown._replace(context=flown.context._replace(motors=motors()._replace(pwm_us=pwm_us)))
    found = kinds(flown)[Kind.MOTOR_SATURATED]
    assert (found.sensor.number, found.from_s) == (2, pytest.approx(50.0, abs=0.2))
    assert "2.9 s" in found.text


def test_a_motor_that_is_switched_off_by_a_setting_has_failed():
    change = ChangedSetting(60.0, "SERVO3_FUNCTION", 35.0, 0.0)
    found = kinds(multirotor(changes=(change,)))
    assert found[Kind.MOTOR_FAILED].sensor == Sensor(SensorKind.MOTOR, 3)
    other = ChangedSetting(60.0, "SERVO9_FUNCTION", 0.0, 70.0)
    assert Kind.MOTOR_FAILED not in kinds(multirotor(changes=(other,)))


def asked_in_vain(struck_m_s2: float = 0.0) -> Flight:
    """Motor 2 at its limit from 58.4 s on, while it falls and turns, and a crash at 60 s.

    Args:
        struck_m_s2: force from the side at 58 s.
    """
    flown = tipped(multirotor(), 60.0)
    first = flown.context.imus[0]
    f_b, w_b = first.f_b.copy(), first.w_b.copy()
    falls = (first.t_s > 58.0) & (first.t_s < 59.9)
    f_b[falls] *= 0.5
    w_b[falls, 0] += 4.0
    f_b[(first.t_s > 58.0) & (first.t_s < 58.2), 1] += struck_m_s2
    pwm_us = motors().pwm_us
    pwm_us[T_S > 58.4] = np.array([1300.0, 1950.0, 1250.0, 1300.0])
    q = np.tile([1.0, 0.0, 0.0, 0.0], (len(T_S), 1))
    turned = np.clip(T_S - 58.0, 0.0, None)
    q[:, 0], q[:, 1] = np.cos(turned), np.sin(turned)
    attitude = flown.context.attitudes[0]._replace(t_s=T_S, q_nb=q)
    demand = Series(T_S, np.zeros((len(T_S), 3)))
    flown = with_imu(flown, f_b=f_b, w_b=w_b)
    return flown._replace(
        context=flown.context._replace(
            motors=motors()._replace(pwm_us=pwm_us), attitudes=(attitude,), demand=demand
        )
    )


def test_a_motor_that_is_asked_in_vain_after_a_blow_has_not_failed():
    assert Kind.MOTOR_FAILED in kinds(asked_in_vain())
    assert Kind.MOTOR_FAILED not in kinds(asked_in_vain(struck_m_s2=20.0))


def test_a_motor_that_is_asked_in_vain_has_failed_and_is_the_cause():
    flown = asked_in_vain()
    analysis = analyse(flown)
    links = chain(flown, analysis)
    assert links.findings[0].kind is Kind.CRASH
    found = {one.kind: one for one in links.findings}
    assert found[Kind.MOTOR_FAILED].sensor.number == 2
    assert found[Kind.LOSS_OF_CONTROL].cause == found[Kind.MOTOR_FAILED].id
    assert found[Kind.CRASH].cause == found[Kind.LOSS_OF_CONTROL].id
    assert first_causes(links.findings)[found[Kind.CRASH].id] == found[Kind.MOTOR_FAILED].id
    text = verdict(flown, analysis, links).text
    assert text.startswith(
        "Motor 2 gave no thrust at 58 s, then control was lost, then it crashed at 60 s and came "
        "to lie on its back."
    )


# --- sensors ------------------------------------------------------------------------------------


def standing(rate_deg_s: tuple[float, ...] = (0.0,) * 3, force: float = GRAVITY_M_S2) -> Flight:
    """Thirty seconds on the ground, with the noise of a sensor."""
    random = np.random.default_rng(4)
    t_s = np.arange(0.0, 30.0, 0.01)
    w_b = np.array(rate_deg_s) * DEG + random.normal(0.0, 0.1 * DEG, (len(t_s), 3))
    f_b = np.array([0.0, 0.0, -force]) + random.normal(0.0, 0.02, (len(t_s), 3))
    track = ImuTrack(
        0, "IMU", t_s, (t_s * 1e6).astype(np.int64), w_b, f_b, np.full((len(t_s), 3), np.nan)
    )
    context = Context(duration_s=30.0, imus=(track,), armed=(Span(0.0, 30.0, "armed"),))
    return flight()._replace(context=context, estimates=None)


@pytest.mark.parametrize("rate", [(2.5, 0.0, 0.0), (-22.0, -23.0, 1.6)])
def test_a_gyro_that_turns_at_rest_is_found_without_a_compass_and_armed(rate):
    found = kinds(standing(rate))[Kind.GYRO_BIAS]
    assert found.size == pytest.approx(np.linalg.norm(rate), abs=0.1)
    assert (found.severity is Severity.ERROR) == (found.size > 5.0)


def test_a_turn_about_the_vertical_may_be_one():
    assert Kind.GYRO_BIAS not in kinds(standing((0.0, 0.0, 30.0)))
    # None is as even as this, and as slow.
    assert Kind.GYRO_BIAS in kinds(standing((0.2, 0.2, -2.6)))
    assert Kind.GYRO_BIAS not in kinds(standing((1.0, 1.0, 0.5)))


@pytest.mark.parametrize(
    ("force", "kind"),
    [
        (7.9, Kind.ACCELEROMETER_SCALE),
        (3.4, Kind.ACCELEROMETER_SCALE),
        (10.65, Kind.ACCELEROMETER_BIAS),
    ],
)
def test_an_accelerometer_that_does_not_show_gravity_at_rest(force, kind):
    assert kind in kinds(standing(force=force))
    assert not set(kinds(standing(force=9.5))) & {kind}


def test_a_dead_compass_is_told_once_and_nothing_is_fitted_to_it():
    frozen = np.tile([40.0, 3.0, -12.0], (len(T_S), 1))
    rows = CompassRows(0, 0.0, DURATION_S, 1200, 0, False, True)
    flown = with_imu(flight(compass_rows=(rows,)), m_b_ut=frozen)
    analysis = analyse(flown)
    assert {one.kind for one in analysis.findings} == {Kind.COMPASS_DEAD}
    assert not analysis.fields


@pytest.mark.parametrize(("begins_s", "kind"), [(0.0, "whole flight"), (60.0, "grew")])
def test_vibration_is_held_against_the_same_flight(begins_s, kind):
    flown = multirotor()
    first = flown.context.imus[0]
    shaken = np.random.default_rng(5).normal(0.0, 6.0, first.f_b.shape)
    f_b = first.f_b + np.where((first.t_s > begins_s)[:, None], shaken, 0.0)
    found = kinds(with_imu(flown, f_b=f_b))[Kind.VIBRATION]
    assert kind in found.text
    if begins_s:
        assert found.from_s == pytest.approx(begins_s, abs=2.5)


def test_the_battery_is_told_by_number_by_text_and_by_its_voltage():
    fault = ReportedFault(60.0, "battery", 1, "battery failsafe")
    assert kinds(multirotor(faults=(fault,)))[Kind.BATTERY].from_s == 60.0
    said = Said(60.0, Severity.WARNING, "Low battery")
    assert kinds(multirotor(said=(said,)))[Kind.BATTERY].from_s == 60.0
    volts = np.where(T_S > 80.0, 10.0, 15.0)
    unknown = np.full(len(T_S), np.nan)
    battery = Battery(0, T_S, volts, unknown, unknown)
    low = multirotor(batteries=(battery,), parameters={"BATT_LOW_VOLT": 10.5})
    finding = kinds(low)[Kind.BATTERY]
    assert finding.from_s == pytest.approx(80.0, abs=0.1)
    assert "lowest voltage 10.0 V" in finding.evidence
    assert Kind.BATTERY not in kinds(multirotor(batteries=(battery,)))


# --- the verdict --------------------------------------------------------------------------------


def test_nothing_wrong_names_what_was_and_was_not_looked_at():
    text = said_of(flight(armed=(Span(3.0, DURATION_S - 2.0, "armed"),)))
    assert text.startswith(
        "Nothing was found wrong in what could be looked at. Looked at: crash and landing"
    )
    lacking = "motors (no motor outputs), barometer (no barometer), battery (no battery)"
    assert f"Not looked at: attitude against its demand (no demands), {lacking}" in text


def test_a_receiver_that_never_had_a_fix_is_in_the_verdict():
    flown = flight()
    blind = with_gps(flown, has_fix=np.zeros(len(flown.context.gps[0].t_s), np.bool_))
    assert said_of(blind).count("The GPS never had a fix.") == 1
    assert "never had a fix" not in said_of(flown)


def test_what_our_own_attitude_says_of_itself_is_no_fault_of_the_vehicle():
    sensor = Sensor(SensorKind.GPS)
    own = Finding(
        Kind.ATTITUDE_VELOCITY, sensor, Severity.ERROR, 50.0, 60.0, 9.0, "deg", "text", "evidence",
        "attitude_velocity.gps.1",
    )  # fmt: skip
    flown = flight()._replace(findings=(own,))
    links = chain(flown, Analysis())
    assert links.own == {own.id}
    assert links.findings[0].severity is Severity.NOTICE
    assert said_of(flown).startswith("The log ends in flight. Nothing was found wrong")


def test_what_follows_an_impact_folds_under_it():
    flown = tipped(multirotor(), 60.0)
    late = Finding(
        Kind.CLIPPING, Sensor(SensorKind.IMU, 1), Severity.ERROR, 60.5, 61.0, 9.0, "%", "text", "",
        "clipping.imu1.1",
    )  # fmt: skip
    before = late._replace(kind=Kind.GPS_LOST, sensor=Sensor(SensorKind.GPS), id="b", from_s=20.0)
    flown = flown._replace(findings=(late, before))
    links = chain(flown, analyse(flown))
    found = {one.kind: one for one in links.findings}
    assert found[Kind.CLIPPING].cause == found[Kind.CRASH].id
    assert found[Kind.GPS_LOST].cause is None


def test_a_log_that_ends_in_the_air_says_so():
    height = Series(T_S, np.clip(T_S - 20.0, 0.0, 30.0) - np.clip(T_S - 116.0, 0.0, None) * 4.0)
    flown = multirotor(baro_height_m=height)
    assert "The log ends in the air, 16 m above where it began, sinking at 4 m/s." in said_of(flown)
    down = multirotor(baro_height_m=height._replace(values=0.0 * height.values))
    assert "ends in the air" not in said_of(down)
    # Motors also run on a bench, and there a barometer drifts.
    still = flown.context.imus[0]
    f_b = np.tile([0.1, 0.2, -9.7], (len(still.t_s), 1))
    bench = still._replace(w_b=np.full_like(still.w_b, 0.3), f_b=f_b)
    lying = flown._replace(context=flown.context._replace(imus=(bench,)))
    assert "ends in the air" not in said_of(lying)


def test_a_log_that_ends_in_flight_low_above_its_beginning_had_no_crash_that_it_knows_of():
    height = Series(T_S, 1.5 * np.sin(0.2 * T_S))
    flown = multirotor(baro_height_m=height)
    uneven = flown.context._replace(motors=motors((60.0, -20.0, -20.0, -20.0)))
    text = said_of(flown._replace(context=uneven))
    assert "The log ends in flight." in text
    assert "No crash" not in text
    stopped = motors((60.0, -20.0, -20.0, -20.0))
    stopped.pwm_us[T_S > DURATION_S - 2.0] = 1000.0
    landed = said_of(flown._replace(context=uneven._replace(motors=stopped)))
    assert landed.startswith("No crash.")
    assert "ends in" not in landed


@pytest.mark.filterwarnings("error")
def test_a_span_without_samples_as_it_begins_does_not_begin_in_the_air():
    height = Series(T_S, 0.1 * np.sin(T_S))
    flown = multirotor(baro_height_m=height, armed=(Span(1.5, 20.0, "armed"),))
    first = flown.context.imus[0]
    paused = select_rows(first, (first.t_s < 1.0) | (first.t_s > 4.0))
    flown = flown._replace(context=flown.context._replace(imus=(paused,)))
    assert lifted(FlightEvidence(flown)) == ()


def test_what_hovers_too_calmly_to_be_judged_flew():
    height = Series(T_S, np.clip(T_S - 5.0, 0.0, 8.0))
    flown = multirotor(baro_height_m=height, height_m=height)
    first = flown.context.imus[0]
    still = first._replace(w_b=0.0 * first.w_b, f_b=0.0 * first.f_b + [0.0, 0.0, -9.81])
    text = said_of(flown._replace(context=flown.context._replace(imus=(still,))))
    assert "motors (it hardly moved in the air)" in text
    assert "did not fly" not in text


@pytest.mark.parametrize("climbs", [True, False])
def test_a_vehicle_that_hovers_at_little_throttle_flew_where_heights_show_it(climbs):
    """Nothing was recorded of when it was in the air."""
    height = Series(T_S, np.clip(T_S - 5.0, 0.0, 8.0 if climbs else 0.0))
    flown = tipped(multirotor(baro_height_m=height, height_m=height), 60.0)
    weak = motors()
    weak = weak._replace(pwm_us=1000.0 + 0.25 * (weak.pwm_us - 1000.0))
    flown = flown._replace(context=flown.context._replace(motors=weak))
    assert (Kind.CRASH in kinds(flown)) == climbs


@pytest.mark.parametrize(("shaken_m_s2", "is_told"), [(0.0, False), (1.0, True)])
def test_a_bench_that_is_touched_does_not_fly(shaken_m_s2, is_told):
    flown = multirotor()
    first, outputs = flown.context.imus[0], motors()
    outputs.pwm_us[(T_S > 60.0) & (T_S < 65.0), 2] = 1950.0
    waves = np.sin(3.0 * first.t_s)[:, None]
    f_b = np.array([0.1, 0.2, -9.7]) * (1.0 + shaken_m_s2 / 9.7 * waves)
    bench = first._replace(w_b=0.1 * waves * np.ones(3), f_b=f_b)
    flown = flown._replace(context=flown.context._replace(imus=(bench,), motors=outputs))
    assert (Kind.MOTOR_SATURATED in kinds(flown)) is is_told


@pytest.mark.parametrize(("left_s", "is_then"), [(58.0, True), (20.0, False)])
def test_a_crash_on_take_off_is_called_so(left_s, is_then):
    airborne = Series(np.array([0.0, left_s]), np.array([0.0, 1.0]))
    text = said_of(tipped(multirotor(airborne=airborne), 60.0))
    assert text.startswith("Crashed on take-off at 60 s") == is_then


@pytest.mark.parametrize(("every", "is_said"), [(1, True), (20, False)])
def test_that_there_was_no_crash_is_said_where_one_was_looked_for(every, is_said):
    flown = multirotor()
    seldom = select_rows(flown.context.imus[0], slice(None, None, every))
    uneven = motors((60.0, -20.0, -20.0, -20.0))
    uneven.pwm_us[T_S > DURATION_S - 2.0] = 1000.0
    context = flown.context._replace(imus=(seldom,), gps=(), motors=uneven)
    text = said_of(flown._replace(context=context))
    assert text.startswith("No crash. Motor 1 works" if is_said else "Motor 1 works")
    assert ("crash and landing (5 samples a second show no blow" in text) != is_said


def test_a_vehicle_that_turns_far_from_its_demand_and_flies_on_had_lost_control():
    flown = multirotor()
    demand, first = flown.context.demand, flown.context.imus[0]
    asked, w_b = demand.values.copy(), first.w_b.copy()
    asked[(T_S > 60.0) & (T_S < 63.0), 0] += 60.0 * DEG
    context = flown.context._replace(demand=demand._replace(values=asked))
    # Without a turn it is the attitude that is wrong, or the demand.
    assert Kind.LOSS_OF_CONTROL not in kinds(flown._replace(context=context))
    w_b[(T_S > 60.0) & (T_S < 60.3), 0] += 3.0
    finding = kinds(with_imu(flown._replace(context=context), w_b=w_b))[Kind.LOSS_OF_CONTROL]
    assert finding.from_s == pytest.approx(60.0, abs=0.2)
    # A log that begins with it shows none that could have been lost.
    context = context._replace(armed=(Span(60.0, DURATION_S, "armed"),))
    assert Kind.LOSS_OF_CONTROL not in kinds(with_imu(flown._replace(context=context), w_b=w_b))


def test_an_attitude_that_a_wrong_gyro_led_astray_is_no_loss_of_control():
    flown = multirotor()
    sensors = {
        Kind.GYRO_BIAS: (Sensor(SensorKind.IMU, 1), 12.0),
        Kind.LOSS_OF_CONTROL: (Sensor(SensorKind.VEHICLE), 90.0),
    }
    some = tuple(
        Finding(
            kind, sensor, Severity.ERROR, 50.0, 60.0, size, "deg", "text", "", f"{kind}.1",
        )
        for kind, (sensor, size) in sensors.items()
    )  # fmt: skip
    links = chain(flown._replace(findings=some), Analysis())
    lost = next(one for one in links.findings if one.kind is Kind.LOSS_OF_CONTROL)
    assert (lost.cause, lost.severity) == ("gyro_bias.1", Severity.NOTICE)


@pytest.mark.parametrize(
    ("from_s", "severity"), [(45.0, Severity.WARNING), (51.5, Severity.NOTICE)]
)
def test_what_an_accelerometer_shows_once_a_motor_has_failed_is_a_note(from_s, severity):
    failed = Finding(
        Kind.MOTOR_FAILED, Sensor(SensorKind.MOTOR, 1), Severity.CRITICAL, 50.0, 51.0, 0.0, "",
        "text", "", "motor_failed.motor.1",
    )  # fmt: skip
    jumped = failed._replace(
        kind=Kind.ACCELEROMETER_BIAS_STEP,
        sensor=Sensor(SensorKind.IMU, 1),
        severity=Severity.WARNING,
        from_s=from_s,
        id="jumped",
    )
    links = chain(multirotor()._replace(findings=(failed, jumped)), Analysis())
    told = next(one for one in links.findings if one.id == "jumped")
    assert told.severity is severity


@pytest.mark.parametrize(
    ("kind", "lead_s"),
    [
        (Kind.MOTOR_FAILED, 12.0),
        (Kind.GYRO_FROZEN, 12.0),
        (Kind.MOTOR_SATURATED, 5.0),
        (Kind.SAID_EKF_FAILED, 30.0),
    ],
)
@pytest.mark.parametrize("is_in_time", [True, False])
def test_a_crash_is_the_work_of_what_ended_shortly_before_it(kind, lead_s, is_in_time):
    ended_s = 100.0 - lead_s + (0.1 if is_in_time else -0.1)
    before = Finding(
        kind, Sensor(SensorKind.VEHICLE), Severity.ERROR, 50.0, ended_s, 1.0, "", "text", "",
        "before",
    )  # fmt: skip
    crash = before._replace(kind=Kind.CRASH, from_s=100.0, to_s=101.0, id="crash")
    links = chain(multirotor()._replace(findings=(before, crash)), Analysis())
    (told,) = (one for one in links.findings if one.id == "crash")
    assert told.cause == ("before" if is_in_time else None)


@pytest.mark.parametrize(("cleared", "cause"), [((), "field"), (("field",), None)])
def test_an_attitude_of_ours_that_was_wrong_brings_nothing_about(cleared, cause):
    field = Finding(
        Kind.COMPASS_FIELD, Sensor(SensorKind.COMPASS), Severity.ERROR, 10.0, 50.0, 9.0, "", "text",
        "", "field",
    )  # fmt: skip
    quoted = field._replace(kind=Kind.SAID_EKF_FAILED, from_s=40.0, id="quoted")
    analysis = Analysis(cleared=frozenset(cleared))
    links = chain(multirotor()._replace(findings=(field, quoted)), analysis)
    told = next(one for one in links.findings if one.id == "quoted")
    assert told.cause == cause


def test_an_accelerometer_that_was_wrong_at_the_end_explains_what_came_before():
    sensor = Sensor(SensorKind.IMU, 1)
    felt = Finding(
        Kind.ATTITUDE_GRAVITY, sensor, Severity.ERROR, 10.0, 50.0, 9.0, "deg", "text", "", "felt",
    )  # fmt: skip
    scale = felt._replace(kind=Kind.ACCELEROMETER_SCALE, from_s=100.0, to_s=110.0, id="scale")
    links = chain(multirotor()._replace(findings=(felt, scale)), Analysis())
    told = next(one for one in links.findings if one.id == "felt")
    assert (told.cause, told.severity) == ("scale", Severity.ERROR)


@pytest.mark.parametrize("drift_m_s2", [0.0, 3.0])
def test_a_receiver_that_is_blamed_in_flight_is_cleared_where_it_fits(drift_m_s2):
    blame = Finding(
        Kind.GPS_VELOCITY, Sensor(SensorKind.GPS), Severity.WARNING, 60.0, 75.0, 1.0, "", "text",
        "", "gps_velocity.gps.1",
    )  # fmt: skip
    flown = flight()._replace(findings=(blame,))
    gps = flown.context.gps[0]
    v_n = gps.v_n + drift_m_s2 * np.clip(gps.t_s - 60.0, 0.0, 15.0)[:, None]
    context = flown.context._replace(gps=(gps._replace(v_n=v_n),))
    assert (blame.id in analyse(flown._replace(context=context)).cleared) == (drift_m_s2 == 0.0)


@pytest.mark.parametrize(("every", "is_told"), [(2, True), (4, False)])
def test_a_gyro_that_jumps_in_seldom_samples_is_a_note(every, is_told):
    step = Finding(
        Kind.GYRO_BIAS_STEP, Sensor(SensorKind.IMU, 1), Severity.WARNING, 60.0, 75.0, 2.8,
        "deg/s", "text", "", "gyro_bias_step.imu1.1",
    )  # fmt: skip
    track = select_rows(flight().context.imus[0], slice(None, None, every))
    flown = flight(imus=1)._replace(findings=(step,))
    flown = flown._replace(context=flown.context._replace(imus=(track,)))
    links = chain(flown, analyse(flown))
    told = next(one for one in links.findings if one.kind is Kind.GYRO_BIAS_STEP)
    assert (told.severity is Severity.WARNING) == is_told


# --- nobody innocent -----------------------------------------------------------------------------


def finding(kind, sensor, from_s=10.0, to_s=20.0, severity=Severity.WARNING, **changes):
    return Finding(kind, sensor, severity, from_s, to_s, 9.0, "", "text", "evidence")._replace(
        **changes
    )


# --- vibration ----------------------------------------------------------------------------------


def shaken(from_s, to_s, share, size_m_s2=7.0):
    """A flight with noise in a share of the samples for a while."""
    flown = multirotor()
    first = flown.context.imus[0]
    random = np.random.default_rng(5)
    hit = (first.t_s > from_s) & (first.t_s < to_s) & (random.random(len(first.t_s)) < share)
    noise = random.normal(0.0, size_m_s2 / np.sqrt(share), first.f_b.shape)
    return with_imu(flown, f_b=first.f_b + np.where(hit[:, None], noise, 0.0))


def test_a_vibration_of_two_seconds_is_told_and_a_bump_is_not():
    found = kinds(shaken(70.0, 72.5, 1.0))[Kind.VIBRATION]
    assert found.from_s == pytest.approx(70.0, abs=1.5)
    assert Kind.VIBRATION not in kinds(shaken(70.0, 72.5, 0.05))


# --- motors on the ground -----------------------------------------------------------------------


def uneven(height_m, **changes):
    """One motor 80 us above the others, at a height over time."""
    pwm_us = np.full((len(T_S), 4), 1500.0)
    pwm_us[:, 1] += 80.0
    pwm_us[T_S < 3.0] = 1000.0
    flown = multirotor(baro_height_m=Series(T_S, height_m), **changes)
    outputs = flown.context.motors._replace(t_s=T_S, pwm_us=pwm_us)
    return flown._replace(context=flown.context._replace(motors=outputs))


def test_outputs_on_a_bench_say_nothing_of_a_motor():
    climbs = np.clip(T_S - 3.0, 0.0, 10.0)
    noise = np.random.default_rng(3).normal(0.0, 0.2, len(T_S))
    assert Kind.MOTOR_IMBALANCE in kinds(uneven(climbs + noise))
    assert Kind.MOTOR_IMBALANCE not in kinds(uneven(noise))
    # A barometer that warms up drifts by metres, but in minutes.
    assert Kind.MOTOR_IMBALANCE not in kinds(uneven(0.008 * T_S + noise))


def test_a_gyro_that_turns_at_rest_takes_the_motors_evidence_away():
    biased = finding(Kind.GYRO_BIAS, Sensor(SensorKind.IMU, 1), 0.0, 5.0, Severity.ERROR)
    motor = finding(Kind.MOTOR_IMBALANCE, Sensor(SensorKind.MOTOR, 2), 20.0, 90.0)
    flown = flight()
    shown = chain(flown, Analysis(findings=(biased, motor)))
    assert [one.kind for one in shown.findings] == [Kind.GYRO_BIAS]
    alone = chain(flown, Analysis(findings=(motor,)))
    assert [one.kind for one in alone.findings] == [Kind.MOTOR_IMBALANCE]


def test_only_the_compass_of_the_same_number_voids_a_gyros_scale():
    scale = finding(Kind.GYRO_SCALE, Sensor(SensorKind.IMU, 1))
    for number, count in ((1, 1), (2, 2)):
        field = finding(Kind.COMPASS_SCALE, Sensor(SensorKind.COMPASS, number))
        links = chain(flight(), Analysis(findings=(scale, field)))
        assert len(links.findings) == count


# --- the battery's sensor -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("volts", "is_wrong"),
    [
        (np.full(len(T_S), 5.9), True),
        (np.where(T_S < 3.0, 10.0, 10.4), True),
        (np.where(T_S < 3.0, 10.4, 9.2), False),
    ],
)
def test_a_battery_that_no_vehicle_flies_with_accuses_its_sensor(volts, is_wrong):
    unknown = np.full(len(T_S), np.nan)
    pwm_us = np.where(T_S < 3.0, 1000.0, 1600.0)[:, None] + np.zeros((1, 4))
    flown = multirotor(
        batteries=(Battery(0, T_S, volts, unknown, unknown),),
        armed=(Span(0.0, DURATION_S, "armed"),),
        parameters={"FS_BATT_VOLTAGE": 10.5},
    )
    outputs = flown.context.motors._replace(t_s=T_S, pwm_us=pwm_us)
    flown = flown._replace(context=flown.context._replace(motors=outputs))
    assert ("sensor is wrong" in kinds(flown)[Kind.BATTERY].text) == is_wrong


# --- compasses ----------------------------------------------------------------------------------


def test_a_field_that_grows_with_the_throttle_is_of_the_motors_without_a_place():
    flown = multirotor()
    track = flown.context.imus[0]
    throttle = np.where(track.t_s < 20.0, 0.0, 0.5)
    context = flown.context._replace(throttle=Series(track.t_s, throttle))
    still = strength_by_throttle(track, context)
    assert still is None
    moved = track._replace(m_b_ut=track.m_b_ut * (1.0 + 0.8 * throttle[:, None]))
    found = strength_by_throttle(moved, context)
    assert found is not None
    assert found.share == pytest.approx(0.8, abs=0.1)


# --- whose attitude -----------------------------------------------------------------------------


def test_an_attitude_that_the_flight_check_could_not_judge_is_judged_by_the_whole_flight():
    """The receiver's velocity confirms ours; without it, nobody is blamed."""
    flown = flight()
    ours = attitudes(flown.estimates.t_s, flown.estimates.q_nb)
    tilted = ours.q_nb + 0.07 * np.roll(ours.q_nb, 1, axis=1) * np.array([-1.0, 1.0, -1.0, 1.0])
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    theirs = flown.context.attitudes[0]._replace(t_s=ours.t_s, q_nb=tilted)
    context = flown.context._replace(attitudes=(theirs,), parameters={"AHRS_TRIM_X": 0.0})
    blame = finding(Kind.AUTOPILOT_TILT, Sensor(SensorKind.AUTOPILOT), 30.0, 100.0, id="a")
    track = flown.context.imus[0]
    (shown,) = judged(context, track, ours, NEVER, (blame,))
    assert shown.backs_us
    assert "fits ours better" in shown.evidence
    (undecided,) = judged(context._replace(gps=()), track, ours, NEVER, (blame,))
    assert undecided.backs_us is None
    whole = analyse(flown._replace(context=context._replace(gps=()), findings=(blame,)))
    assert blame.id in whole.cleared
    assert shown.size > 3.0 * DEG / DEG
    # Body and board may differ by a trim that the log does not have.
    (turned,) = judged(context._replace(parameters={}), track, ours, NEVER, (blame,))
    assert turned.backs_us is None
    assert "AHRS_TRIM" in turned.evidence

"""Causes of a contradiction between attitude and velocity: the right one is named, or none."""

import math

import numpy as np
import pytest
from lanes import few
from needs import DEG
from synthetic_imu import FIELD, GRAVITY
from velocity_flights import (
    FLYING,
    PERIOD,
    accelerating,
    new_filter,
    surge,
    turning,
    with_noise,
    with_samples,
)

from h2nav.attitude.samples import ImuSample, SensorErrors, VelocityFix
from h2nav.integrity import causes
from h2nav.integrity.causes import NOTHING, Cause, Explained, Known, doubt_of
from h2nav.integrity.findings import Kind, Sensor, SensorKind
from h2nav.integrity.monitor import Monitor, Speeds
from h2nav.integrity.strapdown import Moment
from h2nav.integrity.velocity_rows import Shift, VelocityRows
from h2nav.integrity.velocity_windows import (
    FORCE_SIGMA_M_S2,
    Mark,
    VelocityWindows,
    change_of_velocity,
)
from h2nav.maths import quaternion
from h2nav.service.own_bias import OwnBias

FAULT_S = 40.0
END_S = 60.0
# Kinds of alarms that name a sensor, by the cause that they name.
NAMES = {
    Kind.GYRO_BIAS_STEP: Cause.GYRO,
    Kind.ACCELEROMETER_BIAS_STEP: Cause.ACCELEROMETER,
    Kind.GPS_VELOCITY: Cause.VELOCITY,
}


def explained(
    change=lambda s: s,
    velocity_at=lambda t_s, v_n: v_n,
    seed=7,
    gives=True,
    is_denied=lambda t_s: False,
):
    """Explanations five times a second from the fault on, alarms, and the filter at the end."""
    drive = with_noise(accelerating(END_S, seed, law=turning), 0.2, seed)
    drive = with_samples(drive, lambda i, s: change(s) if s.t_us >= FAULT_S * 1e6 else s)
    filter_, monitor = new_filter(knows_field=True), Monitor(Sensor(SensorKind.IMU, 1), Speeds(9.0))
    monitor.use_vehicle(FLYING)
    monitor.use_field(FIELD)
    marks, rows, bias = VelocityWindows(monitor._strapdown), VelocityRows(), OwnBias()
    found, alarms = [], []
    for i, sample in enumerate(drive.flight.samples):
        t_s = sample.t_us * 1e-6
        if i % PERIOD == 0:
            velocity = velocity_at(t_s, drive.v_n[i])
            fix = VelocityFix(sample.t_us, velocity, 0.3, is_denied=is_denied(t_s))
            errors = bias.errors(filter_.sensor_errors)
            if marks.take(fix, errors) and rows.take(marks.marks[-1], errors) and t_s > FAULT_S:
                moment = marks.marks[-1].moment
                known = Known(errors, moment, rows.jitter_m_s, is_denied=fix.is_denied)
                found.append(causes.explain(rows.rows, known))
            doubt = monitor.fix(fix, errors)
            if doubt is not None and gives:
                if doubt.correction is not None:
                    bias.correct(doubt.correction)
                filter_.doubt(doubt)
            if not (monitor.velocity_is_false or fix.is_denied):
                filter_.use_velocity(fix)
            alarms += monitor.alarms(sample.t_us)
        monitor.check(sample)
        estimate = bias.update(filter_, bias.felt(sample))
        if estimate is not None:
            monitor.add(sample, estimate)
    return found, alarms, filter_


def jump(t_s, v_n):
    return (v_n[0] + (5.0 if t_s >= FAULT_S else 0.0), *v_n[1:])


def ramp(t_s, v_n):
    return (v_n[0] + 0.7 * max(t_s - FAULT_S, 0.0), *v_n[1:])


def gyro(s):
    return s._replace(w_b=(s.w_b[0] + 0.9 * DEG, s.w_b[1] - 0.7 * DEG, s.w_b[2]))


def accelerometer(s):
    return s._replace(f_b=(s.f_b[0] + 0.8, s.f_b[1] - 0.6, s.f_b[2]))


FAULTS = {
    "gyro": ({"change": gyro}, Cause.GYRO),
    "accelerometer": ({"change": accelerometer}, Cause.ACCELEROMETER),
    "jump": ({"velocity_at": jump}, Cause.VELOCITY),
    "ramp": ({"velocity_at": ramp}, Cause.VELOCITY),
}


@pytest.mark.parametrize("seed", few(1, [1, 2, 3]))
def test_nothing_has_to_be_explained_where_nothing_is_wrong(seed):
    found, alarms, _ = explained(seed=seed)
    assert not any(one.is_contradiction for one in found)
    assert not [alarm for alarm in alarms if alarm.kind in NAMES]


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("seed", few(1, [1, 2, 3]))
def test_a_cause_is_seen_and_no_other_one_is_named(name, seed):
    given, cause = FAULTS[name]
    found, alarms, _ = explained(seed=seed, gives=False, **given)
    assert any(one.is_contradiction for one in found[:100])
    decided = {one.decided for one in found} - {None, Cause.VIBRATION}
    assert decided <= {cause}
    named = {NAMES[alarm.kind] for alarm in alarms if alarm.kind in NAMES}
    assert named <= {cause}


@pytest.mark.parametrize("seed", few(1, [7, 8, 9]))
def test_a_velocity_that_its_places_deny_is_false_whatever_it_looks_like(seed):
    held = {}

    def velocity_at(t_s, v_n):
        return v_n if t_s <= FAULT_S else held.setdefault(0, v_n)

    found, alarms, _ = explained(
        velocity_at=velocity_at, seed=seed, is_denied=lambda t_s: t_s > FAULT_S + 2.0
    )
    denied = [one for one in found if one.shares == ((Cause.VELOCITY, 1.0),)]
    assert len(denied) > 40
    contradicting = [one for one in denied if one.is_contradiction]
    assert contradicting
    assert all(one.decided is Cause.VELOCITY for one in contradicting)
    # The attitude goes back to what was known when the window began, and no sensor is corrected.
    assert all(one.carried is not None and one.correction is None for one in contradicting)
    assert {NAMES[alarm.kind] for alarm in alarms if alarm.kind in NAMES} == {Cause.VELOCITY}


def test_a_gyros_error_is_found_about_its_axes():
    found, _, _ = explained(change=gyro, gives=False)
    rates = [one.rate_b for one in found if one.share(Cause.GYRO) > 0.5 and one.odds > 5.0]
    assert rates
    along = [(x - y) / math.sqrt(2.0) for x, y, _ in rates]
    assert sum(along) / len(along) > 0.3 * DEG


def test_what_is_not_suspected_is_not_doubted():
    assert doubt_of(NOTHING) is None
    shares = ((Cause.GYRO, 0.25), (Cause.ACCELEROMETER, 0.0))
    suspected = Explained(6.0, shares, rate_b=(0.02, 0.0, -0.01))
    doubt = doubt_of(suspected)
    assert doubt is not None
    assert doubt.rate_b == pytest.approx((0.01, 0.0, 0.005))
    assert doubt.force_b == (0.0, 0.0)
    assert suspected.decided is None


def test_a_doubt_opens_what_is_known_and_never_closes_it():
    filter_ = new_filter()
    state = filter_.kernel_state
    before = (state.p_xx, state.p_yy, state.p_zz)
    filter_.know_sensors(SensorErrors((1e-8, 1e-8, 1e-8)), 0.0)
    filter_.doubt(causes.SensorDoubt((1e-3, 0.0, 1.0)))
    assert state.p_xx == pytest.approx(1e-6)
    assert state.p_yy < 1e-7
    assert state.p_zz <= before[2]


# --- signatures, beside an attitude that nobody corrects ----------------------------------------

NOWHERE = (0.0, 0.0)
# Of a mark: nothing sweeps, a sound accelerometer, and no way along the body's axes.
SOUND = (NOWHERE,) * 3, NOWHERE, FORCE_SIGMA_M_S2, ((0.0,) * 3,) * 2
ERRORS = SensorErrors(((0.05 * DEG) ** 2,) * 3, force_variance=(0.01, 0.01), force_density=4e-6)
LENGTH_S = 10.0


def signature(
    heading_rad=0.0,
    force_at=lambda t_s: (0.0, 0.0, 0.0),
    v_at=None,
    errors=ERRORS,
    seed=1,
    tilt_rad=0.0,
    cleared=(),
    sigma_heading_rad=2.0 * DEG,
    shifts=(),
    force_density=math.inf,
    min_odds=0.0,
):
    """What 10 s show of a flight whose dead reckoning starts with these errors."""
    drive = accelerating(LENGTH_S + 0.5, seed, law=turning, bias_b=(0.0, 0.0, 0.0))
    q_ns = quaternion.from_euler(tilt_rad, 0.0, heading_rad)
    rng = np.random.default_rng(seed)
    rows, gained, before = VelocityRows(), np.zeros(3), None
    for i, q_nb in enumerate(drive.flight.q_nb):
        t_s = 0.01 * i
        if i % PERIOD == 0:
            v_n = drive.v_n[i] if v_at is None else v_at(t_s, drive.v_n)
            moment = Moment(
                i * 10_000, tuple(gained), q_ns, 0.3 * DEG, sigma_heading_rad, 0.0, 0.0, 0.0, q_nb
            )
            felt_n = accel_n = jerk_n = (0.0, 0.0)
            if before is not None:
                felt_n = change_of_velocity(before.moment, moment)[:2]
                accel_n = (felt_n[0] / 0.2, felt_n[1] / 0.2)
                jerk_n = tuple((b - a) / 0.2 for a, b in zip(before.accel_n, accel_n, strict=True))
            noise = rng.normal(0.0, 0.05, 2)
            v_n = (v_n[0] + noise[0], v_n[1] + noise[1])
            mark = Mark(moment, v_n, 0.1, felt_n, accel_n, jerk_n, *SOUND)
            knows = errors(t_s) if callable(errors) else errors
            rows.take(mark, knows)
            before = mark
        x, y, z = surge(t_s)
        a, b, c = force_at(t_s)
        north, east, down = quaternion.rotate(q_nb, (x + a, y + b, z + c))
        gained += 0.01 * np.array((north, east, down - GRAVITY))
    known = Known(knows, mark.moment, rows.jitter_m_s, force_density=force_density, shifts=shifts)
    return causes.explain(rows.rows, known, cleared, min_odds=min_odds)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_sound_flight_has_no_cause(seed):
    found = signature(seed=seed)
    assert found.odds < 1.0
    assert doubt_of(found) is None


DRIFTS_M_S2 = (0.0, 0.04, 0.08, 0.12, 0.16, 0.2, 0.3, 0.7)


@pytest.mark.parametrize(
    ("min_odds", "wanted"),
    [(causes.SUSPECTED, "is_suspicious"), (causes.MIN_OF_EITHER, "is_force_or_velocity")],
)
@pytest.mark.parametrize("part", ["velocity", "force"])
def test_only_what_nobody_would_use_is_left_out(part, min_odds, wanted):
    compared, left_out = [], []
    for size in DRIFTS_M_S2:
        fault = {
            "velocity": {
                "v_at": lambda t_s, v_n, size=size: (
                    v_n[round(100.0 * t_s)][0] + size * max(t_s - 5.0, 0.0),
                    *v_n[round(100.0 * t_s)][1:],
                )
            },
            "force": {"force_at": lambda t_s, size=size: (size * (t_s > 5.0), 0.0, 0.0)},
        }[part]
        whole, found = signature(**fault), signature(**fault, min_odds=min_odds)
        if found == NOTHING:
            left_out.append(getattr(whole, wanted))
        else:
            compared.append(getattr(whole, wanted))
            assert found == whole
    assert left_out
    assert not any(left_out)
    assert any(compared)


@pytest.mark.parametrize("heading_deg", [-40.0, 15.0, 30.0])
def test_a_wrong_heading_turns_the_acceleration(heading_deg):
    found = signature(heading_deg * DEG)
    assert found.decided is Cause.HEADING


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_wrong_attitude_is_no_false_velocity_and_opens_the_deviations(seed):
    found = signature(20.0 * DEG, tilt_rad=12.0 * DEG, seed=seed)
    assert found.is_contradiction
    assert found.decided in (None, Cause.ATTITUDE)
    assert found.tilt_rad == pytest.approx(12.0 * DEG, rel=0.2)
    assert found.heading_rad == pytest.approx(20.0 * DEG, rel=0.3)
    doubt = doubt_of(found)
    assert doubt is not None
    assert (doubt.tilt_rad > 0.0) is (found.decided is Cause.ATTITUDE)


def test_a_drift_opens_the_tilt_by_what_it_would_bend():
    found = signature(v_at=lambda t_s, v_n: ramp(35.0 + t_s, v_n[round(100.0 * t_s)]))
    assert found.share(Cause.VELOCITY) > 0.9
    assert found.drift_m_s2 == pytest.approx(0.7, rel=0.2)
    assert not found.has_jumped


@pytest.mark.parametrize(("at_s", "is_decided"), [(1.1, False), (5.1, True), (8.1, True)])
def test_a_jump_is_decided_while_what_was_before_is_seen(at_s, is_decided):
    def jumped(t_s, v_n):
        north, east, down = v_n[round(100.0 * t_s)]
        return (north + (2.0 if t_s > at_s else 0.0), east, down)

    found = signature(v_at=jumped)
    assert found.share(Cause.VELOCITY) > 0.9
    assert (found.decided is Cause.VELOCITY) is is_decided


@pytest.mark.parametrize(("at_s", "has_jumped"), [(8.1, True), (9.7, False)])
def test_a_jump_is_one_once_the_velocity_agrees_again(at_s, has_jumped):
    def jumped(t_s, v_n):
        north, east, down = v_n[round(100.0 * t_s)]
        return (north + (2.0 if t_s > at_s else 0.0), east, down)

    assert signature(v_at=jumped).has_jumped is has_jumped


def test_vibration_that_the_samples_show_is_named():
    rng = np.random.default_rng(3)

    def shaken(_t_s):
        return tuple(rng.normal(0.0, 5.0, 3))

    assert signature(force_at=shaken, errors=ERRORS._replace(force_density=5e-3)).decided is (
        Cause.VIBRATION
    )
    # ... and is not accused where they show none.
    assert signature(force_at=shaken).decided is None


def drifting(m_s2):
    """Velocities that drift north from the midst of the window on."""

    def velocity_at(t_s, v_n):
        north, east, down = v_n[round(100.0 * t_s)]
        return (north + m_s2 * max(t_s - 5.0, 0.0), east, down)

    return velocity_at


@pytest.mark.parametrize(
    ("shaken_m_s2", "may_be_hidden"), [(1.8, False), (12.0, True), (24.0, True)]
)
def test_a_drift_may_be_a_shaken_force_if_that_is_rectified_to_so_much(shaken_m_s2, may_be_hidden):
    shaken = ERRORS._replace(force_density=0.01 * shaken_m_s2**2)
    found = signature(v_at=drifting(1.1), errors=shaken, force_density=0.01)
    velocity, vibration = found.share(Cause.VELOCITY), found.share(Cause.VIBRATION)
    assert velocity + vibration > 0.1
    assert (vibration > 0.4 * velocity) is may_be_hidden


@pytest.mark.parametrize(
    ("before", "behind", "may_be_a_blow"),
    [(0.03, 0.03, False), (0.03, 0.2, True), (0.2, 0.2, True)],
)
def test_a_jump_is_a_blow_that_samples_miss_only_where_the_force_shakes_by_as_much(
    before, behind, may_be_a_blow
):
    """Whether it shook so before or not: 0.125 m^2/s^3 is asked of a blow of 3 m/s."""

    def jumped(t_s, v_n):
        north, east, down = v_n[round(100.0 * t_s)]
        return (north + (3.0 if t_s > 5.1 else 0.0), east, down)

    def errors(t_s):
        # It has faded again at the end.
        density = before if not 5.1 < t_s < 8.0 else behind
        return ERRORS._replace(force_density=density)

    found = signature(v_at=jumped, errors=errors)
    vibration, velocity = found.share(Cause.VIBRATION), found.share(Cause.VELOCITY)
    assert vibration + velocity > 0.9
    if may_be_a_blow:
        assert vibration == pytest.approx(velocity, rel=0.1)
    else:
        assert found.decided is Cause.VELOCITY


@pytest.mark.parametrize("period_s", [0.005, 0.01, 0.02])
@pytest.mark.parametrize(
    ("parts", "times"), [((1.0,), 12.0), ((0.5, 0.5), 2.0), ((0.8, 0.2), 5.6), ((0.3, 0.7), 3.6)]
)
def test_a_blow_of_one_or_two_samples_leaves_a_trace_in_their_noise(period_s, parts, times):
    """Of the size that is taken for a blow at least twice as much."""
    change_m_s, at = 3.0, round(8.0 / period_s)
    blow = [change_m_s * part / period_s for part in parts]
    filter_, largest = new_filter(), 0.0
    for i in range(round(10.0 / period_s)):
        x = blow[i - at] if at <= i < at + len(blow) else 0.0
        filter_.update(ImuSample(round(1e6 * i * period_s), (0.0,) * 3, (x, 0.0, -GRAVITY)))
        largest = max(largest, filter_.sensor_errors.force_density)
    assert largest / (causes.BLOW_DENSITY * change_m_s**2) == pytest.approx(times, rel=0.05)


def test_a_late_receiver_is_not_a_false_velocity():
    def late(t_s, v_n):
        return v_n[max(round(100.0 * (t_s - (0.4 if t_s > 5.3 else 0.0))), 0)]

    found = signature(v_at=late)
    assert found.share(Cause.LATENCY) > found.share(Cause.VELOCITY)


def test_an_accelerometer_is_named_only_where_it_was_seen_to_fail():
    def since(begin_s):
        return signature(force_at=lambda t_s: (0.7, -0.5, 0.0) if t_s >= begin_s else (0.0,) * 3)

    found = since(4.0)
    assert found.decided is Cause.ACCELEROMETER
    assert found.step == pytest.approx(math.hypot(0.7, 0.5), abs=0.15)
    # ... and certainly began there.
    assert since(0.4).decided is None
    # Off all the time: it may be what was learnt of it that is wrong.
    found = since(0.0)
    assert found.share(Cause.ACCELEROMETER) > 0.5
    assert found.decided is None


@pytest.mark.parametrize(
    ("size_m_s2", "from_s", "is_cleared"), [(0.4, 6.0, True), (3.0, 6.0, True), (0.4, 0.0, False)]
)
def test_agreement_clears_an_accelerometer_that_fails_not_an_error_from_before(
    size_m_s2, from_s, is_cleared
):
    def push(t_s):
        return (size_m_s2, 0.0, 0.0) if t_s > from_s else (0.0, 0.0, 0.0)

    alone = signature(force_at=push)
    beside = signature(force_at=push, cleared=(Cause.ACCELEROMETER,))

    def against_velocity(found):
        return math.log(found.share(Cause.ACCELEROMETER) / found.share(Cause.VELOCITY))

    lost = against_velocity(alone) - against_velocity(beside)
    expected = math.log(causes.FAIL_ALIKE)
    if is_cleared:
        assert lost == pytest.approx(expected, abs=0.5)
    else:
        assert lost < 0.5 * expected


@pytest.mark.parametrize("has_stepped", [False, True])
def test_an_accelerometer_that_fails_shows_its_step_in_the_force(has_stepped):
    """A drift of the velocity and a bias look alike for seconds; only one is in the force."""
    at_s = 6.0
    calm = [
        Shift(round(4e5 * i), 0.05 * (-1) ** i, 0.05 * (-1) ** (i // 2)) for i in range(-20, 25)
    ]
    stepped = [
        shift._replace(forward_m_s2=shift.forward_m_s2 + 0.5)
        if has_stepped and abs(1e-6 * shift.t_us + 0.2 - at_s) < 0.3
        else shift
        for shift in calm
    ]

    def push(t_s):
        return (0.5 if t_s > at_s else 0.0, 0.0, 0.0)

    def odds(shifts):
        found = signature(force_at=push, shifts=shifts)
        return math.log(found.share(Cause.ACCELEROMETER) / found.share(Cause.VELOCITY))

    gained = odds(stepped) - odds(())
    assert gained > math.log(3.0) if has_stepped else gained < -math.log(100.0)
    # Too few changes do not show what is usual.
    assert odds(stepped[:20]) == odds(())


def test_a_step_of_the_force_is_no_contradiction():
    """It says which cause there is: a manoeuvre that begins steps as well."""
    stepped = [
        Shift(round(4e5 * i), 0.6 if i == 15 else 0.05 * (-1) ** i, 0.05 * (-1) ** (i // 2))
        for i in range(-20, 25)
    ]

    def push(t_s):
        return (0.35 if t_s > 6.0 else 0.0, 0.0, 0.0)

    assert signature(force_at=push, shifts=stepped).odds <= signature(force_at=push).odds + 1e-9


def test_a_heading_that_may_be_any_keeps_the_size_of_a_change():
    def jumped(t_s, v_n):
        north, east, down = v_n[round(100.0 * t_s)]
        return (north + (6.0 if t_s > 8.1 else 0.0), east, down)

    found = signature(v_at=jumped, sigma_heading_rad=20.0 * DEG)
    assert found.decided is Cause.VELOCITY
    found = signature(60.0 * DEG, sigma_heading_rad=20.0 * DEG)
    assert found.share(Cause.HEADING) >= found.share(Cause.VELOCITY)


def test_a_turn_that_nobody_saw_says_nothing_of_a_long_window():
    rows = VelocityRows()
    for i in range(60):
        t_s = 0.2 * i
        v_n = (3.0 * max(t_s - 8.0, 0.0), 0.0)
        gained_s = (0.0, 0.0, -GRAVITY * t_s)
        still = Moment(round(1e6 * t_s), gained_s, (1.0, 0.0, 0.0, 0.0), 0.01, 0.02, 0.0, 0.0, 0.0)
        rows.take(Mark(still, v_n, 0.1, NOWHERE, NOWHERE, NOWHERE, *SOUND), ERRORS)
    known = Known(ERRORS, still, rows.jitter_m_s)
    assert causes.explain(rows.rows, known, (), 4.0 * DEG).is_contradiction
    assert causes.explain(rows.rows, known, (), 0.1 * DEG) == NOTHING


def test_a_broken_gyro_is_learnt_anew_only_where_it_is_decided():
    sure = ((Cause.GYRO, 0.9999), (Cause.VELOCITY, 1e-5))
    unsure = ((Cause.GYRO, 0.6), (Cause.VELOCITY, 0.4))
    for shares, least in ((sure, 9.0 * DEG), (unsure, 0.0)):
        doubt = doubt_of(Explained(50.0, shares, rate_b=(10.0 * DEG, 0.0, 0.0)))
        assert doubt is not None
        assert least <= doubt.rate_b[0] <= 1.2 * least
    # A small error is, by its probability; what may as well be a false velocity counts for less.
    doubt = doubt_of(Explained(50.0, unsure, rate_b=(1.0 * DEG, 0.0, 0.0)))
    assert doubt is not None
    assert 0.5 * DEG < doubt.rate_b[0] < 0.7 * DEG


def test_rows_begin_anew_after_a_gap_of_the_receiver():
    rows = VelocityRows()
    times_s = [0.2 * i for i in range(30)] + [66.0 + 0.2 * i for i in range(10)]
    for t_s in times_s:
        still = Moment(
            round(1e6 * t_s),
            (0.0, 0.0, -GRAVITY * t_s),
            (1.0, 0.0, 0.0, 0.0),
            0.1,
            0.1,
            0.0,
            0.0,
            0.0,
        )
        rows.take(Mark(still, NOWHERE, 0.1, NOWHERE, NOWHERE, NOWHERE, *SOUND), ERRORS)
    assert len(rows.rows) == 4
    assert all(row.begun.moment.t_us >= 66_000_000 for row in rows.rows)
    assert all(0.35 < row.length_s < 0.45 for row in rows.rows)
    # Too few of them to be compared.
    assert causes.explain(rows.rows, Known(ERRORS, still, rows.jitter_m_s)) == NOTHING

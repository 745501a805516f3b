"""When force and rate show that a flight ended hard: just enough, and just too little."""

import math

import numpy as np
import pytest
from known_evidence import flying_bins, imu_track
from scipy.spatial.transform import Rotation

from h2nav.integrity.findings import Kind, Severity
from h2nav.maths.rows import select_rows
from h2nav.recordings.context import Context, Motors, ReportedFault, Said, Series, Span
from h2nav.reviews.impacts import (
    Impact,
    binned,
    crash_checks,
    detect_crash_checks,
    detect_impacts,
    driven_at,
    high_above,
    impacts,
    in_flight,
    with_contacts,
)
from h2nav.reviews.vertical import Climb, Contact

G = 9.80665
DEG = math.pi / 180.0
END_S, UP_S, AT_S = 60.0, 10.0, 40.0
T_S = np.arange(0.0, END_S, 0.02)
OUT_S = np.arange(0.0, END_S, 0.1)
ARMED = (Span(2.0, 50.0, ""),)
QUAD, PLANE = 2, 1


def motors(stop_s=AT_S, share=0.5, again=None, from_s=UP_S):
    """Outputs that carry it for a time; `again`: another one, and its share."""
    shares = np.where((from_s - 0.01 < OUT_S) & (stop_s - 0.01 > OUT_S), share, 0.0)
    if again is not None:
        shares[(again[0] - 0.01 < OUT_S) & (again[1] - 0.01 > OUT_S)] = again[2]
    pwm_us = np.tile(1000.0 + 1000.0 * shares[:, None], (1, 4))
    return Motors((1, 2, 3, 4), OUT_S, pwm_us, 1000.0, 2000.0)


def imu(
    blow_g=8.0,
    blow_deg_s=400.0,
    tilt_deg=0.0,
    lies_s=1.0,
    turned_deg=0.0,
    usual_g=1.0,
    rests_s=END_S,
    still_deg_s=0.0,
    stood_deg=0.0,
    after_g=1.0,
):
    """A flight that ends with a blow, after which it lies, from some time on.

    Args:
        turned_deg: about the nose in the second before.
        usual_g: of the vibration in flight, up and down by turns.
        stood_deg: by which it stood on its side at the start.
        rests_s: until when it lies so.
    """
    f_b = np.tile([0.0, 0.0, -G], (len(T_S), 1))
    w_b = np.zeros((len(T_S), 3))
    flies = (T_S > UP_S) & (AT_S - 0.001 > T_S)
    w_b[flies] = np.random.default_rng(1).normal(0.0, 0.1, (flies.sum(), 3))
    if usual_g > 1.0:
        f_b[flies, 2] = np.where(np.arange(flies.sum()) % 2, -usual_g * G, (usual_g - 2.0) * G)
    f_b[T_S < UP_S] = Rotation.from_rotvec([stood_deg * DEG, 0, 0]).apply(f_b[0])
    turning = (AT_S - 1.0 < T_S) & (AT_S - 0.001 > T_S)
    w_b[turning] += (turned_deg * DEG, 0.0, 0.0)
    lies = (AT_S + lies_s - 0.001 < T_S) & (AT_S + rests_s > T_S)
    lying = Rotation.from_rotvec([tilt_deg * DEG, 0.0, 0.0])
    f_b[lies] = after_g * lying.apply([0.0, 0.0, -G])
    w_b[lies] = (0.0, 0.0, still_deg_s * DEG)
    hit = (AT_S - 0.001 < T_S) & (AT_S + 0.099 > T_S)
    f_b[hit] = (0.0, 0.0, -blow_g * G)
    w_b[hit] = (0.0, blow_deg_s * DEG, 0.0)
    return imu_track(T_S, w_b, f_b)


def found_in(track=None, armed=ARMED, vertical=(), outputs=None, **context):
    outputs = motors() if outputs is None else outputs
    made = Context(**{"armed": armed, "motors": outputs, "vehicle_type": QUAD, **context})
    return impacts(imu() if track is None else track, made, vertical)


def test_what_is_measured_of_a_blow():
    (found,) = found_in(imu(tilt_deg=90.0))
    assert found.t_s == pytest.approx(AT_S, abs=0.11)
    assert (found.to_s, found.is_crash) == (50.0, True)
    assert found.peak_g == pytest.approx(8.0)
    assert found.peak_rad_s == pytest.approx(400.0 * DEG)
    assert found.tilt_rad == pytest.approx(90.0 * DEG)
    assert math.isnan(found.speed_m_s)
    (finding,) = detect_impacts([found])
    assert (finding.kind, finding.severity) == (Kind.CRASH, Severity.CRITICAL)
    assert (finding.text, finding.to_s) == ("crashed: 8.0 g", 50.0)
    assert finding.size == pytest.approx(8.0 * G)
    assert finding.evidence == (
        "force up to 8.0 g and rates up to 400 deg/s; it came to lie 90 deg from how it had stood"
    )


CRASHED, LANDED, NOTHING = [True], [False], []


@pytest.mark.parametrize(
    ("how", "outcome"),
    [
        # on its side after a blow that is no person's
        ({"tilt_deg": 31.0, "blow_g": 2.1, "blow_deg_s": 0.0}, CRASHED),
        ({"tilt_deg": 29.0, "blow_g": 2.1, "blow_deg_s": 0.0}, NOTHING),
        ({"tilt_deg": 31.0, "blow_g": 1.9, "blow_deg_s": 0.0}, NOTHING),
        # steadily, at a force near gravity, within some seconds of the blow
        ({"tilt_deg": 90.0, "rests_s": 1.45}, LANDED),
        ({"tilt_deg": 90.0, "rests_s": 1.65}, CRASHED),
        ({"tilt_deg": 90.0, "after_g": 0.72}, CRASHED),
        ({"tilt_deg": 90.0, "after_g": 0.68}, LANDED),
        ({"tilt_deg": 90.0, "after_g": 1.28}, CRASHED),
        ({"tilt_deg": 90.0, "after_g": 1.32}, LANDED),
        ({"tilt_deg": 90.0, "lies_s": 5.0, "blow_g": 3.0}, CRASHED),
        ({"tilt_deg": 90.0, "lies_s": 6.5, "blow_g": 3.0}, NOTHING),
        # a hard landing: 5 g, and a rough one
        ({"blow_g": 5.1}, LANDED),
        ({"blow_g": 4.9}, NOTHING),
        ({"blow_deg_s": 310.0}, LANDED),
        ({"blow_deg_s": 290.0}, NOTHING),
        # beyond the vibration of the whole flight
        ({"usual_g": 3.0, "blow_g": 7.6}, LANDED),
        ({"usual_g": 3.0, "blow_g": 7.4}, NOTHING),
        # it had turned over on its way
        ({"turned_deg": 76.0, "blow_deg_s": 0.0}, CRASHED),
        ({"turned_deg": 64.0, "blow_deg_s": 0.0}, NOTHING),
        ({"turned_deg": 64.0}, LANDED),
        # a board that is mounted on its side, or a vehicle that stood so
        ({"tilt_deg": 60.0, "stood_deg": 60.0}, LANDED),
        ({"tilt_deg": 60.0, "stood_deg": -60.0}, CRASHED),
        ({"tilt_deg": 0.0, "stood_deg": 60.0}, LANDED),
    ],
)
def test_what_a_multirotor_shows(how, outcome):
    assert [one.is_crash for one in found_in(imu(**how))] == outcome


@pytest.mark.parametrize(
    ("how", "outcome"),
    [
        ({"tilt_deg": 46.0}, CRASHED),
        ({"tilt_deg": 44.0}, LANDED),
        ({"tilt_deg": 46.0, "still_deg_s": 2.9}, CRASHED),
        ({"tilt_deg": 46.0, "still_deg_s": 3.1}, LANDED),
    ],
)
def test_what_else_flies_lies_at_rest(how, outcome):
    throttle = Series(OUT_S, np.where((OUT_S > UP_S) & (OUT_S < AT_S), 0.5, 0.0))
    made = Context(armed=ARMED, throttle=throttle, vehicle_type=PLANE)
    assert [one.is_crash for one in impacts(imu(**how), made, ())] == outcome


@pytest.mark.parametrize(
    ("outputs", "outcome"),
    [
        # it is down within three seconds, for one
        (motors(again=(AT_S + 1.1, 50.0, 0.5)), LANDED),
        (motors(again=(AT_S + 0.7, 50.0, 0.5)), NOTHING),
        (motors(AT_S + 2.8), LANDED),
        (motors(AT_S + 3.5), NOTHING),
        (motors(again=(AT_S, 50.0, 0.14)), LANDED),
        (motors(again=(AT_S, 50.0, 0.16)), NOTHING),
        # it had flown, for half a second within the eight before
        (motors(AT_S - 7.3), LANDED),
        (motors(AT_S - 7.6), NOTHING),
        (motors(share=0.21), LANDED),
        (motors(share=0.0), NOTHING),
    ],
)
def test_it_flew_before_and_not_after(outputs, outcome):
    still = imu(still_deg_s=0.0)
    # what moves after the blow as in flight is not down by that
    moves = (T_S > AT_S + 0.2) & (T_S < 50.0)
    still.w_b[moves] = np.random.default_rng(2).normal(0.0, 0.1, (moves.sum(), 3))
    assert [one.is_crash for one in found_in(still, outputs=outputs)] == outcome


def test_an_armed_time_that_ends_is_down():
    flown_on = motors(50.0)
    for disarmed_s, outcome in ((AT_S + 2.9, LANDED), (AT_S + 3.1, NOTHING)):
        moving = imu(lies_s=30.0)
        moves = (T_S > AT_S + 0.2) & (T_S < 50.0)
        moving.w_b[moves] = np.random.default_rng(2).normal(0.0, 0.1, (moves.sum(), 3))
        found = found_in(moving, (Span(2.0, disarmed_s, ""),), outputs=flown_on)
        assert [one.is_crash for one in found] == outcome
    # three seconds behind it still belong to it, unless it is armed again
    for armed, count in (
        ((Span(2.0, AT_S - 2.9, ""),), 1),
        ((Span(2.0, AT_S - 3.2, ""),), 0),
        ((Span(2.0, AT_S - 2.9, ""), Span(AT_S - 2.0, AT_S - 1.0, "")), 1),
    ):
        assert len(found_in(imu(tilt_deg=90.0, lies_s=0.2), armed)) == count
    assert found_in(imu_track(T_S[:9])) == []


def climb(source, climb_m_s, from_s, lasts_s):
    t_s = np.arange(0.0, END_S, 0.1)
    inside = (from_s - 0.01 < t_s) & (from_s + lasts_s + 0.01 > t_s)
    values = [source, t_s, np.where(inside, climb_m_s, 0.0)]
    return Climb(*values, *[None] * (len(Climb._fields) - 3))


@pytest.mark.parametrize(
    ("speeds", "from_s", "lasts_s", "is_told"),
    [
        ((-9.0, -9.0), 44.0, 1.0, False),
        ((-9.0,), 44.0, 1.0, True),
        ((-9.0, 9.0), 44.0, 1.0, True),
        ((-9.0, -9.0), 44.0, 0.1, True),
        ((-0.1, -0.1), 44.0, 1.0, True),
        ((-9.0, -9.0), 51.0, 1.0, True),
    ],
)
def test_what_climbs_or_sinks_afterwards_does_not_lie(speeds, from_s, lasts_s, is_told):
    vertical = [climb(f"source {n}", v, from_s, lasts_s) for n, v in enumerate(speeds)]
    lying = imu(tilt_deg=90.0, blow_g=3.0, rests_s=5.0)
    assert bool(found_in(lying, vertical=vertical)) == is_told


# --- descents that end ----------------------------------------------------------------------------

MANY = ("the barometer", "the receiver")


def contact(speed_m_s=7.0, stop_g=2.0, shown_by=MANY, denied_by=(), t_s=AT_S):
    known = {"t_s": t_s, "speed_m_s": speed_m_s, "stop_m_s2": stop_g * G, "shown_by": shown_by,
             "denied_by": denied_by}  # fmt: skip
    return Contact(**known)


BLOW = Impact(AT_S, 50.0, 6.0, 7.0, 0.1, 0.0, AT_S, is_crash=False)


@pytest.mark.parametrize(
    ("met", "speed_m_s", "is_crash"),
    [
        (contact(), 7.0, True),
        (contact(shown_by=MANY[:1]), 7.0, True),
        (contact(6.4), 6.4, True),
        (contact(6.2), 6.2, False),
        (contact(stop_g=1.51), 7.0, True),
        (contact(stop_g=1.49), 7.0, False),
        (contact(shown_by=MANY[:1], denied_by=MANY[1:]), None, False),
        (contact(denied_by=("the estimator",)), 7.0, True),
        (contact(shown_by=()), None, False),
        (contact(t_s=AT_S + 1.9), 7.0, True),
        (contact(t_s=AT_S - 2.1, shown_by=MANY[:1]), None, False),
    ],
)
def test_a_blow_has_the_speed_of_the_descent_that_it_ended(met, speed_m_s, is_crash):
    made = flying_bins(END_S)
    (found,) = with_contacts([BLOW], [met], made, Context(armed=ARMED))
    assert found.is_crash == is_crash
    assert (None if math.isnan(found.speed_m_s) else found.speed_m_s) == speed_m_s
    assert found.shown_by == (() if speed_m_s is None else met.shown_by)
    (finding,) = detect_impacts([found])
    word = "crashed" if is_crash else "landed hard"
    size = "" if speed_m_s is None else f"at {speed_m_s:.1f} m/s, "
    assert finding.text == f"{word}: {size}6.0 g"
    if speed_m_s is not None:
        show = "shows" if len(met.shown_by) == 1 else "show"
        sources = " and ".join(met.shown_by)
        assert f"; {sources} {show} the descent until then; it was down" in finding.evidence


@pytest.mark.parametrize(
    ("met", "is_found"),
    [
        (contact(), True),
        (contact(shown_by=MANY[:1]), False),
        (contact(6.2), False),
        (contact(t_s=50.5), False),
        (contact(t_s=2.5), True),
        (contact(t_s=1.5), False),
    ],
)
def test_a_descent_that_ends_at_once_is_a_crash_without_a_blow(met, is_found):
    found = with_contacts([], [met], flying_bins(END_S), Context(armed=ARMED))
    assert [(one.t_s, one.is_crash, one.speed_m_s) for one in found] == (
        [(met.t_s, True, met.speed_m_s)] if is_found else []
    )


@pytest.mark.parametrize(
    ("met", "stops_s", "is_found"),
    [
        (contact(4.1), AT_S + 0.5, True),
        (contact(3.9), AT_S + 0.5, False),
        (contact(6.2), AT_S + 0.5, True),
        # one source may be wrong, and what flies on has not landed
        (contact(6.2, shown_by=MANY[:1], denied_by=MANY[1:]), AT_S + 0.5, False),
        (contact(6.2), END_S, False),
        (contact(6.2), AT_S + 2.5, True),
        (contact(6.2), AT_S + 3.5, False),
        (contact(6.2, t_s=50.5), AT_S + 0.5, False),  # disarmed
    ],
)
def test_a_quick_descent_that_ends_on_the_ground_is_a_hard_landing_without_a_blow(
    met, stops_s, is_found
):
    made = flying_bins(END_S)
    made = made._replace(driven=np.where(made.t_s < stops_s, 0.5, 0.0))
    found = with_contacts([], [met], made, Context(armed=ARMED))
    assert [(one.t_s, one.is_crash, one.speed_m_s) for one in found] == (
        [(met.t_s, False, met.speed_m_s)] if is_found else []
    )


@pytest.mark.parametrize(
    ("met", "t_s"),
    [
        (contact(t_s=AT_S - 1.8), AT_S - 1.8),
        (contact(t_s=AT_S - 0.9), AT_S),
        (contact(t_s=AT_S - 1.8, shown_by=MANY[:1]), AT_S),
    ],
)
def test_a_blow_that_follows_the_end_of_a_fall_is_not_the_first(met, t_s):
    lay = BLOW._replace(tilt_rad=1.5)
    (found,) = with_contacts([lay], [met], flying_bins(END_S), Context(armed=ARMED))
    assert (found.t_s, found.speed_m_s, found.is_crash) == (t_s, met.speed_m_s, True)
    assert (found.tilt_rad, found.peak_g, found.to_s) == (1.5, 6.0, 50.0)


@pytest.mark.parametrize(("every", "is_told"), [(2, True), (1, False)])
def test_samples_that_miss_a_blow_show_a_vehicle_that_turned_over_and_lies(every, is_told):
    quick = imu(tilt_deg=80.0, blow_g=1.5, turned_deg=75.0)
    assert bool(found_in(select_rows(quick, slice(None, None, every)))) == is_told


def test_crashes_are_in_the_order_of_time():
    met = [contact(), contact(t_s=20.0)]
    found = with_contacts([BLOW], met, flying_bins(END_S), Context(armed=ARMED))
    assert [one.t_s for one in found] == [20.0, AT_S]


# --- flight ---------------------------------------------------------------------------------------


def test_bins_are_means_and_peaks_of_a_tenth_of_a_second():
    t_s = np.concatenate((np.arange(0.0, 1.0, 0.02), np.arange(2.0, 3.0, 0.02)))
    f_b = np.column_stack((np.arange(100.0), np.zeros(100), np.full(100, -G)))
    w_b = np.column_stack((np.zeros(100), -0.1 * np.arange(100.0), np.zeros(100)))
    t_s[1:] += 0.01  # no sample on an edge, which the first one makes
    made = binned(imu_track(t_s, w_b, f_b), Context(motors=motors(share=0.25)))
    assert len(made.t_s) == 20  # none are empty
    assert made.f_b[:, 0] == pytest.approx(5.0 * np.arange(20) + 2.0)
    assert made.w_b[:, 1] == pytest.approx(-0.1 * made.f_b[:, 0])
    assert made.peak_g == pytest.approx(np.hypot(made.f_b[:, 0] + 2.0, G) / G)
    assert made.peak_rad_s == pytest.approx(0.1 * (made.f_b[:, 0] + 2.0))


@pytest.mark.parametrize(
    ("share", "context", "flying", "idle"),
    [
        (0.5, {}, 0.2, 0.15),
        (0.3, {}, 0.18, 0.12),
        (0.15, {}, 0.2, 0.15),  # not known to fly
        (0.15, {"airborne": Series(np.array([0.0, 12.0]), np.array([0.0, 1.0]))}, 0.09, 0.06),
        (0.5, {"airborne": Series(np.zeros(0), np.zeros(0))}, 0.2, 0.15),
    ],
)
def test_what_is_flying_is_by_the_usual_output(share, context, flying, idle):
    made = binned(imu_track(T_S), Context(motors=motors(share=share), **context))
    assert (made.flying, made.idle) == pytest.approx((flying, idle))


def test_fast_samples_are_smoothed_over_20_ms():
    t_s = np.arange(0.0, 1.0, 0.002)
    f_b = np.zeros((500, 3))
    f_b[250] = (10.0 * G, 0.0, 0.0)
    assert binned(imu_track(t_s, f_b=f_b), Context()).peak_g.max() == pytest.approx(1.0)


def test_outputs_at_any_time():
    at_s = np.array([-1.0, 5.0, 20.0, 99.0])
    values = Series(np.array([0.0, 10.0, 30.0]), np.array([0.0, 0.4, -0.6]))
    found = driven_at(Context(throttle=values), at_s)
    assert found == pytest.approx([np.nan, 0.2, 0.5, 0.6], nan_ok=True)
    found = driven_at(Context(throttle=values, motors=motors(share=0.7)), at_s)
    assert found == pytest.approx([np.nan, 0.0, 0.7, 0.0], nan_ok=True)
    assert np.isnan(driven_at(Context(), at_s)).all()


@pytest.mark.parametrize(
    ("baro_m", "own_m", "count", "vehicle_type", "is_high"),
    [
        (3.1, 3.1, 20, QUAD, True),
        (2.9, 3.1, 20, QUAD, False),
        (3.1, 2.9, 20, QUAD, False),
        (3.1, None, 20, QUAD, False),
        (3.1, 3.1, 20, PLANE, False),
        (3.1, 3.1, 9, QUAD, False),
    ],
)
def test_heights_show_a_vehicle_aloft(baro_m, own_m, count, vehicle_type, is_high):
    t_s = np.linspace(0.0, 19.0, count)

    def height(above_m):
        values = np.where(t_s > 10.0, above_m, 0.0) + 50.0
        return None if above_m is None else Series(t_s, values)

    made = Context(baro_height_m=height(baro_m), height_m=None if own_m is None else height(own_m),
                   vehicle_type=vehicle_type)  # fmt: skip
    assert high_above(made, np.array([5.0, 15.0])).tolist() == [False, is_high]


def test_flight_is_carried_armed_moving_and_before_a_crash():
    made = flying_bins(END_S)
    made.w_b[made.t_s > 55.0] = 0.0
    made.driven[made.t_s < 5.0] = 0.2
    flies = in_flight(made, Context(armed=(Span(2.0, 59.0, ""),)), [])
    assert made.t_s[flies][[0, -1]] == pytest.approx((5.0, 55.9), abs=0.15)
    down = Impact(AT_S, 50.0, 9.0, 9.0, 1.0, 0.0, AT_S, is_crash=True)
    flies = in_flight(made, Context(armed=(Span(2.0, 59.0, ""),)), [down])
    assert not flies[(made.t_s > AT_S - 0.95) & (made.t_s < 50.0)].any()
    assert flies[(made.t_s < AT_S - 1.05) & (made.t_s > 5.1)].all()
    airborne = Series(np.array([0.0, 20.0, 30.0]), np.array([0.0, 1.0, 0.0]))
    flies = in_flight(made, Context(armed=(Span(2.0, 59.0, ""),), airborne=airborne), [])
    assert made.t_s[flies][[0, -1]] == pytest.approx((20.0, 29.9), abs=0.11)
    unknown = made._replace(driven=np.full(len(made.t_s), np.nan))
    assert in_flight(unknown, Context(armed=ARMED), [])[100:300].all()


# --- the autopilot's own word ---------------------------------------------------------------------


def checked(*times, bins=None, blows=(), faults=()):
    said = tuple(Said(t_s, Severity.CRITICAL, "Crash: Disarming") for t_s in times)
    context = Context(armed=ARMED, said=said, faults=faults)
    return detect_crash_checks(flying_bins(END_S) if bins is None else bins, context, blows)


def test_a_crash_check_without_a_crash_is_told():
    (found,) = checked(20.0, 30.0)
    assert (found.kind, found.severity) == (Kind.AUTOPILOT_CRASH_CHECK, Severity.WARNING)
    assert (found.from_s, found.to_s, found.size) == (20.0, 30.0, 2.0)
    assert found.text == "the autopilot says crash; it flew on, 2 times"
    assert found.evidence.endswith("around 20 s, 30 s; force up to 1.0 g")
    still = flying_bins(END_S)
    still.w_b[:] = 0.0
    (found,) = checked(20.0, bins=still)
    assert found.text == "the autopilot says crash; the vehicle stood still"
    assert checked() == []


def test_a_crash_check_of_a_vehicle_on_its_side_is_true():
    for tilt_deg, is_false in ((29.0, True), (31.0, False)):
        made = flying_bins(END_S)
        lies = (made.t_s > 18.0) & (made.t_s <= 20.0)
        made.f_b[lies] = Rotation.from_rotvec([0.0, tilt_deg * DEG, 0.0]).apply([0.0, 0.0, -G])
        assert bool(checked(20.0, bins=made)) == is_false


@pytest.mark.parametrize(("after_s", "is_false"), [(14.9, False), (15.1, True)])
def test_a_crash_check_soon_after_a_crash_is_true(after_s, is_false):
    assert bool(checked(AT_S + after_s, blows=[BLOW])) == is_false


@pytest.mark.parametrize(
    ("faults", "texts", "times"),
    [
        ((("crash_check", 1, 20.0),), (), [20.0]),
        ((("crash_check", 0, 20.0),), (), []),
        ((("ekf", 1, 20.0),), (), []),
        ((("crash_check", 1, 20.0),), ("Crash: Disarming",), [20.0]),
        ((), ("Crash: Disarming",), [25.0]),
        ((), ("crash check",), [25.0]),
        ((), ("no crash",), []),
    ],
)
def test_what_counts_as_a_crash_check(faults, texts, times):
    reported = tuple(ReportedFault(t_s, name, code, "") for name, code, t_s in faults)
    said = tuple(Said(25.0, Severity.CRITICAL, text) for text in texts)
    assert crash_checks(Context(faults=reported, said=said)) == times


# --- one flight after the other -------------------------------------------------------------------


def twice(first, second, again_from_s=UP_S, again_share=0.5):
    """Two flights in one armed time."""
    t_s = np.concatenate((T_S, T_S + END_S))
    track = imu_track(
        t_s, np.concatenate((first.w_b, second.w_b)), np.concatenate((first.f_b, second.f_b))
    )
    one, other = motors(), motors(share=again_share, from_s=again_from_s)
    outputs = one._replace(
        t_s=np.concatenate((OUT_S, OUT_S + END_S)),
        pwm_us=np.concatenate((one.pwm_us, other.pwm_us)),
    )
    return [
        (one.is_crash, pytest.approx(one.t_s, abs=0.11))
        for one in found_in(track, (Span(2.0, 115.0, ""),), outputs=outputs)
    ]


TIPPED, HARD = imu(tilt_deg=90.0, rests_s=15.0), imu()


@pytest.mark.parametrize(
    ("first", "second", "how", "found"),
    [
        (TIPPED, TIPPED, {}, [(True, AT_S), (True, AT_S + END_S)]),
        (TIPPED, HARD, {}, [(True, AT_S), (False, AT_S + END_S)]),
        (HARD, TIPPED, {}, [(False, AT_S), (True, AT_S + END_S)]),
        (HARD, HARD, {}, [(False, AT_S), (False, AT_S + END_S)]),
        # a crash needs a flight of two seconds before it, two before it lies
        (TIPPED, TIPPED, {"again_from_s": AT_S - 3.4}, [(True, AT_S), (True, AT_S + END_S)]),
        (TIPPED, TIPPED, {"again_from_s": AT_S - 2.8}, [(True, AT_S)]),
        (TIPPED, TIPPED, {"again_share": 0.19}, [(True, AT_S)]),
    ],
)
def test_after_a_crash_the_next_one_needs_another_flight(first, second, how, found):
    assert twice(first, second, **how) == found


@pytest.mark.parametrize(("later_s", "count"), [(9.0, 1), (11.0, 2)])
def test_blows_of_one_landing_are_one(later_s, count):
    track = imu()
    hit = (AT_S - 0.001 < T_S) & (AT_S + 0.099 > T_S)
    again = np.roll(hit, -round(50 * later_s))
    track.f_b[again], track.w_b[again] = track.f_b[hit], track.w_b[hit]
    still = (AT_S - later_s + 0.1 < T_S) & (AT_S - later_s + 3.6 > T_S)
    track.w_b[still] = 0.0
    found = found_in(track)
    assert len(found) == count
    assert found[0].t_s == pytest.approx(AT_S - later_s, abs=0.11)


def test_a_blow_begins_where_the_force_leaves_what_is_usual():
    track = imu(tilt_deg=90.0)
    for before_s, size_g in ((0.1, 3.9), (0.2, 2.1), (0.3, 1.9)):
        near = (AT_S - before_s - 0.001 < T_S) & (AT_S - before_s + 0.099 > T_S)
        track.f_b[near] = (0.0, 0.0, -size_g * G)
    (found,) = found_in(track)
    assert found.t_s == pytest.approx(AT_S - 0.2, abs=0.02)
    assert found.peak_g == pytest.approx(8.0)

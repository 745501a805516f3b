"""Receivers with known faults against inertial motion."""

import math

import numpy as np
import pytest
from reviewed_flights import DURATION_S, GPS_HZ, flight, gps_track, with_gps

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.rows import product
from h2nav.maths.units import DEG, EARTH_RADIUS_M
from h2nav.recordings.context import NO_ARMING, Context, GpsTrack, Series, Span
from h2nav.reviews.analysis import analyse
from h2nav.reviews.flight import Flight
from h2nav.reviews.inertial import best_attitude, exponential
from h2nav.reviews.receiver import _by_course, detect_receiver, moves_of
from h2nav.reviews.subjects.receiver import weighed


def found(flown: Flight) -> list[Finding]:
    return list(analyse(flown).findings)


def only(flown: Flight, kind: str) -> Finding:
    (finding,) = found(flown)
    assert finding.kind == kind
    return finding


@pytest.mark.parametrize("lag_s", [0.0, 0.1, 0.2])
@pytest.mark.parametrize("name", ["flight", "aggressive"])
def test_the_lag_is_measured(name, lag_s):
    flown = flight(name)
    late = gps_track(name, lag_s)
    flown = flown._replace(context=flown.context._replace(gps=(late,)))
    analysis = analyse(flown)
    assert analysis.receivers[0].lag_s == pytest.approx(lag_s, abs=0.02)
    assert not analysis.findings


def test_a_lag_that_no_autopilot_can_wait_for_is_told():
    flown = flight()._replace()
    flown = flown._replace(context=flown.context._replace(gps=(gps_track("flight", 0.4),)))
    finding = only(flown, "gps_lag")
    assert finding.size == pytest.approx(400.0, abs=20.0)
    assert finding.severity is Severity.WARNING


def test_a_lag_otherwise_than_configured_is_told():
    flown = flight(parameters={"EKF2_GPS_DELAY": 50.0}, gps=(gps_track("flight", 0.2),))
    finding = only(flown, "gps_lag")
    assert finding.severity is Severity.NOTICE
    assert "50 ms are configured" in finding.evidence


@pytest.mark.parametrize(("receiver", "told"), [(0, "50 ms"), (1, None), (2, None)])
def test_a_lag_is_compared_with_the_setting_of_its_own_receiver(receiver, told):
    flown = flight(parameters={"GPS_DELAY_MS": 50.0, "GPS_DELAY_MS2": 200.0})
    gps, best = gps_track("flight", 0.2)._replace(receiver=receiver), best_attitude(flown)
    _, found = detect_receiver(gps, flown.context, flown.context.imus[0], best, is_polled=False)
    (evidence,) = [one.evidence for one in found if one.kind is Kind.GPS_LAG] or [None]
    assert evidence is None if told is None else f"{told} are configured" in evidence


def test_a_vehicle_at_rest_shows_no_lag():
    assert math.isnan(analyse(flight("rest")).receivers[0].lag_s)


def test_a_velocity_that_is_spoofed_by_a_step_is_told_with_its_time_and_size():
    flown = flight()
    gps = flown.context.gps[0]
    v_n = gps.v_n + (gps.t_s > 60.0)[:, None] * np.array([5.0, 0.0, 0.0])
    finding = only(with_gps(flown, v_n=v_n, **moved(flown, v_n)), "gps_velocity")
    assert finding.from_s == pytest.approx(60.0, abs=1.5)
    assert finding.size == pytest.approx(5.0, abs=1.0)


@pytest.mark.parametrize("is_sound", [True, False])
def test_a_receiver_that_the_imu_contradicts_does_not_convict_a_barometer(is_sound):
    """Its altitude and its velocity agree, and both run away from the height of the vehicle."""
    flown = flight()
    gps = flown.context.gps[0]
    away = 4.0 * ((gps.t_s > 60.0) & (gps.t_s < 80.0))
    run_m = np.cumsum(away) / GPS_HZ
    height = gps.altitude_m - gps.altitude_m[0]
    if is_sound:
        flown = flight(baro_height_m=Series(gps.t_s, height - run_m))
    else:
        v_n = gps.v_n - away[:, None] * np.array([0.0, 1.0, 1.0])
        changes = {"v_n": v_n, "altitude_m": gps.altitude_m + run_m, **moved(flown, v_n)}
        flown = with_gps(flight(baro_height_m=Series(gps.t_s, height)), **changes)
    assert {one.kind for one in found(flown)} == {Kind.BARO if is_sound else Kind.GPS_VELOCITY}


def test_a_velocity_that_drifts_by_3_m_s2_is_told():
    flown = flight()
    gps = flown.context.gps[0]
    drift = 3.0 * np.clip(gps.t_s - 60.0, 0.0, 10.0)
    v_n = gps.v_n + drift[:, None] * np.array([0.0, 1.0, 0.0])
    finding = only(with_gps(flown, v_n=v_n, **moved(flown, v_n)), "gps_velocity")
    assert 58.0 < finding.from_s < 64.0
    assert finding.size > 5.0


def moved(flown: Flight, v_n: np.ndarray) -> dict[str, np.ndarray]:
    """Positions that a receiver with these velocities gives."""
    gps = flown.context.gps[0]
    north, east = (np.cumsum(v_n[:, axis] - gps.v_n[:, axis]) / GPS_HZ for axis in (0, 1))
    parallel = np.cos(gps.latitude_deg * DEG)
    return {
        "latitude_deg": gps.latitude_deg + north / EARTH_RADIUS_M / DEG,
        "longitude_deg": gps.longitude_deg + east / (EARTH_RADIUS_M * parallel) / DEG,
    }


def test_a_velocity_that_never_changes_is_told_and_a_fix_that_is_told_twice_is_not():
    flown = flight()
    (gps,) = flown.context.gps
    v_n = gps.v_n.copy()
    v_n[1::2] = v_n[:-1:2]
    twice = with_gps(flown, v_n=v_n)
    assert "gps_frozen" not in {f.kind for f in analyse(twice).findings}
    place = int(np.flatnonzero(np.linalg.norm(gps.v_n[200:, :2], axis=1) > 1.0)[0]) + 200
    v_n = gps.v_n.copy()
    v_n[place : place + 40] = v_n[place]
    found = {f.kind: f for f in analyse(with_gps(flown, v_n=v_n)).findings}
    assert found["gps_frozen"].from_s == pytest.approx(gps.t_s[place])
    assert found["gps_frozen"].size == pytest.approx(39 * 0.2)


def test_a_jump_of_the_position_is_told():
    flown = flight()
    gps = flown.context.gps[0]
    jumped = gps.latitude_deg + (gps.t_s > 70.05) * 30.0 / EARTH_RADIUS_M / DEG
    finding = only(with_gps(flown, latitude_deg=jumped), "gps_jump")
    assert finding.size == pytest.approx(30.0, abs=1.0)
    assert finding.from_s == pytest.approx(70.2, abs=0.3)


def steady(count: int, period_s: float, speed_m_s: float = 30.0) -> GpsTrack:
    """A receiver that moves north, and says so."""
    t_s = np.arange(count) * period_s
    north_m = speed_m_s * t_s
    v_n = np.tile([speed_m_s, 0.0, 0.0], (count, 1))
    v_n[:, 0] += 1e-3 * np.arange(count)  # never the same twice
    return GpsTrack(
        0,
        t_s,
        np.ones(count, dtype=bool),
        north_m / EARTH_RADIUS_M / DEG,
        np.zeros(count),
        np.zeros(count),
        v_n,
        np.full(count, 0.3),
        np.full(count, 14.0),
    )


def alone(gps: GpsTrack) -> list[Finding]:
    """What is found without any other sensor, armed all the time."""
    context = Context(duration_s=60.0, armed=(Span(0.0, 60.0, "armed"),))
    return detect_receiver(gps, context, None, None, is_polled=False)[1]


def test_a_fast_vehicle_with_rare_fixes_does_not_jump():
    assert not alone(steady(60, 1.0))


@pytest.mark.parametrize(("fixes", "is_frozen"), [(4, False), (5, True)])
def test_a_frozen_velocity_is_one_of_five_fixes(fixes, is_frozen):
    gps = steady(60, 1.0)
    gps.v_n[20 : 20 + fixes] = gps.v_n[20]
    assert [one.kind for one in alone(gps)] == ["gps_frozen"] * is_frozen


def test_a_receiver_without_a_vertical_velocity_moves_horizontally():
    gps = steady(10, 1.0)
    gps.v_n[:, 1:] = (2.0, math.nan)
    moves = moves_of(gps)
    assert moves.axes.tolist() == [True, True, False]
    np.testing.assert_array_equal(moves.v_n[:, :2], gps.v_n[:, :2])
    assert not moves.v_n[:, 2].any()


def test_a_lost_fix_is_told_for_as_long_as_it_was_lost():
    flown = flight()
    gps = flown.context.gps[0]
    finding = only(with_gps(flown, has_fix=(gps.t_s < 40.0) | (gps.t_s > 60.0)), "gps_lost")
    assert finding.size == pytest.approx(20.0, abs=0.5)
    assert finding.from_s == pytest.approx(40.0, abs=0.5)
    assert finding.to_s == pytest.approx(60.0, abs=0.5)


def test_what_dives_has_no_fix_under_water():
    flown = flight(vehicle_type=12)
    gps = flown.context.gps[0]
    dives = with_gps(flown, has_fix=(gps.t_s < 40.0) | (gps.t_s > 60.0))
    assert only(dives, "gps_lost").severity is Severity.NOTICE


def test_reports_that_stay_away_are_a_lost_fix_too():
    flown = flight()
    gps = flown.context.gps[0]
    kept = (gps.t_s < 40.0) | (gps.t_s > 43.0)
    fewer = gps.part(kept)
    flown = flown._replace(context=flown.context._replace(gps=(fewer,)))
    assert only(flown, "gps_lost").size == pytest.approx(3.2, abs=0.3)


def test_before_the_first_fix_and_on_the_ground_nothing_is_lost():
    flown = flight("rest", armed=())
    gps = flown.context.gps[0]
    assert not found(with_gps(flown, has_fix=gps.t_s > 30.0))


@pytest.mark.parametrize("missing", [(), (NO_ARMING,)])
def test_where_arming_is_unknown_the_first_fix_may_have_been_waited_for(missing):
    flown = flight(armed=(Span(0.0, DURATION_S, "armed"),), missing=missing)
    gps = flown.context.gps[0]
    lost = with_gps(flown, has_fix=(gps.t_s > 30.0) & ~((gps.t_s > 60.0) & (gps.t_s < 70.0)))
    begins = [one.from_s for one in found(lost) if one.kind is Kind.GPS_LOST]
    assert begins == pytest.approx([60.0] if missing else [0.0, 60.0])


def test_few_satellites_and_a_doubtful_velocity_are_told():
    flown = flight()
    count = round(DURATION_S * GPS_HZ)
    poor = with_gps(flown, satellites=np.full(count, 5.0), sigma_m_s=np.full(count, 1.6))
    assert {f.kind for f in found(poor)} == {"gps_satellites", "gps_accuracy"}


@pytest.mark.parametrize(("backs_us", "is_ours"), [(False, True), (None, False)])
def test_a_velocity_that_agrees_with_the_autopilot_against_us_is_not_the_receivers_fault(
    backs_us, is_ours
):
    """Flagged in flight while our own tilt was wrong; the other flight shows no velocity at all."""
    flown = flight(gps=())
    velocity = Finding(
        Kind.GPS_VELOCITY, Sensor(SensorKind.GPS), Severity.WARNING, 20.0, 28.0, 9.0, "",
        "GPS velocity is false and not used", "by hand", id="velocity",
    )  # fmt: skip
    tilt = Finding(
        Kind.AUTOPILOT_TILT, Sensor(SensorKind.AUTOPILOT), Severity.WARNING, 24.0, 34.0, 11.0,
        "deg",
        "our tilt off 11 deg, GPS backs autopilot", "by hand", id="tilt", backs_us=backs_us,
    )  # fmt: skip
    found = analyse(flown._replace(findings=(velocity, tilt)))
    assert ("velocity" in found.cleared) == is_ours


@pytest.mark.parametrize("creeps", [True, False])
def test_a_course_that_is_held_at_low_speed_says_little_for_a_while(creeps):
    speed = np.where(np.arange(100) < 50, 0.6 if creeps else 3.0, 3.0)
    speed = speed + 0.05 * np.sin(np.arange(100))
    course = np.where(np.arange(100) < 52, 0.3, 2.0)
    gps = steady(100, 0.2)
    v_n = np.stack((speed * np.cos(course), speed * np.sin(course), 0.0 * speed), axis=1)
    error = _by_course(moves_of(gps._replace(v_n=v_n)))
    assert (error[50:54] == pytest.approx(speed[50:54])) == creeps
    assert not error[60:].any()


def test_without_a_held_course_a_slow_receiver_is_believed():
    gps = gps_track("flight", 0.0)
    assert not _by_course(moves_of(gps)).any()


@pytest.mark.parametrize(
    ("is_compared", "to_s", "severity"),
    [
        (True, 66.0, Severity.NOTICE),
        (True, 60.5, Severity.WARNING),
        (False, 66.0, Severity.WARNING),
    ],
)
def test_the_comparison_of_all_causes_in_flight_decides(is_compared, to_s, severity):
    sensor = Sensor(SensorKind.GPS)
    compared = Finding(
        Kind.ATTITUDE_VELOCITY, sensor, Severity.WARNING, 59.0, to_s, 0.0, "deg", "",
        "vibration", "a", clears_velocity=is_compared,
    )  # fmt: skip
    assert pushed_with(compared).severity is severity


@pytest.mark.parametrize("is_found", [True, False])
def test_a_velocity_that_fits_the_autopilots_attitude_is_our_own_error(is_found):
    flown = flight(parameters={"AHRS_TRIM_X": 0.0})
    own = flown.estimates
    tilted = np.zeros((len(own.t_s), 3))
    tilted[:, 0] = 8.0 * DEG * ((own.t_s > 60.0) & (own.t_s < 72.0))
    differs = Finding(
        Kind.AUTOPILOT_TILT, Sensor(SensorKind.AUTOPILOT), Severity.WARNING, 60.0, 72.0, 8.0,
        "deg", "our tilt off 8 deg, GPS backs autopilot", "by hand", id="tilt", backs_us=False,
    )  # fmt: skip
    flown = flown._replace(
        estimates=own._replace(q_nb=product(exponential(tilted), own.q_nb)),
        findings=(differs,) if is_found else (),
    )
    said = [one.severity for one in found(flown) if one.kind is Kind.GPS_VELOCITY]
    assert said == [Severity.NOTICE if is_found else Severity.WARNING]


def pushed_with(compared: Finding) -> Finding:
    """What is said of a velocity that is off for 6 s, beside another finding in flight."""
    flown = flight()
    gps = flown.context.gps[0]
    v_n = gps.v_n + ((gps.t_s > 60.0) & (gps.t_s < 66.0))[:, None] * np.array([5.0, 0.0, 0.0])
    flown = with_gps(flown, v_n=v_n, **moved(flown, v_n))._replace(findings=(compared,))
    (finding,) = [one for one in found(flown) if one.kind is Kind.GPS_VELOCITY]
    return finding


@pytest.mark.parametrize(
    ("compared_s", "severity"),
    [
        ((99.0, 104.0), Severity.NOTICE),  # it lasted as long
        ((103.0, 109.0), Severity.NOTICE),  # it began at the end, and looked back
        ((112.5, 119.0), Severity.WARNING),  # of these velocities it saw the last ones
        ((60.0, 90.0), Severity.WARNING),
    ],
)
def test_a_comparison_that_saw_the_velocities_and_blames_others_makes_it_a_note(
    compared_s, severity
):
    gps = Sensor(SensorKind.GPS)
    false = Finding(Kind.GPS_VELOCITY, gps, Severity.WARNING, 100.0, 103.2, 6.0, "m/s", "", "jump")
    cause = Finding(
        Kind.ATTITUDE_VELOCITY,
        gps,
        Severity.WARNING,
        *compared_s,
        0.0,
        "deg",
        "undecided",
        "shares",
    )
    found = weighed(false, [cause])
    assert found.severity is severity
    assert ("of all causes: undecided, shares" in found.evidence) == (severity is Severity.NOTICE)


# --- each bound of what a receiver says of itself -------------------------------------------------


def told(kind: str, gps: GpsTrack, **changes: object) -> list[Finding]:
    """The findings of one kind, armed from 5 to 55 s unless changed, without any other sensor."""
    armed = {"duration_s": 60.0, "armed": (Span(5.0, 55.0, "armed"),)}
    context = Context(**armed | changes)
    return [one for one in detect_receiver(gps, context, None, None, is_polled=False)[1]
            if one.kind == kind]  # fmt: skip


def without(gps: GpsTrack, from_s: float, to_s: float) -> GpsTrack:
    return gps._replace(has_fix=~((gps.t_s > from_s) & (gps.t_s < to_s)))


@pytest.mark.parametrize(
    ("lost_s", "is_told"),
    [
        ((20.0, 21.3), False),  # with what two reports take: 1.4 s
        ((20.0, 21.5), True),
        ((2.0, 6.3), False),  # counted from arming
        ((2.0, 6.5), True),
        ((53.7, 60.0), False),  # and until it ended
        ((53.41, 60.0), True),
    ],
)
def test_how_long_a_fix_may_stay_away(lost_s, is_told):
    found = told("gps_lost", without(steady(300, 0.2), *lost_s))
    assert len(found) == is_told
    if is_told:
        (one,) = found
        assert one.from_s == pytest.approx(max(lost_s[0], 5.0), abs=0.02)
        assert one.to_s == pytest.approx(min(lost_s[1] + 0.1, 55.0), abs=1e-6)
        assert one.size == pytest.approx(one.to_s - one.from_s)
        assert one.text == f"no fix for {one.size:.0f} s while armed"
        assert (one.unit, one.severity, one.source) == ("s", Severity.WARNING, "GPS")


def test_what_was_not_recorded_is_no_lost_fix():
    lost = without(steady(300, 0.2), 20.0, 29.9)
    for silent, is_told in (((20.0, 25.2),), False), (((20.0, 24.8),), True), (
        ((10.0, 23.0), (27.6, 40.0)), False,
    ), (((10.0, 19.0), (31.0, 50.0)), True):  # fmt: skip
        spans = tuple(Span(*ends, "silent") for ends in silent)
        assert len(told("gps_lost", lost, silent=spans)) == is_told
    # Before its first report the receiver may not have been recorded, and later it was not armed.
    late = steady(300, 0.2).part(np.arange(300) > 100)
    assert not told("gps_lost", late)
    assert not told("gps_lost", without(steady(300, 0.2), 20.0, 30.0), armed=())


def test_reports_in_bursts_are_as_usual():
    gps = steady(300, 0.2)
    bursts = gps._replace(t_s=np.sort(np.repeat(np.arange(0.0, 60.0, 2.0), 10) + 0.01 * 5))
    assert not told("gps_lost", bursts)
    assert told("gps_lost", without(bursts, 19.0, 25.0))


def test_a_flight_without_any_fix_is_a_note():
    gps = steady(300, 0.2)._replace(has_fix=np.zeros(300, dtype=bool))
    gps.satellites[:] = np.where(np.arange(300) < 150, np.nan, 4.0)
    armed = (Span(5.0, 20.0, "armed"), Span(30.0, 55.0, "armed"))
    (one,) = told("gps_lost", gps, armed=armed)
    assert one.text == "no fix in the whole flight"
    assert one.evidence == "300 reports, none with a 3D fix; at most 4 satellites"
    assert (one.from_s, one.to_s, one.size) == (5.0, 55.0, 50.0)
    assert one.severity is Severity.NOTICE
    (blind,) = told("gps_lost", gps._replace(satellites=np.full(300, np.nan)))
    assert blind.evidence == "300 reports, none with a 3D fix"
    assert not told("gps_lost", gps, armed=())


@pytest.mark.parametrize(
    ("satellites", "sigma_m_s", "seconds", "kinds"),
    [
        (6.0, 1.0, 30.0, []),
        (5.0, 1.0, 10.0, []),
        (5.0, 1.0, 10.5, ["gps_satellites"]),
        (6.0, 1.01, 10.0, []),
        (6.0, 1.01, 10.5, ["gps_accuracy"]),
        (4.0, 3.0, 30.0, ["gps_satellites", "gps_accuracy"]),
    ],
)
def test_how_poor_a_fix_may_be_for_how_long(satellites, sigma_m_s, seconds, kinds):
    gps = steady(300, 0.2)
    count = round(seconds / 0.2)
    for values, usual, poor in (
        (gps.satellites, 12.0, satellites), (gps.sigma_m_s, 0.3, sigma_m_s),
    ):  # fmt: skip
        values[:] = usual
        values[50 : 50 + count] = poor
    context = Context(duration_s=60.0, armed=(Span(5.0, 55.0, "armed"),))
    found = detect_receiver(gps, context, None, None, is_polled=False)[1]
    assert [one.kind for one in found] == kinds
    for one in found:
        assert (one.from_s, one.to_s) == (gps.t_s[50], gps.t_s[49 + count])
        is_few = one.kind == "gps_satellites"
        assert (one.size, one.unit) == ((satellites, "") if is_few else (sigma_m_s, "m/s"))
        assert one.text == (
            f"only {satellites:.0f} satellites while armed"
            if is_few
            else f"velocity accuracy only {sigma_m_s:.1f} m/s"
        )
        start = "fewer than 6 for" if is_few else "the receiver itself states more than 1 m/s for"
        assert one.evidence.startswith(f"{start} {0.2 * count:.0f} s, ")
    grounded = context._replace(armed=())
    assert not detect_receiver(gps, grounded, None, None, is_polled=False)[1]


@pytest.mark.parametrize(
    ("fixes", "period_s", "speed_m_s", "is_told"),
    [
        (11, 0.2, 5.0, True),
        (10, 0.2, 5.0, False),  # 1.8 s
        (5, 0.6, 5.0, True),
        (4, 0.8, 5.0, False),
        (11, 0.2, 0.51, True),
        (11, 0.2, 0.49, False),  # at rest it may be zero all along
    ],
)
def test_for_how_long_a_velocity_may_be_the_same(fixes, period_s, speed_m_s, is_told):
    gps = steady(60, period_s)
    gps.v_n[30 : 30 + fixes] = (0.6 * speed_m_s, -0.8 * speed_m_s, 0.3)
    found = told("gps_frozen", gps)
    assert len(found) == is_told
    if is_told:
        (one,) = found
        assert (one.from_s, one.to_s) == (gps.t_s[30], gps.t_s[29 + fixes])
        assert one.size == pytest.approx((fixes - 1) * period_s)
        assert one.text == f"velocity did not change for {one.size:.0f} s"
        assert one.evidence.startswith(f"{fixes} fixes in a row of exactly the same ")
        assert f" {speed_m_s:.1f} m/s, which" in one.evidence
    no_fix = gps._replace(has_fix=np.zeros(60, dtype=bool))
    assert not told("gps_frozen", no_fix)
    assert not told("gps_frozen", gps, armed=())


@pytest.mark.parametrize(
    ("north_m", "east_m", "period_s", "is_told"),
    [
        (9.9, 0.0, 0.2, False),
        (10.2, 0.0, 0.2, True),
        (0.0, -9.9, 0.2, False),
        (0.0, -10.2, 0.2, True),
        (7.2, 7.2, 0.2, True),
        (50.0, 0.0, 1.9, True),
        (50.0, 0.0, 2.1, False),  # meanwhile it may have moved anyhow
    ],
)
def test_by_how_much_a_position_may_jump(north_m, east_m, period_s, is_told):
    gps = steady(40, period_s)
    gps = gps._replace(longitude_deg=gps.longitude_deg.copy(), latitude_deg=gps.latitude_deg.copy())
    gps.latitude_deg[20:] += north_m / EARTH_RADIUS_M / DEG
    parallel_m = EARTH_RADIUS_M * math.cos(gps.latitude_deg[20] * DEG)
    gps.longitude_deg[20:] += east_m / parallel_m / DEG
    found = told("gps_jump", gps, armed=(Span(0.0, 100.0, "armed"),))
    assert len(found) == is_told
    if is_told:
        (one,) = found
        size = math.hypot(north_m, east_m)
        assert one.size == pytest.approx(size, abs=0.05)
        assert one.text == f"position jumped by {size:.0f} m"
        assert one.evidence.startswith("once by more than 10 m from one fix to the next")
        assert one.from_s == one.to_s == gps.t_s[20]
    gps.latitude_deg[30:] += 20.0 / EARTH_RADIUS_M / DEG
    if period_s < 2.0 and is_told:
        (both,) = told("gps_jump", gps, armed=(Span(0.0, 100.0, "armed"),))
        assert both.evidence.startswith("2 times by more than")
        assert (both.from_s, both.to_s) == (gps.t_s[20], gps.t_s[30])
        (first,) = told("gps_jump", gps, armed=(Span(0.0, float(gps.t_s[25]), "armed"),))
        assert first.to_s == gps.t_s[20]
    has_fix = np.ones(40, dtype=bool)
    has_fix[19] = False
    gps.latitude_deg[30:] -= 20.0 / EARTH_RADIUS_M / DEG
    assert not told("gps_jump", gps._replace(has_fix=has_fix), armed=(Span(0.0, 99.0, "armed"),))


def test_fixes_with_a_velocity_are_taken_once_and_in_order():
    gps = steady(6, 0.2)
    gps.v_n[:] = np.arange(18.0).reshape(6, 3)
    gps.v_n[1, 0] = np.nan
    has_fix = np.array((True, True, False, True, True, True))
    t_s = np.array((0.0, 0.2, 0.4, 0.6, 0.6, 0.8))
    gps.sigma_m_s[:] = (0.1, 0.2, 0.3, 0.4, 0.5, np.nan)
    moves = moves_of(gps._replace(has_fix=has_fix, t_s=t_s))
    assert moves.t_s.tolist() == [0.0, 0.6, 0.8]
    assert moves.v_n.tolist() == [[0, 1, 2], [9, 10, 11], [15, 16, 17]]
    assert moves.sigma_m_s.tolist() == [0.1, 0.4, 0.5]  # where it states nothing: 0.5 m/s
    assert moves.axes.tolist() == [True, True, True]
    assert moves_of(gps.part(slice(0, 0))).axes.tolist() == [True, True, False]

"""The autopilot's estimators: resets, switches, cores, texts, and who is right."""

from typing import NamedTuple

import numpy as np
import pytest
from reviewed_flights import GPS_HZ, estimates, flight, ideal

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.rows import product
from h2nav.maths.units import DEG
from h2nav.recordings.context import (
    Array,
    AttitudeTrack,
    Context,
    GpsTrack,
    ImuTrack,
    Said,
    Span,
)
from h2nav.reviews.analysis import analyse
from h2nav.reviews.estimators import detect_estimators, detect_texts
from h2nav.reviews.flight import Flight
from h2nav.reviews.inertial import attitudes, conjugate, exponential, rotate


def turned(name: str, error_n: Array) -> Array:
    return product(exponential(error_n), estimates(name).q_nb)


def times(name: str = "flight") -> Array:
    return ideal(name).t_us * 1e-6


def with_attitude(name: str, error_n: Array) -> Flight:
    track = AttitudeTrack("EKF3", times(name), turned(name, error_n))
    return flight(name, attitudes=(track,))


def only(flown: Flight) -> Finding:
    (finding,) = analyse(flown).findings
    return finding


@pytest.mark.parametrize("name", ["flight", "aggressive"])
def test_a_reset_of_the_heading_is_told_with_its_time_and_size(name):
    error = np.zeros((len(times(name)), 3))
    error[(times(name) > 50.0) & (times(name) < 60.0), 2] = 12.0 * DEG
    found = analyse(with_attitude(name, error)).findings
    assert [f.kind for f in found] == ["attitude_reset", "attitude_reset"]
    assert [f.from_s for f in found] == pytest.approx([50.0, 60.0], abs=0.1)
    assert [f.size for f in found] == pytest.approx([12.0, 12.0], abs=0.5)
    assert "heading" in found[0].text


def test_attitudes_that_are_timed_a_little_otherwise_are_no_resets():
    flown = flight("aggressive")
    track = flown.context.attitudes[0]
    shift = np.random.default_rng(2).uniform(-0.02, 0.02, len(track.t_s))
    jittered = track._replace(t_s=track.t_s + shift)
    assert not analyse(
        flown._replace(context=flown.context._replace(attitudes=(jittered,)))
    ).findings


def test_an_attitude_that_is_off_for_long_is_told_with_the_velocitys_verdict():
    # Turned by 8 deg slowly: no reset, but the force no longer explains the velocity.
    t_s = times("aggressive")
    error = np.zeros((len(t_s), 3))
    error[:, 2] = 30.0 * DEG * np.clip((t_s - 40.0) / 20.0, 0.0, 1.0)
    finding = only(with_attitude("aggressive", error))
    assert finding.kind == "autopilot_heading"
    assert finding.size == pytest.approx(30.0, abs=1.5)
    assert "fits ours better" in finding.evidence


def test_gravity_while_it_was_off_shows_whose_tilt_is_wrong():
    """12 deg from 50 to 90 s, nothing before and after."""
    t_s = times("rest")
    error = np.zeros((len(t_s), 3))
    error[:, 0] = 12.0 * DEG * np.clip(np.minimum(t_s - 30.0, 110.0 - t_s) / 20.0, 0.0, 1.0)
    finding = only(with_attitude("rest", error))
    assert finding.kind == "autopilot_tilt"
    assert "gravity at rest is 1 deg from ours and 12 deg from the autopilot's" in finding.evidence


@pytest.mark.parametrize("fixes", [0, 3])
def test_without_velocities_it_stays_open_whose_attitude_is_off(fixes):
    t_s = times("aggressive")
    error = np.zeros((len(t_s), 3))
    error[:, 2] = 30.0 * DEG * np.clip((t_s - 40.0) / 20.0, 0.0, 1.0)
    flown = with_attitude("aggressive", error)
    (gps,) = flown.context.gps
    is_fix = (gps.t_s >= 80.0) & (gps.t_s < 80.0 + fixes / GPS_HZ)
    context = flown.context._replace(gps=(gps._replace(has_fix=is_fix),) if fixes else ())
    found = {f.kind: f for f in analyse(flown._replace(context=context)).findings}
    assert "no velocity shows who is right" in found["autopilot_heading"].evidence


def test_what_the_witness_told_in_flight_is_not_told_again():
    t_s = times("aggressive")
    error = np.zeros((len(t_s), 3))
    error[:, 2] = 30.0 * DEG * np.clip((t_s - 40.0) / 20.0, 0.0, 1.0)
    told = Finding(
        Kind.AUTOPILOT_HEADING,
        Sensor(SensorKind.AUTOPILOT),
        Severity.WARNING,
        50.0,
        120.0,
        30.0,
        "deg",
        "",
        "",
    )
    assert not analyse(with_attitude("aggressive", error)._replace(findings=(told,))).findings


def test_cores_that_differ_are_told():
    t_s = times()
    error = np.zeros((len(t_s), 3))
    error[:, 0] = 9.0 * DEG * ((t_s > 50.0) & (t_s < 70.0))
    cores = (
        AttitudeTrack("EKF3", t_s, turned("flight", 0.0 * error)),
        AttitudeTrack("EKF3 core 1", t_s, turned("flight", error)),
    )
    finding = only(flight(attitudes=cores))
    assert (finding.kind, finding.source) == ("cores_differ", "estimator")
    assert "EKF3 core 1" in finding.text
    assert finding.size == pytest.approx(9.0, abs=0.3)


def test_lane_switches_are_told_while_armed_only():
    lanes = (Span(0.0, 50.0, "core 0"), Span(50.0, 100.0, "core 1"), Span(100.0, 120.0, "core 0"))
    finding = only(flight(primary=lanes))
    assert finding.kind == "estimator_switch"
    assert finding.size == 2.0
    assert finding.from_s == 50.0
    assert finding.text.endswith(", 2 times")
    assert not analyse(flight("rest", armed=(), primary=lanes)).findings


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("EKF3 lane switch 1", "estimator_switch"),
        ("EKF variance: velocity", "said_ekf_failed"),
        ("GPS Glitch or Compass error", "said_gps_glitch"),
        ("Compass 2 inconsistent with field", "said_compass"),
        ("EKF3 IMU0 stopped aiding", "said_aiding"),
        ("EKF3 IMU0 emergency yaw reset", "said_yaw_reset"),
        ("Vibration compensation ON", "said_vibration"),
        ("Crash: Disarming: AngErr=60>30", "said_crash"),
    ],
)
def test_what_the_autopilot_said_in_flight_is_gathered(text, kind):
    said = (Said(60.0, Severity.CRITICAL, text), Said(61.0, Severity.CRITICAL, text))
    found = [f for f in analyse(flight(said=said)).findings if f.kind == kind]
    assert len(found) == 1
    assert found[0].from_s == 60.0
    assert text in found[0].evidence


def test_preparations_and_usual_texts_are_not_told():
    said = tuple(
        Said(60.0, Severity.INFO, text)
        for text in (
            "PreArm: Compass not healthy",
            "EKF3 IMU0 is using GPS",
            "EKF3 IMU0 MAG0 in-flight yaw alignment complete",
            "SIM Hit ground at 0.5 m/s",
        )
    )
    before = (Said(0.5, Severity.WARNING, "EKF variance"),)
    after = (Said(119.9, Severity.WARNING, "EKF primary changed:0"),)
    assert not analyse(flight(said=(*before, *said, *after))).findings


def test_a_vehicle_that_ends_on_its_side_is_told():
    flown = flight()
    first = flown.context.imus[0]
    falls = first.t_s > 110.0
    f_b, w_b = first.f_b.copy(), first.w_b.copy()
    f_b[falls], w_b[falls] = np.array([0.0, -9.8, -0.5]), 0.0
    f_b[11000:11003] = np.array([0.0, 0.0, -90.0])
    flown = flight(imus=1, attitudes=())
    changed = flown.context.imus[0]._replace(f_b=f_b, w_b=w_b)
    flown = flown._replace(context=flown.context._replace(imus=(changed,), gps=()), estimates=None)
    found = {f.kind: f for f in analyse(flown).findings}
    assert found["crash"].from_s == pytest.approx(110.0, abs=0.2)
    assert found["crash"].size == pytest.approx(90.0, abs=1.0)
    assert "87 deg from how it had stood" in found["crash"].evidence


def test_a_gyro_that_is_known_to_be_frozen_accuses_no_heading():
    flown = flight("aggressive")
    (track,) = flown.context.imus
    is_frozen = (track.t_s > 40.0) & (track.t_s < 43.0)
    frozen = track._replace(w_b=np.where(is_frozen[:, None], track.w_b[0], track.w_b))
    finding = Finding(
        Kind.GYRO_FROZEN, Sensor(SensorKind.IMU, 1), Severity.ERROR, 40.0, 43.0, 3.0, "s", "", ""
    )
    attitude = flown.context.attitudes[0]
    seldom = attitude._replace(t_s=attitude.t_s[::10], q_nb=attitude.q_nb[::10])
    context = flown.context._replace(imus=(frozen,), attitudes=(seldom,))
    flown = flown._replace(context=context)
    kinds = [
        {f.kind for f in analyse(flown._replace(findings=known)).findings}
        for known in ((), (finding,))
    ]
    assert ["attitude_reset" in each for each in kinds] == [True, False]


@pytest.mark.parametrize(
    ("texts", "told"),
    [
        (("Radio Failsafe - Continuing Landing",), ["Radio failsafe"]),
        (("Radio Failsafe", "Radio Failsafe Cleared", "radio failsafe: over"), ["Radio failsafe"]),
        (("GCS Failsafe", "GCS Failsafe"), ["GCS failsafe, 2 times"]),
        (("Failsafe mode activated",), ["failsafe"]),
        (("Max Alt fence breached",), ["fence breached"]),
        (("Geofence violated", "fence: over"), ["fence breached"]),
        (("fence",), ["fence breached"]),  # of ERR, by number
        (("fence: 2",), ["fence breached"]),
        (("Parachute: Released",), ["parachute released"]),
        (("Quad-chute triggered due to loss of altitude",), ["transition given up"]),
        (("Transition failed, exceeded time limit",), ["transition given up"]),
        (("Transition airspeed reached 14.2", "Transition done"), []),
        (("fence enabled", "defence: 2", "PreArm: fence breached", "Parachute: Enabled"), []),
    ],
)
def test_failsafes_that_the_autopilot_told(texts, told):
    said_ = tuple(Said(30.0 + at_s, Severity.CRITICAL, text) for at_s, text in enumerate(texts))
    armed = (Span(1.0, 90.0, "armed"),)
    found = detect_texts(Context(duration_s=100.0, armed=armed, said=said_))
    assert [one.text for one in found] == [f"the autopilot said: {text}" for text in told]


# --- each bound, of a vehicle that hovers and is pushed to and fro --------------------------------

LONG_S = 40.0
ARMED = (Span(5.0, 55.0, "armed"),)


class Hover(NamedTuple):
    """By how much the autopilot's attitude is off, and when, deg and s."""

    tilt: float = 0.0
    heading: float = 0.0
    from_s: float = 20.05
    to_s: float = LONG_S
    other_heading: float = 0.0  # of its second core
    other_tilt: float = 0.0
    core: str = "EKF3 core 1"
    turn_deg_s: float = 0.0  # of the vehicle
    lost_s: tuple[float, float] = (0.0, 0.0)  # of the samples
    armed: tuple[Span, ...] = ARMED
    ours_deg: float = 0.0  # error of our own heading
    sigma_deg: float | None = None  # of ours; None: there is no attitude of ours
    has_velocity: bool = False
    pushed_m_s2: float = 0.0
    parameters: dict[str, float] = {"AHRS_TRIM_X": 0.0}  # noqa: RUF012 - never changed
    in_flight: tuple[Finding, ...] = ()

    def found(self) -> list[Finding]:
        t_s = np.arange(10.0, LONG_S, 0.02)
        w_b = np.tile((0.0, 0.0, self.turn_deg_s * DEG), (len(t_s), 1))
        true = exponential(t_s[:, None] * w_b)
        pushed = self.pushed_m_s2 * np.outer(np.sin(t_s), (1.0, 0.0, 0.0))
        force = rotate(conjugate(true), pushed - np.array((0.0, 0.0, 9.80665)))
        stamps = np.round(t_s * 1e6).astype(np.int64)
        kept = (t_s <= self.lost_s[0]) | (t_s >= self.lost_s[1])
        nothing = np.full(force.shape, np.nan)
        rows = (values[kept] for values in (t_s, stamps, w_b, force, nothing))
        track = ImuTrack(0, "IMU", *rows)
        off = ((t_s >= self.from_s) & (t_s < self.to_s))[:, None]
        wrong = [
            product(exponential(DEG * off * np.array((tilt, 0.0, heading))), true)[::5]
            for tilt, heading in (
                (self.tilt, self.heading), (self.other_tilt, self.other_heading),
            )
        ]  # fmt: skip
        ours = product(exponential(np.tile((0.0, 0.0, self.ours_deg * DEG), (len(t_s), 1))), true)
        best = None
        if self.sigma_deg is not None:
            sigma = np.full(len(t_s), self.sigma_deg * DEG)
            best = attitudes(t_s, ours)._replace(sigma_tilt_rad=sigma, sigma_heading_rad=sigma)
        fixes_s = np.arange(10.0, LONG_S, 0.2)
        v_n = self.pushed_m_s2 * np.outer(1.0 - np.cos(fixes_s), (1.0, 0.0, 0.0))
        every = np.ones(len(fixes_s))
        gps = GpsTrack(0, fixes_s, every > 0.0, *[0.0 * every] * 3, v_n, 0.3 * every, 12.0 * every)
        context = Context(
            attitudes=(
                AttitudeTrack("EKF3", t_s[::5], wrong[0]),
                AttitudeTrack(self.core, t_s[::5], wrong[1]),
            ),
            armed=self.armed,
            gps=(gps,) if self.has_velocity else (),
            parameters=self.parameters,
        )
        return detect_estimators(context, track, best, self.in_flight)


TURNED = Finding(
    Kind.AUTOPILOT_HEADING, Sensor(SensorKind.AUTOPILOT), Severity.NOTICE, 1.0, 2.0, 9.0, "", "", ""
)


@pytest.mark.parametrize(
    ("too_little", "enough", "kind"),
    [
        (Hover(heading=3.9, core="DCM"), Hover(heading=-4.1, core="DCM"), "attitude_reset"),
        (Hover(tilt=3.9, core="DCM"), Hover(tilt=4.1, core="DCM"), "attitude_reset"),
        # Samples and attitudes may be 0.03 s apart.
        (
            Hover(heading=4.5, turn_deg_s=20.0, core="DCM"),
            Hover(heading=4.7, turn_deg_s=20.0, core="DCM"),
            "attitude_reset",
        ),
        # What reverses within 0.3 s is one of timing.
        (
            Hover(heading=8.0, to_s=20.25, core="DCM"),
            Hover(heading=8.0, to_s=20.75, core="DCM"),
            "attitude_reset",
        ),
        (
            Hover(heading=8.0, core="DCM", armed=(Span(20.3, 55.0, ""),)),
            Hover(heading=8.0, core="DCM", armed=(Span(20.0, 55.0, ""),)),
            "attitude_reset",
        ),
        (
            Hover(heading=8.0, core="DCM", lost_s=(20.1, 20.2)),
            Hover(heading=8.0, core="DCM", lost_s=(20.1, 20.15)),
            "attitude_reset",
        ),
        # Two cores, for five seconds.
        (Hover(other_tilt=4.9), Hover(other_tilt=5.1), "cores_differ"),
        (Hover(other_heading=14.9), Hover(other_heading=15.1), "cores_differ"),
        (Hover(other_tilt=9.0, core="DCM"), Hover(other_tilt=9.0), "cores_differ"),
        (
            Hover(other_tilt=9.0, to_s=25.0),
            Hover(other_tilt=9.0, to_s=25.3),
            "cores_differ",
        ),
        # Three deviations of both: of ours, and of 0.5 deg of tilt and 1.5 deg of heading.
        (
            Hover(heading=5.3, sigma_deg=1.0, core="DCM"),
            Hover(heading=5.5, sigma_deg=1.0, core="DCM"),
            "autopilot_heading",
        ),
        (
            Hover(tilt=3.3, sigma_deg=1.0, core="DCM"),
            Hover(tilt=3.4, sigma_deg=1.0, core="DCM"),
            "autopilot_tilt",
        ),
        (
            Hover(tilt=3.4, sigma_deg=1.0, to_s=35.0, core="DCM"),
            Hover(tilt=3.4, sigma_deg=1.0, to_s=35.3, core="DCM"),
            "autopilot_tilt",
        ),
        # What was told in flight is not told again.
        (
            Hover(heading=9.0, sigma_deg=1.0, in_flight=(TURNED._replace(to_s=21.0),)),
            Hover(heading=9.0, sigma_deg=1.0, in_flight=(TURNED._replace(to_s=19.0),)),
            "autopilot_heading",
        ),
    ],
)
def test_how_far_an_estimator_may_be_off(too_little, enough, kind):
    assert kind not in {one.kind for one in too_little.found()}
    assert kind in {one.kind for one in enough.found()}


def test_a_jump_is_told_by_its_larger_part():
    (one,) = Hover(heading=-6.0, tilt=3.0, core="DCM").found()
    assert one.text == "the autopilot's heading jumped by 6 deg"
    assert one.evidence.startswith("tilt 3.0 deg, heading 6.0 deg between two attitudes")
    assert (one.from_s, one.to_s) == pytest.approx((20.1, 20.1))
    assert one.size == pytest.approx(6.0, abs=0.05)
    (tilted,) = Hover(heading=-3.0, tilt=6.0, core="DCM").found()
    assert tilted.text == "the autopilot's tilt jumped by 6 deg"
    there, back = Hover(heading=6.0, to_s=21.65, core="DCM").found()
    assert (there.from_s, back.from_s) == pytest.approx((20.1, 21.7))
    (both,) = Hover(heading=6.0, to_s=20.95, core="DCM").found()  # within a second, as one
    assert (both.from_s, both.to_s) == pytest.approx((20.1, 21.0))


def test_cores_are_told_with_their_names():
    (one,) = Hover(other_heading=20.0, to_s=30.05).found()
    assert one.text == "heading of EKF3 and EKF3 core 1 differ by 20 deg"
    assert (one.from_s, one.to_s) == pytest.approx((20.1, 30.0), abs=0.11)
    assert (one.source, one.size) == ("estimator", pytest.approx(20.0, abs=0.1))


@pytest.mark.parametrize(
    ("case", "severity", "text", "words"),
    [
        (
            Hover(heading=30.0),
            "notice",
            "heading of the autopilot and ours differ by 30 deg",
            "beyond three deviations of ours; no velocity shows who is right",
        ),
        (
            Hover(heading=30.0, has_velocity=True, pushed_m_s2=3.0),
            "warning",
            "the autopilot's heading is off by 30 deg",
            "the receiver's velocity fits ours better (rms 0.0",
        ),
        (
            Hover(heading=0.0, ours_deg=30.0, has_velocity=True, pushed_m_s2=3.0),
            "notice",
            "heading of the autopilot and ours differ by 30 deg",
            "the receiver's velocity fits the autopilot's better (rms ",
        ),
        (
            Hover(heading=30.0, has_velocity=True),
            "notice",
            "heading of the autopilot and ours differ by 30 deg",
            "the receiver's velocity does not show who is right",
        ),
        (
            Hover(tilt=9.0, parameters={}),
            "notice",
            "tilt of the autopilot and ours differ by 9 deg",
            "AHRS_TRIM, which may explain it, is not in the recording",
        ),
        (
            Hover(tilt=11.0, parameters={}, has_velocity=True),
            "warning",
            "the autopilot's tilt is off by 11 deg",
            "the receiver's velocity fits ours better (rms 0.00 m/s",
        ),
        (
            Hover(tilt=9.0, parameters={"EKF2_X": 1.0}, has_velocity=True),
            "warning",
            "the autopilot's tilt is off by 9 deg",
            "the receiver's velocity fits ours better (rms 0.00 m/s",
        ),
    ],
)
def test_whose_attitude_is_off(case, severity, text, words):
    found = case._replace(sigma_deg=1.0, core="DCM").found()
    (one,) = (one for one in found if one.kind != "attitude_reset")
    assert (one.severity.word, one.text) == (severity, text)
    assert words in one.evidence


@pytest.mark.parametrize(
    ("text", "t_s", "is_told"),
    [
        ("GPS Glitch", 4.9, False),
        ("GPS Glitch", 5.1, True),
        ("GPS Glitch", 53.9, True),
        ("GPS Glitch", 54.1, False),  # of disarming
        ("Crash: disarming", 55.9, True),
        ("Crash: disarming", 56.1, False),
        ("Preflight Fail: Crash", 9.9, False),
        ("Preflight Fail: Crash", 10.1, True),
        ("PreArm: GPS Glitch", 20.0, False),
        ("GPS Failsafe cleared", 20.0, False),
    ],
)
def test_when_a_text_counts(text, t_s, is_told):
    said = (Said(t_s, Severity.WARNING, text),)
    assert bool(detect_texts(Context(said=said, armed=ARMED))) == is_told


def test_texts_of_one_meaning_are_quoted_together():
    said = tuple(Said(10.0 + n, Severity.ERROR, f"GPS glitch {n}") for n in range(5))
    (one,) = detect_texts(Context(said=said, armed=ARMED))
    assert one.text == "the autopilot said: GPS glitch, 5 times"
    assert one.evidence == "; ".join(f"{10 + n} s: 'GPS glitch {n}'" for n in range(4))
    assert (one.from_s, one.to_s, one.size) == (10.0, 14.0, 5.0)
    (alone,) = detect_texts(Context(said=said[:1], armed=ARMED))
    assert alone.text == "the autopilot said: GPS glitch"


@pytest.mark.parametrize(("at_s", "is_told"), [(4.9, 0), (5.1, 1), (53.9, 1), (54.1, 0)])
def test_lanes_count_while_armed(at_s, is_told):
    lanes = (Span(0.0, at_s, "core 0"), Span(at_s, at_s, "core 0"), Span(at_s, 60.0, "core 1"))
    found = detect_estimators(Context(primary=lanes, armed=ARMED), None, None, ())
    assert len(found) == is_told
    if is_told:
        assert found[0].text == "the autopilot changed its estimator"
        assert found[0].evidence == f"{at_s:.1f} s: core 0 to core 1"
        said = (Said(20.0, Severity.INFO, "EKF3 lane switch 1"),)
        assert detect_texts(Context(said=said, primary=lanes, armed=ARMED)) == []


@pytest.mark.parametrize(("attitudes_", "samples"), [(2, 100), (20, 2), (0, 0)])
def test_a_few_rows_show_no_jump(attitudes_, samples):
    t_s = 10.0 + 0.1 * np.arange(attitudes_)
    q_nb = np.tile((1.0, 0.0, 0.0, 0.0), (attitudes_, 1))
    q_nb[1:] = (0.0, 0.0, 0.0, 1.0)
    context = Context(attitudes=(AttitudeTrack("EKF3", t_s, q_nb),), armed=ARMED)
    imu_s = 10.0 + 0.01 * np.arange(samples)
    stamps = np.round(imu_s * 1e6).astype(np.int64)
    track = ImuTrack(0, "IMU", imu_s, stamps, *np.zeros((3, samples, 3)))
    assert detect_estimators(context, track, None, ()) == []

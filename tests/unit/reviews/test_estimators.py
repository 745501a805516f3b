"""The autopilot's estimators: resets, switches, cores, texts, and who is right."""

import numpy as np
import pytest
from reviewed_flights import GPS_HZ, estimates, flight, ideal

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.rows import product
from h2nav.maths.units import DEG
from h2nav.recordings.context import Array, AttitudeTrack, Context, Said, Span
from h2nav.reviews.analysis import analyse
from h2nav.reviews.estimators import detect_texts
from h2nav.reviews.flight import Flight
from h2nav.reviews.inertial import exponential


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

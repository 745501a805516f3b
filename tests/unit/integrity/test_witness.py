"""Another attitude against ours: how far apart, from when on, and who is right."""

import math
import random

import pytest

from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Trust, VelocityFix
from h2nav.integrity import velocity_witness
from h2nav.integrity.findings import Severity
from h2nav.integrity.tilt_corrections import TiltCorrections
from h2nav.integrity.velocity_witness import NO_DOUBT, OwnDoubt, VelocityVerdict, Verdicts
from h2nav.integrity.witness import CLOCK_WRAP_US, AttitudeSource, Witness
from h2nav.maths.quaternion import conjugate, from_euler, multiply, rotate
from h2nav.maths.units import GRAVITY_M_S2

GOOD = Trust.ALIGNED | Trust.CONVERGED | Trust.YAW_REFERENCED
STEP_US = 10_000
REST = (0.0, 0.0, -GRAVITY_M_S2)
DEG = math.pi / 180.0
PLAIN_TEXT = "autopilot heading differs by 23 deg"


def estimate(t_us, q_nb, trust=GOOD, w_b=(0.0, 0.0, 0.0)):
    zero = (0.0, 0.0, 0.0)
    return AttitudeEstimate(t_us, q_nb, w_b, zero, zero, 0.5 * DEG, trust, 1.5 * DEG)


def yaw(degrees):
    return from_euler(0.0, 0.0, degrees * DEG)


class Bench:
    """Our estimates at 100 Hz, theirs at 10 Hz, both of a vehicle at rest."""

    def __init__(self, trust=GOOD):
        self.witness = Witness()
        self.trust = trust
        self.t_us = 60_000_000
        self.found = []

    def rests(
        self,
        seconds,
        theirs,
        source=AttitudeSource.AUTOPILOT,
        first_us=0,
        by_compass_rad=None,
    ):
        for count in range(round(seconds * 1e6 / STEP_US)):
            self.t_us += STEP_US
            ours = estimate(self.t_us, yaw(0.0), self.trust)
            self.found += self.witness.add(ImuSample(self.t_us, (0.0, 0.0, 0.0), REST), ours)
            if count % 10 == 0 and theirs is not None:
                time_ms = (self.t_us + first_us) // 1000
                self.found += self.witness.report(source, time_ms, theirs, by_compass_rad)
        return self.witness.alarms()


def test_tilt_and_heading_are_told_apart():
    bench = Bench()
    bench.rests(1.0, multiply(yaw(-8.0), from_euler(3.0 * DEG, 0.0, 0.0)))
    assert len(bench.found) == 10
    found = bench.found[-1]
    assert found.tilt_rad == pytest.approx(3.0 * DEG, abs=1e-9)
    assert found.heading_rad == pytest.approx(-8.0 * DEG, abs=1e-9)
    assert found.sigma_tilt_rad == pytest.approx(math.hypot(0.5, 0.5) * DEG)
    assert found.sigma_heading_rad == pytest.approx(math.hypot(1.5, 1.0) * DEG)


@pytest.mark.parametrize("offset_ms", [-503, -7, 0, 4])
def test_both_are_compared_at_the_same_time(offset_ms):
    """A vehicle that turns at 100 deg/s: 5 ms would be half a degree."""
    witness, found = Witness(), []
    for count in range(1, 101):
        t_us = 60_000_000 + count * STEP_US
        sample = ImuSample(t_us, (0.0, 0.0, 100.0 * DEG), REST)
        ours = estimate(t_us, yaw(count), w_b=sample.w_b)
        found += witness.add(sample, ours)
        if count == 90:
            at_ms = t_us // 1000 + offset_ms
            found += witness.report(AttitudeSource.AUTOPILOT, at_ms, yaw(90.0 + 0.1 * offset_ms))
    (only,) = found
    assert only.t_us == 60_900_000 + offset_ms * 1000
    assert abs(only.heading_rad) < 1e-6


@pytest.mark.parametrize("first_us", [-1_500_000, 150_000, 3_600_000_000])
def test_another_clock_is_not_compared(first_us):
    bench = Bench()
    bench.rests(2.0, yaw(50.0), first_us=first_us)
    assert bench.found == []


def test_the_counter_of_milliseconds_wraps():
    bench = Bench()
    bench.t_us += CLOCK_WRAP_US - 61_000_000
    bench.rests(2.0, yaw(0.0))
    assert len(bench.found) == 20
    bench.found.clear()
    bench.rests(2.0, yaw(0.0), first_us=-CLOCK_WRAP_US)
    assert len(bench.found) == 20


def test_what_does_not_last_is_not_told():
    bench = Bench()
    assert bench.rests(5.0, yaw(0.0)) == ()
    assert bench.rests(3.5, yaw(40.0)) == ()
    assert bench.rests(5.0, yaw(0.0)) == ()
    assert bench.rests(3.5, yaw(40.0)) == ()


def test_a_plain_disagreement_is_told_after_four_seconds_and_ends():
    bench = Bench()
    bench.rests(4.2, yaw(23.0))
    (alarm,) = bench.witness.alarms()
    assert (alarm.kind, alarm.sensor.name) == ("autopilot_heading", "autopilot")
    assert alarm.severity is Severity.WARNING
    assert alarm.size == pytest.approx(23.0)
    assert alarm.text == PLAIN_TEXT
    assert alarm.evidence == (
        "heading of the autopilot differs by 23 deg since 4 s; no GPS velocity shows who is right"
    )
    assert not alarm.degrades
    assert alarm.since_s == pytest.approx(4.0, abs=0.2)
    assert bench.rests(1.5, yaw(0.0)) == ()


@pytest.mark.parametrize(
    ("by_compass_deg", "text"),
    [(8.0, "autopilot heading off 23 deg, compass backs us"), (12.0, PLAIN_TEXT)],
)
@pytest.mark.parametrize("ahead_us", [0, 60_000])
def test_the_compass_backs_us_where_their_heading_jumps(by_compass_deg, text, ahead_us):
    bench = Bench()
    for seconds, heading_deg in ((11.0, 2.0), (4.5, 23.0)):
        bench.rests(
            seconds, yaw(heading_deg), first_us=ahead_us, by_compass_rad=by_compass_deg * DEG
        )
    (alarm,) = bench.witness.alarms()
    assert alarm.text == text
    assert alarm.backs_us is (True if "backs us" in text else None)
    assert not alarm.degrades


def test_one_that_is_not_plain_is_told_after_ten_seconds():
    bench = Bench()
    assert bench.rests(9.5, yaw(8.0)) == ()
    assert len(bench.rests(1.0, yaw(8.0))) == 1


def test_an_autopilot_that_falls_silent_is_no_alarm():
    bench = Bench()
    assert bench.rests(5.0, yaw(40.0))
    assert bench.witness.latest is not None
    assert bench.rests(2.5, None) == ()
    assert bench.witness.latest is None


def test_three_degrees_are_no_disagreement():
    assert Bench().rests(30.0, multiply(yaw(2.9), from_euler(0.0, 2.0 * DEG, 0.0))) == ()


@pytest.mark.parametrize("trust", [Trust.ALIGNED, Trust(0)])
def test_nothing_is_compared_before_we_have_converged(trust):
    bench = Bench(trust)
    assert bench.rests(20.0, yaw(40.0)) == ()
    assert bench.found == []


def test_a_heading_of_ours_without_reference_accuses_nobody():
    bench = Bench(Trust.ALIGNED | Trust.CONVERGED)
    assert bench.rests(20.0, yaw(40.0)) == ()
    assert math.isnan(bench.found[-1].sigma_heading_rad)
    bench.rests(5.0, multiply(yaw(40.0), from_euler(20.0 * DEG, 0.0, 0.0)))
    assert [alarm.kind for alarm in bench.witness.alarms()] == ["autopilot_tilt"]


def test_the_second_estimator_is_only_a_remark_and_may_be_worse():
    bench = Bench()
    assert bench.rests(20.0, yaw(14.0), AttitudeSource.AHRS2) == ()
    (alarm,) = bench.rests(20.0, yaw(40.0), AttitudeSource.AHRS2)
    assert (alarm.kind, alarm.sensor.name) == ("autopilot_heading", "AHRS2")
    assert alarm.severity is Severity.INFO


def test_a_restart_forgets_everything():
    bench = Bench()
    bench.rests(5.0, yaw(40.0))
    bench.witness.restart()
    assert bench.witness.alarms() == ()
    assert bench.witness.latest is None
    assert bench.witness.report(AttitudeSource.AUTOPILOT, bench.t_us // 1000, yaw(0.0)) == []


class Flight:
    """A level vehicle that accelerates to and fro or circles, with the velocity of a receiver.

    Args:
        our_error: turn (NED) from the truth to our attitude; or time (s) to it.
        their_error: the same of the other one.
        acceleration: time (s) to the horizontal acceleration, m/s^2.
        velocity: its integral.
        late_s: latency of the receiver.
        noise_m_s: of the receiver.
        fixes_until_s: its last fix.
        length_s: of the flight.
        turns_deg_s: about the vertical.
        accelerometer_is_off: by as much as would tilt our attitude by its error.
        excluded_s: from when until when the receiver is held to be false.
        axes_turned_deg: of the accelerometer in the body, about its z.
        found_anew_s: when our attitude, until then of `error_before`, is found anew.
        error_before: turn (NED) from the truth to our attitude until then.
        wrong_from_s: when the other attitude gets its error.
        error_is_of_body: theirs is in body axes, as if it came from an accelerometer.
        doubt: of our attitude.
        removed_s: time (s) to the latency that has been learnt.
    """

    def __init__(
        self,
        our_error,
        their_error,
        acceleration,
        velocity,
        late_s=0.15,
        noise_m_s=0.05,
        fixes_until_s=math.inf,
        length_s=30,
        *,
        turns_deg_s=0.0,
        accelerometer_is_off=False,
        excluded_s=(math.inf, math.inf),
        axes_turned_deg=0.0,
        found_anew_s=0.0,
        error_before=None,
        wrong_from_s=0.0,
        error_is_of_body=False,
        doubt=NO_DOUBT,
        removed_s=None,
    ):
        self.witness = Witness()
        random_numbers = random.Random(1)
        for count in range(1, 100 * length_s + 1):
            t_s, t_us = count * 0.01, 60_000_000 + count * STEP_US
            nose = from_euler(0.05, -0.1, 0.7 + turns_deg_s * DEG * t_s)
            force_n = (*acceleration(t_s), -GRAVITY_M_S2)
            felt_through = multiply(our_error, nose) if accelerometer_is_off else nose
            force_b = rotate(yaw(axes_turned_deg), rotate(conjugate(felt_through), force_n))
            sample = ImuSample(t_us, (0.0, 0.0, 0.0), force_b)
            error = our_error(t_s) if callable(our_error) else our_error
            ours = multiply(error if t_s >= found_anew_s else error_before, nose)
            has_converged = not 0.0 <= found_anew_s - t_s < 0.1
            trust = GOOD if has_converged else Trust.ALIGNED
            self.witness.add(sample, estimate(t_us, ours, trust))
            if count % 10 == 0:
                pair = (nose, their_error) if error_is_of_body else (their_error, nose)
                theirs = multiply(*pair) if t_s >= wrong_from_s else nose
                found = self.witness.report(AttitudeSource.AUTOPILOT, t_us // 1000, theirs)
                self.verdicts = found[-1].verdicts if found else Verdicts()
            if count % 20 == 0 and t_s < fixes_until_s:
                north, east = (
                    v + random_numbers.gauss(0, noise_m_s) for v in velocity(t_s - late_s)
                )
                fix = VelocityFix(t_us, (north, east, 0.0), 0.3)
                since_s, until_s = excluded_s
                is_excluded = since_s <= t_s < until_s
                learnt_s = 0.0 if removed_s is None else removed_s(t_s)
                self.witness.fix(
                    fix,
                    doubt._replace(may_be_bent=is_excluded),
                    lambda fix, learnt_s=learnt_s: fix._replace(
                        t_us=fix.t_us - round(1e6 * learnt_s),
                        removed_s=learnt_s,
                        removed_sigma_s=0.03 if learnt_s else 0.2,
                    ),
                )

    @property
    def text(self):
        (alarm,) = self.witness.alarms()
        return alarm.text


def to_and_fro(t_s):
    return (2.0 * math.cos(0.8 * t_s), 1.0 * math.cos(0.5 * t_s))


def swinging(t_s):
    return (2.5 * math.sin(0.8 * t_s), 2.0 * math.sin(0.5 * t_s))


def circling(t_s):
    return (-2.0 * math.sin(0.5 * t_s), 2.0 * math.cos(0.5 * t_s))


def round_and_round(t_s):
    return (4.0 * math.cos(0.5 * t_s), 4.0 * math.sin(0.5 * t_s))


RIGHT = yaw(0.0)
SHORT = 50 - len("h2nav: ")


def test_the_velocity_shows_that_their_heading_is_wrong():
    flight = Flight(RIGHT, yaw(12.0), to_and_fro, swinging)
    assert flight.verdicts == Verdicts(heading=VelocityVerdict.H2NAV)
    assert flight.text == "autopilot heading off 12 deg, GPS backs us"
    assert len(flight.text) <= SHORT


def test_the_velocity_shows_that_our_heading_is_wrong():
    flight = Flight(yaw(-12.0), RIGHT, to_and_fro, swinging)
    assert flight.verdicts == Verdicts(heading=VelocityVerdict.AUTOPILOT)
    assert flight.text == "our heading off 12 deg, GPS backs autopilot"
    assert len(flight.text) <= SHORT


@pytest.mark.parametrize("wrong", [True, False])
def test_the_velocity_shows_whose_tilt_is_wrong(wrong):
    """Without turns, beyond what an accelerometer's bias may be; in turns, less."""
    for tilt_deg, turns_deg_s in ((7.0, 0.0), (4.0, 15.0)):
        tilted = from_euler(tilt_deg * DEG, 0.0, 0.0)
        errors = (tilted, RIGHT) if wrong else (RIGHT, tilted)
        flight = Flight(*errors, to_and_fro, swinging, turns_deg_s=turns_deg_s)
        verdict = VelocityVerdict.AUTOPILOT if wrong else VelocityVerdict.H2NAV
        assert flight.verdicts == Verdicts(tilt=verdict)


def test_a_biased_accelerometer_that_has_tilted_us_backs_nobody():
    """Of 0.7 m/s^2: the velocities fit our attitude, which has followed it."""
    tilted = from_euler(4.0 * DEG, 0.0, 0.0)
    flight = Flight(tilted, RIGHT, to_and_fro, swinging, accelerometer_is_off=True)
    assert flight.verdicts == Verdicts()


@pytest.mark.parametrize(
    ("moved_deg", "tilt"),
    [(-7.0, VelocityVerdict.UNDECIDED), (7.0, VelocityVerdict.H2NAV)],
)
def test_velocities_back_no_tilt_that_they_have_made(moved_deg, tilt):
    """Of ours, when it moved and the other one did not; never against the other way round."""
    corrections, tilted = TiltCorrections(), from_euler(7.0 * DEG, 0.0, 0.0)
    for i, turned_deg in enumerate((0.0, moved_deg)):
        q_ns = from_euler(turned_deg * DEG, 0.0, 0.0)
        corrections.take(i, q_ns, is_anew=i == 0)
    ours = Flight(RIGHT, tilted, to_and_fro, swinging, doubt=OwnDoubt(corrections=corrections))
    assert ours.verdicts == Verdicts(tilt=tilt)
    theirs = Flight(tilted, RIGHT, to_and_fro, swinging, doubt=OwnDoubt(corrections=corrections))
    assert theirs.verdicts == Verdicts(tilt=VelocityVerdict.AUTOPILOT)


@pytest.mark.parametrize(
    ("apart_deg", "tilt"), [(3.6, VelocityVerdict.UNDECIDED), (3.4, VelocityVerdict.H2NAV)]
)
def test_velocities_back_no_tilt_of_one_of_imus_that_differ(apart_deg, tilt):
    """By half as much as the autopilot's differs from the one that is sent."""
    doubt, tilted = OwnDoubt(tilts_apart_rad=apart_deg * DEG), from_euler(7.0 * DEG, 0.0, 0.0)
    ours = Flight(RIGHT, tilted, to_and_fro, swinging, doubt=doubt)
    assert ours.verdicts == Verdicts(tilt=tilt)
    theirs = Flight(tilted, RIGHT, to_and_fro, swinging, doubt=doubt)
    assert theirs.verdicts == Verdicts(tilt=VelocityVerdict.AUTOPILOT)


@pytest.mark.parametrize(
    ("tilt_deg", "wrong_from_s", "tilt"),
    [
        (3.3, 0.0, VelocityVerdict.UNDECIDED),
        (3.3, 1.0, VelocityVerdict.H2NAV),
        (3.6, 0.0, VelocityVerdict.H2NAV),
    ],
)
def test_velocities_back_no_tilt_that_a_bias_may_have_made_from_the_beginning(
    monkeypatch, tilt_deg, wrong_from_s, tilt
):
    """60 mg tilt by 3.44 deg; in a turn a gyro whose axes are turned hides them."""
    backs_us = Verdicts(tilt=VelocityVerdict.H2NAV)
    monkeypatch.setattr(velocity_witness, "_verdicts", lambda windows: backs_us)
    flight = Flight(
        RIGHT,
        from_euler(tilt_deg * DEG, 0.0, 0.0),
        to_and_fro,
        swinging,
        turns_deg_s=15.0,
        wrong_from_s=wrong_from_s,
        error_is_of_body=True,
    )
    assert flight.verdicts == Verdicts(tilt=tilt)


def test_a_verdict_by_what_is_left_of_the_evidence_is_doubted_as_well(monkeypatch):
    """Few windows back us, as it were, and more of them do not: without fixes few are left."""
    backs_us = Verdicts(tilt=VelocityVerdict.H2NAV)
    monkeypatch.setattr(
        velocity_witness, "_verdicts", lambda windows: backs_us if len(windows) < 8 else Verdicts()
    )
    tilted, left = from_euler(7.0 * DEG, 0.0, 0.0), {"fixes_until_s": 20.0, "length_s": 40}
    assert Flight(RIGHT, tilted, to_and_fro, swinging, **left).verdicts == backs_us
    doubt = OwnDoubt(tilts_apart_rad=1.0)
    assert Flight(RIGHT, tilted, to_and_fro, swinging, doubt=doubt, **left).verdicts == Verdicts()


def test_gps_and_autopilot_together_degrade_our_attitude_and_neither_does_alone():
    tilted = from_euler(7.0 * DEG, 0.0, 0.0)
    for ours, theirs, degrades in (
        (yaw(-12.0), RIGHT, True),
        (tilted, RIGHT, True),
        (RIGHT, yaw(12.0), False),
        (RIGHT, tilted, False),
    ):
        alarms = Flight(ours, theirs, to_and_fro, swinging).witness.alarms()
        assert [alarm.degrades for alarm in alarms] == [degrades]
    # A receiver that is of no help leaves it at a difference.
    alarms = Flight(yaw(-20.0), RIGHT, to_and_fro, swinging, noise_m_s=4.0).witness.alarms()
    assert not any(alarm.degrades for alarm in alarms)


def test_a_smaller_error_is_told_where_the_velocity_proves_it():
    """4 deg are less than three deviations of ours."""
    assert Flight(RIGHT, yaw(4.0), to_and_fro, swinging).witness.alarms()
    assert not Flight(RIGHT, yaw(4.0), lambda t: (0, 0), lambda t: (0, 0)).witness.alarms()


@pytest.mark.parametrize(("backed_s", "is_told"), [(3.0, False), (5.0, True)])
@pytest.mark.parametrize("who", [VelocityVerdict.H2NAV, VelocityVerdict.AUTOPILOT])
def test_what_speaks_for_us_has_to_last(monkeypatch, who, backed_s, is_told):
    """Against us it counts at once."""
    bench = Bench()
    velocity = bench.witness._reporters[AttitudeSource.AUTOPILOT].velocity
    bench.rests(10.0, yaw(4.0))
    assert not bench.witness.alarms()
    monkeypatch.setattr(velocity, "_found", Verdicts(heading=who))
    bench.rests(backed_s, yaw(4.0))
    assert bool(bench.witness.alarms()) == (is_told or who is VelocityVerdict.AUTOPILOT)


def test_a_late_receiver_in_a_circle_looks_like_a_wrong_heading_and_proves_nothing():
    """0.3 s at 29 deg/s are 8.6 deg."""
    flight = Flight(RIGHT, yaw(-8.6), circling, round_and_round, late_s=0.3)
    assert flight.verdicts.heading is not VelocityVerdict.AUTOPILOT


@pytest.mark.parametrize(
    ("ours_deg", "theirs_deg", "right"),
    [(0.0, -8.6, VelocityVerdict.H2NAV), (8.6, 0.0, VelocityVerdict.AUTOPILOT)],
)
@pytest.mark.parametrize("learnt_from_s", [0.0, 15.0])
def test_a_latency_that_is_known_is_no_heading(ours_deg, theirs_deg, right, learnt_from_s):
    """What is learnt of it meanwhile counts for what has been seen before."""
    flight = Flight(
        yaw(ours_deg),
        yaw(theirs_deg),
        circling,
        round_and_round,
        late_s=0.35,
        removed_s=lambda t_s: 0.35 if t_s >= learnt_from_s else 0.0,
    )
    assert flight.verdicts.heading is right


def test_velocities_without_samples_are_no_evidence():
    flight = Flight(RIGHT, yaw(12.0), to_and_fro, swinging)
    velocity = flight.witness._reporters[AttitudeSource.AUTOPILOT].velocity
    before = list(velocity._windows)
    for count in range(1, 51):
        fix = VelocityFix(90_200_000 + 200_000 * count, (3.0, 1.0, 0.0), 0.3)
        flight.witness.fix(fix)
    assert list(velocity._windows) == before
    assert velocity.verdicts.heading is VelocityVerdict.H2NAV


@pytest.mark.parametrize(("late_s", "is_known"), [(0.2, True), (0.4, False)])
def test_a_receiver_that_is_later_than_it_was_proves_nothing(late_s, is_known):
    flight = Flight(
        RIGHT, yaw(12.0), to_and_fro, swinging, late_s=late_s, removed_s=lambda t_s: 0.2
    )
    assert (flight.verdicts.heading is VelocityVerdict.H2NAV) == is_known


@pytest.mark.parametrize(
    ("swing_deg", "theirs_deg", "right"),
    [
        (1.0, 8.0, VelocityVerdict.H2NAV),
        (8.0, 8.0, VelocityVerdict.UNDECIDED),
        (8.0, 0.0, VelocityVerdict.AUTOPILOT),
    ],
)
def test_nothing_speaks_for_a_heading_of_ours_that_moves(swing_deg, theirs_deg, right):
    flight = Flight(
        lambda t_s: yaw(swing_deg * math.sin(1.5 * t_s)), yaw(theirs_deg), to_and_fro, swinging
    )
    assert flight.verdicts.heading is right


@pytest.mark.parametrize(("late_s", "is_known"), [(0.9, True), (1.2, False)])
def test_of_a_velocity_that_is_later_than_what_is_kept_nothing_is_said(late_s, is_known):
    flight = Flight(
        RIGHT, yaw(12.0), to_and_fro, swinging, late_s=late_s, removed_s=lambda t_s: late_s
    )
    assert (flight.verdicts.heading is VelocityVerdict.H2NAV) == is_known


@pytest.mark.parametrize(("theirs_deg", "is_told"), [(40.0, True), (50.0, False)])
def test_of_another_vertical_no_heading_is_told(theirs_deg, is_told):
    bench = Bench()
    alarms = bench.rests(5.0, multiply(yaw(20.0), from_euler(theirs_deg * DEG, 0.0, 0.0)))
    assert {alarm.kind for alarm in alarms} == {"autopilot_tilt"} | (
        {"autopilot_heading"} if is_told else set()
    )


def test_a_receiver_that_contradicts_both_proves_nothing():
    flight = Flight(RIGHT, yaw(20.0), to_and_fro, swinging, noise_m_s=4.0)
    assert flight.verdicts == Verdicts()


@pytest.mark.parametrize(("length_s", "is_known"), [(45, True), (65, False)])
def test_a_verdict_lasts_no_longer_than_its_evidence(length_s, is_known):
    """The last velocity came after 30 s; the disagreement goes on."""
    flight = Flight(RIGHT, yaw(12.0), to_and_fro, swinging, fixes_until_s=30, length_s=length_s)
    assert (flight.verdicts.heading is VelocityVerdict.H2NAV) == is_known
    assert ("GPS backs us" in flight.text) == is_known


def test_an_excluded_receiver_speaks_against_us_but_never_for_us():
    """So that no exclusion hides our own error, and no false velocity that bent us defends us."""
    flights = {
        ours: Flight(
            yaw(ours), yaw(ours + 12.0), to_and_fro, swinging, excluded_s=(15.0, math.inf)
        ).verdicts.heading
        for ours in (0.0, -12.0)
    }
    assert flights == {0.0: VelocityVerdict.UNDECIDED, -12.0: VelocityVerdict.AUTOPILOT}


@pytest.mark.parametrize(("back_s", "is_known"), [(29.0, False), (20.0, True)])
def test_after_an_exclusion_only_what_is_new_is_evidence(back_s, is_known):
    flight = Flight(RIGHT, yaw(12.0), to_and_fro, swinging, excluded_s=(10.0, back_s))
    assert (flight.verdicts.heading is VelocityVerdict.H2NAV) == is_known


def test_a_velocity_of_the_autopilots_own_estimator_is_no_witness():
    bench = Bench()
    for north in (0.0, 3.0, 0.0, 3.0, 0.0, 3.0):
        bench.rests(2.0, yaw(20.0))
        bench.witness.fix(VelocityFix(bench.t_us, (north, 0.0, 0.0), 0.3, independent=False))
    assert bench.found[-1].verdicts == Verdicts()


@pytest.mark.parametrize(("theirs_deg", "is_decided"), [(-2.0, False), (-9.0, True)])
def test_axes_of_an_accelerometer_choose_between_no_two_headings(theirs_deg, is_decided):
    """They are turned by 2 deg, as those of its data sheet may be, and our heading is off by 4."""
    flight = Flight(
        yaw(4.0),
        yaw(theirs_deg),
        lambda t_s: tuple(3.0 * a for a in to_and_fro(t_s)),
        lambda t_s: tuple(3.0 * v for v in swinging(t_s)),
        axes_turned_deg=-2.0,
        noise_m_s=0.02,
    )
    assert (flight.verdicts.heading is VelocityVerdict.H2NAV) == is_decided


@pytest.mark.parametrize(("at_s", "is_known"), [(27.0, False), (20.0, True)])
def test_evidence_of_an_attitude_that_is_gone_says_nothing_of_the_new_one(at_s, is_known):
    flight = Flight(
        RIGHT, yaw(12.0), to_and_fro, swinging, found_anew_s=at_s, error_before=yaw(-90.0)
    )
    assert (flight.verdicts.heading is VelocityVerdict.H2NAV) == is_known

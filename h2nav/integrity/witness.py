"""Compares the autopilot's attitude with ours: difference, duration, and which one is right.

Both are brought to one time on the autopilot's clock and compared in tilt and heading. A lasting
difference beyond both deviations becomes an alarm, and the velocity of the GPS receiver decides
which one it supports (`velocity_witness`), or the compass if the other heading has jumped
(`heading_jump`). Nothing of it goes back into the filter.
"""

import math
from collections import deque
from enum import Enum, auto
from typing import NamedTuple

from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Trust, VelocityFix
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.heading_jump import LASTING_US, HeadingJump
from h2nav.integrity.spell import PAUSE_US, STALE_US, Spell
from h2nav.integrity.velocity_witness import (
    NO_DOUBT,
    Correction,
    Integrated,
    OwnDoubt,
    VelocityVerdict,
    VelocityWitness,
    Verdicts,
)
from h2nav.maths.quaternion import Quat, conjugate, multiply, normalize, tilt_and_heading

CLOCK_WRAP_US = (1 << 32) * 1000
PAST_US = 1_000_000
# Attitudes are interpolated over at most this time.
LONGEST_GAP_US = 100_000
MAX_WAITING = 8
COMPARED_WITH = int(Trust.ALIGNED | Trust.CONVERGED)
BEYOND = 3.0  # deviations
# Of verticals that are further apart nothing about either is a heading of both.
ONE_VERTICAL_RAD = math.radians(45.0)
# Difference of two attitudes that may both be right.
MIN_DIFFERENCE_RAD = math.radians(3.0)
# A disagreement is reported after the first time if it is plain, or if one side is known to be
# right; otherwise after the second one.
UNDECIDED_US = 10_000_000
PLAIN = 2.0  # limits


class AttitudeSource(Enum):
    """The estimator behind a reported attitude; the value is its name in logs and alarms."""

    AUTOPILOT = "autopilot"
    AHRS2 = "AHRS2"


class _Quality(NamedTuple):
    """Quality of an attitude in flight: deviations of tilt and heading (rad), of time (s)."""

    tilt_rad: float
    heading_rad: float
    time_s: float


# By the recorded flights against the truth (docs/integrity.md): the main estimators within 0.4 and
# 1.3 deg where nothing is wrong; AHRS2, often a complementary filter, off by 2 and 5 deg at times.
QUALITIES = {
    AttitudeSource.AUTOPILOT: _Quality(math.radians(0.5), math.radians(1.0), 0.01),
    AttitudeSource.AHRS2: _Quality(math.radians(2.0), math.radians(5.0), 0.03),
}


class _Proof(Enum):
    """What shows which of two attitudes is right."""

    GPS_FOR_US = auto()
    GPS_FOR_THEM = auto()
    COMPASS_FOR_US = auto()
    NONE = auto()


BY_VELOCITY = {
    VelocityVerdict.H2NAV: _Proof.GPS_FOR_US,
    VelocityVerdict.AUTOPILOT: _Proof.GPS_FOR_THEM,
    VelocityVerdict.UNDECIDED: _Proof.NONE,
}


class Comparison(NamedTuple):
    """Another attitude minus ours."""

    t_us: int  # of both
    source: AttitudeSource  # of the other attitude
    tilt_rad: float  # angle between the verticals
    heading_rad: float  # the other heading minus ours
    sigma_tilt_rad: float  # deviation of the difference, both of them together
    sigma_heading_rad: float  # the same; NaN if ours has no reference, or no vertical is common
    verdicts: Verdicts  # by the velocity


class _Disagreement:
    """One part of the attitude of one source."""

    def __init__(self, source: AttitudeSource, part: str) -> None:
        self._source = source
        self._part = part
        quality = QUALITIES[source]
        sigma_rad = quality.tilt_rad if part == "tilt" else quality.heading_rad
        self._least_rad = max(BEYOND * sigma_rad, MIN_DIFFERENCE_RAD)
        self._lasting, self._beyond, self._backed = Spell(), Spell(), Spell()
        self._is_reported = False
        self._alarm: Alarm | None = None

    def alarm(self, t_us: int) -> Alarm | None:
        """The alarm at this time; none without recent reports."""
        return self._alarm if t_us - self._lasting.seen_us <= PAUSE_US else None

    def look(
        self,
        t_us: int,
        difference_rad: float,
        sigma_rad: float,
        verdict: VelocityVerdict,
        *,
        compass_backs_us: bool = False,
    ) -> None:
        """Takes the newest difference and who is right; ignores a NaN sigma."""
        size_rad = abs(difference_rad)
        limit_rad = max(self._least_rad, BEYOND * sigma_rad)
        # Once the velocity has decided, our deviation no longer matters.
        is_known = not math.isnan(sigma_rad)
        proof = BY_VELOCITY[verdict]
        if proof is _Proof.NONE and compass_backs_us:
            proof = _Proof.COMPASS_FOR_US
        decided = is_known and proof is not _Proof.NONE
        lasted_us = self._lasting.look(t_us, is_so=is_known and size_rad > self._least_rad)
        beyond_us = self._beyond.look(t_us, is_so=is_known and size_rad > limit_rad)
        if lasted_us is None:
            self._is_reported, self._alarm = False, None
            return
        beyond_us = beyond_us or 0
        is_plain = size_rad > PLAIN * limit_rad and beyond_us >= LASTING_US
        is_proved = decided and lasted_us >= LASTING_US
        if proof is _Proof.GPS_FOR_US:
            # One window of velocities among many may speak for us by chance.
            backed_us = self._backed.look(t_us, is_so=decided)
            is_proved &= (backed_us or 0) >= LASTING_US
        self._is_reported |= is_plain or is_proved or beyond_us >= UNDECIDED_US
        if self._is_reported:
            self._alarm = self._alarm_of(math.degrees(size_rad), lasted_us * 1e-6, proof)

    def _alarm_of(self, size_deg: float, since_s: float, proof: _Proof) -> Alarm:
        source, part = self._source, self._part
        size = f"{size_deg:.0f} deg"
        text, whom, backs_us = {
            _Proof.COMPASS_FOR_US: (
                f"{source.value} {part} off {size}, compass backs us",
                "it left ours at once, where no gyro shows a turn, and the compass, whose dip and "
                "norm are the earth's, agrees with h2nav",
                True,
            ),
            _Proof.GPS_FOR_US: (
                f"{source.value} {part} off {size}, GPS backs us",
                "GPS velocity agrees with h2nav",
                True,
            ),
            _Proof.GPS_FOR_THEM: (
                f"our {part} off {size}, GPS backs {source.value}",
                "GPS velocity agrees with the autopilot",
                False,
            ),
            _Proof.NONE: (
                f"{source.value} {part} differs by {size}",
                "no GPS velocity shows who is right",
                None,
            ),
        }[proof]
        is_main = source is AttitudeSource.AUTOPILOT
        whose = "the autopilot" if is_main else "the autopilot's AHRS2"
        return Alarm(
            Kind.AUTOPILOT_TILT if part == "tilt" else Kind.AUTOPILOT_HEADING,
            Sensor(SensorKind.AUTOPILOT if is_main else SensorKind.AHRS2),
            Severity.WARNING if is_main else Severity.INFO,
            size_deg,
            "deg",
            text,
            f"{part} of {whose} differs by {size} since {since_s:.0f} s; {whom}",
            # Two that are independent of us agree against us.
            degrades=is_main and proof is _Proof.GPS_FOR_THEM,
            since_s=since_s,
            is_decided=backs_us is not None,
            backs_us=backs_us,
        )


class _Reporter:
    """The state of one source."""

    def __init__(self, source: AttitudeSource, integrated: Integrated) -> None:
        self.source = source
        self.velocity = VelocityWitness(integrated)
        self.tilt = _Disagreement(source, "tilt")
        self.heading = _Disagreement(source, "heading")
        self._jump = HeadingJump()

    def compare(
        self, ours: AttitudeEstimate, q_nb: Quat, by_compass_rad: float | None
    ) -> Comparison:
        """Compares another attitude at the time of ours; see `Witness.report`."""
        turn_n = multiply(q_nb, conjugate(ours.q_nb))
        tilt_rad, heading_rad = tilt_and_heading(turn_n)
        self.velocity.differs(ours.t_us, ours.q_nb, turn_n, heading_rad)
        quality = QUALITIES[self.source]
        by_time_rad = math.hypot(*ours.w_b) * quality.time_s
        has_headings = Trust.YAW_REFERENCED in ours.trust and tilt_rad < ONE_VERTICAL_RAD
        own_heading_rad = ours.sigma_heading_rad if has_headings else math.nan
        found = Comparison(
            ours.t_us,
            self.source,
            tilt_rad,
            heading_rad,
            math.hypot(ours.sigma_tilt_rad, quality.tilt_rad, by_time_rad),
            math.hypot(own_heading_rad, quality.heading_rad, by_time_rad),
            self.velocity.verdicts,
        )
        self.tilt.look(found.t_us, tilt_rad, found.sigma_tilt_rad, found.verdicts.tilt)
        self._jump.look(found.t_us, ours.q_nb, heading_rad, by_compass_rad)
        self.heading.look(
            found.t_us,
            heading_rad,
            found.sigma_heading_rad,
            found.verdicts.heading,
            compass_backs_us=self._jump.compass_backs_us,
        )
        return found


class _Waiting(NamedTuple):
    """A report of a time at which ours is not known yet."""

    source: AttitudeSource
    t_us: int
    q_nb: Quat
    by_compass_rad: float | None


class Witness:
    """Compares the autopilot's reports with our past estimates."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Restarts for another autopilot, or another clock."""
        self._past: deque[AttitudeEstimate] = deque()
        self._waiting: deque[_Waiting] = deque(maxlen=MAX_WAITING)
        self._integrated = Integrated()
        self._reporters = {source: _Reporter(source, self._integrated) for source in AttitudeSource}
        self._latest: Comparison | None = None

    @property
    def latest(self) -> Comparison | None:
        """The newest comparison with the autopilot's main estimator; None without a fresh one."""
        if self._latest is None or not self._past:
            return None
        return self._latest if self._past[-1].t_us - self._latest.t_us <= STALE_US else None

    def alarms(self) -> tuple[Alarm, ...]:
        """Lasting disagreements."""
        if not self._past:
            return ()
        newest_us = self._past[-1].t_us
        parts = ((reporter.tilt, reporter.heading) for reporter in self._reporters.values())
        alarms = (part.alarm(newest_us) for pair in parts for part in pair)
        return tuple(alarm for alarm in alarms if alarm is not None)

    def add(self, sample: ImuSample, estimate: AttitudeEstimate | None) -> list[Comparison]:
        """Takes our newest estimate; compares the reports of the time just before.

        Args:
            sample: of the estimate.
            estimate: propagated to the time of the sample; None during an alignment.
        """
        if estimate is None or int(estimate.trust) & COMPARED_WITH != COMPARED_WITH:
            if self._past:
                self._past.clear()
                self._integrated.interrupt()
                for reporter in self._reporters.values():
                    reporter.velocity.forget()
            return []
        self._integrated.add(sample, estimate.q_nb)
        t_us, past = estimate.t_us, self._past
        past.append(estimate)
        while t_us - past[0].t_us > PAST_US:
            past.popleft()
        found: list[Comparison] = []
        while self._waiting and self._waiting[0].t_us <= t_us:
            found += self._compare(*self._waiting.popleft())
        return found

    def fix(
        self,
        fix: VelocityFix,
        doubt: OwnDoubt = NO_DOUBT,
        corrected: Correction = lambda fix: fix,
    ) -> None:
        """Takes a velocity of the GPS receiver; see `VelocityWitness.fix`."""
        if fix.independent:
            for reporter in self._reporters.values():
                reporter.velocity.fix(fix, doubt, corrected)

    def report(
        self,
        source: AttitudeSource,
        time_ms: int | None,
        q_nb: Quat,
        by_compass_rad: float | None = None,
    ) -> list[Comparison]:
        """Takes an attitude of the autopilot; stores it until ours of its time is known.

        Args:
            source: its estimator.
            time_ms: on the clock of our samples; None = that of our newest sample.
            q_nb: body to NED.
            by_compass_rad: how far our heading may be off by our compass; None = unknown.
        """
        if not self._past:
            return []
        newest_us = self._past[-1].t_us
        t_us = newest_us
        if time_ms is not None:
            ahead_us = (time_ms * 1000 - newest_us + CLOCK_WRAP_US // 2) % CLOCK_WRAP_US
            t_us += ahead_us - CLOCK_WRAP_US // 2
        if t_us <= newest_us:
            return self._compare(source, t_us, q_nb, by_compass_rad)
        if t_us - newest_us <= LONGEST_GAP_US:
            self._waiting.append(_Waiting(source, t_us, q_nb, by_compass_rad))
        return []

    def _compare(
        self, source: AttitudeSource, t_us: int, q_nb: Quat, by_compass_rad: float | None
    ) -> list[Comparison]:
        ours = self._ours_at(t_us)
        if ours is None:
            return []
        found = self._reporters[source].compare(ours, q_nb, by_compass_rad)
        if source is AttitudeSource.AUTOPILOT:
            self._latest = found
        return [found]

    def _ours_at(self, t_us: int) -> AttitudeEstimate | None:
        """Our estimate at a time; None if none is near."""
        after: AttitudeEstimate | None = None
        for before in reversed(self._past):
            if before.t_us == t_us:
                return before
            if before.t_us < t_us:
                return None if after is None else _between(before, after, t_us)
            after = before
        return None


def _between(
    before: AttitudeEstimate, after: AttitudeEstimate, t_us: int
) -> AttitudeEstimate | None:
    """The estimate between two that differ little."""
    gap_us = after.t_us - before.t_us
    if gap_us > LONGEST_GAP_US:
        return None
    p, q = before.q_nb, after.q_nb
    share = (t_us - before.t_us) / gap_us
    if sum(a * b for a, b in zip(p, q, strict=True)) < 0.0:
        share = -share
    rest = 1.0 - abs(share)
    mixed = (
        rest * p[0] + share * q[0],
        rest * p[1] + share * q[1],
        rest * p[2] + share * q[2],
        rest * p[3] + share * q[3],
    )
    return after._replace(t_us=t_us, q_nb=normalize(mixed))

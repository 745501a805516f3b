"""Searches what makes velocities contradict an attitude, and what follows from the answer.

A false velocity is refused, a wrong sensor corrected or estimated anew; while it may be either the
force or the velocity, both are withheld. What is learnt of a sound receiver is learnt here as well.
Equations: docs/integrity.md, section 5.
"""

import math
from collections.abc import Collection
from typing import NamedTuple

from h2nav.attitude.samples import SensorCorrection, SensorDoubt, SensorErrors
from h2nav.integrity.bent import BentAttitude
from h2nav.integrity.cause_alarms import cause_alarm
from h2nav.integrity.causes import (
    MAX_RECTIFIED,
    PROBABLY,
    SUSPECTED,
    Cause,
    Explained,
    doubt_of,
    explain,
)
from h2nav.integrity.contradiction import Contradiction
from h2nav.integrity.corrected_sensor import CorrectedSensor
from h2nav.integrity.correction import advanced
from h2nav.integrity.field_evidence import OPEN_RATIO
from h2nav.integrity.findings import Alarm, Kind, Sensor
from h2nav.integrity.lasting_scatter import LastingScatter
from h2nav.integrity.opened_errors import OpenedErrors
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.receiver import LearntReceiver
from h2nav.integrity.slow_drift import LENGTH_S as DRIFT_S
from h2nav.integrity.slow_drift import SlowDrift
from h2nav.integrity.strapdown import Strapdown
from h2nav.integrity.velocity_model import Known
from h2nav.integrity.velocity_refusal import HARMLESS_RAD, REFUSED_US, VelocityRefusal
from h2nav.integrity.velocity_rows import VelocityRows
from h2nav.integrity.velocity_windows import ANY_HEADING_RAD, Mark, VelocityWindows, Window
from h2nav.maths.units import DEG, GRAVITY_M_S2

# From this ratio of a velocity on, a cause is searched.
SUSPICIOUS_RATIO = 0.2
# A velocity that is refused as probably false is reported after this time.
REPORTED_US = 3_000_000
# A failing gyro begins like a drifting velocity: the field needs this time to confirm the gyro. A
# velocity that is decided to have jumped, and agrees again, begins like nothing else.
BLAME_US = 2_500_000
# Samples further apart alias a vehicle's vibration (propellers from some 30 Hz on): a mean force
# may be wrong by the whole amplitude on both axes, 2 times the rms and a margin; a rate, if
# anything shakes.
SLOW_US = 15_000.0
ALIASED = 3.0
SHAKEN_M_S2 = 1.0
# A force that shakes by more, rms, is rectified by tenths: of a velocity it shows no smaller drift,
# and no jump, to be false.
RECTIFIED_M_S2 = 5.0
# What is only probable has to be larger by half: lost samples add to the mean.
PROBABLY_RECTIFIED = 1.5 * MAX_RECTIFIED
# Between lost or slow samples of such a force a velocity contradicts for a moment: an undecided
# contradiction is reported after this time.
SHAKEN_US = 5_000_000
# While either the force or the velocity is false, and nothing else, neither corrects the tilt: the
# gyro carries it, for so long that its bias turns it by no more than is harmless.
WITHHELD_US = 30_000_000
# An attitude is only corrected as far as turns that add up are small.
LINEAR_RAD = 10.0 * DEG


class Situation(NamedTuple):
    """What else is known when a velocity arrives.

    Attributes:
        t_us: time of the velocity.
        errors: the filter's knowledge of its sensors.
        ratios: test ratios.
        long: the longest window of velocities; None without one.
        sample_us: time of the newest sample.
        vibration_m_s2: of the accelerometer, rms.
        period_us: of the samples.
        field_holds: a field corrected the heading just now.
        on_ground: the vehicle stands.
        unsettled_us: from when to when the tilt was last not settled.
        is_denied: the velocity, by the places of the same receiver.
    """

    t_us: int
    errors: SensorErrors
    ratios: InnovationRatios
    long: Window | None
    sample_us: int
    vibration_m_s2: float
    period_us: float
    field_holds: bool
    on_ground: bool
    unsettled_us: tuple[int, int]
    is_denied: bool


class CauseSearch:
    """Follows the velocities of one attitude.

    Attributes:
        contradiction: the present one.
        receiver: what is learnt of it.
        corrected: the sensor proved wrong.
        bent: what may have bent the attitude.
        withheld_us: since when force and velocity are withheld; None while they are not.
    """

    def __init__(
        self, strapdown: Strapdown, velocity: VelocityWindows, opened: OpenedErrors
    ) -> None:
        self._strapdown, self._velocity, self._opened = strapdown, velocity, opened
        self.contradiction = Contradiction()
        self.receiver = LearntReceiver()
        self._scatter = LastingScatter()
        self.corrected = CorrectedSensor()
        self.bent = BentAttitude()
        self._cleared: frozenset[Cause] = frozenset()
        self.withheld_us: int | None = None
        self._rows, self._slow = VelocityRows(), SlowDrift()
        self._refusal = VelocityRefusal()
        self._shakes = False  # the force, so much that it is rectified
        self._carried_us = 0  # when the attitude was last set back to that by the gyro
        # when it last may have drifted by more than is harmless
        self._drifted_us: int | None = None
        # when the receiver's places last denied the velocity
        self._denied_us: int | None = None

    def restart(self) -> None:
        """Restarts with the strapdown, or with other velocities."""
        self.restart_rows()
        self.forget()

    def restart_rows(self) -> None:
        """Restarts the windows; what is known of a contradiction stays."""
        self._rows.restart()
        self._slow.restart()

    def renew(self) -> None:
        """Restarts with sensors that were wrong, and are good again."""
        self.restart()
        self.corrected = CorrectedSensor()

    def use_cleared(self, cleared: frozenset[Cause]) -> None:
        """Takes which sensors those of other IMUs confirm."""
        self._cleared = cleared

    def forget(self) -> None:
        """Forgets a contradiction: it is over, or no more velocities come."""
        self._refusal.forget_contradiction()
        self._slow.forget()
        self.contradiction.forget()
        self.withheld_us = None

    # --- what is known ------------------------------------------------------------------------

    @property
    def velocity_is_false(self) -> bool:
        """Whether the velocity must not be fused: see `Monitor.velocity_is_false`."""
        return self._refusal.since_us is not None

    @property
    def velocity_is_known_false(self) -> bool:
        """Whether that is decided, and not only probable."""
        return self._refusal.shown is not None

    @property
    def velocity_is_denied(self) -> bool:
        """Whether the receiver's own places have denied a velocity that still counts."""
        return self._is_denied(self._rows)

    def may_be_bent(self, now_us: int | None) -> bool:
        """Whether the attitude may follow a false velocity, or a sensor of ours that is wrong."""
        if self.velocity_is_known_false or now_us is None:
            return self.velocity_is_known_false
        has_drifted = self._drifted_us is not None and now_us - self._drifted_us < REFUSED_US
        is_bent = self.bent.is_bent(now_us) or self.bent.was_contradicted(now_us)
        return has_drifted or is_bent

    def is_withheld(self, now_us: int) -> bool:
        """Whether either the force or the velocity is false, and only the gyro is not doubted."""
        since_us = self.withheld_us
        if since_us is None or self.velocity_is_false:
            return False
        return now_us - since_us < WITHHELD_US

    def alarms(self, imu: Sensor, t_us: int, reported: Collection[Kind]) -> list[Alarm]:
        """The cause of a lasting contradiction; undecided once only."""
        contradiction, named = self.contradiction, self._named(t_us)
        refused, since_us = self._refusal.shown, self._refusal.since_us
        is_sure = refused is not None
        if since_us is not None and (is_sure or self._is_refused_for_long(t_us)):
            found, since_s = refused or self._refusal.begun, 1e-6 * (t_us - since_us)
            return [cause_alarm(found, Cause.VELOCITY, imu, since_s, is_sure=is_sure)]
        begun_us = contradiction.begun_us
        least_us = SHAKEN_US if named is None and self._shakes else 0
        if begun_us is None or t_us - begun_us < least_us or not contradiction.is_told(t_us):
            return self.corrected.alarms(imu, t_us, self._cleared)
        shown = None if named is None else contradiction.shown(named)
        since_s = (t_us - begun_us) * 1e-6
        alarm = cause_alarm(shown or contradiction.explained, named, imu, since_s)
        return [] if alarm.kind in reported else [alarm]

    def accuses_velocity(self, t_us: int) -> bool:
        """Whether it is named as the cause: then nothing contradicts the attitude."""
        if self.velocity_is_false:
            return self.velocity_is_known_false or self._is_refused_for_long(t_us)
        return self.contradiction.is_told(t_us) and self._named(t_us) is Cause.VELOCITY

    def _is_refused_for_long(self, t_us: int) -> bool:
        """Whether a velocity that is only probably false has been refused for long."""
        since_us = self._refusal.since_us
        return since_us is not None and t_us - since_us >= REPORTED_US

    def _named(self, t_us: int) -> Cause | None:
        """The cause to report: that which was decided.

        So is a velocity that is not refused, for lack of a field, but withheld, if another IMU
        confirms the gyro.
        """
        is_withheld = self.withheld_us is not None and self.is_withheld(t_us)
        if self.contradiction.decided is Cause.VELOCITY and is_withheld:
            return Cause.VELOCITY if Cause.GYRO in self._cleared else None
        return self._decided

    @property
    def _decided(self) -> Cause | None:
        """The cause that was decided, unless others deny it."""
        cause = self.contradiction.decided
        if cause in self._cleared:
            return None
        return cause if cause is not Cause.VELOCITY or self.velocity_is_false else None

    # --- a velocity ---------------------------------------------------------------------------

    def take(self, mark: Mark, seen: Situation) -> tuple[SensorDoubt | None, bool]:
        """Takes a velocity, and searches a cause while it contradicts.

        Returns:
            A doubt for the filter, and whether everything has to be measured anew behind it.
        """
        rows, known = self._rows, None
        self._shakes = seen.vibration_m_s2 > RECTIFIED_M_S2
        if seen.is_denied:
            self._denied_us = seen.t_us
        if rows.take(mark, seen.errors):
            known = self._known(mark, seen, rows)
        self._follow_slowly(mark, seen)
        if self._refusal.since_us is not None:
            self._hear_velocity(seen, None)
        doubt, is_corrected = None, False
        is_quiet = not seen.ratios.of_velocity > SUSPICIOUS_RATIO
        is_settled = self._began_settled(seen) and self._began_with_heading()
        if not is_settled or (is_quiet and not self._slow.found.is_suspicious):
            self.forget()
        elif known is not None and self.contradiction.is_due(seen.t_us):
            doubt, is_corrected = self._search(seen, known)
        # A fault that begins looks like a late velocity: its cause is looked for first.
        is_suspicious = self.contradiction.explained.is_suspicious
        may_learn = not is_suspicious or self.contradiction.is_old(seen.t_us)
        if known is not None and not is_suspicious:
            self._scatter.learn(rows.rows, known)
        if known is not None and may_learn and self.receiver.learn(rows.rows, known):
            # Earlier velocities were corrected otherwise.
            self._velocity.restart()
            self.restart()
            return None, is_corrected
        return doubt, is_corrected

    def _began_settled(self, seen: Situation) -> bool:
        """Whether the tilt was settled when the window began, whatever the filter did since."""
        rows = self._rows.rows
        begun_us = rows[0].begun.moment.t_us if rows else seen.t_us
        from_us, to_us = seen.unsettled_us
        return not from_us <= begun_us <= to_us

    def _began_with_heading(self) -> bool:
        """Whether the window began with a heading: without one, speeding up looks like a fault."""
        rows = self._rows.rows
        return not rows or rows[0].begun.moment.sigma_heading_rad < ANY_HEADING_RAD

    def _known(self, mark: Mark, seen: Situation, rows: VelocityRows) -> Known:
        """What is known at the end of a window."""
        return Known(
            seen.errors,
            mark.moment,
            rows.jitter_m_s,
            self.receiver.errors,
            rows.force_density,
            self._scatter.share,
            rows.usual_m_s2,
            self._rows.shifts,
            1e-6 * seen.period_us,
            is_denied=self._denied_us is not None and self._is_denied(rows),
        )

    def _is_denied(self, rows: VelocityRows) -> bool:
        """Whether a velocity of a window was denied by the places of the same receiver."""
        begun = rows.rows[0].begun if rows.rows else None
        denied_us = self._denied_us
        return begun is not None and denied_us is not None and begun.moment.t_us < denied_us

    def _follow_slowly(self, mark: Mark, seen: Situation) -> None:
        """Looks for a slow drift, with a tilt that has been settled for the whole window."""
        if seen.on_ground:
            # What touches the ground is pushed by it, by blows that samples miss.
            self._slow.restart()
        elif self._slow.take(mark, seen.errors):
            _, unsettled_us = seen.unsettled_us
            if seen.t_us - unsettled_us > 1e6 * DRIFT_S:
                self._slow.search(self._known(mark, seen, self._slow.rows), self._cleared)

    def _search(self, seen: Situation, known: Known) -> tuple[SensorDoubt | None, bool]:
        """Compares the causes; returns a doubt for the filter, and whether it is a correction."""
        t_us = seen.t_us
        found, rows = self._explanation(known)
        self.contradiction.take(t_us, found)
        self._note_drift(t_us, found)
        if not found.is_suspicious:
            self.forget()
            return None, False
        is_back = not self._is_denied(rows) and self._refusal.comes_back(t_us, found)
        self._decide(seen, found, rows, is_back=is_back)
        self._withhold(t_us, found, is_back=is_back)
        correction = None if self.velocity_is_false else self._correct(seen, found, known, rows)
        if correction is not None:
            return SensorDoubt(correction=correction), True
        correction = self._carry(seen, found, known)
        if correction is not None:
            return SensorDoubt(correction=correction), False
        is_new = found.decided is None and self.contradiction.is_young(t_us)
        if self.velocity_is_false or is_new or self.is_withheld(seen.sample_us):
            return None, False
        return doubt_of(found), False

    def _explanation(self, known: Known) -> tuple[Explained, VelocityRows]:
        """That of the short window, or of the long one, with its rows."""
        found = explain(self._rows.rows, known, self._cleared, min_odds=SUSPECTED)
        if found.decided is not None:
            # It need not be explained again for as long as a slow window shows it.
            self._slow.restart()
        elif not found.is_suspicious:
            return self._slow.found, self._slow.rows
        return found, self._rows

    def _note_drift(self, t_us: int, found: Explained) -> None:
        """Notes the tilt by which a false velocity would bend the attitude, if it may be one."""
        if self.contradiction.is_told(t_us) and found.drift_m_s2 > GRAVITY_M_S2 * HARMLESS_RAD:
            self._drifted_us = t_us
        self._opened.suspect_drift(t_us, found.drift_m_s2, is_suspicious=found.is_suspicious)

    def _decide(
        self, seen: Situation, found: Explained, rows: VelocityRows, *, is_back: bool
    ) -> None:
        """Notes what was decided, and hears the velocity; one that comes back is cleared."""
        cause = found.decided
        if is_back:
            self.contradiction.clear(Cause.VELOCITY)
            return
        if cause is not None and not self._is_excused(seen, found, rows.begun_us):
            self.contradiction.decide(cause, found)
            self.bent.decide(cause, seen.t_us)
        is_told = self.contradiction.is_told(seen.t_us)
        if found.share(Cause.VELOCITY) * SUSPECTED > 1.0 and is_told:
            self._refusal.suspect(seen.t_us)
        self._hear_velocity(seen, found)

    def _is_excused(self, seen: Situation, found: Explained, begun_us: int) -> bool:
        """Whether a decision against a sensor may be vibration, or what another one has bent."""
        cause = found.decided
        is_bent = cause is not None and self.bent.excuses(cause, begun_us)
        return is_bent or _may_be_aliased(seen, found)

    # --- the velocity -------------------------------------------------------------------------

    def _hear_velocity(self, seen: Situation, found: Explained | None) -> None:
        """Begins to refuse the velocity, or ends it.

        Args:
            found: a new explanation; None without one.
        """
        shown = self.contradiction.shown(Cause.VELOCITY)
        if not self.velocity_is_false:
            # Only a field can confirm the gyro; that places deny a velocity needs no gyro.
            is_held = seen.ratios.of_turn < OPEN_RATIO and seen.field_holds
            is_held |= self.velocity_is_denied
            if found and is_held and self._is_contradicted_by_velocity(seen, found):
                self._refusal.begin(seen.t_us, found, shown)
            return
        if seen.is_denied:
            self._refusal.deny(seen.t_us)
        elif self._refusal.hear(seen.t_us, seen.long, seen.ratios, found, shown):
            self.contradiction.clear(Cause.VELOCITY)

    def _is_contradicted_by_velocity(self, seen: Situation, found: Explained) -> bool:
        """Whether a false velocity is the cause, or so probably that it is safer not to use it."""
        since_us, t_us = self.contradiction.begun_us, seen.t_us
        # What an earlier window decided counts while this one, which has seen more, agrees.
        if since_us is None or found.likeliest is not Cause.VELOCITY:
            return False
        if self.velocity_is_denied:
            return True
        has_jumped = found.has_jumped and found.decided is Cause.VELOCITY
        if t_us - since_us < BLAME_US and not has_jumped:
            return False
        if self.bent.is_shaken(t_us):
            return False
        if self.contradiction.decided is Cause.VELOCITY:
            return not _may_be_rectified(seen, found)
        if _may_be_rectified(seen, found, PROBABLY_RECTIFIED):
            return False
        return found.is_seen and found.share(Cause.VELOCITY) > PROBABLY

    def _withhold(self, t_us: int, found: Explained, *, is_back: bool) -> None:
        """Begins to withhold force and velocity, or ends it: a velocity that is back is right."""
        if is_back or not found.is_contradiction or not found.is_force_or_velocity:
            self.withheld_us = None
        elif self.withheld_us is None:
            self.withheld_us = t_us

    # --- corrections --------------------------------------------------------------------------

    def _carry(self, seen: Situation, found: Explained, known: Known) -> SensorCorrection | None:
        """Back to the gyro's attitude once the velocity is refused, or withheld with the force.

        What has been learnt from either since it is false would turn the attitude further.
        """
        since_us, now = self._refusal.since_us, self._strapdown.newest
        if since_us is None and self.contradiction.is_told(seen.t_us):
            since_us = self.withheld_us
        if since_us is None or self._carried_us >= since_us or now is None:
            return None
        if found.carried is None or found.carried.tilt_sigma_rad > LINEAR_RAD:
            return None
        correction = advanced(found.carried, known.moment, now)
        north, east, _ = correction.turn_n
        if correction.tilt_sigma_rad > max(math.hypot(north, east), HARMLESS_RAD):
            return None  # the attitude agrees with the gyro's, which is hardly known
        self._carried_us = seen.t_us
        self._opened.correct(correction.tilt_sigma_rad)
        # Neither of both holds the heading.
        return correction._replace(
            turn_n=(north, east, 0.0), heading_sigma_rad=now.sigma_heading_rad
        )

    def _correct(
        self, seen: Situation, found: Explained, known: Known, rows: VelocityRows
    ) -> SensorCorrection | None:
        """What the filter has to take off a sensor that has lastingly been decided to be wrong.

        Everything is measured anew behind it: earlier windows contain the error.
        """
        t_us, now, cause = seen.t_us, self._strapdown.newest, self._decided
        if found.correction is None or now is None or not self.contradiction.is_told(t_us):
            return None
        since_us = self.contradiction.begun_us or t_us
        if cause is None and t_us - since_us > BLAME_US:
            cause = found.probable  # undecided, and it remains so
        if cause is None or cause in self._cleared:
            return None
        if cause is not found.probable or _may_be_aliased(seen, found):
            return None
        if found.correction.tilt_sigma_rad > LINEAR_RAD:
            return None
        correction = advanced(found.correction, known.moment, now)
        self.corrected.take(cause, found, correction, rows.rows[0], since_us)
        self.bent.bend(t_us)
        self._opened.correct(correction.tilt_sigma_rad, correction.heading_sigma_rad)
        self.restart()
        return correction


def _may_be_rectified(seen: Situation, found: Explained, most: float = MAX_RECTIFIED) -> bool:
    """Whether what a force that shakes is rectified to may look like the drift of a velocity."""
    vibration_m_s2 = seen.vibration_m_s2
    is_small = found.drift_m_s2 < most * vibration_m_s2
    return vibration_m_s2 > RECTIFIED_M_S2 and is_small


def _may_be_aliased(seen: Situation, found: Explained) -> bool:
    """Whether vibration between slow samples may look like the fault of a sensor."""
    if seen.period_us < SLOW_US:
        return False
    if found.decided is Cause.ACCELEROMETER:
        return ALIASED * seen.vibration_m_s2 > found.step
    return found.decided is Cause.GYRO and seen.vibration_m_s2 > SHAKEN_M_S2

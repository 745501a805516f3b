"""Monitors one attitude: its sensors, and its consistency with velocity, field and gravity.

The monitor sees the filter's inputs and outputs, and has an arithmetic of its own. It reports when
the filter's deviations are too small for errors that measurements show, and by how much to increase
them. Two things go back to the filter: samples of a frozen sensor, and velocities that only a false
receiver explains, are kept from it; and a sensor proved wrong by a velocity is estimated anew
(`SensorDoubt`).
"""

import math
from collections import Counter
from collections.abc import Collection
from typing import NamedTuple

from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    SensorCorrection,
    SensorDelays,
    SensorDoubt,
    SensorErrors,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.integrity.bent import BentAttitude
from h2nav.integrity.cause_alarms import cause_alarm
from h2nav.integrity.causes import (
    NOTHING,
    PROBABLY,
    SUSPECTED,
    Cause,
    Explained,
    doubt_of,
    explain,
)
from h2nav.integrity.contradiction_alarms import (
    field_alarm,
    force_alarm,
    force_size_alarm,
    no_velocity,
    turn_alarm,
    velocity_alarm,
)
from h2nav.integrity.corrected_sensor import CorrectedSensor
from h2nav.integrity.correction import advanced
from h2nav.integrity.field_windows import FieldWindows
from h2nav.integrity.findings import Alarm, Kind, Sensor
from h2nav.integrity.force_size import ForceError, ForceSize
from h2nav.integrity.kernel.checks import LONGEST_STEP_US
from h2nav.integrity.kernel.memory import (
    BEGUN,
    DUE,
    FIELD_FROZEN,
    KEPT,
    ROW,
    THIN_ROW,
    UNSEEN_TURN,
)
from h2nav.integrity.kernel.windows import JUDGED_US
from h2nav.integrity.lasting import Lasting
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.receiver import LearntReceiver
from h2nav.integrity.sensor_checks import Use, is_bad, sensor_alarms, use_of
from h2nav.integrity.slow_drift import LENGTH_S as DRIFT_S
from h2nav.integrity.slow_drift import SlowDrift
from h2nav.integrity.strapdown import Strapdown
from h2nav.integrity.velocity_model import Known
from h2nav.integrity.velocity_refusal import HARMLESS_RAD, REFUSED_US, SURE_S, VelocityRefusal
from h2nav.integrity.velocity_rows import VelocityRows
from h2nav.integrity.velocity_windows import (
    ANY_HEADING_RAD,
    GATE,
    LENGTHS_S,
    LONG_S,
    Mark,
    VelocityWindows,
    Window,
    change_of_velocity,
    inertial_variance,
)
from h2nav.integrity.watch import Watch
from h2nav.maths.units import DEG, GRAVITY_M_S2

# Errors shown by measurements increase the deviations from this ratio on, and for this long after.
OPEN_RATIO = 0.5
OPEN_S = 10.0
KEPT_OPEN = math.exp(-1e-6 * JUDGED_US / OPEN_S)
# From this ratio of a velocity on, a cause is searched.
SUSPICIOUS_RATIO = 0.2
# A failing gyro begins like a drifting velocity: the field needs this time to confirm the gyro. A
# velocity that is decided to have jumped, and agrees again, begins like nothing else.
BLAME_US = 2_500_000
# Odds at which nothing is learnt of the receiver for a while.
LIKELY = 10.0
# An undecided sensor is estimated anew after a suspicion of this duration.
SUSPECTED_US = 700_000
# An older contradiction is explained at this interval only.
OLD_US = 4_000_000
OLD_SPACING_US = 1_000_000
# A contradiction of this duration is reported, with its cause.
CONTRADICTED_US = 1_000_000
# Assumed velocities: on the ground, and vertically for any vehicle.
GROUND_SPEED_M_S = 1.5
CLIMB_SPEED_M_S = 3.0
JUDGED_S = 1e-6 * JUDGED_US
FORCE_SHARE = JUDGED_S / LONG_S
# A heading is confirmed by velocities that would have shown an error of this size,
CONFIRMED_RAD = 15.0 * DEG
# or by 10 s of a field that is the earth's beyond doubt,
CONFIRMED_RATIO = 0.5
# and stays confirmed as long as the gyro alone would hold it.
SHOWN_US = 10_000_000
# Samples further apart alias a vehicle's vibration (propellers from some 30 Hz on): a mean force
# may be wrong by the whole amplitude on both axes, 2 times the rms and a margin; a rate, if
# anything shakes.
SLOW_US = 15_000.0
SLOW_SHARE = 0.01
ALIASED = 3.0
SHAKEN_M_S2 = 1.0
# A force that shakes by more, rms, is rectified by tenths: it shows no velocity to be false.
RECTIFIED_M_S2 = 5.0
# While either the force or the velocity is false, and nothing else, neither corrects the tilt: the
# gyro carries it, for so long that its bias turns it by no more than is harmless.
WITHHELD_US = 30_000_000
# An attitude is only corrected as far as turns that add up are small.
LINEAR_RAD = 10.0 * DEG
# A field used this recently holds the heading.
FIELD_HOLDS_US = 1_000_000
NO_FORCE: Vec3 = (0.0, 0.0, 0.0)
# Velocities count as lost after this, and after this many of their usual periods.
VELOCITY_LOST_US = 3_000_000
PERIODS_LOST = 4.0
PERIOD_SHARE = 0.2
# A plain number: `&` of a flag makes a new one.
FIELD_USED = int(Trust.FIELD_USED)
CONVERGED = int(Trust.CONVERGED)


class Speeds(NamedTuple):
    """Usual speeds of a vehicle without measurement, m/s, one sigma."""

    horizontal_m_s: float
    vertical_m_s: float = CLIMB_SPEED_M_S


class Monitor:
    """Monitors one filter and its IMU.

    For each sample: call `check`, pass the filter what `Use` allows, then `add` with the result
    (`restart` without one). Velocities, field, vehicle and delays are passed as to the filter; a
    velocity is kept from the filter while `velocity_is_false`.

    Attributes:
        field_is_frozen: the compass does not show the heading.
        ratios: test ratios at the latest sample.
    """

    def __init__(self, imu: Sensor, speeds: Speeds) -> None:
        self._imu = imu
        self._speeds = speeds
        self._watch = Watch()
        self._checked = 0  # bits of the latest check
        self.field_is_frozen = False
        self._strapdown = Strapdown(self._watch)
        self._velocity = VelocityWindows(self._strapdown)
        self._field = FieldWindows(self._watch, self._strapdown)
        self._force_size, self._force_was_wrong = ForceSize(), False
        self.force_is_off = False  # by its size; others may show the same, see `force_error`
        self._other_excesses: Collection[float] = ()
        self._vehicle = VehicleState()
        self._change_n: Vec3 = (0.0, 0.0, 0.0)  # of velocity, by the force of the last 10 s
        self._force_m_s2 = GRAVITY_M_S2  # mean size, of about the last 10 s
        self._windows: list[Window] = []
        self._fix: VelocityFix | None = None
        self._fix_period_us = 0.0
        self._rows, self._slow = VelocityRows(), SlowDrift()
        self._receiver = LearntReceiver()
        self._explained, self._explained_us = NOTHING, 0
        # since when force and velocity are withheld
        self._withheld_us: int | None = None
        self._carried_us = 0  # when the attitude was last set back to that by the gyro
        self._corrected = CorrectedSensor()
        self._bent = BentAttitude()
        self._suspected_us: int | None = None
        self._contradicted_us: int | None = None
        self._refusal = VelocityRefusal()
        self._decisions: Counter[Cause] = Counter()
        self._shown: dict[Cause, Explained] = {}  # the latest explanation that decided each
        self._cleared: frozenset[Cause] = frozenset()  # sensors that other IMUs' confirm
        self._unsettled_from_us = self._unsettled_us = 0  # when the tilt was last unsettled
        self._tilt_rad = self._heading_rad = 0.0
        self._drift_tilt_rad, self._drift_us = 0.0, 0
        # when it last may have drifted by more than is harmless
        self._drifted_us: int | None = None
        self._field_used_us: int | None = None
        self._is_confirmed = False
        self._sample_us, self._period_us = 0, 0.0
        self._checked_us: int | None = None
        self._silent_us = 0  # without samples since the latest velocity
        self._shown_us: int | None = None
        # the field's latest turn in space that failed: over how long, and about the vertical?
        self._turn_s, self._turn_rad, self._turn_is_level = 0, 0.0, False
        self._tests = {name: Lasting() for name in ("velocity", "force", "field", "turn")}
        self.ratios = InnovationRatios()

    def anew(self) -> "Monitor":
        """A new monitor of the same IMU, for a restarted clock."""
        fresh = Monitor(self._imu, self._speeds)
        fresh.use_vehicle(self._vehicle)
        fresh._field.use_field(self._field.reference)
        fresh._watch.use_field_delay(self._watch.gains.field_delay_s)
        return fresh

    def check(self, sample: ImuSample) -> Use:
        """Takes a sample before the filter does; returns what the filter may use."""
        t_us, before_us = sample.t_us, self._checked_us
        if before_us is not None and t_us - before_us > LONGEST_STEP_US:
            # Nothing was heard: a link that is cut loses no velocity.
            self._silent_us += t_us - before_us
        self._checked_us = t_us
        bits = self._checked = self._watch.check(sample)
        self.field_is_frozen = bits & FIELD_FROZEN > 0
        if bits & UNSEEN_TURN:
            unseen_rad = self._watch.memory.unseen_rad
            self._tilt_rad = max(self._tilt_rad, unseen_rad)
            self._heading_rad = max(self._heading_rad, unseen_rad)
        return use_of(bits) if bits else Use.ALL

    @property
    def sensor_is_bad(self) -> bool:
        """Whether gyro or accelerometer is known to be faulty now."""
        return is_bad(self._checked, self._watch.memory)

    @property
    def force_error(self) -> ForceError | None:
        """What the size of the force shows the accelerometer to be off by; None if nothing.

        If that of another IMU is off by as much, the receiver's altitude is false. Without a
        receiver nothing shows any more whether it still is.
        """
        found = self._force_size.found
        if found is None or self.sensor_is_bad or self._force_size.is_stale(self._sample_us):
            return None
        alike_m_s2 = 0.5 * GRAVITY_M_S2 * found.share
        is_shared = any(other / alike_m_s2 > 1.0 for other in self._other_excesses)
        return None if is_shared else found

    @property
    def force_excess_m_s2(self) -> float:
        """By how much the force is larger than velocity and altitude explain, beyond the usual."""
        return self._force_size.latest_m_s2

    @property
    def vibration_m_s2(self) -> float:
        """Of the accelerometer, rms over the last full second."""
        return self._watch.memory.vibration_m_s2

    def add(self, sample: ImuSample, estimate: AttitudeEstimate) -> AttitudeEstimate:
        """Takes the filter's estimate, not propagated, for the sample checked last.

        Returns:
            It with deviations increased to the errors that measurements show.
        """
        t_us, _, force, _, clipped = sample
        before_us = self._sample_us
        apart_us: float = t_us - before_us
        apart_us = min(apart_us, 2.0 * SLOW_US)
        self._period_us += SLOW_SHARE * (apart_us - self._period_us)
        self._sample_us = t_us
        if clipped or force == NO_FORCE:
            # The result of its windows is known already.
            self.restart()
        else:
            bits, trust = self._strapdown.add(t_us, estimate), int(estimate.trust)
            if not trust & CONVERGED:
                if self._unsettled_us < before_us:
                    self._unsettled_from_us = t_us
                self._unsettled_us = t_us
            if trust & FIELD_USED or (self.force_is_withheld and self._field_holds):
                self._field_used_us = t_us
            if self.field_is_frozen:
                self._field.restart()
                self._tests["turn"], self._tests["field"] = Lasting(), Lasting()
            if bits & ~KEPT:
                self._end_windows(t_us, bits, force)
        if self._tilt_rad == 0.0 and self._drift_tilt_rad == 0.0 and self._heading_rad == 0.0:
            return estimate
        return self.opened(estimate)

    def _end_windows(self, t_us: int, bits: int, force: Vec3) -> None:
        """Evaluates the windows completed by a sample."""
        if bits & (BEGUN | THIN_ROW):
            self._field.restart()
        if bits & BEGUN:
            self._velocity.restart()
            self._force_size.restart()
            self._restart_rows()
            self.ratios = InnovationRatios()
        if bits & ROW:
            self._field.end_row()
            self._judge_field()
        if bits & DUE:
            self._force_m_s2 += FORCE_SHARE * (math.hypot(*force) - self._force_m_s2)
            self._renew_ratios(t_us)
            self._judge(t_us)
            self._open()

    def corrected(self, fix: VelocityFix) -> VelocityFix:
        """The velocity of the IMU by a receiver's fix, for `fix` and for the filter."""
        if not fix.independent:
            return fix
        timely = self._receiver.timely(fix)
        moment = self._strapdown.at(timely.t_us)
        return timely if moment is None else self._receiver.centred(timely, moment)

    def fix(self, fix: VelocityFix, errors: SensorErrors) -> SensorDoubt | None:
        """Takes a velocity over ground.

        Args:
            errors: the filter's knowledge of its sensors.

        Returns:
            The errors that the filter has to estimate anew; None if nothing was shown.
        """
        if self._fix is not None:
            apart_us = min(fix.t_us - self._fix.t_us, 2 * VELOCITY_LOST_US)
            self._fix_period_us += PERIOD_SHARE * (apart_us - self._fix_period_us)
        self._fix, self._silent_us = fix, 0
        self._field.use_offset(errors.field_offset_share)
        self._velocity.use_receiver(self._receiver.errors)
        if not self._velocity.take(fix, errors):
            return None
        mark = self._velocity.marks[-1]
        self._see_force_size(mark, fix.altitude_m)
        self._corrected.review(errors, mark.moment.bias_b)
        windows = [self._velocity.window(length_s) for length_s in LENGTHS_S]
        self._windows = [window for window in windows if window is not None]
        of_1s, of_3s, of_10s = [math.nan if window is None else window.ratio for window in windows]
        self.ratios = self.ratios._replace(
            velocity_1s=of_1s, velocity_3s=of_3s, velocity_10s=of_10s
        )
        long = windows[-1]
        if long is not None and long.shows_heading and long.ratio < 1.0:
            shown = GATE * long.sigma_m_s / max(long.change_m_s, 0.1)
            if shown < CONFIRMED_RAD:
                self._is_confirmed, self._shown_us = True, fix.t_us
        return self._explain(fix.t_us, errors)

    def _see_force_size(self, mark: Mark, altitude_m: float) -> None:
        """Compares the size of the force with the receiver's acceleration."""
        moment = mark.moment
        if not self._force_size.is_due(moment.t_us):
            return
        is_known = self.force_is_off and self.force_error is not None
        if is_known and not self._force_was_wrong:
            self._bent.bend(moment.t_us)
        self._force_was_wrong = is_known
        gyro_is_doubted = self.ratios.of_turn > OPEN_RATIO
        gyro_is_doubted |= self._bent.excuses(Cause.ACCELEROMETER, moment.t_us)
        has_doubts = gyro_is_doubted or self.sensor_is_bad or self.velocity_is_false
        may_judge = self._vehicle.on_ground is not True and not has_doubts
        self._force_size.take(
            moment, mark.v_n, altitude_m, self.vibration_m_s2, may_judge=may_judge
        )
        self.force_is_off = self._force_size.found is not None

    def _explain(self, t_us: int, errors: SensorErrors) -> SensorDoubt | None:
        """Searches the cause while velocities contradict; returns a doubt for the filter."""
        mark = self._velocity.marks[-1]
        rows, known = self._rows, None
        if rows.take(mark, errors):
            known = self._known(mark, errors, rows)
        self._follow_slowly(t_us, mark, errors)
        self._hear_velocity(t_us, None)
        doubt = None
        is_quiet = not self.ratios.of_velocity > SUSPICIOUS_RATIO
        is_settled = self._began_settled(t_us) and self._began_with_heading()
        if not is_settled or (is_quiet and not self._slow.found.is_suspicious):
            self._forget_cause()
        elif known is not None and t_us - self._explained_us >= self._spacing_us(t_us):
            doubt = self._search(t_us, known)
        # A fault that begins looks like a late velocity: its cause is looked for first.
        since_us = self._suspected_us
        is_new = self._explained.odds > math.log(LIKELY)
        is_new = is_new and (since_us is None or t_us - since_us < OLD_US)
        if known is not None and not is_new and self._receiver.learn(rows.rows, known):
            # Earlier velocities were corrected otherwise.
            self._velocity.restart()
            self._restart_rows()
            self._forget_cause()
            return None
        return doubt

    def _began_settled(self, t_us: int) -> bool:
        """Whether the tilt was settled when the window began, whatever the filter did since."""
        rows = self._rows.rows
        begun_us = rows[0].begun.moment.t_us if rows else t_us
        return not self._unsettled_from_us <= begun_us <= self._unsettled_us

    def _began_with_heading(self) -> bool:
        """Whether the window began with a heading: without one, speeding up looks like a fault."""
        rows = self._rows.rows
        return not rows or rows[0].begun.moment.sigma_heading_rad < ANY_HEADING_RAD

    def _known(self, mark: Mark, errors: SensorErrors, rows: VelocityRows) -> Known:
        """What is known at the end of a window."""
        return Known(
            errors,
            mark.moment,
            rows.jitter_m_s,
            self._receiver.errors,
            rows.force_density,
            rows.usual_m_s2,
            self._rows.shifts,
            1e-6 * self._period_us,
        )

    def _restart_rows(self) -> None:
        """Restarts them with the strapdown, or with other velocities."""
        self._rows.restart()
        self._slow.restart()

    def _follow_slowly(self, t_us: int, mark: Mark, errors: SensorErrors) -> None:
        """Looks for a slow drift, with a tilt that has been settled for the whole window."""
        if self._vehicle.on_ground is True:
            # What touches the ground is pushed by it, by blows that samples miss.
            self._slow.restart()
        elif self._slow.take(mark, errors) and t_us - self._unsettled_us > 1e6 * DRIFT_S:
            self._slow.search(self._known(mark, errors, self._slow.rows), self._cleared)

    def _search(self, t_us: int, known: Known) -> SensorDoubt | None:
        """Compares the causes; returns a doubt for the filter."""
        self._explained_us = t_us
        found, rows = self._explanation(known)
        self._explained = found
        self._note_drift(t_us, found)
        if found.is_contradiction and self._contradicted_us is None:
            self._contradicted_us = t_us
        if not found.is_suspicious:
            self._forget_cause()
            return None
        self._suspected_us = self._suspected_us or t_us
        is_back = self._refusal.comes_back(t_us, found)
        if is_back:
            self._decisions.pop(Cause.VELOCITY, None)
        elif found.decided is not None and not self._is_excused(found, rows.begun_us):
            self._decisions[found.decided] += 1
            self._bent.decide(found.decided, t_us)
            self._shown[found.decided] = found
        if not is_back:
            if found.share(Cause.VELOCITY) * SUSPECTED > 1.0 and self._is_told(t_us):
                self._refusal.suspect(t_us)
            self._hear_velocity(t_us, found)
        self._withhold(t_us, found, is_back)
        correction = None if self.velocity_is_false else self._correct(t_us, found, known, rows)
        correction = correction or self._carry(t_us, found, known)
        if correction is not None:
            return SensorDoubt(correction=correction)
        if self.velocity_is_false:
            return None
        is_new = found.decided is None and t_us - self._suspected_us < SUSPECTED_US
        return None if is_new or self.force_is_withheld else doubt_of(found)

    def _explanation(self, known: Known) -> tuple[Explained, VelocityRows]:
        """That of the short window, or of the long one, with its rows."""
        found = explain(self._rows.rows, known, self._cleared)
        if found.decided is not None:
            # It need not be explained again for as long as a slow window shows it.
            self._slow.restart()
        elif not found.is_suspicious:
            return self._slow.found, self._slow.rows
        return found, self._rows

    def _withhold(self, t_us: int, found: Explained, is_back: bool) -> None:
        """Begins to withhold force and velocity, or ends it: a velocity that is back is right."""
        if is_back or not found.is_contradiction or not found.is_force_or_velocity:
            self._withheld_us = None
        elif self._withheld_us is None:
            self._withheld_us = t_us

    @property
    def force_is_withheld(self) -> bool:
        """Whether either the force or the velocity is false, and only the gyro is not doubted."""
        since_us, now_us = self._withheld_us, self._sample_us
        if since_us is None or self.velocity_is_false:
            return False
        return now_us - since_us < WITHHELD_US

    def _carry(self, t_us: int, found: Explained, known: Known) -> SensorCorrection | None:
        """Back to the gyro's attitude once the velocity is refused, or withheld with the force.

        What has been learnt from either since it is false would turn the attitude further.
        """
        since_us, now = self._refusal.since_us, self._strapdown.newest
        if since_us is None and self._is_told(t_us):
            since_us = self._withheld_us
        if since_us is None or self._carried_us >= since_us or now is None:
            return None
        if found.carried is None or found.carried.tilt_sigma_rad > LINEAR_RAD:
            return None
        correction = advanced(found.carried, known.moment, now)
        north, east, _ = correction.turn_n
        if correction.tilt_sigma_rad > max(math.hypot(north, east), HARMLESS_RAD):
            return None  # the attitude agrees with the gyro's, which is hardly known
        self._carried_us, self._tilt_rad = t_us, correction.tilt_sigma_rad
        # Neither of both holds the heading.
        return correction._replace(
            turn_n=(north, east, 0.0), heading_sigma_rad=now.sigma_heading_rad
        )

    def _correct(
        self, t_us: int, found: Explained, known: Known, rows: VelocityRows
    ) -> SensorCorrection | None:
        """What the filter has to take off a sensor that has lastingly been decided to be wrong.

        Everything is measured anew behind it: earlier windows contain the error.
        """
        now, cause = self._strapdown.newest, self._decided
        if found.correction is None or now is None or not self._is_told(t_us):
            return None
        if cause is None and t_us - (self._contradicted_us or t_us) > BLAME_US:
            cause = found.probable  # undecided, and it remains so
        if cause is None or cause in self._cleared:
            return None
        if cause is not found.probable or self._may_be_aliased(found):
            return None
        if found.correction.tilt_sigma_rad > LINEAR_RAD:
            return None
        correction = advanced(found.correction, known.moment, now)
        since_us = self._contradicted_us or t_us
        self._corrected.take(cause, found, correction, rows.rows[0], since_us)
        self._bent.bend(t_us)
        self.restart()
        self._tilt_rad = correction.tilt_sigma_rad
        self._heading_rad = correction.heading_sigma_rad
        return correction

    def _note_drift(self, t_us: int, found: Explained) -> None:
        """Notes the tilt by which a false velocity would bend the attitude, if it may be one."""
        if found.is_suspicious:
            self._drift_us = t_us
        if self._is_told(t_us) and found.drift_m_s2 > GRAVITY_M_S2 * HARMLESS_RAD:
            self._drifted_us = t_us
        if t_us - self._drift_us < LONG_S * 1e6:
            self._drift_tilt_rad = max(self._drift_tilt_rad, found.drift_m_s2 / GRAVITY_M_S2)

    def _spacing_us(self, t_us: int) -> int:
        """Least time between explanations: the beginning of a contradiction needs the most."""
        since_us = self._contradicted_us
        return OLD_SPACING_US if since_us is not None and t_us - since_us > OLD_US else 0

    def _is_told(self, t_us: int) -> bool:
        """Whether a contradiction has lasted for long enough to be reported."""
        return self._contradicted_us is not None and t_us - self._contradicted_us >= CONTRADICTED_US

    def _forget_cause(self) -> None:
        self._refusal.forget_contradiction()
        self._explained = NOTHING
        self._slow.forget()
        self._suspected_us = self._contradicted_us = self._withheld_us = None
        self._decisions.clear()
        self._shown.clear()

    @property
    def _decided(self) -> Cause | None:
        """The cause decided most often since the beginning, which later windows may miss."""
        if not self._decisions:
            return None
        cause = self._decisions.most_common(1)[0][0]
        if cause in self._cleared:
            return None
        return cause if cause is not Cause.VELOCITY or self.velocity_is_false else None

    def _is_excused(self, found: Explained, begun_us: int) -> bool:
        """Whether a decision against a sensor may be vibration, or what another one has bent."""
        cause = found.decided
        is_bent = cause is not None and self._bent.excuses(cause, begun_us)
        return is_bent or self._may_be_aliased(found)

    def _may_be_aliased(self, found: Explained) -> bool:
        """Whether vibration between slow samples may look like the fault of a sensor."""
        if self._period_us < SLOW_US:
            return False
        if found.decided is Cause.ACCELEROMETER:
            return ALIASED * self.vibration_m_s2 > found.step
        return found.decided is Cause.GYRO and self.vibration_m_s2 > SHAKEN_M_S2

    @property
    def field_fits(self) -> bool | None:
        """Whether norm and dip of the field are the earth's; None if unknown now."""
        now_us, field = self._strapdown.t_us, self._field
        if field.reference is None or now_us is None or field.is_stale(now_us):
            return None
        return field.is_plausible

    @property
    def heading_is_shown(self) -> bool:
        """Whether velocities have recently confirmed that the heading is roughly right."""
        shown_us, now_us = self._shown_us, self._strapdown.t_us
        if shown_us is None or now_us is None or self._tests["velocity"].is_raised:
            return False
        return now_us - shown_us < SHOWN_US

    def use_field(self, field: EarthField) -> None:
        """Takes the earth's field."""
        self._field.use_field(field)

    def use_agreed(self, *, gyro: bool, accelerometer: bool) -> None:
        """Takes which of its sensors show the same as another IMU's: they are not accused."""
        found = ((Cause.GYRO, gyro), (Cause.ACCELEROMETER, accelerometer))
        self._cleared = frozenset(cause for cause, agrees in found if agrees)

    def use_other_excesses(self, excesses_m_s2: Collection[float]) -> None:
        """Takes `force_excess_m_s2` of the other IMUs."""
        self._other_excesses = excesses_m_s2

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Takes the autopilot's report of the vehicle."""
        if vehicle.on_ground != self._vehicle.on_ground:
            self._force_size.begin()
        self._vehicle = vehicle

    def use_delays(self, delays: SensorDelays) -> None:
        """Takes the sensors' delays."""
        self._watch.use_field_delay(max(delays.field_s - delays.gyro_s, 0.0))

    def restart(self) -> None:
        """Forgets integrals; faults stay until they are seen to be resolved."""
        self._strapdown.restart()
        self._velocity.restart()
        self._force_size.restart()
        self._restart_rows()
        self._field.restart()
        self._windows = []
        self._forget_cause()
        self.ratios = InnovationRatios()

    def renew(self) -> None:
        """Restarts with sensors that were wrong, and are good again."""
        self.restart()
        self._corrected = CorrectedSensor()

    def opened(self, estimate: AttitudeEstimate) -> AttitudeEstimate:
        """The estimate with deviations increased to the errors that measurements show."""
        tilt_rad = self._tilt_rad
        tilt_rad = max(tilt_rad, self._drift_tilt_rad)
        if tilt_rad == 0.0 and self._heading_rad == 0.0:
            return estimate
        t_us, q_nb, w_b, bias_b, innovation_n, sigma_tilt_rad, trust, sigma_heading_rad = estimate
        tilt_rad = math.hypot(sigma_tilt_rad, tilt_rad)
        heading_rad = math.hypot(sigma_heading_rad, self._heading_rad)
        # `_replace` costs three times as much, for every sample after a doubt.
        return tuple.__new__(
            AttitudeEstimate,
            (t_us, q_nb, w_b, bias_b, innovation_n, tilt_rad, trust, heading_rad),
        )

    @property
    def velocity_is_false(self) -> bool:
        """Whether the velocity must not be fused: it would bend the attitude.

        So it is while only a false velocity explains a contradiction and the gyro is not in doubt,
        and then until it has proved itself. A heading held by velocities alone does not count
        against them, nor do forces sampled too slowly for the vehicle's vibration.
        """
        return self._refusal.since_us is not None

    @property
    def velocity_is_known_false(self) -> bool:
        """Whether that is decided, and not only probable."""
        return self._refusal.shown is not None

    @property
    def may_be_bent(self) -> bool:
        """Whether our attitude may follow a false velocity, or a sensor of ours that is wrong.

        Velocities then fit it for that reason, and do not speak for it.
        """
        now_us = self._strapdown.t_us
        if self.velocity_is_known_false or now_us is None:
            return self.velocity_is_known_false
        has_drifted = self._drifted_us is not None and now_us - self._drifted_us < REFUSED_US
        return has_drifted or self._bent.is_bent(now_us)

    def _hear_velocity(self, t_us: int, found: Explained | None) -> None:
        """Begins to refuse the velocity, or ends it.

        Args:
            found: a new explanation; None without one.
        """
        shown = self._shown.get(Cause.VELOCITY)
        if not self.velocity_is_false:
            # Only a field can confirm the gyro.
            is_held = self.ratios.of_turn < OPEN_RATIO and self._field_holds
            if is_held and self._is_contradicted_by_velocity(t_us, found):
                self._refusal.begin(t_us, shown)
            return
        long = self._windows[-1] if self._windows else None
        if self._refusal.hear(t_us, long, self.ratios, found, shown):
            self._decisions.pop(Cause.VELOCITY, None)

    def _is_contradicted_by_velocity(self, t_us: int, found: Explained | None) -> bool:
        """Whether a false velocity is the cause, or so probably that it is safer not to use it."""
        since_us = self._contradicted_us
        # What an earlier window decided counts while this one, which has seen more, agrees.
        if found is None or since_us is None or found.likeliest is not Cause.VELOCITY:
            return False
        has_jumped = found.has_jumped and found.decided is Cause.VELOCITY
        if t_us - since_us < BLAME_US and not has_jumped:
            return False
        is_shaken = self.vibration_m_s2 > RECTIFIED_M_S2
        if is_shaken or self._bent.is_shaken(t_us):
            return False
        if self._decisions and self._decisions.most_common(1)[0][0] is Cause.VELOCITY:
            return True
        return found.is_seen and found.share(Cause.VELOCITY) > PROBABLY

    def _open(self) -> None:
        """Updates the errors that measurements show."""
        ratios, field = self.ratios, self._field
        # An error that no sound sensor explains opens them at any ratio.
        open_ratio = OPEN_RATIO if self._contradicted_us is None else SUSPICIOUS_RATIO
        # The shortest window shows a large angle for a small velocity: it has to fail.
        tilts = [
            window.shown_tilt_rad
            for window in self._windows
            if window.ratio > (open_ratio if window.length_s > SURE_S else 1.0)
        ]
        tilts.append(self._velocity.biased_tilt_rad(self._corrected.force_b))
        headings = []
        if self._explained.is_suspicious:
            tilts.append(self._explained.tilt_rad)
            headings.append(self._explained.heading_rad)
        # A drift that went on would have left what the vehicle's velocity can be.
        gone = JUDGED_S * GRAVITY_M_S2 / self._speeds.horizontal_m_s
        self._drift_tilt_rad /= 1.0 + gone * self._drift_tilt_rad
        if ratios.force_10s > OPEN_RATIO:
            tilts.append(math.hypot(*self._change_n[:2]) / (GRAVITY_M_S2 * LONG_S))
        if ratios.of_turn > OPEN_RATIO:
            turn = field.turn(10)[0]
            headings.append(turn)
            if not field.turned_level(10):
                tilts.append(turn)
        if self._field_matters:
            headings.append(field.worst_heading_rad)
        elif field.is_plausible and ratios.field_1s > OPEN_RATIO:
            headings.append(0.5 * abs(field.heading_error_rad))
        self._tilt_rad = min(max(KEPT_OPEN * self._tilt_rad, *tilts, 0.0), math.pi)
        self._heading_rad = min(max(KEPT_OPEN * self._heading_rad, *headings, 0.0), math.pi)

    @property
    def _field_matters(self) -> bool:
        """Whether, in flight, a contradicting field is in use or was never confirmed otherwise."""
        on_ground = self._vehicle.on_ground is True
        if on_ground or not self._tests["field"].is_raised or not self.ratios.of_field > 1.0:
            return False
        return self._field_holds or not self._is_confirmed

    @property
    def _field_holds(self) -> bool:
        """Whether a field corrected the heading just now."""
        now_us, used_us = self._strapdown.t_us, self._field_used_us
        return now_us is not None and used_us is not None and now_us - used_us < FIELD_HOLDS_US

    def alarms(self, t_us: int) -> tuple[Alarm, ...]:
        """The alarms at this time."""
        found = sensor_alarms(self._imu, self._checked, self._watch.memory)
        lost_us = max(VELOCITY_LOST_US, PERIODS_LOST * self._fix_period_us)
        if self._fix is not None and t_us - self._fix.t_us - self._silent_us > lost_us:
            found.append(no_velocity(self._fix, (t_us - self._fix.t_us) * 1e-6))
        tests = self._tests
        since_s = {name: test.since_s(t_us) for name, test in tests.items() if test.is_raised}
        if "velocity" in since_s:
            worst = max(self._windows, key=lambda window: window.ratio, default=None)
            found.append(velocity_alarm(worst, since_s["velocity"]))
        if "force" in since_s:
            found.append(force_alarm(self._change_n, self._force_m_s2, since_s["force"]))
        if "turn" in since_s and not self._turn_is_level:
            found.append(turn_alarm(self._turn_rad, self._turn_s, since_s["turn"]))
        if (tests["field"].is_raised or self._field_turns) and not self._is_bent(t_us):
            found.append(self._field_alarm(t_us))
        found += self._cause_alarms(t_us, {alarm.kind for alarm in found})
        error = self.force_error if self.force_is_off else None
        if error is not None and all(a.kind is not Kind.ACCELEROMETER_BIAS_STEP for a in found):
            found.append(force_size_alarm(error, self._imu, self._force_size.since_s(t_us)))
        return tuple(found)

    def _is_bent(self, t_us: int) -> bool:
        """Whether an attitude bent by our own sensor explains a field of the right size."""
        return self._bent.is_bent(t_us) and self._field.has_norm

    def _cause_alarms(self, t_us: int, reported: Collection[Kind]) -> list[Alarm]:
        """The cause of a lasting contradiction; undecided once only."""
        refused, since_us = self._refusal.shown, self._refusal.since_us
        if refused is not None and since_us is not None:
            return [cause_alarm(refused, Cause.VELOCITY, self._imu, 1e-6 * (t_us - since_us))]
        if self._contradicted_us is None or not self._is_told(t_us):
            return self._corrected.alarms(self._imu, t_us, self._cleared)
        since_s = (t_us - self._contradicted_us) * 1e-6
        decided = self._decided
        shown = self._explained if decided is None else self._shown[decided]
        alarm = cause_alarm(shown, decided, self._imu, since_s)
        return [] if alarm.kind in reported else [alarm]

    @property
    def _field_turns(self) -> bool:
        """Whether the field has turned about the vertical, by a wrong yaw rate or iron."""
        return self._tests["turn"].is_raised and self._turn_is_level

    def _field_alarm(self, t_us: int) -> Alarm:
        turns = self._field_turns
        test = self._tests["field" if self._tests["field"].is_raised else "turn"]
        return field_alarm(
            self._field,
            (self._turn_rad, self._turn_s) if turns else None,
            matters=self._field_matters or turns,
            since_s=test.since_s(t_us),
        )

    def _judge(self, t_us: int) -> None:
        ratios, tests = self.ratios, self._tests
        tests["velocity"].take(t_us, ratios.of_velocity)
        tests["force"].take(t_us, ratios.force_10s)
        tests["turn"].take(t_us, ratios.of_turn)
        tests["field"].take(t_us, ratios.of_field)

    def _judge_field(self) -> None:
        field = self._field
        (_, of_1s), (_, of_10s) = field.turn(1), field.turn(10)
        self.ratios = self.ratios._replace(
            field_1s=field.field_ratio(1),
            field_10s=field.field_ratio(10),
            turn_1s=of_1s,
            turn_10s=of_10s,
        )
        failed = [length_s for length_s, ratio in ((1, of_1s), (10, of_10s)) if ratio > 1.0]
        if failed:
            self._turn_s = failed[-1]
            self._turn_rad = field.turn(self._turn_s)[0]
            # Once about the vertical only, the whole contradiction is doubtful.
            self._turn_is_level |= any(map(field.turned_level, failed))
        elif not self._tests["turn"].is_raised:
            self._turn_is_level = False
        self._is_confirmed |= self.ratios.field_10s < CONFIRMED_RATIO

    def _renew_ratios(self, t_us: int) -> None:
        """Drops what is stale; without velocities the force is tested."""
        ratios, nothing = self.ratios, math.nan
        if not math.isnan(ratios.force_10s):
            ratios = ratios._replace(force_10s=nothing)
        if self._velocity.is_stale(t_us):
            self._windows = []
            self._forget_cause()
            ratios = ratios._replace(
                velocity_1s=nothing,
                velocity_3s=nothing,
                velocity_10s=nothing,
                force_10s=self._force_ratio(t_us),
            )
        if self._field.is_stale(t_us):
            ratios = ratios._replace(
                field_1s=nothing, field_10s=nothing, turn_1s=nothing, turn_10s=nothing
            )
        self.ratios = ratios

    def _force_ratio(self, t_us: int) -> float:
        """Tests the force of 10 s against a velocity that is not measured, but bounded."""
        last = self._strapdown.newest
        first = self._strapdown.at(t_us - round(LONG_S * 1e6))
        if last is None or first is None:
            return math.nan
        on_ground = self._vehicle.on_ground is True
        level, climb = (GROUND_SPEED_M_S, GROUND_SPEED_M_S) if on_ground else self._speeds
        north, east, down = self._change_n = change_of_velocity(first, last)
        inertial = inertial_variance(first, last)
        return max(
            math.hypot(north, east) / (GATE * math.sqrt(2.0 * level * level + inertial)),
            abs(down) / (GATE * math.sqrt(2.0 * climb * climb + inertial)),
        )

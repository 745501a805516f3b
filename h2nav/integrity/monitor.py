"""Monitors one attitude: its sensors, and its consistency with velocity, field and gravity.

The monitor sees the filter's inputs and outputs, and has an arithmetic of its own. It reports when
the filter's deviations are too small for errors that measurements show, and by how much to increase
them. Two things go back to the filter: samples of a frozen sensor, and velocities that only a false
receiver explains, are kept from it; and a sensor proved wrong by a velocity is estimated anew
(`SensorDoubt`).
"""

import math
from collections.abc import Collection
from typing import NamedTuple

from h2nav.attitude.filter import TakesInputs
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    SensorDelays,
    SensorDoubt,
    SensorErrors,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.integrity.cause_search import SLOW_US, SUSPICIOUS_RATIO, CauseSearch, Situation
from h2nav.integrity.causes import Cause
from h2nav.integrity.contradiction_alarms import (
    force_alarm,
    force_size_alarm,
    no_velocity,
    velocity_alarm,
)
from h2nav.integrity.field_evidence import OPEN_RATIO, FieldEvidence
from h2nav.integrity.findings import Alarm, Kind, Sensor
from h2nav.integrity.force_size import ForceError, ForceSize
from h2nav.integrity.gyro_turns import GyroTurns
from h2nav.integrity.kernel.checks import LONGEST_STEP_US
from h2nav.integrity.kernel.memory import (
    BEGUN,
    DUE,
    FIELD_FROZEN,
    KEPT,
    ROW,
    THIN_ROW,
    TURN_ROW,
    UNSEEN_TURN,
)
from h2nav.integrity.lasting import Lasting
from h2nav.integrity.lost_attitude import APART_RAD, LostAttitude, shown_by_field
from h2nav.integrity.opened_errors import JUDGED_S, OpenedErrors
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.sensor_checks import Use, is_bad, sensor_alarms, use_of
from h2nav.integrity.strapdown import Strapdown
from h2nav.integrity.tilt_corrections import TiltCorrections
from h2nav.integrity.velocity_refusal import SURE_S
from h2nav.integrity.velocity_windows import (
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

# Assumed velocities: on the ground, and vertically for any vehicle.
GROUND_SPEED_M_S = 1.5
CLIMB_SPEED_M_S = 3.0
FORCE_SHARE = JUDGED_S / LONG_S
# A heading is confirmed by velocities that would have shown an error of this size,
CONFIRMED_RAD = 15.0 * DEG
# and stays confirmed as long as the gyro alone would hold it.
SHOWN_US = 10_000_000
# The period of samples is a mean; a longer gap is no slow stream.
SLOW_SHARE, LONGEST_PERIOD_US = 0.01, 2.0 * SLOW_US
NO_FORCE: Vec3 = (0.0, 0.0, 0.0)
# Velocities count as lost after this, and after this many of their usual periods: of fixes of 1 Hz
# a link that loses 4 % of its messages loses three in a row every 5 h, four every 4 days.
VELOCITY_LOST_US = 3_000_000
PERIODS_LOST = 5.0
PERIOD_SHARE = 0.2
# A plain number: `&` of a flag makes a new one.
FIELD_USED = int(Trust.FIELD_USED)
CONVERGED = int(Trust.CONVERGED)


class Speeds(NamedTuple):
    """Usual speeds of a vehicle without measurement, m/s, one sigma."""

    horizontal_m_s: float
    vertical_m_s: float = CLIMB_SPEED_M_S


class Monitor(TakesInputs):
    """Monitors one filter and its IMU.

    For each sample: call `check`, pass the filter what `Use` allows, then `add` with the result
    (`restart` without one). Velocities, field, vehicle and delays are passed as to the filter; a
    velocity is kept from the filter while `velocity_is_false`.

    Attributes:
        field_is_frozen: the compass does not show the heading.
        ratios: test ratios at the latest sample.
        corrections: of the tilt, by the filter.
        rate_factor: by which the gyro's rates have to be multiplied, by the field.
    """

    def __init__(self, imu: Sensor, speeds: Speeds) -> None:
        self._imu = imu
        self._speeds = speeds
        self._watch = Watch()
        self._checked = 0  # bits of the latest check
        self.field_is_frozen = False
        self._strapdown = Strapdown(self._watch)
        self._velocity = VelocityWindows(self._strapdown)
        self._field = FieldEvidence(self._watch, self._strapdown)
        self._turns, self._gyro_is_agreed = GyroTurns(), False
        self._gyro_is_wrong, self.rate_factor = False, 1.0
        self._opened = OpenedErrors()
        self._unknown_heading_rad = 0.0  # what a field that was wrong from the start leaves open
        self._search = CauseSearch(self._strapdown, self._velocity, self._opened)
        self._force_size, self._force_was_wrong = ForceSize(), False
        self._force_differs = False
        self.force_is_off = False  # by its size; others may show the same, see `force_error`
        self._other_excesses: Collection[float] = ()
        self._on_ground: bool | None = None
        self._landed_us = 0  # when it was first reported to be there
        self._was_on_ground = False
        self._change_n: Vec3 = (0.0, 0.0, 0.0)  # of velocity, by the force of the last 10 s
        self._force_m_s2 = GRAVITY_M_S2  # mean size, of about the last 10 s
        self._windows: list[Window] = []
        self._apart_rad = 0.0  # the tilt that velocities of 3 s show
        self._fix: VelocityFix | None = None
        self._fix_period_us = 0.0
        self._unsettled_from_us = self._unsettled_us = 0  # when the tilt was last unsettled
        self._sample_us, self._period_us = 0, 0.0
        self._checked_us: int | None = None
        self._silent_us = 0  # without samples since the latest velocity
        self._shown_us: int | None = None
        self._of_velocity, self._of_force = Lasting(), Lasting()
        self._lost = LostAttitude()
        self.ratios = InnovationRatios()
        self.corrections = TiltCorrections()

    def anew(self) -> "Monitor":
        """A new monitor of the same IMU, for a restarted clock."""
        fresh = Monitor(self._imu, self._speeds)
        fresh._on_ground = self._on_ground
        fresh._was_on_ground = self._on_ground is True
        fresh._field.windows.use_field(self._field.windows.reference)
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
        if bits & TURN_ROW:
            windows = self._field.windows
            is_of_earth = windows.reference is not None and windows.has_norm
            if self._turns.take(self._watch.memory, is_of_earth=is_of_earth):
                self._see_turns()
        if bits & UNSEEN_TURN:
            unseen_rad = self._watch.memory.unseen_rad
            self._opened.open(unseen_rad, unseen_rad)
        return use_of(bits) if bits else Use.ALL

    @property
    def sensor_is_bad(self) -> bool:
        """Whether gyro or accelerometer is known to be faulty now."""
        return self._gyro_is_wrong or is_bad(self._checked, self._watch.memory)

    @property
    def misturned_rad(self) -> float:
        """By how much the attitude may be off by rates that have to be multiplied by a number."""
        return abs(1.0 - self.rate_factor) * self._turns.turned_rad

    def _see_turns(self) -> None:
        """Takes what the field shows of the gyro, unless another gyro agrees with it."""
        turns, is_agreed = self._turns, self._gyro_is_agreed
        self._gyro_is_wrong = turns.error is not None and not is_agreed
        self.rate_factor = 1.0 if is_agreed else turns.rate_factor

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
        apart_us = min(apart_us, LONGEST_PERIOD_US)
        self._period_us += SLOW_SHARE * (apart_us - self._period_us)
        self._sample_us = t_us
        if clipped or force == NO_FORCE:
            # The result of its windows is known already.
            self.restart()
        else:
            known = estimate
            if self._unknown_heading_rad:
                sigma_rad = math.hypot(estimate.sigma_heading_rad, self._unknown_heading_rad)
                known = estimate._replace(sigma_heading_rad=sigma_rad)
            bits, trust = self._strapdown.add(t_us, known), int(estimate.trust)
            if not trust & CONVERGED:
                if self._unsettled_us < before_us:
                    self._unsettled_from_us = t_us
                self._unsettled_us = t_us
            is_withheld = self._search.withheld_us is not None and self.force_is_withheld
            if trust & FIELD_USED or (is_withheld and self._field.holds):
                self._field.use(t_us)
            if self.field_is_frozen:
                self._field.forget()
            if bits & ~KEPT:
                self._end_windows(t_us, bits, force)
        return self._opened.of(estimate) if self._opened.is_any else estimate

    @property
    def attitude_is_lost(self) -> bool:
        """Whether it is off by so much that it has to be found anew; see `lost_attitude`."""
        return self._lost.is_lost

    def _look_whether_lost(self, t_us: int) -> None:
        """Follows an attitude that velocities contradict by far."""
        if self._of_velocity.is_raised or self._apart_rad > APART_RAD:
            self._lost.take(t_us, self._shows_lost(t_us))
        elif self._lost.is_suspected:
            self._lost.take(t_us, False)

    def _shows_lost(self, t_us: int) -> bool | None:
        """Whether sound sensors show the attitude to be lost; None if nothing shows whether."""
        if self.sensor_is_bad or self.ratios.of_turn > 1.0:
            return False
        if self._search.velocity_is_denied:
            return False
        found = shown_by_field(self._field.windows, self._apart_rad)
        if found or not self._of_velocity.is_raised:
            return found
        if self._search.contradiction.decided is Cause.ACCELEROMETER:
            return False
        return self._force_ratio(t_us) > 1.0 or found

    def _end_windows(self, t_us: int, bits: int, force: Vec3) -> None:
        """Evaluates the windows completed by a sample."""
        if bits & (BEGUN | THIN_ROW):
            self._field.windows.restart()
        if bits & BEGUN:
            self._velocity.restart()
            self._force_size.restart()
            self._search.restart_rows()
            self.ratios = InnovationRatios()
        if bits & ROW:
            self.ratios = self._field.end_row(self.ratios)
        if bits & DUE:
            self._force_m_s2 += FORCE_SHARE * (math.hypot(*force) - self._force_m_s2)
            self._renew_ratios(t_us)
            self._of_velocity.take(t_us, self.ratios.of_velocity)
            if self._of_velocity.is_raised:
                self._search.bent.contradict(t_us)
            self._of_force.take(t_us, self.ratios.force_10s)
            self._field.judge(t_us, self.ratios)
            self._look_whether_lost(t_us)
            self._open()

    def corrected(self, fix: VelocityFix) -> VelocityFix:
        """The velocity of the IMU by a receiver's fix, for `fix` and for the filter."""
        if not fix.independent:
            return fix
        timely = self._search.receiver.timely(fix)
        moment = self._strapdown.at(timely.t_us)
        return timely if moment is None else self._search.receiver.centred(timely, moment)

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
        self._field.windows.use_offset(errors.field_offset_share)
        self._velocity.use_receiver(self._search.receiver.errors)
        if not self._velocity.take(fix, errors):
            return None
        marks = self._velocity.marks
        mark = marks[-1]
        self.corrections.take(mark.moment.t_us, mark.moment.q_ns, is_anew=len(marks) == 1)
        self._see_force_size(mark, fix.altitude_m)
        self._search.corrected.review(errors, mark.moment.bias_b)
        windows = [*map(self._velocity.window, LENGTHS_S)]
        middle = windows[1]
        self._apart_rad = 0.0 if middle is None else middle.tilt_rad
        self._windows = [*filter(None, windows)]
        of_1s, of_3s, of_10s = [math.nan if window is None else window.ratio for window in windows]
        self.ratios = self.ratios._replace(
            velocity_1s=of_1s, velocity_3s=of_3s, velocity_10s=of_10s
        )
        long = windows[-1]
        if long is not None and long.shows_heading and long.ratio < 1.0:
            shown = GATE * long.sigma_m_s / max(long.change_m_s, 0.1)
            if shown < CONFIRMED_RAD:
                self._shown_us = fix.t_us
                self._field.confirm()
        doubt, is_corrected = self._search.take(mark, self._situation(fix, errors))
        if is_corrected:
            self.restart()
        return doubt

    def _situation(self, fix: VelocityFix, errors: SensorErrors) -> Situation:
        """What the search of a cause has to know."""
        return Situation(
            fix.t_us,
            errors,
            self.ratios,
            self._windows[-1] if self._windows else None,
            self._sample_us,
            self.vibration_m_s2,
            self._period_us,
            field_holds=self._field.holds,
            on_ground=self._on_ground is True,
            unsettled_us=(self._unsettled_from_us, self._unsettled_us),
            is_denied=fix.is_denied,
        )

    def _see_force_size(self, mark: Mark, altitude_m: float) -> None:
        """Compares the size of the force with the receiver's acceleration."""
        moment = mark.moment
        if not self._force_size.is_due(moment.t_us):
            return
        is_known = self.force_is_off and self.force_error is not None
        if is_known and not self._force_was_wrong:
            self._search.bent.bend(moment.t_us)
        self._force_was_wrong = is_known
        gyro_is_doubted = self.ratios.of_turn > OPEN_RATIO
        gyro_is_doubted |= self._search.bent.excuses(Cause.ACCELEROMETER, moment.t_us)
        has_doubts = gyro_is_doubted or self.sensor_is_bad or self.velocity_is_false
        may_judge = self._on_ground is not True and not has_doubts
        self._force_size.take(
            moment,
            mark.v_n,
            altitude_m,
            self.vibration_m_s2,
            may_judge=may_judge,
            differs=self._force_differs,
        )
        self.force_is_off = self._force_size.found is not None

    @property
    def force_is_withheld(self) -> bool:
        """Whether either the force or the velocity is false, and only the gyro is not doubted."""
        search = self._search
        return search.withheld_us is not None and search.is_withheld(self._sample_us)

    @property
    def field_fits(self) -> bool | None:
        """Whether norm and dip of the field are the earth's; None if unknown now."""
        return self._field.fits

    @property
    def error_by_compass_rad(self) -> float | None:
        """How far the heading may be off by the field; None if that shows nothing."""
        return None if self.field_is_frozen else self._field.largest_heading_error_rad

    @property
    def heading_is_shown(self) -> bool:
        """Whether velocities have recently confirmed that the heading is roughly right."""
        shown_us, now_us = self._shown_us, self._strapdown.t_us
        if shown_us is None or now_us is None or self._of_velocity.is_raised:
            return False
        return now_us - shown_us < SHOWN_US

    def use_field(self, field: EarthField) -> None:
        """Takes the earth's field."""
        self._field.windows.use_field(field)

    def use_agreed(self, *, gyro: bool, accelerometer: bool) -> None:
        """Takes which of its sensors show the same as another IMU's: they are not accused."""
        found = ((Cause.GYRO, gyro), (Cause.ACCELEROMETER, accelerometer))
        self._search.use_cleared(frozenset(cause for cause, agrees in found if agrees))
        if gyro is not self._gyro_is_agreed:
            self._gyro_is_agreed = gyro
            self._see_turns()

    def use_differing_force(self, differs: bool) -> None:
        """Takes whether its force and another IMU's differ, and nobody knows which is wrong."""
        self._force_differs = differs

    def use_other_excesses(self, excesses_m_s2: Collection[float]) -> None:
        """Takes `force_excess_m_s2` of the other IMUs."""
        self._other_excesses = excesses_m_s2

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Takes the autopilot's report of the vehicle."""
        if vehicle.on_ground != self._on_ground:
            self._force_size.begin()
            self._field.windows.change_surroundings()
            self._landed_us = self._sample_us
            if vehicle.on_ground and not self._was_on_ground:
                # Without motors a sensor is quieter than it has ever been.
                self._watch.forget_rest()
                self._was_on_ground = True
        self._on_ground = vehicle.on_ground

    def change_message(self) -> None:
        """Goes on with samples of another message of the same sensors."""
        self._watch.forget_values()

    def use_delays(self, delays: SensorDelays) -> None:
        """Takes the sensors' delays."""
        self._watch.use_field_delay(max(delays.field_s - delays.gyro_s, 0.0))

    def restart(self) -> None:
        """Forgets integrals; faults stay until they are seen to be resolved."""
        self._strapdown.restart()
        self._velocity.restart()
        self._force_size.restart()
        self._search.restart()
        self._field.windows.restart()
        self._windows, self._apart_rad = [], 0.0
        self.ratios = InnovationRatios()

    def renew(self) -> None:
        """Restarts with sensors that were wrong, and are good again."""
        self.restart()
        self._search.renew()
        self._opened.correct(0.0, 0.0)
        self._lost = LostAttitude()

    def open(self, tilt_rad: float, heading_rad: float = 0.0) -> None:
        """Takes errors that others show: they open the deviations, and fade."""
        self._opened.open(tilt_rad, heading_rad)

    def opened(self, estimate: AttitudeEstimate) -> AttitudeEstimate:
        """The estimate with deviations increased to the errors that measurements show."""
        return self._opened.of(estimate)

    @property
    def velocity_is_false(self) -> bool:
        """Whether the velocity must not be fused: it would bend the attitude.

        So it is while only a false velocity explains a contradiction and the gyro is not in doubt,
        and then until it has proved itself. A heading held by velocities alone does not count
        against them, nor do forces sampled too slowly for the vehicle's vibration.
        """
        return self._search.velocity_is_false and not self._gyro_is_wrong

    @property
    def velocity_is_known_false(self) -> bool:
        """Whether that is decided, and not only probable."""
        return self._search.velocity_is_known_false and not self._gyro_is_wrong

    @property
    def may_be_bent(self) -> bool:
        """Whether our attitude may follow a false velocity, or a sensor of ours that is wrong.

        Velocities then fit it for that reason, and do not speak for it.
        """
        return self._search.may_be_bent(self._strapdown.t_us)

    def _open(self) -> None:
        """Updates the errors that measurements show."""
        contradiction = self._search.contradiction
        # An error that no sound sensor explains opens them at any ratio.
        open_ratio = OPEN_RATIO if contradiction.begun_us is None else SUSPICIOUS_RATIO
        # The shortest window shows a large angle for a small velocity: it has to fail.
        tilts = [
            window.shown_tilt_rad
            for window in self._windows
            if window.ratio > (open_ratio if window.length_s > SURE_S else 1.0)
        ]
        tilts.append(self._velocity.biased_tilt_rad(self._search.corrected.force_b))
        by_field, headings = self._field.shown_errors(
            self.ratios, on_ground=self._on_ground is True
        )
        tilts += by_field
        self._unknown_heading_rad = self._field.unknown_heading_rad(self.ratios)
        headings.append(self._unknown_heading_rad)
        if contradiction.explained.is_suspicious:
            tilts.append(contradiction.explained.tilt_rad)
            headings.append(contradiction.explained.heading_rad)
        if self.ratios.force_10s > OPEN_RATIO:
            tilts.append(math.hypot(*self._change_n[:2]) / (GRAVITY_M_S2 * LONG_S))
        self._opened.bound_drift(self._speeds.horizontal_m_s)
        self._opened.judge(tilts, headings)

    def alarms(self, t_us: int) -> tuple[Alarm, ...]:
        """The alarms at this time."""
        found = sensor_alarms(self._imu, self._checked, self._watch.memory)
        if self._gyro_is_wrong:
            found += self._turns.alarms(self._imu, t_us)
        lost_us = max(VELOCITY_LOST_US, PERIODS_LOST * self._fix_period_us)
        if self._fix is not None and t_us - self._fix.t_us - self._silent_us > lost_us:
            found.append(no_velocity(self._fix, (t_us - self._fix.t_us) * 1e-6))
        if self._of_velocity.is_raised and not self._search.accuses_velocity(t_us):
            worst = max(self._windows, key=lambda window: window.ratio, default=None)
            found.append(velocity_alarm(worst, self._of_velocity.since_s(t_us)))
        if self._of_force.is_raised:
            since_s = self._of_force.since_s(t_us)
            found.append(force_alarm(self._change_n, self._force_m_s2, since_s))
        on_ground = self._on_ground is True
        found += self._field.alarms(t_us, self.ratios, self._search.bent, on_ground=on_ground)
        found += self._search.alarms(self._imu, t_us, {alarm.kind for alarm in found})
        error = self.force_error if self.force_is_off else None
        if error is not None and all(a.kind is not Kind.ACCELEROMETER_BIAS_STEP for a in found):
            found.append(force_size_alarm(error, self._imu, self._force_size.since_s(t_us)))
        return tuple(found)

    def _renew_ratios(self, t_us: int) -> None:
        """Drops what is stale; without velocities the force is tested."""
        ratios, nothing = self.ratios, math.nan
        if not math.isnan(ratios.force_10s):
            ratios = ratios._replace(force_10s=nothing)
        if self._velocity.is_stale(t_us):
            self._windows, self._apart_rad = [], 0.0
            self._search.forget()
            ratios = ratios._replace(
                velocity_1s=nothing,
                velocity_3s=nothing,
                velocity_10s=nothing,
                force_10s=self._force_ratio(t_us),
            )
        if self._field.windows.is_stale(t_us):
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
        # One that has just landed has braked within the window.
        on_ground = self._on_ground is True and self._landed_us <= first.t_us
        level, climb = (GROUND_SPEED_M_S, GROUND_SPEED_M_S) if on_ground else self._speeds
        north, east, down = self._change_n = change_of_velocity(first, last)
        inertial = inertial_variance(first, last)
        return max(
            math.hypot(north, east) / (GATE * math.sqrt(2.0 * level * level + inertial)),
            abs(down) / (GATE * math.sqrt(2.0 * climb * climb + inertial)),
        )

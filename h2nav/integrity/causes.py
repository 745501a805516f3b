"""Explains why a measured velocity contradicts an attitude: causes compared by their signatures.

The change of velocity predicted from the force of a window differs from the measured one. Each
cause has a signature of its own: a wrong gyro's difference grows with the square of time, an
accelerometer's turns with the body, a wrong heading's turns with the acceleration, a false velocity
jumps or bends at a moment without a trace in the force, and vibration only adds noise. All of them
are linear in a few unknowns, and each may begin at any moment. The usual size of the unknowns is
known of healthy sensors; under the hypothesis of a cause its own unknowns may be as large as a
failure makes them. The causes are compared by the likelihood of the measurements with the unknowns
integrated out.

Equations: docs/integrity.md, section 5.
"""

import math
from collections.abc import Collection, Sequence
from enum import Enum
from typing import NamedTuple

from h2nav.attitude.samples import SensorCorrection, SensorDoubt, Vec3
from h2nav.integrity.correction import FAILED_RATE_RAD_S, WindowErrors, attitude, mixed
from h2nav.integrity.likelihood import HypothesisFit, Since, mean
from h2nav.integrity.velocity_model import (
    FORCE,
    HEADING,
    LAG,
    MIN_ROWS,
    RATE,
    SCALE,
    TILT,
    Known,
    VelocityModel,
)
from h2nav.integrity.velocity_rows import Shift, VelocityRow, plus
from h2nav.integrity.velocity_windows import Level
from h2nav.maths.quaternion import Quat, conjugate, exp, log, multiply, rotate, tilt_and_heading
from h2nav.maths.units import DEG

# Size of a failure: accelerometers step by their data sheet's 60 mg; a heading may be any.
FAILED_FORCE_M_S2 = 0.6
FAILED_HEADING_RAD = 60.0 * DEG
FAILED_TILT_RAD = 5.0 * DEG
# A broken accelerometer; a broken gyro, and the tilt error before it is detected.
BROKEN_FORCE_M_S2 = 3.0
BROKEN_RATE_RAD_S = 20.0 * DEG
BROKEN_TILT_RAD = 30.0 * DEG  # and of an attitude that is wrong for whatever reason
BROKEN = 3.0  # times a failure's rate
JUMPS_M_S = (2.0, 10.0)  # multipath and slow spoofing; another place
RAMP_M_S2 = 2.0
# Ages of a fault in rows, besides the whole window; of a jump the number of rows tried, those with
# the largest residuals.
ONSETS = (2, 3, 5, 8, 10, 13, 16, 20)
NEARER = 4  # a beginning of this age is nearer than the next one to what is one row away
JUMPS = 2
# Rows behind a jump that show that the velocity did no more than jump.
JUMP_ROWS = 3
# Additional latency of a receiver.
FAILED_LAG_S = 0.5
# Vibration: multiple of the noise in the samples of the force, and at least this, m^2/s^3, since
# the samples do not show all of it.
SHAKEN = 4.0
SHAKEN_DENSITY = 1e-3
# The largest mean force that an accelerometer makes of vibration, as a share of its rms.
MAX_RECTIFIED = 0.1
SHAKING_DENSITY = 0.02  # 1.4 m/s^2 rms at 100 Hz: above it a force may hide blows
# A blow that samples miss touches one or two of them. In the density of their noise, a mean over
# 2 s, it leaves a 36th of the square of its change of velocity, 1/s, or more. Asked is half of it.
BLOW_DENSITY = 1.0 / 72.0
# Beside a force with this noise a velocity shows nothing.
UNUSED_DENSITY = 1e6
# A larger heading error is not a small angle.
KNOWN_HEADING_RAD = 10.0 * DEG
# Odds for a decision, and for the existence of a cause: one error in a thousand.
DECIDED = 1000.0
# An undecided cause takes effect by its probability, from these odds against none on.
SUSPECTED = 100.0
LOG_ODDS_ROUNDING = 1e-6  # generously
# Without a decision what is done about a cause begins here; what speaks for either of two causes.
PROBABLY = 0.9
SURELY = 0.99
# Odds that one of both then has against none.
MIN_OF_EITHER = 0.5 * SURELY / (1.0 - SURELY)
# Of an error by a cause that may still be right, at least this share is one deviation: it stays
# within three of them.
MIN_SHARE = 1.0 / 9.0
# A sensor that fails while that of another IMU shows the same: in one of so many cases both fail
# alike. Zeros of sound accelerometers move alike by temperature (1 mg/K) and supply, by less than
# 0.1 m/s^2 in a window; two that fail by 0.6 m/s^2 each are as near to each other in one of 36
# cases (three in one of 1,300). What moves the gyros of one board alike, by temperature and shocks,
# is as large as the usual size of a failure: that they agree says nothing of their bias.
FAIL_ALIKE = 36.0
# A heading turns an acceleration and keeps its size, within this share.
SAME_SIZE = 0.2
# A vehicle's acceleration has the tails of Student's distribution of so many degrees of freedom;
# changes of its force have a kurtosis of 3 to 6.
TAILS = 1.0
SHIFT_TAILS = 6.0
MIN_SHIFTS = 25  # fewer do not show what is usual
# Shares of its first row that have passed when a broken accelerometer steps: what it then shows is
# one constant, in all of the rest.
PASSED = (0.0, 1.0 / 3.0, 2.0 / 3.0)
# Largest effect of an unknown delay and antenna for a decision, in deviations of a velocity; and
# how many deviations of theirs a difference has to be that they, which do not add up, cannot make.
MAX_RECEIVER = 3.0
BEYOND_RECEIVER = 6.0
# Largest excess of the residuals' square over that of the noise for a decision, in its deviations.
MISFIT_SIGMAS = 3.0


class Cause(Enum):
    """The cause of a contradiction; the value is for people."""

    GYRO = "gyro"
    ACCELEROMETER = "accelerometer"
    HEADING = "heading"
    ATTITUDE = "attitude"
    VELOCITY = "velocity"
    VIBRATION = "vibration"
    LATENCY = "latency"


class Explained(NamedTuple):
    """The explanation of the window that ends now."""

    odds: float = 0.0  # of the best cause against none, as a logarithm; 0: nothing to explain
    # probabilities of the causes; with that of "nothing is wrong" their sum is 1
    shares: tuple[tuple[Cause, float], ...] = ()
    # the residuals of the best cause are noise, and a sensor's fault began within the window:
    # a constant error may be a wrong estimate of a sound sensor. Vibration has to show in the
    # samples.
    is_seen: bool = True
    # error of the filter's present gyro bias, if the gyro is the cause, rad/s
    rate_b: Vec3 = (0.0, 0.0, 0.0)
    force_b: Vec3 = (0.0, 0.0, 0.0)  # the same of the accelerometer, m/s^2; z is not estimated
    step: float = 0.0  # size of the fault that began within the window, rad/s or m/s^2
    # deviation of the filter's present tilt by the causes that are still possible
    tilt_rad: float = 0.0
    heading_rad: float = 0.0  # the same of its heading
    drift_m_s2: float = 0.0  # deviation of a drift of the velocity, if that may be false
    # whether the best cause is a jump of the velocity, with rows behind it that agree again
    has_jumped: bool = False
    jumped_us: int = 0  # when the latest jump of the velocity began, if it is the best cause
    correction: SensorCorrection | None = None  # at the window's end, if a sensor is `probable`
    # back to the attitude by the gyro, and to what was known of it, if only force or velocity can
    # be false
    carried: SensorCorrection | None = None

    def share(self, cause: Cause) -> float:
        """Probability of a cause."""
        return next((share for one, share in self.shares if one is cause), 0.0)

    @property
    def likeliest(self) -> Cause | None:
        """The most probable cause; None: nothing is wrong."""
        return max(self.shares, key=lambda one: one[1])[0] if self.shares else None

    @property
    def is_contradiction(self) -> bool:
        """Whether anything is wrong."""
        return self.odds > math.log(DECIDED)

    @property
    def is_suspicious(self) -> bool:
        """Whether a fault is likely enough for a contradiction to continue, not for a new one."""
        return self.odds > math.log(SUSPECTED)

    @property
    def decided(self) -> Cause | None:
        """The only possible cause; None: undecided, or nothing is wrong."""
        if not (self.is_contradiction and self.is_seen):
            return None
        return next((cause for cause, share in self.shares if share > 1.0 - 1.0 / DECIDED), None)

    @property
    def probable(self) -> Cause | None:
        """The sensor of ours that is decided to be wrong, or an accelerometer that probably is.

        That an accelerometer is wrong or the velocity false, the attitude without its error is that
        by the gyro, and right. What is taken for a gyro's error turns the attitude.
        """
        decided = self.decided
        if decided in OWN_SENSORS:
            return decided
        is_probable = self.share(Cause.ACCELEROMETER) > PROBABLY
        if self.is_contradiction and self.is_seen and is_probable and self.is_force_or_velocity:
            return Cause.ACCELEROMETER
        return None

    @property
    def is_force_or_velocity(self) -> bool:
        """Whether the accelerometer is wrong or the velocity false, and nothing else."""
        return self.share(Cause.ACCELEROMETER) + self.share(Cause.VELOCITY) > SURELY


NOTHING = Explained()
OWN_SENSORS = (Cause.GYRO, Cause.ACCELEROMETER)


def doubt_of(found: Explained) -> SensorDoubt | None:
    """The doubt for a filter: errors of its sensors, by the probability of their cause.

    Source: docs/integrity.md Eq. (6).
    """
    if not found.is_suspicious:
        return None
    # An error that may be a false velocity must not be estimated from it.
    false = found.share(Cause.VELOCITY)
    of_rate, of_force = (
        share / math.sqrt(share + false) if share > 0.0 else 0.0
        for share in (found.share(Cause.GYRO), found.share(Cause.ACCELEROMETER))
    )
    if math.hypot(*found.rate_b) > BROKEN * FAILED_RATE_RAD_S and found.decided is not Cause.GYRO:
        # At first a grossly false velocity looks like a broken gyro.
        of_rate = 0.0
    x, y, z = (of_rate * abs(part) for part in found.rate_b)
    u, v = (of_force * abs(part) for part in found.force_b[:2])
    bent = (0.0, 0.0)
    if found.decided in (Cause.GYRO, Cause.ATTITUDE):
        bent = (found.tilt_rad, found.heading_rad)
    return SensorDoubt((x, y, z), (u, v), *bent)


def explain(
    rows: Sequence[VelocityRow],
    known: Known,
    cleared: Collection[Cause] = (),
    unseen_rad: float = math.inf,
    min_odds: float = 0.0,
) -> Explained:
    """Compares the causes over a window.

    Args:
        rows: of the window, in order.
        known: at its end.
        cleared: sensors that show the same as those of other IMUs.
        unseen_rad: a gyro that may turn the attitude by more within the window shows nothing.
        min_odds: whose odds against none cannot reach this is not compared any further.
    """
    if len(rows) < MIN_ROWS:
        return NOTHING
    comparison = _Comparison(rows, known, cleared)
    return comparison.explained(min_odds) if comparison.unseen_rad < unseen_rad else NOTHING


class _Variant(NamedTuple):
    """A cause with its beginning."""

    cause: Cause  # the cause
    fit: HypothesisFit  # of its unknowns
    own: int = 0  # number of unknowns besides the usual ones
    begun: int = 0  # row with which it began
    drifts: bool = False  # its own unknowns begin with a drift of the velocity north and east
    breaks: bool = False  # larger than a board's temperature, supply or shocks make it
    motion: float = 0.0  # logarithm of how likely the vehicle moves as it then would
    stepping: float = 0.0  # and of how likely its force steps as it does

    @property
    def likelihood(self) -> float:
        """Of the measurements and the motion, as a logarithm."""
        return self.shown + self.stepping

    @property
    def shown(self) -> float:
        """The same without what a step of the force adds: a manoeuvre that begins has one, too."""
        return self.fit.likelihood + self.motion


class _Hypothesis(NamedTuple):
    """A cause that begins with a row, before it is fitted."""

    cause: Cause
    base: HypothesisFit  # of the usual unknowns
    places: tuple[int, ...]  # of its own ones in those that begin with the row
    sigma: float  # their deviation
    drifts: bool = False  # see `_Variant`
    breaks: bool = False


class _Beginning(NamedTuple):
    """The causes that may begin with a row."""

    begun: int
    since: Since
    hypotheses: Sequence[_Hypothesis]

    def most(self) -> float:
        """The largest likelihood, as a logarithm."""
        bases = {id(one.base): one.base for one in self.hypotheses}
        return max(
            likelihood
            for base in bases.values()
            for likelihood in self.since.likelihoods(
                base, [(one.places, one.sigma) for one in self.hypotheses if one.base is base]
            )
        )

    def variants(self) -> list[_Variant]:
        """The same, fitted."""
        return [
            _Variant(
                one.cause,
                self.since.fit(one.base, one.places, one.sigma),
                len(one.places),
                self.begun,
                drifts=one.drifts,
                breaks=one.breaks,
            )
            for one in self.hypotheses
        ]


class _Comparison:
    """The likelihoods of the causes over one window."""

    def __init__(
        self, rows: Sequence[VelocityRow], known: Known, cleared: Collection[Cause]
    ) -> None:
        self._rows, self._known, self._cleared = rows, known, cleared
        self._window = window = VelocityModel(rows, known)
        self._force_density, self._shaken = window.force_density, window.shaken_density
        self._columns, self._sound = window.columns, window.sigmas
        self._model = window.with_noise(window.force_density)
        self._moves: dict[int, tuple[float, float]] = {}  # since a row
        self._usual_shift_m_s2 = _usual_shift(known.shifts)
        begun_us = rows[0].begun.moment.t_us
        self._shifts = [shift for shift in known.shifts if shift.t_us >= begun_us]

    @property
    def unseen_rad(self) -> float:
        """Deviation of a turn of the window if nothing is wrong."""
        return max(self._sound[RATE:SCALE]) * sum(self._window.lengths_s)

    def explained(self, min_odds: float) -> Explained:
        """The result; of nothing where no odds can reach `min_odds`."""
        model, sound = self._model, self._sound
        none = model.fit(sound)
        # No hypothesis with these noises explains more than everything.
        if 0.5 * (model.square - none.explained) < math.log(SUSPECTED):
            return NOTHING
        if self._known.is_denied:
            return self._of_denied(none)
        # An error older than the window has also bent the attitude.
        bent = _failed(sound, TILT, 2, FAILED_TILT_RAD)
        variants = self._from_before(none, bent)
        bases = none, model.fit(bent)
        beginnings = [self._from_row(begun, bases) for begun in self._onsets()]
        jumps = [self._jump(row, bases) for row in self._jumps(none)]
        vibration = self._vibration() + math.log(self._window.hidden_share)
        if min_odds > 0.0:
            # How the vehicle moves speaks against a cause, never for it; a step of the force does
            # not count for the odds.
            most = max(vibration, *(one.fit.likelihood for one in variants))
            most = max(most, *(one.most() for one in (*beginnings, *jumps)))
            if most - none.likelihood < math.log(min_odds) - LOG_ODDS_ROUNDING:
                return NOTHING
        variants += [one for each in beginnings for one in each.variants()]
        variants = [
            one._replace(motion=self._motion(one), stepping=self._stepping(one)) for one in variants
        ]
        variants += [one for each in jumps for one in each.variants()]
        if self._cleared and self._shaken <= SHAKING_DENSITY:
            variants = [self._seen_by_another(one) for one in variants]
        odds: dict[Cause, float] = {
            cause: mean([one.likelihood for one in variants if one.cause is cause])
            for cause in Cause
            if cause is not Cause.VIBRATION
        }
        odds[Cause.VIBRATION] = vibration
        if self._shaken > SHAKING_DENSITY:
            odds[Cause.VIBRATION] = max(odds[Cause.VIBRATION], self._hidden(variants))
        if self._is_any_heading(variants):
            odds[Cause.HEADING] = max(odds[Cause.HEADING], odds[Cause.VELOCITY])
        return self._decided(none.likelihood + self._by_step(odds, variants), odds, variants)

    def _of_denied(self, none: HypothesisFit) -> Explained:
        """A velocity that the receiver's own places deny: it may do anything, and shows nothing."""
        count = 2 * len(self._rows)
        odds = 0.5 * (self._model.square - none.explained - count)
        found = Explained(max(odds, 0.0), ((Cause.VELOCITY, 1.0),))
        if not found.is_contradiction:
            return found
        return found._replace(carried=self._correction([self._unused()]))

    def _unused(self) -> _Variant:
        """A velocity that may do anything: what was known when the window began is all there is."""
        return _Variant(Cause.VELOCITY, self._window.with_noise(UNUSED_DENSITY).fit(self._sound))

    def _hidden(self, variants: Sequence[_Variant]) -> float:
        """How likely what a shaken force hides, from every IMU, looks like a false velocity.

        Single samples miss a blow, and what vibration is rectified to. A larger constant is hidden
        only by a line at a multiple of the samples' rate, and a jump by nothing but a blow, which
        shakes the force.
        """
        rectified_m_s2 = MAX_RECTIFIED * math.sqrt(self._shaken / self._known.period_s)
        line = math.log(self._window.hidden_share)
        density = max(self._shaken, *(row.errors.force_density for row in self._rows))
        blow_m_s = math.sqrt(density / BLOW_DENSITY)

        def log_share(one: _Variant) -> float:
            own = one.fit.unknowns()[-one.own :]
            jump = own[2:] if one.drifts else own
            if math.hypot(*jump) <= blow_m_s and _drift_m_s2(one) <= rectified_m_s2:
                return 0.0
            # The constant of a line may begin within a row.
            return line if one.drifts else -math.inf

        return mean(
            [one.likelihood + log_share(one) for one in variants if one.cause is Cause.VELOCITY]
        )

    @staticmethod
    def _by_step(odds: dict[Cause, float], variants: Sequence[_Variant]) -> float:
        """By how much the best cause is better only for a step of the force.

        That says which cause it is; that there is one is for the velocities to show.
        """
        mine = [one.shown for one in variants if one.cause is Cause.ACCELEROMETER]
        accelerometer = min(odds[Cause.ACCELEROMETER], mean(mine))
        return max(odds.values()) - max((odds | {Cause.ACCELEROMETER: accelerometer}).values())

    def _is_any_heading(self, variants: Sequence[_Variant]) -> bool:
        """Whether the heading is so unknown that it can imitate the false velocity.

        It turns a change of velocity, and keeps its size.
        """
        if self._rows[0].begun.moment.sigma_heading_rad < KNOWN_HEADING_RAD:
            return False
        false = _likeliest([one for one in variants if one.cause is Cause.VELOCITY])
        measured, felt = (math.hypot(*change) for change in self._changes_since(false.begun))
        noise_m_s = MISFIT_SIGMAS * math.sqrt(2.0) * self._window.noise_m_s
        return abs(measured - felt) < SAME_SIZE * max(measured, felt) + noise_m_s

    def _decided(
        self, none: float, odds: dict[Cause, float], variants: Sequence[_Variant]
    ) -> Explained:
        best = max(odds.values())
        whole = math.exp(min(none - best, 0.0)) + sum(math.exp(one - best) for one in odds.values())
        shares = tuple((cause, math.exp(one - best) / whole) for cause, one in odds.items())
        winner = max(odds, key=lambda cause: odds[cause])
        mine = [one for one in variants if one.cause is winner]
        is_seen, step, has_jumped = self._shaken > SHAKEN_DENSITY, 0.0, False
        jumped_us = 0
        if mine:
            likeliest = _likeliest(mine)
            is_seen = self._is_beyond_receiver(winner) and self._is_seen(mine)
            is_seen = is_seen and not (self._leaves(likeliest) or self._may_lag(likeliest))
            is_jump = winner is Cause.VELOCITY and not likeliest.drifts
            has_jumped = is_jump and len(self._rows) - likeliest.begun > JUMP_ROWS
            if is_jump:
                jumped_us = self._rows[likeliest.begun].begun.moment.t_us
            if likeliest.own > 0:
                step = _size(likeliest)
        rate_b = force_b = (0.0, 0.0, 0.0)
        # Samples of a shaken force do not show its mean: nothing can be estimated from them.
        if self._shaken <= SHAKING_DENSITY:
            rate_b, _ = self._biases(self._errors(_likeliest_of(Cause.GYRO, variants)))
            _, force_b = self._biases(self._errors(_likeliest_of(Cause.ACCELEROMETER, variants)))
        found = Explained(
            max(best - none, 0.0),
            shares,
            is_seen,
            rate_b,
            force_b,
            step,
            has_jumped=has_jumped,
            jumped_us=jumped_us,
        )
        return self._with_errors(found, variants)

    def _with_errors(self, found: Explained, variants: Sequence[_Variant]) -> Explained:
        """Adds the errors by the causes that are still possible.

        Source: docs/integrity.md Eq. (7).
        """
        tilts, headings, drift = [0.0], [0.0], 0.0
        for cause, share in found.shares:
            mine = [one for one in variants if one.cause is cause]
            if not mine or share * SUSPECTED < 1.0:
                continue
            likeliest, weight = _likeliest(mine), math.sqrt(max(share, MIN_SHARE))
            tilt, heading = tilt_and_heading(self._turn(self._errors(likeliest)))
            tilts.append(weight * tilt)
            headings.append(weight * abs(heading))
            if likeliest.drifts:
                drift = weight * _drift_m_s2(likeliest)
        found = found._replace(tilt_rad=max(tilts), heading_rad=max(headings), drift_m_s2=drift)
        if self._shaken > SHAKING_DENSITY or not found.is_contradiction:
            return found
        if found.is_force_or_velocity:
            mine = [one for one in variants if one.cause is Cause.VELOCITY]
            # One that is neither a jump nor a drift shows nothing of the attitude.
            carried = self._correction(mine if found.is_seen else [self._unused()])
            found = found._replace(carried=carried)
        wrong = found.probable
        if wrong is None:
            return found
        correction = self._correction([one for one in variants if one.cause is wrong])
        return found._replace(correction=correction)

    def _correction(self, mine: Sequence[_Variant]) -> SensorCorrection:
        """Of the filter's present knowledge, by a cause whatever its beginning."""
        best = _likeliest(mine).likelihood
        weights = [math.exp(one.likelihood - best) for one in mine]
        possible = [(w, one) for w, one in zip(weights, mine, strict=True) if w * SUSPECTED > 1.0]
        down_b = rotate(conjugate(attitude(self._known.moment)), (0.0, 0.0, 1.0))
        found = []
        for _, one in possible:
            errors = self._errors(one)
            correction = errors.correction(down_b)
            rate_b, force_b = self._biases(errors)
            turn_n = log(self._turn(errors))
            found.append(correction._replace(rate_b=rate_b, force_b=force_b, turn_n=turn_n))
        return mixed([weight for weight, _ in possible], found)

    def _errors(self, one: _Variant) -> WindowErrors:
        """The errors of attitude and sensors by a cause."""
        is_gyro = one.cause is Cause.GYRO and one.own > 0
        has_force = one.cause is Cause.ACCELEROMETER and one.own > 0
        rate_from = one.begun if is_gyro else None
        return WindowErrors(one.fit, self._columns, rate_from=rate_from, has_force=has_force)

    def _turn(self, errors: WindowErrors) -> Quat:
        """From the filter's attitude at the window's end to that by a cause."""
        first, now = self._rows[0].begun.moment, self._known.moment
        return multiply(exp(errors.turn_n), multiply(first.q_ns, conjugate(now.q_ns)))

    def _seen_by_another(self, one: _Variant) -> _Variant:
        """The variant with how likely another IMU's sensor shows what it shows."""
        steps = one.cause is Cause.ACCELEROMETER and one.own > 0
        if one.cause not in self._cleared or not (one.breaks or steps):
            return one
        return one._replace(motion=one.motion - math.log(FAIL_ALIKE))

    def _motion(self, one: _Variant) -> float:
        """Logarithm of how likely the vehicle accelerates as it does if this is the cause.

        If the velocity is false, the force shows the true acceleration, else the velocity does: one
        of both has changed with the fault, and a fault does not wait for a manoeuvre that hides it.
        Only the difference counts.
        """
        if one.cause in (Cause.HEADING, Cause.ATTITUDE):
            found = one.fit.unknowns()
            sine, cosine = found[HEADING], 1.0 - found[-1]
            size = (sine * sine + cosine * cosine - 1.0) / SAME_SIZE
            return -0.5 * size * size
        moves = self._moves.get(one.begun)
        if moves is None:
            moves = self._moves[one.begun] = self._moves_since(one.begun)
        return moves[1 if one.cause is Cause.VELOCITY else 0] - max(moves)

    def _moves_since(self, begun: int) -> tuple[float, float]:
        """Logarithms of how likely the acceleration is since a row, by velocity and by force."""
        usual = self._known.usual_m_s2 * sum(self._window.lengths_s[begun:])
        by_velocity, by_force = (
            -0.5 * (TAILS + 2.0) * math.log1p((x * x + y * y) / (TAILS * usual * usual))
            for x, y in self._changes_since(begun)
        )
        return by_velocity, by_force

    def _changes_since(self, begun: int) -> tuple[Level, Level]:
        """The change of velocity since a row, as measured and as felt."""
        left, count = self._columns.left, len(self._rows)
        first, last = self._rows[begun].begun.v_n, self._rows[-1].ended.v_n
        north, east = last[0] - first[0], last[1] - first[1]
        missing = sum(left[begun:count]), sum(left[count + begun :])
        return (north, east), (north - missing[0], east - missing[1])

    def _stepping(self, one: _Variant) -> float:
        """Logarithm of how likely the force steps as it does if this is the cause.

        An accelerometer that fails within the window shows that itself, whatever the velocity does.
        Only the difference to a cause without a step counts. Source: docs/integrity.md Eq. (11).
        """
        usual = self._usual_shift_m_s2
        if one.cause is not Cause.ACCELEROMETER or not one.own or not math.isfinite(usual):
            return 0.0
        x, y = one.fit.unknowns()[-one.own :]
        count = len(one.fit.forward)
        (of_x, _), (_, of_y) = one.fit.covariance((count - 2, count - 1))
        square = usual * usual
        known = square + 0.5 * (of_x + of_y)
        # A beginning stands for those nearer to it than to the next one that is tried.
        rows, near = self._rows, (len(self._rows) - one.begun) // NEARER
        first_us = rows[max(one.begun - near, 0)].begun.moment.t_us
        last_us = rows[min(one.begun + near, len(rows) - 1)].ended.moment.t_us
        ratios = [
            math.log1p((u * u + v * v) / (SHIFT_TAILS * square))
            - math.log1p(((u - x) ** 2 + (v - y) ** 2) / (SHIFT_TAILS * known))
            for t_us, u, v in self._shifts
            if first_us <= t_us < last_us
        ]
        if not ratios:
            return 0.0
        half = 0.5 * (SHIFT_TAILS + 2.0)
        return mean([half * ratio for ratio in ratios]) + math.log(square / known)

    def _is_beyond_receiver(self, cause: Cause) -> bool:
        """Whether delay and antenna, unknown and together more than either, are not the cause.

        A receiver of which little is known is not accused for what it is not known to do.
        """
        effect_m_s = self._window.receiver_m_s
        if effect_m_s < MAX_RECEIVER * self._window.noise_m_s:
            return True
        if cause is Cause.VELOCITY:
            return False
        left, count = self._columns.left, len(self._rows)
        north = east = 0.0
        for i in reversed(range(count)):
            north, east = north + left[i], east + left[count + i]
            if math.hypot(north, east) > BEYOND_RECEIVER * effect_m_s:
                return True
        return False

    def _is_seen(self, mine: Sequence[_Variant]) -> bool:
        """Whether the residuals are noise (chi square) and a sensor's fault began in the window."""
        best, count = _likeliest(mine), 2 * len(self._rows)
        left = self._model.square - best.fit.explained
        return _has_begun(mine) and left < count + MISFIT_SIGMAS * math.sqrt(2.0 * count)

    def _leaves(self, one: _Variant) -> bool:
        """Whether it is a jump that leaves the window: what was before it is seen no more.

        It was undecided while all of it was seen, and now less contradicts it.
        """
        is_jump = one.cause is Cause.VELOCITY and not one.drifts
        return is_jump and len(self._rows) - one.begun > max(ONSETS)

    def _may_lag(self, one: _Variant) -> bool:
        """Whether it is a jump that a manoeuvre makes of fixes that are late by its row."""
        if one.cause is not Cause.VELOCITY or one.drifts:
            return False
        row = self._rows[one.begun]
        fastest_m_s2 = max(math.hypot(*row.begun.accel_n), math.hypot(*row.ended.accel_n))
        return _size(one) < fastest_m_s2 * row.length_s

    def _onsets(self) -> list[int]:
        """Rows at which a fault may begin."""
        count = len(self._rows)
        return [count - age for age in ONSETS if age < count]

    def _from_before(self, none: HypothesisFit, bent: Sequence[float]) -> list[_Variant]:
        """Faults of the whole window."""
        model, count = self._model, len(self._rows)
        broken = _failed(self._sound, TILT, 2, BROKEN_TILT_RAD)
        force = model.fit(_failed(bent, FORCE, 2, FAILED_FORCE_M_S2))
        heading = model.fit(_failed(self._sound, HEADING, 1, FAILED_HEADING_RAD))
        attitude = model.fit(_failed(broken, HEADING, 1, FAILED_HEADING_RAD))
        # A large heading error also shortens the acceleration by its cosine.
        gained, most = self._columns.gained, 1.0 - math.cos(FAILED_HEADING_RAD)
        shapes = [[*(g[0] for g in gained), *(g[1] for g in gained)], *self._ramps(count)]
        since = model.since(0, shapes)
        return [
            _Variant(Cause.GYRO, model.fit(_failed(bent, RATE, 3, FAILED_RATE_RAD_S))),
            _Variant(
                Cause.GYRO,
                model.fit(_failed(broken, RATE, 3, BROKEN_RATE_RAD_S)),
                breaks=True,
            ),
            _Variant(Cause.ACCELEROMETER, force),
            _Variant(Cause.HEADING, since.fit(heading, (0,), most), 1),
            _Variant(Cause.ATTITUDE, since.fit(attitude, (0,), most), 1),
            _Variant(Cause.VELOCITY, since.fit(none, (1, 2), RAMP_M_S2), 2, drifts=True),
            _Variant(Cause.VELOCITY, since.fit(model.fit(bent), (1, 2), RAMP_M_S2), 2, drifts=True),
        ]

    def _from_row(self, begun: int, bases: tuple[HypothesisFit, HypothesisFit]) -> _Beginning:
        """Faults that begin with a row; a drift of the velocity may also begin within it."""
        count, (none, bent) = len(self._rows) - begun, bases
        late = [self._later(LAG + j, begun) for j in (0, 1)]
        for shape, first in zip(late, self._rows[begun].began_late, strict=True):
            shape[0], shape[count] = first
        stepped = [self._stepped(FORCE + j, begun, passed) for passed in PASSED for j in (0, 1)]
        since = self._model.since(
            begun,
            [
                *(self._columns.from_row(begun, j) for j in range(3)),
                *stepped,
                *self._ramps(count),
                *_jumps(count),
                *late,
            ],
        )
        drift, jump, lag = ((at, at + 1) for at in range(9, 15, 2))
        gyro, accelerometer, velocity = Cause.GYRO, Cause.ACCELEROMETER, Cause.VELOCITY
        hypotheses = [
            _Hypothesis(gyro, none, (0, 1, 2), FAILED_RATE_RAD_S),
            _Hypothesis(gyro, none, (0, 1, 2), BROKEN_RATE_RAD_S, breaks=True),
            _Hypothesis(accelerometer, none, (3, 4), FAILED_FORCE_M_S2),
            *(
                _Hypothesis(accelerometer, none, (at, at + 1), BROKEN_FORCE_M_S2, breaks=True)
                for at in range(3, 3 + len(stepped), 2)
            ),
            _Hypothesis(velocity, none, drift, RAMP_M_S2, drifts=True),
            _Hypothesis(velocity, bent, drift, RAMP_M_S2, drifts=True),
            _Hypothesis(velocity, none, drift + jump, RAMP_M_S2, drifts=True),
            _Hypothesis(Cause.LATENCY, none, lag, FAILED_LAG_S),
        ]
        return _Beginning(begun, since, hypotheses)

    def _jump(self, row: int, bases: tuple[HypothesisFit, HypothesisFit]) -> _Beginning:
        """A jump of the velocity in a row."""
        since = self._model.since(row, _jumps(len(self._rows) - row))
        hypotheses = [
            _Hypothesis(Cause.VELOCITY, base, (0, 1), size_m_s)
            for base in bases
            for size_m_s in JUMPS_M_S
        ]
        return _Beginning(row, since, hypotheses)

    def _jumps(self, none: HypothesisFit) -> list[int]:
        """The rows with the largest residuals of a sound vehicle."""
        size = self._model.misfits(none)
        return sorted(range(len(size)), key=lambda i: -size[i])[:JUMPS]

    def _later(self, j: int, begun: int) -> list[float]:
        """The column of an unknown, from a row on."""
        column, count = self._columns.of[j], len(self._rows)
        return [*column[begun:count], *column[count + begun :]]

    def _stepped(self, j: int, begun: int, passed: float) -> list[float]:
        """The column of an unknown from within a row on, of which a share has passed before."""
        shape = self._later(j, begun)
        for first in (0, len(shape) // 2):
            shape[first] *= 1.0 - passed
        return shape

    def _ramps(self, count: int) -> list[list[float]]:
        """Columns of a drift north and of one east, over the last rows."""
        lengths_s, zeros = self._window.lengths_s[-count:], [0.0] * count
        return [[*lengths_s, *zeros], [*zeros, *lengths_s]]

    def _vibration(self) -> float:
        """Likelihood of a force with the noise of vibration and clipping."""
        density = SHAKEN * SHAKEN * max(self._force_density, SHAKEN_DENSITY)
        shaken = self._window.with_noise(max(density, self._shaken))
        return shaken.level + shaken.fit(self._sound).likelihood - self._model.level

    def _biases(self, errors: WindowErrors) -> tuple[Vec3, Vec3]:
        """Errors of the biases of gyro and accelerometer by a cause.

        At present, without what the filter has corrected since.
        """
        first, known = self._rows[0], self._known
        rate_b = plus(
            plus(errors.rate_b, 1.0, first.begun.moment.bias_b), -1.0, known.moment.bias_b
        )
        u, v, _ = plus(errors.force_b, 1.0, first.errors.force_bias_b)
        a, b, _ = known.errors.force_bias_b
        return rate_b, (u - a, v - b, 0.0)


def _usual_shift(shifts: Sequence[Shift]) -> float:
    """Of the force across a row, rms per axis; infinite while too little is known."""
    if len(shifts) < MIN_SHIFTS:
        return math.inf
    squares = sum(u * u + v * v for _, u, v in shifts)
    return math.sqrt(squares / (2.0 * len(shifts)))


def _size(one: _Variant) -> float:
    """Of the fault that begins within the window, in its own unit."""
    return math.hypot(*one.fit.unknowns()[-one.own :])


def _drift_m_s2(one: _Variant) -> float:
    """By how much the velocity drifts by a variant; 0 if it does not."""
    return math.hypot(*one.fit.unknowns()[-one.own :][:2]) if one.drifts else 0.0


def _likeliest(variants: Sequence[_Variant]) -> _Variant:
    return max(variants, key=lambda one: one.likelihood)


def _likeliest_of(cause: Cause, variants: Sequence[_Variant]) -> _Variant:
    return _likeliest([one for one in variants if one.cause is cause])


def _has_begun(mine: Sequence[_Variant]) -> bool:
    """Whether a sensor's fault certainly began in the window; of other causes it need not."""
    if mine[0].cause not in OWN_SENSORS:
        return True
    begun, constant = (
        max((one.likelihood for one in mine if (one.own > 0) is own), default=-math.inf)
        for own in (True, False)
    )
    return begun - constant > math.log(DECIDED)


def _failed(sigmas: Sequence[float], place: int, count: int, sigma: float) -> list[float]:
    """The deviations with some unknowns as large as a failure makes them."""
    of_failure = [max(sigma, known) for known in sigmas[place : place + count]]
    return [*sigmas[:place], *of_failure, *sigmas[place + count :]]


def _jumps(count: int) -> list[list[float]]:
    """Columns of a jump north and of one east in the first of `count` rows."""
    north, east = [0.0] * (2 * count), [0.0] * (2 * count)
    north[0] = east[count] = 1.0
    return [north, east]

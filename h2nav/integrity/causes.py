"""Explains why a measured velocity contradicts an attitude: causes compared by their signatures.

The change of velocity predicted from the force of a window differs from the measured one. Each
cause has a signature of its own: a wrong gyro's difference grows with the square of time, an
accelerometer's turns with the body, a wrong heading's turns with the acceleration, a false velocity
jumps or bends at a moment without a trace in the force, and vibration only adds noise. All of them
are linear in a few unknowns. The usual size of these is known of healthy sensors; under the
hypothesis of a cause its own unknowns may be as large as a failure makes them. The causes are
compared by the likelihood of the measurements with the unknowns integrated out.

Equations: docs/integrity.md, section 5.
"""

import math
import operator
import statistics
from collections.abc import Sequence
from enum import Enum
from itertools import pairwise
from typing import NamedTuple

from h2nav.attitude.samples import SensorDoubt, SensorErrors, Vec3
from h2nav.integrity.velocity_windows import (
    LAG_SIGMA_S,
    RATE_SIGMA_RAD_S,
    SCALE_SIGMA,
    Mark,
    change_of_velocity,
)
from h2nav.maths.quaternion import Quat, conjugate, multiply, rotate
from h2nav.maths.units import DEG

LENGTHS_S = (3.0, 6.0, 10.0)
LEAST_SHARE = 0.8
LEAST_ROWS = 4
# Velocities closer in time share the receiver's error.
ROW_S = 0.4
# Noise of a receiver's velocity from row to row, m/s; its measured jitter is added.
NOISE_M_S = 0.1
# Of a force that turns with the vehicle, where the filter knows no better, m/s^2.
FORCE_SIGMA_M_S2 = 0.1
# Least deviation of a gyro's bias that is being estimated.
MOST_RATE_RAD_S = 0.15 * DEG
LEAST_TILT_RAD = 0.2 * DEG
LEAST_HEADING_RAD = 1.0 * DEG
# Sizes of failures: gyros step by 1 deg/s with temperature and knocks, accelerometers by their data
# sheet's 60 mg; a heading may be any.
FAILED_RATE_RAD_S = 1.5 * DEG
FAILED_FORCE_M_S2 = 0.6
FAILED_HEADING_RAD = 60.0 * DEG
FAILED_TILT_RAD = 5.0 * DEG
JUMP_M_S = 10.0
RAMP_M_S2 = 2.0
MOMENTS = 8  # at which a velocity may have become false
# Vibration: multiple of the noise in the samples of the force, and at least this, m^2/s^3, since
# the samples do not show all of it.
SHAKEN = 4.0
SHAKEN_DENSITY = 1e-3
SHAKING_DENSITY = 0.02  # 1.4 m/s^2 rms at 100 Hz: above it a force may hide blows
# A larger heading error is not a small angle.
KNOWN_HEADING_RAD = 10.0 * DEG
# Odds for a decision, and for the existence of a cause: one error in a thousand.
DECIDED = 1000.0
# An undecided cause takes effect by its probability, from these odds against none on.
SUSPECTED = 100.0


class Cause(Enum):
    """The cause of a contradiction; the value is for people."""

    GYRO = "gyro"
    ACCELEROMETER = "accelerometer"
    HEADING = "heading"
    VELOCITY = "velocity"
    VIBRATION = "vibration"


class Explained(NamedTuple):
    """The explanation of the windows that end now.

    Attributes:
        odds: of the best cause against none, as a logarithm; 0: nothing to explain.
        shares: probabilities of the causes; with that of "nothing is wrong" their sum is 1.
        rate_b: error of the gyro's bias, if it is the cause, rad/s.
        force_b: error of the accelerometer, if it is the cause, m/s^2; z is not estimated.
    """

    odds: float = 0.0
    shares: tuple[tuple[Cause, float], ...] = ()
    rate_b: Vec3 = (0.0, 0.0, 0.0)
    force_b: Vec3 = (0.0, 0.0, 0.0)

    def share(self, cause: Cause) -> float:
        """Probability of a cause."""
        return next((share for one, share in self.shares if one is cause), 0.0)

    @property
    def is_contradiction(self) -> bool:
        """Whether anything is wrong."""
        return self.odds > math.log(DECIDED)

    @property
    def decided(self) -> Cause | None:
        """The only possible cause; None: undecided, or nothing is wrong."""
        if not self.is_contradiction:
            return None
        return next((cause for cause, share in self.shares if share > 1.0 - 1.0 / DECIDED), None)


NOTHING = Explained()


def doubt_of(found: Explained) -> SensorDoubt | None:
    """The doubt for a filter: errors of its sensors, by the probability of their cause.

    Source: docs/integrity.md Eq. (6).
    """
    if found.odds < math.log(SUSPECTED):
        return None
    of_rate = math.sqrt(found.share(Cause.GYRO))
    of_force = math.sqrt(found.share(Cause.ACCELEROMETER))
    x, y, z = (of_rate * abs(part) for part in found.rate_b)
    u, v = (of_force * abs(part) for part in found.force_b[:2])
    return SensorDoubt((x, y, z), (u, v))


# Unknowns, by their columns: tilt north and east, heading, gyro's bias and scale (three axes each),
# accelerometer (two axes), latency.
COLUMNS = 12
_TILT, _HEADING, _RATE, _SCALE, _FORCE, _LAG = 0, 2, 3, 6, 9, 11


class _Row(NamedTuple):
    """One step between marks, north and east in turn.

    Attributes:
        length_s: of the step.
        left: measured minus predicted change of velocity, m/s.
        columns: effect of each unknown on it.
    """

    length_s: float
    left: tuple[float, float]
    columns: tuple[tuple[float, ...], tuple[float, ...]]


def explain(marks: Sequence[Mark], errors: SensorErrors) -> Explained:
    """Compares the causes over windows that end with the last mark.

    Args:
        marks: fixes and dead reckoning at their times, in order.
        errors: the filter's knowledge of its sensors.
    """
    found = NOTHING
    for length_s in LENGTHS_S:
        window = _window(marks, length_s)
        if len(window) > LEAST_ROWS:
            rows = _rows(window, errors.force_bias_b)
            if len(rows) >= LEAST_ROWS:
                one = _compare(rows, _jitter_m_s(window), window[0], _slow(window, errors))
                found = max(found, one, key=_weight)
    return found


def _slow(window: Sequence[Mark], errors: SensorErrors) -> SensorErrors:
    """The noises, increased by what slow samples miss."""
    first, last = window[0].moment, window[-1].moment
    length_s = 1e-6 * (last.t_us - first.t_us)
    turned = (last.turn_variance - first.turn_variance) / length_s
    gained = (last.gained_variance - first.gained_variance) / length_s
    return errors._replace(
        rate_density=errors.rate_density + turned, force_density=errors.force_density + gained
    )


def _weight(found: Explained) -> tuple[bool, float]:
    """Sort key: a window that decides has more weight."""
    return found.decided is not None, found.odds


def _window(marks: Sequence[Mark], length_s: float) -> list[Mark]:
    """The marks of the last `length_s`; none if they do not reach back that far."""
    end_us = marks[-1].moment.t_us
    window = [mark for mark in marks if end_us - mark.moment.t_us <= 1.02e6 * length_s]
    reached_s = 1e-6 * (end_us - window[0].moment.t_us)
    return window if reached_s >= LEAST_SHARE * length_s else []


def _jitter_m_s(window: Sequence[Mark]) -> float:
    """Noise of single velocities, by the median of their second differences."""
    first = window[0].moment
    left = []
    for mark in window:
        north, east, _ = change_of_velocity(first, mark.moment)
        left.append((mark.v_n[0] - north, mark.v_n[1] - east))
    bends = [
        abs(a[i] - 2.0 * b[i] + c[i])
        for a, b, c in zip(left, left[1:], left[2:], strict=False)
        for i in (0, 1)
    ]
    # A normal deviation is 1.48 medians; a second difference has six times the variance.
    return 1.48 * statistics.median(bends) / math.sqrt(6.0) if bends else 0.0


class _Reckoning:
    """The effect of the sensors' unknowns on turn and velocity along a window, in axes n."""

    def __init__(self) -> None:
        # Turn error by each axis's bias, by its scale, and by the known bias error.
        self._turns = [[0.0, 0.0, 0.0] for _ in range(7)]
        self.begin()

    def begin(self) -> None:
        """Begins a row."""
        self.length_s = 0.0
        self.change_n = [0.0, 0.0, 0.0]
        self.by_turn = [[0.0, 0.0] for _ in range(7)]
        self.axes = [[0.0, 0.0] for _ in range(2)]

    def step(
        self, dt_s: float, axes: Sequence[Vec3], turned: Vec3, known: Vec3, change_n: Vec3
    ) -> None:
        """Advances to the next mark.

        Args:
            dt_s: time since the previous mark.
            axes: of the body, in n, over the step.
            turned: angle of the step about them, rad.
            known: negative error of the gyro's bias in the prediction, rad/s, body.
            change_n: integral of the specific force over the step, m/s.
        """
        turns = self._turns
        for j, (x, y, z) in enumerate(axes):
            for of, size in ((j, dt_s), (3 + j, turned[j]), (6, known[j] * dt_s)):
                turn = turns[of]
                turn[0] -= size * x
                turn[1] -= size * y
                turn[2] -= size * z
        for turn, by in zip(turns, self.by_turn, strict=True):
            by[0] += turn[1] * change_n[2] - turn[2] * change_n[1]
            by[1] += turn[2] * change_n[0] - turn[0] * change_n[2]
        for j in (0, 1):
            self.axes[j][0] -= dt_s * axes[j][0]
            self.axes[j][1] -= dt_s * axes[j][1]
        for i in range(3):
            self.change_n[i] += change_n[i]
        self.length_s += dt_s


def _rows(window: Sequence[Mark], force_bias_b: Vec3) -> list[_Row]:
    """The steps of a window with the effect of each unknown."""
    q_ns, bias_b = window[0].moment.q_ns, window[-1].moment.bias_b
    at = _Reckoning()
    begun, rows = window[0], []
    for before, mark in pairwise(window):
        a, b = before.moment, mark.moment
        dt_s = 1e-6 * (b.t_us - a.t_us)
        gained = tuple(y - x for x, y in zip(a.gained_s, b.gained_s, strict=True))
        turn = multiply(conjugate(a.q_sb), b.q_sb)
        sign = 2.0 if turn[0] > 0.0 else -2.0
        turned = (sign * turn[1], sign * turn[2], sign * turn[3])
        used = ((x + y) / 2.0 for x, y in zip(a.bias_b, b.bias_b, strict=True))
        known = tuple(now - then for now, then in zip(bias_b, used, strict=True))
        change_n = rotate(q_ns, (gained[0], gained[1], gained[2]))
        axes = _axes(q_ns, a.q_sb, turned)
        at.step(dt_s, axes, turned, (known[0], known[1], known[2]), change_n)
        if at.length_s >= ROW_S:
            rows.append(_row(at, begun, mark, force_bias_b))
            begun = mark
            at.begin()
    return rows


def _axes(q_ns: Quat, q_sb: Quat, turned: Vec3) -> tuple[Vec3, Vec3, Vec3]:
    """The body's axes in n in the middle of a step."""
    half = multiply(q_sb, (1.0, 0.25 * turned[0], 0.25 * turned[1], 0.25 * turned[2]))
    size = 1.0 / math.sqrt(sum(part * part for part in half))
    w, x, y, z = multiply(q_ns, half)
    q = (size * w, size * x, size * y, size * z)
    return rotate(q, (1.0, 0.0, 0.0)), rotate(q, (0.0, 1.0, 0.0)), rotate(q, (0.0, 0.0, 1.0))


def _row(at: _Reckoning, begun: Mark, mark: Mark, force_bias_b: Vec3) -> _Row:
    north, east, down = at.change_n
    known = at.by_turn[6]
    left = [
        mark.v_n[i]
        - begun.v_n[i]
        - at.change_n[i]
        - known[i]
        - sum(force_bias_b[j] * at.axes[j][i] for j in (0, 1))
        for i in (0, 1)
    ]
    columns = [
        (
            *tilt,
            *(by[i] for by in at.by_turn[:6]),
            *(axis[i] for axis in at.axes),
            begun.accel_n[i] - mark.accel_n[i],
        )
        for i, tilt in enumerate(((0.0, down, -east), (-down, 0.0, north)))
    ]
    return _Row(at.length_s, (left[0], left[1]), (columns[0], columns[1]))


class _Sums:
    """Normal equations of whitened rows, with priors still open.

    Attributes:
        products: of columns with columns; the lower half.
        right: of columns with the residuals.
        square: of the residuals.
        level: logarithm of the likelihood without unknowns, up to a constant.
    """

    def __init__(self, rows: Sequence[_Row], noise_m_s: float, force_density: float) -> None:
        gains = _whitening([row.length_s for row in rows], noise_m_s, force_density)
        self._gains = gains
        # Column by column, north and then east.
        self._columns = [
            [x for i in (0, 1) for x in _whitened([row.columns[i][j] for row in rows], gains)]
            for j in range(COLUMNS)
        ]
        self._left = [x for i in (0, 1) for x in _whitened([row.left[i] for row in rows], gains)]
        self.products = [
            [_dot(one, other) for other in self._columns[: i + 1]]
            for i, one in enumerate(self._columns)
        ]
        self.right = [_dot(one, self._left) for one in self._columns]
        self.square = _dot(self._left, self._left)
        self.level = 2.0 * sum(math.log(scale) for scale, _ in gains) - 0.5 * self.square

    def with_shape(self, shape: Sequence[float]) -> "tuple[list[list[float]], list[float]]":
        """Products and right side with two more unknowns, a shape in north and in east."""
        one, zeros = _whitened(shape, self._gains), [0.0] * len(shape)
        products, right = [*self.products], [*self.right]
        size, half = _dot(one, one), len(shape)
        for i, column in enumerate(([*one, *zeros], [*zeros, *one])):
            part = slice(i * half, (i + 1) * half)
            cross = [_dot(other[part], one) for other in self._columns]
            products.append([*cross, size] if i == 0 else [*cross, 0.0, size])
            right.append(_dot(column, self._left))
        return products, right


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return float(sum(map(operator.mul, a, b)))


def _whitening(
    lengths_s: Sequence[float], noise_m_s: float, force_density: float
) -> list[tuple[float, float]]:
    """Factors of the covariance of changes between noisy velocities, plus a noisy force.

    Neighbouring changes share a velocity: the covariance has one diagonal beside the main one, and
    so has its root. Source: docs/integrity.md Eq. (4).

    Returns:
        For each row its own scale, and the share of the previous white row.
    """
    noise, factors, before = noise_m_s * noise_m_s, [], math.inf
    for length_s in lengths_s:
        share = -noise / before
        scale = math.sqrt(2.0 * noise + force_density * length_s - share * share)
        factors.append((1.0 / scale, share))
        before = scale
    return factors


def _whitened(values: Sequence[float], factors: Sequence[tuple[float, float]]) -> list[float]:
    white, before = [], 0.0
    for value, (scale, share) in zip(values, factors, strict=True):
        before = scale * (value - share * before)
        white.append(before)
    return white


class _Fit(NamedTuple):
    """The fit of a hypothesis.

    Attributes:
        root: lower triangle, row by row, of I + S A^T A S.
        forward: its solution for S A^T z.
        likelihood: its logarithm, up to a constant shared by all hypotheses.
    """

    root: tuple[tuple[float, ...], ...] = ()
    forward: tuple[float, ...] = ()
    likelihood: float = 0.0


UNBEGUN = _Fit()


def _fit(
    products: Sequence[Sequence[float]],
    right: Sequence[float],
    sigmas: Sequence[float],
    begun: _Fit = UNBEGUN,
) -> _Fit:
    """Integrates the unknowns out.

    Args:
        products: of the columns; the lower half.
        right: of columns with the residuals.
        sigmas: prior deviations of the unknowns.
        begun: factor of the first of them.

    Source: docs/integrity.md Eq. (5).
    """
    root, forward, likelihood = list(begun.root), list(begun.forward), begun.likelihood
    for i in range(len(root), len(sigmas)):
        line, scale = products[i], sigmas[i]
        row: list[float] = []
        for j in range(i):
            row.append((scale * line[j] * sigmas[j] - _dot(row, root[j])) / root[j][j])
        pivot = math.sqrt(1.0 + scale * sigmas[i] * line[i] - _dot(row, row))
        solved = (scale * right[i] - _dot(row, forward)) / pivot
        root.append((*row, pivot))
        forward.append(solved)
        likelihood += 0.5 * solved * solved - math.log(pivot)
    return _Fit(tuple(root), tuple(forward), likelihood)


def _unknowns(fit: _Fit, sigmas: Sequence[float]) -> list[float]:
    """The most probable unknowns."""
    root = fit.root
    found = [0.0] * len(root)
    for i in reversed(range(len(root))):
        rest = sum(root[k][i] * found[k] for k in range(i + 1, len(root)))
        found[i] = (fit.forward[i] - rest) / root[i][i]
    return [sigma * part for sigma, part in zip(sigmas, found, strict=True)]


def _compare(
    rows: Sequence[_Row], jitter_m_s: float, first: Mark, errors: SensorErrors
) -> Explained:
    """The likelihoods of the causes over one window."""
    noise_m_s = math.hypot(NOISE_M_S, jitter_m_s)
    sums = _Sums(rows, noise_m_s, errors.force_density)
    products, right = sums.products, sums.right
    sound = _sigmas(sum(row.length_s for row in rows), first, errors)
    none = _fit(products, right, sound)
    # No hypothesis with these noises explains more than everything.
    if 0.5 * sums.square - none.likelihood < math.log(SUSPECTED):
        return NOTHING
    # An error that has lasted for a while has also bent the attitude.
    bent = _failed(sound, _TILT, 2, FAILED_TILT_RAD)
    of_rate = _failed(bent, _RATE, 3, FAILED_RATE_RAD_S)
    of_force = _failed(bent, _FORCE, 2, FAILED_FORCE_M_S2)
    of_heading = _failed(sound, _HEADING, 1, FAILED_HEADING_RAD)
    gyro, force = _fit(products, right, of_rate), _fit(products, right, of_force)
    odds = {
        Cause.GYRO: gyro.likelihood,
        Cause.ACCELEROMETER: force.likelihood,
        Cause.HEADING: _fit(products, right, of_heading).likelihood,
        Cause.VELOCITY: _falsehood(sums, [row.length_s for row in rows], bent),
        Cause.VIBRATION: _shaken(rows, noise_m_s, errors.force_density, sound) - sums.level,
    }
    if errors.force_density > SHAKING_DENSITY:
        # A blow hidden from the force looks like a jump of the velocity: noise may have made it.
        odds[Cause.VIBRATION] = max(odds[Cause.VIBRATION], odds[Cause.VELOCITY])
    if first.moment.sigma_heading_rad > KNOWN_HEADING_RAD:
        # An almost unknown heading can imitate any false velocity.
        odds[Cause.HEADING] = max(odds[Cause.HEADING], odds[Cause.VELOCITY])
    best = max(odds.values())
    whole = math.exp(min(none.likelihood - best, 0.0)) + sum(
        math.exp(one - best) for one in odds.values()
    )
    shares = tuple((cause, math.exp(one - best) / whole) for cause, one in odds.items())
    x, y, z = _unknowns(gyro, of_rate)[_RATE : _RATE + 3]
    u, v = _unknowns(force, of_force)[_FORCE : _FORCE + 2]
    if errors.force_density > SHAKING_DENSITY:
        # Samples of a shaken force do not show its mean: nothing can be estimated from them.
        x = y = z = u = v = 0.0
    return Explained(max(best - none.likelihood, 0.0), shares, (x, y, z), (u, v, 0.0))


def _sigmas(length_s: float, first: Mark, errors: SensorErrors) -> list[float]:
    """Deviations of the unknowns if nothing is wrong."""
    tilt = max(first.moment.sigma_tilt_rad / math.sqrt(2.0), LEAST_TILT_RAD)
    heading = min(max(first.moment.sigma_heading_rad, LEAST_HEADING_RAD), math.pi)
    # The rate noise turns an attitude like a bias of this size, as seen by the velocity.
    by_noise = 4.0 * errors.rate_density / (3.0 * length_s)
    known = by_noise + RATE_SIGMA_RAD_S * RATE_SIGMA_RAD_S
    most = MOST_RATE_RAD_S * MOST_RATE_RAD_S
    rate = [math.sqrt(known + min(variance, most)) for variance in errors.gyro_variance]
    force = [math.sqrt(v) if v > 0.0 else FORCE_SIGMA_M_S2 for v in errors.force_variance]
    return [tilt, tilt, heading, *rate, *[SCALE_SIGMA] * 3, *force, LAG_SIGMA_S]


def _failed(sigmas: Sequence[float], place: int, count: int, sigma: float) -> list[float]:
    """The deviations with some unknowns as large as a failure makes them."""
    of_failure = [max(sigma, known) for known in sigmas[place : place + count]]
    return [*sigmas[:place], *of_failure, *sigmas[place + count :]]


def _shaken(
    rows: Sequence[_Row], noise_m_s: float, force_density: float, sigmas: Sequence[float]
) -> float:
    """Likelihood of a force with the noise of vibration and clipping."""
    density = SHAKEN * SHAKEN * max(force_density, SHAKEN_DENSITY)
    sums = _Sums(rows, noise_m_s, density)
    return sums.level + _fit(sums.products, sums.right, sigmas).likelihood


def _falsehood(sums: _Sums, lengths_s: Sequence[float], sigmas: Sequence[float]) -> float:
    """Likelihood of a velocity that jumps, or begins to drift, at a moment of the window."""
    count = len(lengths_s)
    base = _fit(sums.products, sums.right, sigmas)
    likelihoods = []
    for begun in range(0, count, max(1, count // MOMENTS)):
        jump = [1.0 if i == begun else 0.0 for i in range(count)]
        drift = [length_s if i >= begun else 0.0 for i, length_s in enumerate(lengths_s)]
        for shape, sigma in ((jump, JUMP_M_S), (drift, RAMP_M_S2)):
            products, right = sums.with_shape(shape)
            fit = _fit(products, right, [*sigmas, sigma, sigma], base)
            likelihoods.append(fit.likelihood)
    best = max(likelihoods)
    return best + math.log(sum(math.exp(one - best) for one in likelihoods) / len(likelihoods))

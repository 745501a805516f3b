"""What a sensor proved wrong is off by, and the attitude without it, with what is left unknown.

Equations: docs/integrity.md, section 5.
"""

import math
from collections.abc import Sequence
from operator import mul

from h2nav.attitude.samples import SensorCorrection, Vec3
from h2nav.integrity.likelihood import HypothesisFit
from h2nav.integrity.strapdown import Moment
from h2nav.integrity.velocity_model import FORCE, RATE, TILT
from h2nav.integrity.velocity_rows import VelocityColumns, plus
from h2nav.maths.quaternion import Quat, conjugate, exp, log, multiply
from h2nav.maths.units import DEG

# Of the square of a turn: what is left of angles that were added as if they were small.
SECOND_ORDER = 0.25
# Velocities hardly show a rate about the vertical: one within so many deviations is not believed
# beyond the size of a usual failure: gyros step by 1 deg/s with temperature and knocks.
SIGNIFICANT = 3.0
FAILED_RATE_RAD_S = 1.5 * DEG

Rows = Sequence[Sequence[float]]


class WindowErrors:
    """Errors at the end of a window as sums of the unknowns of a cause.

    Args:
        fit: of the cause.
        columns: of the window.
        rate_from: the last three unknowns are a gyro's error since this row.
        has_force: the last two are an accelerometer's.
    """

    def __init__(
        self,
        fit: HypothesisFit,
        columns: VelocityColumns,
        *,
        rate_from: int | None,
        has_force: bool,
    ) -> None:
        self._fit, self._used_n = fit, columns.used_n
        self._unknowns = fit.unknowns()
        count = len(self._unknowns)
        turns = dict(enumerate(columns.turned_in_all, RATE))
        rates, forces = [RATE], [FORCE]
        if rate_from is not None:
            rates.append(count - 3)
            pairs = zip(columns.turned_in_all, columns.turned[rate_from], strict=False)
            turns |= enumerate((plus(in_all, -1.0, before) for in_all, before in pairs), count - 3)
        if has_force:
            forces.append(count - 2)
        self._turn = _ones(count, 3, TILT)  # north, east, and the heading behind them
        for place, turn in turns.items():
            for row, part in zip(self._turn, turn, strict=True):
                row[place] = part
        self._rate, self._force = _ones(count, 3, *rates), _ones(count, 2, *forces)

    @property
    def turn_n(self) -> Vec3:
        """From the strapdown's attitude to the true one, rotation vector in NED, rad."""
        north, east, down = _sums(self._turn, self._unknowns)
        return plus(self._used_n, 1.0, (north, east, down))

    @property
    def rate_b(self) -> Vec3:
        """Of the gyro, beyond the bias known at the window's beginning, rad/s."""
        x, y, z = _sums(self._rate, self._unknowns)
        return x, y, z

    @property
    def force_b(self) -> Vec3:
        """Likewise of the accelerometer, m/s^2; z is not estimated."""
        x, y = _sums(self._force, self._unknowns)
        return x, y, 0.0

    def correction(self, down_b: Vec3) -> SensorCorrection:
        """The correction with its deviations, of what was known at the window's beginning.

        Args:
            down_b: the vertical in body axes.

        Source: docs/integrity.md Eq. (10).
        """
        covariance = self._fit.covariance(range(len(self._unknowns)))
        vertical = [sum(map(mul, down_b, rates)) for rates in zip(*self._rate, strict=True)]
        shared = _sums(covariance, vertical)
        variance, found = sum(map(mul, vertical, shared)), sum(map(mul, vertical, self._unknowns))
        if found * found < SIGNIFICANT**2 * variance:
            whole = variance + FAILED_RATE_RAD_S**2
            gains = [part / whole for part in shared]
            self._unknowns = [
                x - gain * found for x, gain in zip(self._unknowns, gains, strict=True)
            ]
            covariance = [
                [part - gain * other for part, other in zip(row, shared, strict=True)]
                for row, gain in zip(covariance, gains, strict=True)
            ]
        north, east, down, x, y, z, a, b = (
            sum(map(mul, row, _sums(covariance, row)))
            for row in (*self._turn, *self._rate, *self._force)
        )
        bent = SECOND_ORDER * sum(part * part for part in self.turn_n)
        return SensorCorrection(
            self.rate_b,
            self.force_b,
            self.turn_n,
            (math.sqrt(x), math.sqrt(y), math.sqrt(z)),
            (math.sqrt(a), math.sqrt(b)),
            math.sqrt(north + east + bent * bent),
            math.sqrt(down + bent * bent),
        )


def mixed(weights: Sequence[float], found: Sequence[SensorCorrection]) -> SensorCorrection:
    """One correction for several that are possible: their mean, and by how much they differ.

    Args:
        weights: how likely each is, up to a factor.

    Source: docs/integrity.md Eq. (10).
    """
    shares = [weight / sum(weights) for weight in weights]
    rate_b, rates = _spread(shares, [one.rate_b for one in found])
    force_b, forces = _spread(shares, [one.force_b for one in found])
    turn_n, (north, east, down) = _spread(shares, [one.turn_n for one in found])
    x, y, z = _deviations(shares, [one.rate_sigma_b for one in found], rates)
    a, b = _deviations(shares, [one.force_sigma_b for one in found], forces[:2])
    tilt, heading = _deviations(
        shares,
        [(one.tilt_sigma_rad, one.heading_sigma_rad) for one in found],
        (north + east, down),
    )
    return SensorCorrection(rate_b, force_b, turn_n, (x, y, z), (a, b), tilt, heading)


def advanced(found: SensorCorrection, then: Moment, now: Moment) -> SensorCorrection:
    """The correction at a later moment, to which the gyro has gone on with its error."""
    rate_b = plus(plus(found.rate_b, 1.0, then.bias_b), -1.0, now.bias_b)
    x, y, z = (-1e-6 * (now.t_us - then.t_us) * rate for rate in rate_b)
    sound = multiply(multiply(exp(found.turn_n), then.q_ns), multiply(now.q_sb, exp((x, y, z))))
    turn_n = log(multiply(sound, conjugate(attitude(now))))
    return found._replace(rate_b=rate_b, turn_n=turn_n)


def attitude(moment: Moment) -> Quat:
    """The filter's attitude then, body to NED."""
    return multiply(moment.q_ns, moment.q_sb)


def _ones(count: int, rows: int, *firsts: int) -> list[list[float]]:
    """Rows that each take one unknown of every triad or pair that begins at these places."""
    found = [[0.0] * count for _ in range(rows)]
    for i, row in enumerate(found):
        for first in firsts:
            row[first + i] = 1.0
    return found


def _spread(shares: Sequence[float], vectors: Sequence[Vec3]) -> tuple[Vec3, Vec3]:
    """Mean and variances of vectors that are possible with these shares."""
    x, y, z = _sums([*zip(*vectors, strict=True)], shares)
    off = [plus(vector, -1.0, (x, y, z)) for vector in vectors]
    u, v, w = _squares(shares, off)
    return (x, y, z), (u, v, w)


def _deviations(shares: Sequence[float], sigmas: Rows, apart: Sequence[float]) -> list[float]:
    """Deviations of what is possible with these shares, and apart by these variances."""
    within = _squares(shares, sigmas)
    return [math.sqrt(one + other) for one, other in zip(within, apart, strict=True)]


def _squares(shares: Sequence[float], vectors: Rows) -> list[float]:
    """Mean squares of their parts."""
    return _sums([[x * x for x in parts] for parts in zip(*vectors, strict=True)], shares)


def _sums(rows: Rows, numbers: Sequence[float]) -> list[float]:
    return [sum(map(mul, row, numbers)) for row in rows]

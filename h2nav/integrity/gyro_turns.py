"""Tests a gyro by the field, without any attitude: whether its rates turn the field as it turns.

A field m that is fixed in space changes in the body by the integral of m x w. A gyro in other
units, of another scale, or with other axes turns another field than a compass shows, whatever the
vehicle does and however it shakes. Fitted along are what no gyro or compass is free of: a zero b,
and iron h of the vehicle, which does not turn,

    change = integral of (m - h) x (M w + b),

with M = 1 of a sound gyro, a number times it of one that is off by a scale, and any matrix of one
with other axes. A compass that is mounted otherwise than is said turns the field by a rotation M.
It never is by a scale. A compass that is said to be mirrored fits no rotation: axes are compared
only if they have agreed before.

Equations: docs/integrity.md, section 5.
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

from h2nav.integrity.findings import Alarm, Kind, Sensor, Severity
from h2nav.integrity.kernel.memory import Memory
from h2nav.integrity.kernel.turns import FIELDS, PATH, PRODUCTS, RATES
from h2nav.integrity.likelihood import (
    HypothesisFit,
    LinearModel,
    NoiseSearch,
    fit_of_unknown_noise,
    model_of_one_noise,
)
from h2nav.maths.quaternion import Vec3
from h2nav.maths.units import DEG
from h2nav.maths.vectors import cross

ROWS = 40
# What has changed at once shows in few rows, a scale or calm turns only in many.
MIN_ROWS, SHORT_ROWS, MIDDLE_ROWS = 8, 10, 16
JUDGED_ROWS = 2  # a second
# Judgements in turn: a scale that has begun within the rows resembles other axes for some of them.
RAISED = {Kind.GYRO_SCALE: 2, Kind.GYRO_FIELD: 5}
ENDED = 3  # judgements in turn that show none
# What a zero and iron may be: a gyro's data sheet, and a magnet of half the field.
ZERO_SIGMA_RAD_S = 20.0 * DEG
IRON_SIGMA = 0.5
# Of one component of a change, as a share of the field: less is resolution, more fits no gyro.
MIN_NOISE, MAX_NOISE = 0.006, 0.05
NOISES = NoiseSearch(first=0.02, least=MIN_NOISE, fits=2)
# Smaller misfits are what delay, iron and a zero explain: of a second fit nothing would follow.
SUSPICIOUS = 0.012
# A field that hardly changes, as that of a compass that has failed, fits any gyro.
ALIVE = 2.0
# Changes so much larger than what is left of them are those by the gyro.
AGREED = 3.0
# A scale that data sheets do not allow, with what iron and the delay of a field leave of one.
MIN_SCALE, SCALE_SIGMAS, SCALE_SIGMA = 0.04, 5.0, 0.05
SCALE_PATH_RAD = 2.0 * math.pi
# What both halves show, over that of all.
ALIKE = 0.6
# The norm of a field that iron or currents change is not the same to this share.
STEADY = 0.05
# Other axes fit by this much better, in so many rows, than a gyro that misses by so much.
MISFIT, AXES_ROWS, AXES_MISFIT = 2.2, 16, 0.03
# They are known to this deviation, and fit by so much better than the nearest rotation, which may
# be the compass's own, and shows in no turn about its axis.
AXES_SIGMA, TURNED, ROTATION_STEPS = 0.35, 1.7, 12
# A vehicle that turns by less in 20 s shows nothing any more.
SEEN_RAD = 1.0
# Logarithm of the odds from which on the newest rows show that a gyro is sound again.
SURE = 12.0
# A scale is taken anew if it differs by this much.
RESCALED = 0.02
# A factor from which on it is named as one, not as a share.
FACTOR, MAX_FACTOR, FAR_TOO_LARGE = 5.0, 1000.0, "gyro's rates are far too large"
# In calm flight iron as large as the field would hide its turns: so many times as large they are
# the gyro's own, if the field has the norm of the earth's.
GROSS = 8.0
# Few rows show that such a gyro is sound again: those that miss by less than so much of a change.
SOUND_ROWS, SOUND = 3, 2.0
SCALE = 6  # place of the unknown behind zero and iron; other axes follow
NOISE_PRIORS = (ZERO_SIGMA_RAD_S,) * 3 + (IRON_SIGMA,) * 3
PRIORS = {
    "sound": (*NOISE_PRIORS, 0.0, *9 * (0.0,)),
    "scale": (*NOISE_PRIORS, 1.0, *9 * (0.0,)),
    "axes": (*NOISE_PRIORS, 0.0, *9 * (2.0,)),
    "known": NOISE_PRIORS,
}
UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class _Row(NamedTuple):
    """One change of the field."""

    values: list[float]  # of `kernel.turns`
    share: float  # one over the norm of the field, 1/uT
    left: Vec3  # the change as a share of the norm, minus that by the gyro
    square: float  # of `left`
    changed: float  # square of the change, as a share of the norm


class _Fit(NamedTuple):
    noise: float  # rms of what is left, of one component
    found: HypothesisFit
    unknowns: list[float]


class GyroError(NamedTuple):
    """How a gyro differs from the field."""

    kind: Kind  # of the finding
    size: float  # percent: of the scale, or of the field that is left of a change
    text: str  # for people
    evidence: str  # the figures
    unknowns: tuple[float, ...]  # as fitted
    noise: float  # of one component of a change, as a share of the field
    rate_factor: float = 1.0  # by which its rates have to be multiplied; 1: that is not known

    @property
    def is_gross(self) -> bool:
        """Whether its rates are so far off that they show nothing."""
        return self.kind is Kind.GYRO_SCALE and self.rate_factor == 1.0


class GyroTurns:
    """Judges one gyro by one compass.

    Attributes:
        error: of the gyro; None if none is known.
        rate_factor: by which its rates have to be multiplied, also while it hardly turns.
    """

    def __init__(self) -> None:
        self._rows: deque[_Row] = deque(maxlen=ROWS)
        self._new = 0
        self._has_agreed = self._is_of_earth = False
        self._suspected, self._times, self._without = "", 0, 0
        self._since_us = 0
        self.error: GyroError | None = None
        self._raised: GyroError | None = None  # the latest one, until the gyro is sound again
        self.rate_factor = 1.0

    @property
    def turned_rad(self) -> float:
        """The path of its rows."""
        return sum(row.values[PATH] for row in self._rows)

    def take(self, memory: Memory, *, is_of_earth: bool) -> bool:
        """Takes the row that is complete.

        Args:
            memory: of the watch.
            is_of_earth: the field has the norm of the earth's.

        Returns:
            Whether anything may have changed by it.
        """
        self._is_of_earth = is_of_earth
        values, norm_ut = memory.turn_row[:], math.hypot(*memory.field[:])
        share = 1.0 / norm_ut if norm_ut > 0.0 else 0.0
        x, y, z, _, xy, xz, yx, _, yz, zx, zy, _ = values[:FIELDS]
        u, v, w = x - (yz - zy), y - (zx - xz), z - (xy - yx)
        square, changed = (
            share * share * (u * u + v * v + w * w),
            share * share * (x * x + y * y + z * z),
        )
        left = (share * u, share * v, share * w)
        self._rows.append(_Row(values, share, left, square, changed))
        if self.error is not None and self.error.is_gross:
            newest = list(self._rows)[-SOUND_ROWS:]
            if sum(row.square for row in newest) < SOUND**2 * sum(row.changed for row in newest):
                self._end(newest)
                return True
        self._new += 1
        if self._new < JUDGED_ROWS or len(self._rows) < MIN_ROWS:
            return False
        self._new = 0
        newest = list(self._rows)[-MIDDLE_ROWS:]
        if self._raised is not None and _is_sound(newest, self._raised):
            self._end(newest)
            return True
        was_fine = self.error is None
        self._judge(round(memory.t_us))
        return not was_fine or self.error is not None

    def _end(self, newest: Sequence[_Row]) -> None:
        """Ends an error that the newest rows do not show."""
        self._rows = deque(newest, ROWS)
        self.error = self._raised = None
        self.rate_factor, self._times = 1.0, 0

    def _judge(self, t_us: int) -> None:
        rows = list(self._rows)
        found = None
        if rows[-1].square > SUSPICIOUS**2:
            found = self._found(rows[-SHORT_ROWS:]) or self._found(rows[-MIDDLE_ROWS:])
        if found is None:
            found = self._found(rows)
        if found is None:
            self._times, self._without = 0, self._without + 1
            if self._without >= ENDED:
                self.error = None
            return
        self._without = 0
        if found.kind != self._suspected:
            self._suspected, self._times, self._since_us = found.kind, 0, t_us
        self._times += 1
        if self._times >= RAISED[found.kind]:
            self.error = self._raised = found
            if abs(found.rate_factor - self.rate_factor) > RESCALED:
                self.rate_factor = found.rate_factor

    def _found(self, rows: Sequence[_Row]) -> GyroError | None:
        """The error that these rows show."""
        path_rad = changed = square = 0.0
        for row in rows:  # a sum of a generator would cost a call for each
            path_rad += row.values[PATH]
            changed += row.changed
            square += row.square
        values = 3.0 * len(rows)
        changed, misfit = math.sqrt(changed / values), math.sqrt(square / values)
        self._has_agreed |= changed > AGREED * misfit and changed > AGREED * MIN_NOISE
        if misfit < SUSPICIOUS or path_rad < SEEN_RAD:
            return None
        is_gross = misfit > GROSS * changed and path_rad > SCALE_PATH_RAD
        if is_gross and self._is_of_earth and len(rows) <= SHORT_ROWS:
            return _far_too_large(changed, misfit)
        return _compared(rows, path_rad, changed, has_agreed=self._has_agreed)

    def alarms(self, imu: Sensor, t_us: int) -> list[Alarm]:
        """The alarm of its error, if there is one."""
        error = self.error
        if error is None:
            return []
        return [
            Alarm(
                error.kind,
                imu,
                Severity.ERROR,
                error.size,
                "%",
                error.text,
                error.evidence,
                degrades=True,
                since_s=(t_us - self._since_us) * 1e-6,
                is_decided=True,
            )
        ]


def _columns(row: _Row) -> tuple[Sequence[float], ...]:
    """What each unknown adds to a row: three of zero and iron each, the scale, nine of axes."""
    values = [row.share * value for value in row.values[:RATES]]
    products = [[values[PRODUCTS + 3 * of + by] for of in range(3)] for by in range(3)]
    x, y, z = values[FIELDS:RATES]
    turned = (row.values[RATES], row.values[RATES + 1], row.values[RATES + 2])
    zero = [cross((x, y, z), axis) for axis in UNITS]
    iron = [cross(turned, axis) for axis in UNITS]
    axes = [cross((u, v, w), axis) for axis in UNITS for u, v, w in products]
    scale = [a + b + c for a, b, c in zip(axes[0], axes[4], axes[8], strict=True)]
    return (*zero, *iron, scale, *axes)


def _compared(
    rows: Sequence[_Row], path_rad: float, changed: float, *, has_agreed: bool
) -> GyroError | None:
    """The error by which a gyro differs from the field; None if it may be sound."""
    if not _is_steady([row.share for row in rows]):
        return None
    left, columns = _equations(rows)
    model = model_of_one_noise(left, columns)
    scale = _fitted(model, "scale")
    axes = _fitted(model, "axes") if has_agreed else scale
    if path_rad > SCALE_PATH_RAD and scale.noise < min(MAX_NOISE, 1.5 * axes.noise):
        found = _scale_error(scale, path_rad, has_agreed=has_agreed)
        # A zero that moves within some seconds looks like a scale of them.
        if found is not None:
            share = scale.unknowns[SCALE]
            return found if found.is_gross or _lasts(left, columns, share) else None
    if not has_agreed or len(rows) < AXES_ROWS or axes.noise > min(MAX_NOISE, changed / ALIVE):
        return None
    sound = _fitted(model, "sound")
    if sound.noise < max(AXES_MISFIT, MISFIT * axes.noise):
        return None
    variances = axes.found.covariance(range(SCALE + 1, SCALE + 10))
    if any(axes.noise * math.sqrt(variances[i][i]) > AXES_SIGMA for i in range(9)):
        return None
    if _turned(left, columns, axes.unknowns[SCALE + 1 :]) < TURNED * axes.noise:
        return None
    return _axes_error(sound.noise, axes)


def _lasts(left: Sequence[float], columns: Sequence[Sequence[float]], share: float) -> bool:
    """Whether a scale is that of either half of many rows."""
    half = len(left) // 4 * 2
    if half < 3 * MIN_ROWS:
        return False
    for part in (slice(0, half), slice(half, 2 * half)):
        model = model_of_one_noise(left[part], [column[part] for column in columns])
        of_half = _fitted(model, "scale").unknowns[SCALE]
        if not ALIKE < of_half / share < 1.0 / ALIKE:
            return False
    return True


def _turned(
    left: Sequence[float], columns: Sequence[Sequence[float]], axes: Sequence[float]
) -> float:
    """What is left of the changes if the compass is turned in place of these axes."""
    turn = _nearest_rotation([float(i % 4 == 0) + x for i, x in enumerate(axes)])
    if turn is None:
        return math.inf
    known = [0.0, *(x - float(i % 4 == 0) for i, x in enumerate(turn))]
    return _without(left, columns, known)


def _is_sound(rows: Sequence[_Row], error: GyroError) -> bool:
    """Whether rows fit a sound gyro, and not that error."""
    left, columns = _equations(rows)
    sound = _without(left, columns, ()) ** 2
    wrong = _without(left, columns, error.unknowns[SCALE:]) ** 2
    return 0.5 * len(left) * (wrong / sound - 1.0) > SURE


def _without(
    left: Sequence[float], columns: Sequence[Sequence[float]], known: Sequence[float]
) -> float:
    """The noise that zero and iron leave with these values of the other unknowns."""
    rest = list(left)
    for x, column in zip(known, columns[SCALE:], strict=False):
        if x != 0.0:
            rest = [value - x * by for value, by in zip(rest, column, strict=True)]
    return _fitted(model_of_one_noise(rest, columns[:SCALE]), "known").noise


def _equations(rows: Sequence[_Row]) -> tuple[list[float], list[list[float]]]:
    """What is left of all changes, and what each unknown adds to them."""
    left = list(chain.from_iterable(row.left for row in rows))
    columns = [
        list(chain.from_iterable(of_rows)) for of_rows in zip(*map(_columns, rows), strict=True)
    ]
    return left, columns


def _fitted(model: LinearModel, hypothesis: str) -> _Fit:
    found, _, noise = fit_of_unknown_noise(model, PRIORS[hypothesis], NOISES)
    return _Fit(noise, found, found.unknowns())


def _scale_error(fit: _Fit, path_rad: float, *, has_agreed: bool) -> GyroError | None:
    """The error of a gyro that turns a field by 1 + share of its rates; None without one."""
    share = fit.unknowns[SCALE]
    ((variance,),) = fit.found.covariance((SCALE,))
    sigma = fit.noise * math.sqrt(variance)
    is_followed = has_agreed or abs(1.0 + share) > SCALE_SIGMAS * sigma
    if not is_followed or sigma > SCALE_SIGMA or abs(share) < MIN_SCALE + SCALE_SIGMAS * sigma:
        return None
    factor = 1.0 / (1.0 + share) if abs(1.0 + share) > 1.0 / MAX_FACTOR else MAX_FACTOR
    percent = 100.0 * abs(factor - 1.0)
    return GyroError(
        Kind.GYRO_SCALE,
        percent,
        FAR_TOO_LARGE if abs(factor) > FACTOR else f"gyro's scale is off by {percent:.0f} %",
        f"the field turned by {abs(1.0 + share) * path_rad / DEG:.0f} deg of its "
        f"{path_rad / DEG:.0f} deg",
        tuple(fit.unknowns),
        fit.noise,
        1.0 + share if 1.0 / FACTOR < factor < FACTOR else 1.0,
    )


def _far_too_large(changed: float, misfit: float) -> GyroError:
    noise = max(changed, MIN_NOISE)
    return GyroError(
        Kind.GYRO_SCALE,
        100.0 * misfit / noise,
        FAR_TOO_LARGE,
        f"a field of the earth's norm changes by {100.0 * changed:.0f} % of it in half a second, "
        f"by the gyro by {100.0 * misfit:.0f} %",
        (*SCALE * (0.0,), -1.0, *9 * (0.0,)),
        noise,
    )


def _axes_error(misfit: float, fit: _Fit) -> GyroError:
    return GyroError(
        Kind.GYRO_FIELD,
        100.0 * misfit,
        "gyro contradicts field",
        f"a field of the same norm turns by other axes than the gyro: changes of half a second "
        f"differ by {100.0 * misfit:.0f} % of it, by {100.0 * fit.noise:.0f} % with others",
        tuple(fit.unknowns),
        fit.noise,
    )


def _is_steady(shares: Sequence[float]) -> bool:
    """Whether the norm of the field has been the same; by one over it."""
    mean = sum(shares) / len(shares)
    variance = sum((share - mean) ** 2 for share in shares) / len(shares)
    return variance < (STEADY * mean) ** 2


def _nearest_rotation(m: Sequence[float]) -> list[float] | None:
    """The rotation nearest to a matrix, row by row, by Newton's iteration; None if it mirrors."""
    found = list(m)
    for _ in range(ROTATION_STEPS):
        a, b, c, d, e, f, g, h, k = found
        cofactors = (
            *(e * k - f * h, f * g - d * k, d * h - e * g),
            *(c * h - b * k, a * k - c * g, b * g - a * h),
            *(b * f - c * e, c * d - a * f, a * e - b * d),
        )
        determinant = a * cofactors[0] + b * cofactors[1] + c * cofactors[2]
        if determinant <= 0.0:
            return None
        found = [0.5 * (x + y / determinant) for x, y in zip(found, cofactors, strict=True)]
    return found

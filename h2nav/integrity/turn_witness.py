"""Decides which of two gyros that differ has turned as a compass shows.

The field of the earth is fixed in space: turned by what a gyro has turned, an earlier field is the
present one. The share of the difference of both gyros that the fields demand is 0 if the first one
is right and 1 if the second is. It is fitted to the turns of some seconds each. Iron of the
vehicle, which does not turn, is fitted along, since in short turns it resembles a scale, and so is
what is left of the right one's zero.
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from h2nav.integrity.likelihood import NoiseSearch, fit_of_unknown_noise, model_of_one_noise
from h2nav.integrity.sensor_pairs import VOTING_WINDOW_S
from h2nav.maths.quaternion import IDENTITY, Quat, Vec3, conjugate, multiply, rotate, turned
from h2nav.maths.units import DEG
from h2nav.maths.vectors import ZERO, cross, minus, plus, scaled

# A row ends every second and begins eight seconds earlier: by then a difference of gyros exceeds
# the noise of a field.
STEP_WINDOWS = 5
STEPS_OF_ROW = 8
ROWS = 30
MIN_ROWS = 5
# Neither gyro is preferred; what a calibration leaves of iron, as a share of the field, and an
# estimate of a gyro's zero, rad/s.
EXPECTED_SHARE = 0.5
PRIOR_SIGMAS = (2.0, *3 * (0.1,), *3 * (0.1 * DEG,))
# Deviation of one component of a field's change: resolution and noise at the least; beyond the
# most the fields fit no gyro.
NOISES = NoiseSearch(first=0.03, least=0.01, fits=3)
MAX_SIGMA = 0.15
DECIDED = 3.0  # deviations
# A share further from 0 and from 1 shows that neither gyro fits, or that their biases differ.
NEAR = 0.3
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class _Seen(NamedTuple):
    """A field, and what both gyros had turned by then."""

    field: Vec3
    turns: tuple[Quat, Quat]
    windows: int  # since the one before


class _Row(NamedTuple):
    """The change of a field, as a share of its norm."""

    left: Vec3  # measured minus turned by the first gyro
    by_second: Vec3  # what the second gyro adds to that turn
    by_iron: tuple[Vec3, Vec3, Vec3]  # what iron along each axis adds
    by_zero: tuple[Vec3, Vec3, Vec3]  # what a rate that both gyros miss adds, per rad/s


class TurnWitness:
    """Judges two gyros, since they differ.

    Args:
        zero: of the first, as estimated until then, rad/s.
        zero_of_second: of the second.
    """

    def __init__(self, zero: Vec3, zero_of_second: Vec3) -> None:
        self._zeros = zero, zero_of_second
        self._rows: deque[_Row] = deque(maxlen=ROWS)
        self._seen: deque[_Seen] = deque(maxlen=STEPS_OF_ROW + 1)
        self._turns: tuple[Quat, Quat] = IDENTITY, IDENTITY  # of both gyros since the beginning
        self._windows, self._newest = 0, 0
        # The wrong one (0, 1), and the ratio of its evidence to what is enough.
        self.wrong: tuple[int, float] | None = None

    def take(self, number: int, first: Vec3, second: Vec3, field: Vec3 | None) -> None:
        """Takes a window of both.

        Args:
            number: of the window.
            first: mean rate of the first gyro, rad/s.
            second: of the second.
            field: the last one of the window, of any unit; None: there was none.
        """
        if number != self._newest + 1:
            self._seen.clear()
        one, other = (
            turned(turn, scaled(VOTING_WINDOW_S, minus(rate, zero)))
            for turn, rate, zero in zip(self._turns, (first, second), self._zeros, strict=True)
        )
        self._turns, self._newest, self._windows = (one, other), number, self._windows + 1
        if field is None or not any(field) or self._windows < STEP_WINDOWS:
            return
        self._seen.append(_Seen(field, self._turns, self._windows))
        self._windows = 0
        if len(self._seen) > 1:
            self._rows.append(_row(self._seen))
            self.wrong = _judged(self._rows) if len(self._rows) >= MIN_ROWS else None


def _row(seen: Sequence[_Seen]) -> _Row:
    begun, ended = seen[0], seen[-1]
    back, back_by_second = (
        multiply(conjugate(now), then) for now, then in zip(ended.turns, begun.turns, strict=True)
    )
    share = 1.0 / math.hypot(*begun.field)
    expected = rotate(back, begun.field)
    x, y, z = (minus(axis, rotate(back, axis)) for axis in AXES)
    return _Row(
        scaled(share, minus(ended.field, expected)),
        scaled(share, minus(rotate(back_by_second, begun.field), expected)),
        (x, y, z),
        _by_zero(seen, share),
    )


def _by_zero(seen: Sequence[_Seen], share: float) -> tuple[Vec3, Vec3, Vec3]:
    found = [ZERO, ZERO, ZERO]
    for then, after in pairwise(seen):
        back = multiply(conjugate(seen[-1].turns[0]), then.turns[0])
        for i, axis in enumerate(AXES):
            turns = rotate(back, cross(then.field, axis))
            found[i] = plus(found[i], scaled(share * VOTING_WINDOW_S * after.windows, turns))
    return found[0], found[1], found[2]


def _judged(rows: Sequence[_Row]) -> tuple[int, float] | None:
    columns = [[x for row in rows for x in row.by_second]]
    columns += [[x for row in rows for x in row.by_iron[i]] for i in range(3)]
    columns += [[x for row in rows for x in row.by_zero[i]] for i in range(3)]
    left = [
        x - EXPECTED_SHARE * d for row in rows for x, d in zip(row.left, row.by_second, strict=True)
    ]
    model = model_of_one_noise(left, columns)
    fit, noise, sigma = fit_of_unknown_noise(model, PRIOR_SIGMAS, NOISES)
    if sigma > MAX_SIGMA:
        return None
    share = EXPECTED_SHARE + fit.unknowns()[0]
    ((variance,),) = fit.covariance((0,))
    ratio = abs(share - EXPECTED_SHARE) / (DECIDED * noise * math.sqrt(variance))
    wrong = 0 if share > EXPECTED_SHARE else 1
    is_near = abs(share - (1.0 - wrong)) < NEAR
    return (wrong, ratio) if is_near and ratio > 1.0 else None

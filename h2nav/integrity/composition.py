"""A window of velocity rows as columns of a linear model: the arithmetic, on arrays of doubles.

The extension has the same function (`native/likelihood.c`), with the same bits.

Equations: docs/integrity.md, section 5.
"""

from array import array
from collections.abc import Iterable, Sequence

from h2nav.attitude.samples import Vec3

# Turns in order: the gyro's bias and its scale (three axes each), the bias that was used.
TURNS = 7
USED = 6
# Vectors of a row in order.
GAINED, TURNED, BENT, PUSHED, VECTORS = 0, 1, 1 + TURNS, 1 + 2 * TURNS, 3 + 2 * TURNS
# Of a row as measured, north and east each: the change of velocity, and the effects of latency, of
# half its square and of the antenna's place along three axes.
MEASURED = 12
# What is left to explain, and the effects of all unknowns (`velocity_rows.columns`).
COLUMNS = 17


def compose(
    to_n: "array[float]",
    known: "array[float]",
    integrals: "array[float]",
    measured: "array[float]",
    found: "tuple[array[float], array[float], array[float], array[float]]",
) -> None:
    """Composes a window of its rows.

    Args:
        to_n: (9,) the axes north, east and down at the window's beginning, in s.
        known: (5,) bias of the gyro, rad/s, and of the accelerometer in x and y, m/s^2, then.
        integrals: (VECTORS vectors) of each row; see `velocity_rows.VelocityRow`.
        measured: (MEASURED,) of each row.
        found: written: COLUMNS columns, each north of all rows and then east; gained velocity of
            each row, NED, m/s; three turns to each row, and TURNS to the end, NED.
    """
    table, gained, turns, in_all = found
    axes = vectors(to_n)
    (a, b, c), (d, e, f), _ = axes
    rows = len(measured) // MEASURED
    turned: list[Vec3] = [(0.0, 0.0, 0.0)] * TURNS
    for row in range(rows):
        own = vectors(integrals[3 * VECTORS * row : 3 * VECTORS * (row + 1)])
        x, y, z = own[GAINED]
        g = _in_n(axes, own[GAINED])
        moved = [
            (u + (q * z - r * y), v + (r * x - p * z), w + (p * y - q * x))
            for (p, q, r), (u, v, w) in zip(turned, own[BENT:PUSHED], strict=True)
        ]
        moved += own[PUSHED:]
        norths = [a * u + b * v + c * w for u, v, w in moved]
        easts = [d * u + e * v + f * w for u, v, w in moved]
        tilts = ((0.0, g[2], -g[1]), (-g[2], 0.0, g[0]))
        for axis, (bent, tilt) in enumerate(zip((norths, easts), tilts, strict=True)):
            change, *by_receiver = measured[MEASURED * row + axis : MEASURED * (row + 1) : 2]
            expected = 0.0 + known[0] * bent[0] + known[1] * bent[1] + known[2] * bent[2]
            expected = expected - bent[USED] + (known[3] * bent[TURNS] + known[4] * bent[TURNS + 1])
            left = change - g[axis] - expected
            effects = (left, *tilt, *bent[:USED], *bent[TURNS:], *by_receiver)
            table[axis * rows + row :: 2 * rows] = array("d", effects)
        gained[3 * row : 3 * row + 3] = array("d", g)
        flat = [part for turn in turned[:3] for part in _in_n(axes, turn)]
        turns[9 * row : 9 * row + 9] = array("d", flat)
        more = zip(turned, own[TURNED:BENT], strict=True)
        turned = [(p + u, q + v, r + w) for (p, q, r), (u, v, w) in more]
    in_all[:] = array("d", [part for turn in turned for part in _in_n(axes, turn)])


def vectors(flat: Iterable[float]) -> list[Vec3]:
    """The vectors that stand one after the other."""
    numbers = iter(flat)
    return list(zip(numbers, numbers, numbers, strict=True))


def _in_n(axes: Sequence[Vec3], v: Vec3) -> Vec3:
    (a, b, c), (d, e, f), (g, h, i) = axes
    x, y, z = v
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z

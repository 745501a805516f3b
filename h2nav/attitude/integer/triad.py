"""Attitude from gravity and field (TRIAD, gravity first) in 32-bit integers, without a division.

Source: docs/fixed-point.md Eq. (10) to (12).
"""

from h2nav.maths.fixedpoint import I32, clamp, known

UNIT_Q14 = 1 << 14
MIN_NORM_Q26 = 1 << 24  # a quarter: the least squared norm that is scaled to one
VECTOR_LIMIT = 20480  # 1.25 in Q14
UNIT_LIMIT = UNIT_Q14 + 64  # a unit vector after rounding
Q_LIMIT = 32767 << 14  # Q29; rounds to 32767 in Q15
FOURFOLD_LIMIT = 4 * UNIT_LIMIT


def inverse_root(norm: I32) -> I32:
    """1 / sqrt(norm), Q14, for norm from 1/4 to 3/2, Q26; Newton from 1.

    Source: docs/fixed-point.md Eq. (10).
    """
    root = 1 << 14
    x = clamp(norm, MIN_NORM_Q26, 3 << 25) >> 12
    for _ in range(7):
        square = (root * root + 8192) >> 14
        rest = (3 << 14) - ((x * square + 8192) >> 14)
        root = clamp((root * clamp(rest, 0, 3 << 14) + 16384) >> 15, 8192, 32767)
    return root


def squared(v: list[I32]) -> I32:
    """Squared norm of a Q14 vector, Q26."""
    return (v[0] >> 1) * (v[0] >> 1) + (v[1] >> 1) * (v[1] >> 1) + (v[2] >> 1) * (v[2] >> 1)


def scaled(v: list[I32], root: I32) -> None:
    """Brings a vector to length one; `root` is the inverse of its length, Q14."""
    for i in range(3):
        v[i] = known((v[i] * root + 8192) >> 14, -UNIT_LIMIT, UNIT_LIMIT)  # Lemma 4


def cross(a: list[I32], b: list[I32], c: list[I32]) -> None:
    """Writes a x b of Q14 vectors into c; one of them is a unit vector."""
    # no longer than the longer of the two (Lemma 4)
    c[0] = known((a[1] * b[2] - a[2] * b[1] + 8192) >> 14, -VECTOR_LIMIT, VECTOR_LIMIT)
    c[1] = known((a[2] * b[0] - a[0] * b[2] + 8192) >> 14, -VECTOR_LIMIT, VECTOR_LIMIT)
    c[2] = known((a[0] * b[1] - a[1] * b[0] + 8192) >> 14, -VECTOR_LIMIT, VECTOR_LIMIT)


def triad(g: list[I32], f: list[I32], q: list[I32]) -> I32:
    """Writes the attitude that gravity and field show, Q2.29, a little shorter than one.

    Args:
        g: opposite of the specific force over gravity, body frame, Q14; becomes a unit vector.
        f: anything that shows north when gravity is taken away, body frame, Q14.
        q: result, scalar first.

    Returns:
        1, or 0 when the vectors show no heading.

    Source: docs/fixed-point.md Eq. (11), (12).
    """
    east = [0, 0, 0]
    north = [0, 0, 0]
    scaled(g, inverse_root(squared(g)))
    cross(g, f, east)
    for _ in range(5):
        if squared(east) < MIN_NORM_Q26:
            for i in range(3):
                east[i] = known(east[i] * 2, -VECTOR_LIMIT, VECTOR_LIMIT)  # shorter than a half
    if squared(east) < MIN_NORM_Q26:
        return 0
    scaled(east, inverse_root(squared(east)))
    cross(east, g, north)
    quaternion(north, east, g, q)
    return 1


def quaternion(north: list[I32], east: list[I32], down: list[I32], q: list[I32]) -> None:
    """Writes the attitude of the matrix with these rows; the largest element is taken first.

    Source: docs/fixed-point.md Eq. (12).
    """
    w = UNIT_Q14 + north[0] + east[1] + down[2]
    x = UNIT_Q14 + north[0] - east[1] - down[2]
    y = UNIT_Q14 - north[0] + east[1] - down[2]
    z = UNIT_Q14 - north[0] - east[1] + down[2]
    wx = down[1] - east[2]
    wy = north[2] - down[0]
    wz = east[0] - north[1]
    xy = north[1] + east[0]
    xz = north[2] + down[0]
    yz = east[2] + down[1]
    if w >= x and w >= y and w >= z:
        normalised(w, wx, wy, wz, q)
    elif x >= y and x >= z:
        normalised(wx, x, xy, xz, q)
    elif y >= z:
        normalised(wy, xy, y, yz, q)
    else:
        normalised(wz, xz, yz, z, q)


def normalised(w: I32, x: I32, y: I32, z: I32, q: list[I32]) -> None:
    """Writes four numbers of norm 2 to 4, Q14, as a quaternion of norm just below one, Q29."""
    # four times a unit quaternion (Lemma 4)
    q[0] = known(w, -FOURFOLD_LIMIT, FOURFOLD_LIMIT)
    q[1] = known(x, -FOURFOLD_LIMIT, FOURFOLD_LIMIT)
    q[2] = known(y, -FOURFOLD_LIMIT, FOURFOLD_LIMIT)
    q[3] = known(z, -FOURFOLD_LIMIT, FOURFOLD_LIMIT)
    norm = 0
    for i in range(4):
        norm += (q[i] >> 2) * (q[i] >> 2)
    root = inverse_root(norm >> 2)
    # 2^-9 below one, so that rounding cannot bring it above
    root = (root - (root >> 9)) >> 1
    for i in range(4):
        q[i] = known(q[i] * root, -Q_LIMIT, Q_LIMIT)

"""Arithmetic that a 32-bit machine lacks: wide products, quotients, logarithms, polar coordinates.

No product is wider than 32 bits and nothing is divided. Logarithms are to base two with 8 bits of
fraction ("Q8"): noises and levels span ten decades, need one percent, and their products, powers
and roots become sums, multiples and halves.

Source: docs/fixed-point.md Eq. (15) to (19).
"""

from h2nav.maths.fixedpoint import I32, clamp, known

HALF_TURN_Q28 = 843314857  # pi
ARC_TANGENTS_Q28 = (
    210828714,
    124459457,
    65760959,
    33381290,
    16755422,
    8385879,
    4193963,
    2097109,
    1048571,
    524287,
    262144,
    131072,
    65536,
    32768,
)
TURNS = 14
TURNS_OF_LENGTH = 8
CORDIC_GAIN_Q15 = 19898  # what the turns have lengthened, undone
LONGEST = 1 << 30  # factor of a product, argument of a limit
LARGEST_LOG_Q8 = 7679  # just below 2^30


def limited(x: I32, most: I32) -> I32:
    """`x` moved into [-most, most]; `clamp` needs a spare bit, this does not."""
    if x > most:
        return most
    if x < -most:
        return -most
    return x


def product(a: I32, b: I32) -> I32:
    """Product a b / 2^15 of a 31-bit and a 16-bit factor, rounded down, made of two halves.

    Source: docs/fixed-point.md Eq. (15).
    """
    return (a >> 15) * b + (((a & 32767) * b) >> 15)


def square_q28(x: I32) -> I32:
    """Square over 2^28 of a number of at most 2^29, made of its halves; wrong by less than 2."""
    high = x >> 14
    return known(high * high + ((high * (x & 16383)) >> 13), -1, LONGEST)  # Lemma 14


def shifted(x: I32, n: I32) -> I32:
    """Quotient x / 2^n for n from -12 to 31; what would grow beyond 30 bits is limited before."""
    if n >= 0:
        return x >> n
    if n >= -4:
        return limited(x, LONGEST >> 4) << -n
    return limited(x, LONGEST >> 12) << known(-n, 0, 12)


def bits_of(x: I32) -> I32:
    """Number of binary digits of x >= 0."""
    bits = 0
    if x >= 1 << 16:
        bits = 16
        x = x >> 16
    if x >= 1 << 8:
        bits += 8
        x = x >> 8
    if x >= 1 << 4:
        bits += 4
        x = x >> 4
    if x >= 1 << 2:
        bits += 2
        x = x >> 2
    if x >= 1 << 1:
        bits += 1
        x = x >> 1
    return bits + x


def mantissa(x: I32, bits: I32) -> I32:
    """A number x > 0 of so many digits, scaled to 15 digits."""
    scaled_up = known(x, 0, 32767) << (15 - bits) if bits < 15 else x >> (bits - 15)
    return known(scaled_up, 1 << 14, 32767)


def reciprocal(m: I32) -> I32:
    """2^29 / m for m of 15 digits; two steps of Newton from a straight line.

    Source: docs/fixed-point.md Eq. (16).
    """
    root = 47747 - m
    for _ in range(2):
        root = clamp((root * (32768 - ((m * root) >> 15)) + 8192) >> 14, 1 << 14, 1 << 15)
    return root


def ratio(a: I32, b: I32) -> I32:
    """A / b, Q15, for a >= 0 and b > 0; at most 32767.

    Source: docs/fixed-point.md Eq. (16).
    """
    if a >= b:
        return 32767
    bits = bits_of(b)
    # a is less than b, which gets 15 digits
    part = known(a, 0, 32767) << (15 - bits) if bits < 15 else a >> (bits - 15)
    return clamp((known(part, 0, 32767) * reciprocal(mantissa(b, bits))) >> 14, 0, 32767)


def signed_ratio(a: I32, b: I32) -> I32:
    """A / b, Q15, for b > 0; at most 32767 in size."""
    share = ratio(abs(a), b)
    if a < 0:
        return -share
    return share


def logarithm(x: I32) -> I32:
    """Logarithm of x > 0 to base two, Q8, wrong by at most 0.017.

    Source: docs/fixed-point.md Eq. (17).
    """
    bits = bits_of(x)
    rest = (mantissa(x, bits) - (1 << 14)) >> 6
    return ((bits - 1) << 8) + rest + ((rest * (256 - rest) * 88) >> 16)


def power2(exponent: I32) -> I32:
    """Two to the power of a Q8 exponent, rounded down, wrong by at most 0.33 %; at most 2^30.

    Source: docs/fixed-point.md Eq. (17).
    """
    if exponent < 0:
        return 0
    if exponent > LARGEST_LOG_Q8:
        exponent = LARGEST_LOG_Q8
    rest = exponent & 255
    m = (1 << 14) + ((rest * (10756 + 22 * rest)) >> 8)
    if exponent >= 14 << 8:
        return m << ((exponent >> 8) - 14)
    return m >> (14 - (exponent >> 8))


def polar(x: I32, y: I32, result: list[I32]) -> None:
    """Writes the length of (x, y) and its angle (rad, Q28) by turns of shrinking size.

    The length is wrong by at most 6, the angle by 1.3e-4 rad where the length is above 1000.

    Args:
        x: less than 2^17 in size.
        y: the same.
        result: length, angle.

    Source: docs/fixed-point.md Eq. (18).
    """
    angle = 0
    if x < 0:
        angle = HALF_TURN_Q28
        if y < 0:
            angle = -HALF_TURN_Q28
        x = -x
        y = -y
    x = x << 10
    y = y << 10
    for i in range(TURNS):
        sign = y >> 31
        to_x = ((y >> i) ^ sign) - sign
        y -= ((x >> i) ^ sign) - sign
        x += to_x
        angle += (ARC_TANGENTS_Q28[i] ^ sign) - sign
    # 1.65 times a length below 2^27.5
    result[0] = product(known(x, 0, LONGEST), CORDIC_GAIN_Q15) >> 10
    result[1] = angle


def length(x: I32, y: I32) -> I32:
    """Length of (x, y), x >= 0, both less than 2^17 in size; wrong by at most 12.

    Half as many turns do: what is left of y counts by its square.

    Source: docs/fixed-point.md Eq. (18).
    """
    x = x << 10
    y = y << 10
    for i in range(TURNS_OF_LENGTH):
        sign = y >> 31
        to_x = ((y >> i) ^ sign) - sign
        y -= ((x >> i) ^ sign) - sign
        x += to_x
    return product(known(x, 0, LONGEST), CORDIC_GAIN_Q15) >> 10

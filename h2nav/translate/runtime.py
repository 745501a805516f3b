"""The C forms of the integer operations that C does not define for negative numbers.

They are the counterparts of Python's ``>>``, ``abs`` and `h2nav.maths.fixedpoint.clamp`. Most
compilers make no branch of them, so a step takes the same number of instructions whatever the
samples are.
"""

from collections.abc import Collection
from typing import Final

# name -> text; the arguments stay within what the range analysis has proved
RUNTIME: Final[dict[str, str]] = {
    f"{name}_{bits}": text.replace("BITS", str(bits)).replace("TOP", str(bits - 1))
    for bits in (32, 64)
    for name, text in {
        "shift_right": """\
/* x / 2^n, rounded towards minus infinity: one arithmetic shift where compilers have it. */
static inline intBITS_t shift_right_BITS(intBITS_t x, int32_t n)
{
    return -1 >> 1 == -1 || x >= 0 ? x >> n : ~(~x >> n);
}
""",
        "magnitude": """\
/* Absolute value, without a branch. */
static inline intBITS_t magnitude_BITS(intBITS_t x)
{
    const intBITS_t sign = shift_right_BITS(x, TOP);
    return (x ^ sign) - sign;
}
""",
        "at_most": """\
/* The lesser, without a branch; x - high fits BITS bits. */
static inline intBITS_t at_most_BITS(intBITS_t x, intBITS_t high)
{
    const intBITS_t above = x - high;
    return x - (above & ~shift_right_BITS(above, TOP));
}
""",
        "at_least": """\
/* The greater, without a branch; x - low fits BITS bits. */
static inline intBITS_t at_least_BITS(intBITS_t x, intBITS_t low)
{
    const intBITS_t over = x - low;
    return x - (over & shift_right_BITS(over, TOP));
}
""",
        "clamp": """\
/* x moved into [low, high], without a branch; x - low and x - high fit BITS bits. */
static inline intBITS_t clamp_BITS(intBITS_t x, intBITS_t low, intBITS_t high)
{
    const intBITS_t above = x - high;
    const intBITS_t limited = x - (above & ~shift_right_BITS(above, TOP));
    const intBITS_t over = limited - low;
    return limited - (over & shift_right_BITS(over, TOP));
}
""",
    }.items()
}


def operations(names: Collection[str]) -> list[str]:
    """Texts of the named operations and of those that they call, callees first."""
    callers = "".join(RUNTIME[name] for name in names)
    return [text for name, text in RUNTIME.items() if name in names or f"{name}(" in callers]

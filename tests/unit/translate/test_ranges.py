"""What is proved of a kernel is what Python reaches, and what cannot be proved is refused."""

import itertools

import pytest

from h2nav.translate.facts import FLOAT, Facts
from h2nav.translate.intervals import Interval
from h2nav.translate.ranges import analyse
from h2nav.translate.source import KernelSource, Untranslatable, read_kernel

X, Y = Interval(-3, 5), Interval(0, 4)
HEAD = f"""from h2nav.maths.fixedpoint import I16, I32, clamp, known

SIZE = 3
SHARE = 0.75
TABLE = (3, -5, 7)
WIDE = (1 << 31, 0)
SHARES = (0.5, 1.5)


def half(x: I16) -> I32:
    if x < 0:
        return -(-x >> 1)
    return x >> 1


def put(a: list[int], x: I16) -> None:
    if x > 2:
        a[1] = 7
        return
    a[1] = x


def bump(a: list[int]) -> I32:
    a[0] = a[0] + 1
    return a[0]


def step(x: I16, y: I16) -> I32:
    x = known(x, {X.lo}, {X.hi})
    y = known(y, {Y.lo}, {Y.hi})
"""

CARRIED = """for i in range(3):
    if i > 0:
        z = z + 1
    else:
        z = 0"""
CARRIED_LIST = """for i in range(3):
    if i == 0:
        a = [0]
    a[0] = i"""


def facts(body: str) -> Facts:
    lines = "".join(f"    {line}\n" for line in body.splitlines())
    return analyse(read_kernel([KernelSource("kernel.py", HEAD + lines)]), ["step"])


def reached(body: str) -> Interval:
    """All that Python returns."""
    scope: dict = {}
    exec(HEAD + "".join(f"    {line}\n" for line in body.splitlines()), scope)
    inputs = itertools.product(range(X.lo, X.hi + 1), range(Y.lo, Y.hi + 1))
    found = [scope["step"](x, y) for x, y in inputs]
    return Interval(min(found), max(found))


@pytest.mark.parametrize(
    "body",
    [
        "return 7",
        "return SIZE + x",
        "return x - y",
        "return x * y",
        "return x * x",
        "return -x",
        "return ~x",
        "return abs(x)",
        "return abs(y)",
        "return x << 3",
        "return x << y",
        "return x >> 1",
        "return x >> y",
        "return (x & -(y >> 2)) + 0",
        "return (x | -(y >> 2)) + 0",
        "return (x ^ -(y >> 2)) + 0",
        "return clamp(x, -1, 2)",
        "return clamp(x, 1, 1)",
        "return clamp(x, y - 9, y + 2)",
        "return TABLE[1] + TABLE[0]",
        "return TABLE[y >> 2]",
        "return half(x)",
        "return half(x) + half(y)",
        # a function that a test calls writes once on either path
        "a = [0]\nif bump(a) > 0:\n    return a[0]\nreturn 1",
        "a = [0]\nif x > 0 or bump(a) > 9:\n    return 1\nreturn a[0]",
        "a = [0]\nif bump(a) > 9 or x > 0:\n    return a[0]\nreturn a[0]",
        "a = [0]\nz = a[0] if bump(a) > 0 else 1\nreturn z",
        "a = [0]\nif a[0] < bump(a):\n    return a[0]\nreturn 1",
        "a = [0, 0]\na[1] = 1 if bump(a) > 0 else 2\nreturn a[0]",
        # what a comparison leaves of its operands, on either side
        "return x if x < 2 else 0",
        "return x if x <= 2 else 0",
        "return x if x > 2 else 4",
        "return x if x >= 2 else 4",
        "return x if x == 2 else 3",
        "return x if 2 > x else 0",
        "return x if 2 >= x else 0",
        "return x if 2 < x else 4",
        "return x if 2 <= x else 4",
        "return 3 if x < 2 else x",
        "return 3 if x <= 2 else x",
        "return 0 if x > 2 else x",
        "return 0 if x >= 2 else x",
        "return 0 if x != 2 else x",
        "return x if x != 5 else 0",
        "return x if x != -3 else 0",
        "return x if x != 1 else 0",
        "return x if x < y else 0",
        "return x if x <= y else 0",
        "return y if y < x else 0",
        "return y if x < y - 3 else 0",
        "return x if not x < 2 else 4",
        "return x if -1 <= x and x <= 3 else 0",
        "return 0 if x < -1 or x > 3 else x",
        "return x if x < -1 or x > 3 and y > 1 else -2",
        "return x if x < -1 or x == 0 or x == 1 else 0",
        "return x if not (x < -1 or x > 3) else 0",
        "return 0 if not (x > -1 and x < 3) else x",
        # a branch that is never taken gives nothing
        "return x if y >= 0 else 1000",
        "return 1000 if y > 4 else x",
        "return 1000 if x == 9 else x",
        "return x if y <= 4 and x <= 5 else 1000",
        "if y < 0:\n    x = 1000\nreturn x",
        "if x > 2:\n    return 2\nreturn x",
        "if x > 2:\n    return x\nelif x < 0:\n    return 1\nreturn x",
        "if x > 2:\n    x = 2\nelse:\n    x += y\nreturn x",
        "z = 9\nif y > 4:\n    z = 10\nelse:\n    z = 8\nreturn z",
        # loops, pass by pass
        "z = 0\nfor i in range(SIZE):\n    z += i\nreturn z",
        "z = 0\nfor i in range(2, 5):\n    z -= i * y\nreturn z",
        "z = 0\nfor i in range(0):\n    z = 9\nreturn z",
        "for i in range(9):\n    if y >= 0:\n        return i\nreturn 5",
        "for i in range(9):\n    if y == i:\n        return i\nreturn 5",
        # elements
        "a = [x, y]\nreturn a[0]",
        "a = [x, y]\na[0] = 7\nreturn a[0] - a[1]",
        "a = [2] * 3\nreturn a[2]",
        "a = [x, 9, 9]\na[1] = y + 3\nreturn a[clamp(x, 0, 1)]",
        "a = [5, 5, 5]\na[clamp(x, 0, 1)] = 8\nreturn a[0]",
        "a = [5, 5, 5]\na[clamp(x, 0, 1)] = 8\nreturn a[1]",
        "a = [5, 5, 5]\na[clamp(x, 0, 1)] = 8\nreturn a[2]",
        "a = [1, 2]\nif a[0] < 2:\n    return 1\nreturn 0",
        "a = [x, 2]\nif a[0] < 2:\n    return a[0]\nreturn 0",
        "a = [1, 2, 3]\nput(a, y)\nreturn a[0] * 10 + a[1]",
        "a = [x, 2]\nif y > 1:\n    a[1] = 4\nreturn a[1]",
        "'a text'\npass\nreturn x",
    ],
)
def test_what_is_proved_is_exactly_what_python_reaches(body: str) -> None:
    assert facts(body).functions["step"].result == reached(body)


@pytest.mark.parametrize(
    "body",
    [
        "return x * (x - 1)",
        "return x & y",
        "return x | y",
        "return x ^ y",
        "return y & (y + 3)",
        "return x if -1 < x < 3 else 0",
        "return x if not -1 < x < 3 else 0",
        "return x - x if x != y else x",
        "a = [x, 2]\na[y >> 2] = 1\nreturn a[0]",
    ],
)
def test_what_python_reaches_is_proved_where_the_rules_are_wider(body: str) -> None:
    assert reached(body).within(facts(body).functions["step"].result)


@pytest.mark.parametrize(
    "body",
    [
        "return float(x)",
        "return SHARE",
        "return SHARE * x - 1.0",
        "return 1 / SHARE + y",
        "return -SHARE",
        "return math.pi",
        "return SHARES[y >> 2]",
        "return math.sqrt(SHARE)",
        "return math.atan2(SHARE, 1.0)",
        "a = [0.0] * 2\na[1] = x\nreturn a[0]",
        "return SHARE if x > 0 else 2.0",
        "return SHARE if SHARE > x else 2.0",
        "z = 1.0\nz += x << 49\nreturn z",
    ],
)
def test_floats_are_a_kind_without_a_range(body: str) -> None:
    assert facts(body).functions["step"].result is FLOAT


@pytest.mark.parametrize(
    ("just_enough", "too_much", "reason"),
    [
        ("z = y << 60", "z = y << 61", "may need 65 bits (reaches 0..9223372036854775808)"),
        ("z = -1 << 62", "z = -1 << 63", "shift by 63..63"),
        ("z = 1 << (y + 26)", "z = 1 << (y + 27)", "shift by 27..31"),
        ("z = 1 << y", "z = 1 << (y - 1)", "shift by -1..3"),
        ("z = x >> 31", "z = x >> 32", "shift of a 4-bit value by 32..32"),
        ("z = (y << 31) >> 63", "z = (y << 31) >> 64", "shift of a 35-bit value by 64..64"),
        ("z = (x << 29) >> 32", "z = (x << 28) >> 32", "shift of a 32-bit value by 32..32"),
        ("z = x >> y", "z = x >> (y - 1)", "shift of a 4-bit value by -1..3"),
        ("z = clamp(x, y - 4, 0)", "z = clamp(x, y - 3, 0)", "lower limit may lie above"),
        ("a = [1] * 5\nz = a[y]", "a = [1] * 4\nz = a[y]", "index 0..4 leaves 0..3"),
        ("a = [1] * 4\nz = a[y - 0 >> 1]", "a = [1]\nz = a[-1]", "index -1..-1 leaves 0..0"),
        ("a = [1]\na[0] = -1 << 31", "a = [1]\na[0] = 1 << 31", "in a 32-bit element"),
        ("a = [-1 << 31]", "a = [1 << 31]", "an array of integers holds 32-bit values"),
        ("z = half(y << 12)", "z = half(y << 13)", "x of half may be 0..32768, outside its"),
        ("for i in range(4096):\n    z = i", "for i in range(4097):\n    z = i", "4096 passes"),
        ("for i in range(9, 4105):\n    z = i", "for i in range(9, 4106):\n    z = i", "passes"),
        ("z = SHARE * ((1 << 53) - 1)", "z = SHARE * (1 << 53)", "too wide to become a float"),
        ("z = 2.0 if (1 << 52) > SHARE else 1.0", "z = 2.0 if (1 << 53) > SHARE else 1.0", "wide"),
        ("z = 2.0 if SHARE < y else 1.0", "z = 2.0 if SHARE < (1 << 53) else 1.0", "too wide"),
        ("a = [0.5]\na[0] = y", "a = [0.5]\na[0] = 1 << 53", "too wide to become a float"),
        ("a = [0.5]\na[0] = y", "a = [1]\na[0] = 0.5", "a float is stored in an array of integ"),
        ("a = [0.5, 1.0]", "a = [0.5, 1]", "mixes integers and floats"),
        ("a = [1]\na = [2]", "a = [1]\na = [2, 3]", "a changes its kind or length"),
        ("a = [1]\na = [2]", "a = [1]\na = [0.5]", "a changes its kind or length"),
        ("z = 1\nz = 2", "z = 1\nz = 0.5", "is sometimes an integer, sometimes a float"),
        ("z = 1", "TABLE = 1", "TABLE already names something else"),
        ("z = 1", "SIZE = 1", "SIZE already names something else"),
        ("a = [1]\na[0] = 1", "TABLE[0] = 1", "a constant table is written"),
        ("z = 1", "x, y = y, x", "only names, elements and fields"),
        ("a = [1, 1]\nput(a, x)", "put(x, x)", "put needs an array for a"),
        ("a = [1, 1]\nput(a, x)", "a = [0.5, 1.0]\nput(a, x)", "put needs an array for a"),
        ("z = half(x)", "z = half(x, y)", "half takes 1 plain arguments"),
        ("half(x)", "half(x=y)", "half takes 1 plain arguments"),
        ("z = half(x)", "z = half(0.5)", "wrong kind of number for x of half"),
        ("a = [1, 1]\nput(a, x)", "a = [1, 1]\nz = put(a, x)", "put returns nothing"),
        ("half(x)", "quarter(x)", "call of quarter is outside the subset"),
        ("z = math.sqrt(SHARE)", "z = math.sqrt(SHARE, SHARE)", "with 2 arguments is not known"),
        ("z = math.sqrt(SHARE)", "z = math.sqrt(x)", "math.sqrt of an integer"),
        ("z = math.sqrt(SHARE)", "z = math.cbrt(SHARE)", "math.cbrt with 1 arguments"),
        ("z = abs(x)", "z = abs(SHARE)", "an integer is needed here"),
        ("z = SHARE / x", "z = SHARE // x", "FloorDiv is outside the subset of floats"),
        ("z = x * y", "z = x / y", "Div is outside the subset of integers"),
        ("z = ~x", "z = ~SHARE", "Invert is outside the subset here"),
        ("z = 1 if x < y else 2", "z = 1 if x in y else 2", "In is outside the subset"),
        ("z = 1 if y != 1 else 2", "z = 1 if y & 1 else 2", "a test is a comparison"),
        ("z = 1 if x < y else 2", "z = 1 if x < y else 0.5", "is sometimes an integer"),
        ("z = x", "z = TABLE", "TABLE is not a number that is set on every path"),
        ("for i in range(3):\n    z = i", "for i in range(3):\n    z = i\nz = i", "i is not a"),
        ("for i in range(3):\n    z = i", "for i in range(0, 3, 1):\n    z = i", "a loop runs ove"),
        ("for i in range(3):\n    z = i", "for i in range(y):\n    z = i", "bounds of a loop are"),
        # C declares what only a loop's body mentions anew in each pass, and its own counter
        ("z = 0\nfor i in range(3):\n    z = z + i", CARRIED, "z is not a number that is set on"),
        ("a = [0]\nfor i in range(3):\n    a[0] = i", CARRIED_LIST, "a is not set on every path"),
        ("for i in range(3):\n    z = i", "for i in range(3):\n    i = 2", "variable of a loop"),
        ("a = [0]\nz = a[0]", "if x > 0:\n    a = [0]\nz = a[0]", "a is not set on every path"),
        ("a = [0, 0]\nput(a, x)", "if x > 0:\n    a = [0, 0]\nput(a, x)", "needs an array for a"),
        ("z = TABLE[0]", "z = WIDE[0]", "only arrays may be subscripted"),
        ("z = 1 if 0 < half(x) else 2", "z = 1 if 0 < half(x) < 2 else 2", "which C makes twice"),
    ],
)
def test_what_is_just_provable_and_what_is_just_not(
    just_enough: str, too_much: str, reason: str
) -> None:
    assert facts(f"{just_enough}\nreturn x").functions["step"].result == X
    with pytest.raises(Untranslatable) as refusal:
        facts(f"{too_much}\nreturn x")
    assert reason in str(refusal.value)


@pytest.mark.parametrize(
    "returns",
    ["if x > 0:\n    return 1", "if x > 0:\n    return 1\nreturn 0.5"],
)
def test_every_path_returns_a_number_of_one_kind(returns: str) -> None:
    with pytest.raises(Untranslatable):
        facts(returns)


def test_facts_are_hulls_over_all_calls_and_passes() -> None:
    found = facts("for i in range(SIZE):\n    z = i - 1\nreturn half(x) + half(y + 20) + TABLE[0]")
    assert list(found.functions) == ["half", "step"]
    half, step = found.functions["half"], found.functions["step"]
    assert half.scalars["x"] == Interval(-3, 24)
    assert half.result == Interval(-1, 12)
    assert step.scalars["z"] == Interval(-1, 1)
    assert step.scalars["i"] == Interval(0, 3)  # as in C, where it ends at the bound
    assert step.scalars["x"] == Interval(-32768, 32767)
    assert found.constants == {"SIZE"}
    assert not step.arrays


@pytest.mark.parametrize(
    ("annotation", "found"),
    [
        ("I16", Interval(-(1 << 15), (1 << 15) - 1)),
        ("U16", Interval(0, (1 << 16) - 1)),
        ("I32", Interval(-(1 << 31), (1 << 31) - 1)),
        ("int", Interval(-(1 << 31), (1 << 31) - 1)),
        ("I64", Interval(-(1 << 63), (1 << 63) - 1)),
        ("float", FLOAT),
    ],
)
def test_an_argument_has_the_range_of_its_annotation(annotation: str, found: object) -> None:
    text = f"def step(x: {annotation}) -> I32:\n    return x\n"
    kernel = read_kernel([KernelSource("kernel.py", text)])
    assert analyse(kernel, ["step"]).functions["step"].result == found


@pytest.mark.parametrize("annotation", ["", ": str", ": list", ": tuple[int]"])
def test_an_argument_needs_an_annotation(annotation: str) -> None:
    text = f"def step(x{annotation}) -> I32:\n    return 1\n"
    with pytest.raises(Untranslatable, match="x needs an annotation of the subset"):
        analyse(read_kernel([KernelSource("kernel.py", text)]), ["step"])


def test_an_array_of_unknown_length_holds_any_word_and_what_was_written() -> None:
    text = "def step(a: list[int], b: list[float], x: I16) -> I32:\n    a[3] = x\n    return "
    ranges = {
        "a[3]": Interval(-(1 << 15), (1 << 15) - 1),
        "a[2]": Interval(-(1 << 31), (1 << 31) - 1),
        "a[x & 3]": Interval(-(1 << 31), (1 << 31) - 1),
        "b[7]": FLOAT,
    }
    for element, found in ranges.items():
        kernel = read_kernel([KernelSource("kernel.py", f"{text}{element}\n")])
        assert analyse(kernel, ["step"]).functions["step"].result == found

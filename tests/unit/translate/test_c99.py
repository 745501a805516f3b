"""The translator: what it writes, that C computes it, and what it refuses."""

import ctypes
import random
import subprocess
from pathlib import Path
from typing import Any

import needs
import pytest

from h2nav.apps.export_c import kernel_sources
from h2nav.attitude import record
from h2nav.attitude.kernel_files import CONSTANT_GAIN, VELOCITY_AIDED
from h2nav.translate.c99 import translate
from h2nav.translate.source import KernelSource, Untranslatable, read_kernel
from h2nav.translate.structs import constant_text, struct_text

INTEGER_HEAD = "from h2nav.maths.fixedpoint import I16, I32, clamp, known\n"
RECORD = '''
from dataclasses import dataclass

from h2nav.attitude.record import integer, integers


@dataclass(slots=True)
class Memory:
    """What the kernel remembers."""

    level: I32 = integer(-100, 100, "m", "the level", q=3)
    parts: list[I32] = integers(2, -9, 9, "", "its parts")


@dataclass(slots=True)
class Other:
    """Another record."""

    level: I32 = integer(-100, 100, "", "a level")


'''


def translated(text: str, entry: str = "step") -> str:
    return translate([KernelSource("kernel.py", text)], [entry]).code


def with_record(functions: str, entry: str = "step") -> str:
    """The C of functions on the records above."""
    return translated(f"{INTEGER_HEAD}{RECORD}{functions}", entry)


def compiled(folder: Path, code: str, wrapper: str) -> ctypes.CDLL:
    source, library = folder / "kernel.c", folder / "kernel.so"
    source.write_text(f"#include <math.h>\n#include <stdint.h>\n{code}\n{wrapper}\n")
    subprocess.run(
        [
            needs.need_program("gcc"), "-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror",
            "-pedantic", "-Wno-missing-prototypes", "-O2", "-ffp-contract=off", "-shared",
            "-fPIC", "-o", str(library), str(source), "-lm",
        ],
        check=True,
    )  # fmt: skip
    return ctypes.CDLL(str(library))


EVERYTHING = '''
"""A kernel that uses the whole integer subset."""
from dataclasses import dataclass

from h2nav.attitude.record import integer, integers
from h2nav.maths.fixedpoint import I16, I32, clamp, known

ONE = 1 << 14  # Q14
TABLE = (3, -5, 7)


@dataclass(slots=True)
class Memory:
    """What it remembers."""

    sum: I32 = integer(-40000, 40000, "", "a bounded number")
    mask: I32 = integer(-2147483648, 2147483647, "", "any number")
    last: list[I32] = integers(3, -ONE, ONE, "", "a vector")


def half(value: I32) -> I32:
    """Half, rounded down."""
    return value >> 1


def step(s: Memory, a: I16, b: I32) -> I32:
    """Every operation once."""
    # first part
    wide = b * 3 + a  # needs 64 bits
    small = clamp(wide >> 2, -ONE, ONE)
    parts = [0] * 3
    for i in range(3):
        parts[i] = TABLE[i] * small
        s.last[i] = small >> i
    if a > 100 and not b == 7:
        s.sum = clamp(s.sum + a, -40000, 40000)
    elif a < -100 or b >= 1 << 20:
        s.sum = half(s.sum)
    else:
        s.sum = -s.sum
    s.mask = (b & 65535) ^ -1
    total = parts[0] + parts[1] - parts[2]
    total += abs(a) if a != 5 else ~a
    gate = (a - 50) >> 31
    total |= s.sum & gate
    return known(total, -2147483648, 2147483647) + (1 << (a & 3))
'''


def test_functions_that_are_to_be_called_are_marked():
    text = f"""{INTEGER_HEAD}
def half(x: I16) -> I32:
    return x >> 1


def step(x: I16) -> I32:
    return half(x) + half(x)
"""
    source = [KernelSource("kernel.py", text)]
    assert "static inline int32_t half(" in translate(source, ["step"]).code
    assert "static CALLED int32_t half(" in translate(source, ["step"], called=["half"]).code
    with pytest.raises(Untranslatable, match="there is no function quarter"):
        translate(source, ["step"], called=["quarter"])


def test_c_computes_what_python_computes(tmp_path: Path) -> None:
    rows = read_kernel([KernelSource("kernel.py", EVERYTHING)]).records["Memory"].rows
    code = struct_text("What it remembers.", rows, "Memory") + translated(EVERYTHING)
    library = compiled(
        tmp_path,
        code,
        "int64_t run(Memory *s, int32_t a, int32_t b);\n"
        "int64_t run(Memory *s, int32_t a, int32_t b) { return step(s, a, b); }",
    )
    library.run.restype = ctypes.c_int64
    scope: dict[str, Any] = {}
    exec(EVERYTHING, scope)
    rng = random.Random(3)
    edges = [-(1 << 31), -(1 << 20), -1, 0, 1, 7, 1 << 20, (1 << 31) - 1]
    in_python, in_c = scope["Memory"](), record.in_c(scope["Memory"])
    for _ in range(20000):
        a = rng.choice([-32768, -101, -100, 5, 49, 50, 100, 101, 32767, rng.randint(-300, 300)])
        b = rng.choice([*edges, rng.randint(-(1 << 31), (1 << 31) - 1)])
        expected = scope["step"](in_python, a, b)
        assert library.run(ctypes.byref(in_c), a, b) == expected
        numbers = record.values(in_python, scope["Memory"])
        assert record.values(in_c, scope["Memory"]) == numbers


def test_names_comments_and_formats_are_carried_over() -> None:
    code = translated(EVERYTHING)
    assert "#define ONE INT32_C(16384)  /* Q14 */" in code
    assert "/* first part */" in code
    assert "/* needs 64 bits */" in code
    assert "/* Half, rounded down. */" in code
    assert "int64_t wide = (int64_t)b * INT32_C(3) + a;" in code
    assert "static const int32_t TABLE[3]" in code
    assert "step(Memory *s, int32_t a, int32_t b)" in code
    assert "s->last[i] = " in code
    assert "for (int32_t i = 0; i < INT32_C(3); i++) {" in code


COMMENTED = f'''{INTEGER_HEAD}

def step(x: I16, y: I16) -> I32:
    """About it."""
    # before the first
    a = x  # beside the first
    # one line
    # and another

    # after an empty line
    b = clamp(
        y,
        -6,
        # of a part of a statement
        5,
    )  # beside the last line
    # before a test
    if a > 0:  # beside the test
        # before what is done
        b = 1
        # of nothing that is done
    elif a < -7:  # beside the next test
        b = 2  # beside what is done
    else:
        # before what else is done
        b = 3
    # before a loop
    for i in range(3):  # beside the loop
        # in the loop
        b = b + i
    # before the end
    return a + b  # beside the end
'''
IN_C = """\
/* About it. */
static int32_t step(int32_t x, int32_t y)
{
    /* before the first */
    int32_t a = x;  /* beside the first */
    /* one line
     * and another
     * after an empty line
     */
    int32_t b = clamp_32(y, -INT32_C(6), INT32_C(5));  /* beside the last line */
    /* before a test */
    if (a > INT32_C(0)) {  /* beside the test */
        /* before what is done */
        b = INT32_C(1);
    } else if (a < -INT32_C(7)) {  /* beside the next test */
        b = INT32_C(2);  /* beside what is done */
    } else {
        /* before what else is done */
        b = INT32_C(3);
    }
    /* before a loop */
    for (int32_t i = 0; i < INT32_C(3); i++) {  /* beside the loop */
        /* in the loop */
        b = b + i;
    }
    /* before the end */
    return a + b;  /* beside the end */
}
"""


def test_comments_stand_before_or_beside_the_statements_that_they_stood_at() -> None:
    """Each once; what stood at none is left out."""
    assert translated(COMMENTED).endswith(f"\n{IN_C}")


@pytest.mark.parametrize(
    ("statement", "line", "reason"),
    [
        ("    return x / 2", 4, "Div"),
        ("    return x // 2", 4, "FloorDiv"),
        ("    return x % 3", 4, "Mod"),
        ("    return x ** 2", 4, "Pow"),
        ("    return print(x)", 4, "call of print"),
        ("    while x > 0:\n        x -= 1\n    return x", 4, "While"),
        ("    return [i for i in range(3)][0]", 4, "subscript"),
        ("    return x * x * x", 4, "bits"),
        ("    return x << 40", 4, "bits"),
        ("    return x << -1", 4, "shift"),
        ("    for i in range(x):\n        x += 1\n    return x", 4, "constant"),
        ("    if x > 0:\n        y = 1\n    return y", 6, "not a number that is set"),
        ("    if x > 0:\n        return 1", 3, "may end without"),
        ("    y = x if x > 0 else 0.5\n    return y", 4, "sometimes an integer"),
        ("    return unknown(x)", 4, "call of unknown"),
        ("    return x + True", 4, "truth values"),
        ("    a = [1, 2]\n    return a[2]", 5, "leaves 0..1"),
        ("    return step(x)", 3, "calls itself"),
        ("    y = x\n    return y\n    y = 2", 6, "never reached"),
        ("    return clamp(x, 5, 3)", 4, "lower limit"),
        ("    x: str = 'a'\n    return 1", 4, "Constant"),
        ("    with x:\n        return 1", 4, "With"),
        ("    import os\n    return x", 4, "Import"),
        ("    return lambda: x", 4, "Lambda"),
    ],
)
def test_refuses_with_file_and_line(statement: str, line: int, reason: str) -> None:
    text = f"{INTEGER_HEAD}\ndef step(x: I32) -> I32:\n{statement}\n"
    with pytest.raises(Untranslatable) as refusal:
        translated(text)
    assert str(refusal.value).startswith(f"kernel.py:{line}: ")
    assert reason in str(refusal.value)


@pytest.mark.parametrize(
    "module_line",
    ["import numpy", "from os import path", "class A:\n    pass", "def f():\n    yield 1\nX = f()"],
)
def test_refuses_modules_with_anything_but_constants_and_functions(module_line: str) -> None:
    with pytest.raises(Untranslatable, match=r"^kernel\.py:\d+: "):
        translated(f"{module_line}\n\ndef step(x: int) -> int:\n    return x\n")


def test_a_field_that_may_leave_its_declared_range_is_refused() -> None:
    head = "def step(s: Memory, a: I16) -> None:\n"
    reason = r"may leave s\.level at -32868\.\.32867, declared -100\.\.100"
    with pytest.raises(Untranslatable, match=reason):
        with_record(f"{head}    s.level = s.level + a\n")
    assert "clamp_32" in with_record(f"{head}    s.level = clamp(s.level + a, -100, 100)\n")
    with pytest.raises(
        Untranslatable, match=r"may leave s\.parts\[1\] at 10\.\.10, declared -9\.\.9"
    ):
        with_record(f"{head}    s.parts[1] = 10\n")


def test_an_initialiser_finds_zeros() -> None:
    """Its result is proved from there: what it does not write is zero, and zero must be allowed."""
    text = f"{INTEGER_HEAD}{RECORD}def begin(s: Memory) -> None:\n    s.level = s.level + 100\n"
    assert translate([KernelSource("kernel.py", text)], [], ["begin"]).code
    with pytest.raises(Untranslatable, match=r"begin may leave s\.level at 0\.\.200"):
        translate([KernelSource("kernel.py", text)], ["begin"])
    positive = text.replace("integers(2, -9, 9,", "integers(2, 1, 9,")
    with pytest.raises(
        Untranslatable, match=r"begin may leave s\.parts\[0\] at 0\.\.0, declared 1\.\.9"
    ):
        translate([KernelSource("kernel.py", positive)], [], ["begin"])


@pytest.mark.parametrize(
    ("functions", "reason"),
    [
        ("def step(s: Memory) -> I32:\n    return s.depth\n", "Memory has no field depth"),
        ("def step(s: Memory) -> None:\n    s.depth = 0\n", "Memory has no field depth"),
        ("def step(s: Memory) -> I32:\n    return s.parts\n", "parts is a vector"),
        ("def step(s: Memory) -> None:\n    s.parts = 0\n", "parts is a vector"),
        ("def step(s: Memory) -> I32:\n    return s.level[0]\n", "only arrays may be subscripted"),
        ("def step(s: Memory) -> I32:\n    return s.parts[2]\n", "index 2..2 leaves 0..1"),
        ("def step(s: I32) -> I32:\n    return s.level\n", "s.level is not a field of a record"),
        (
            "def of(s: Other) -> I32:\n    return s.level\n\n\n"
            "def step(s: Memory) -> I32:\n    return of(s)\n",
            "of needs a Other here",
        ),
        (
            "def of(s: Memory) -> I32:\n    return s.level\n\n\n"
            "def step(s: Memory) -> I32:\n    return of(s.level)\n",
            "of needs a Memory here",
        ),
    ],
)
def test_refuses_what_a_record_is_not(functions: str, reason: str) -> None:
    with pytest.raises(Untranslatable, match=r"^kernel\.py:\d+: ") as refusal:
        with_record(functions)
    assert reason in str(refusal.value)


CALLED = (
    "def bump(s: Memory) -> I32:\n    s.level = clamp(s.level + 1, -100, 100)\n"
    "    return s.level\n\n\ndef more(a: I32, b: I32) -> I32:\n    return a >> 1\n\n\n"
    "def step(s: Memory) -> I32:\n    "
)


@pytest.mark.parametrize(
    ("in_order", "in_any_order"),
    [
        ("a = bump(s)\n    return a + bump(s)", "return bump(s) + bump(s)"),
        ("bump(s)\n    return more(bump(s), 1)", "return more(bump(s), bump(s))"),
        ("return 1 if bump(s) > 0 and bump(s) > 1 else 2", "return 1 if bump(s) > bump(s) else 2"),
        (
            "if bump(s) > 0 or bump(s) > 1:\n        return 0\n    return 1",
            "if bump(s) > 0 or bump(s) > bump(s):\n        return 0\n    return 1",
        ),
    ],
)
def test_refuses_calls_whose_order_is_that_of_the_compiler(
    in_order: str, in_any_order: str
) -> None:
    assert "bump(s)" in with_record(f"{CALLED}{in_order}\n")
    with pytest.raises(Untranslatable, match="two calls that write, which C makes in any order"):
        with_record(f"{CALLED}{in_any_order}\n")


@pytest.mark.parametrize(
    ("in_order", "beside"),
    [
        ("found = bump(s)\n    return s.level + found", "return s.level + bump(s)"),
        ("found = bump(s)\n    return more(found, s.level)", "return more(bump(s), s.level)"),
        ("bump(s)\n    return s.level", "s.level -= 0 * bump(s)\n    return 0"),
        ("s.level = bump(s)\n    return 0", "s.level = 0 * bump(s) - s.level\n    return 0"),
        ("if s.level > 3 and bump(s) > 2:\n        return 1\n    return 0",
         "if s.level > bump(s):\n        return 1\n    return 0"),
    ],
)  # fmt: skip
def test_refuses_what_is_read_beside_a_call_that_writes_it(in_order: str, beside: str) -> None:
    assert "bump(s)" in with_record(f"{CALLED}{in_order}\n")
    with pytest.raises(Untranslatable, match="s is read beside a call that writes it"):
        with_record(f"{CALLED}{beside}\n")


def test_refuses_one_name_for_two_constants() -> None:
    sources = [KernelSource("a.py", "MAX = 3\n"), KernelSource("b.py", "MAX = 3\nMAX = 4\n")]
    with pytest.raises(Untranslatable, match=r"^b\.py:2: MAX has another value"):
        read_kernel(sources)


@pytest.mark.parametrize(
    ("statement", "reason"),
    [
        ("    level: I32 = 5", "a record holds only fields made by a row"),
        ("    level: I32 = unknown(1)", "a record holds only fields made by a row"),
        ("    def f(self) -> None:\n        pass", "a record holds only fields made by a row"),
        ("    level: I32 = integer(0, MAX, '', 'a level')", "not a constant expression"),
    ],
)
def test_refuses_records_of_anything_but_rows(statement: str, reason: str) -> None:
    text = f"class Memory:\n{statement}\n\n\ndef step(x: int) -> int:\n    return x\n"
    with pytest.raises(Untranslatable, match=rf"^kernel\.py:\d+: .*{reason}"):
        translated(text)


def test_a_record_becomes_a_struct_with_named_members() -> None:
    rows = read_kernel([KernelSource("kernel.py", INTEGER_HEAD + RECORD)]).records["Memory"].rows
    assert struct_text("What the kernel remembers.", rows, "my_memory") == (
        "/* What the kernel remembers. */\n"
        "typedef struct {\n"
        "    int32_t level;    /* the level; 2^3 = 1 m */\n"
        "    int32_t parts[2]; /* its parts */\n"
        "} my_memory;\n"
    )
    assert constant_text(rows, [5, -1, 2], "static const my_memory GAINS") == (
        "static const my_memory GAINS = {\n"
        "    .level = INT32_C(5),\n"
        "    .parts = {(-INT32_C(1)), INT32_C(2)},\n"
        "};\n"
    )


def test_a_unit_with_a_factor_is_told_with_its_power_of_two() -> None:
    rows = [record.Row("field", None, (-9, 9), "64 uT", "the field", 14)]
    assert "    int32_t field; /* the field; 2^14 = 64 uT */" in struct_text("A.", rows, "a")


def test_constants_in_use_only() -> None:
    text = "USED = 3\nUNUSED = 4\n\ndef step(x: int) -> int:\n    return (x >> 3) + USED\n"
    assert "UNUSED" not in translated(text)


SMALLEST = kernel_sources(CONSTANT_GAIN)


@pytest.mark.parametrize(
    ("original", "mutant"),
    [
        ("(q_w + 32768) >> 16", "(q_w + 32767) >> 16"),
        ("ww + xx - yy - zz", "ww + xx - yy + zz - zz - zz"),
        ("RATE_LIMIT = 19241453", "RATE_LIMIT = 19241452"),
        ("f_y &= f_used", "f_y |= f_used & 0"),
    ],
)
def test_a_mutation_of_the_kernel_changes_the_c(original: str, mutant: str) -> None:
    mutated = replaced(SMALLEST, original, mutant)
    assert translate(mutated, ["update"]).code != translate(SMALLEST, ["update"]).code


def replaced(sources: list[KernelSource], original: str, mutant: str) -> list[KernelSource]:
    """The sources with one piece of text changed, which must be in exactly one of them."""
    assert sum(original in source.text for source in sources) == 1
    return [KernelSource(path, text.replace(original, mutant, 1)) for path, text in sources]


def test_a_wider_input_of_the_constant_gain_kernel_is_noticed() -> None:
    """Ranges are proved: with longer steps a turn no longer fits, and the proof fails."""
    wider = replaced(SMALLEST, "MAX_DT_US = 12500", "MAX_DT_US = 60000")
    code = translate(wider, ["update"]).code
    assert "int64_t" in code  # no longer the 32-bit form
    assert "int64_t" not in translate(SMALLEST, ["update"]).code


@pytest.mark.thorough
def test_the_float_kernel_compiles_without_a_warning(tmp_path: Path) -> None:
    translation = translate(kernel_sources(VELOCITY_AIDED), [VELOCITY_AIDED.entry])
    records = translation.kernel.records.values()
    structs = "".join(struct_text(found.about, found.rows, found.name) for found in records)
    arguments = "State *s, Workspace *w, const Gains *g, const Sample *sample"
    compiled(
        tmp_path,
        structs + translation.code,
        f"int32_t run({arguments});\nint32_t run({arguments}) {{ return step(s, w, g, sample); }}",
    )


def test_the_runtime_against_python_at_every_corner(tmp_path: Path) -> None:
    text = f"""{INTEGER_HEAD}
def step(x: I32, low: I16, high: I16, n: I16, out: list[I32]) -> None:
    out[0] = clamp(x >> 1, -20000, 30000)
    out[1] = clamp(x >> 1, -(1 << 30), 5)
    out[2] = clamp(x >> 1, 5, 1 << 30)
    out[3] = abs(x >> 1)
    out[4] = x >> (n & 31)
    out[5] = (x * 65536) >> ((n & 15) + 16)
    out[6] = clamp(x * 4, -7, 1 << 20)
"""
    library = compiled(
        tmp_path,
        translated(text),
        "void run(int32_t x, int32_t n, int32_t *out);\n"
        "void run(int32_t x, int32_t n, int32_t *out) { step(x, 0, 0, n, out); }",
    )
    scope: dict[str, object] = {}
    exec(text, scope)
    words, expected = (ctypes.c_int32 * 7)(), [0] * 7
    corners = [sign * (1 << bit) + d for bit in range(31) for sign in (1, -1) for d in (-1, 0, 1)]
    for x in [*corners, -(1 << 31), (1 << 31) - 1]:
        for n in (0, 1, 15, 31):
            scope["step"](x, 0, 0, n, expected)  # type: ignore[operator]
            library.run(x, n, words)
            assert list(words) == expected, x

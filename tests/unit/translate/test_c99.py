"""The translator: what it writes, that C computes it, and what it refuses."""

import ctypes
import random
import subprocess
from pathlib import Path

import needs
import pytest

from h2nav.attitude.kernels import (
    fixed_lean,
    fixed_motion,
    fixed_triad,
    shaped,
    shaped_doubt,
    shaped_field,
    shaped_layout,
    shaped_motion,
    shaped_rest,
    shaped_theta,
    shaped_velocity,
)
from h2nav.attitude.two_stage.filter import memory as two_stage_layout
from h2nav.attitude.two_stage.kernel import correction as two_stage_correction
from h2nav.attitude.two_stage.kernel import motion as two_stage_motion
from h2nav.attitude.two_stage.kernel import step as two_stage
from h2nav.attitude.two_stage.kernel import trust as two_stage_trust
from h2nav.translate.c99 import translate
from h2nav.translate.source import Refused, Source

INTEGER_HEAD = "from h2nav.maths.fixedpoint import I16, I32, clamp, known\n"


def translated(text: str, entry: str = "step") -> str:
    return translate([Source("kernel.py", text)], [entry]).code


def source_of(module: object) -> Source:
    path = Path(str(module.__file__))  # type: ignore[attr-defined]
    return Source(str(path), path.read_text())


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
from h2nav.maths.fixedpoint import I16, I32, clamp, known

A, B = range(2)
ONE = 1 << 14  # Q14
TABLE = (3, -5, 7)
X_RANGES = ((-40000, 40000), (-2147483648, 2147483647))


def half(value: I32) -> I32:
    """Half, rounded down."""
    return value >> 1


def step(x: list[I32], a: I16, b: I32) -> I32:
    """Every operation once."""
    # first part
    wide = b * 3 + a  # needs 64 bits
    small = clamp(wide >> 2, -ONE, ONE)
    parts = [0] * 3
    for i in range(3):
        parts[i] = TABLE[i] * small
    if a > 100 and not b == 7:
        x[A] = clamp(x[A] + a, -40000, 40000)
    elif a < -100 or b >= 1 << 20:
        x[A] = half(x[A])
    else:
        x[A] = -x[A]
    x[B] = (b & 65535) ^ -1
    total = parts[0] + parts[1] - parts[2]
    total += abs(a) if a != 5 else ~a
    gate = (a - 50) >> 31
    total |= x[A] & gate
    return known(total, -2147483648, 2147483647) + (1 << (a & 3))
'''


def test_c_computes_what_python_computes(tmp_path: Path) -> None:
    code = translated(EVERYTHING)
    library = compiled(
        tmp_path,
        code,
        "int64_t run(int32_t *x, int32_t a, int32_t b);\n"
        "int64_t run(int32_t *x, int32_t a, int32_t b) { return step(x, a, b); }",
    )
    library.run.restype = ctypes.c_int64
    scope: dict[str, object] = {}
    exec(EVERYTHING, scope)
    rng = random.Random(3)
    edges = [-(1 << 31), -(1 << 20), -1, 0, 1, 7, 1 << 20, (1 << 31) - 1]
    x = [0, 0]
    words = (ctypes.c_int32 * 2)()
    for _ in range(20000):
        a = rng.choice([-32768, -101, -100, 5, 49, 50, 100, 101, 32767, rng.randint(-300, 300)])
        b = rng.choice([*edges, rng.randint(-(1 << 31), (1 << 31) - 1)])
        expected = scope["step"](x, a, b)  # type: ignore[operator]
        assert library.run(words, a, b) == expected
        assert list(words) == x


def test_names_comments_and_formats_are_carried_over() -> None:
    code = translated(EVERYTHING)
    assert "#define ONE INT32_C(16384)  /* Q14 */" in code
    assert "/* first part */" in code
    assert "/* needs 64 bits */" in code
    assert "/* Half, rounded down. */" in code
    assert "int64_t wide = (int64_t)b * INT32_C(3) + a;" in code
    assert "static const int32_t TABLE[3]" in code
    assert "for (int32_t i = 0; i < INT32_C(3); i++) {" in code


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
    with pytest.raises(Refused) as refusal:
        translated(text)
    assert str(refusal.value).startswith(f"kernel.py:{line}: ")
    assert reason in str(refusal.value)


@pytest.mark.parametrize(
    "module_line",
    ["import numpy", "from os import path", "class A:\n    pass", "def f():\n    yield 1\nX = f()"],
)
def test_refuses_modules_with_anything_but_constants_and_functions(module_line: str) -> None:
    with pytest.raises(Refused, match=r"^kernel\.py:\d+: "):
        translated(f"{module_line}\n\ndef step(x: int) -> int:\n    return x\n")


def test_a_state_that_may_leave_its_declared_range_is_refused() -> None:
    text = f"{INTEGER_HEAD}X_RANGES = ((-100, 100),)\n\ndef step(x: list[I32], a: I16) -> None:\n"
    with pytest.raises(Refused, match=r"may leave x\[0\] at -32868..32867, declared -100..100"):
        translated(f"{text}    x[0] = x[0] + a\n")
    assert "clamp_32" in translated(f"{text}    x[0] = clamp(x[0] + a, -100, 100)\n")


def test_an_initialiser_may_trust_nothing() -> None:
    text = f"{INTEGER_HEAD}X_RANGES = ((-9, 9), (-9, 9))\n\ndef begin(x: list[I32]) -> None:\n"
    sources = [Source("kernel.py", f"{text}    x[0] = 0\n")]
    with pytest.raises(Refused, match=r"may leave x\[1\]"):
        translate(sources, [], ["begin"])
    assert translate(sources, ["begin"]).code


def test_constants_in_use_only() -> None:
    text = "USED = 3\nUNUSED = 4\n\ndef step(x: int) -> int:\n    return (x >> 3) + USED\n"
    assert "UNUSED" not in translated(text)


LEAN = [source_of(fixed_triad), source_of(fixed_motion), source_of(fixed_lean)]


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
    mutated = replaced(LEAN, original, mutant)
    assert translate(mutated, ["update"]).code != translate(LEAN, ["update"]).code


def replaced(sources: list[Source], original: str, mutant: str) -> list[Source]:
    """The sources with one piece of text changed, which must be in exactly one of them."""
    assert sum(original in source.text for source in sources) == 1
    return [Source(path, text.replace(original, mutant, 1)) for path, text in sources]


def test_a_wider_input_of_the_lean_kernel_is_noticed() -> None:
    """Ranges are proved: with longer steps a turn no longer fits, and the proof fails."""
    wider = replaced(LEAN, "MOST_DT_US = 12500", "MOST_DT_US = 60000")
    code = translate(wider, ["update"]).code
    assert "int64_t" in code  # no longer the 32-bit form
    assert "int64_t" not in translate(LEAN, ["update"]).code


SHAPED = [
    shaped_layout,
    shaped_motion,
    shaped_theta,
    shaped_doubt,
    shaped_velocity,
    shaped_field,
    shaped_rest,
    shaped,
]
TWO_STAGE = [two_stage_layout, two_stage_motion, two_stage_trust, two_stage_correction, two_stage]


@pytest.mark.parametrize("modules", [SHAPED, TWO_STAGE], ids=["shaped", "two_stage"])
def test_the_float_kernels_compile_without_a_warning(tmp_path: Path, modules: list[object]) -> None:
    code = translate([source_of(module) for module in modules], ["step"]).code
    compiled(
        tmp_path,
        code,
        "int32_t run(double *x, const double *g, const double *z);\n"
        "int32_t run(double *x, const double *g, const double *z) { return step(x, g, z); }",
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

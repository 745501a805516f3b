"""The exported flight form from outside: a program's calls against the filter in Python."""

import ast
import contextlib
import ctypes
import math
import random
import subprocess
from collections.abc import Sequence

import needs
import pytest
from agreement import c_builds
from agreement.identity import IDENTITIES

from h2nav.apps import export_c
from h2nav.apps.export_forms import FORMS
from h2nav.attitude.kernels import fixed_flight, fixed_flight_place, fixed_flight_start
from h2nav.attitude.kernels import fixed_flight_layout as layout
from h2nav.attitude.kernels import fixed_motion as motion
from h2nav.attitude.samples import EarthField, ImuSample
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.filter import (
    IntegerVelocityAidedFilter,
    parts_of,
    sample_integers,
)
from h2nav.io import gain_files
from h2nav.translate.c99 import translate
from h2nav.translate.source import Refused, Source

FLIGHT = IDENTITIES["flight"]
GAINS = velocity_aided_gains(gain_files.load(FLIGHT.gains), FLIGHT.gains)
GRAVITY = 9.80665


def ints(values: Sequence[int], kind: type[ctypes.c_int16 | ctypes.c_int32]) -> object:
    return (kind * len(values))(*values)


class Program:
    """The exported C in this process, called as a program would."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library
        self.filter = (ctypes.c_int32 * layout.STATE_SIZE)()
        self.sample = (ctypes.c_int32 * layout.SAMPLE_SIZE)()
        library.h2nav_init(self.filter)

    def reset(self) -> None:
        self._library.h2nav_reset(self.filter)

    def set_field(self, field: Sequence[int]) -> None:
        self._library.h2nav_set_field(self.filter, ints(field, ctypes.c_int16))

    def fill(
        self, rate: Sequence[int], force: Sequence[int], field: Sequence[int] | None, dt_us: int
    ) -> list[int]:
        self._library.h2nav_fill(
            self.sample,
            ints(rate, ctypes.c_int32),
            ints(force, ctypes.c_int32),
            None if field is None else ints(field, ctypes.c_int16),
            ctypes.c_uint32(dt_us),
        )
        return list(self.sample)

    def add_fix(
        self, velocity: Sequence[int], gained: Sequence[int], variance: int, period_us: int
    ) -> list[int]:
        self._library.h2nav_add_fix(
            self.sample,
            ints(velocity, ctypes.c_int32),
            ints(gained, ctypes.c_int32),
            ctypes.c_int32(variance),
            ctypes.c_uint32(period_us),
        )
        return list(self.sample)

    def step(self) -> int:
        return int(self._library.h2nav_step(self.filter, self.sample))


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = c_builds.export(tmp_path_factory.mktemp("interface"), FLIGHT)
    target = folder / "h2nav.so"
    command = [needs.need_program("gcc"), *c_builds.STRICT, "-O2", "-shared", "-fPIC"]
    subprocess.run([*command, folder / "h2nav_filter.c", "-o", target], check=True)
    return ctypes.CDLL(str(target))


def test_fill_writes_the_sample_that_the_daemon_makes(library: ctypes.CDLL) -> None:
    rng = random.Random(4)
    program = Program(library)
    for number in range(300):
        size = rng.choice((1.0, 10.0, 200.0))
        w, f, m = ([rng.gauss(0.0, size) for _ in range(3)] for _ in range(3))
        sample = ImuSample(0, (w[0], w[1], w[2]), (f[0], f[1], f[2]), (m[0], m[1], m[2]))
        expected = sample_integers(sample if number % 2 else sample._replace(m_b_ut=None))
        expected[motion.DT_US] = 10_000
        expected[layout.REST] = 1  # a hand-held sensor decides itself
        force = [round(part / GRAVITY * 2.0**20) for part in f]
        field = expected[layout.F_FIELD : layout.F_FIELD + 3] if number % 2 else None
        words = program.fill(expected[:3], force, field, 10_000)
        for i in range(3):  # the daemon rounds halves upwards
            assert abs(words[layout.A_X + i] - expected[layout.A_X + i]) <= 1
        expected[layout.A_X : layout.A_Z + 1] = words[layout.A_X : layout.A_Z + 1]
        assert words == expected


def test_fill_limits_what_the_formats_do_not_hold(library: ctypes.CDLL) -> None:
    program = Program(library)
    words = program.fill((0, 0, 0), (-(1 << 31), (1 << 31) - 1, 5), None, 0xFFFFFFFF)
    low, high = layout.SAMPLE_RANGES[layout.A_X]
    assert words[layout.A_X : layout.A_Z + 1] == [low, high, 5]
    assert words[motion.DT_US] == 1_000_001  # longer than any gap that is bridged
    assert words[layout.CLIPPED] == 0
    assert program.fill((1, 1, 1), (0, 0, 0), None, 5)[layout.CLIPPED] == 1
    high = layout.SAMPLE_RANGES[layout.FIX_PERIOD_US][1]
    for (variance, period), expected in {
        (0, 0): [1, 1],
        (-7, 0xFFFFFFFF): [1, high],
        ((1 << 31) - 1, 200_000): [layout.SAMPLE_RANGES[layout.FIX_VARIANCE][1], 200_000],
    }.items():
        fix = program.add_fix((-(1 << 31), (1 << 31) - 1), (-1, 1 << 30), variance, period)
        assert fix[layout.FIX_VARIANCE : layout.FIX_PERIOD_US + 1] == expected
        assert fix[layout.FIX_V : layout.FIX_V + 2] == [-layout.S_MOST, layout.S_MOST]
        assert fix[layout.FIX_C : layout.FIX_C + 2] == [layout.C_MASK, 0]
        assert fix[layout.HAS_FIX] == fix[layout.IS_AIDED] == 1
        for word, (least, most) in zip(fix, layout.SAMPLE_RANGES, strict=True):
            assert least <= word <= most or word == fix[motion.DT_US]


@pytest.mark.parametrize("dt_us", [0, 12_500, 12_501, 99_999, 1_000_000, 1_000_001])
def test_a_step_of_any_length_is_that_of_the_daemon(library: ctypes.CDLL, dt_us: int) -> None:
    """The same parts as `IntegerVelocityAidedFilter` makes; the sample is the same afterwards."""
    program, python = Program(library), IntegerVelocityAidedFilter(GAINS, GAINS.name)
    still, force, field = (0, 0, 549_756), (3000, -3000, -(1 << 20)), (6400, 0, 11085)
    t_us = 0
    state = FORMS[0].start(python.params)
    for number in range(200):
        last = number == 199
        words = program.fill(still, force, field, dt_us if last else 10_000)
        program.step()
        assert list(program.sample) == words
        t_us += words[motion.DT_US]
        if last and dt_us > 1_000_000:
            fixed_flight_start.restart(state)
            words[motion.DT_US] = 0
        for part in parts_of(words, words[motion.DT_US]):
            fixed_flight.update(state, list(python.params), part)
    assert list(program.filter) == state


def test_the_field_of_the_place_is_that_of_the_daemon(library: ctypes.CDLL) -> None:
    """Declination, norm and dip from components, to what 2^14 = 64 uT resolves."""
    rng = random.Random(8)
    for _ in range(200):
        norm, dip = rng.uniform(25.0, 65.0), rng.uniform(-1.4, 1.4)
        angle = rng.uniform(-math.pi, math.pi)
        flat, down = norm * math.cos(dip), norm * math.sin(dip)
        parts = (flat * math.cos(angle), flat * math.sin(angle), down)
        if max(map(abs, parts)) > 64.0 * 32767 / 16384:
            continue
        field = [round(part / 64.0 * 2.0**14) for part in parts]
        program, python = Program(library), IntegerVelocityAidedFilter(GAINS, GAINS.name)
        program.set_field(field)
        python.use_field(EarthField(norm, dip, angle))
        expected, got = memory_of(python), list(program.filter)
        error = (got[layout.DECLINATION] - expected[layout.DECLINATION]) * 2.0**-28
        assert abs(math.remainder(error, 2.0 * math.pi)) < 0.01 / flat
        for word in (layout.SIN_DECLINATION, layout.COS_DECLINATION):
            assert abs(got[word] - expected[word]) < 8 + 20 / flat
        for word in (layout.REF_FLAT, layout.REF_DOWN, layout.REF_NORM):
            assert abs(got[word] - expected[word]) < 5 << 12  # of a norm of 2^26
        assert got[layout.REF_GIVEN] == 1
        state = FORMS[0].start(python.params)
        fixed_flight_place.set_place(state, list(python.params), field)
        assert got == state


def test_reset_forgets_the_attitude_alone(library: ctypes.CDLL) -> None:
    program = Program(library)
    program.fill((0, 0, 0), (0, 0, -(1 << 20)), (6400, 0, 11085), 10_000)
    assert program.step() & layout.ALIGNED
    before = list(program.filter)
    program.reset()
    changed = {i for i, word in enumerate(program.filter) if word != before[i]}
    assert program.filter[layout.AGE_US] == -1
    assert changed <= {layout.AGE_US, layout.FIELD_US}


def test_a_changed_kernel_changes_the_c() -> None:
    """One addition of a function made a subtraction: other C, or ranges that cannot be proved."""
    form = FORMS[0].text
    sources = export_c.kernel_sources(form)
    code = translate(sources, form.entries, ["reset"]).code
    seen = 0
    for index, source in enumerate(sources):
        for mutant in mutants(source.text):
            changed = [*sources]
            changed[index] = Source(source.path, mutant)
            with contextlib.suppress(Refused):
                assert translate(changed, form.entries, ["reset"]).code != code
            seen += 1
    assert seen >= 2 * len(sources) - 2  # every module but the layout has some


def mutants(text: str) -> list[str]:
    """The text with one ``+`` inside a function made ``-``: the first, and the last."""
    lines = text.splitlines(keepends=True)
    functions = [node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
    sums = [
        node.left
        for function in functions
        for node in ast.walk(function)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add)
    ]
    found = []
    for left in sums[:1] + sums[-1:]:
        assert left.end_lineno is not None
        row, column = left.end_lineno - 1, left.end_col_offset or 0
        line = lines[row]
        changed = line[:column] + line[column:].replace("+", "-", 1)
        found.append("".join([*lines[:row], changed, *lines[row + 1 :]]))
    return found


def memory_of(python: IntegerVelocityAidedFilter) -> list[int]:
    """The kernel's memory inside the filter's state."""
    return list(python._state)

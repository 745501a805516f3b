"""The exported velocity-aided filter from outside: a program's calls against Python."""

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
from h2nav.attitude.record import Number, assign, in_c, row, rows, values
from h2nav.attitude.samples import EarthField, ImuSample
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.integer import memory
from h2nav.attitude.velocity_aided.integer.filter import (
    IntegerVelocityAidedFilter,
    fill_sample,
    parts_of,
)
from h2nav.attitude.velocity_aided.integer.kernel import start, step, told
from h2nav.attitude.velocity_aided.integer.memory import Gains, Sample, State
from h2nav.files import gain_files
from h2nav.translate.c99 import translate
from h2nav.translate.source import KernelSource, Untranslatable

IDENTITY = IDENTITIES["velocity_aided"]
GAINS = velocity_aided_gains(gain_files.load(IDENTITY.gains), IDENTITY.gains)
GRAVITY = 9.80665


def ints(values: Sequence[int], kind: type[ctypes.c_int16 | ctypes.c_int32]) -> object:
    return (kind * len(values))(*values)


class Program:
    """The exported C in this process, called as a program would.

    Attributes:
        filter: ``h2nav_filter``.
        sample: ``h2nav_sample``.
    """

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library
        self.filter, self.sample = in_c(State), in_c(Sample)
        library.h2nav_init(address(self.filter))

    def reset(self) -> None:
        self._library.h2nav_reset(address(self.filter))

    def set_field(self, field: Sequence[int]) -> None:
        self._library.h2nav_set_field(address(self.filter), ints(field, ctypes.c_int16))

    def remove_fix_delay(self, removed: int) -> None:
        self._library.h2nav_remove_fix_delay(address(self.filter), ctypes.c_int32(removed))

    def fill(
        self, rate: Sequence[int], force: Sequence[int], field: Sequence[int] | None, dt_us: int
    ) -> None:
        self._library.h2nav_fill(
            address(self.sample),
            ints(rate, ctypes.c_int32),
            ints(force, ctypes.c_int32),
            None if field is None else ints(field, ctypes.c_int16),
            ctypes.c_uint32(dt_us),
        )

    def add_fix(
        self,
        velocity: Sequence[int],
        gained: Sequence[int],
        accel: Sequence[int],
        variance: int,
        period_us: int,
    ) -> None:
        self._library.h2nav_add_fix(
            address(self.sample),
            ints(velocity, ctypes.c_int32),
            ints(gained, ctypes.c_int32),
            ints(accel, ctypes.c_int32),
            ctypes.c_int32(variance),
            ctypes.c_uint32(period_us),
        )

    def step(self) -> int:
        return int(self._library.h2nav_step(address(self.filter), address(self.sample)))

    def memory(self) -> list[Number]:
        """All numbers of the filter, in order."""
        return values(self.filter, State)


def address(record: object) -> object:
    """Of a record that `in_c` has made."""
    assert isinstance(record, ctypes.Structure)
    return ctypes.byref(record)


def started(gains: Gains) -> State:
    """What the filter in Python remembers at its start."""
    fresh = State()
    start.reset(fresh, gains)
    return fresh


def ends(name: str) -> tuple[int, int]:
    """Lowest and highest value of a field of the sample."""
    found = row(Sample, name).range
    assert found is not None
    return found


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = c_builds.export(tmp_path_factory.mktemp("interface"), IDENTITY)
    target = folder / "h2nav.so"
    command = [needs.need_program("gcc"), *c_builds.STRICT, "-O2", "-shared", "-fPIC"]
    subprocess.run([*command, folder / "h2nav_filter.c", "-o", target], check=True)
    return ctypes.CDLL(str(target))


@pytest.mark.thorough
def test_fill_writes_the_sample_that_the_daemon_makes(library: ctypes.CDLL) -> None:
    rng = random.Random(4)
    program, expected = Program(library), Sample()
    for number in range(300):
        size = rng.choice((1.0, 10.0, 200.0))
        w, f, m = ([rng.gauss(0.0, size) for _ in range(3)] for _ in range(3))
        sample = ImuSample(0, (w[0], w[1], w[2]), (f[0], f[1], f[2]), (m[0], m[1], m[2]))
        fill_sample(expected, sample if number % 2 else sample._replace(m_b_ut=None))
        expected.dt_us = 10_000
        expected.rest_prior = 1  # a hand-held sensor decides itself
        force = [round(part / GRAVITY * 2.0**20) for part in f]
        program.fill(expected.gyro, force, expected.mag if number % 2 else None, 10_000)
        for i in range(3):  # the daemon rounds halves upwards
            assert abs(program.sample.accel[i] - expected.accel[i]) <= 1
        expected.accel[:] = program.sample.accel
        assert values(program.sample, Sample) == values(expected, Sample)


@pytest.mark.thorough
def test_fill_limits_what_the_formats_do_not_hold(library: ctypes.CDLL) -> None:
    program = Program(library)
    sample = program.sample
    program.fill((0, 0, 0), (-(1 << 31), (1 << 31) - 1, 5), None, 0xFFFFFFFF)
    assert list(sample.accel) == [*ends("accel"), 5]
    assert sample.dt_us == 1_000_001  # longer than any gap that is bridged
    assert sample.clipped == 0
    program.fill((1, 1, 1), (0, 0, 0), None, 5)
    expected_by_daemon = Sample()
    fill_sample(expected_by_daemon, ImuSample(0, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)))
    assert sample.clipped == expected_by_daemon.clipped == memory.FORCE_LOST
    for (variance, period_us), expected in {
        (0, 0): (1, 1),
        (-7, 0xFFFFFFFF): (1, ends("fix_period_us")[1]),
        ((1 << 31) - 1, 200_000): (ends("fix_variance")[1], 200_000),
    }.items():
        widest = (-(1 << 31), (1 << 31) - 1)
        program.add_fix(widest, (-1, 1 << 30), widest, variance, period_us)
        assert (sample.fix_variance, sample.fix_period_us) == expected
        assert (sample.fix_velocity_n, sample.fix_velocity_e) == ends("fix_velocity_n")
        assert (sample.fix_accel_n, sample.fix_accel_e) == ends("fix_accel_n")
        assert (sample.fix_gained_n, sample.fix_gained_e) == (memory.GAINED_MASK, 0)
        assert sample.has_fix == sample.aided == 1
        for field in rows(Sample):
            low, high = ends(field.name)
            value = getattr(sample, field.name)
            numbers = [value] if field.size is None else list(value)
            assert low <= min(numbers) <= max(numbers) <= high


@pytest.mark.parametrize("dt_us", [0, 12_500, 12_501, 99_999, 1_000_000, 1_000_001])
def test_a_step_of_any_length_is_that_of_the_daemon(library: ctypes.CDLL, dt_us: int) -> None:
    """The same parts as `IntegerVelocityAidedFilter` makes; the sample is the same afterwards."""
    gains = IntegerVelocityAidedFilter(GAINS, GAINS.name).kernel_gains
    program, python = Program(library), started(gains)
    still, force, field = (0, 0, 549_756), (3000, -3000, -(1 << 20)), (6400, 0, 11085)
    for number in range(200):
        program.fill(still, force, field, dt_us if number == 199 else 10_000)
        given = values(program.sample, Sample)
        program.step()
        assert values(program.sample, Sample) == given
        sample = program.sample
        if sample.dt_us > 1_000_000:
            sample.dt_us = 0
            start.resume(python, gains, sample)
            continue
        for part in parts_of(sample, sample.dt_us):
            step.update(python, gains, part)
    assert program.memory() == values(python, State)


def test_the_field_of_the_place_is_that_of_the_daemon(library: ctypes.CDLL) -> None:
    """Declination, norm and dip from components, to what 2^14 = 64 uT resolves."""
    rng = random.Random(8)
    for _ in range(200):
        norm, dip = rng.uniform(25.0, 65.0), rng.uniform(-1.4, 1.4)
        angle = rng.uniform(-math.pi, math.pi)
        horizontal, down = norm * math.cos(dip), norm * math.sin(dip)
        parts = (horizontal * math.cos(angle), horizontal * math.sin(angle), down)
        if max(map(abs, parts)) > 64.0 * 32767 / 16384:
            continue
        field = [round(part / 64.0 * 2.0**14) for part in parts]
        program, daemon = Program(library), IntegerVelocityAidedFilter(GAINS, GAINS.name)
        program.set_field(field)
        daemon.use_field(EarthField(norm, dip, angle))
        expected, got = daemon.kernel_state, program.filter
        error = (got.declination - expected.declination) * 2.0**-28
        assert abs(math.remainder(error, 2.0 * math.pi)) < 0.01 / horizontal
        for name in ("declination_sine", "declination_cosine"):
            assert abs(getattr(got, name) - getattr(expected, name)) < 8 + 20 / horizontal
        for name in ("mag_ref_horizontal", "mag_ref_down", "mag_ref_norm"):
            assert abs(getattr(got, name) - getattr(expected, name)) < 5 << 12  # of 2^26
        assert got.mag_ref_given == 1
        python = started(daemon.kernel_gains)
        north, east, below = field
        told.set_place(python, daemon.kernel_gains, north, east, below)
        assert program.memory() == values(python, State)


def test_what_a_program_takes_off_the_fixes_times_their_latency_loses(
    library: ctypes.CDLL,
) -> None:
    """As in the daemon it may be below zero by what was taken off, at most half a second."""
    program, second = Program(library), 1 << 30
    for removed, kept, lag in (
        (second // 10, second // 10, -(second // 10)),
        (second // 20, second // 20, -(second // 20)),
        (second, second // 2, -second // 2),
        (-5, 0, 0),
    ):
        program.remove_fix_delay(removed)
        assert program.filter.fix_removed == kept
        assert program.filter.fix_lag == lag
    program.filter.fix_lag = second // 8
    program.remove_fix_delay(second // 10)
    assert program.filter.fix_lag == second // 8 - second // 10


def test_reset_forgets_the_attitude_alone(library: ctypes.CDLL) -> None:
    program = Program(library)
    program.fill((0, 0, 0), (0, 0, -(1 << 20)), (6400, 0, 11085), 10_000)
    assert program.step() & memory.ALIGNED
    expected = State()
    assign(expected, State, program.memory())
    program.filter.mag_age_us = 5000
    program.reset()
    expected.age_us, expected.mag_age_us = -1, 0
    assert program.memory() == values(expected, State)


@pytest.mark.thorough
def test_a_changed_kernel_changes_the_c() -> None:
    """One addition of a function made a subtraction: other C, or ranges that cannot be proved."""
    form = IDENTITY.form.text
    sources = export_c.kernel_sources(form.kernel)
    entries = (form.kernel.entry, *form.more_entries)
    code = translate(sources, entries, ["reset"]).code
    mutants = {i: mutated(source.text) for i, source in enumerate(sources)}
    found = [(i, mutant) for i, mutant in mutants.items() if mutant is not None]
    assert len(found) >= len(sources) - 1  # every module but the memory has one
    # Four modules from the first to the last: each translation takes a second.
    for index, mutant in found[:: max(len(found) // 4, 1)]:
        changed = [*sources]
        changed[index] = KernelSource(sources[index].path, mutant)
        with contextlib.suppress(Untranslatable):
            assert translate(changed, entries, ["reset"]).code != code


def mutated(text: str) -> str | None:
    """The text with one ``+`` inside a function made ``-``: the middle one; None without any."""
    lines = text.splitlines(keepends=True)
    functions = [node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
    sums = [
        node.left
        for function in functions
        for node in ast.walk(function)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add)
    ]
    if not sums:
        return None
    left = sums[len(sums) // 2]
    assert left.end_lineno is not None
    row, column = left.end_lineno - 1, left.end_col_offset or 0
    line = lines[row]
    lines[row] = line[:column] + line[column:].replace("+", "-", 1)
    return "".join(lines)

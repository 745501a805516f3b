"""A filter"""

ROOM = "h2nav/attitude/made"
CHANGES = {
    f"{ROOM}/__init__.py": '"""A made filter: complementary, with constant gains, in floats."""\n',
    f"{ROOM}/memory.py": '''\
"""State, gains and sample of the made filter; n is north-east-down with magnetic north."""

from dataclasses import dataclass

from h2nav.attitude.record import real, reals

FORCE_USED = 1
FIELD_USED = 2


@dataclass(slots=True)
class State:
    """The filter's whole memory."""

    q_nb: list[float] = reals(4, "", "attitude, body to n, scalar first")
    gyro_bias: list[float] = reals(3, "rad/s", "gyro bias")
    is_aligned: float = real("", "1: there is an attitude")


@dataclass(slots=True)
class Gains:
    """The shares of an error that are corrected."""

    tilt: float = real("1/s", "of the tilt")
    heading: float = real("1/s", "of the heading")
    bias: float = real("1/s^2", "of both, as a bias")


@dataclass(slots=True)
class Sample:
    """One sample."""

    dt_s: float = real("s", "time since the sample before")
    gyro: list[float] = reals(3, "rad/s", "angular rate")
    accel: list[float] = reals(3, "m/s^2", "specific force; zeros for none")
    mag: list[float] = reals(3, "uT", "magnetic field; zeros for none")
''',
    f"{ROOM}/kernel/__init__.py": '"""The kernel, in the translatable subset."""\n',
    f"{ROOM}/kernel/step.py": '''\
"""One step: the gyro's turn, then the corrections by gravity and field."""

import math

from ..memory import FIELD_USED, FORCE_USED, Gains, Sample, State

MAX_SHARE = 0.5
MAX_LEARNT = 0.1  # rad/s: a larger error is one of the attitude


def step(s: State, g: Gains, sample: Sample) -> int:
    """Takes one sample; returns bits."""
    error = [0.0, 0.0, 0.0]
    dt = sample.dt_s
    turn(
        s,
        dt * (sample.gyro[0] - s.gyro_bias[0]),
        dt * (sample.gyro[1] - s.gyro_bias[1]),
        dt * (sample.gyro[2] - s.gyro_bias[2]),
    )
    bits = errors(s, g, sample, error)
    if bits == 0:
        return 0
    share = dt
    if share > MAX_SHARE:
        share = MAX_SHARE
    turn(s, share * error[0], share * error[1], share * error[2])
    if length(error) < MAX_LEARNT:
        for i in range(3):
            s.gyro_bias[i] = s.gyro_bias[i] - share * g.bias * error[i]
    return bits


def errors(s: State, g: Gains, sample: Sample, error: list[float]) -> int:
    """Writes the turn per second that corrects the attitude, body; returns bits."""
    w = s.q_nb[0]
    x = s.q_nb[1]
    y = s.q_nb[2]
    z = s.q_nb[3]
    down = [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]
    north = [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)]
    force = length(sample.accel)
    if force <= 0.0:
        return 0
    k = -g.tilt / force
    error[0] = k * (sample.accel[1] * down[2] - sample.accel[2] * down[1])
    error[1] = k * (sample.accel[2] * down[0] - sample.accel[0] * down[2])
    error[2] = k * (sample.accel[0] * down[1] - sample.accel[1] * down[0])
    level = [0.0, 0.0, 0.0]
    part = sample.mag[0] * down[0] + sample.mag[1] * down[1] + sample.mag[2] * down[2]
    for i in range(3):
        level[i] = sample.mag[i] - part * down[i]
    field = length(level)
    if field <= 0.0:
        return FORCE_USED
    k = (level[1] * north[2] - level[2] * north[1]) * down[0]
    k = k + (level[2] * north[0] - level[0] * north[2]) * down[1]
    k = k + (level[0] * north[1] - level[1] * north[0]) * down[2]
    k = g.heading * k / field
    for i in range(3):
        error[i] = error[i] + k * down[i]
    return FORCE_USED | FIELD_USED


def turn(s: State, px: float, py: float, pz: float) -> None:
    """Turns the attitude in body axes."""
    half = 0.5 * math.sqrt(px * px + py * py + pz * pz)
    c = math.cos(half)
    k = 0.5
    if half > 1e-9:
        k = 0.5 * math.sin(half) / half
    px = k * px
    py = k * py
    pz = k * pz
    w = s.q_nb[0]
    x = s.q_nb[1]
    y = s.q_nb[2]
    z = s.q_nb[3]
    nw = c * w - px * x - py * y - pz * z
    nx = c * x + px * w + pz * y - py * z
    ny = c * y + py * w + px * z - pz * x
    nz = c * z + pz * w + py * x - px * y
    k = 1.0 / math.sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    s.q_nb[0] = k * nw
    s.q_nb[1] = k * nx
    s.q_nb[2] = k * ny
    s.q_nb[3] = k * nz


def length(v: list[float]) -> float:
    """Length of a vector of three numbers."""
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
''',
    f"{ROOM}/gains.py": '''\
"""The made filter's gains, by the gyro noise of a gain file of kind velocity_aided."""

import math

from h2nav.attitude.gains.envelope import GainFile
from h2nav.attitude.made.memory import Gains
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains


def made_gains(file: GainFile, place: str) -> Gains:
    """Faster, the noisier the gyro."""
    noise = math.sqrt(velocity_aided_gains(file, place).kernel.gyro_noise)
    fast = min(max(2000.0 * noise, 0.5), 1.0)
    return Gains(tilt=fast, heading=fast, bias=0.1 * fast * fast)
''',
    f"{ROOM}/filter.py": '''\
"""The made filter, behind the interface of every filter."""

import math
from functools import partial

from h2nav.attitude.alignment import triad
from h2nav.attitude.filter import FilterState, IgnoresInputs
from h2nav.attitude.made.kernel.step import step
from h2nav.attitude.made.memory import FIELD_USED, FORCE_USED, Gains, Sample, State
from h2nav.attitude.native import CompiledStep
from h2nav.attitude.record import assign, copy, in_c, size_of, values
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    SensorErrors,
    Trust,
    Vec3,
)
from h2nav.maths.quaternion import multiply

LONGEST_GAP_US = 1_000_000
MAX_RATE_RAD_S, MAX_FORCE_M_S2, MAX_FIELD_UT = 100.0, 1000.0, 1e5
NOTHING: Vec3 = (0.0, 0.0, 0.0)


class MadeFilter(IgnoresInputs):
    """A complementary filter.

    Args:
        gains: of a gain file.
        compiled: the compiled kernel; None for the one in Python.
    """

    name = "made"

    def __init__(self, gains: Gains, compiled: CompiledStep | None = None) -> None:
        self._state, self._g, self._sample = State(), gains, Sample()
        if compiled is not None:
            self._state, self._g, self._sample = in_c(State), in_c(Gains), in_c(Sample)
            copy(gains, self._g, Gains)
        s, g, u = self._state, self._g, self._sample
        self._step = partial(step, s, g, u) if compiled is None else compiled.bound(s, g, u)
        self._t_us: int | None = None
        self._declination_rad = 0.0

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Takes one sample; see `AttitudeFilter`."""
        s, u, trust = self._state, self._sample, Trust.ALIGNED | Trust.CONVERGED
        if not _is_below(sample.w_b, MAX_RATE_RAD_S) or not _is_below(sample.f_b, MAX_FORCE_M_S2):
            return self._estimate(sample, Trust.SATURATED) if s.is_aligned > 0.0 else None
        field = sample.m_b_ut or NOTHING
        if not _is_below(field, MAX_FIELD_UT):
            field = NOTHING
        before_us, self._t_us = self._t_us, sample.t_us
        if before_us is None or sample.t_us - before_us > LONGEST_GAP_US or s.is_aligned <= 0.0:
            return self._align(sample, field)
        u.dt_s = 1e-6 * (sample.t_us - before_us)
        u.gyro[:] = sample.w_b
        u.accel[:] = NOTHING if sample.clipped else sample.f_b
        u.mag[:] = field
        bits = self._step()
        if bits & FORCE_USED:
            trust |= Trust.FORCE_USED
        if bits & FIELD_USED:
            trust |= Trust.FIELD_USED | Trust.YAW_REFERENCED
        return self._estimate(sample, trust | (Trust.SATURATED if sample.clipped else trust))

    def _align(self, sample: ImuSample, field: Vec3) -> AttitudeEstimate | None:
        try:
            q_nb = triad(sample.f_b, None if field == NOTHING else field)
        except ValueError:
            self._state.is_aligned = 0.0
            return None
        self._state.q_nb[:] = q_nb
        self._state.is_aligned = 1.0
        return self._estimate(sample, Trust.ALIGNED | Trust.RESTARTED)

    def _estimate(self, sample: ImuSample, trust: Trust) -> AttitudeEstimate:
        half, (w, x, y, z) = 0.5 * self._declination_rad, self._state.q_nb
        (a, b, c), (p, q, r) = self._state.gyro_bias, sample.w_b
        return AttitudeEstimate(
            t_us=sample.t_us,
            q_nb=multiply((math.cos(half), 0.0, 0.0, math.sin(half)), (w, x, y, z)),
            w_b=(p - a, q - b, r - c) if _is_below(sample.w_b, MAX_RATE_RAD_S) else NOTHING,
            bias_b=(a, b, c),
            innovation_n=NOTHING,
            sigma_tilt_rad=math.nan,
            trust=trust,
        )

    def use_field(self, field: EarthField) -> None:
        """Only the declination matters."""
        self._declination_rad = field.declination_rad

    @property
    def sensor_errors(self) -> SensorErrors:
        """Nothing is known of them."""
        return SensorErrors(NOTHING)

    def restart(self) -> None:
        """Forgets time and attitude; keeps the bias."""
        self._state.is_aligned, self._t_us = 0.0, None

    def state(self) -> FilterState:
        """Time, declination and the kernel's numbers."""
        own = values(self._state, State)
        return FilterState(self.name, (self._t_us, self._declination_rad, *own))

    def restore(self, state: FilterState) -> None:
        """Continues where `state` was taken."""
        t_us, *rest = state.values
        if state.filter_name != self.name or len(rest) != 1 + size_of(State):
            raise ValueError(f"not a state of the filter {self.name}")
        declination_rad, *own = (float(value or 0.0) for value in rest)
        assign(self._state, State, own)
        self._declination_rad, self._t_us = declination_rad, None if t_us is None else int(t_us)


def _is_below(v: Vec3, limit: float) -> bool:
    """Whether all parts are; no NaN is."""
    return all(abs(part) < limit for part in v)
''',
    "pyproject.toml": (
        (
            '    "h2nav.attitude.velocity_aided", ',
            '    "h2nav.attitude.made", "h2nav.attitude.made.kernel",\n'
            '    "h2nav.attitude.velocity_aided", ',
        ),
        ('    "constant_gain",\n', '    "constant_gain | made",\n'),
    ),
    "h2nav/apps/algorithms.py": (
        (
            "ALGORITHMS = {\n",
            """\
def _made(file: GainFile) -> AttitudeFilter:
    from h2nav.attitude.kernel_files import MADE
    from h2nav.attitude.made.filter import MadeFilter
    from h2nav.attitude.made.gains import made_gains
    from h2nav.attitude.native import compiled_step

    return MadeFilter(made_gains(file, file.name), compiled_step(MADE))


ALGORITHMS = {
    "made": Algorithm("velocity_aided", gains_by_class=True, makers={"float": _made}),
""",
        ),
    ),
    "h2nav/attitude/kernel_files.py": (
        (
            "FILTERS = (VELOCITY_AIDED, VELOCITY_AIDED_INTEGER, CONSTANT_GAIN)\n",
            """\
MADE = KernelFiles("made", _kernel("made", "step"), "step")
FILTERS = (VELOCITY_AIDED, VELOCITY_AIDED_INTEGER, CONSTANT_GAIN, MADE)
""",
        ),
    ),
    "tests/filters.py": (
        (
            "import CONSTANT_GAIN, VELOCITY_AIDED, VELOCITY_AIDED_INTEGER\n",
            """\
import CONSTANT_GAIN, MADE, VELOCITY_AIDED, VELOCITY_AIDED_INTEGER
from h2nav.attitude.made.filter import MadeFilter
from h2nav.attitude.made.gains import made_gains
""",
        ),
        (
            '    "velocity_aided": lambda:',
            """\
    "made": lambda: MadeFilter(
        made_gains(gain_files.load(MULTIROTOR), MULTIROTOR), compiled_step(MADE)
    ),
    "velocity_aided": lambda:""",
        ),
    ),
    "tests/unit/apps/test_filters.py": (
        ("CASES = [\n", 'CASES = [\n    ("made", "float", "made"),\n'),
    ),
    "tests/unit/attitude/test_native.py": (
        (
            "from h2nav.attitude.native import SWITCH,",
            """\
from h2nav.attitude.made.filter import MadeFilter
from h2nav.attitude.made.gains import made_gains
from h2nav.attitude.native import SWITCH,""",
        ),
        (
            "MAKERS: dict[str, Maker] = {\n",
            """\
MAKERS: dict[str, Maker] = {
    "made": lambda compiled: MadeFilter(
        made_gains(gain_files.load("multirotor_100hz"), "multirotor_100hz"), compiled
    ),
""",
        ),
    ),
}
WRITTEN = ("docs/memory.md", "configs/schema.json")

if __name__ == "__main__":
    import contextlib
    import subprocess
    import sys
    import tempfile
    from pathlib import Path

    from needs import REPOSITORY
    from unit.apps import test_filters as names
    from unit.attitude import test_native as native

    from h2nav.apps.export_c import kernel_sources
    from h2nav.attitude.kernel_files import FILTERS, MADE
    from h2nav.cli import main
    from h2nav.translate.batch import batch_c

    # The contract suite, with the copy's list of filters.
    suite = REPOSITORY / "tests" / "contract" / "test_attitude_filters.py"
    options = ("-q", "-k", "made", "-p", "no:cacheprovider", "-o", "pythonpath=")
    command = [sys.executable, "-m", "pytest", *options, suite]
    with tempfile.TemporaryDirectory() as place:  # hypothesis writes beside itself
        told = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stdout
    assert int(told.stdout.split(" passed")[0].split()[-1]) > 40, told.stdout

    # A vehicle gets it by its name.
    names.test_every_name_is_tried()
    names.test_a_name_and_an_arithmetic_give_a_filter("made", "float", "made")
    schema, page = map(Path, ("configs/schema.json", "docs/memory.md"))
    with schema.open("w", encoding="utf-8") as file, contextlib.redirect_stdout(file):
        assert main(["check-config", "--schema"]) == 0
    assert '"made"' in schema.read_text(encoding="utf-8")

    # It can be compiled, and what it remembers is documented.
    assert "s->gyro_bias" in batch_c(MADE, kernel_sources(MADE))
    assert {kernel.name for kernel in FILTERS} == set(native.MAKERS)
    subprocess.run([sys.executable, "tools/memory_tables.py"], check=True)
    assert "\n## made, in floats\n" in page.read_text(encoding="utf-8")

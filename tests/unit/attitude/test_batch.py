"""Whole recordings: the compiled kernels give the bits that Python gives."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from lanes import few
from needs import absent

from h2nav.attitude import batch, native
from h2nav.attitude.constant_gain.filter import ConstantGainFilter
from h2nav.attitude.constant_gain.gains import constant_gain_model
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.kernel_files import COMPILED, CONSTANT_GAIN, VELOCITY_AIDED
from h2nav.attitude.record import in_c, size_of
from h2nav.attitude.samples import EarthField, VehicleState, VelocityFix
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.attitude.velocity_aided.memory import Gains, Sample, State, Workspace
from h2nav.errors import BadInput
from h2nav.files import gain_files

N = 6000
Recording = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def velocity_aided_filter() -> AttitudeFilter:
    return VelocityAidedFilter(
        velocity_aided_gains(gain_files.load("handheld_100hz"), "handheld_100hz")
    )


def constant_gain_filter() -> AttitudeFilter:
    return ConstantGainFilter(
        constant_gain_model(gain_files.load("mpu9250_100hz"), "mpu9250_100hz")
    )


def integer_filter() -> AttitudeFilter:
    return IntegerVelocityAidedFilter(
        velocity_aided_gains(gain_files.load("handheld_100hz"), "handheld_100hz"), "test"
    )


FILTERS = [velocity_aided_filter, integer_filter, constant_gain_filter]


def need_native() -> None:
    if native._current_build() is None:
        absent("the compiled kernels are not built, or not from these kernels")


@pytest.fixture
def recording() -> Recording:
    """Motion with everything that a batch must not stumble over."""
    rng = np.random.default_rng(4)
    t = 0.01 * np.arange(N)
    gyr = np.stack([0.5 * np.sin(0.7 * t), 0.4 * np.cos(0.5 * t), 0.3 * np.sin(0.2 * t)], axis=1)
    gyr += rng.normal(0.0, 0.01, (N, 3))
    acc = np.array([0.0, 0.0, -9.8]) + rng.normal(0.0, 0.5, (N, 3))
    mag = np.array([25.0, 0.0, 43.0]) + rng.normal(0.0, 1.0, (N, 3))
    mag[::3] = np.nan
    dt = np.full(N, 0.01)
    gyr[100] = np.nan
    acc[1000:1010] = 0.0
    gyr[2000] = 1e9
    mag[2500] = [2e6, 0.0, 0.0]
    dt[3000], dt[4000] = 0.5, 3.0
    acc[3500] = [1e300, 0.0, 0.0]
    return gyr, acc, mag, dt


def both_ways(
    recording: Recording,
    make: Callable[[], AttitudeFilter],
    monkeypatch: pytest.MonkeyPatch,
    halves: Callable[[AttitudeFilter, int], None] | None = None,
) -> batch.BatchResult:
    """The estimates, which compiled and Python must give alike; with something told in between."""
    need_native()
    results, states = [], []
    for switch in ("require", "forbid"):
        monkeypatch.setenv(native.SWITCH, switch)
        attitude_filter = make()
        if halves is None:
            parts = [batch.filter_array(*recording, attitude_filter)]
        else:
            middle, times = len(recording[3]) // 2, np.cumsum(recording[3])
            parts = [batch.filter_array(*(array[:middle] for array in recording), attitude_filter)]
            halves(attitude_filter, round(times[middle - 1] * 1e6))
            rest = [array[middle:].copy() for array in recording]
            rest[3][0] = times[middle]
            parts.append(batch.filter_array(*rest, attitude_filter))
        results.append([np.concatenate(columns) for columns in zip(*parts, strict=True)])
        states.append(attitude_filter.state())
    for compiled, python in zip(*results, strict=True):
        assert np.array_equal(compiled, python, equal_nan=True)
    assert states[0] == states[1]
    return batch.BatchResult(*results[0])


@pytest.mark.parametrize("make", FILTERS)
def test_compiled_and_python_give_the_same_bits(
    recording: Recording, make: Callable[[], AttitudeFilter], monkeypatch: pytest.MonkeyPatch
) -> None:
    result = both_ways(recording, make, monkeypatch)
    assert np.isfinite(result.q_nb[200:]).mean() > 0.99


@pytest.mark.parametrize("make", FILTERS)
@pytest.mark.parametrize("rate_hz", few(1, [50.0, 286.0, 400.0]))
def test_the_same_bits_at_any_rate(
    recording: Recording,
    make: Callable[[], AttitudeFilter],
    rate_hz: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At 50 Hz the integers take every sample in two steps."""
    gyr, acc, mag, _ = recording
    result = both_ways((gyr, acc, mag, np.full(N, 1.0 / rate_hz)), make, monkeypatch)
    assert np.isfinite(result.q_nb[200:]).mean() > 0.99


@pytest.mark.parametrize(
    ("make", "rate_hz"), [(velocity_aided_filter, 100.0), (integer_filter, 50.0)]
)
def test_ordinary_samples_do_go_through_the_compiled_kernel(
    recording: Recording,
    make: Callable[[], AttitudeFilter],
    rate_hz: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    need_native()
    monkeypatch.setenv(native.SWITCH, "require")
    attitude_filter, calls = make(), []
    update = attitude_filter.update
    monkeypatch.setattr(attitude_filter, "update", lambda sample: calls.append(0) or update(sample))
    gyr, acc, mag, _ = recording
    batch.filter_array(gyr, acc, mag, 1.0 / rate_hz, attitude_filter)
    assert 0 < len(calls) < 40


@pytest.mark.parametrize("make", FILTERS)
@pytest.mark.parametrize("field", ["none", "late", "repeated", "infinite", "zero", "strong"])
def test_the_same_bits_whatever_the_field(
    recording: Recording,
    make: Callable[[], AttitudeFilter],
    field: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    gyr, acc, mag, dt = (array[:1500].copy() for array in recording)
    full = np.where(np.isnan(mag), [25.0, 0.0, 43.0], mag)
    if field == "repeated":
        mag = np.repeat(full[::3], 3, axis=0)
    else:
        mag = full
        mag[:700] = {"none": np.nan, "late": np.nan, "infinite": np.inf, "zero": 0.0}.get(
            field, 9e4
        )
        if field == "none":
            mag[:] = np.nan
    result = both_ways((gyr, acc, mag, dt), make, monkeypatch)
    assert np.isfinite(result.q_nb[800:]).mean() > 0.99


@pytest.mark.parametrize("make", FILTERS)
def test_the_same_bits_beyond_the_ranges(
    recording: Recording, make: Callable[[], AttitudeFilter], monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(5)
    gyr, acc, mag, dt = (array[:2000].copy() for array in recording)
    for array, size in ((gyr, 120.0), (acc, 3000.0), (mag, 3e5)):
        rows = rng.integers(50, 2000, 150)
        array[rows] = rng.uniform(-size, size, (150, 3)) / 2.0
    dt[rng.integers(50, 2000, 60)] = rng.uniform(1e-6, 1.2, 60)
    both_ways((gyr, acc, mag, dt), make, monkeypatch)


@pytest.mark.parametrize("make", FILTERS)
def test_what_is_told_between_two_batches_counts(
    recording: Recording, make: Callable[[], AttitudeFilter], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A field, a vehicle on the ground, and fixes that hold the filter until they are lost."""
    ordinary = tuple(array[3100:3900] for array in recording)
    gyr, acc, mag, dt = ordinary
    acc = np.clip(acc, -20.0, 20.0)

    def tell(attitude_filter: AttitudeFilter, t_us: int) -> None:
        attitude_filter.use_field(EarthField(49.0, 1.04, 0.2))
        attitude_filter.use_vehicle(VehicleState(on_ground=True, airspeed_m_s=12.0))
        for late_us in (500_000, 300_000, 100_000):
            attitude_filter.use_velocity(VelocityFix(t_us - late_us, (1.0, 2.0, 0.0), 0.3))

    result = both_ways((gyr, acc, mag, dt), make, monkeypatch, tell)
    assert np.isfinite(result.q_nb[300:]).all()


@pytest.mark.parametrize("make", FILTERS)
def test_two_halves_are_the_whole(recording: Recording, make: Callable[[], AttitudeFilter]) -> None:
    """The filter goes on from where the first half left it."""
    gyr, acc, mag, _ = (array[:900].copy() for array in recording)
    gyr[100] = 0.0
    whole = batch.filter_array(gyr, acc, mag, 0.01, make())
    attitude_filter = make()
    first = batch.filter_array(gyr[:500], acc[:500], mag[:500], 0.01, attitude_filter)
    t_us = attitude_filter.state().values[0]
    assert t_us == 5_000_000
    assert np.array_equal(first.q_nb, whole.q_nb[:500], equal_nan=True)
    steps_s = np.array([5.01, *[0.01] * 399])
    second = batch.filter_array(gyr[500:], acc[500:], mag[500:], steps_s, attitude_filter)
    assert np.array_equal(second.q_nb, whole.q_nb[500:])


def test_backend_follows_the_switch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(native.SWITCH, "forbid")
    assert native.backend() == "python"
    monkeypatch.setenv(native.SWITCH, "perhaps")
    with pytest.raises(BadInput, match="H2NAV_NATIVE: expected require or forbid"):
        native.backend()


def test_requiring_what_is_absent_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(native.importlib, "import_module", missing)
    monkeypatch.setattr(native, "_current_build", native._current_build.__wrapped__)
    monkeypatch.setenv(native.SWITCH, "require")
    with pytest.raises(BadInput, match="install h2nav again with a C compiler"):
        native.backend()
    monkeypatch.delenv(native.SWITCH)
    assert native.backend() == "python"


@pytest.mark.parametrize(
    ("shape", "dt", "message"),
    [
        ((5, 2), 0.01, "shape"),
        ((5, 3), 0.0, "microsecond"),
        ((1, 3), math.nan, "finite"),
        ((1, 3), math.inf, "finite"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(
    shape: tuple[int, int], dt: float, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        batch.filter_array(np.zeros(shape), np.zeros(shape), None, dt, constant_gain_filter())


def test_the_compiled_kernels_refuse_buffers_that_do_not_fit() -> None:
    need_native()
    compiled = native.native_kernels()
    assert compiled is not None
    number = COMPILED.index(CONSTANT_GAIN)
    memory, gains, sample, out = (
        np.zeros(size, np.int32) for size in (16, 22, 11, native.RESULT_COLUMNS)
    )
    for buffers, message in (
        ((memory[1:], gains, sample, out), "not those of this kernel"),
        ((memory, gains[1:], sample, out), "not those of this kernel"),
        ((memory, gains, sample[1:], out), "not whole samples"),
        ((memory, gains, np.zeros(22, np.int32), out), "one row of numbers"),
    ):
        with pytest.raises(ValueError, match=message):
            compiled.run(number, buffers[0], bytearray(), *buffers[1:])
    with pytest.raises(ValueError, match="no kernel of this number"):
        compiled.run(len(COMPILED), memory, bytearray(), gains, sample, out)
    compiled.run(number, memory, bytearray(), gains, sample, out)


def test_a_bound_kernel_takes_numbers_for_fields_of_its_sample_only() -> None:
    need_native()
    compiled = native.native_kernels()
    assert compiled is not None
    number, count = COMPILED.index(VELOCITY_AIDED), size_of(Sample)
    records = [in_c(State), in_c(Workspace), in_c(Gains), in_c(Sample)]
    step = compiled.bind(number, *records, count - 2, 2)
    for numbers in ((1.0,), (1.0, 2.0, 3.0), (1.0, "x")):
        with pytest.raises(TypeError):
            step(*numbers)
    largest = (1 << 63) - 1
    for first, length in ((count - 1, 2), (-1, 2), (0, -1), (1, largest), (largest, largest)):
        with pytest.raises(ValueError, match="not the records of a kernel of doubles"):
            compiled.bind(number, *records, first, length)
    for wrong in ([*records[:3], in_c(State)], [in_c(Sample), *records[1:]]):
        with pytest.raises(ValueError, match="not the records"):
            compiled.bind(number, *wrong, 0, 1)
    with pytest.raises(ValueError, match="not the records"):
        compiled.bind(COMPILED.index(CONSTANT_GAIN), *records, 0, 1)

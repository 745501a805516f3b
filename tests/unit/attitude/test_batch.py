"""Whole recordings: the compiled kernels give the bits that Python gives."""

from collections.abc import Callable

import numpy as np
import pytest
from needs import absent

from h2nav.attitude import batch
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.fixed import FixedFilter
from h2nav.attitude.fixed_gains import fixed_model
from h2nav.attitude.samples import EarthField
from h2nav.attitude.shaped import ShapedFilter
from h2nav.attitude.shaped_gains import shaped_gains
from h2nav.errors import BadInput
from h2nav.io import gain_files
from h2nav.translate.batch import BATCH_KERNELS

N = 6000
Recording = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def shaped_filter() -> AttitudeFilter:
    return ShapedFilter(shaped_gains(gain_files.load("handheld_100hz"), "handheld_100hz"))


def fixed_filter() -> AttitudeFilter:
    return FixedFilter(fixed_model(gain_files.load("mpu9250_100hz"), "mpu9250_100hz"))


def need_native() -> None:
    if batch._current_build() is None:
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


@pytest.mark.parametrize("make", [shaped_filter, fixed_filter])
def test_compiled_and_python_give_the_same_bits(
    recording: Recording, make: Callable[[], AttitudeFilter], monkeypatch: pytest.MonkeyPatch
) -> None:
    need_native()
    results, states = [], []
    for wish in ("require", "forbid"):
        monkeypatch.setenv(batch.SWITCH, wish)
        attitude_filter = make()
        results.append(batch.filter_array(*recording, attitude_filter))
        states.append(attitude_filter.state())
    assert np.array_equal(results[0].q_nb, results[1].q_nb, equal_nan=True)
    assert np.array_equal(results[0].bias_b, results[1].bias_b, equal_nan=True)
    assert states[0] == states[1]
    assert np.isfinite(results[0].q_nb[200:]).mean() > 0.99


@pytest.mark.parametrize("make", [shaped_filter, fixed_filter])
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


def test_a_declined_field_turns_the_batch_too(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    need_native()
    results = []
    for wish in ("require", "forbid"):
        monkeypatch.setenv(batch.SWITCH, wish)
        attitude_filter = fixed_filter()
        attitude_filter.use_field(EarthField(49.0, 1.04, 0.2))
        results.append(batch.filter_array(*recording, attitude_filter).q_nb)
    assert np.array_equal(results[0], results[1], equal_nan=True)


def test_every_translated_module_is_part_of_the_digest() -> None:
    translated = [name for kernel in BATCH_KERNELS for name in kernel.modules]
    assert tuple(translated) == batch.COMPILED_MODULES


def test_backend_follows_the_switch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(batch.SWITCH, "forbid")
    assert batch.backend() == "python"
    monkeypatch.setenv(batch.SWITCH, "perhaps")
    with pytest.raises(BadInput, match="H2NAV_NATIVE: expected require or forbid"):
        batch.backend()


def test_requiring_what_is_absent_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(batch.importlib, "import_module", missing)
    monkeypatch.setattr(batch, "_current_build", batch._current_build.__wrapped__)
    monkeypatch.setenv(batch.SWITCH, "require")
    with pytest.raises(BadInput, match="install h2nav again with a C compiler"):
        batch.backend()
    monkeypatch.delenv(batch.SWITCH)
    assert batch.backend() == "python"


@pytest.mark.parametrize(
    ("shape", "dt", "message"), [((5, 2), 0.01, "shape"), ((5, 3), 0.0, "microsecond")]
)
def test_arrays_that_do_not_fit_are_refused(
    shape: tuple[int, int], dt: float, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        batch.filter_array(np.zeros(shape), np.zeros(shape), None, dt, fixed_filter())


def test_the_compiled_kernels_refuse_buffers_that_do_not_fit() -> None:
    need_native()
    native = batch.importlib.import_module("h2nav.attitude._native")
    memory, gains = np.zeros(16, np.int32), np.zeros(22, np.int32)
    with pytest.raises(ValueError, match="rows of the given number of columns"):
        native.run_fixed_lean(memory, gains, np.zeros(12, np.int32), 11, np.zeros(8, np.int32))
    with pytest.raises(ValueError, match="one row of 8 numbers"):
        native.run_fixed_lean(memory, gains, np.zeros(22, np.int32), 11, np.zeros(8, np.int32))

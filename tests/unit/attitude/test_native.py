"""The compiled step behind a filter: the same estimates and memory as the one in Python."""

import sys
from collections.abc import Callable
from types import SimpleNamespace

import pytest

from h2nav.attitude import native
from h2nav.attitude.constant_gain.filter import ConstantGainFilter
from h2nav.attitude.constant_gain.gains import constant_gain_model
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.kernel_files import (
    COMPILED,
    CONSTANT_GAIN,
    FILTERS,
    VELOCITY_AIDED,
    KernelFiles,
)
from h2nav.attitude.native import SWITCH, CompiledStep, compiled_or, compiled_step, native_kernels
from h2nav.attitude.record import in_c, place_of, values
from h2nav.attitude.samples import EarthField, ImuSample, VehicleState, VelocityFix
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains, velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.attitude.velocity_aided.memory import Gains, Sample, State, Workspace
from h2nav.files import gain_files
from h2nav.integrity import composition
from tests.needs import absent

Maker = Callable[[CompiledStep | None], AttitudeFilter]


def multirotor() -> VelocityAidedGains:
    name = "multirotor_100hz"
    return velocity_aided_gains(gain_files.load(name), name)


MAKERS: dict[str, Maker] = {
    "velocity_aided": lambda compiled: VelocityAidedFilter(multirotor(), compiled),
    "constant_gain": lambda compiled: ConstantGainFilter(
        constant_gain_model(gain_files.load("mpu9250_100hz"), "mpu9250_100hz"), compiled
    ),
    "velocity_aided_integer": lambda compiled: IntegerVelocityAidedFilter(
        multirotor(), "multirotor_100hz", compiled
    ),
}


def flown(chosen: AttitudeFilter, start: int, stop: int) -> list[object]:
    """Estimates over turns, a gap, a clipped sample, a new place and velocity fixes."""
    found: list[object] = []
    for i in range(start, stop):
        t_us = 10_000 * i + (300_000 if i > 700 else 0)
        if i == 100:
            chosen.use_field(EarthField(48.0, 1.1, 0.05))
            chosen.use_vehicle(VehicleState(on_ground=False))
        if i % 20 == 0 and 300 < i < 900:
            chosen.use_velocity(VelocityFix(t_us - 110_000, (0.02 * i, -1.0, 0.0), 0.2))
        wave = 0.3 * ((i % 200) - 100) / 100
        field = (20.0 + wave, 0.01 * (i % 7), 43.0) if i % 4 == 0 else None
        found.append(
            chosen.update(
                ImuSample(t_us, (wave, -0.1, 0.5 * wave), (wave, 0.1, -9.8), field, i % 150 == 7)
            )
        )
    return found


@pytest.mark.parametrize("kernel", FILTERS, ids=lambda kernel: kernel.name)
def test_a_compiled_step_gives_the_same_estimates(kernel: KernelFiles) -> None:
    name, compiled = kernel.name, compiled_step(kernel)
    if compiled is None:
        pytest.skip("the compiled kernels are absent or older than the Python ones")
    plain, fast = MAKERS[name](None), MAKERS[name](compiled)
    assert flown(plain, 1, 1200) == flown(fast, 1, 1200)
    assert plain.state() == fast.state()
    again = MAKERS[name](compiled_step(kernel))
    again.restore(plain.state())
    assert flown(again, 1200, 1300) == flown(plain, 1200, 1300)


def records() -> tuple[object, ...]:
    return tuple(in_c(kind) for kind in (State, Workspace, Gains, Sample))


def test_a_bound_step_holds_its_records_and_refuses_others() -> None:
    compiled = compiled_step(VELOCITY_AIDED)
    if compiled is None:
        absent("the compiled kernels are not built")
    bind = native_kernels().bind  # type: ignore[union-attr]
    number, (state, workspace, gains, sample) = COMPILED.index(VELOCITY_AIDED), records()
    first, count = place_of(Sample, "dt_s", "has_fix")
    bound = bind(number, state, workspace, gains, sample, first, count)
    bound(*range(count))
    assert values(sample, Sample)[first : first + count] == [float(n) for n in range(count)]
    with pytest.raises(TypeError, match="not as many numbers"):
        bound(*range(count - 1))
    with pytest.raises(TypeError):
        bound(*range(count - 1), "one")
    for wrong in (
        (number, workspace, workspace, gains, sample, first, count),
        (number, state, workspace, gains, state, first, count),
        (number, state, workspace, gains, sample, first, 1000),
        (number, state, workspace, gains, sample, -1, 1),
        (COMPILED.index(CONSTANT_GAIN), state, workspace, gains, sample, first, count),
        (len(COMPILED), state, workspace, gains, sample, first, count),
    ):
        with pytest.raises(ValueError, match="not the records of a kernel"):
            bind(*wrong)


def test_an_extension_with_another_interface_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    if native_kernels() is None:
        absent("the compiled kernels are not built")
    older = SimpleNamespace(kernel_digest=native_kernels().kernel_digest, interface=1)
    monkeypatch.setitem(sys.modules, "h2nav.attitude._native", older)
    assert native._current_build.__wrapped__() is None


def test_functions_are_the_compiled_ones_of_their_names_or_those_in_python(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    compiled = native_kernels()
    if compiled is not None:
        assert compiled_or(composition) is compiled
        assert callable(compiled.compose)
    monkeypatch.setenv(SWITCH, "forbid")
    assert compiled_or(composition) is composition

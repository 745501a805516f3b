"""State and workspace of the velocity-aided filter: what a step works out is never remembered."""

import random

import pytest
from velocity_flights import GAINS

from h2nav.attitude.kernel_files import VELOCITY_AIDED
from h2nav.attitude.native import CompiledStep, compiled_step
from h2nav.attitude.record import assign, rows, size_of
from h2nav.attitude.samples import EarthField, ImuSample, VehicleState, VelocityFix
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.memory import State, Workspace


def flown(chosen: VelocityAidedFilter, rng: random.Random | None) -> list[object]:
    """Estimates over turns, a gap, clipped samples, rest, fixes that come and go, a new field.

    Args:
        chosen: the filter.
        rng: overwrites the workspace before every call; None leaves it.
    """
    found: list[object] = []

    def disturb() -> None:
        if rng is not None:
            noise = [rng.uniform(-9.0, 9.0) for _ in range(size_of(Workspace))]
            assign(chosen.kernel_workspace, Workspace, noise)

    chosen.use_field(EarthField(48.0, 1.1, 0.05))
    for i in range(1, 4000):
        disturb()
        t_us = 10_000 * i + (1_500_000 if i > 2500 else 0)
        if i % 700 == 0:
            chosen.use_vehicle(VehicleState(on_ground=(None, False, True)[i // 700 % 3]))
            disturb()
        if i % 20 == 0 and (300 < i < 1500 or 2700 < i < 3700):
            chosen.use_velocity(VelocityFix(t_us - 110_000, (0.002 * i, -1.0, 0.0), 0.2))
            disturb()
        if i == 1700:
            chosen.use_field(EarthField(48.0, 1.1, 0.25))
            disturb()
        wave = 0.3 * ((i % 200) - 100) / 100 if i % 1000 < 700 else 0.0
        field = (20.0 + wave, 0.01 * (i % 7), 43.0) if i % 4 == 0 else None
        is_clipped = i % 150 in (7, 8) or 2000 < i < 2040
        rate = (wave + 3.0 * is_clipped, -0.1 * (wave != 0.0), 0.5 * wave)
        found.append(chosen.update(ImuSample(t_us, rate, (wave, 0.1, -9.8), field, is_clipped)))
        if i % 500 == 0:
            chosen.restore(chosen.state())
    return found


def test_no_field_is_of_both() -> None:
    assert not {row.name for row in rows(State)} & {row.name for row in rows(Workspace)}


@pytest.mark.parametrize(
    "compiled",
    [None, pytest.param(compiled_step(VELOCITY_AIDED), id="compiled")],
)
def test_nothing_of_the_workspace_is_remembered(compiled: CompiledStep | None) -> None:
    left = VelocityAidedFilter(GAINS, compiled)
    overwritten = VelocityAidedFilter(GAINS, compiled)
    assert flown(left, None) == flown(overwritten, random.Random(1))
    assert left.state() == overwritten.state()

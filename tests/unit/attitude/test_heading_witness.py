"""The heading that measured velocities show, alone."""

import cmath
import math

import numpy as np
import pytest
from needs import DEG
from synthetic_imu import GRAVITY

from h2nav.attitude.velocity_aided.heading_witness import (
    LATENCIES_S,
    SIZE,
    Heading,
    HeadingWitness,
    velocity_walk,
)

PERIOD_S = 0.2
SIGMA_M_S = 0.1
WALK = velocity_walk(5e-7, 1e-5)


def velocity(t: float) -> complex:
    """Of a vehicle that flies to and fro, some 3 m/s^2."""
    return 4.0 * cmath.exp(0.8j * t) + 3.0 * math.sin(1.1 * t)


def nothing(_t: float) -> complex:
    return 0j


def watch(
    witness: HeadingWitness,
    offset: float,
    seconds: tuple[float, float] = (0.0, 40.0),
    latency_s: float = 0.0,
    moves=velocity,
    jump=nothing,
    turned: float = 0.0,
) -> list[Heading | None]:
    """Fixes of a receiver that is late and jumps, and a filter whose heading is off."""
    rng = np.random.default_rng(5)
    found = []
    frame = cmath.exp(1j * (turned - offset)) / GRAVITY
    for i in range(round(seconds[0] / PERIOD_S), round(seconds[1] / PERIOD_S)):
        t = i * PERIOD_S
        n, e = rng.normal(0.0, 0.03, 2)
        seen = moves(t - latency_s) + jump(t) + complex(n, e)
        felt = [frame * moves(t - back) for back in LATENCIES_S]
        gained = [(part.real, part.imag) for part in felt]
        found.append(
            witness.take((seen.real, seen.imag), gained, turned, PERIOD_S, SIGMA_M_S, WALK)
        )
    return found


@pytest.mark.parametrize("latency_s", [0.0, 0.25])
@pytest.mark.parametrize("offset_deg", [-170.0, -40.0, 0.0, 20.0, 120.0])
def test_finds_by_how_much_the_heading_is_off(offset_deg: float, latency_s: float) -> None:
    last = watch(HeadingWitness(), offset_deg * DEG, latency_s=latency_s)[-1]
    assert last is not None
    assert abs(math.remainder(last.turn_rad - offset_deg * DEG, 2.0 * math.pi)) < 2.0 * DEG
    assert last.sigma_rad < 5.0 * DEG
    assert last.contradicts == (abs(offset_deg) > 15.0)


def test_turns_of_the_heading_are_taken_off() -> None:
    """The filter has turned by what its heading was off: nothing is left to turn."""
    last = watch(HeadingWitness(), 1.0, turned=1.0)[-1]
    assert last is not None
    assert abs(last.turn_rad) < 2.0 * DEG


def test_a_receiver_that_jumps_shows_no_heading() -> None:
    """10 m/s to and fro every 3 s; of a vehicle that moves, none that is wrong."""

    def jumps(t: float) -> complex:
        return 10.0 if int(t / 3.0) % 2 else 0.0

    assert not any(watch(HeadingWitness(), 0.0, moves=nothing, jump=jumps))
    found = [h for h in watch(HeadingWitness(), 90.0 * DEG, jump=jumps) if h is not None]
    assert found
    off = [heading._replace(turn_rad=heading.turn_rad - 90.0 * DEG) for heading in found]
    assert not any(heading.contradicts for heading in off)


def test_one_jump_makes_all_before_it_void() -> None:
    found = watch(HeadingWitness(), 0.5, jump=lambda t: 10.0 if t > 19.9 else 0.0)
    assert found[99] is not None
    assert found[100] is None
    last = found[-1]
    assert last is not None
    assert abs(last.turn_rad - 0.5) < 2.0 * DEG


def test_a_vehicle_that_does_not_move_shows_no_heading() -> None:
    assert not any(watch(HeadingWitness(), 0.0, moves=nothing))
    witness = HeadingWitness()
    still = [(0.0, 0.0)] * len(LATENCIES_S)
    for period_s in (0.0, PERIOD_S, 2.5) * 20:
        assert witness.take((0.0, 0.0), still, 0.0, period_s, 0.0, 0.0) is None


def test_a_velocity_of_another_size_shows_no_heading() -> None:
    """Half of the measured velocity is felt: it is not this vehicle's."""
    assert not any(watch(HeadingWitness(), 0.0, jump=velocity)[20:])


def test_a_witness_loaded_from_its_values_goes_on_identically() -> None:
    witness, again = HeadingWitness(), HeadingWitness()
    watch(witness, 1.0, (0.0, 17.0))
    assert len(witness.values()) == SIZE
    again.load(witness.values())
    assert again.values() == witness.values()
    assert watch(again, 1.0, (17.0, 30.0)) == watch(witness, 1.0, (17.0, 30.0))
    assert again.values() == witness.values()


def test_a_blind_witness_takes_nothing_of_that_time_and_then_starts_anew() -> None:
    """A tilt that is being corrected would turn the heading."""
    witness = HeadingWitness()
    witness.clear(4.0)
    found = watch(witness, 40.0 * DEG, (0.0, 4.0))
    assert found == [None] * 20
    copy = HeadingWitness()
    copy.load(witness.values())
    for one in (witness, copy):
        last = watch(one, 0.0, (4.0, 44.0))[-1]
        assert last is not None
        assert abs(last.turn_rad) < 3.0 * last.sigma_rad < 15.0 * DEG

"""The heading that measured velocities show, alone."""

import cmath
import math
from collections.abc import Callable
from unittest.mock import Mock

import numpy as np
import pytest
from needs import DEG
from synthetic_imu import GRAVITY

from h2nav.attitude.velocity_aided.heading_witness import (
    LATENCIES_S,
    SIZE,
    Heading,
    HeadingWitness,
    VelocityNoise,
    velocity_walk,
)
from h2nav.attitude.velocity_aided.velocity_heading import RefusedField, VelocityHeading

PERIOD_S = 0.2
SIGMA_M_S = 0.1
NOISE = VelocityNoise(SIGMA_M_S, velocity_walk(5e-7, 1e-5))


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
    noise: VelocityNoise = NOISE,
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
        found.append(witness.take((seen.real, seen.imag), gained, turned, PERIOD_S, noise))
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
        assert witness.take((0.0, 0.0), still, 0.0, period_s, VelocityNoise(0.0, 0.0)) is None


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


# --- a gyro that turns meanwhile ----------------------------------------------------------------

CALM = VelocityNoise(0.1, 0.0, 0.02 * DEG)


def corrected(turned: Callable[[float], float], is_right: bool, until_s: float) -> Heading | None:
    """Of a heading that was corrected by `turned` until a time; rightly, or by a false field."""
    witness, found = HeadingWitness(), None
    gained = [0j] * len(LATENCIES_S)
    for i in range(round(until_s / PERIOD_S)):
        t = i * PERIOD_S
        frame = 1.0 if is_right else cmath.exp(1j * turned(t))
        for k, back_s in enumerate(LATENCIES_S):
            gained[k] += frame * (velocity(t - back_s) - velocity(t - PERIOD_S - back_s)) / GRAVITY
        pairs = [(part.real, part.imag) for part in gained]
        seen = velocity(t)
        found = witness.take((seen.real, seen.imag), pairs, turned(t), PERIOD_S, CALM)
    return found


@pytest.mark.parametrize("rate_deg_s", [0.1, 0.3])
def test_a_gyro_that_drifts_and_is_corrected_contradicts_no_heading(rate_deg_s: float) -> None:
    found = corrected(lambda t: rate_deg_s * DEG * t, True, 90.0)
    assert found is not None
    assert abs(found.turn_rad) < 2.0 * found.sigma_rad < 24.0 * DEG
    assert found.off_rad == 0.0


def test_a_heading_that_a_false_field_has_turned_at_once_is_found() -> None:
    """The corrections say that the gyro has turned, and it is seen that it has not."""
    found = corrected(lambda t: 40.0 * DEG if t > 60.0 else 0.0, False, 90.0)
    assert found is not None
    assert found.turn_rad == pytest.approx(-40.0 * DEG, abs=found.sigma_rad)
    assert found.contradicts


def test_a_bias_that_is_not_known_doubts_the_heading() -> None:
    def last(drift_rad_s: float) -> Heading:
        noise = VelocityNoise(1.0, 0.0, drift_rad_s)
        found = watch(HeadingWitness(), 20.0 * DEG, (0.0, 90.0), noise=noise)[-1]
        assert found is not None
        return found

    assert 1.5 < last(1.0 * DEG).sigma_rad / last(0.0).sigma_rad < 2.5


# --- a field that is refused --------------------------------------------------------------------

SEEN = Heading(2.0 * DEG, 3.0 * DEG)  # its limit is 12 deg


@pytest.mark.parametrize(
    ("turn_deg", "refused_s", "is_heard"),
    [(13.0, 11.0, True), (13.0, 9.0, False), (10.0, 11.0, False), (25.0, 11.0, False)],
)
def test_a_refused_field_is_heard_where_velocities_allow_it(
    turn_deg: float, refused_s: float, is_heard: bool
) -> None:
    assert RefusedField(turn_deg * DEG, refused_s).is_heard_by(SEEN) is is_heard


@pytest.mark.parametrize(
    ("turn_deg", "seen_deg", "sigma_deg", "is_heard"),
    [
        (74.0, 30.0, 30.0, False),  # they know nothing
        (20.0, 9.0, 11.0, False),  # the filter's heading is nearer to theirs
        (20.0, 11.0, 11.0, True),
        (-20.0, -11.0, 11.0, True),
    ],
)
def test_a_field_that_has_jumped_is_heard_where_velocities_speak_for_it(
    turn_deg: float, seen_deg: float, sigma_deg: float, is_heard: bool
) -> None:
    seen = Heading(seen_deg * DEG, sigma_deg * DEG)
    assert RefusedField(turn_deg * DEG, 11.0, True).is_heard_by(seen) is is_heard
    assert RefusedField(turn_deg * DEG, 11.0).is_heard_by(seen)


@pytest.mark.parametrize(
    ("off_deg", "sigma_deg", "own_deg", "is_doubted"),
    [
        (4.5, 0.3, 0.5, True),
        (3.5, 0.3, 0.5, False),  # a good compass is off by so much
        (9.0, 0.3, 3.5, False),  # the filter itself is no surer
        (13.0, 2.0, 0.5, True),
        (11.0, 2.0, 0.5, False),  # the velocities are no surer
    ],
)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_field_is_doubted_where_velocities_show_clearly_another_heading(
    off_deg: float, sigma_deg: float, own_deg: float, is_doubted: bool, sign: float
) -> None:
    chosen = Mock(spec=VelocityHeading)
    seen = Heading(sign * off_deg * DEG, sigma_deg * DEG)
    VelocityHeading._compare(chosen, seen, (own_deg * DEG) ** 2)
    assert chosen._doubt_field.called is is_doubted
    if not is_doubted:
        chosen._confirm.assert_called_once_with(max(off_deg, 2.0 * sigma_deg) * DEG)

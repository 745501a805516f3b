"""The tilt's predicted deviation is matched to the innovations of velocities, Eq. (63), (64)."""

import math

import pytest
from needs import DEG
from velocity_flights import (
    PERIOD,
    Drive,
    accelerating,
    follow,
    new_filter,
    new_integer_filter,
    part,
    tilt_errors,
    turning,
    wandering,
)

from h2nav.attitude.samples import SensorDoubt
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.kernel.estimate import accel_variance

ZERO = (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def drive() -> Drive:
    """Turns that show the accelerometer's bias, and velocities without errors."""
    return accelerating(120.0, 5, law=turning)


def flown(drive: Drive) -> tuple[VelocityAidedFilter, list[float]]:
    """The filter after a flight, and its deviations of the tilt from 60 s on."""
    filter_ = new_filter(knows_field=True)
    found = follow(filter_, drive)
    sigma = [estimate.sigma_tilt_rad for estimate in found[6000:] if estimate is not None]
    errors = tilt_errors(drive, found, 6000)
    # A receiver that swings by ten of its deviations is at the limit.
    assert max(e / s for e, s in zip(errors, sigma, strict=True)) < 3.0
    return filter_, sigma


def test_the_deviation_is_lower_where_innovations_are_smaller_than_predicted(drive: Drive) -> None:
    sound, low = flown(drive)
    swings, high = flown(wandering(drive, 1.0))
    assert sound.kernel_state.unused_variance > 0.5
    assert swings.kernel_state.unused_variance < 0.5 * sound.kernel_state.unused_variance
    assert low[-1] < 0.8 * high[-1]


def test_what_turns_have_shown_of_the_force_counts_by_the_innovations(drive: Drive) -> None:
    filter_, _ = flown(drive)
    state, gains = filter_.kernel_state, filter_.kernel_gains
    predicted = accel_variance(state, gains, 0.0)
    assert 0.0 < accel_variance(state, gains, 0.8) < 0.25 * predicted


def test_without_turns_the_accelerometers_bias_stays_in_the_deviation() -> None:
    straight = accelerating(90.0, 5, force=lambda _: ZERO, law=lambda _: ZERO)
    filter_, sigma = flown(straight)
    assert filter_.kernel_state.unused_variance > 0.5
    before = math.sqrt(2.0 * filter_.kernel_gains.accel_variance)
    assert min(sigma) > 0.8 * before


@pytest.mark.parametrize("what", ["doubt", "jump"])
def test_what_is_unexpected_raises_it_at_once(drive: Drive, what: str) -> None:
    begun, rest = part(drive, 0, 9000), part(drive, 9000, 9040)
    filter_, _ = flown(begun)
    assert filter_.kernel_state.unused_variance > 0.5
    if what == "doubt":
        filter_.doubt(SensorDoubt(rate_b=(1.0 * DEG,) * 3))
    else:
        follow(filter_, rest._replace(v_n=[(v[0] + 20.0, v[1], v[2]) for v in rest.v_n]))
    assert filter_.kernel_state.unused_variance == 0.0


@pytest.mark.parametrize("count", [1, 4])
@pytest.mark.parametrize("kind", ["floats", "integers"])
def test_fixes_too_wild_for_any_tilt_do_not_open_it(drive: Drive, kind: str, count: int) -> None:
    made = new_filter if kind == "floats" else new_integer_filter
    filter_ = made(knows_field=True)
    wild = range(6000 - count * PERIOD, 6000)
    v_n = [(v[0] + 60.0 * (i in wild), v[1], v[2]) for i, v in enumerate(drive.v_n)]
    found = follow(filter_, part(drive._replace(v_n=v_n), 0, 6400))
    assert filter_.kernel_state.fixes_rejected == 0
    sigmas = [one.sigma_tilt_rad for one in found[5800:] if one is not None]
    assert max(sigmas) < 1.5 * DEG


@pytest.mark.parametrize("kind", ["floats", "integers"])
def test_an_attitude_that_a_failed_sensor_has_bent_is_opened_and_stays_bounded(
    drive: Drive, kind: str
) -> None:
    made = new_filter if kind == "floats" else new_integer_filter
    filter_ = made(knows_field=True)
    found = follow(filter_, part(drive, 0, 6000))
    assert found[-1] is not None
    assert found[-1].sigma_tilt_rad < 1.0 * DEG
    for tilt_rad, least, most in ((0.2, 0.15, 0.21), (1e6, 1.0, math.pi)):
        filter_.doubt(SensorDoubt(tilt_rad=tilt_rad, heading_rad=tilt_rad))
        opened = filter_.update(drive.flight.samples[6000 + round(tilt_rad > 1.0)])
        assert opened is not None
        assert least < opened.sigma_tilt_rad < most
        assert 0.08 < opened.sigma_heading_rad < math.pi

"""The field's offset in body axes: learnt with velocities, honest before and after."""

import math

import pytest
from needs import DEG
from synthetic_imu import FIELD
from velocity_flights import (
    IRON,
    Drive,
    accelerating,
    follow,
    heading_apart,
    new_filter,
    part,
    surge,
    wandering,
    with_iron,
    with_noise,
    with_turned_compass,
)

from h2nav.attitude.samples import Trust, Vec3

NO_BIAS = (0.0, 0.0, 0.0)
NONE: Vec3 = (0.0, 0.0, 0.0)


def share_beyond(drive: Drive, found, first: int = 0) -> float:
    """Of estimates whose heading is off by more than three deviations."""
    pairs = list(zip(drive.flight.q_nb, found, strict=True))[first:]
    beyond = [
        abs(heading_apart(q, e.q_nb)) > 3.0 * e.sigma_heading_rad for q, e in pairs if e is not None
    ]
    return sum(beyond) / len(beyond)


@pytest.mark.parametrize("iron", [NONE, IRON])
def test_an_offset_is_learnt_while_velocities_show_the_heading(iron: Vec3) -> None:
    drive = with_iron(accelerating(90.0, 51, bias_b=NO_BIAS), iron)
    filter_ = new_filter(knows_field=True)
    found = follow(filter_, drive)
    state = filter_.kernel_state
    for learnt, true in zip(state.field_offset, iron, strict=True):
        assert abs(learnt - true) < 0.01
    last = found[-1]
    assert last is not None
    assert abs(heading_apart(drive.flight.q_nb[-1], last.q_nb)) < 1.5 * DEG
    assert share_beyond(drive, found) < 0.02


def test_iron_that_the_norm_shows_is_doubted_until_it_is_learnt() -> None:
    drive = with_iron(accelerating(60.0, 53, bias_b=NO_BIAS))
    filter_ = new_filter(knows_field=True)
    shown = []
    for first in range(0, 6000, 20):
        follow(filter_, part(drive, first, first + 20), latency=0)
        shown.append(filter_.kernel_state.iron_shown)
    assert max(shown) == 1.0
    assert shown[-1] == 0.0


@pytest.mark.parametrize("swing_m_s", [0.0, 1.0])
def test_a_tilt_that_a_receiver_bends_shows_no_iron(swing_m_s: float) -> None:
    drive = wandering(accelerating(60.0, 53, bias_b=NO_BIAS), swing_m_s)
    filter_ = new_filter(knows_field=True)
    for first in range(0, 6000, 20):
        follow(filter_, part(drive, first, first + 20), latency=0)
        assert filter_.kernel_state.iron_shown == 0.0


@pytest.mark.parametrize("fields", [True, False])
def test_shown_iron_counts_only_while_fields_come(fields: bool) -> None:
    drive = with_iron(accelerating(60.0, 53, bias_b=NO_BIAS))
    sigmas = []
    for shown in (0.0, 1.0):
        filter_ = new_filter(knows_field=True)
        follow(filter_, part(drive, 0, 2900))
        follow(filter_, part(drive, 2900, 3020), field=False)
        filter_.kernel_state.iron_shown = shown
        last = follow(filter_, part(drive, 3020, 3200), field=fields)[-1]
        assert last is not None
        sigmas.append(last.sigma_heading_rad)
    assert (sigmas[1] < sigmas[0]) == fields


def test_it_is_not_learnt_without_velocities() -> None:
    drive = with_iron(accelerating(20.0, 52, bias_b=NO_BIAS))
    filter_ = new_filter(knows_field=True)
    for sample in drive.flight.samples:
        filter_.update(sample)
    assert filter_.kernel_state.field_offset[:] == [0.0, 0.0, 0.0]


def test_a_heading_is_as_certain_as_velocities_have_shown_it() -> None:
    """5 % of iron may be in a field that fits in norm and dip."""
    drive = accelerating(90.0, 53, bias_b=NO_BIAS)
    filter_ = new_filter(knows_field=True)
    for sample in drive.flight.samples[:1500]:
        before = filter_.update(sample)
    assert before is not None
    assert before.sigma_heading_rad > 0.05 / math.cos(FIELD.dip_rad)
    after = follow(new_filter(knows_field=True), drive)[-1]
    assert after is not None
    assert after.trust & Trust.VELOCITY_USED
    assert after.sigma_heading_rad < 0.8 * before.sigma_heading_rad


def calm(t: float) -> Vec3:
    """A hover, then accelerations of .3 m/s^2."""
    x, y, z = surge(t)
    return (0.1 * x, 0.1 * y, 0.1 * z) if t > 20.0 else NONE


def slow(t: float) -> Vec3:
    return (0.05 * math.cos(0.7 * t), 0.05 * math.cos(0.9 * t), 0.3 * math.sin(0.15 * t))


@pytest.mark.parametrize(("sigma_deg", "is_used"), [(20.0, False), (29.0, True)])
def test_a_field_far_from_a_heading_by_velocities_is_used_if_that_is_as_uncertain(
    sigma_deg: float, is_used: bool
) -> None:
    """The offset is so uncertain that the innovation's own gate would let it pass."""
    drive = accelerating(32.0, 55, force=calm, law=slow, bias_b=NO_BIAS)
    filter_ = new_filter(knows_field=True)
    follow(filter_, part(drive, 0, 3000))
    state = filter_.kernel_state
    state.heading_witnessed = 1.0
    state.heading_variance = (sigma_deg * DEG) ** 2
    for i in (0, 3, 5):
        state.p_offset[i] = 0.5
    follow(filter_, with_turned_compass(part(drive, 3000, 3050), 50.0 * DEG))
    assert (state.mag_accepted_age_s < 0.3) == is_used


def test_a_turned_compass_does_not_take_back_the_heading_that_velocities_show() -> None:
    flight = accelerating(100.0, 54, force=calm, law=slow, bias_b=NO_BIAS)
    drive = with_turned_compass(with_noise(flight, 0.1, 54), 90.0 * DEG)
    found = follow(new_filter(knows_field=True), drive)
    pairs = list(zip(drive.flight.q_nb, found, strict=True))[5500:]
    assert all(e is not None and abs(heading_apart(q, e.q_nb)) < 12.0 * DEG for q, e in pairs)
    assert share_beyond(drive, found, 5500) == 0.0

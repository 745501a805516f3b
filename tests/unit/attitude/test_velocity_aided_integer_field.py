"""Fields of the default filter in integers: all of a frame count, whatever part they come with."""

import math
import random

import pytest
from integer_flights import new_filter, new_float_filter
from needs import DEG
from synthetic_imu import FIELD, fly, still

from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.attitude.velocity_aided.integer.kernel.heading import LONG_PARTS
from h2nav.attitude.velocity_aided.integer.memory import FRAME
from h2nav.attitude.velocity_aided.units import FIELD_UNIT_UT
from h2nav.maths import quaternion

FIELD_UT = (20.0, 0.0, 40.0)
UNIT_UT = FIELD_UNIT_UT / 2.0**14


def at_rest(number: int, east: int) -> ImuSample:
    """A level sample, whose field is new each time; `east` in units of the integers."""
    x, y, z = FIELD_UT
    field = (x + (number % 2) * UNIT_UT, y + east * UNIT_UT, z)
    return ImuSample(number * 10_000, (0.0, 0.0, 0.0), (0.0, 0.0, -9.80665), field)


def test_the_mean_of_a_frame_is_that_of_all_its_fields() -> None:
    """Those that come with its long parts wait for the next sample that has time to turn them."""
    filter_ = new_filter()
    state = filter_.kernel_state
    number = 0
    while number < 200 or state.phase != 9:
        filter_.update(at_rest(number, 0))
        number += 1
    before = state.mag_ned[1]
    added = 0
    for _ in range(FRAME + 2):
        # until the mean is taken with the first sample of part 10
        east = 64 if (LONG_PARTS >> state.phase) & 1 else 0
        added += east
        filter_.update(at_rest(number, east))
        number += 1
        if state.phase == 11 and number > 200 + FRAME:
            break
    # the last two are of the next frame
    assert state.mag_ned[1] - before == round((added - 2 * 64) / FRAME)


def test_what_a_vehicle_turns_while_a_field_waits_is_undone() -> None:
    """A turn of 60 deg/s about the vertical: 14 ms, the mean of the waits, would be 0.8 deg."""

    def spin(t: float) -> Vec3:
        return (0.0, 0.0, math.pi / 3.0 if t > 2.0 else 0.0)

    flight = fly(spin, 20.0, 3)
    floats, integers = new_float_filter(), new_filter()
    wrong = []
    for sample, q_nb in zip(flight.samples, flight.q_nb, strict=True):
        a, b = floats.update(sample), integers.update(sample)
        if a is not None and b is not None and sample.t_us > 10_000_000:
            wrong.append(quaternion.angle(a.q_nb, b.q_nb))
            assert quaternion.angle(b.q_nb, q_nb) < 0.5 * DEG
    assert sum(wrong) / len(wrong) < 0.1 * DEG


def test_the_level_of_disturbance_is_that_of_single_fields() -> None:
    """Of white noise of 2 % a frame's mean has a sixteenth."""
    rng = random.Random(7)
    floats, integers = new_float_filter(), new_filter()
    for filter_ in (floats, integers):
        filter_.use_field(FIELD)
    flight = fly(still, 30.0, 5)
    for sample in flight.samples:
        assert sample.m_b_ut is not None
        x, y, z = (part + rng.gauss(0.0, 0.02 * FIELD.norm_ut) for part in sample.m_b_ut)
        for filter_ in (floats, integers):
            filter_.update(sample._replace(m_b_ut=(x, y, z)))
    level = integers.kernel_state.mag_disturbance * 2.0**-26
    assert level == pytest.approx(floats.kernel_state.mag_disturbance, rel=0.5)


def test_a_field_that_waits_is_dropped_when_samples_are_clipped() -> None:
    filter_ = new_filter()
    state = filter_.kernel_state
    flight = fly(still, 2.0, 4)
    for sample in flight.samples:
        filter_.update(sample)
        if state.mag_held > 1:
            break
    assert state.mag_held > 1
    filter_.update(sample._replace(t_us=sample.t_us + 10_000, clipped=1))
    assert state.mag_held == 0

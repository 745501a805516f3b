"""Two messages of one sensor are told from two sensors of one vehicle."""

import random

import pytest

from h2nav.attitude.samples import ImuSample
from h2nav.service.twins import Twins, are_apart


def stream(*, noise=0.0, seed=1, steps=300, moves=True, late_us=0):
    """Samples of a vehicle that shakes, cut to 1 mrad/s and 1 mg as messages do."""
    common, own = random.Random(1), random.Random(seed)
    for number in range(steps):
        size = 1.0 if moves else 0.0
        w = [round(common.gauss(0, size) + own.gauss(0, noise), 3) for _ in range(3)]
        f = [round(common.gauss(0, size) + own.gauss(0, noise), 2) for _ in range(3)]
        yield ImuSample(number * 10_000 + late_us, tuple(w), tuple(f))


def are_one(one, other):
    twins = Twins()
    return any(twins.compare(*samples) for samples in zip(one, other, strict=True))


def test_the_same_values_again_and_again_are_one_sensor():
    assert are_one(stream(), stream(late_us=500))


def test_one_sensor_with_another_number_of_digits_is_still_one():
    finer = (
        sample._replace(w_b=tuple(x + 4e-4 for x in sample.w_b)) for sample in stream(late_us=500)
    )
    assert are_one(stream(), finer)


def test_sensors_with_noise_of_their_own_are_two():
    assert not are_one(stream(noise=0.005, seed=2), stream(noise=0.005, seed=3))


def test_at_rest_nothing_is_said():
    assert not are_one(stream(moves=False, steps=5000), stream(moves=False, steps=5000))


def test_samples_of_different_times_are_not_compared():
    assert not are_one(stream(), stream(late_us=5000))


SAMPLE = ImuSample(0, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))


def moved(of, axis, by):
    values = list(getattr(SAMPLE, of))
    values[axis] += by
    return SAMPLE._replace(**{of: tuple(values)})


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("of", "count"), [("w_b", 1.1e-3), ("f_b", 1.1e-2)])
@pytest.mark.parametrize("counts", [1.0, 5.0])
def test_values_are_apart_beyond_so_many_last_digits(axis, sign, of, count, counts):
    assert not are_apart(SAMPLE, moved(of, axis, sign * 0.999 * counts * count), counts)
    assert are_apart(SAMPLE, moved(of, axis, sign * 1.001 * counts * count), counts)


def steps(count, *, size=0.0056, late_us=0):
    """Samples that change by so much each time."""
    for number in range(count):
        yield ImuSample(10_000 * number + late_us, (size * number, 0.0, 0.0), (0.0, 0.0, -9.8))


@pytest.mark.parametrize(
    ("count", "late_us", "size", "are_one_sensor"),
    [
        (100, 0, 0.0056, True),
        (99, 0, 0.0056, False),
        (100, 2_000, 0.0056, True),
        (100, -2_000, 0.0056, True),
        (500, 2_001, 0.0056, False),
        (500, -2_001, 0.0056, False),
        (198, 0, 0.0054, False),  # every other one has changed enough
        (199, 0, 0.0054, True),
    ],
)
def test_a_hundred_changes_that_both_show_are_one_sensor(count, late_us, size, are_one_sensor):
    assert are_one(steps(count, size=size), steps(count, size=size, late_us=late_us)) is (
        are_one_sensor
    )


def test_one_sample_that_differs_begins_anew():
    twins = Twins()
    for number, sample in enumerate(steps(199)):
        other = sample._replace(f_b=(0.0, 0.0, -9.5)) if number == 99 else sample
        assert not twins.compare(sample, other)
    assert twins.compare(sample._replace(w_b=(9.0, 0.0, 0.0)), sample._replace(w_b=(9.0, 0.0, 0.0)))

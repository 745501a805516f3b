"""Two messages of one sensor are told from two sensors of one vehicle."""

import random

from h2nav.attitude.samples import ImuSample
from h2nav.service.twins import Twins


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

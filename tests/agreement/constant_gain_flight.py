"""One flight for the constant-gain filter in integers and in floats."""

import math
from functools import partial
from pathlib import Path

import numpy as np
from agreement.constant_gain_compiled import BIAS, CompiledReference, Q

from h2nav.attitude.batch_driver import Table, empty_table
from h2nav.attitude.constant_gain.filter import fill_sample
from h2nav.attitude.constant_gain.gains import (
    BIAS_UNIT,
    ConstantIntegerGains,
    constant_gains,
    integer_gains,
)
from h2nav.attitude.constant_gain.kernel.step import reset, update
from h2nav.attitude.constant_gain.memory import Gains, Sample, State
from h2nav.attitude.gains.densities import SensorDensities
from h2nav.attitude.kernel_files import CONSTANT_GAIN
from h2nav.attitude.native import RESULT_COLUMNS, compiled_step
from h2nav.attitude.record import assign, copy, in_c
from h2nav.attitude.samples import EarthField

FIELD = EarthField(50.0, math.radians(60.0), 0.0)
DENSITIES = SensorDensities(1e-3, 2e-5, 0.3, 5.0, 9.80665, FIELD)


def image_at(rate_hz: int) -> ConstantIntegerGains:
    return integer_gains(constant_gains(DENSITIES, rate_hz, 1.0), "test")


class Kernel:
    """The filter in integers: compiled or, while its text in Python is another, in Python.

    Args:
        image: its gains.
    """

    def __init__(self, image: ConstantIntegerGains) -> None:
        self._compiled = compiled_step(CONSTANT_GAIN)
        types = State, Gains, Sample
        records = [kind() if self._compiled is None else in_c(kind) for kind in types]
        self.memory, self.gains, self.sample = records
        reset(self.memory)
        copy(image.gains, self.gains, Gains)
        bound = partial(update, *records)
        self.step = bound if self._compiled is None else self._compiled.bound(*records)

    def run(self, samples: Table) -> np.ndarray:
        """Attitude and bias (N, 7) after each sample."""
        if self._compiled is not None:
            results = np.empty((len(samples), RESULT_COLUMNS), dtype=np.int32)
            self._compiled.run((self.memory, self.gains), samples, results)
            return results[:, :7]
        found = []
        for numbers in samples.view(np.int32).reshape(len(samples), -1).tolist():
            assign(self.sample, Sample, numbers)
            self.step()
            found.append([*self.memory.q_nb, *self.memory.gyro_bias])
        return np.array(found)


class Flight:
    """A flight of permanent turns with noise, a field with every other sample.

    Args:
        folder: where the reference is built.
        rate_hz: of the samples.
        seed: of the noise.
    """

    def __init__(self, folder: Path, rate_hz: int, seed: int) -> None:
        self._rate_hz, self._flown = rate_hz, 0
        image, self._rng = image_at(rate_hz), np.random.default_rng(seed)
        assert image.gains.boost == 3  # what the reference does
        boost_s = 1e-6 * (1 << image.gains.boost_shift)
        self.reference = CompiledReference(folder, image.rounded, boost_s)
        self.kernel = Kernel(image)

    def samples(self, count: int) -> np.ndarray:
        """The next rows of rate, gravity, field, has field."""
        index = np.arange(self._flown, self._flown + count)
        self._flown += count
        t, rng = index / self._rate_hz, self._rng
        rates = np.stack(
            [0.8 * np.sin(0.7 * t), 0.6 * np.cos(0.45 * t), 0.5 * np.sin(0.31 * t + 1.0)], axis=1
        )
        matrices = self.reference.fly(rates)
        table = np.empty((count, 10))
        table[:, :3] = rates + np.array([2e-3, -1e-3, 1.5e-3]) + rng.normal(0.0, 2e-3, (count, 3))
        table[:, 3:6] = matrices[:, 2, :] + rng.normal(0.0, 0.01, (count, 3))
        field = math.cos(FIELD.dip_rad) * matrices[:, 0] + math.sin(FIELD.dip_rad) * matrices[:, 2]
        table[:, 9] = index % 2
        table[:, 6:9] = (field + rng.normal(0.0, 0.01, (count, 3))) * table[:, 9:]
        return table

    def deviations_deg(self, count: int) -> np.ndarray:
        """Angle between integers and floats after each of the next samples; biases stay equal."""
        table = self.samples(count)
        integers = self._integers_of(table)
        memory = self.kernel.memory
        if memory.age_us < 0:  # the first sample aligns
            first = Sample()
            fill_sample(first, tuple(table[0, :3]), tuple(table[0, 3:6]), None, 0)
            assert first.gyro == integers["gyro"][0].tolist()
            assert first.gravity == integers["gravity"][0].tolist()
            update(memory, self.kernel.gains, first)
            assert memory.age_us == 0
            self.reference.start(np.array(memory.q_nb, dtype=float))
            table, integers = table[1:], integers[1:]
        results, expected = self.kernel.run(integers), self.reference.run(table)
        assert np.abs(results[:, 4:] / BIAS_UNIT - expected[:, BIAS]).max() < 2e-5
        q = results[:, :4] / np.linalg.norm(results[:, :4].astype(float), axis=1)[:, None]
        q *= np.sign(np.sum(q * expected[:, Q], axis=1))[:, None]
        chords = np.linalg.norm(q - expected[:, Q], axis=1)
        angles: np.ndarray = np.degrees(4.0 * np.arcsin(0.5 * chords))
        return angles

    def _integers_of(self, table: np.ndarray) -> Table:
        """The same samples as the kernel takes them."""
        integers = empty_table(Sample, len(table))
        integers["gyro"] = np.floor(table[:, :3] * 1e-6 * 2.0**40 + 0.5)
        integers["gravity"] = np.floor(table[:, 3:6] * 2.0**14 + 0.5)
        integers["mag"] = np.floor(table[:, 6:9] * 2.0**14 + 0.5)
        integers["has_mag"] = -table[:, 9]
        integers["dt_us"] = 1_000_000 // self._rate_hz
        return integers

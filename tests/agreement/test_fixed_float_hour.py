"""A whole hour at 400 Hz: the integer filter against the same equations in floats, compiled."""

import math
from pathlib import Path

import needs
import numpy as np
import pytest
from agreement.constant_gain_compiled import BIAS, MEMORY_SIZE, CompiledReference, Q
from agreement.constant_gain_reference import ConstantGainReference
from agreement.test_fixed_float import FIELD, image_at, started

from h2nav.attitude.batch_driver import Table, empty_table
from h2nav.attitude.constant_gain.filter import fill_sample
from h2nav.attitude.constant_gain.gains import BIAS_UNIT
from h2nav.attitude.constant_gain.kernel.step import update
from h2nav.attitude.constant_gain.memory import Gains, Sample, State
from h2nav.attitude.kernel_files import CONSTANT_GAIN
from h2nav.attitude.native import RESULT_COLUMNS, compiled_step
from h2nav.attitude.record import assign, in_c, values

RATE_HZ = 400
DT_US = 1_000_000 // RATE_HZ
ROWS = 60 * RATE_HZ  # at a time
IMAGE = image_at(RATE_HZ)
BOOST_S = 1e-6 * (1 << IMAGE.gains.boost_shift)


def samples_of(reference: CompiledReference, first: int, rng: np.random.Generator) -> np.ndarray:
    """One minute of the flight of test_fixed_float.py: rows of rate, gravity, field, has field."""
    index = np.arange(first, first + ROWS)
    t = index / RATE_HZ
    rates = np.stack(
        [0.8 * np.sin(0.7 * t), 0.6 * np.cos(0.45 * t), 0.5 * np.sin(0.31 * t + 1.0)], axis=1
    )
    matrices = reference.fly(rates)
    table = np.empty((ROWS, 10))
    table[:, :3] = rates + np.array([2e-3, -1e-3, 1.5e-3]) + rng.normal(0.0, 2e-3, (ROWS, 3))
    table[:, 3:6] = matrices[:, 2, :] + rng.normal(0.0, 0.01, (ROWS, 3))
    field = math.cos(FIELD.dip_rad) * matrices[:, 0] + math.sin(FIELD.dip_rad) * matrices[:, 2]
    table[:, 9] = index % 2
    table[:, 6:9] = (field + rng.normal(0.0, 0.01, (ROWS, 3))) * table[:, 9:]
    return table


def integers_of(table: np.ndarray) -> Table:
    """The same samples as the kernel takes them."""
    integers = empty_table(Sample, len(table))
    integers["gyro"] = np.floor(table[:, :3] * 1e-6 * 2.0**40 + 0.5)
    integers["gravity"] = np.floor(table[:, 3:6] * 2.0**14 + 0.5)
    integers["mag"] = np.floor(table[:, 6:9] * 2.0**14 + 0.5)
    integers["has_mag"] = -table[:, 9]
    integers["dt_us"] = DT_US
    return integers


def test_compiled_reference_is_the_reference(tmp_path: Path) -> None:
    compiled = CompiledReference(tmp_path, IMAGE.rounded, BOOST_S)
    table = samples_of(compiled, 0, np.random.default_rng(3))[:8000]
    table[100::700, 3:6] *= 1.5  # beyond the gates
    table[101::900, 6:9] *= 1.5
    start = np.array([1.0, 0.02, -0.03, 0.05])
    compiled.start(start)
    found = compiled.run(table)
    plain = ConstantGainReference(IMAGE.rounded, list(start), BOOST_S)
    for row in table:
        plain.update(row[:3], row[3:6], row[6:9] if row[9] else None, 1.0 / RATE_HZ)
    assert found[-1, Q] == pytest.approx(plain.q, abs=1e-10)
    assert found[-1, BIAS] == pytest.approx(plain.bias, abs=1e-11)
    assert compiled.memory.shape == (MEMORY_SIZE,)


def test_an_hour_at_400_hz_shows_no_drift(tmp_path: Path) -> None:
    step = compiled_step(CONSTANT_GAIN)
    if step is None:
        needs.absent("the compiled kernels are not built")
    assert IMAGE.gains.boost == 3  # what the reference does
    reference = CompiledReference(tmp_path, IMAGE.rounded, BOOST_S)
    rng = np.random.default_rng(1)
    memory, gains = in_c(State), in_c(Gains)
    assign(gains, Gains, values(IMAGE.gains, Gains))
    minutes = []
    for minute in range(60):
        table = samples_of(reference, minute * ROWS, rng)
        integers = integers_of(table)
        if minute == 0:  # the first sample aligns
            first, start = Sample(), started()
            fill_sample(first, tuple(table[0, :3]), tuple(table[0, 3:6]), None, 0)
            assert first.gyro == integers["gyro"][0].tolist()
            assert first.gravity == integers["gravity"][0].tolist()
            update(start, IMAGE.gains, first)
            assert start.age_us == 0
            assign(memory, State, values(start, State))
            reference.start(np.array(start.q_nb, dtype=float))
            table, integers = table[1:], integers[1:]
        results = np.empty((len(table), RESULT_COLUMNS), dtype=np.int32)
        step.run((memory, gains), integers, results)
        expected = reference.run(table)
        q = results[:, :4] / np.linalg.norm(results[:, :4].astype(float), axis=1)[:, None]
        q *= np.sign(np.sum(q * expected[:, Q], axis=1))[:, None]
        minutes.append(4.0 * np.arcsin(0.5 * np.linalg.norm(q - expected[:, Q], axis=1)))
        bias = results[:, 4:7] / BIAS_UNIT
        assert np.abs(bias - expected[:, BIAS]).max() < 2e-5
    assert memory.saturations == 0
    angles = np.degrees(np.concatenate(minutes))
    quarters = [math.sqrt(np.mean(part**2)) for part in np.array_split(angles, 4)]
    assert angles.max() < 6e-3
    assert math.sqrt(np.mean(angles**2)) < 3e-3
    assert max(quarters) < 1.5 * quarters[0]

"""A whole hour at 400 Hz: the integer filter against the same equations in floats, compiled."""

import math
from pathlib import Path

import needs
import numpy as np
import pytest
from agreement.constant_gain_compiled import BIAS, MEMORY_SIZE, CompiledReference, Q
from agreement.constant_gain_reference import ConstantGainReference
from agreement.test_fixed_float import FIELD, image_at

from h2nav.attitude.constant_gain.filter import sample_integers
from h2nav.attitude.constant_gain.gains import BIAS_UNIT
from h2nav.attitude.kernels import fixed_lean as kernel
from h2nav.attitude.native import native_kernels

RATE_HZ = 400
DT_US = 1_000_000 // RATE_HZ
ROWS = 60 * RATE_HZ  # at a time
IMAGE = image_at(RATE_HZ)
BOOST_S = 1e-6 * (1 << IMAGE.params[kernel.BOOST_SHIFT])


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


def integers_of(table: np.ndarray) -> np.ndarray:
    """The same samples as the kernel takes them."""
    integers = np.empty((len(table), kernel.SAMPLE_SIZE), dtype=np.int32)
    integers[:, :3] = np.floor(table[:, :3] * 1e-6 * 2.0**40 + 0.5)
    integers[:, 3:9] = np.floor(table[:, 3:9] * 2.0**14 + 0.5)
    integers[:, 9] = -table[:, 9]
    integers[:, 10] = DT_US
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
    native = native_kernels()
    if native is None:
        needs.absent("the compiled kernels are not built")
    assert IMAGE.params[kernel.BOOST] == 3  # what the reference does
    reference = CompiledReference(tmp_path, IMAGE.rounded, BOOST_S)
    rng = np.random.default_rng(1)
    params = np.array(IMAGE.params, dtype=np.int32)
    memory = np.zeros(kernel.STATE_SIZE, dtype=np.int32)
    minutes = []
    for minute in range(60):
        table = samples_of(reference, minute * ROWS, rng)
        integers = integers_of(table)
        if minute == 0:  # the first sample aligns
            row = table[0]
            state = [0] * kernel.STATE_SIZE
            kernel.reset(state)
            first = sample_integers(tuple(row[:3]), tuple(row[3:6]), None, 0)
            assert first[:9] == integers[0, :9].tolist()
            kernel.update(state, list(IMAGE.params), first)
            assert state[kernel.AGE_US] == 0
            memory[:] = state
            reference.start(memory[:4].astype(float))
            table, integers = table[1:], integers[1:]
        results = np.empty((len(table), 8), dtype=np.int32)
        native.run_fixed_lean(memory, params, integers, kernel.SAMPLE_SIZE, results)
        expected = reference.run(table)
        q = results[:, :4] / np.linalg.norm(results[:, :4].astype(float), axis=1)[:, None]
        q *= np.sign(np.sum(q * expected[:, Q], axis=1))[:, None]
        minutes.append(4.0 * np.arcsin(0.5 * np.linalg.norm(q - expected[:, Q], axis=1)))
        bias = results[:, 4:7] / BIAS_UNIT
        assert np.abs(bias - expected[:, BIAS]).max() < 2e-5
    assert memory[kernel.SATURATIONS] == 0
    angles = np.degrees(np.concatenate(minutes))
    quarters = [math.sqrt(np.mean(part**2)) for part in np.array_split(angles, 4)]
    assert angles.max() < 6e-3
    assert math.sqrt(np.mean(angles**2)) < 3e-3
    assert max(quarters) < 1.5 * quarters[0]

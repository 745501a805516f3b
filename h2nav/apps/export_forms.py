"""The integer filters of `h2nav export c`: their gains as integers, test vectors."""

import random
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from h2nav.attitude.constant_gain import memory as constant_gain
from h2nav.attitude.constant_gain.gains import integer_gains_of
from h2nav.attitude.constant_gain.kernel import step as constant_gain_step
from h2nav.attitude.gains.envelope import GainFile
from h2nav.attitude.record import assign, row, rows, values
from h2nav.attitude.samples import VehicleState
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.integer import memory as velocity_aided
from h2nav.attitude.velocity_aided.integer.filter import parts_of
from h2nav.attitude.velocity_aided.integer.gains import integer_gains
from h2nav.attitude.velocity_aided.integer.kernel import start, step
from h2nav.attitude.velocity_aided.shell import LONGEST_GAP_US, forward_speed_m_s, rest_prior
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.translate.firmware import IntegerForm, Row
from h2nav.translate.firmware_constant_gain import CONSTANT_GAIN
from h2nav.translate.firmware_velocity_aided import VELOCITY_AIDED

SEED = 1  # of the samples that an export is checked with


class Image(NamedTuple):
    """A gain file in the form of an integer filter."""

    gains: Any  # of the kernel, a record
    rounding_error: float  # largest relative change of a gain
    constants: tuple[Row, ...]  # for the interface in C


class Vectors(NamedTuple):
    """Test vectors of an exported filter, made by the same filter in Python."""

    samples: list[list[int]]  # numbers of each sample
    bits: list[int]  # result of each step
    final: list[int]  # numbers of the memory at the end


class ExportedForm(NamedTuple):
    """An integer filter with everything for its export."""

    text: IntegerForm  # its C text
    former_name: str  # earlier name on the command line
    kinds: tuple[str, ...]  # of suitable gain files; the first form of a kind is its default
    # integers of a gain file; raises BadInput if they do not fit their formats
    image: Callable[[GainFile, str], Image]
    vectors: Callable[[Any], Vectors]  # test vectors with these gains


def _constant_gain_image(file: GainFile, place: str) -> Image:
    image = integer_gains_of(file, place)
    return Image(image.gains, image.rounding_error, ())


def _velocity_aided_image(file: GainFile, place: str) -> Image:
    gains = velocity_aided_gains(file, place)
    image = integer_gains(gains, place)
    unknown = VehicleState()
    speed = forward_speed_m_s(gains, unknown) / GRAVITY_M_S2
    constants = (
        ("REST_UNKNOWN", rest_prior(gains, unknown), "rest_prior when nothing is known"),
        (
            "SPEED_UNKNOWN",
            row(velocity_aided.Sample, "forward_speed").fixed(speed),
            "forward_speed when nothing is known",
        ),
    )
    return Image(image.gains, image.rounding_error, constants)


def _vectors(
    memory: Any, sample_type: type, samples: Sequence[Any], step_of: Callable[[Any], int]
) -> Vectors:
    flat = [_integers(sample, sample_type) for sample in samples]
    bits = [step_of(sample) for sample in samples]
    return Vectors(flat, bits, _integers(memory, type(memory)))


def _integers(record: object, record_type: type) -> list[int]:
    return [int(number) for number in values(record, record_type)]


def constant_gain_vectors(gains: constant_gain.Gains) -> Vectors:
    """Ordinary motion first, then random numbers within the formats."""
    memory = constant_gain.State()
    constant_gain_step.reset(memory)
    return _vectors(
        memory,
        constant_gain.Sample,
        constant_gain_samples(),
        lambda sample: constant_gain_step.update(memory, gains, sample),
    )


def velocity_aided_vectors(gains: velocity_aided.Gains) -> Vectors:
    """Motion with fields, then also with fixes, then random numbers within the formats."""
    memory = velocity_aided.State()
    start.reset(memory, gains)
    return _vectors(
        memory,
        velocity_aided.Sample,
        velocity_aided_samples(),
        lambda sample: step_of_any_length(memory, gains, sample),
    )


def step_of_any_length(
    memory: velocity_aided.State, gains: velocity_aided.Gains, sample: velocity_aided.Sample
) -> int:
    """The counterpart of ``h2nav_step`` of the velocity-aided filter; leaves the sample as is."""
    given = sample.dt_us, sample.has_mag, sample.has_fix
    bits = 0
    if sample.dt_us > LONGEST_GAP_US:
        sample.dt_us = 0
        bits = start.resume(memory, gains, sample)
    else:
        for part in parts_of(sample, sample.dt_us):
            bits |= step.update(memory, gains, part)
    sample.dt_us, sample.has_mag, sample.has_fix = given
    return bits


def _anything(record_type: type, rng: random.Random) -> Any:
    """A record with every number random in its range."""
    record = record_type()
    numbers = [
        rng.randint(*(found.range or (0, 0)))
        for found in rows(record_type)
        for _ in range(found.length)
    ]
    assign(record, record_type, numbers)
    return record


def constant_gain_samples() -> list[constant_gain.Sample]:
    """Ordinary motion first, then random numbers within the formats."""
    rng, count = random.Random(SEED), 400
    samples = []
    for number in range(count):
        if number >= count // 2:
            sample = _anything(constant_gain.Sample, rng)
        else:
            rates = [rng.randint(-1100000, 1100000) for _ in range(3)]
            vectors = [v + rng.randint(-300, 300) for v in (0, 0, 16384, 8192, 0, 14189)]
            sample = constant_gain.Sample(
                rates, vectors[:3], vectors[3:], has_mag=-(number & 1), dt_us=10000
            )
        samples.append(sample)
    return samples


def velocity_aided_samples() -> list[velocity_aided.Sample]:
    """Motion with fields, then also with fixes, then random numbers; some samples are long.

    At most as many rows as fit into 32 kB, the largest table of an AVR, and with the filter into
    the 128 kB of an ATmega1284P.
    """
    rng, count = random.Random(SEED), 208
    samples = []
    for number in range(count):
        if number >= count * 3 // 4:
            sample = _anything(velocity_aided.Sample, rng)
        else:
            sample = velocity_aided.Sample(parts=1, fix_variance=170000, fix_period_us=200000)
            sample.gyro = [rng.randint(-1100000, 1100000) for _ in range(3)]
            for axis, (force, field) in enumerate(((0, 6400), (0, 0), (-(1 << 20), 11085))):
                sample.accel[axis] = force + rng.randint(-20000, 20000)
                sample.mag[axis] = field + rng.randint(-100, 100)
            sample.has_mag = number & 1
            sample.aided = int(number >= count // 4)
            sample.has_fix = int(number >= count // 4 and number % 20 == 0)
        sample.dt_us = {37: 30000, 90: 100001, 130: 200000}.get(number, 10000)
        samples.append(sample)
    return samples


FORMS: Final = (
    ExportedForm(
        VELOCITY_AIDED, "flight", ("velocity_aided",), _velocity_aided_image, velocity_aided_vectors
    ),
    ExportedForm(
        CONSTANT_GAIN,
        "lean",
        ("two_stage", "velocity_aided"),
        _constant_gain_image,
        constant_gain_vectors,
    ),
)

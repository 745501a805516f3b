"""The forms of the integer filter for `h2nav export c`: image of the gains, test vectors."""

import random
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from h2nav.attitude.fixed_flight import parts_of
from h2nav.attitude.fixed_gains import fixed_image
from h2nav.attitude.flight_gains import flight_image
from h2nav.attitude.gains import GainFile
from h2nav.attitude.kernels import fixed_flight, fixed_flight_start, fixed_lean, fixed_motion
from h2nav.attitude.kernels import fixed_flight_layout as flight
from h2nav.attitude.samples import VehicleState
from h2nav.attitude.shaped import LONGEST_GAP_S, nose_velocity_m_s, rest_belief
from h2nav.attitude.shaped_gains import GRAVITY_M_S2, shaped_gains
from h2nav.maths.fixedpoint import to_fixed
from h2nav.translate.firmware import IntegerForm, Row
from h2nav.translate.firmware_flight import FLIGHT
from h2nav.translate.firmware_lean import LEAN

Words = list[int]
_LONGEST_GAP_US = round(LONGEST_GAP_S * 1e6)


class Image(NamedTuple):
    """What a gain file is to a form.

    Attributes:
        params: of the kernel.
        rounding_error: largest relative change of a gain.
        constants: for the interface in C.
    """

    params: tuple[int, ...]
    rounding_error: float
    constants: tuple[Row, ...]


class ExportedForm(NamedTuple):
    """A form with all that an export needs.

    Attributes:
        text: what it is in C.
        kinds: of gain files that it can be made from; the first form of a kind is its usual one.
        image: integers of a gain file; BadInput when its formats do not hold them.
        start: memory of a new filter, from the parameters.
        step: what ``h2nav_step`` does: memory, parameters, sample -> bits.
        samples: for the test vectors.
    """

    text: IntegerForm
    kinds: tuple[str, ...]
    image: Callable[[GainFile, str], Image]
    start: Callable[[Sequence[int]], Words]
    step: Callable[[Words, Words, Words], int]
    samples: Callable[[], list[Words]]


def _lean_image(file: GainFile, place: str) -> Image:
    image = fixed_image(file, place)
    return Image(image.params, image.rounding_error, ())


def _lean_start(_params: Sequence[int]) -> Words:
    state = [0] * fixed_lean.STATE_SIZE
    fixed_lean.reset(state)
    return state


def _flight_image(file: GainFile, place: str) -> Image:
    gains = shaped_gains(file, place)
    image = flight_image(gains, place)
    untold = VehicleState()
    ends = flight.SAMPLE_RANGES[flight.NOSE]
    nose = to_fixed(nose_velocity_m_s(gains, untold) / GRAVITY_M_S2, 11, *ends)
    constants = (
        ("REST_UNTOLD", rest_belief(gains, untold), "word REST of a vehicle that tells nothing"),
        ("NOSE_UNTOLD", nose, "word NOSE of it"),
    )
    return Image(image.params, image.rounding_error, constants)


def _flight_start(params: Sequence[int]) -> Words:
    state = [0] * flight.STATE_SIZE
    fixed_flight_start.reset(state)
    fixed_flight_start.prepare(state, list(params))
    return state


def flight_step(state: Words, params: Words, sample: Words) -> int:
    """What ``h2nav_step`` of the flight form does, for a sample of any length."""
    dt_us = sample[fixed_motion.DT_US]
    if dt_us > _LONGEST_GAP_US:
        fixed_flight_start.restart(state)
        dt_us = 0
    bits = 0
    for part in parts_of(list(sample), dt_us):
        bits |= fixed_flight.update(state, params, part)
    return bits


def lean_samples(rows: int = 400, seed: int = 1) -> list[Words]:
    """Ordinary motion first, then whatever the formats hold."""
    rng = random.Random(seed)
    samples = []
    for row in range(rows):
        if row >= rows // 2:
            sample = [rng.randint(low, high) for low, high in fixed_lean.SAMPLE_RANGES]
        else:
            rates = [rng.randint(-1100000, 1100000) for _ in range(3)]
            vectors = [v + rng.randint(-300, 300) for v in (0, 0, 16384, 8192, 0, 14189)]
            sample = [*rates, *vectors, -(row & 1), 10000]
        samples.append(sample)
    return samples


def flight_samples(rows: int = 360, seed: int = 1) -> list[Words]:
    """Motion with fields, then with fixes too, then whatever the formats hold; some are long.

    No more rows than fit 32 kB, the largest table of an AVR.
    """
    rng = random.Random(seed)
    samples = []
    for row in range(rows):
        if row >= rows * 3 // 4:
            sample = [rng.randint(low, high) for low, high in flight.SAMPLE_RANGES]
        else:
            sample = [0] * flight.SAMPLE_SIZE
            sample[:3] = [rng.randint(-1100000, 1100000) for _ in range(3)]
            for axis, (force, field) in enumerate(((0, 6400), (0, 0), (-(1 << 20), 11085))):
                sample[flight.A_X + axis] = force + rng.randint(-20000, 20000)
                sample[flight.F_FIELD + axis] = field + rng.randint(-100, 100)
            sample[flight.HAS_FIELD] = row & 1
            sample[flight.IS_AIDED] = int(row >= rows // 4)
            sample[flight.HAS_FIX] = int(row >= rows // 4 and row % 20 == 0)
            sample[flight.FIX_VARIANCE] = 170000
            sample[flight.FIX_PERIOD_US] = 200000
        sample[fixed_motion.DT_US] = {37: 30000, 90: 100001, 340: 1500000}.get(row, 10000)
        samples.append(sample)
    return samples


FORMS: Final = (
    ExportedForm(FLIGHT, ("shaped",), _flight_image, _flight_start, flight_step, flight_samples),
    ExportedForm(
        LEAN,
        ("two_stage", "shaped"),
        _lean_image,
        _lean_start,
        fixed_lean.update,
        lean_samples,
    ),
)

"""From a disturbance model to a certified gain file of kind velocity_aided.

A gain set is the H2-optimal observer of one horizontal axis: the tilt is driven by gyro noise, the
velocity by the tilt, and the velocity is what is (pseudo-)measured. The gain depends on nothing but
omega0^2 = g sigma_w / n_v, so a ladder of sets, a factor 2 apart, serves every pair of noises.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from h2nav.attitude.gains.envelope import GainFile
from h2nav.attitude.record import values
from h2nav.attitude.velocity_aided.gains import (
    LIMITS,
    GainSets,
    class_complaints,
    sets_of,
    velocity_aided_gains,
)
from h2nav.attitude.velocity_aided.integer.gains import integer_gains, rounded_sets
from h2nav.attitude.velocity_aided.integer.memory import PERIODS, SETS, Gains
from h2nav.attitude.velocity_aided.parameters import PARAMETERS
from h2nav.errors import BadInput
from h2nav.maths.units import DEG
from h2nav.synthesis.certificate import accept, compared, spectrum
from h2nav.synthesis.gain_certificate import Loop, certified
from h2nav.synthesis.method import Candidate
from h2nav.synthesis.plant import Matrix, Plant, discretise
from h2nav.synthesis.riccati import solve_riccati
from h2nav.validation import key_complaints, numbers_within

# omega0^2 of the slowest set, 1/s^2: omega0 = 0.044 rad/s, slower than any vehicle class needs.
SLOWEST = 2.0**-9
STEP = 2.0
# Velocity fixes come at 10, 5, 2 and 1 Hz.
FIX_PERIODS_S = (0.1, 0.2, 0.5, 1.0)
assert len(FIX_PERIODS_S) == PERIODS
FIXED_POINT_FORMAT = "flight-2"

_USUAL = {row.key: row.usual for row in PARAMETERS if row.usual is not None}
_MODEL_KEYS = ("kind", "name", "source", "vehicle_class", "disturbance")


class Synthesis(NamedTuple):
    """A gain file and figures that are not written into it."""

    file: GainFile  # certified
    wall_time_s: dict[str, float]  # time in the solvers, per method


def tilt_plant(gyro_density: float, velocity_density: float) -> Plant:
    """One horizontal axis: states (tilt rad, velocity over g in s), the velocity measured.

    Args:
        gyro_density: rad/s/sqrt(Hz).
        velocity_density: of the pseudo-measurement, over g, s/sqrt(Hz).

    Source: docs/filter.md Eq. (3).
    """
    return Plant(
        A=np.array([[0.0, 0.0], [1.0, 0.0]]),
        B_w=np.array([[gyro_density, 0.0], [0.0, 0.0]]),
        C_y=np.array([[0.0, 1.0]]),
        D_w=np.array([[0.0, velocity_density]]),
        C_z=np.array([[1.0, 0.0]]),
    )


def tilt_gain(gyro_density: float, velocity_density: float) -> Candidate:
    """The continuous H2 gain in closed form: a second-order Butterworth filter.

    Source: docs/filter.md Eq. (9), (11).
    """
    squared = gyro_density / velocity_density
    k_velocity = np.sqrt(2.0 * squared)
    norm = velocity_density * np.sqrt(squared * k_velocity)
    return Candidate("closed_form", np.array([[squared], [k_velocity]]), float(norm))


def synthesize(
    document: Mapping[str, object], rate_hz: float, place: str, lmi_solvers: Sequence[str]
) -> Synthesis:
    """Synthesises the certified gain sets of a disturbance model at a rate.

    Args:
        document: the model file's mapping, `kind: velocity_aided`.
        rate_hz: sample rate of the filter.
        place: the model's file, for errors.
        lmi_solvers: solvers of the H2 LMI, besides Riccati and closed form.

    Raises:
        BadInput: a key of the model is missing, unknown or outside its limits.
        CertificateError: no trustworthy gain; cannot happen for a model inside its limits.
    """
    disturbance = checked_model(document, place)
    gyro = _gyro_density(disturbance)
    methods: dict[str, object] = {}
    wall_time_s: dict[str, float] = {}
    for number in range(SETS):
        continuous = _plant(gyro, number)
        closed_form = tilt_gain(gyro, gyro / _squared(number))
        methods[f"set_{number}"] = {
            "continuous": _compare(continuous, closed_form, lmi_solvers, wall_time_s),
            "discrete": _compare(
                discretise(continuous, 1.0 / rate_hz),
                solve_riccati(discretise(continuous, 1.0 / rate_hz)),
                lmi_solvers,
                wall_time_s,
            ),
        }
    file = GainFile(
        kind="velocity_aided",
        name=f"{document['name']}_{rate_hz:g}hz",
        rate_hz=rate_hz,
        model=dict(document),
        gains={
            "vehicle_class": document["vehicle_class"],
            **{key: disturbance.get(key, _USUAL.get(key)) for key in LIMITS},
            **_tables(gain_ladder(gyro, rate_hz)),
        },
        methods=methods,
        certificate={},
        fixed_point={},
        made_by="h2nav synthesize",
    )
    image = fixed_point_section(file, place)
    return Synthesis(certified(file, loops(file, place), image), wall_time_s)


def gain_ladder(gyro_density: float, rate_hz: float) -> GainSets:
    """The gains of every set, discrete and optimal at the rate and at every fix period."""
    per_step = [_discrete_gain(gyro_density, number, 1.0 / rate_hz) for number in range(SETS)]
    at_fix = [
        [_discrete_gain(gyro_density, number, period) for number in range(SETS)]
        for period in FIX_PERIODS_S
    ]
    return GainSets(
        bounds=tuple(_squared(number) ** 2 * STEP for number in range(SETS - 1)),
        k_tilt=tuple(float(L[0, 0]) * rate_hz for L in per_step),
        k_velocity=tuple(float(L[1, 0]) * rate_hz for L in per_step),
        fix_periods=FIX_PERIODS_S,
        k_fix_tilt=tuple(tuple(float(L[0, 0]) for L in row) for row in at_fix),
        k_fix_velocity=tuple(tuple(float(L[1, 0]) for L in row) for row in at_fix),
    )


def loops(file: GainFile, place: str) -> list[Loop]:
    """The closed loops of a file of this kind, with plants rebuilt from its model.

    Raises:
        BadInput: a section of the file is not what this kind needs.
    """
    velocity_aided_gains(file, place)
    return _loops_of(file, place, sets_of(file.gains))


def fixed_point_section(file: GainFile, place: str) -> dict[str, object]:
    """The `fixed_point` section: image, rounding error, stability of the loops after rounding.

    The spectral radius is the largest of the loops that `loops` gives, with the rounded gains. A
    model that the integers do not hold serves the filter in floats; the section then says why.

    Raises:
        BadInput: the file's gains are not usable.
    """
    gains = velocity_aided_gains(file, place)
    try:
        image = integer_gains(gains, file.name)
    except BadInput as error:
        return {"format": FIXED_POINT_FORMAT, "refused": str(error)}
    rounded = _loops_of(file, place, rounded_sets(image.gains, sets_of(file.gains)))
    radii = [spectrum(loop.plant, loop.L)[1] or 0.0 for loop in rounded]
    return {
        "format": FIXED_POINT_FORMAT,
        "params": values(image.gains, Gains),
        "rounding_error": image.rounding_error,
        "spectral_radius": max(radii),
    }


def _loops_of(file: GainFile, place: str, sets: GainSets) -> list[Loop]:
    """The loops of some gain sets with the plants of a file's model."""
    gyro = _gyro_density(checked_model(file.model, place))
    dt_s = 1.0 / file.rate_hz
    result = []
    for number in range(SETS):
        L = np.array([[sets.k_tilt[number] * dt_s], [sets.k_velocity[number] * dt_s]])
        result.append(Loop(f"set_{number}", discretise(_plant(gyro, number), dt_s), L))
    for place_in_table, period in enumerate(sets.fix_periods):
        for number in range(SETS):
            L = np.array(
                [
                    [sets.k_fix_tilt[place_in_table][number]],
                    [sets.k_fix_velocity[place_in_table][number]],
                ]
            )
            plant = discretise(_plant(gyro, number), period)
            result.append(Loop(f"fix_{period:g}s_set_{number}", plant, L))
    return result


def _squared(number: int) -> float:
    """omega0^2 of a set, 1/s^2."""
    return SLOWEST * STEP**number


def _plant(gyro_density: float, number: int) -> Plant:
    return tilt_plant(gyro_density, gyro_density / _squared(number))


def _discrete_gain(gyro_density: float, number: int, dt_s: float) -> Matrix:
    return solve_riccati(discretise(_plant(gyro_density, number), dt_s)).L


def _tables(sets: GainSets) -> dict[str, object]:
    return {
        "set_bounds_s4": list(sets.bounds),
        "k_tilt_s2": list(sets.k_tilt),
        "k_velocity_s": list(sets.k_velocity),
        "fix_periods_s": list(sets.fix_periods),
        "k_fix_tilt_s": [list(row) for row in sets.k_fix_tilt],
        "k_fix_velocity": [list(row) for row in sets.k_fix_velocity],
    }


def _compare(
    plant: Plant, reference: Candidate, lmi_solvers: Sequence[str], wall_time_s: dict[str, float]
) -> dict[str, object]:
    """H2 norm of the reference and how far every other method's gain is from it."""
    section: dict[str, object] = {
        reference.method: {"h2_norm": accept(plant, reference).h2_norm, "distance": 0.0}
    }
    for name, found in compared(plant, reference, lmi_solvers):
        if isinstance(found, str):
            section[name] = {"refused": found}
            continue
        candidate, proof, distance = found
        section[name] = {"h2_norm": proof.h2_norm, "distance": float(f"{distance:.2g}")}
        if candidate.wall_time_s is not None:
            wall_time_s[name] = wall_time_s.get(name, 0.0) + candidate.wall_time_s
    return section


def checked_model(document: Mapping[str, object], place: str) -> Mapping[str, object]:
    """The `disturbance` section of a model that is complete and inside its limits.

    Raises:
        BadInput: one line per key that is missing, unknown or out of its limits.
    """
    errors = key_complaints(document, _MODEL_KEYS, _MODEL_KEYS, place)
    errors += [
        f"{place}: {key}: expected a text that is not empty"
        for key in ("name", "source")
        if key in document and (not isinstance(document[key], str) or not document[key])
    ]
    disturbance = document.get("disturbance")
    if not isinstance(disturbance, Mapping):
        raise BadInput(*errors, f"{place}: disturbance: expected a section of keys and values")
    required = [key for key in LIMITS if key not in _USUAL]
    errors += key_complaints(disturbance, LIMITS, required, place, "disturbance.")
    numbers_within(disturbance, LIMITS, errors, place, "disturbance.")
    errors += class_complaints(document, place, "")
    if errors:
        raise BadInput(*errors)
    return disturbance


def _gyro_density(disturbance: Mapping[str, object]) -> float:
    """Of a checked model, rad/s/sqrt(Hz)."""
    return numbers_within(disturbance, LIMITS, [], "")["gyro_noise_deg_s_rthz"] * DEG

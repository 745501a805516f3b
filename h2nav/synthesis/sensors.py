"""From a sensor model to a certified gain file of kind two_stage.

The bias-free attitude gains are deployed, one per accelerometer weight. The plant with gyro bias is
also synthesised, by every method: the constant-gain filter uses its gain.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from h2nav import __version__
from h2nav.attitude.constant_gain.sensor_gains import (
    GainLevel,
    design_sensor_gains,
    sensor_gains,
    sensor_section,
)
from h2nav.attitude.gains.densities import SensorDensities
from h2nav.attitude.gains.envelope import GainFile
from h2nav.errors import BadInput
from h2nav.synthesis.certificate import LoopCertificate, accept, compared
from h2nav.synthesis.closed_form import attitude_bias_gain, attitude_gain
from h2nav.synthesis.constant_gain import fixed_point_section
from h2nav.synthesis.gain_certificate import Loop, certified
from h2nav.synthesis.method import Candidate
from h2nav.synthesis.model import (
    SensorModel,
    densities,
    given_values,
    model_from_values,
    vector_sensors,
)
from h2nav.synthesis.plant import (
    Matrix,
    Plant,
    VectorSensor,
    attitude_bias_plant,
    attitude_plant,
    discretise,
)

WITH_BIAS = "attitude_and_bias"
WITHOUT_BIAS = "attitude"
# The deployed gains are closed forms: only rounding separates them from the optimum.
DEPLOYED_LIMIT = 1e-9
_DIGITS = 12


class SensorSynthesis(NamedTuple):
    """A gain file and figures that are not written into it."""

    file: GainFile  # certified
    wall_time_s: dict[str, float]  # per plant, time and method that measures it


class _Problem(NamedTuple):
    """One plant with the closed form of its gain."""

    name: str
    continuous: Plant
    closed_form: Callable[[float], Candidate]


def synthesize(
    model: SensorModel, rate_hz: float, place: str, lmi_solvers: Sequence[str]
) -> SensorSynthesis:
    """Synthesises the certified gains of a model at a rate.

    Args:
        model: with its field by value.
        rate_hz: sample rate of the filter.
        place: the model's file, for errors.
        lmi_solvers: which solvers run the slides' LMI; empty = Riccati and closed form only.

    Raises:
        BadInput: the model has no well-posed synthesis.
        CertificateError: no trustworthy gain; cannot happen for a well-posed model.
    """
    noise = densities(model, place)
    name = f"{model.name}_{rate_hz:g}hz"
    gains = design_sensor_gains(noise, rate_hz, name)
    methods = {}
    wall_time_s: dict[str, float] = {}
    for problem in _problems(noise):
        times = {}
        for time, dt_s in (("continuous", 0.0), ("discrete", 1.0 / rate_hz)):
            plant = discretise(problem.continuous, dt_s) if dt_s else problem.continuous
            section, seconds = _compare(plant, problem.closed_form(dt_s), lmi_solvers)
            times[time] = section
            wall_time_s |= {f"{problem.name}.{time}.{key}": s for key, s in seconds.items()}
        methods[problem.name] = times
    file = GainFile(
        kind="two_stage",
        name=name,
        rate_hz=rate_hz,
        model=given_values(model),
        gains=sensor_section(gains),
        methods=methods,
        certificate={},
        fixed_point={},
        made_by=f"h2nav {__version__} synthesize",
    )
    image = fixed_point_section(file, place)
    return SensorSynthesis(certified(file, loops(file, place), image), wall_time_s)


def loops(file: GainFile, place: str) -> list[Loop]:
    """The closed loops of a two_stage file, with plants rebuilt from its model.

    Raises:
        BadInput: a section of the file is invalid for this kind.
    """
    noise = densities(model_from_values(file.model, place), place)
    gains = sensor_gains(file, place)
    sensors = vector_sensors(noise)
    dt_s = 1.0 / file.rate_hz
    full = discretise(attitude_bias_plant(noise.gyro, noise.bias_walk, sensors), dt_s)
    reference = attitude_bias_gain(noise.gyro, noise.bias_walk, sensors, dt_s)
    result = [Loop(WITH_BIAS, full, reference.L, DEPLOYED_LIMIT)]
    designed = design_sensor_gains(noise, file.rate_hz, file.name).levels
    if len(designed) != len(gains.levels):
        raise BadInput(
            f"{place}: gains.force_weight: expected {len(designed)} levels; make the file again "
            "with h2nav synthesize"
        )
    for number, (level, design) in enumerate(zip(gains.levels, designed, strict=True)):
        weighted = _weighted(sensors, design.force_weight)
        plant = discretise(attitude_plant(noise.gyro, weighted), dt_s)
        # A moving vehicle's gains follow rules other than the optimum; only level 0 is optimal.
        limit = DEPLOYED_LIMIT if number == 0 else math.inf
        L = deployed_gain(level, plant)
        loop = Loop(f"{WITHOUT_BIAS}_level_{number}", plant, L, limit, deployed_gain(design, plant))
        result.append(loop)
    return result


def _problems(noise: SensorDensities) -> tuple[_Problem, _Problem]:
    sensors = vector_sensors(noise)
    return (
        _Problem(
            WITH_BIAS,
            attitude_bias_plant(noise.gyro, noise.bias_walk, sensors),
            lambda dt_s: attitude_bias_gain(noise.gyro, noise.bias_walk, sensors, dt_s),
        ),
        _Problem(
            WITHOUT_BIAS,
            attitude_plant(noise.gyro, sensors),
            lambda dt_s: attitude_gain(noise.gyro, sensors, dt_s),
        ),
    )


def _weighted(sensors: tuple[VectorSensor, VectorSensor], weight: float) -> list[VectorSensor]:
    """The sensors with the accelerometer's information multiplied by `weight`."""
    force, field = sensors
    return [VectorSensor(force.v_n, force.density / weight**0.5), field]


def deployed_gain(level: GainLevel, plant: Plant) -> Matrix:
    """The filter's K_b, which acts on zeta = C^T R^-1 y, as a gain on the raw measurements."""
    K = np.array(
        [[level.k_nn, 0.0, level.k_nd], [0.0, level.k_ee, 0.0], [level.k_nd, 0.0, level.k_dd]]
    )
    variance = np.diag(plant.D_w @ plant.D_w.T)
    return K @ (plant.C_y.T / variance)


def _compare(
    plant: Plant, closed_form: Candidate, lmi_solvers: Sequence[str]
) -> tuple[dict[str, object], dict[str, float]]:
    """Each method's result for one plant, and the solvers' times."""
    section: dict[str, object] = {
        "closed_form": _recorded(closed_form, accept(plant, closed_form), 0.0)
    }
    seconds = {}
    largest = 0.0
    for name, found in compared(plant, closed_form, lmi_solvers):
        if isinstance(found, str):
            section[name] = {"refused": found}
            continue
        candidate, proof, distance = found
        largest = max(largest, distance)
        section[name] = _recorded(candidate, proof, distance)
        if candidate.wall_time_s is not None:
            seconds[name] = candidate.wall_time_s
    section["disagreement"] = float(f"{largest:.2g}")
    return section, seconds


def _recorded(candidate: Candidate, proof: LoopCertificate, distance: float) -> dict[str, object]:
    """One method's entry: gain to 12 digits, true H2 norm, distance from the closed form."""
    return {
        "h2_norm": proof.h2_norm,
        "distance": float(f"{distance:.2g}"),
        "gain": [[_rounded(x, max(map(abs, row))) for x in row] for row in candidate.L.tolist()],
    }


def _rounded(x: float, largest: float) -> float:
    """A number to 12 digits; 0 where it is only rounding noise beside `largest`."""
    return 0.0 if abs(x) < 1e-12 * largest else float(f"{x:.{_DIGITS}g}")

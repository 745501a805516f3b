"""Our filters, run on a trial for `h2nav evaluate dataset`."""

import math
import time
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from h2nav.apps.filters import SHIPPED_RATES_HZ
from h2nav.attitude import alignment
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.gains import two_stage_gains
from h2nav.attitude.paper import PaperFilter, Weights, linearised_plant
from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Quat, Trust, VelocityFix
from h2nav.attitude.shaped import ShapedFilter
from h2nav.attitude.shaped_gains import ShapedGains, shaped_gains
from h2nav.attitude.two_stage import TwoStageFilter
from h2nav.errors import TaskFailed
from h2nav.io import gain_files
from h2nav.io.trials import Trial
from h2nav.maths import frames, quaternion
from h2nav.synthesis.riccati import solve_riccati

Array = npt.NDArray[np.float64]

DEG = math.pi / 180.0
GPS_SIGMA_M_S = 0.1
# Forward-right-down of forward-left-up, as a factor on rows of vectors.
_FRD = np.array(frames.frd_from_flu((1.0, 1.0, 1.0)))
TWO_STAGE_SENSOR = "mpu9250"


class Conditions(NamedTuple):
    """What is told to the filters beside the samples.

    Attributes:
        vehicle_class: chooses the gains of the default filter.
        use_gps: GPS velocities are given to the default filter.
        declination_deg: of the truth's north, which GPS courses are turned by.
        cruise_speed_m_s: replaces the class's pseudo-velocity along the nose; None keeps it.
    """

    vehicle_class: str
    use_gps: bool = False
    declination_deg: float = 0.0
    cruise_speed_m_s: float | None = None


class Track(NamedTuple):
    """What a filter made of a trial.

    Attributes:
        q_es: (N, 4) attitude, sensor to east-north-up.
        us_per_sample: processor time.
        bias: (N, 3) gyro bias, rad/s; None where the filter shows none.
        gain_set: (N,) number of the gain set in use; None for other filters.
        field_used: (N,) whether the sample's field was believed; None for other filters.
    """

    q_es: Array
    us_per_sample: float
    bias: Array | None = None
    gain_set: Array | None = None
    field_used: npt.NDArray[np.bool_] | None = None


def samples(trial: Trial) -> Iterator[ImuSample]:
    """The trial's samples; the body axes are the sensor's."""
    rates, forces = trial.w_s.tolist(), trial.f_s.tolist()
    fields: list[Any] = [None] * len(rates)
    if trial.m_s is not None:
        fields = [None if math.isnan(sum(row)) else tuple(row) for row in trial.m_s.tolist()]
    for t_us, w, f, m in zip(trial.t_us.tolist(), rates, forces, fields, strict=True):
        yield ImuSample(t_us, tuple(w), tuple(f), m)


def shipped_rate(rate_hz: float) -> int:
    """The rate of the shipped gains that is nearest."""
    return min(SHIPPED_RATES_HZ, key=lambda shipped_hz: abs(math.log(shipped_hz / rate_hz)))


def run_default(trial: Trial, conditions: Conditions) -> Track:
    """The default filter with the shipped gains of the class and the nearest rate."""
    name = f"{conditions.vehicle_class}_{shipped_rate(trial.rate_hz)}hz"
    return run_shaped(trial, conditions, shaped_gains(gain_files.load(name), name))


def run_shaped(trial: Trial, conditions: Conditions, gains: ShapedGains) -> Track:
    """The default filter with given gains."""
    if conditions.cruise_speed_m_s is not None:
        gains = gains._replace(cruise_speed_m_s=conditions.cruise_speed_m_s)
    return _stream(trial, conditions, ShapedFilter(gains))


def run_two_stage(trial: Trial, conditions: Conditions) -> Track:
    """The two-stage filter with the shipped gains of a common sensor."""
    name = f"{TWO_STAGE_SENSOR}_{shipped_rate(trial.rate_hz)}hz"
    return _stream(trial, conditions, TwoStageFilter(two_stage_gains(gain_files.load(name), name)))


def _stream(trial: Trial, conditions: Conditions, chosen: AttitudeFilter) -> Track:
    """Runs one of our filters sample by sample, as the daemon does."""
    fixes = _fixes(trial, conditions) if conditions.use_gps else []
    estimates: list[AttitudeEstimate | None] = []
    sets: list[int] = []
    next_fix = 0
    started = time.process_time()
    for sample in samples(trial):
        while next_fix < len(fixes) and fixes[next_fix].t_us <= sample.t_us:
            chosen.use_velocity(fixes[next_fix])
            next_fix += 1
        estimates.append(chosen.update(sample))
        if isinstance(chosen, ShapedFilter):
            sets.append(chosen.gain_set)
    us_per_sample = (time.process_time() - started) * 1e6 / len(estimates)
    found = [estimate for estimate in estimates if estimate is not None]
    if not found:
        raise TaskFailed(f"{trial.name}: {chosen.name} never aligned: no usable sample")
    filled = []
    latest = found[0]  # nothing is known before the alignment
    for estimate in estimates:
        latest = estimate or latest
        filled.append(latest)
    return Track(
        q_es=enu([estimate.q_nb for estimate in filled]),
        us_per_sample=us_per_sample,
        bias=np.array([estimate.bias_b for estimate in filled]),
        gain_set=np.array(sets) if sets else None,
        field_used=np.array([bool(estimate.trust & Trust.FIELD_USED) for estimate in filled]),
    )


def run_paper(trial: Trial, _: Conditions) -> Track:
    """The source paper's Euler-angle filter, its vectors scaled to 1 and its weights 1.

    It only works near level, so the sensor's axes are taken for forward-left-up.
    """
    if trial.m_s is None:
        raise TaskFailed(f"{trial.name}: the paper's filter needs a magnetometer")
    rates = trial.w_s * _FRD
    forces = _unit(trial.f_s * _FRD)
    fields = _unit(held(trial.m_s) * _FRD)
    dip = math.asin(float(np.clip(-np.dot(forces[0], fields[0]), -1.0, 1.0)))
    vectors = np.array([[0.0, 0.0, 1.0], [math.cos(dip), 0.0, math.sin(dip)]])
    gain = solve_riccati(linearised_plant(vectors, Weights())).L
    chosen = PaperFilter(gain, vectors, 1)
    chosen.angles[0] = quaternion.to_euler(alignment.triad(tuple(forces[0]), tuple(fields[0])))
    steps = np.diff(trial.t_us, prepend=trial.t_us[0]) * 1e-6
    measured = np.hstack([-forces, fields])
    rows = []
    started = time.process_time()
    for k, dt_s in enumerate(steps.tolist()):
        chosen.step(rates[k : k + 1], measured[k : k + 1], dt_s)
        rows.append(chosen.angles[0].tolist())
    us_per_sample = (time.process_time() - started) * 1e6 / len(rows)
    angles = np.where(np.isfinite(rows), rows, 0.0).tolist()
    attitudes = (quaternion.from_euler(*row) for row in angles)
    q_ef = [frames.attitude_enu_flu_from_ned_frd(q_nb) for q_nb in attitudes]
    return Track(np.array(q_ef), us_per_sample)


def _fixes(trial: Trial, conditions: Conditions) -> list[VelocityFix]:
    """The trial's GPS velocities, courses turned to the truth's north.

    Raises:
        TaskFailed: it has none.
    """
    if trial.gps is None:
        raise TaskFailed(f"{trial.name}: no gps rows, but --gps was given")
    fixes = []
    for t_s, speed, course_deg, _ in trial.gps.tolist():
        course = (course_deg - conditions.declination_deg) * DEG
        v_n = (speed * math.cos(course), speed * math.sin(course), math.nan)
        fixes.append(VelocityFix(round(t_s * 1e6), v_n, GPS_SIGMA_M_S))
    return fixes


def enu(q_ns: Iterable[Quat]) -> Array:
    """(N, 4) q_es of attitudes against north-east-down."""
    return np.array([frames.attitude_enu_from_ned(q) for q in q_ns])


def _unit(vectors: Array) -> Array:
    result: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-9)[:, None]
    return result


def held(field: Array) -> Array:
    """The field with every row that brings nothing new replaced by the one before."""
    fine = np.isfinite(field).all(axis=1)
    if not fine.any():
        return np.zeros_like(field)
    last = np.maximum.accumulate(np.where(fine, np.arange(len(field)), -1))
    last[last < 0] = int(np.argmax(fine))
    result: Array = field[last]
    return result

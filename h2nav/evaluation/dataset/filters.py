"""Runs the filters of h2nav on a trial for `h2nav evaluate dataset`.

Whole stretches run through the compiled kernels where they are built. Filters are called sample by
sample while a velocity is fused, where internals are recorded, and in the smoother. The estimates
have the same bits either way.
"""

import math
import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from h2nav.attitude import alignment, batch, native
from h2nav.attitude.batch_driver import BatchSamples
from h2nav.attitude.filter import AttitudeFilter, pass_on
from h2nav.attitude.kernel_files import VELOCITY_AIDED, VELOCITY_AIDED_INTEGER
from h2nav.attitude.lead import extrapolated
from h2nav.attitude.samples import (
    AttitudeEstimate,
    ImuSample,
    SensorDelays,
    Trust,
    VelocityFix,
)
from h2nav.attitude.smoothing import FilterMaker, Given, smooth
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains, velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.errors import TaskFailed
from h2nav.files import gain_files
from h2nav.maths import frames, quaternion
from h2nav.maths.rows import Array, enu_from_ned, from_euler, product
from h2nav.maths.units import DEG
from h2nav.recordings.trials import FilterInput, Trial

GPS_SIGMA_M_S = 0.1
# From forward-left-up to forward-right-down, as a factor on rows of vectors.
_FRD = np.array(frames.frd_from_flu((1.0, 1.0, 1.0)))


class Conditions(NamedTuple):
    """Inputs of the filters besides the samples."""

    vehicle_class: str  # selects the gains of the velocity-aided filter
    use_gps: bool = False  # the default filter uses GPS velocities
    # of the truth's north, by which the courses of gps rows are rotated
    declination_deg: float = 0.0
    # replaces the class's pseudo-velocity along the nose; None keeps it
    cruise_speed_m_s: float | None = None
    shows_insides: bool = False  # also record gain set and gate


class FilterTrack(NamedTuple):
    """The result of a filter on a trial."""

    q_es: Array  # (N, 4) attitude, sensor to east-north-up
    us_per_sample: float  # processor time of the filter's calls
    backend: str  # native; native, called per sample; or python
    bias: Array | None = None  # (N, 3) gyro bias, rad/s; None if the filter has none
    gain_set: Array | None = None  # (N,) number of the gain set in use; None for other filters
    # (N,) whether the sample's field passed the gate; None for other filters
    field_used: npt.NDArray[np.bool_] | None = None


def samples(trial: Trial) -> Iterator[ImuSample]:
    """The trial's samples; the body axes are the sensor's."""
    return _columns(trial).records()


def _columns(trial: Trial) -> BatchSamples:
    """The same in columns."""
    count = len(trial.t_us)
    fields = np.full((count, 3), math.nan) if trial.m_s is None else trial.m_s
    clipped = np.zeros(count, np.bool_) if trial.clipped is None else trial.clipped
    has_field = ~np.any(np.isnan(fields), axis=1)
    return BatchSamples(trial.t_us, trial.w_s, trial.f_s, fields, has_field, clipped)


def run_velocity_aided(trial: Trial, conditions: Conditions) -> FilterTrack:
    """The velocity-aided filter with the shipped gains of the class and the nearest rate."""
    return run_with_gains(trial, conditions, _class_gains(trial, conditions))


def run_velocity_aided_integer(trial: Trial, conditions: Conditions) -> FilterTrack:
    """The same in integers."""
    return _run(trial, conditions, _integer_filter(_class_gains(trial, conditions), conditions))


def smooth_velocity_aided(trial: Trial, conditions: Conditions) -> FilterTrack:
    """The velocity-aided filter forward and backward."""
    gains = _class_gains(trial, conditions)
    return _smooth(trial, conditions, lambda: _float_filter(gains, conditions))


def smooth_velocity_aided_integer(trial: Trial, conditions: Conditions) -> FilterTrack:
    """The same in integers."""
    gains = _class_gains(trial, conditions)
    return _smooth(trial, conditions, lambda: _integer_filter(gains, conditions))


def run_with_gains(trial: Trial, conditions: Conditions, gains: VelocityAidedGains) -> FilterTrack:
    """The velocity-aided filter with given gains."""
    return _run(trial, conditions, _float_filter(gains, conditions))


def _class_gains(trial: Trial, conditions: Conditions) -> VelocityAidedGains:
    name = f"{conditions.vehicle_class}_{gain_files.shipped_rate(trial.rate_hz)}hz"
    return velocity_aided_gains(gain_files.load(name), name)


def _float_filter(gains: VelocityAidedGains, conditions: Conditions) -> VelocityAidedFilter:
    step = native.compiled_step(VELOCITY_AIDED)
    return VelocityAidedFilter(_at_cruise(gains, conditions), step)


def _integer_filter(
    gains: VelocityAidedGains, conditions: Conditions
) -> IntegerVelocityAidedFilter:
    step = native.compiled_step(VELOCITY_AIDED_INTEGER)
    return IntegerVelocityAidedFilter(_at_cruise(gains, conditions), gains.name, step)


def _at_cruise(gains: VelocityAidedGains, conditions: Conditions) -> VelocityAidedGains:
    if conditions.cruise_speed_m_s is None:
        return gains
    return gains._replace(cruise_speed_m_s=conditions.cruise_speed_m_s)


def _run(trial: Trial, conditions: Conditions, chosen: AttitudeFilter) -> FilterTrack:
    """Runs a filter of h2nav in the fastest way that records what is wanted."""
    inputs = _inputs(trial, conditions)
    is_plain = trial.clipped is None and not conditions.shows_insides
    special = (VelocityFix, SensorDelays)  # batches take no fixes, and propagate no attitude
    is_plain = is_plain and not any(isinstance(each.what, special) for each in inputs)
    if is_plain and _is_compiled(chosen):
        return _run_batch(trial, inputs, chosen)
    return _run_samples(trial, inputs, chosen)


def _is_compiled(chosen: AttitudeFilter) -> bool:
    is_aided = isinstance(chosen, VelocityAidedFilter | IntegerVelocityAidedFilter)
    return is_aided and native.backend() == "native"


def _backend_of_samples(chosen: AttitudeFilter) -> str:
    return "native, called per sample" if _is_compiled(chosen) else "python"


def _run_batch(trial: Trial, inputs: Sequence[FilterInput], chosen: AttitudeFilter) -> FilterTrack:
    """Runs the stretches between these records through the compiled kernel."""
    count = len(trial.t_us)
    q_nb, bias = np.empty((count, 4)), np.empty((count, 3))
    starts = sorted({0, *(each.row for each in inputs if each.row < count)})
    started = time.process_time()
    for start, stop in zip(starts, [*starts[1:], count], strict=True):
        for each in inputs:
            if each.row == start:
                pass_on(chosen, each.what)
        rows = slice(start, stop)
        field = None if trial.m_s is None else trial.m_s[rows]
        # The first step of a stretch continues the trial's times.
        steps_s = np.diff(trial.t_us[rows], prepend=0) * 1e-6
        found = batch.filter_array(trial.w_s[rows], trial.f_s[rows], field, steps_s, chosen)
        q_nb[rows], bias[rows] = found.q_nb, found.bias_b
    us_per_sample = (time.process_time() - started) * 1e6 / count
    known = np.isfinite(q_nb[:, 0])
    if not known.any():
        raise TaskFailed(f"{trial.name}: {chosen.name} never aligned: no usable sample")
    latest = _latest(known)
    return FilterTrack(enu_from_ned(q_nb[latest]), us_per_sample, "native", bias[latest])


def _run_samples(
    trial: Trial, inputs: Sequence[FilterInput], chosen: AttitudeFilter
) -> FilterTrack:
    """Runs sample by sample, as the daemon does."""
    taken = list(samples(trial))
    estimates: list[AttitudeEstimate | None] = []
    sets: list[int] = []
    coming = iter(inputs)
    following = next(coming, None)
    late_s = 0.0
    started = time.process_time()
    for row, sample in enumerate(taken):
        while following is not None and following.row <= row:
            pass_on(chosen, following.what)
            if isinstance(following.what, SensorDelays):
                late_s = following.what.gyro_s
            following = next(coming, None)
        estimate = chosen.update(sample)
        estimates.append(None if estimate is None else extrapolated(estimate, late_s))
        if isinstance(chosen, VelocityAidedFilter | IntegerVelocityAidedFilter):
            sets.append(chosen.gain_set)
    us_per_sample = (time.process_time() - started) * 1e6 / len(estimates)
    filled = _filled(estimates, f"{trial.name}: {chosen.name}")
    return _track(filled, us_per_sample, chosen)._replace(
        gain_set=np.array(sets) if sets else None,
        field_used=np.array([bool(estimate.trust & Trust.FIELD_USED) for estimate in filled]),
    )


def _smooth(trial: Trial, conditions: Conditions, make: FilterMaker) -> FilterTrack:
    """The smoother around a filter."""
    given = Given(_columns(trial), _inputs(trial, conditions))
    started = time.process_time()
    estimates = list(smooth([given], make)[0].estimates())
    us_per_sample = (time.process_time() - started) * 1e6 / len(estimates)
    chosen = make()
    return _track(_filled(estimates, f"{trial.name}: {chosen.name}"), us_per_sample, chosen)


def _track(
    filled: Sequence[AttitudeEstimate], us_per_sample: float, chosen: AttitudeFilter
) -> FilterTrack:
    return FilterTrack(
        q_es=enu_from_ned([estimate.q_nb for estimate in filled]),
        us_per_sample=us_per_sample,
        backend=_backend_of_samples(chosen),
        bias=np.array([estimate.bias_b for estimate in filled]),
    )


def _filled(estimates: Sequence[AttitudeEstimate | None], what: str) -> list[AttitudeEstimate]:
    """The estimates, with the previous (at the start the first) where there is none.

    Raises:
        TaskFailed: there is none at all.
    """
    known = np.array([estimate is not None for estimate in estimates])
    if not known.any():
        raise TaskFailed(f"{what} never aligned: no usable sample")
    rows = (estimates[row] for row in _latest(known).tolist())
    return [estimate for estimate in rows if estimate is not None]


def run_paper(trial: Trial, _: Conditions) -> FilterTrack:
    """The source paper's Euler-angle filter, its vectors scaled to 1 and its weights 1.

    It works only near level: z up or down as in the first force, x forward.
    """
    from h2nav.evaluation.paper.filter import PaperFilter, paper_gain  # needs scipy

    if trial.m_s is None:
        raise TaskFailed(f"{trial.name}: the paper's filter needs a magnetometer")
    is_frd = trial.f_s[0, 2] < 0.0
    axes = np.ones(3) if is_frd else _FRD
    rates = trial.w_s * axes
    forces = _unit(trial.f_s * axes)
    fields = _unit(held(trial.m_s) * axes)
    dip = math.asin(float(np.clip(-np.dot(forces[0], fields[0]), -1.0, 1.0)))
    vectors = np.array([[0.0, 0.0, 1.0], [math.cos(dip), 0.0, math.sin(dip)]])
    chosen = PaperFilter(paper_gain(vectors), vectors, 1)
    chosen.angles[0] = quaternion.to_euler(alignment.triad(tuple(forces[0]), tuple(fields[0])))
    steps = np.diff(trial.t_us, prepend=trial.t_us[0]) * 1e-6
    measured = np.hstack([-forces, fields])
    rows = []
    started = time.process_time()
    for k, dt_s in enumerate(steps.tolist()):
        chosen.step(rates[k : k + 1], measured[k : k + 1], dt_s)
        rows.append(chosen.angles[0].tolist())
    us_per_sample = (time.process_time() - started) * 1e6 / len(rows)
    q_nb = from_euler(np.where(np.isfinite(rows), rows, 0.0))
    to_enu = frames.attitude_enu_from_ned if is_frd else frames.attitude_enu_flu_from_ned_frd
    q_es = np.array([to_enu(tuple(q)) for q in q_nb.tolist()])
    return FilterTrack(to_true_north(q_es, trial.declination_rad), us_per_sample, "python")


def _inputs(trial: Trial, conditions: Conditions) -> list[FilterInput]:
    """The further inputs of the filter, in order; velocities only on request.

    Raises:
        TaskFailed: they are requested, and the trial has none.
    """
    if not conditions.use_gps:
        return [each for each in trial.inputs if not isinstance(each.what, VelocityFix)]
    inputs = list(trial.inputs) if trial.gps is None else _fixes(trial, conditions)
    if not any(isinstance(each.what, VelocityFix) for each in inputs):
        raise TaskFailed(f"{trial.name}: no gps rows, but --gps was given")
    return inputs


def _fixes(trial: Trial, conditions: Conditions) -> list[FilterInput]:
    """The trial's gps rows as velocities in order, courses rotated to the truth's north.

    Rows without a time, a speed or a course are left out.
    """
    assert trial.gps is not None
    known = trial.gps[np.isfinite(trial.gps[:, :3]).all(axis=1)]
    inputs = []
    for t_s, speed, course_deg, _ in known[np.argsort(known[:, 0], kind="stable")].tolist():
        course = (course_deg - conditions.declination_deg) * DEG
        v_n = (speed * math.cos(course), speed * math.sin(course), math.nan)
        t_us = round(t_s * 1e6)
        row = int(np.searchsorted(trial.t_us, t_us))
        inputs.append(FilterInput(row, VelocityFix(t_us, v_n, GPS_SIGMA_M_S)))
    return inputs


def to_true_north(q_es: Array, declination_rad: float) -> Array:
    """Attitudes from magnetic to true east-north-up."""
    half = -0.5 * declination_rad  # east is clockwise from above
    return product(np.array([[math.cos(half), 0.0, 0.0, math.sin(half)]]), q_es)


def _unit(vectors: Array) -> Array:
    result: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-9)[:, None]
    return result


def held(field: Array) -> Array:
    """The field with every row without a new value replaced by the previous one."""
    fine = np.isfinite(field.sum(axis=1))
    if not fine.any():
        return np.zeros_like(field)
    result: Array = field[_latest(fine)]
    return result


def _latest(known: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """For each row the last known one up to it; before all of them, the first."""
    last = np.maximum.accumulate(np.where(known, np.arange(len(known)), -1))
    last[last < 0] = int(np.argmax(known))
    return last

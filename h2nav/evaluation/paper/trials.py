"""The source paper's two cases: truth, sensor data of many seeds, and a run of every filter.

The slides give the sensor, the speed and the size of the motion, no more. `Assumptions` holds the
rest, which is printed beside every table.
"""

import importlib
import importlib.util
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.gains.densities import SensorDensities
from h2nav.attitude.samples import EarthField, ImuSample, VehicleState
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.evaluation import imufusion
from h2nav.evaluation.paper.euler_ekf import EulerEkf
from h2nav.evaluation.paper.filter import PaperFilter, paper_gain
from h2nav.files import gain_files
from h2nav.maths import frames, quaternion
from h2nav.maths.rows import to_euler, wrapped
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.sim.imu_model import (
    MPU_9250,
    GyroSampling,
    ImuModel,
    ImuParameters,
    field_vector,
    readings,
)
from h2nav.sim.scenarios import scenario
from h2nav.synthesis.plant import Matrix

RATE_HZ = 100
DT_S = 1.0 / RATE_HZ


class Assumptions(NamedTuple):
    """Assumptions where the slides give no value."""

    dip_deg: float = 42.0  # of the earth's field
    norm_ut: float = 50.0  # of the earth's field
    run_in_s: float = 150.0  # length of the motion before the case begins; not scored

    @property
    def field(self) -> EarthField:
        """The field of the simulation."""
        return EarthField(self.norm_ut, self.dip_deg * DEG, 0.0)

    @property
    def vectors(self) -> Matrix:
        """(2, 3) the unit vectors of gravity and field in NED."""
        return np.array([[0.0, 0.0, 1.0], np.array(field_vector(self.field)) / self.norm_ut])

    @property
    def sensor(self) -> ImuParameters:
        """The MPU-9250 as in the slides' simulation: instantaneous samples, steady bias."""
        return MPU_9250._replace(gyro_sampling=GyroSampling.INSTANT, gyro_walk_deg_s_rts=0.0)


class Case(NamedTuple):
    """One of the slides' cases."""

    key: str  # in the JSON result
    scenario: str  # name of the motion
    duration_s: float  # scored length
    averaged: bool  # adjacent gyro samples are averaged for our filters and the tuned EKF


CASES = (
    Case("case_1", "case1", 50.0, averaged=True),
    Case("case_2", "case2", 10.0, averaged=True),
    Case("case_2_held", "case2", 10.0, averaged=False),
)


class Trials(NamedTuple):
    """Sensor data of many seeds along one true motion; N samples, S seeds."""

    t_us: Matrix  # (N,) times
    rate: Matrix  # (S, N, 3) gyro as sampled, rad/s
    own_rate: Matrix  # (S, N, 3) the gyro samples for our filters
    force: Matrix  # (S, N, 3) specific force, m/s^2
    field: Matrix  # (S, N, 3) magnetic field, microtesla
    truth: Matrix  # (N, 3) roll, pitch, yaw, rad
    scored: int  # index of the first sample that counts
    assumptions: Assumptions  # behind the data

    @property
    def measured(self) -> Matrix:
        """(S, N, 6) the slides' measurements R g and R h, each divided by its length."""
        down = -self.force / GRAVITY_M_S2
        return np.concatenate((down, self.field / self.assumptions.norm_ut), axis=2)


# Runs one filter: name in the results -> (S, N, 3) roll, pitch, yaw in rad.
Runner = Callable[[Trials], dict[str, Matrix]]
# Filters with unit weights forget within a second: a longer run-in is not needed.
UNIT_RUN_IN = 20 * RATE_HZ


def make_trials(case: Case, assumptions: Assumptions, seeds: range) -> Trials:
    """Simulates the sensors along a case's motion."""
    run_in = round(assumptions.run_in_s * RATE_HZ)
    count = run_in + round(case.duration_s * RATE_HZ) + 1
    t_us = [round(k * 1e6 * DT_S) for k in range(count)]
    motion_at = scenario(case.scenario).motion_at
    ideal = readings(
        lambda t_s: motion_at(t_s - run_in * DT_S),
        t_us,
        assumptions.field,
        assumptions.sensor.gyro_sampling,
    )
    batches = [
        ImuModel(assumptions.sensor, assumptions.field, seed, RATE_HZ).batch(ideal)
        for seed in seeds
    ]
    rate = np.array([batch.w_b for batch in batches])
    own_rate = rate.copy()
    if case.averaged:
        own_rate[:, 1:] = (rate[:, 1:] + rate[:, :-1]) / 2
    return Trials(
        t_us=ideal.t_us.astype(np.float64),
        rate=rate,
        own_rate=own_rate,
        force=np.array([batch.f_b for batch in batches]),
        field=np.array([batch.m_b_ut for batch in batches]),
        truth=to_euler(ideal.q_nb),
        scored=run_in,
        assumptions=assumptions,
    )


def errors_deg(trials: Trials, estimates: Matrix) -> Matrix:
    """(S, M, 3) scored errors of roll, pitch, yaw; NaN where a filter had no estimate yet."""
    error = wrapped(estimates - trials.truth)
    scored: Matrix = error[:, trials.scored :] / DEG
    return scored


def runners(case: Case) -> dict[str, Runner]:
    """Every filter that is installed, by its first name in the results.

    The unit-weighted filters always use held gyro samples: for a case with averaged samples, their
    results exist already.
    """
    found: dict[str, Runner] = {}
    if case.averaged:
        found |= {"eh2_paper": _paper, "ekf_unit": _ekf_unit}
    found |= {"ekf_tuned": _ekf_tuned, "default": _default}
    peers: dict[str, Runner] = {"vqf": _vqf, "imufusion": _imufusion}
    return found | {name: run for name, run in peers.items() if importlib.util.find_spec(name)}


def _paper(trials: Trials) -> dict[str, Matrix]:
    """The paper's filter, compared after its step (as in its loop) and before it (prompt)."""
    measured = trials.measured
    late, prompt = np.full_like(trials.rate, np.nan), np.full_like(trials.rate, np.nan)
    start = max(trials.scored - UNIT_RUN_IN, 0)
    vectors = trials.assumptions.vectors
    paper = PaperFilter(paper_gain(vectors), vectors, len(measured))
    paper.angles = np.tile(trials.truth[start], (len(measured), 1))
    for k in range(start, late.shape[1]):
        prompt[:, k] = paper.angles
        paper.step(trials.rate[:, k], measured[:, k], DT_S)
        late[:, k] = paper.angles
    return {"eh2_paper": late, "eh2_paper_prompt": prompt}


def _ekf_unit(trials: Trials) -> dict[str, Matrix]:
    """The EKF with unit matrices, compared like the paper's filter."""
    measured = trials.measured
    late, prompt = np.full_like(trials.rate, np.nan), np.full_like(trials.rate, np.nan)
    start = max(trials.scored - UNIT_RUN_IN, 0)
    ones = np.ones(6)
    ekf = EulerEkf(trials.assumptions.vectors, ones, ones, ones, len(measured))
    ekf.angles = np.tile(trials.truth[start], (len(measured), 1))
    for k in range(start, late.shape[1]):
        ekf.correct(measured[:, k])
        prompt[:, k] = ekf.angles
        ekf.predict(trials.rate[:, k], DT_S)
        late[:, k] = ekf.angles
    return {"ekf_unit": late, "ekf_unit_prompt": prompt}


def _ekf_tuned(trials: Trials) -> dict[str, Matrix]:
    """The EKF with the sensors' own covariances."""
    noise = densities(trials.assumptions)
    measured = trials.measured
    force = noise.accelerometer / GRAVITY_M_S2 / math.sqrt(DT_S)
    field = noise.magnetometer / trials.assumptions.norm_ut / math.sqrt(DT_S)
    ekf = EulerEkf(
        trials.assumptions.vectors,
        np.repeat([noise.gyro**2, noise.bias_walk**2], 3),
        np.repeat([force**2, field**2], 3),
        np.repeat([(1.0 * DEG) ** 2, (0.1 * DEG) ** 2], 3),
        len(measured),
    )
    ekf.angles = np.tile(trials.truth[0], (len(measured), 1))
    rate = trials.own_rate
    estimates = np.empty_like(rate)
    for k in range(estimates.shape[1]):
        if k > 0:
            ekf.predict(rate[:, k], DT_S)
        ekf.correct(measured[:, k])
        estimates[:, k] = ekf.angles
    return {"ekf_tuned": estimates}


def densities(assumptions: Assumptions) -> SensorDensities:
    """The noise for tuned filters: that of the simulated sensor."""
    sensor = assumptions.sensor
    return SensorDensities(
        gyro=sensor.gyro_noise_deg_s_rthz * DEG / math.sqrt(2.0),
        # The simulated bias is steady; a little walk keeps the gains finite.
        bias_walk=1e-5 * DEG,
        accelerometer=sensor.accel_noise_ug_rthz * 1e-6 * GRAVITY_M_S2 / math.sqrt(2.0),
        magnetometer=sensor.mag_noise_ut * math.sqrt(DT_S),
        gravity_m_s2=GRAVITY_M_S2,
        field=assumptions.field,
    )


def _default(trials: Trials) -> dict[str, Matrix]:
    name = f"multirotor_{RATE_HZ}hz"
    gains = velocity_aided_gains(gain_files.load(name), name)
    return {"default": _one_by_one(trials, lambda: VelocityAidedFilter(gains))}


def _one_by_one(trials: Trials, make: Callable[[], AttitudeFilter]) -> Matrix:
    """Runs a filter of h2nav sample by sample, one seed after the other."""
    estimates = np.full_like(trials.rate, np.nan)
    times = trials.t_us.astype(np.int64).tolist()
    for run, columns in enumerate(zip(trials.own_rate, trials.force, trials.field, strict=True)):
        estimator = make()
        estimator.use_vehicle(VehicleState(on_ground=False))
        estimator.use_field(trials.assumptions.field)
        rows = zip(times, *(map(tuple, column.tolist()) for column in columns), strict=True)
        for k, row in enumerate(rows):
            estimate = estimator.update(ImuSample(*row))
            if estimate is not None:
                estimates[run, k] = quaternion.to_euler(estimate.q_nb)
    return estimates


def _vqf(trials: Trials) -> dict[str, Matrix]:
    vqf = importlib.import_module("vqf")
    estimates = np.empty_like(trials.rate)
    for run, data in enumerate(zip(trials.own_rate, trials.force, trials.field, strict=True)):
        out = vqf.VQF(DT_S).updateBatch(*map(np.ascontiguousarray, data))
        attitudes = [frames.attitude_ned_from_enu(tuple(q)) for q in out["quat9D"].tolist()]
        estimates[run] = to_euler(np.array(attitudes))
    return {"vqf": estimates}


def _imufusion(trials: Trials) -> dict[str, Matrix]:
    steps_s = [DT_S] * len(trials.t_us)
    runs = zip(trials.own_rate, trials.force, trials.field, strict=True)
    attitudes = (imufusion.attitudes(*run, steps_s) for run in runs)
    return {"imufusion": np.array([to_euler(q_nb) for q_nb in attitudes])}

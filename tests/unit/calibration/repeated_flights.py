"""A vehicle with wrong calibrations that flies, is calibrated, and flies again.

Sensors alone: a multirotor's motion, what its sensors measure and its autopilot logs with the
parameters in use, and an attitude without compass that is as wrong as it says. No filter runs, so
that a hundred flights take minutes.
"""

from typing import NamedTuple

import numpy as np

from h2nav.calibration.evidence import Evidence
from h2nav.calibration.field_fit import EARTH_UT, FieldCorrection
from h2nav.calibration.imu import LEAN_M_S2
from h2nav.calibration.outcome import Calibration, ParameterChange
from h2nav.calibration.settings import ardupilot_compass
from h2nav.calibration.vehicle import calibrate
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import CompassTrack, Context, GpsTrack, Series, Span
from h2nav.reviews.flight import EarthFields, Estimates
from h2nav.reviews.inertial import conjugate, rotate
from tests.unit.calibration.fields import slow_error
from tests.unit.calibration.logs import evidence_of_log, imu_track

SECONDS, RATE_HZ, FIELD_HZ, FIX_HZ = 120.0, 25.0, 10.0, 5.0
TILT_SIGMA_RAD, HEADING_SIGMA_RAD = 0.2 * DEG, 1.5 * DEG
DRAG_PER_S, DELAY_S, LATE_S = 0.25, 0.1, 0.02
PARAMETERS = {
    **{f"COMPASS_{name}_{axis}": 0.0 for name in ("OFS", "ODI", "MOT") for axis in "XYZ"},
    **{f"COMPASS_DIA_{axis}": 1.0 for axis in "XYZ"},
    "COMPASS_SCALE": 1.0,
    "COMPASS_MOTCT": 0.0,
    "COMPASS_EXTERNAL": 1.0,
    "COMPASS_ORIENT": 0.0,
    **{f"INS_ACCOFFS_{axis}": 0.0 for axis in "XYZ"},
    **{f"INS_ACCSCAL_{axis}": 1.0 for axis in "XYZ"},
    **{f"INS_GYROFFS_{axis}": 0.0 for axis in "XYZ"},
    **{f"GPS1_POS_{axis}": 0.0 for axis in "XYZ"},
    **{f"INS_POS1_{axis}": 0.0 for axis in "XYZ"},
    "INS_GYR_CAL": 0.0,
    "GPS1_DELAY_MS": 1e3 * DELAY_S,
    "AHRS_TRIM_X": 0.0,
    "AHRS_TRIM_Y": 0.0,
}


class Vehicle(NamedTuple):
    """What is wrong with it, and where it flies."""

    iron: FieldCorrection  # that its compass needs
    offset_b: np.ndarray  # (3,) of its accelerometer, m/s^2
    bias_b: np.ndarray  # (3,) of its gyro, rad/s
    earth_n_ut: np.ndarray  # (3,) the field there
    model_n_ut: np.ndarray  # (3,) the model's


def drawn(rng: np.random.Generator) -> Vehicle:
    """Irons of some hundreds of milligauss; every third compass has scale and soft iron, too.

    Each axis of accelerometer and gyro is sound or clearly wrong: an error as large as what counts
    as significant would be written after one flight or another.
    """

    def wrong(low: float, high: float, count: int) -> np.ndarray:
        return rng.choice((-1.0, 0.0, 1.0), count) * rng.uniform(low, high, count)

    S = np.eye(3)
    if rng.random() < 1.0 / 3.0:
        S += np.diag(rng.choice((-1.0, 1.0), 3) * rng.uniform(0.05, 0.1, 3))
        for i, j in ((0, 1), (0, 2), (1, 2)):
            S[i, j] = S[j, i] = 0.03 * rng.standard_normal()
    dip, norm = rng.uniform(-70.0, 75.0) * DEG, rng.uniform(35.0, 60.0)
    earth_n_ut = norm * np.array((np.cos(dip), 0.0, np.sin(dip)))
    return Vehicle(
        FieldCorrection(15.0 * rng.standard_normal(3), S, np.zeros(3)),
        np.append(wrong(0.25, 0.6, 2), 0.0),
        DEG * wrong(0.6, 1.5, 3),
        earth_n_ut,
        earth_n_ut + EARTH_UT * rng.standard_normal(3),
    )


def written_again(first: Calibration, second: Calibration) -> list[ParameterChange]:
    """Of the second, for sensors that the first flight showed."""
    shown = [one for one in first.outcomes if one.changes or "no change" in "".join(one.left)]
    names = {one.sensor for one in shown}
    return [change for one in second.outcomes if one.sensor in names for change in one.changes]


def twice(seed: int) -> tuple[Vehicle, Calibration, Calibration]:
    """Flown, calibrated, loaded, flown elsewhere in the sky, calibrated."""
    rng = np.random.default_rng(seed)
    vehicle = drawn(rng)
    first = calibrate([flown(rng, vehicle, PARAMETERS)])
    loaded = PARAMETERS | {change.name: change.new for change in first.changes}
    return vehicle, first, calibrate([flown(rng, vehicle, loaded)])


def flown(rng: np.random.Generator, vehicle: Vehicle, own: dict[str, float]) -> Evidence:
    """One flight, as its autopilot logs it with these parameters."""
    t_s = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    v_n, q_nb = _motion(rng, t_s)
    w_b = _rates(q_nb, t_s)
    a_n = np.gradient(v_n, t_s, axis=0) - (0.0, 0.0, GRAVITY_M_S2)
    f_b = rotate(conjugate(q_nb), a_n) + vehicle.offset_b
    f_b = own["INS_ACCSCAL_X"] * (f_b - _three(own, "INS_ACCOFFS_%s"))
    f_b += 0.05 * rng.standard_normal(f_b.shape)
    shown = w_b + vehicle.bias_b - _three(own, "INS_GYROFFS_%s")
    context = Context(
        imus=(imu_track(shown + 1e-3 * rng.standard_normal(w_b.shape), f_b, rate_hz=RATE_HZ),),
        compasses=(_compass(rng, vehicle, own, t_s, q_nb),),
        gps=(_receiver(rng, t_s, v_n),),
        armed=(Span(0.0, SECONDS, "armed"),),
        airborne=Series(np.zeros(1), np.ones(1)),
        vehicle_type=2,
    )
    evidence = evidence_of_log(context, own, free=_believed(rng, t_s, q_nb))
    x, y, z = vehicle.model_n_ut
    level = np.hypot(x, y)
    earth = EarthFields(
        np.zeros(1), *(np.array([v]) for v in (np.hypot(level, z), np.arctan2(z, level)))
        , np.array([np.arctan2(y, x)]),
    )  # fmt: skip
    return evidence._replace(flight=evidence.flight._replace(earth=earth))


def _motion(rng: np.random.Generator, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) velocity and (N, 4) attitude of a multirotor that looks round while it moves."""

    def swings(size: float, count: int = 4) -> np.ndarray:
        rates, phases = rng.uniform(0.15, 0.7, count), rng.uniform(0.0, 2.0 * np.pi, count)
        return size * np.sin(np.outer(t_s, rates) + phases).mean(axis=1)

    top = rng.uniform(3.0, 8.0)
    v_n = np.stack((swings(top), swings(top), swings(2.0)), axis=1)
    yaw = rng.uniform(1.0, 4.0) * 2.0 * np.pi * t_s / SECONDS + swings(1.0)
    thrust = np.gradient(v_n, t_s, axis=0) - (0.0, 0.0, GRAVITY_M_S2) + DRAG_PER_S * v_n
    down = -thrust / np.linalg.norm(thrust, axis=1, keepdims=True)
    nose = np.stack((np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))), axis=1)
    right = np.cross(down, nose)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    return v_n, _quaternions(np.stack((np.cross(right, down), right, down), axis=2))


def _quaternions(R: np.ndarray) -> np.ndarray:
    """(N, 4) of (N, 3, 3) rotations, body to NED, none of them nearly upside down."""
    down, yaw = R[:, 2, 2], np.arctan2(R[:, 1, 0], R[:, 0, 0])
    pitch, roll = -np.arcsin(R[:, 2, 0]), np.arctan2(R[:, 2, 1], down)
    return _from_angles(roll, pitch, yaw)


def _from_angles(roll: np.ndarray, pitch: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a / 2.0), np.sin(a / 2.0)) for a in (roll, pitch, yaw))
    return np.stack(
        (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ),
        axis=1,
    )


def _times(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(N, 4) products."""
    w = p[:, :1] * q[:, :1] - (p[:, 1:] * q[:, 1:]).sum(axis=1, keepdims=True)
    return np.hstack((w, p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])))


def _rates(q_nb: np.ndarray, t_s: np.ndarray) -> np.ndarray:
    """(N, 3) angular rate of the body."""
    turns = _times(conjugate(q_nb[:-1]), q_nb[1:])
    rates = 2.0 * np.sign(turns[:, :1]) * turns[:, 1:] / np.diff(t_s)[:, None]
    return np.vstack((rates[:1], rates))


def _believed(rng: np.random.Generator, t_s: np.ndarray, q_nb: np.ndarray) -> Estimates:
    """The attitude without compass: wandering in the world, leaning in the board's axes."""
    tilt = [slow_error(rng, t_s, TILT_SIGMA_RAD, 20.0) for _ in range(2)]
    heading = slow_error(rng, t_s, HEADING_SIGMA_RAD, 60.0)
    lean = LEAN_M_S2 / GRAVITY_M_S2 * rng.standard_normal((1, 2)) + np.zeros((len(t_s), 2))
    off_n = np.column_stack((np.ones(len(t_s)), 0.5 * tilt[0], 0.5 * tilt[1], 0.5 * heading))
    off_b = np.column_stack((np.ones(len(t_s)), 0.5 * lean, np.zeros(len(t_s))))
    q = _times(_times(off_n, q_nb), off_b)
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    ones = np.ones(len(t_s))
    sigmas = TILT_SIGMA_RAD * ones, HEADING_SIGMA_RAD * ones
    return Estimates(t_s, q, np.zeros((len(t_s), 3)), *sigmas)


def _compass(
    rng: np.random.Generator,
    vehicle: Vehicle,
    own: dict[str, float],
    t_s: np.ndarray,
    q_nb: np.ndarray,
) -> CompassTrack:
    places = np.arange(0, len(t_s), round(RATE_HZ / FIELD_HZ))
    true_b = rotate(conjugate(q_nb[places]), np.tile(vehicle.earth_n_ut, (len(places), 1)))
    none = np.zeros(len(places))
    raw = vehicle.iron.undone(true_b, none) + 0.3 * rng.standard_normal(true_b.shape)
    settings = ardupilot_compass(own, 0)
    assert settings is not None
    logged = settings.correction.corrected(raw, none)
    offset = np.tile(settings.correction.offset_ut, (len(places), 1))
    return CompassTrack(0, 0, t_s[places] + LATE_S, logged, offset, np.zeros(offset.shape))


def _receiver(rng: np.random.Generator, t_s: np.ndarray, v_n: np.ndarray) -> GpsTrack:
    fix_s = np.arange(1.0, SECONDS, 1.0 / FIX_HZ)
    fixes = np.stack([np.interp(fix_s - DELAY_S, t_s, axis) for axis in v_n.T], axis=1)
    fixes += 0.05 * rng.standard_normal(fixes.shape)
    zeros = np.zeros(len(fix_s))
    return GpsTrack(0, fix_s, zeros == 0.0, zeros, zeros, zeros, fixes, zeros + 0.1, zeros)


def _three(own: dict[str, float], form: str) -> np.ndarray:
    return np.array([own[form % axis] for axis in "XYZ"])

"""A vehicle at rest: its gyros and accelerometers show their own errors.

Gravity does not turn. While its direction in the body stands still without vibration, any rate with
a component across it is a bias, however large; no compass is needed. A vehicle that circles
steadily also shows a steady force, but its receiver shows that it moves.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import Array, Context, GpsTrack, ImuTrack
from h2nav.reviews.inertial import Attitudes, Mask, means, rotate

REST_WINDOW_S, PARTS = 2.5, 5
# In a window, the forces of its parts stay within a degree's share of gravity; likewise rates.
STILL_M_S2, STILL_RAD_S = 0.17, 1.0 * DEG
# A flying or driving vehicle shakes its samples more.
QUIET_RAD_S, QUIET_M_S2 = 1.5 * DEG, 0.6
MOVING_M_S, FIX_WITHIN_S = 1.0, 1.0
MIN_REST_WINDOWS = 3
# A larger bias needs fewer windows: in all of them together, gravity would have turned so far.
WOULD_TURN_RAD, MIN_LARGE = 15.0 * DEG, 2
# About the vertical, gravity shows nothing; but nobody turns a vehicle this evenly for this long.
# A table might, faster than any gyro is off (MPU-6000, before it is calibrated).
EVEN_RAD_S, EVEN_S, MAX_BIAS_RAD_S = 0.3 * DEG, 10.0, 20.0 * DEG
# Allowed difference of biases of windows that belong together.
ALIKE_RAD_S = 1.5 * DEG
# Data sheets, see `sensor_bias`; beyond the second, an attitude is useless.
BIAS_RAD_S, LARGE_RAD_S = 2.0 * DEG, 5.0 * DEG
FORCE_M_S2 = 0.080 * GRAVITY_M_S2
# No accelerometer's zero is off by more: beyond, it is its scale.
SCALE_SHARE = 0.10


class Rest(NamedTuple):
    """Windows at rest, of one IMU."""

    t_s: Array  # (N,) their beginnings
    f_b: Array  # (N, 3) mean force, m/s^2
    w_b: Array  # (N, 3) mean rate, rad/s

    def part(self, wanted: Mask) -> "Rest":
        """A selection of the windows."""
        return Rest(self.t_s[wanted], self.f_b[wanted], self.w_b[wanted])


NEVER = Rest(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))


def detect_rest(rest: Rest, imu: int) -> list[Finding]:
    """Bias of the gyro and scale of the accelerometer of an IMU, from 0, at rest."""
    sensor = Sensor(SensorKind.IMU, imu + 1)
    return [*_gyro(rest, sensor), *_force(rest, sensor)]


def rest_of(track: ImuTrack, context: Context) -> Rest:
    """The windows at rest."""
    if len(track.t_s) < 2 * PARTS:
        return NEVER
    edges = np.arange(track.t_s[0], track.t_s[-1], REST_WINDOW_S / PARTS)
    count = (len(edges) - 1) // PARTS
    if count < 1:
        return NEVER
    edges = edges[: count * PARTS + 1]
    values = np.hstack((track.f_b, track.w_b)).astype(float)
    parts = means(track.t_s, np.hstack((values, values**2)), edges).reshape(count, PARTS, 12)
    mean = parts[:, :, :6].mean(axis=1)
    still = _still(parts, mean)
    t_s = edges[:-1:PARTS]
    still &= ~_moving(context.gps, t_s)
    return Rest(t_s[still], mean[still, :3], mean[still, 3:])


def _still(parts: Array, mean: Array) -> Mask:
    """(N,) windows without rotation and vibration."""
    apart = parts[:, :, :6] - mean[:, None]
    turned = np.linalg.norm(apart[:, :, :3], axis=2).max(axis=1)
    spread = np.linalg.norm(apart[:, :, 3:], axis=2).max(axis=1)
    shaken = np.sqrt(np.maximum(parts[:, :, 6:] - parts[:, :, :6] ** 2, 0.0).mean(axis=1))
    still: Mask = (turned < STILL_M_S2) & (spread < STILL_RAD_S) & mean[:, :3].any(axis=1)
    still &= shaken[:, :3].max(axis=1) < QUIET_M_S2
    still &= shaken[:, 3:].max(axis=1) < QUIET_RAD_S
    return still


def _moving(receivers: Iterable[GpsTrack], t_s: Array) -> Mask:
    """(N,) windows in which a receiver measured a speed."""
    moving = np.zeros(len(t_s), dtype=bool)
    for gps in receivers:
        speed = np.linalg.norm(np.nan_to_num(gps.v_n[:, :2]), axis=1)
        fast = gps.t_s[gps.has_fix & (speed > MOVING_M_S)]
        first = np.searchsorted(fast, t_s - FIX_WITHIN_S)
        after = np.searchsorted(fast, t_s + REST_WINDOW_S + FIX_WITHIN_S)
        moving |= after > first
    return moving


def _gyro(rest: Rest, imu: Sensor) -> list[Finding]:
    if len(rest.t_s) < MIN_LARGE:
        return []
    bias = np.median(rest.w_b, axis=0)
    alike = np.linalg.norm(rest.w_b - bias, axis=1) < ALIKE_RAD_S
    size = float(np.linalg.norm(bias))
    if size < BIAS_RAD_S or not (_against_gravity(rest, bias, alike) or _is_even(rest, bias)):
        return []
    x, y, z = bias / DEG
    times = rest.t_s[alike]
    return [
        Finding(
            Kind.GYRO_BIAS,
            imu,
            Severity.ERROR if size > LARGE_RAD_S else Severity.WARNING,
            float(times[0]),
            float(times[-1] + REST_WINDOW_S),
            size / DEG,
            "deg/s",
            f"gyro turns at {size / DEG:.1f} deg/s at rest",
            f"({x:+.1f}, {y:+.1f}, {z:+.1f}) deg/s about x, y, z in {alike.sum()} windows of "
            f"{REST_WINDOW_S:.1f} s at rest, in which gravity did not turn in the body; data "
            f"sheets admit {BIAS_RAD_S / DEG:.0f}",
        )
    ]


def _against_gravity(rest: Rest, bias: Array, alike: Mask) -> bool:
    """Whether most of the bias would have turned gravity far in the windows that agree."""
    down = rest.f_b / np.linalg.norm(rest.f_b, axis=1, keepdims=True)
    across = np.linalg.norm(rest.w_b - (rest.w_b * down).sum(axis=1, keepdims=True) * down, axis=1)
    if alike.sum() < MIN_LARGE:
        return False
    shown = float(np.median(across[alike]))
    would_turn = float(across[alike].sum()) * REST_WINDOW_S
    return shown > 0.5 * float(np.linalg.norm(bias)) and would_turn > WOULD_TURN_RAD


def _is_even(rest: Rest, bias: Array) -> bool:
    """Whether every window shows the same rate, about whatever axis."""
    apart = np.linalg.norm(rest.w_b - bias, axis=1)
    enough = (
        len(rest.t_s) >= MIN_REST_WINDOWS and rest.t_s[-1] + REST_WINDOW_S - rest.t_s[0] >= EVEN_S
    )
    is_bias = float(np.linalg.norm(bias)) < MAX_BIAS_RAD_S
    return bool(enough and is_bias and apart.max() < EVEN_RAD_S)


def _force(rest: Rest, imu: Sensor) -> list[Finding]:
    if len(rest.t_s) < MIN_REST_WINDOWS - 1:
        return []
    # A vehicle that circles steadily feels more than gravity.
    rest = rest.part(np.linalg.norm(rest.w_b - np.median(rest.w_b, axis=0), axis=1) < ALIKE_RAD_S)
    if len(rest.t_s) < MIN_REST_WINDOWS - 1:
        return []
    norms = np.linalg.norm(rest.f_b, axis=1)
    norm = float(np.median(norms))
    apart = norm - GRAVITY_M_S2
    if abs(apart) < FORCE_M_S2:
        return []
    is_scale = abs(apart) > SCALE_SHARE * GRAVITY_M_S2
    # It may have come in flight, in a hover as calm as rest.
    times = rest.t_s[np.abs(norms - norm) < FORCE_M_S2]
    if not len(times):
        return []  # half of the windows on either side: none shows what lies between
    share = apart / GRAVITY_M_S2
    return [
        Finding(
            Kind.ACCELEROMETER_SCALE if is_scale else Kind.ACCELEROMETER_BIAS,
            imu,
            Severity.ERROR if is_scale else Severity.WARNING,
            float(times[0]),
            float(times[-1] + REST_WINDOW_S),
            1e3 * abs(share) if is_scale else abs(apart),
            "mg" if is_scale else "m/s^2",
            f"accelerometer shows {norm:.2f} m/s^2 at rest",
            f"gravity is {GRAVITY_M_S2:.2f}: {1e3 * abs(share):.0f} mg of bias, or {share:+.1%} of "
            f"scale, over {len(norms) * REST_WINDOW_S:.0f} s at rest; data sheets admit "
            f"{1e3 * FORCE_M_S2 / GRAVITY_M_S2:.0f} mg: calibrate it",
        )
    ]


def force_error(rest: Rest) -> float:
    """Error of the accelerometer along gravity, m/s^2; 0 if it was never at rest."""
    if not len(rest.t_s):
        return 0.0
    return abs(float(np.median(np.linalg.norm(rest.f_b, axis=1))) - GRAVITY_M_S2)


def bias_at_rest(rest: Rest) -> Array:
    """(3,) rate of the gyro at rest, rad/s; zero unless it is certainly a bias."""
    bias = np.median(rest.w_b, axis=0) if len(rest.t_s) >= MIN_LARGE else np.zeros(3)
    return bias if float(np.linalg.norm(bias)) > BIAS_RAD_S else np.zeros(3)


def tilt_at_rest(rest: Rest, track: Attitudes) -> float:
    """Angle between gravity at rest and an attitude's vertical, rad; NaN if either is unknown."""
    if not len(rest.t_s) or len(track.t_s) < 2:
        return float("nan")
    q_nb = track.at(rest.t_s + 0.5 * REST_WINDOW_S)
    known = np.isfinite(q_nb[:, 0])
    if not known.any():
        return float("nan")
    up = rotate(q_nb[known], rest.f_b[known])
    cosine = -up[:, 2] / np.linalg.norm(up, axis=1)
    return float(np.median(np.arccos(np.clip(cosine, -1.0, 1.0))))

"""What something truthful shows of heading and tilt, second by second.

An attitude that is wrong is only held against a filter while one of its inputs shows better.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.evaluation.campaign.draw import OF_COMPASS, Draw
from h2nav.evaluation.campaign.flight import DrawnFlight
from h2nav.evaluation.campaign.sensors import DrawnReadings
from h2nav.maths.rows import Array, wrapped
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.sim.faults import Fault

Mask = NDArray[np.bool_]

# A compass whose own heading, levelled by the truth, is nearer than this to the truth; half of
# what counts as a wrong heading.
TRUTHFUL_DEG = 5.0
# An accelerometer whose mean force points off the true one by less; half of what counts as a wrong
# tilt. Nothing shows the tilt of a vehicle that rests but its accelerometers.
LEVEL_DEG = 1.5
# Beyond these a compass is disturbed, whoever says so: 5 % of iron turn a level heading by 10 deg
# where the field is steep (dip 70 deg), and the norm by as much.
DISTURBED_DEG, DISTURBED_SHARE = 8.0, 0.1
# For this long a sensor must have been truthful, and the vehicle accelerated, or unaccelerated.
SHOWN_WINDOW_S = 10
ENOUGH_M_S2, STILL_M_S2 = 1.0, 0.3
NOISY_M_S = 0.5
GYRO_FAULTS = ("gyro-", "imu-frozen")
ACCELEROMETER_FAULTS = ("accel-", "clipping", "vibration", "imu-frozen")
COMPASS_FAULTS = (*OF_COMPASS, "imu-frozen")
RECEIVER_FAULTS = ("gps-",)


class ShownBySensors(NamedTuple):
    """Second by second."""

    heading: Mask  # (S,) a truthful compass, or velocities, show it
    tilt: Mask  # (S,)
    disturbed: tuple[Mask, ...]  # of each compass: it does not measure the earth's field
    receiver: Mask  # (S,) it is there and truthful


def shown(flight: DrawnFlight) -> ShownBySensors:
    """What the sensors of a flight show."""
    draw = flight.draw
    seconds = np.arange(int(draw.length_s), dtype=np.float64)
    errors = [_compass_errors(flight, number) for number in range(draw.imu.count)]
    truthful = np.zeros(len(seconds), np.bool_)
    for number, (error_deg, _) in enumerate(errors):
        sound = ~faulty(draw, COMPASS_FAULTS, seconds, number)
        truthful |= _lasting((np.abs(error_deg) < TRUTHFUL_DEG) & sound)
    disturbed = tuple(
        ~((np.abs(error) < DISTURBED_DEG) & (np.abs(share) < DISTURBED_SHARE))
        for error, share in errors
    )
    receiver = _receiver(flight, seconds)
    lately = _lasting(receiver)
    a_m_s2 = np.linalg.norm(flight.motion.at(seconds + 0.5).a_n[:, :2], axis=1)
    accelerates = np.sqrt(_mean(a_m_s2**2)) >= ENOUGH_M_S2
    gyro = _some_imu(draw, GYRO_FAULTS, seconds)
    force = _some_imu(draw, GYRO_FAULTS + ACCELEROMETER_FAULTS, seconds)
    by_velocity = lately & accelerates & force & (draw.receiver.noise_m_s < NOISY_M_S)
    still = _lasting(a_m_s2 < STILL_M_S2)
    level = np.zeros(len(seconds), np.bool_)
    for number in range(draw.imu.count):
        sound = ~faulty(draw, GYRO_FAULTS + ACCELEROMETER_FAULTS, seconds, number)
        level |= _lasting((_force_errors(flight, number) < LEVEL_DEG) & sound)
    by_motion = lately & force & _lasting(flight.motion.moves(seconds) > 0.0)
    shown_tilt = (level & (lately | still)) | by_motion
    return ShownBySensors(gyro & (truthful | by_velocity), shown_tilt, disturbed, receiver)


def faulty(draw: Draw, names: tuple[str, ...], seconds: Array, imu: int | None = None) -> Mask:
    """(S,) whether one of these faults acts; of an IMU, 0 being the first, or of any."""
    found = np.zeros(len(seconds), np.bool_)
    for fault in draw.scheduled:
        if is_one_of(fault, names) and (imu is None or fault.imu == imu + 1):
            over_s = fault.start_s + fault.length_s
            found |= (seconds + 1.0 >= fault.start_s) & (seconds < over_s)
    return found


def is_one_of(fault: Fault, names: tuple[str, ...]) -> bool:
    """Whether its name begins with one of these."""
    return any(fault.name.startswith(name) for name in names)


def _some_imu(draw: Draw, names: tuple[str, ...], seconds: Array) -> Mask:
    """(S,) whether some IMU has none of these faults, and had none lately."""
    sound = [_lasting(~faulty(draw, names, seconds, imu)) for imu in range(draw.imu.count)]
    return np.asarray(np.any(sound, axis=0))


def _compass_errors(flight: DrawnFlight, number: int) -> tuple[Array, Array]:
    """(S,) error of the heading by a compass, deg, and of the field's norm, as a share of it.

    NaN without a field in that second.
    """
    found, size = flight.imus[number], int(flight.draw.length_s)
    field_n = _mean_field(flight, found, size)
    declination = flight.field.declination_rad
    heading = wrapped(declination - np.arctan2(field_n[:, 1], field_n[:, 0]))
    return heading / DEG, np.linalg.norm(field_n, axis=1) / flight.field.norm_ut - 1.0


def _force_errors(flight: DrawnFlight, number: int) -> Array:
    """(S,) by how much an accelerometer's mean force points off the true one, deg."""
    found, size = flight.imus[number], int(flight.draw.length_s)
    rows = np.flatnonzero(found.t_s < size)
    truth = flight.motion.at(found.t_s[rows] - 1e-3 * flight.draw.imu.delay_ms)
    off_n = np.einsum("nij,nj->ni", truth.to_ned, found.f_b[rows] - truth.f_b)
    off_n = _mean_of_seconds(off_n, found.t_s[rows].astype(np.int64), size)
    return np.asarray(np.arctan(np.hypot(off_n[:, 0], off_n[:, 1]) / GRAVITY_M_S2) / DEG)


def _mean_field(flight: DrawnFlight, found: DrawnReadings, size: int) -> Array:
    """(S, 3) mean field of each second, turned to NED by the truth."""
    rows = np.flatnonzero(~np.isnan(found.m_b_ut[:, 0]) & (found.t_s < size))
    # A few a second suffice, and a message of integers repeats them.
    few = np.diff(np.floor(found.t_s[rows] * 10.0), prepend=-1.0) > 0.0
    rows = rows[few]
    read_s = found.t_s[rows] - 1e-3 * flight.draw.compass.delay_ms
    turned = np.einsum("nij,nj->ni", flight.motion.at(read_s).to_ned, found.m_b_ut[rows])
    return _mean_of_seconds(turned, found.t_s[rows].astype(np.int64), size)


def _mean_of_seconds(values: Array, second: NDArray[np.int64], size: int) -> Array:
    """(S, 3) mean of the values of each second; NaN without one."""
    count = np.bincount(second, minlength=size).astype(np.float64)
    count[count == 0.0] = np.nan
    sums = [np.bincount(second, values[:, axis], minlength=size) for axis in range(3)]
    return np.asarray(np.stack(sums, axis=1) / count[:, None])


def _receiver(flight: DrawnFlight, seconds: Array) -> Mask:
    """(S,) whether the receiver has a fix in this second, and none of its faults acts."""
    second = flight.fixes.t_s[flight.fixes.has_fix].astype(np.int64)
    has_fix = np.bincount(second, minlength=len(seconds))[: len(seconds)] > 0
    if flight.draw.receiver.rate_hz < 1.0:
        has_fix[1:] |= has_fix[:-1].copy()
    return np.asarray(has_fix & ~faulty(flight.draw, RECEIVER_FAULTS, seconds))


def _lasting(values: Mask) -> Mask:
    """(S,) whether it has held for the whole window."""
    return np.asarray(_mean(values.astype(np.float64)) > 1.0 - 0.5 / SHOWN_WINDOW_S)


def _mean(values: Array) -> Array:
    """(S,) mean over the window that ends here; as if 0 before the beginning."""
    padded = np.concatenate((np.zeros(SHOWN_WINDOW_S - 1), values))
    windows = np.lib.stride_tricks.sliding_window_view(padded, SHOWN_WINDOW_S)
    return np.asarray(windows.mean(axis=1))

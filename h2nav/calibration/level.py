"""Tilt of the board in a multirotor: the thrust is along an axis of the frame.

In flight the IMU measures thrust and drag. The drag varies with heading or speed; the part that is
constant in the axes of the board is the board's tilt.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.calibration.evidence import PX4, Evidence
from h2nav.calibration.imu import Forces, Tracks
from h2nav.calibration.imu_settings import board_of
from h2nav.calibration.outcome import Outcome, ParameterChange
from h2nav.calibration.regression import (
    LAST_ROUNDS,
    Array,
    halves_of,
    longer,
    noise_of,
    robust,
    together,
)
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import ImuTrack
from h2nav.recordings.motor_outputs import MULTIROTORS
from h2nav.reviews.inertial import Mask, conjugate, interpolated, means, rotate, slowed
from h2nav.reviews.receiver import moves_of
from h2nav.reviews.sensor_bias import measuring

THRUST_WINDOW_S = 1.0
MIN_THRUST_ROWS = 40
# Roll, pitch, drag by speed, drag by the wind from north and east. A board that was meant to be
# level; multirotors 0.2 to 0.5 /s; a wind of 5 m/s.
SIGMAS = np.array((6.0 * DEG, 6.0 * DEG, 0.4, 2.0, 2.0))
COUNT = len(SIGMAS)
MIN_NOISE_M_S2 = 0.05
# If the wind changes while the vehicle turns, 0.25 m/s count as tilt, with a drag of 0.2 /s.
MIN_SIGMA_RAD = 0.3 * DEG
# One degree is a drift of 0.17 m/s^2 in a hover by attitude alone; halves that differ by more show
# something else.
RELEVANT_RAD, SURE = 1.0 * DEG, 4.0
NAMES = {True: ("SENS_BOARD_X_OFF", "SENS_BOARD_Y_OFF"), False: ("AHRS_TRIM_X", "AHRS_TRIM_Y")}
# The firmwares' limit.
MAX_TRIM_RAD = 10.0 * DEG


class _Rows(NamedTuple):
    """Windows: (N,) flight and middle, (N, 2) level force, (N, 2, 5) its derivatives."""

    flight: NDArray[np.int64]
    t_s: Array
    force: Array
    J: Array


def calibrate_level(tracks: Tracks, forces: Forces) -> Outcome:
    """Calibrates the board's level, by one IMU.

    Args:
        forces: calibration of its accelerometer.
    """
    last = tracks.pairs[-1][0]
    own = Outcome("level")
    if last.context.vehicle_type not in MULTIROTORS:
        return own._replace(left=("observable in flights of a multirotor only",))
    names = NAMES[last.autopilot == PX4]
    if any(name not in last.parameters for name in names):
        return own._replace(left=("its parameters are not in the recording (--parameters)",))
    found = [_rows(number, *pair, forces.offset) for number, pair in enumerate(tracks.pairs)]
    rows = together(found)
    if len(rows.t_s) < MIN_THRUST_ROWS:
        return own._replace(left=("too little time in the air, or that time is unknown",))
    angles, sigma = _tilt(rows, forces.sigma)
    roll, pitch = angles.tolist()
    roll_sigma, pitch_sigma = sigma.tolist()
    unit = DEG if last.autopilot == PX4 else 1.0
    old = np.array([last.parameters[name] for name in names]) * unit
    new = np.array((roll, pitch))
    figures = {
        "roll_deg": roll / DEG, "pitch_deg": pitch / DEG,
        "roll_sigma_deg": roll_sigma / DEG, "pitch_sigma_deg": pitch_sigma / DEG,
        "windows": float(len(rows.t_s)),
    }  # fmt: skip
    own = own._replace(figures=figures)
    change = np.abs(new - old)
    words = (
        f"({roll / DEG:+.1f} ± {roll_sigma / DEG:.1f}, "
        f"{pitch / DEG:+.1f} ± {pitch_sigma / DEG:.1f}) deg"
    )
    wanted = (change > RELEVANT_RAD) & (change > SURE * sigma)
    if not wanted.any():  # one axis or both: they are one rotation
        return own._replace(left=(f"no change: roll and pitch by the thrust are {words}",))
    one, other = (_tilt(half, 0.0)[0] for half in halves_of(rows))
    if np.abs(one - other).max() > RELEVANT_RAD or np.abs(new).max() > MAX_TRIM_RAD:
        return own._replace(left=(f"the halves of the flight do not agree on {words}",))
    return own._replace(
        changes=tuple(
            ParameterChange(
                names[i], float(old[i] / unit), float(new[i] / unit), float(sigma[i] / unit)
            )
            for i in range(2)
        ),
        shown=f"thrust in {len(rows.t_s)} windows of {THRUST_WINDOW_S:.0f} s in the air",
    )


def _rows(number: int, evidence: Evidence, track: ImuTrack, added: Array) -> _Rows:
    """Means of force in the air, in the axes of the board, with the velocity in them."""
    nothing = _Rows(
        np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2, COUNT))
    )
    track = measuring(track, evidence.flight.findings)
    if len(track.t_s) < MIN_THRUST_ROWS or evidence.gps is None:
        return nothing
    track = slowed(track)
    edges = np.arange(track.t_s[0], track.t_s[-1], THRUST_WINDOW_S)
    t_s = 0.5 * (edges[1:] + edges[:-1])
    if not len(t_s):
        return nothing
    moves = moves_of(evidence.gps)
    q = evidence.attitude_of_tracks().at(t_s)
    board = board_of(evidence).vectors(np.eye(3))  # rows: where the board's axes lie
    force = (means(track.t_s, track.f_b, edges) + added) @ board.T
    level = [rotate(conjugate(q), np.tile(axis, (len(t_s), 1))) @ board.T for axis in np.eye(3)]
    v_n = interpolated(t_s, moves.t_s, moves.v_n)
    v = sum(part * axis for part, axis in zip(v_n.T[:2, :, None], level[:2], strict=True))
    J = np.zeros((len(t_s), 2, COUNT))
    J[:, 0, 1], J[:, 1, 0] = -force[:, 2], force[:, 2]
    J[:, :, 2] = -v[:, :2]
    J[:, :, 3], J[:, :, 4] = level[0][:, :2], level[1][:, :2]
    good = in_air(evidence, edges) & np.isfinite(force.sum(axis=1) + J.sum(axis=(1, 2)))
    # Only its motors carry it.
    good &= force[:, 2] < -0.5 * GRAVITY_M_S2
    return _Rows(np.full(int(good.sum()), number), t_s[good], force[good, :2], J[good])


def in_air(evidence: Evidence, edges: Array) -> Mask:
    """(M - 1,) windows entirely in the air; none if that is unknown."""
    airborne = evidence.context.airborne
    if airborne is None:
        return np.zeros(len(edges) - 1, dtype=bool)
    place = np.searchsorted(airborne.t_s, edges, side="right") - 1
    flies = (place >= 0) & (airborne.values[place.clip(0)] > 0.0)
    changes = np.diff(place) > 0
    inside: Mask = flies[1:] & flies[:-1] & ~(changes & ~flies[1:]) & evidence.flying(edges[1:])
    return inside


def _tilt(rows: _Rows, offset_m_s2: float) -> tuple[Array, Array]:
    """(2,) roll and pitch of the board in the frame, rad, and their deviations."""
    information = np.diag(SIGMAS**-2)
    x: Array = np.zeros(COUNT)
    flat = np.ones(len(rows.t_s))
    for _ in range(LAST_ROUNDS):
        r = rows.force - rows.J @ x
        noise = max(noise_of(np.linalg.norm(r, axis=1), flat), MIN_NOISE_M_S2)
        weight = robust(np.linalg.norm(r, axis=1), noise, 1.0)
        weighted = rows.J * (weight / noise**2)[:, None, None]
        A = np.einsum("nij,nik->jk", weighted, rows.J)
        x = np.linalg.solve(A + information, np.einsum("nij,ni->j", weighted, rows.force))
    inflated = longer(rows.flight, rows.t_s, rows.force - rows.J @ x, weight, COUNT)
    sigma = np.sqrt(np.diag(np.linalg.inv(A / inflated + information)))[:2]
    angles = np.arctan(x[:2])
    angles[1] = math.atan(x[1] * math.cos(angles[0]))
    return angles, np.hypot(np.hypot(sigma, MIN_SIGMA_RAD), offset_m_s2 / GRAVITY_M_S2)

"""The error of the estimates against what the recording itself says of the attitude.

SIMSTATE is the simulator's truth and carries no time; it belongs to the samples that arrive with
it. ATTITUDE is the autopilot's own estimate, with its time since boot.
"""

from array import array
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.io import codec
from h2nav.io.deframer import Frame
from h2nav.service.records import EstimateRecord

SIMSTATE = mavlink.MAVLINK_MSG_ID_SIMSTATE
ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE
# Further apart than this, an estimate and a reference do not belong together.
FARTHEST_US = 20_000

Floats = NDArray[np.float64]


class ErrorTable(NamedTuple):
    """RMS errors in degrees over all estimates that have a reference.

    Attributes:
        reference: SIMSTATE, ATTITUDE, or empty when the recording has neither.
        compared: how many pairs.
        roll: Euler angle errors (z-y-x).
        tilt: angle between the estimated and the true vertical.
        total: angle of the whole error rotation.
    """

    reference: str
    compared: int
    roll: float = float("nan")
    pitch: float = float("nan")
    yaw: float = float("nan")
    tilt: float = float("nan")
    total: float = float("nan")

    def as_mapping(self) -> dict[str, float | None]:
        """The errors by name; None where there is nothing to compare."""
        return {
            name: round(value, 5) if self.compared else None
            for name, value in self._asdict().items()
            if name not in ("reference", "compared")
        }


class _Attitudes:
    """Times (us) and roll, pitch, yaw (rad), growing cheaply."""

    def __init__(self) -> None:
        self.t_us = array("q")
        self.angles = array("d")

    def add(self, t_us: int, roll: float, pitch: float, yaw: float) -> None:
        self.t_us.append(t_us)
        self.angles.extend((roll, pitch, yaw))

    def arrays(self) -> tuple[NDArray[np.int64], Floats]:
        return np.array(self.t_us), np.array(self.angles).reshape(-1, 3)


class Reference:
    """Collects estimates and references while a recording runs; compares them at its end.

    Attributes:
        message_ids: the messages that say something of the attitude.
    """

    message_ids = frozenset({SIMSTATE, ATTITUDE})

    def __init__(self) -> None:
        self._by_arrival = _Attitudes()
        self._by_boot_time = _Attitudes()
        self._truth = _Attitudes()
        self._autopilot = _Attitudes()

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Takes what a frame of `message_ids` says of the attitude."""
        if frame.msg_id == SIMSTATE:
            fields: Any = codec.decode(frame)
            self._truth.add(t_ns // 1000, fields.roll, fields.pitch, fields.yaw)
        elif frame.compid == mavlink.MAV_COMP_ID_AUTOPILOT1:
            fields = codec.decode(frame)
            t_us = fields.time_boot_ms * 1000
            self._autopilot.add(t_us, fields.roll, fields.pitch, fields.yaw)

    def estimate(self, t_ns: int, record: EstimateRecord) -> None:
        """Takes an estimate."""
        angles = (record.roll_deg, record.pitch_deg, record.yaw_deg)
        roll, pitch, yaw = (angle * np.pi / 180.0 for angle in angles)
        self._by_arrival.add(t_ns // 1000, roll, pitch, yaw)
        self._by_boot_time.add(record.t_us, roll, pitch, yaw)

    def table(self, skip_s: float = 0.0) -> ErrorTable:
        """The errors against SIMSTATE, else ATTITUDE.

        Args:
            skip_s: references of so many first seconds do not count.
        """
        for name, reference, estimates in (
            ("SIMSTATE", self._truth, self._by_arrival),
            ("ATTITUDE", self._autopilot, self._by_boot_time),
        ):
            if reference.t_us and estimates.t_us:
                return _compare(name, reference, estimates, skip_s)
        return ErrorTable("", 0)


def _compare(name: str, reference: _Attitudes, estimates: _Attitudes, skip_s: float) -> ErrorTable:
    reference_us, reference_angles = reference.arrays()
    counts = reference_us >= reference_us[0] + skip_s * 1e6
    reference_us, reference_angles = reference_us[counts], reference_angles[counts]
    estimate_us, estimate_angles = estimates.arrays()
    order = np.argsort(estimate_us, kind="stable")
    estimate_us, estimate_angles = estimate_us[order], estimate_angles[order]
    after = np.clip(np.searchsorted(estimate_us, reference_us), 1, max(len(estimate_us) - 1, 1))
    after = np.minimum(after, len(estimate_us) - 1)
    before = np.maximum(after - 1, 0)
    nearer_before = np.abs(estimate_us[before] - reference_us) <= np.abs(
        estimate_us[after] - reference_us
    )
    nearest = np.where(nearer_before, before, after)
    paired = np.abs(estimate_us[nearest] - reference_us) <= FARTHEST_US
    if not paired.any():
        return ErrorTable("", 0)
    truth, ours = reference_angles[paired], estimate_angles[nearest[paired]]
    difference = (ours - truth + np.pi) % (2.0 * np.pi) - np.pi
    tilt, total = _rotation_errors(ours, truth)
    rms = [_rms_deg(column) for column in (*difference.T, tilt, total)]
    return ErrorTable(name, int(paired.sum()), *rms)


def _rotation_errors(ours: Floats, truth: Floats) -> tuple[Floats, Floats]:
    """Angle between the verticals, and angle of the whole rotation, rad."""
    R_ours, R_truth = _matrices(ours), _matrices(truth)
    cos_tilt = np.einsum("ij,ij->i", R_ours[:, 2], R_truth[:, 2])
    sin_tilt = np.linalg.norm(np.cross(R_ours[:, 2], R_truth[:, 2]), axis=1)
    # |R1 - R2| (Frobenius) is 2 sqrt(2) sin(angle/2): accurate for small angles, unlike the trace.
    chord = np.linalg.norm(R_ours - R_truth, axis=(1, 2)) / (2.0 * np.sqrt(2.0))
    return np.arctan2(sin_tilt, cos_tilt), 2.0 * np.arcsin(np.minimum(chord, 1.0))


def _matrices(angles: Floats) -> Floats:
    """R_nb of roll, pitch, yaw, shape (N, 3, 3)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles).T, np.sin(angles).T
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _rms_deg(values: Floats) -> float:
    return float(np.degrees(np.sqrt(np.mean(values**2))))

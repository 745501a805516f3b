"""Errors of the estimates against the attitude in the recording itself.

SIMSTATE is the simulator's truth without a time stamp; it belongs to the samples that arrive with
it. ATTITUDE is the autopilot's own estimate, stamped with its time since boot.
"""

import math
from array import array
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.attitude_errors import errors, honesty, root_mean_square
from h2nav.maths.quaternion import to_euler
from h2nav.maths.rows import Array, from_euler, wrapped
from h2nav.recordings.frame_tables import FrameTable
from h2nav.wire import codec
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.deframer import Frame
from h2nav.wire.readers import Message

SIMSTATE = mavlink.MAVLINK_MSG_ID_SIMSTATE
ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE
# An estimate and a reference further apart do not belong together.
FARTHEST_US = 20_000


class EulerRecord(Protocol):
    """The common fields of records of estimates."""

    @property
    def t_us(self) -> int:
        """Autopilot time."""

    @property
    def roll_deg(self) -> float:
        """Euler angle of the z-y-x sequence."""

    @property
    def pitch_deg(self) -> float:
        """The same."""

    @property
    def yaw_deg(self) -> float:
        """The same."""

    @property
    def sigma_tilt_deg(self) -> float:
        """Predicted one-sigma tilt error; NaN without."""

    @property
    def sigma_heading_deg(self) -> float:
        """Predicted one-sigma heading error; NaN without."""


class ErrorTable(NamedTuple):
    """RMS errors in degrees over all estimates that have a reference."""

    reference: str  # SIMSTATE, ATTITUDE, or empty if the recording has neither
    compared: int  # number of pairs
    roll: float = float("nan")  # Euler angle errors (z-y-x)
    pitch: float = float("nan")
    yaw: float = float("nan")
    tilt: float = float("nan")  # angle between the estimated and the true vertical
    total: float = float("nan")  # angle of the whole error rotation

    def as_mapping(self) -> dict[str, float | None]:
        """The errors by name; None where there is nothing to compare."""
        return {
            name: round(value, 5) if self.compared else None
            for name, value in self._asdict().items()
            if name not in ("reference", "compared")
        }


class Pairs(NamedTuple):
    """References with their samples."""

    reference: str  # SIMSTATE, ATTITUDE, or empty if the recording has neither
    rows: NDArray[np.int64]  # (M,) numbers of the samples
    angles: Array  # (M, 3) reference there: roll, pitch, yaw, rad


class TimedAttitudes:
    """Times (us) and roll, pitch, yaw (rad), growing cheaply."""

    def __init__(self) -> None:
        self.t_us = array("q")
        self.angles = array("d")

    def add(self, t_us: int, roll: float, pitch: float, yaw: float) -> None:
        """Appends one."""
        self.t_us.append(t_us)
        self.angles.extend((roll, pitch, yaw))

    def extend(self, t_us: NDArray[np.int64], fields: NDArray[Any]) -> None:
        """Appends many, by the fields of their messages."""
        angles = np.stack([fields[name] for name in ("roll", "pitch", "yaw")], axis=1)
        self.t_us.frombytes(t_us.astype(np.int64).tobytes())
        self.angles.frombytes(angles.astype(np.float64).tobytes())

    def arrays(self) -> tuple[NDArray[np.int64], Array]:
        """(N,) times, us, and (N, 3) angles, rad."""
        return np.array(self.t_us), np.array(self.angles).reshape(-1, 3)


class TimedEstimates:
    """Estimates with their times of arrival."""

    def __init__(self) -> None:
        self._attitudes = TimedAttitudes()  # by arrival
        self._boot_us = array("q")  # of the same
        self._sigmas = array("d")

    def add(self, t_ns: int, record: EulerRecord) -> None:
        """Adds an estimate of a sample that arrived at this host time."""
        angles = (record.roll_deg, record.pitch_deg, record.yaw_deg)
        roll, pitch, yaw = map(math.radians, angles)
        self._attitudes.add(t_ns // 1000, roll, pitch, yaw)
        self._boot_us.append(record.t_us)
        self._sigmas.extend((record.sigma_tilt_deg, record.sigma_heading_deg))

    @property
    def sigmas_deg(self) -> Array:
        """(N, 2) predicted deviations of tilt and heading."""
        return np.array(self._sigmas).reshape(-1, 2)

    def arrays(self) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
        """(N,) times of arrival, us, (N,) autopilot times, us, (N, 3) roll, pitch, yaw, rad."""
        arrived_us, angles = self._attitudes.arrays()
        return arrived_us, np.array(self._boot_us), angles


class Reference:
    """Collects estimates and references during a playback; compares them at its end.

    Attributes:
        message_ids: the messages with an attitude.
    """

    message_ids = frozenset({SIMSTATE, ATTITUDE})

    def __init__(self) -> None:
        self._estimates = TimedEstimates()
        self._truth = TimedAttitudes()
        self._autopilot = TimedAttitudes()

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Adds the attitude in a frame of `message_ids`."""
        if frame.msg_id == SIMSTATE:
            fields: Any = codec.decode(frame)
            self._truth.add(t_ns // 1000, fields.roll, fields.pitch, fields.yaw)
        elif frame.compid == mavlink.MAV_COMP_ID_AUTOPILOT1:
            fields = codec.decode(frame)
            t_us = fields.time_boot_ms * 1000
            self._autopilot.add(t_us, fields.roll, fields.pitch, fields.yaw)

    def tables(self, found: Mapping[int, FrameTable]) -> None:
        """Adds the attitudes of a whole recording, by tables of `message_ids`."""
        truth, autopilot = found[SIMSTATE], found[ATTITUDE]
        self._truth.extend(truth.t_ns // 1000, truth.fields)
        of_autopilot = autopilot.senders[:, 1] == mavlink.MAV_COMP_ID_AUTOPILOT1
        fields = autopilot.fields[of_autopilot]
        self._autopilot.extend(fields["time_boot_ms"].astype(np.int64) * 1000, fields)

    def message(self, message: Message) -> None:
        """Adds the attitude in an event of an autopilot's own log."""
        if isinstance(message, ReportedAttitude) and message.time_ms is not None:
            self._autopilot.add(message.time_ms * 1000, *to_euler(message.q_nb))

    def estimate(self, t_ns: int, record: EulerRecord) -> None:
        """Adds an estimate."""
        self._estimates.add(t_ns, record)

    def table(self, skip_s: float = 0.0, estimates: TimedEstimates | None = None) -> ErrorTable:
        """The errors against SIMSTATE, otherwise ATTITUDE.

        Args:
            skip_s: length of the beginning that is not scored.
            estimates: to compare instead of the added ones.
        """
        arrived_us, boot_us, angles = (estimates or self._estimates).arrays()
        pairs = self.pairs(arrived_us, boot_us, skip_s)
        if not len(pairs.rows):
            return ErrorTable("", 0)
        return _table(pairs.reference, angles[pairs.rows], pairs.angles)

    def honesty(self) -> dict[str, float | None]:
        """Consistency of the predicted deviations with the simulator's truth; None without it.

        Keys: see `h2nav.maths.attitude_errors.honesty`, of tilt and heading.
        """
        arrived_us, boot_us, angles = self._estimates.arrays()
        pairs = self.pairs(arrived_us, boot_us)
        rows, sigmas = pairs.rows, self._estimates.sigmas_deg
        if pairs.reference != "SIMSTATE":
            rows, pairs = rows[:0], pairs._replace(angles=pairs.angles[:0])
        mask = np.ones(len(rows), dtype=bool)
        found = errors(from_euler(angles[rows]), from_euler(pairs.angles), mask, True)
        return honesty("tilt", found.inclination, sigmas[rows, 0]) | honesty(
            "heading", found.heading, sigmas[rows, 1]
        )

    def pairs(
        self, arrived_us: NDArray[np.int64], boot_us: NDArray[np.int64], skip_s: float = 0.0
    ) -> Pairs:
        """The references of samples.

        Args:
            arrived_us: (N,) when the samples arrived.
            boot_us: (N,) the samples' own times.
            skip_s: length of the beginning that is not scored.
        """
        for name, reference, t_us in (
            ("SIMSTATE", self._truth, arrived_us),
            ("ATTITUDE", self._autopilot, boot_us),
        ):
            if reference.t_us and len(t_us):
                at_us, angles = reference.arrays()
                counts = at_us >= at_us[0] + skip_s * 1e6
                rows = _nearest(at_us[counts], t_us)
                return Pairs(name, rows[rows >= 0], angles[counts][rows >= 0])
        return Pairs("", np.empty(0, dtype=np.int64), np.empty((0, 3)))


def _nearest(at_us: NDArray[np.int64], t_us: NDArray[np.int64]) -> NDArray[np.int64]:
    """The row of `t_us` (any order) nearest to each time; -1 where none is near enough."""
    order = np.argsort(t_us, kind="stable")
    ordered = t_us[order]
    after = np.clip(np.searchsorted(ordered, at_us), 1, max(len(ordered) - 1, 1))
    after = np.minimum(after, len(ordered) - 1)
    before = np.maximum(after - 1, 0)
    nearer_before = np.abs(ordered[before] - at_us) <= np.abs(ordered[after] - at_us)
    nearest = np.where(nearer_before, before, after)
    is_near = np.abs(ordered[nearest] - at_us) <= FARTHEST_US
    return np.where(is_near, order[nearest], -1)


def _table(name: str, ours: Array, truth: Array) -> ErrorTable:
    found = errors(from_euler(ours), from_euler(truth), np.ones(len(ours), dtype=bool), True)
    columns = (*np.degrees(wrapped(ours - truth)).T, found.inclination, found.total)
    return ErrorTable(name, len(ours), *map(root_mean_square, columns))

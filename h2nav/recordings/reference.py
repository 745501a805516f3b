"""Errors of the estimates against the attitude in the recording itself.

SIMSTATE is the simulator's truth without a time stamp; it belongs to the samples that arrive with
it. ATTITUDE is the autopilot's own estimate, stamped with its time since boot.
"""

from array import array
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate
from h2nav.maths import quaternion
from h2nav.maths.attitude_errors import AttitudeErrors, errors, honesty, root_mean_square
from h2nav.maths.rows import Array, from_euler, to_euler, wrapped
from h2nav.recordings.frame_tables import FrameTable
from h2nav.wire import codec
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.deframer import Frame
from h2nav.wire.readers import Message

SIMSTATE = mavlink.MAVLINK_MSG_ID_SIMSTATE
ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE
# An estimate and a reference further apart do not belong together.
FARTHEST_US = 20_000


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
    """Estimates with their times of arrival; their angles are worked out at the end."""

    def __init__(self) -> None:
        self._arrived_us, self._boot_us = array("q"), array("q")
        self._numbers = array("d")  # of each: attitude, both deviations

    def add(self, t_ns: int, estimate: AttitudeEstimate) -> None:
        """Adds an estimate of a sample that arrived at this host time."""
        self._arrived_us.append(t_ns // 1000)
        self._boot_us.append(estimate.t_us)
        self._numbers.extend(estimate.q_nb)
        self._numbers.extend((estimate.sigma_tilt_rad, estimate.sigma_heading_rad))

    def times(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(N,) times of arrival, us, and (N,) autopilot times, us."""
        return np.array(self._arrived_us), np.array(self._boot_us)

    def angles(self, rows: NDArray[np.int64]) -> Array:
        """(M, 3) roll, pitch, yaw, rad, of some."""
        # By way of degrees, as records have them.
        degrees = np.degrees(to_euler(self._rows[rows, :4]))
        return np.radians(degrees)

    def sigmas_deg(self, rows: NDArray[np.int64]) -> Array:
        """(M, 2) predicted deviations of tilt and heading of some."""
        found: Array = np.degrees(self._rows[rows, 4:])
        return found

    @property
    def _rows(self) -> Array:
        return np.array(self._numbers).reshape(-1, 6)


class _Compared(NamedTuple):
    """Estimates beside their references."""

    pairs: Pairs
    ours: Array  # (M, 3) roll, pitch, yaw, rad
    errors: AttitudeErrors


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
        self._compared: _Compared | None = None  # all there is, once asked for

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Adds the attitude in a frame of `message_ids`."""
        self._compared = None
        if frame.msg_id == SIMSTATE:
            fields: Any = codec.decode(frame)
            self._truth.add(t_ns // 1000, fields.roll, fields.pitch, fields.yaw)
        elif frame.compid == mavlink.MAV_COMP_ID_AUTOPILOT1:
            fields = codec.decode(frame)
            t_us = fields.time_boot_ms * 1000
            self._autopilot.add(t_us, fields.roll, fields.pitch, fields.yaw)

    def tables(self, found: Mapping[int, FrameTable]) -> None:
        """Adds the attitudes of a whole recording, by tables of `message_ids`."""
        self._compared = None
        truth, autopilot = found[SIMSTATE], found[ATTITUDE]
        self._truth.extend(truth.t_ns // 1000, truth.fields)
        of_autopilot = autopilot.senders[:, 1] == mavlink.MAV_COMP_ID_AUTOPILOT1
        fields = autopilot.fields[of_autopilot]
        self._autopilot.extend(fields["time_boot_ms"].astype(np.int64) * 1000, fields)

    def message(self, message: Message) -> None:
        """Adds the attitude in an event of an autopilot's own log."""
        if isinstance(message, ReportedAttitude) and message.time_ms is not None:
            self._compared = None
            self._autopilot.add(message.time_ms * 1000, *quaternion.to_euler(message.q_nb))

    def estimate(self, t_ns: int, estimate: AttitudeEstimate) -> None:
        """Adds an estimate."""
        self._compared = None
        self._estimates.add(t_ns, estimate)

    def table(self, skip_s: float = 0.0, estimates: TimedEstimates | None = None) -> ErrorTable:
        """The errors against SIMSTATE, otherwise ATTITUDE.

        Args:
            skip_s: length of the beginning that is not scored.
            estimates: to compare instead of the added ones.
        """
        found = self._compare(estimates or self._estimates, skip_s)
        if not len(found.pairs.rows):
            return ErrorTable("", 0)
        return _table(found)

    def honesty(self) -> dict[str, float | None]:
        """Consistency of the predicted deviations with the simulator's truth; None without it.

        Keys: see `h2nav.maths.attitude_errors.honesty`, of tilt and heading.
        """
        found = self._compare(self._estimates, 0.0)
        is_true = found.pairs.reference == "SIMSTATE"
        sigmas = self._estimates.sigmas_deg(found.pairs.rows)
        count = len(sigmas) if is_true else 0
        return honesty("tilt", found.errors.inclination[:count], sigmas[:count, 0]) | honesty(
            "heading", found.errors.heading[:count], sigmas[:count, 1]
        )

    def _compare(self, estimates: TimedEstimates, skip_s: float) -> _Compared:
        """Estimates with their errors; of our own, all of them, remembered."""
        is_whole = estimates is self._estimates and skip_s == 0.0
        if is_whole and self._compared is not None:
            return self._compared
        pairs = self.pairs(*estimates.times(), skip_s)
        ours, mask = estimates.angles(pairs.rows), np.ones(len(pairs.rows), dtype=bool)
        found = errors(from_euler(ours), from_euler(pairs.angles), mask, True)
        compared = _Compared(pairs, ours, found)
        if is_whole:
            self._compared = compared
        return compared

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


def _table(compared: _Compared) -> ErrorTable:
    (name, rows, truth), ours, found = compared
    columns = (*np.degrees(wrapped(ours - truth)).T, found.inclination, found.total)
    return ErrorTable(name, len(rows), *map(root_mean_square, columns))

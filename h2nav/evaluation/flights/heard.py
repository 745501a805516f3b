"""Records the autopilot's attitudes and the service's estimates during a playback."""

import math
from array import array
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate
from h2nav.integrity.findings import Severity
from h2nav.maths.rows import Array
from h2nav.recordings.reference import ATTITUDE, SIMSTATE, TimedAttitudes
from h2nav.wire import codec
from h2nav.wire.deframer import Frame
from h2nav.wire.vehicle import heartbeat, landed_state

AHRS2 = mavlink.MAVLINK_MSG_ID_AHRS2
HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
EXTENDED_SYS_STATE = mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE
# A clock that steps back by more has restarted; messages may overtake each other by less.
REBOOT_US = 1_000_000


class HeardEstimates(NamedTuple):
    """All estimates of one estimator."""

    arrived_us: NDArray[np.int64]  # (N,) host time of arrival of their inputs
    boot_us: NDArray[np.int64]  # (N,) their autopilot time
    q_nb: Array  # (N, 4) attitudes, body to NED
    sigma_tilt_deg: Array  # (N,) predicted deviation of the tilt
    sigma_heading_deg: Array  # (N,) of the heading; NaN if not predicted


class FromAutopilot:
    """The autopilot's messages in the recording.

    Args:
        system_id: of the vehicle; 0 = that of the first autopilot that is heard.

    Attributes:
        start_us: when the recording began; the times below are on the same clock.
        end_us: when it ended.
        truth: SIMSTATE, by arrival.
        ekf: ATTITUDE of the autopilot, by arrival.
        ekf_boot_us: the times in the same messages.
        ahrs2: AHRS2, by arrival.
        airborne: (arrival, us; armed and not landed), at each change; empty while unknown.
    """

    message_ids = frozenset({SIMSTATE, ATTITUDE, AHRS2, HEARTBEAT, EXTENDED_SYS_STATE})

    def __init__(self, system_id: int = 0) -> None:
        self.start_us = self.end_us = 0
        self.truth = TimedAttitudes()
        self.ekf = TimedAttitudes()
        self.ekf_boot_us = array("q")
        self.ahrs2 = TimedAttitudes()
        self.airborne: list[tuple[int, bool]] = []
        self._system_id = system_id
        self._is_armed: bool | None = None
        self._has_landed = False
        self._newest_boot_us = 0
        self._reboots_us = array("q")

    def time(self, t_ns: int) -> None:
        """Sets the present time."""
        self.end_us = t_ns // 1000
        self.start_us = self.start_us or self.end_us

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Adds a frame of `message_ids`."""
        t_us = t_ns // 1000
        fields: Any = codec.decode(frame)
        if self._system_id not in (0, frame.sysid):
            return
        is_attitude = frame.msg_id in (SIMSTATE, AHRS2, ATTITUDE)
        if is_attitude and not math.isfinite(fields.roll + fields.pitch + fields.yaw):
            return
        if frame.msg_id == SIMSTATE:
            self.truth.add(t_us, fields.roll, fields.pitch, fields.yaw)
        elif frame.msg_id == AHRS2:
            self.ahrs2.add(t_us, fields.roll, fields.pitch, fields.yaw)
        elif frame.compid == mavlink.MAV_COMP_ID_AUTOPILOT1:
            if frame.msg_id == ATTITUDE:
                boot_us = fields.time_boot_ms * 1000
                self.boot_time(t_us, boot_us)
                self.ekf.add(t_us, fields.roll, fields.pitch, fields.yaw)
                self.ekf_boot_us.append(boot_us)
            else:
                self._vehicle_state(t_us, frame, fields)

    def boot_time(self, t_us: int, boot_us: int) -> None:
        """Adds a time stamp of the autopilot."""
        if boot_us < self._newest_boot_us - REBOOT_US:
            self._reboots_us.append(t_us)
            self._newest_boot_us = boot_us
        self._newest_boot_us = max(self._newest_boot_us, boot_us)

    def epochs(self, arrived_us: NDArray[np.int64]) -> NDArray[np.int64]:
        """How often the autopilot's clock had restarted at each time."""
        return np.searchsorted(np.array(self._reboots_us), arrived_us, side="right")

    def boot_offset_us(self) -> int | None:
        """Time of arrival minus the autopilot's time, before its first restart."""
        arrived_us, _ = self.ekf.arrays()
        is_first = self.epochs(arrived_us) == 0
        if not is_first.any():
            return None
        return int(np.median((arrived_us - np.array(self.ekf_boot_us))[is_first]))

    def _vehicle_state(self, t_us: int, frame: Frame, fields: Any) -> None:
        if frame.msg_id == HEARTBEAT:
            beat = heartbeat(fields)
            if beat.is_of_autopilot:
                self._is_armed, self._system_id = beat.is_armed, frame.sysid
        else:
            self._has_landed = landed_state(fields).on_ground is True
        if self._is_armed is None:
            return
        is_airborne = self._is_armed and not self._has_landed
        if not self.airborne or self.airborne[-1][1] != is_airborne:
            self.airborne.append((t_us, is_airborne))


class FromService:
    """The output of one run of the service; a watcher of its pipeline.

    Args:
        autopilot: receives the autopilot's messages.
        listens: this run passes frames on, as one of several must.
    """

    def __init__(self, autopilot: FromAutopilot, *, listens: bool) -> None:
        self.message_ids = autopilot.message_ids if listens else frozenset[int]()
        self._tells_time = listens  # several runs are up to a timer apart
        self.notices: list[tuple[int, Severity, str]] = []  # time of arrival (us), severity, text
        # how long each state of the service lasted; empty until the end
        self.state_s: dict[str, float] = {}
        self._autopilot = autopilot
        self._arrived_us = array("q")
        self._boot_us = array("q")
        self._rows = array("d")

    def end(self, state_s: dict[str, float]) -> None:
        """Takes how long each state lasted."""
        self.state_s = state_s

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Passes a frame on."""
        self._autopilot.frame(t_ns, frame)

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """Stores an estimate."""
        self._arrived_us.append(t_ns // 1000)
        self._boot_us.append(estimate.t_us)
        if self._tells_time:
            self._autopilot.boot_time(t_ns // 1000, estimate.t_us)
        sigmas = (estimate.sigma_tilt_rad, estimate.sigma_heading_rad)
        self._rows.extend((*estimate.q_nb, *map(math.degrees, sigmas)))

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """Stores a notice."""
        self.notices.append((t_ns // 1000, severity, text))

    def estimates(self) -> HeardEstimates:
        """All so far."""
        rows = np.array(self._rows).reshape(-1, 6)
        return HeardEstimates(
            np.array(self._arrived_us, dtype=np.int64),
            np.array(self._boot_us, dtype=np.int64),
            rows[:, :4],
            rows[:, 4],
            rows[:, 5],
        )


class HeardFlight(NamedTuple):
    """Everything recorded of a flight."""

    autopilot: FromAutopilot  # its messages
    runs: dict[str, FromService]  # name of an estimator of h2nav -> its run

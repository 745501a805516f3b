"""The state of the service with its reason; it determines the heartbeat's status."""

from collections.abc import Callable
from enum import Enum
from typing import NamedTuple


class ServiceState(Enum):
    """Ordered from worst to best; the value is its name in logs."""

    NO_LINK = "no_link"
    NO_AUTOPILOT = "no_autopilot"
    NO_IMU = "no_imu"
    ALIGNING = "aligning"
    DEGRADED = "degraded"
    ACTIVE = "active"


# An older estimate does not count.
SILENT_IMU_NS = 500_000_000
LOW_RATE_SHARE = 0.5
LINK_DOWN = "link is down"
NOT_HEARD = "heartbeat"


class Objection(NamedTuple):
    """A fault that affects the state."""

    cause: str  # identifies it while figures in the text change
    text: str  # for people


class Signs(NamedTuple):
    """The inputs of `judge`."""

    link_error: str | None  # why no bytes can arrive; None while they can
    # length of our own stall just now, during which silence says nothing about others; 0
    # without one
    stall_ns: int
    bytes_are_junk: bool  # bytes arrive without MAVLink frames
    autopilot_known: bool  # an autopilot is bound, and its heartbeats arrive
    last_sample_ns: int | None  # host time of the last sample used; None before the first
    last_gap_ns: int | None  # time between the last two samples used; None before the second
    no_imu: Callable[[], Objection]  # why there may be no samples
    has_estimate: bool  # the filter has aligned
    late_ns: int  # lasting lateness of the estimates; 0 without
    objections: tuple[Objection, ...]  # lasting ones, such as wrong units
    rate_hz: float | None  # measured rate of the IMU message in use; None until measured
    granted_rate_hz: float | None  # the rate negotiated with the autopilot; None without


class StateVerdict(NamedTuple):
    """A state with its reason."""

    state: ServiceState  # of the service
    cause: str = ""  # of the state; a change is reported. Empty when active.
    reason: str = ""  # for people; its figures may change while the cause stays

    @property
    def text(self) -> str:
        """Such as ``degraded: late by 3.2 s``."""
        return f"{self.state.value}: {self.reason}" if self.reason else self.state.value


AT_START = StateVerdict(ServiceState.NO_LINK, LINK_DOWN, LINK_DOWN)


def judge(signs: Signs, t_ns: int) -> StateVerdict:
    """Returns the state at `t_ns`."""
    if signs.link_error is not None:
        reason = signs.link_error or LINK_DOWN
        return StateVerdict(ServiceState.NO_LINK, reason, reason)
    if signs.stall_ns:
        return StateVerdict(
            ServiceState.DEGRADED, "late", _late(max(signs.stall_ns, signs.late_ns))
        )
    if not signs.autopilot_known and signs.bytes_are_junk:
        return StateVerdict(
            ServiceState.NO_AUTOPILOT, "junk", "bytes, no MAVLink: wrong baud rate?"
        )
    if not signs.autopilot_known:
        return StateVerdict(ServiceState.NO_AUTOPILOT, NOT_HEARD, "no autopilot heartbeat")
    if signs.last_sample_ns is None or t_ns - signs.last_sample_ns > SILENT_IMU_NS:
        return StateVerdict(ServiceState.NO_IMU, *signs.no_imu())
    if signs.last_gap_ns is not None and signs.last_gap_ns > SILENT_IMU_NS:
        # One sample does not end a silence: a stream of 1 Hz would toggle the state.
        return StateVerdict(ServiceState.NO_IMU, *signs.no_imu())
    if not signs.has_estimate:
        return StateVerdict(ServiceState.ALIGNING, "alignment", "finding the first attitude")
    objections = list(signs.objections)
    if signs.late_ns:
        objections.insert(0, Objection("late", _late(signs.late_ns)))
    rate_hz, granted_hz = signs.rate_hz, signs.granted_rate_hz
    if rate_hz is not None and granted_hz is not None and rate_hz < LOW_RATE_SHARE * granted_hz:
        objections.append(Objection("rate", f"IMU rate {rate_hz:.0f} of {granted_hz:.0f} Hz"))
    if not objections:
        return StateVerdict(ServiceState.ACTIVE)
    causes, texts = zip(*objections, strict=True)
    return StateVerdict(ServiceState.DEGRADED, "; ".join(causes), "; ".join(texts))


def _late(late_ns: int) -> str:
    return f"late by {late_ns * 1e-9:.1f} s"

"""The text of the daemon's live panel."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from h2nav.attitude.samples import Quat
from h2nav.maths import quaternion
from h2nav.service.records import EstimateRecord, HealthRecord, StatusRecord

if TYPE_CHECKING:  # a daemon may write no log
    from h2nav.log.recorder import RecorderRecord

MAX_ALARMS = 4
NOTHING = "-"
ANGLES = "{:>9} {:>8} {:>8}"
BACKED = {"h2nav": "h2nav", "autopilot": "the autopilot"}


class LogSight(NamedTuple):
    """State of the recording."""

    path: Path | None  # of the current file; None before the first
    trouble: str | None  # why recording is stopped; None while it works
    counters: "RecorderRecord"  # of the recorder


class Sight(NamedTuple):
    """Everything displayed at one time."""

    health: HealthRecord  # state and counts
    status: StatusRecord  # comparison and alarms
    log: LogSight | None  # None without one


def panel_lines(sight: Sight, ours: EstimateRecord | None) -> list[str]:
    """The lines of the panel, with the most important at the left, for narrow terminals.

    Args:
        ours: the newest estimate; None if it is stale.
    """
    health, status, log = sight
    return [
        _state(health, status),
        _source(health, status),
        f"{'':10}{ANGLES.format('roll', 'pitch', 'yaw')}  deg",
        _our_attitude(ours),
        _their_attitude(status),
        _difference(status),
        _ratios(status),
        _log(log),
        *_alarms(status.alarms.splitlines()),
    ]


def autopilot_attitude(status: StatusRecord) -> Quat | None:
    """The autopilot's own attitude, body to NED; None if it is stale."""
    w, x, y, z = (
        status.autopilot_q_w,
        status.autopilot_q_x,
        status.autopilot_q_y,
        status.autopilot_q_z,
    )
    return None if w is None or x is None or y is None or z is None else (w, x, y, z)


def euler_deg(q_nb: Quat) -> tuple[float, float, float]:
    """Roll, pitch and yaw."""
    roll, pitch, yaw = quaternion.to_euler(q_nb)
    return math.degrees(roll), math.degrees(pitch), math.degrees(yaw)


def _state(health: HealthRecord, status: StatusRecord) -> str:
    state = f"{health.state}: {health.reason}" if health.reason else health.state
    armed = ", armed" if health.armed else ""
    return f"{state:30}  {status.vehicle}{armed}" if status.vehicle else state


def _source(health: HealthRecord, status: StatusRecord) -> str:
    parts = [health.imu_message or "no IMU"]
    if health.imu_rate_hz:  # 0 = not measured yet
        parts.append(f"{health.imu_rate_hz:.0f} Hz")
    if status.age_ms is not None:
        parts.append(f"age {status.age_ms:.0f} ms")
    parts.append(f"used {health.samples_used}  refused {health.samples_rejected}")
    return "  ".join(parts)


def _our_attitude(ours: EstimateRecord | None) -> str:
    if ours is None:
        return f"{'h2nav':10}{ANGLES.format(*[NOTHING] * 3)}"
    tilt, heading = _size(ours.sigma_tilt_deg), _size(ours.sigma_heading_deg)
    angles = _angles(ours.roll_deg, ours.pitch_deg, ours.yaw_deg)
    return f"{'h2nav':10}{angles}  sigma: tilt {tilt}, heading {heading}"


def _their_attitude(status: StatusRecord) -> str:
    q_nb = autopilot_attitude(status)
    if q_nb is None:
        return f"{'autopilot':10}{ANGLES.format(*[NOTHING] * 3)}"
    second = "  its second estimator, AHRS2" if status.autopilot_source == "AHRS2" else ""
    return f"{'autopilot':10}{_angles(*euler_deg(q_nb))}{second}"


def _difference(status: StatusRecord) -> str:
    if status.tilt_deg is None or status.heading_deg is None:
        return f"{'difference':10} nothing to compare at present"
    tilt = f"tilt {_in_sigmas(status.tilt_deg, status.sigma_tilt_deg)}"
    heading = f"heading {_in_sigmas(status.heading_deg, status.sigma_heading_deg)}"
    backed = "".join(
        f"; GPS backs {BACKED[verdict]} in {part}"
        for part, verdict in (("tilt", status.tilt_verdict), ("heading", status.heading_verdict))
        if verdict in BACKED
    )
    return f"{'difference':10} {tilt}, {heading}{backed}"


def _ratios(status: StatusRecord) -> str:
    """The test ratios of the measurements; a lost receiver has no velocity."""
    ratios = {
        "velocity": status.velocity_ratio,
        "force": status.force_ratio,
        "field": status.field_ratio,
        "turn": status.turn_ratio,
    }
    shown = "  ".join(f"{name} {_size(ratio)}" for name, ratio in ratios.items())
    return f"{'tests':10} {shown}  (1 = fails)"


def _in_sigmas(difference_deg: float, sigma_deg: float | None) -> str:
    """A difference, also in multiples of its deviation."""
    text = f"{difference_deg:.1f} deg"
    if sigma_deg is None or not sigma_deg > 0.0:
        return text
    return f"{text} ({abs(difference_deg) / sigma_deg:.1f} sigma)"


def _log(log: LogSight | None) -> str:
    if log is None:
        return f"{'log':10} none"
    if log.trouble is not None:
        return f"{'log':10} NOT RECORDING: {log.trouble}"
    counters = log.counters
    lost = counters.dropped_queue_full + counters.lost_disk + counters.rejected
    said = f", {lost} messages LOST" if lost else ""
    path = f"  {log.path.name} in {log.path.parent}" if log.path is not None else ""
    return f"{'log':10} {counters.file_bytes / 1e6:.1f} MB{said}{path}"


def _alarms(alarms: list[str]) -> list[str]:
    lines = [f"! {alarm}" for alarm in alarms[:MAX_ALARMS]]
    if len(alarms) > MAX_ALARMS:
        lines[-1] = f"! and {len(alarms) - MAX_ALARMS + 1} more"
    return lines


def _angles(roll_deg: float, pitch_deg: float, yaw_deg: float) -> str:
    return ANGLES.format(f"{roll_deg:+.2f}", f"{pitch_deg:+.2f}", f"{yaw_deg:+.2f}")


def _size(value: float) -> str:
    return NOTHING if math.isnan(value) else f"{value:.2f}"

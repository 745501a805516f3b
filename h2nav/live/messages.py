"""Messages for the page: attitudes ten times a second, the overview twice; texts when new.

Keys carry their units; unknown values are null. Ages are in s.
"""

import math
from typing import Any

from h2nav import __version__
from h2nav.attitude.samples import Trust
from h2nav.live.state import LiveState, Seen
from h2nav.maths import quaternion
from h2nav.service.records import finding_mapping

# Not every sample corrects every state; a recent correction still counts.
HELD_WITHIN_S = 2.0
HOLDING = {
    Trust.FORCE_USED: "gravity",
    Trust.FIELD_USED: "compass",
    Trust.VELOCITY_USED: "velocity",
    Trust.REST: "rest",
}
COUNTED = (
    ("/health", ("samples_used", "samples_rejected", "estimates_sent")),
    ("/link", ("bytes_in", "bytes_out")),
    ("/recorder", ("written",)),
    ("/feed", ("cpu_s",)),
)


def attitudes(state: LiveState) -> dict[str, Any]:
    """Both attitudes and their difference."""
    seen = state.newest("/status")
    return {
        "silent_s": state.silent_s,
        "h2nav": _ours(state),
        "autopilot": None if seen is None else _autopilots(state, seen),
        "difference": None if seen is None else _difference(seen.record),
    }


def overview(state: LiveState) -> dict[str, Any]:
    """State, alarms, test ratios and counters."""
    return {
        "version": __version__,
        "status": _record(state.newest("/status")),
        "health": _record(state.newest("/health")),
        "alarms": state.alarms,
        "preflight": state.preflight,
        "holding": _holding(state),
        "velocity": _velocity(state),
        "lanes": [_record(seen) for seen in state.all_of("/lanes")],
        "refused": [_record(seen) for seen in state.all_of("/rejected")],
        "link": _record(state.newest("/link")),
        "recorder": _record(state.newest("/recorder")),
        "daemon": _record(state.newest("/feed")),
        "per_s": {name: state.per_s(topic, name) for topic, names in COUNTED for name in names},
    }


def reports(state: LiveState) -> dict[str, Any]:
    """Findings and lines of the program, newest first."""
    findings = [
        {
            **finding_mapping(reports.finding),
            "age_s": state.age_s(reports.began_ns),
        }
        for reports in reversed(state.findings)
    ]
    lines = [
        {"level": line.severity.word, "text": line.text, "age_s": state.age_s(line.heard_ns)}
        for line in reversed(state.texts)
    ]
    return {"findings": findings, "lines": lines}


def _ours(state: LiveState) -> dict[str, Any] | None:
    seen = state.newest("/estimate")
    if seen is None:
        return None
    ours = seen.record
    return {
        "roll_deg": ours.roll_deg,
        "pitch_deg": ours.pitch_deg,
        "heading_deg": ours.yaw_deg % 360.0,
        "sigma_tilt_deg": ours.sigma_tilt_deg,
        "sigma_heading_deg": ours.sigma_heading_deg,
        "has_north": bool(ours.trust & Trust.YAW_REFERENCED),
        "age_s": state.age_s(seen.heard_ns),
    }


def _autopilots(state: LiveState, seen: Seen) -> dict[str, Any] | None:
    """The autopilot's attitude, propagated to the time of ours where possible."""
    status = seen.record
    if status.autopilot_q_w is None:
        return None
    q_nb = (
        status.autopilot_q_w,
        status.autopilot_q_x,
        status.autopilot_q_y,
        status.autopilot_q_z,
    )
    sent_ns = seen.heard_ns - round(status.autopilot_age_ms * 1e6)
    q_nb = state.track.carried(sent_ns, q_nb) or q_nb
    roll_deg, pitch_deg, yaw_deg = map(math.degrees, quaternion.to_euler(q_nb))
    return {
        "source": status.autopilot_source,
        "roll_deg": roll_deg,
        "pitch_deg": pitch_deg,
        "heading_deg": yaw_deg % 360.0,
        "age_s": status.autopilot_age_ms * 1e-3 + state.age_s(seen.heard_ns),
    }


def _difference(status: Any) -> dict[str, Any] | None:
    if status.tilt_deg is None:
        return None
    return {
        name: getattr(status, name)
        for name in (
            "tilt_deg",
            "heading_deg",
            "sigma_tilt_deg",
            "sigma_heading_deg",
            "tilt_verdict",
            "heading_verdict",
        )
    }


def _velocity(state: LiveState) -> dict[str, Any] | None:
    """The last velocity that aided the filter, and its source."""
    seen = state.newest("/aiding", "velocity")
    if seen is None:
        return None
    source = "GPS receiver" if seen.record.independent else "autopilot"
    return {"source": source, "age_s": state.age_s(seen.heard_ns)}


def _record(seen: Seen | None) -> dict[str, Any] | None:
    return None if seen is None else dict(seen.record._asdict())


def _holding(state: LiveState) -> list[str]:
    ages = state.trusted_s()
    return [name for flag, name in HOLDING.items() if ages.get(flag, math.inf) < HELD_WITHIN_S]

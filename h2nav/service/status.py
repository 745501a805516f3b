"""The status for displays: one flat record of the service's state."""

import math

from h2nav.service.comparing import LatestReport
from h2nav.service.health import StateVerdict
from h2nav.service.outputs import Assessment
from h2nav.service.records import StatusRecord

NS_PER_MS = 1e6


def status_record(
    t_ns: int,
    verdict: StateVerdict,
    vehicle: str,
    sample_ns: int | None,
    reported: LatestReport | None,
    assessment: Assessment,
) -> StatusRecord:
    """The record of a moment.

    Args:
        vehicle: bound autopilot, for people.
        sample_ns: host time of the newest sample used; None before the first.
        reported: the autopilot's own attitude; None if stale.
    """
    difference, ratios = assessment.difference, assessment.ratios
    w, x, y, z = (None, None, None, None) if reported is None else reported.q_nb
    return StatusRecord(
        verdict.state.value,
        verdict.reason,
        vehicle,
        None if sample_ns is None else _age_ms(t_ns, sample_ns),
        w,
        x,
        y,
        z,
        "" if reported is None else reported.source.value,
        None if reported is None else _age_ms(t_ns, reported.t_ns),
        difference and math.degrees(difference.tilt_rad),
        difference and math.degrees(difference.heading_rad),
        difference and math.degrees(difference.sigma_tilt_rad),
        difference and math.degrees(difference.sigma_heading_rad),
        "" if difference is None else difference.verdicts.tilt.value,
        "" if difference is None else difference.verdicts.heading.value,
        ratios.of_velocity,
        ratios.force_10s,
        ratios.of_field,
        ratios.of_turn,
        "\n".join(alarm.notice for alarm in assessment.alarms),
        preflight="\n".join(fault.text for fault in assessment.on_ground.faults),
    )


def _age_ms(t_ns: int, then_ns: int) -> float:
    """Age of an event; 0 for one after the beginning of the turn."""
    return max(t_ns - then_ns, 0) / NS_PER_MS

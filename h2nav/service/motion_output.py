"""Sends motion estimates as ODOMETRY, logs them, and reports interruptions."""

import math

from h2nav.integrity.findings import Severity
from h2nav.service.autopilot import Autopilot
from h2nav.service.effects import Effect, Record, Send
from h2nav.service.motion_records import odometry_line
from h2nav.service.notices import Report
from h2nav.service.outputs import Outputs, SentMotion

# An estimate from an older measurement is not sent.
STALE_S = 2.0
# A lasting lack of estimates is reported.
LASTING_NS = 500_000_000
# This many consecutive rejections are reported, once.
REFUSED_IN_A_ROW = 10


class RefusalStreak:
    """Reports once when all messages are rejected.

    Args:
        what: is rejected, such as ``poses``.
    """

    def __init__(self, what: str, report: Report) -> None:
        self._what = what
        self._report = report
        self._in_a_row = 0

    def good(self) -> None:
        """Notes a message that was used."""
        self._in_a_row = 0

    def refused(self, t_ns: int, reason: str) -> list[Effect]:
        """Notes a rejected message."""
        self._in_a_row += 1
        if self._in_a_row != REFUSED_IN_A_ROW:
            return []
        text = f"{self._what} refused: {reason}"
        return self._report(t_ns, Severity.WARNING, text)


class OdometryOut:
    """Sends and logs motion estimates; detects resets and silence.

    Attributes:
        refusals: of the measurements.

    Args:
        autopilot: whose system id is used.
        source: of the estimates, such as ``poses``.
    """

    def __init__(self, autopilot: Autopilot, outputs: Outputs, source: str, report: Report) -> None:
        self._autopilot = autopilot
        self._outputs = outputs
        self._source = source
        self._report = report
        self._reset_counter = 0
        self._is_fresh = False
        self._put_ns = 0
        self.refusals = RefusalStreak(source, report)

    def put(self, t_ns: int, motion: SentMotion) -> list[Effect]:
        """Takes a fresh, finite estimate: sends and logs it if it is due."""
        effects: list[Effect] = []
        self._put_ns = t_ns
        identity = self._autopilot.identity
        messages = self._outputs.due_odometry(motion)
        if messages and identity is not None:
            if not self._outputs.are_held:
                effects += [Send(message, identity.system_id) for message in messages]
            line = odometry_line(motion.record, motion.quality)
            effects.append(Record("/odometry", line, motion.t_us))
        resets = motion.record.reset_counter
        if resets != self._reset_counter:
            self._reset_counter = resets
            effects += self._report(
                t_ns, Severity.NOTICE, f"odometry reset, number {resets}", "odometry"
            )
        if not self._is_fresh:
            self._is_fresh = True
            effects += self._report(t_ns, Severity.INFO, f"odometry from {self._source}")
        return effects

    def nothing(self, t_ns: int) -> list[Effect]:
        """Notes that there is no fresh estimate; the last one must not be sent again."""
        self._outputs.forget_odometry()
        if not self._is_fresh or t_ns - self._put_ns <= LASTING_NS:
            return []
        self._is_fresh = False
        text = f"no ODOMETRY: no {self._source}"
        return self._report(t_ns, Severity.WARNING, text)


def is_finite(motion: SentMotion) -> bool:
    """Whether every number of an estimate is finite."""
    record = motion.record
    values = (
        *record.q,
        *record.p_m,
        *record.v_b_m_s,
        *record.w_b_rad_s,
        *record.pose_covariance,
        *record.velocity_covariance,
    )
    return all(map(math.isfinite, values))

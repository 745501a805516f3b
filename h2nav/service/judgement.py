"""Reports faults: findings, notices, objections.

Findings depend on messages and their times alone, so a replay finds the same.
"""

from collections.abc import Iterable
from typing import Protocol

from h2nav.integrity.findings import Alarm, Finding, Findings, Severity
from h2nav.maths.units import SECOND_NS
from h2nav.service.effects import Effect, Found
from h2nav.service.health import Objection
from h2nav.service.notices import Report

PERIOD_NS = SECOND_NS // 5
# After a pause of this length, earlier alarms no longer hold.
QUIET_NS = 2 * SECOND_NS
AGAIN_NS = SECOND_NS


class Judged(Protocol):
    """A source of alarms."""

    def alarms(self) -> Iterable[Alarm]:
        """The present alarms."""


class Judgement:
    """Collects alarms a few times a second, and reports changes.

    Args:
        judged: the sources; each kind and source comes from one of them only.

    Attributes:
        objections: faults that make the attitude that is sent untrustworthy.
    """

    def __init__(self, report: Report, *judged: Judged) -> None:
        self._report = report
        self._judged = judged
        self._findings = Findings()
        self._start_ns: int | None = None
        self._looked_ns = 0
        self.objections: tuple[Objection, ...] = ()
        self.due_ns = 0  # nothing is reported before this time, except at once
        self._again_ns = 0
        self._untold: set[tuple[str, Severity]] = set()  # alarms that have not been told yet

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings so far."""
        return self._findings.all

    @property
    def open(self) -> tuple[Finding, ...]:
        """The open findings."""
        return self._findings.open

    @property
    def alarms(self) -> tuple[Alarm, ...]:
        """The present alarms."""
        return self._findings.alarms

    def look(self, t_ns: int, *, at_once: bool = False) -> list[Effect]:
        """Called at a message; reports changes since the last call.

        Args:
            at_once: the message has shown that a sensor is faulty, which does not wait.
        """
        if self._start_ns is None:
            self._start_ns = t_ns
        if not at_once and t_ns - self._looked_ns < PERIOD_NS:
            self.due_ns = self._looked_ns + PERIOD_NS
            return []
        if 0 < self._looked_ns < t_ns - QUIET_NS:
            # An alarm before a pause is not known to hold after it.
            self._again_ns = t_ns + AGAIN_NS
        self._looked_ns, self.due_ns = t_ns, t_ns + PERIOD_NS
        alarms = [alarm for one in self._judged for alarm in one.alarms()]
        if t_ns < self._again_ns:
            alarms = []
        begun, news, worse = self._findings.update((t_ns - self._start_ns) * 1e-9, alarms)
        wrong = (alarm for alarm in self._findings.alarms if alarm.degrades)
        self.objections = tuple(Objection(alarm.cause, alarm.notice) for alarm in wrong)
        effects: list[Effect] = [Found(phase, finding) for phase, finding in news]
        return effects + self._tell(t_ns, (*begun, *worse))

    def _tell(self, t_ns: int, news: Iterable[Alarm]) -> list[Effect]:
        """Reports alarms in words, one of a kind a minute: what has to wait is told if it lasts.

        A sensor that fails is told at once, whatever others did.
        """
        self._untold |= {(alarm.cause, alarm.severity) for alarm in news}
        untold, self._untold = self._untold, set()
        effects: list[Effect] = []
        for alarm in self._findings.alarms:
            key = alarm.cause, alarm.severity
            if key not in untold or alarm.degrades:  # the state reports those that do
                continue
            subject = alarm.cause if alarm.severity <= Severity.ERROR else str(alarm.kind)
            told = self._report(t_ns, alarm.severity, alarm.notice, subject)
            effects += told
            if not told:
                self._untold.add(key)
        return effects

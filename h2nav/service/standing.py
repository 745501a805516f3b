"""The present state of the service, and the reports of its changes."""

from h2nav.integrity.findings import Severity
from h2nav.service import health
from h2nav.service.effects import Effect
from h2nav.service.health import NOT_HEARD, ServiceState, Signs, StateVerdict
from h2nav.service.notices import Notices

GOOD = (ServiceState.ACTIVE, ServiceState.ALIGNING)


class Standing:
    """Judges the state, and reports each change of it or of its cause once.

    A change that reverses within a minute is reported only if it lasts; but an all-clear follows
    each complaint at once.

    Attributes:
        verdict: the present state.
        is_active: it is active.
        lasted_ns: how long each state has lasted so far, by its name.
    """

    def __init__(self, notices: Notices) -> None:
        self._notices = notices
        self._reported = health.AT_START[:2]
        self.verdict: StateVerdict = health.AT_START
        self.is_active = False
        self.lasted_ns: dict[str, int] = {}
        self._has_heard = False  # an autopilot, since the start
        self._judged_ns: int | None = None

    @property
    def complaint(self) -> list[tuple[Severity, str]]:
        """The state as reported; nothing if there is nothing to complain about."""
        return [] if self.verdict.state in GOOD else [(Severity.WARNING, self.verdict.text)]

    def judge(self, t_ns: int, signs: Signs) -> bool:
        """Judges the state; returns True if it, or its cause, has changed."""
        before, self.verdict = self.verdict, health.judge(signs, t_ns)
        self.is_active = self.verdict.state is ServiceState.ACTIVE
        lasted_ns = 0 if self._judged_ns is None else max(t_ns - self._judged_ns, 0)
        name = before.state.value
        self.lasted_ns[name] = self.lasted_ns.get(name, 0) + lasted_ns
        self._judged_ns = t_ns
        return self.verdict[:2] != before[:2]

    def report(self, t_ns: int, *, is_starting: bool) -> list[Effect]:
        """Reports what has not been reported yet.

        Args:
            is_starting: a lack of samples is not worth a report yet.
        """
        verdict = self.verdict
        if verdict[:2] == self._reported or (is_starting and verdict.state is ServiceState.NO_IMU):
            return []
        change = f"{self._reported} -> {verdict[:2]}"
        if self.is_active:
            self._notices.forget(change)
        if not self._notices.may_report(t_ns, change):
            return []
        self._has_heard |= verdict.state not in (ServiceState.NO_LINK, ServiceState.NO_AUTOPILOT)
        # At a start the autopilot has not been heard yet.
        is_first = verdict.cause == NOT_HEARD and not self._has_heard
        severity = Severity.INFO if verdict.state in GOOD or is_first else Severity.WARNING
        reported = self._notices.report(t_ns, severity, verdict.text, change)
        if reported:
            self._reported = verdict[:2]
        return reported

"""From received bytes to carried-out effects: the same for the daemon and for a replay."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from h2nav.io import codec
from h2nav.io.deframer import Deframer, Frame
from h2nav.io.foxglove_messages import LogLevel
from h2nav.io.link_statistics import LinkStatistics
from h2nav.io.recorder import Recorder
from h2nav.service.effects import Effect, Notice, Record, Send, Severity, Used
from h2nav.service.records import EstimateRecord, estimate_record, imu_record
from h2nav.service.service import Service

LINK_NAME = "autopilot"
LOG_LEVELS = {
    Severity.CRITICAL: LogLevel.FATAL,
    Severity.ERROR: LogLevel.ERROR,
    Severity.WARNING: LogLevel.WARNING,
    Severity.NOTICE: LogLevel.INFO,
    Severity.INFO: LogLevel.INFO,
}
RECORDER_SEVERITIES = {
    LogLevel.ERROR: Severity.ERROR,
    LogLevel.WARNING: Severity.WARNING,
    LogLevel.INFO: Severity.NOTICE,
}


class Watcher(Protocol):
    """Somebody who looks on: the status line, the error table of a replay.

    Attributes:
        message_ids: the messages that it wants to see.
    """

    message_ids: frozenset[int]

    def frame(self, t_ns: int, frame: Frame) -> None:
        """A good frame of `message_ids` came."""

    def estimate(self, t_ns: int, record: EstimateRecord) -> None:
        """An estimate was made."""

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """The service has something to tell."""


class Outlets(NamedTuple):
    """Where the effects go.

    Attributes:
        unix_ns: host monotonic time to host UNIX time by one constant for a whole run, so that a
            log's times give back the monotonic ones exactly.
        send: puts a frame on the link; None where nobody listens (replay).
        recorder: the log; None without one.
        watcher: who looks on.
    """

    unix_ns: Callable[[int], int]
    send: Callable[[bytes], object] | None
    recorder: Recorder | None
    watcher: Watcher


class Pipeline:
    """Deframes, decodes, asks the service, and carries out what it wants.

    Args:
        service: the behaviour.
        component_id: ours, for outgoing frames.
        outlets: where the effects go.
    """

    def __init__(self, service: Service, component_id: int, outlets: Outlets) -> None:
        self.service = service
        self.deframer = Deframer()
        self._component_id = component_id
        self._system_id = service.system_id
        self._encoder = codec.Encoder(self._system_id, component_id)
        self._unix_ns, self._send, self._recorder, self._watcher = outlets
        self._message_ids = service.message_ids
        self._watched_ids = self._watcher.message_ids
        self._timer_ns = 0

    @property
    def next_timer_ns(self) -> int:
        """When `tick` has something to do."""
        return self._timer_ns

    def received(self, t_ns: int, data: bytes) -> None:
        """Takes one datagram or chunk as it came from the link."""
        if self._recorder is not None:
            self._recorder.raw(LINK_NAME, self._unix_ns(t_ns), data)
        for frame in self.deframer.feed(data):
            if frame.msg_id in self._watched_ids:
                self._watcher.frame(t_ns, frame)
            if frame.msg_id in self._message_ids:
                sender = (frame.sysid, frame.compid)
                fields = codec.decode(frame)
                self._carry_out(t_ns, self.service.on_message(t_ns, sender, frame.msg_id, fields))

    def tick(self, t_ns: int) -> None:
        """Runs what is due by the clock, if anything is."""
        if t_ns >= self._timer_ns:
            self._carry_out(t_ns, self.service.on_timer(t_ns))
            self._timer_ns = self.service.next_timer_ns(t_ns)

    def link(self, t_ns: int, is_up: bool) -> None:
        """Tells the service that the link is up or down."""
        self._carry_out(t_ns, self.service.on_link(t_ns, is_up))

    def report(self, t_ns: int, link: LinkStatistics) -> None:
        """Writes the counters of link and log to the log, and tells of trouble with the log."""
        if self._recorder is None:
            return
        unix_ns = self._unix_ns(t_ns)
        self._recorder.record("/link", link, unix_ns)
        self._recorder.record("/deframer", self.deframer.counters, unix_ns)
        self._recorder.record("/recorder", self._recorder.statistics(), unix_ns)
        for notice in self._recorder.notices():
            self.note(t_ns, notice.text, RECORDER_SEVERITIES[notice.level])

    def note(self, t_ns: int, text: str, severity: Severity = Severity.NOTICE) -> None:
        """Tells people something that the service does not know of."""
        self._carry_out(t_ns, [Notice(severity, text)])

    def _carry_out(self, t_ns: int, effects: list[Effect]) -> None:
        for effect in effects:
            if isinstance(effect, Used):
                self._log_used(t_ns, effect)
            elif isinstance(effect, Send):
                self._send_message(t_ns, effect)
            elif isinstance(effect, Record):
                self._log(t_ns, effect.topic, effect.record, effect.t_us)
            else:
                self._say(t_ns, effect)

    def _log_used(self, t_ns: int, effect: Used) -> None:
        sample, estimate = effect
        self._log(t_ns, "/imu", imu_record(sample), sample.t_us)
        if estimate is not None:
            record = estimate_record(estimate)
            self._watcher.estimate(t_ns, record)
            self._log(t_ns, "/estimate", record, estimate.t_us)
            if self._recorder is not None:
                self._recorder.transform(self._unix_ns(t_ns), estimate.q_nb)

    def _say(self, t_ns: int, effect: Notice) -> None:
        self._watcher.notice(t_ns, effect.severity, effect.text)
        if self._recorder is not None:
            level = LOG_LEVELS[effect.severity]
            self._recorder.text(self._unix_ns(t_ns), level, effect.text)

    def _log(self, t_ns: int, topic: str, record: Any, t_us: int | None) -> None:
        if self._recorder is not None:
            published_ns = self._publish_ns(t_ns, t_us)
            self._recorder.record(topic, record, self._unix_ns(t_ns), published_ns)

    def _publish_ns(self, t_ns: int, t_us: int | None) -> int | None:
        """The autopilot's time as host UNIX time, once the clocks are related."""
        offset_ns = self.service.time_sync.offset_ns(t_ns)
        if t_us is None or offset_ns is None:
            return None
        return self._unix_ns(t_us * 1000 - offset_ns)

    def _send_message(self, t_ns: int, effect: Send) -> None:
        if self._send is None:
            return
        if effect.system_id != self._system_id:
            self._system_id = effect.system_id
            self._encoder = codec.Encoder(effect.system_id, self._component_id)
        frame = self._encoder.encode(effect.message)
        self._send(frame)
        if self._recorder is not None:
            self._recorder.sent(LINK_NAME, self._unix_ns(t_ns), frame)

"""From received bytes to executed effects: the same for the daemon and for a replay."""

import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.link_signing import LinkSigning
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.integrity.findings import Finding, Phase, Severity
from h2nav.links.link_statistics import LinkStatistics
from h2nav.service.effects import Effect, Found, Notice, Record, Send, Used
from h2nav.service.records import (
    FINDING_TOPIC,
    estimate_record,
    finding_record,
    imu_record,
)
from h2nav.service.service import Service
from h2nav.wire import codec
from h2nav.wire.deframer import Deframer, Frame, PlacedFrame, frame_at
from h2nav.wire.imu import IMU_MESSAGES, ImuReading
from h2nav.wire.key_blanker import KeyBlanker
from h2nav.wire.readers import READERS, Envelope, Message, message_name
from h2nav.wire.refused import Refused
from h2nav.wire.signing import without_signature

if TYPE_CHECKING:  # loaded where there is a live view, or a log is written
    from h2nav.links.live_feed import LiveFeed
    from h2nav.log.recorder import Recorder

LINK_NAME = "autopilot"
# More bytes, for longer than this, without a frame are not a boot text.
JUNK_BYTES = 1024
JUNK_NS = 3_000_000_000
HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
IMU_IDS = READERS.keys() & IMU_MESSAGES.keys()


class PlayedFrames(NamedTuple):
    """Frames of a recording."""

    data: bytes  # the buffer that holds them
    frames: Sequence[PlacedFrame]  # their places and origins
    first: int  # number of the first one for `reading`
    # number of a frame and its IMU message's id -> its reading; None where it has to be read singly
    reading: Callable[[int, int], ImuReading | None]


class Watcher(Protocol):
    """Observes frames and estimates: the status line, the error table of a replay."""

    message_ids: frozenset[int]  # the messages that it observes

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Called with a good frame of `message_ids`."""

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """Called with an estimate, later than usual on this link by `late_ns`."""

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """Called with a notice of the service."""


class Observer(Protocol):
    """Observes more: imported events, and all records of the service."""

    def message(self, t_ns: int, message: Message) -> None:
        """Called with a typed record from an autopilot's own log."""

    def record(self, t_ns: int, topic: str, record: object) -> None:
        """Called with a record of the service other than samples and estimates."""


# Time, UNIX time and service -> notices, and messages to send.
Beside = Callable[[int, int, Service], Sequence[Notice | Send]]


class Outlets(NamedTuple):
    """The destinations of effects."""

    # converts monotonic to UNIX time by one constant per run, so that the monotonic times can
    # be recovered exactly from a log
    unix_ns: Callable[[int], int]
    send: Callable[[bytes], object] | None  # puts a frame on the link; None in a replay
    recorder: "Recorder | None"  # the log; None without one
    watcher: Watcher  # observes frames and estimates
    observer: Observer | None = None  # observes all records; None = not needed
    live: "LiveFeed | None" = None  # the live view's feed; None without one
    # called with each report of a finding; None = not needed
    finding: Callable[[int, Phase, Finding], object] | None = None


def deliver(service: Service, frame: Frame, t_ns: int, now_ns: int) -> list[Effect]:
    """Passes a frame of `Service.message_ids` through the wire boundary; returns effects.

    Args:
        t_ns: host time of its arrival.
        now_ns: host time now.
    """
    sender = frame.sysid, frame.compid
    if not service.on_arrival(t_ns, sender, frame.msg_id):
        return []
    return read(service, Envelope(t_ns, now_ns, sender, frame.msg_id), frame.payload)


def read(service: Service, envelope: Envelope, payload: bytes) -> list[Effect]:
    """Reads a message that the service uses; returns effects."""
    message_id = envelope.message_id
    try:
        message = READERS[message_id](codec.DECODERS[message_id](payload))
    except Refused as refusal:
        return service.on_refusal(envelope, refusal.reason)
    return service.on_message(envelope, message)


class Junk:
    """Detects bytes without frames that last longer than a boot text.

    Attributes:
        is_raised: they are present.
    """

    def __init__(self) -> None:
        self._bytes = 0
        self._since_ns = 0
        self.is_raised = False

    def changes(self, t_ns: int, size: int, *, has_frames: bool) -> bool:
        """Adds a chunk; returns whether it changed `is_raised`."""
        if has_frames:
            self._bytes = 0
            was_raised, self.is_raised = self.is_raised, False
            return was_raised
        if self._bytes == 0:
            self._since_ns = t_ns
        self._bytes += size
        is_new = self._bytes > JUNK_BYTES and t_ns - self._since_ns > JUNK_NS and not self.is_raised
        self.is_raised |= is_new
        return is_new


class Pipeline:
    """Deframes, decodes, calls the service, and carries out its effects.

    An exception on the way is counted and reported by the service; the next frame follows.

    Args:
        signing: verifies and signs; None = frames are neither verified nor signed.
    """

    def __init__(
        self,
        service: Service,
        component_id: int,
        outlets: Outlets,
        signing: LinkSigning | None = None,
    ) -> None:
        self.service = service
        self.deframer = Deframer()
        self._signing = signing
        self._blanker = KeyBlanker()
        self._component_id = component_id
        self._system_id = service.system_id
        self._encoder = self._new_encoder()
        (
            self._unix_ns,
            self._send,
            self._recorder,
            self._watcher,
            self._observer,
            self._live,
            self._finding,
        ) = outlets
        self._writers: tuple[Recorder | LiveFeed, ...] = tuple(
            writer for writer in (self._recorder, self._live) if writer is not None
        )
        self._message_ids = service.message_ids
        self._watched_ids = self._watcher.message_ids
        self._link_state: tuple[bool, str] | None = None
        self._junk = Junk()
        self._timer_ns = 0
        self._now_ns = 0

    @property
    def next_timer_ns(self) -> int:
        """When `tick` is due next."""
        return self._timer_ns

    def received(self, t_ns: int, data: bytes, now_ns: int | None = None) -> None:
        """Processes one datagram or chunk from the link.

        Args:
            t_ns: host time of its arrival.
            now_ns: host time now, if they have been delayed.
        """
        now_ns = t_ns if now_ns is None else now_ns
        frames = self.deframer.feed(data)
        if self._junk.changes(t_ns, len(data), has_frames=bool(frames)):
            self._guarded(t_ns, "bytes", lambda: self.service.on_bytes(t_ns, self._junk.is_raised))
        if self._signing is None:
            self.record_stream(t_ns, data)
            self._process(t_ns, frames, now_ns)
            return
        found = self._signing.sort(t_ns, frames)
        # Only admitted frames: a replay has no key to verify them.
        self._record_received(t_ns, found.received)
        if found.refused and self._recorder is not None:
            self._recorder.refused(LINK_NAME, self._unix_ns(t_ns), found.refused)
        self._carry_out(t_ns, found.notices)
        self._process(t_ns, found.admitted, now_ns)

    @property
    def wanted_ids(self) -> frozenset[int]:
        """The messages that the service or the watcher needs."""
        return self._message_ids | self._watched_ids

    @property
    def records(self) -> bool:
        """Whether a log is written."""
        return self._recorder is not None

    def record_stream(self, t_ns: int, data: bytes) -> None:
        """Writes arrived bytes to the log, without the frames that they complete."""
        if self._recorder is not None:
            self._record_received(t_ns, self._blanker.blanked(data))

    def play(self, played: PlayedFrames, before: Callable[[int], object] | None = None) -> None:
        """Processes frames of `wanted_ids` in a recording, in order.

        The result is that of `received`. Most frames of a recording are not used, and cost little
        more than this check.

        Args:
            played: the frames.
            before: called with the time (ns) of each message before it is read.
        """
        service, is_read, watched = self.service, self.service.on_arrival, self._watched_ids
        used, imu_ids, (data, frames, first, reading_of) = self._message_ids, IMU_IDS, played
        for number, (t_ns, msg_id, sender, at, payload_at, payload_end) in enumerate(frames, first):
            if msg_id in watched:
                self._watcher.frame(t_ns, frame_at(data, at))
            if msg_id not in used:
                continue
            try:
                if not is_read(t_ns, sender, msg_id):
                    continue
                if before is not None:
                    before(t_ns)
                envelope = tuple.__new__(Envelope, (t_ns, t_ns, sender, msg_id))
                reading = reading_of(number, msg_id) if msg_id in imu_ids else None
                if reading is not None:
                    effects = service.on_imu(envelope, reading)
                else:
                    effects = read(service, envelope, data[payload_at:payload_end])
                if effects:
                    self._carry_out(t_ns, effects)
            except Exception as error:
                self._fault(t_ns, message_name(msg_id), error)

    def imported(self, envelope: Envelope, message: Message) -> None:
        """Processes an event of an autopilot's own log, after what is due by the clock."""
        t_ns = envelope.t_ns
        if t_ns >= self._timer_ns:
            self.tick(t_ns)
        if self._observer is not None:
            self._observer.message(t_ns, message)
        try:
            if self.service.on_arrival(t_ns, envelope.sender, envelope.message_id):
                self._carry_out(t_ns, self.service.on_message(envelope, message))
        except Exception as error:
            self._fault(t_ns, message_name(envelope.message_id), error)

    def _record_received(self, t_ns: int, data: bytes) -> None:
        if data and self._recorder is not None:
            self._recorder.raw(LINK_NAME, self._unix_ns(t_ns), data)

    def _process(self, t_ns: int, frames: list[Frame], now_ns: int) -> None:
        for frame in frames:
            if frame.msg_id in self._watched_ids:
                try:
                    self._watcher.frame(t_ns, frame)
                except Exception as error:
                    self._fault(t_ns, message_name(frame.msg_id), error)
            if frame.msg_id in self._message_ids:
                try:
                    self._carry_out(t_ns, deliver(self.service, frame, t_ns, now_ns))
                except Exception as error:
                    self._fault(t_ns, message_name(frame.msg_id), error)

    def comes_from_vehicle(self, data: bytes) -> bool:
        """Whether a datagram of an unknown sender has a frame of the bound or a new autopilot."""
        t_ns = self._now_ns
        for frame in Deframer().feed(data):
            if self._signing is not None and not self._signing.would_answer(frame):
                self._carry_out(t_ns, self._signing.turned_away(t_ns, frame))
                continue
            message: Message | None = None
            if frame.msg_id == HEARTBEAT:
                message = READERS[HEARTBEAT](codec.decode(frame))
            envelope = Envelope(t_ns, t_ns, (frame.sysid, frame.compid), frame.msg_id)
            if self.service.speaks_for_vehicle(envelope, message):
                return True
        return False

    def tick(self, t_ns: int) -> None:
        """Runs what is due by the clock; feeds the live view."""
        self._now_ns = t_ns
        if t_ns >= self._timer_ns:
            self._guarded(t_ns, "timer", lambda: self.service.on_timer(t_ns))
            self._timer_ns = self.service.next_timer_ns(t_ns)
        if self._live is not None:
            self._live.flush()

    def link(self, t_ns: int, is_up: bool, error: str = "") -> None:
        """Passes a changed state of the link, and its latest error, to the service."""
        if (is_up, error) != self._link_state:
            self._link_state = is_up, error
            self._guarded(t_ns, "link", lambda: self.service.on_link(t_ns, is_up, error))

    def stalled(self, t_ns: int, length_ns: int) -> None:
        """Reports to the service that the program was stalled."""
        self._guarded(t_ns, "stall", lambda: self.service.on_stall(t_ns, length_ns))

    def report(self, t_ns: int, link: LinkStatistics) -> None:
        """Logs the counters of link and log, and reports trouble with files."""
        if self._signing is not None:
            self._carry_out(t_ns, self._signing.notices())
            self._log(t_ns, "/signing", self._signing.record())
        self._log(t_ns, "/link", link)
        self._log(t_ns, "/deframer", self.deframer.counters)
        if self._recorder is not None:
            self._log(t_ns, "/recorder", self._recorder.statistics())
        self.report_recorder(t_ns)

    def report_recorder(self, t_ns: int) -> None:
        """Reports what has happened to the log since the last call."""
        for notice in self._recorder.notices() if self._recorder is not None else ():
            self.note(t_ns, Notice(*notice))

    def note(self, t_ns: int, said: Notice) -> None:
        """Reports an event from outside the service."""
        self._carry_out(t_ns, self.service.on_note(t_ns, said))

    def tend(self, t_ns: int, name: str, work: Beside) -> None:
        """Runs something beside the service as due; sends and reports what it returns."""
        try:
            for said in work(t_ns, self._unix_ns(t_ns), self.service):
                if isinstance(said, Send):
                    self._carry_out(t_ns, [said])
                else:
                    self.note(t_ns, said)
        except Exception as error:
            self._fault(t_ns, name, error)

    def _guarded(self, t_ns: int, where: str, event: Callable[[], list[Effect]]) -> None:
        """Carries out the effects of an event."""
        try:
            self._carry_out(t_ns, event())
        except Exception as error:
            self._fault(t_ns, where, error)

    def _fault(self, t_ns: int, where: str, error: Exception) -> None:
        """Limits the damage of a bug to one event."""
        self._carry_out(t_ns, self.service.on_fault(t_ns, where, _in_one_line(error)))

    def _carry_out(self, t_ns: int, effects: Sequence[Effect]) -> None:
        for effect in effects:
            if isinstance(effect, Used):
                self._log_used(t_ns, effect)
            elif isinstance(effect, Send):
                self._send_message(t_ns, effect)
            elif isinstance(effect, Record):
                if self._observer is not None:
                    self._observer.record(t_ns, effect.topic, effect.record)
                self._log(t_ns, effect.topic, effect.record, effect.t_us)
            elif isinstance(effect, Found):
                self._log(t_ns, FINDING_TOPIC, finding_record(*effect))
                if self._finding is not None:
                    self._finding(t_ns, *effect)
            else:
                self._say(t_ns, effect)

    def _log_used(self, t_ns: int, effect: Used) -> None:
        sample, estimate, late_ns = effect
        if estimate is not None:
            self._watcher.estimate(t_ns, estimate, late_ns)
        if not self._writers:
            return
        self._log(t_ns, "/imu", imu_record(sample), sample.t_us)
        if estimate is not None:
            self._log(t_ns, "/estimate", estimate_record(estimate, late_ns), estimate.t_us)
            if self._recorder is not None:
                self._recorder.transform(self._unix_ns(t_ns), estimate.q_nb)

    def _say(self, t_ns: int, effect: Notice) -> None:
        self._watcher.notice(t_ns, effect.severity, effect.text)
        for writer in self._writers:
            writer.text(self._unix_ns(t_ns), effect.severity, effect.text)

    def _log(self, t_ns: int, topic: str, record: tuple[Any, ...], t_us: int | None = None) -> None:
        if self._writers:
            unix_ns, published_ns = self._unix_ns(t_ns), self._publish_ns(t_ns, t_us)
            for writer in self._writers:
                writer.record(topic, record, unix_ns, published_ns)

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
            self._encoder = self._new_encoder()
        frame = self._encoder.encode(effect.message)
        self._send(frame)
        if self._recorder is not None:
            self._recorder.sent(LINK_NAME, self._unix_ns(t_ns), without_signature(frame))

    def _new_encoder(self) -> codec.Encoder:
        signer = None if self._signing is None else self._signing.signer
        return codec.Encoder(self._system_id, self._component_id, signer=signer)


def _in_one_line(error: Exception) -> str:
    """Kind, text and place of an error."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" at {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    return f"{type(error).__name__}: {error}{place}"

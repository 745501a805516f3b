"""Streams the daemon's records to the viewer process over a socket that never blocks the daemon.

Each packet holds the records of one turn of the daemon's loop. A packet that does not fit into the
socket's buffer is dropped and counted, never kept for later: only the present matters. The viewer
answers with `Word`s, which the daemon reads between its own work.
"""

import pickle
import socket
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import orjson

from h2nav.integrity.severity import Severity

TEXT_TOPIC = "/log"
FEED_TOPIC = "/feed"
STATUS_TOPIC = "/status"
# Topics with one record per sample; all others are rare.
FAST_TOPICS = frozenset({"/imu", "/estimate", "/twist", "/odometry", "/wheels", "/pose_measured"})
PAUSE_NS = 100_000_000
# Limit per turn; working off a backlog yields more than can be displayed.
MAX_ENTRIES = 512
BUFFER_BYTES = 512 * 1024
MAX_WORDS = 16
LONGEST_WORD_BYTES = 2048
LONGEST_TROUBLE = 200


class FeedLine(NamedTuple):
    """A line of the program's output, in place of a record.

    Attributes:
        severity: of the line.
        text: the line.
    """

    severity: Severity
    text: str


class FeedEntry(NamedTuple):
    """One record of the feed."""

    topic: str  # as in the log
    unix_ns: int  # host time
    publish_ns: int  # the source's own time on the UNIX scale, or the host time
    record: tuple[Any, ...]  # a NamedTuple of flat scalars, as in the log, or a `FeedLine`


class FeedRecord(NamedTuple):
    """Statistics of the live view and the daemon's process, once a second; not in the log.

    Attributes:
        packets: sent to the viewer since the start.
        dropped: packets and entries that did not fit.
        wants_all: a viewer displays every sample; otherwise fast records come at 10 Hz.
        cpu_s: processor time of the daemon since its start.
        memory_bytes: of the daemon, resident.
    """

    packets: int
    dropped: int
    wants_all: bool
    cpu_s: float
    memory_bytes: int


class Greeting(NamedTuple):
    """The first packet to a viewer: its settings."""

    host: str  # address to listen on
    port: int  # of the page; 0 = chosen by the kernel
    foxglove_port: int  # of the Foxglove WebSocket; 0 = none
    configuration: Mapping[str, Mapping[str, Any]]  # of the daemon, section -> key -> value
    flights_folder: str = ""  # of the record of flights; empty = none
    flights_token: str = ""  # that changes to it need; empty = none are allowed
    upload_bytes: int = 0  # the largest upload


class Word(NamedTuple):
    """A message of the viewer to the daemon.

    Attributes:
        port: of the page, once it listens; 0 before.
        wants_all: a client displays every sample.
        trouble: why the viewer cannot continue; empty while it can.
    """

    port: int = 0
    wants_all: bool = False
    trouble: str = ""


class LiveFeed:
    """The daemon's end of the feed."""

    def __init__(self) -> None:
        self._socket: socket.socket | None = None
        self._entries: list[tuple[str, int, int, tuple[Any, ...]]] = []
        self._due_ns = dict.fromkeys(FAST_TOPICS, 0)
        self.packets = 0  # sent since the start
        self.dropped = 0  # packets and entries that did not fit
        self.refused = 0  # consecutive packets that did not fit
        # every record is wanted; otherwise those of `FAST_TOPICS` are thinned to 10 Hz
        self.wants_all = False

    def want_all(self, wants_all: bool) -> None:
        """Takes whether a viewer displays every sample."""
        self.wants_all = wants_all

    def begin(self, end: socket.socket, greeting: Greeting) -> None:
        """Connects a viewer; `end` is the daemon's of `feed_sockets`."""
        end.setblocking(False)
        self._socket = end
        self._send(end, greeting)

    def end(self) -> None:
        """Disconnects the viewer, which exits when it finds the socket closed."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None
        self._entries.clear()
        self.wants_all = False
        self.refused = 0

    def record(
        self, topic: str, record: tuple[Any, ...], unix_ns: int, publish_ns: int | None = None
    ) -> None:
        """Queues a record; see `Recorder.record`."""
        if self._socket is None:
            return
        if not self.wants_all and topic in self._due_ns:
            # A clock that was set back must not silence a topic.
            if 0 < self._due_ns[topic] - unix_ns <= PAUSE_NS:
                return
            self._due_ns[topic] = unix_ns + PAUSE_NS
        if len(self._entries) == MAX_ENTRIES:
            self.dropped += 1
            return
        published = unix_ns if publish_ns is None else publish_ns
        self._entries.append((topic, unix_ns, published, record))

    def text(self, unix_ns: int, severity: Severity, text: str) -> None:
        """Queues a line of the program's output."""
        self.record(TEXT_TOPIC, FeedLine(severity, text), unix_ns)

    def flush(self) -> None:
        """Sends what was queued; called at the end of each turn."""
        if self._entries and self._socket is not None:
            self._send(self._socket, self._entries)
            self._entries.clear()

    def words(self) -> Iterator[Word]:
        """Yields the viewer's messages since the last call.

        Raises:
            ConnectionError: the viewer is gone or sent an invalid message.
        """
        if self._socket is None:
            return
        for _ in range(MAX_WORDS):
            try:
                data = self._socket.recv(LONGEST_WORD_BYTES)
            except BlockingIOError:
                return
            except ConnectionResetError:
                continue  # it is gone; messages that it sent before come now
            if not data:
                raise ConnectionResetError("the viewer closed its end")
            yield _word(data)

    def _send(self, end: socket.socket, content: object) -> None:
        try:
            end.send(pickle.dumps(content, protocol=pickle.HIGHEST_PROTOCOL))
        except OSError:  # no room, too long, or no viewer: `words` reports the last
            self.dropped += 1
            self.refused += 1
        else:
            self.packets += 1
            self.refused = 0


class FeedReader:
    """The viewer's end of the feed."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end

    def fileno(self) -> int:
        """The descriptor to wait on for reading."""
        return self._socket.fileno()

    def greeting(self) -> Greeting:
        """Waits for the first packet; raises ConnectionError if the daemon is gone."""
        found = self._receive()
        assert isinstance(found, Greeting)
        self._socket.setblocking(False)
        return found

    def entries(self) -> list[FeedEntry]:
        """Returns the entries of the next packet, if one has arrived.

        Raises:
            ConnectionError: the daemon is gone.
        """
        try:
            return [FeedEntry(*entry) for entry in self._receive()]
        except BlockingIOError:
            return []

    def say(self, word: Word) -> None:
        """Sends a message to the daemon without waiting; it is lost where the daemon is gone."""
        with suppress(OSError):
            self._socket.send(orjson.dumps(word._asdict()))

    def _receive(self) -> Any:
        data = self._socket.recv(BUFFER_BYTES)
        if not data:
            raise ConnectionResetError("the daemon closed its end")
        return pickle.loads(data)  # trusted: from the daemon, which started this process


def feed_sockets() -> tuple[socket.socket, socket.socket]:
    """Creates the daemon's end and the viewer's; packets keep their boundaries."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
    return ours, theirs


def _word(data: bytes) -> Word:
    """Checks a message of the viewer: it serves strangers, so it is not trusted."""
    try:
        said = orjson.loads(data)
        port, wants_all, trouble = (said[name] for name in Word._fields)
    except (ValueError, TypeError, KeyError):
        raise ConnectionAbortedError("the viewer sent an invalid message") from None
    if type(port) is not int or type(wants_all) is not bool or type(trouble) is not str:
        raise ConnectionAbortedError("the viewer sent an invalid message")
    printable = "".join(letter if letter.isprintable() else "?" for letter in trouble)
    return Word(port, wants_all, printable[:LONGEST_TROUBLE])

"""Records on a separate thread: the caller never waits for the disk and sees no exception."""

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Self

from h2nav.attitude.samples import Quat
from h2nav.errors import BadInput
from h2nav.integrity.severity import Severity
from h2nav.log.autopilot_channels import AutopilotDecoder
from h2nav.log.file import Attachment, LogFile
from h2nav.log.folder import ACTIVE_SUFFIX, MIB, LogLimits
from h2nav.log.series import FolderTarget, LogSeries, RecorderNotice, SingleTarget

QUEUE_MESSAGES = 16384
QUEUE_BYTES = 16 * MIB
POLL_S = 0.02
RECEIVED_TOPIC = "/mavlink/rx/"
SENT_TOPIC = "/mavlink/tx/"
REFUSED_TOPIC = "/mavlink/refused/"

_Write = Callable[[LogFile], None]


class RecorderRecord(NamedTuple):
    """Statistics of the recording, in the log like any other record.

    Attributes:
        written: messages written since start.
        dropped_queue_full: messages dropped because the disk did not keep up.
        lost_disk: messages lost to a disk that failed or was full.
        rejected: messages that could not be encoded.
        file_bytes: size of the current file.
        files: files opened since start.
    """

    written: int
    dropped_queue_full: int
    lost_disk: int
    rejected: int
    file_bytes: int
    files: int


class Recorder:
    """Writes records to MCAP files on its own thread, behind a bounded queue.

    All calls come from one thread, cost microseconds and never raise. When the disk fails,
    recording stops with one notice, retries with growing delays and reports when it is back; lost
    messages are counted.

    Args:
        folder: created if missing; `folder.next_log_path` names the files.
        limits: sizes and numbers of files, free space.
        unix_offset_ns: UNIX minus monotonic time in every `unix_ns` of this recording; a replay
            recovers the monotonic times from it.
        decode_autopilot: also write the autopilot's common messages as channels of their own.
    """

    def __init__(
        self,
        folder: Path | str,
        limits: LogLimits,
        unix_offset_ns: int = 0,
        *,
        decode_autopilot: bool = False,
    ) -> None:
        target = FolderTarget(Path(folder), limits)
        decoder = AutopilotDecoder() if decode_autopilot else None
        self._start(LogSeries(target, unix_offset_ns), lossless=False, decoder=decoder)

    @classmethod
    def to_file(cls, path: Path | str, unix_offset_ns: int = 0) -> Self:
        """Creates a recorder for one file, which waits for the disk instead of dropping (replay).

        Raises:
            BadInput: the file exists or its folder does not.
        """
        path = Path(path)
        for name in (path, path.with_name(path.name + ACTIVE_SUFFIX)):
            if name.exists():
                raise BadInput(f"{name}: exists; choose another name or remove it first")
        if not path.parent.is_dir():
            raise BadInput(f"{path.parent}: no such folder; make it first")
        recorder = cls.__new__(cls)
        recorder._start(LogSeries(SingleTarget(path), unix_offset_ns), lossless=True)
        return recorder

    def _start(
        self, series: LogSeries, *, lossless: bool, decoder: AutopilotDecoder | None = None
    ) -> None:
        self._queue: deque[tuple[_Write, int]] = deque()
        self._bytes_in = self._bytes_out = 0  # one writing thread each, so no lock
        self._refused = 0
        self._lossless = lossless
        self._wake, self._room = threading.Event(), threading.Event()
        self._begun = threading.Event()
        self._closing = False
        self._decoder = decoder
        self._series = series
        self._thread = threading.Thread(target=self._run, name="h2nav-recorder", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """Number of messages missing from the log, for any reason."""
        series = self._series
        return self._refused + series.lost + series.rejected

    @property
    def path(self) -> Path | None:
        """Final name of the current (or last) file; None before the first."""
        return self._series.path

    @property
    def trouble(self) -> str | None:
        """Why recording is stopped, in one line; None while it works."""
        return self._series.trouble

    def statistics(self) -> RecorderRecord:
        """The counters, as a record for the log or a status line."""
        series = self._series
        return RecorderRecord(
            series.written,
            self._refused,
            series.lost,
            series.rejected,
            series.file_bytes,
            series.opened,
        )

    def notices(self) -> list[RecorderNotice]:
        """Returns the events since the last call; each appears once."""
        waiting = self._series.notices
        return [waiting.popleft() for _ in range(len(waiting))]

    def wait_for_repair(self) -> None:
        """Waits until logs left over from earlier runs have been repaired."""
        self._begun.wait()
        if self._series.repairing is not None:
            self._series.repairing.join()

    def raw(self, link_name: str, unix_ns: int, data: bytes) -> None:
        """Records bytes as received, one call per datagram or read."""
        topic = RECEIVED_TOPIC + link_name
        self._put(lambda file: file.add_raw(topic, unix_ns, data), len(data))
        if self._decoder is not None:
            self._put(partial(_add_decoded, self._decoder, topic, unix_ns, data), len(data))

    def refused(self, link_name: str, unix_ns: int, data: bytes) -> None:
        """Records received bytes that were rejected; a replay skips them."""
        topic = REFUSED_TOPIC + link_name
        self._put(lambda file: file.add_raw(topic, unix_ns, data), len(data))

    def sent(self, link_name: str, unix_ns: int, data: bytes) -> None:
        """Records bytes that were sent."""
        topic = SENT_TOPIC + link_name
        self._put(lambda file: file.add_raw(topic, unix_ns, data), len(data))

    def record(self, topic: str, record: Any, unix_ns: int, publish_ns: int | None = None) -> None:
        """Records a NamedTuple of flat scalars as JSON with a schema.

        Args:
            topic: such as ``/estimate``; one type of record per topic.
            record: int, float, bool, str or None fields, units in their names.
            unix_ns: host time, `log_time` in the file.
            publish_ns: the source's own time on the UNIX scale; `unix_ns` when None.
        """
        published = unix_ns if publish_ns is None else publish_ns
        self._put(lambda file: file.add_record(topic, record, unix_ns, published))

    def transform(self, unix_ns: int, q_nb: Quat) -> None:
        """Records the attitude for viewers: transform ned -> body, and the pose."""
        self._put(lambda file: file.add_attitude(unix_ns, q_nb))

    def text(self, unix_ns: int, severity: Severity, text: str) -> None:
        """Records a line of the program's output."""
        self._put(lambda file: file.add_text(unix_ns, severity, text))

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Adds a file to this log and to every later one."""
        attachment, unix_ns = Attachment(name, media_type, data), time.time_ns()
        self._series.keep("attachment", name, lambda file: file.attach(attachment, unix_ns))
        self._wake.set()

    def metadata(self, name: str, mapping: Mapping[str, str]) -> None:
        """Adds named texts to this log and to every later one."""
        texts = {str(key): str(value) for key, value in mapping.items()}
        self._series.keep("metadata", name, lambda file: file.describe(name, texts))
        self._wake.set()

    def roll(self) -> None:
        """Closes the present file soon and begins the next one."""
        self._series.roll()
        self._wake.set()

    def close(self, timeout_s: float | None = None) -> None:
        """Writes what is queued, closes and renames the file.

        Args:
            timeout_s: limit of the wait for a hanging disk; the file then stays ``.active`` and
                is repaired at the next start.
        """
        self._closing = True
        self._wake.set()
        self._thread.join(timeout_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _put(self, write: _Write, size: int = 0) -> None:
        while len(self._queue) >= QUEUE_MESSAGES or self._bytes_in - self._bytes_out > QUEUE_BYTES:
            self._wake.set()
            if not (self._lossless and self._thread.is_alive()):
                self._refused += 1
                return
            self._room.wait(POLL_S)
            self._room.clear()
        self._bytes_in += size
        self._queue.append((write, size))

    def _run(self) -> None:
        try:
            self._record_until_closed()
        except Exception as error:  # a bug: attitude continues, the operator is notified
            self._series.give_up(error)
        finally:
            self._begun.set()

    def _record_until_closed(self) -> None:
        series = self._series
        series.begin()
        self._begun.set()
        while True:
            closing = self._closing  # read before draining: nothing is queued after it is set
            self._drain()
            series.tend()
            if closing:
                break
            self._wake.wait(POLL_S)
            self._wake.clear()
        series.end()

    def _drain(self) -> None:
        queue, series = self._queue, self._series
        for _ in range(len(queue)):
            write, size = queue.popleft()
            self._bytes_out += size
            series.write(write)
            if len(queue) == QUEUE_MESSAGES // 2:
                self._room.set()
        self._room.set()


def _add_decoded(
    decoder: AutopilotDecoder, topic: str, unix_ns: int, data: bytes, file: LogFile
) -> None:
    """Adds the decoded messages of an autopilot; on the recorder's thread."""
    for decoded in decoder.feed(topic, data):
        file.add_formatted(decoded.topic, decoded.form, decoded.fields, unix_ns)

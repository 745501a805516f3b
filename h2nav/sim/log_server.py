"""The autopilot's logger: list of logs, LOG_REQUEST_DATA and MAVLink FTP, as ArduPilot does them.

One station is served at a time; requests are ignored while it sends, and by the logger while the
vehicle is armed. The file server has a queue of five requests, and serves an armed vehicle too.
"""

from collections import deque
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.fetch.file_transfer import DATA_BYTES, FileError, FileMessage, FileOpcode
from h2nav.maths.units import SECOND_NS

LOG_MESSAGES = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_LOG_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_LOG_REQUEST_DATA,
        mavlink.MAVLINK_MSG_ID_LOG_REQUEST_END,
        mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,
    }
)
LOG_DATA_BYTES = 90
QUEUED_REQUESTS = 5
QUEUE_NS = SECOND_NS // 500
USB_BYTES_PER_S = 1e6
FILE_WIRE_BYTES = 266
LOG_WIRE_BYTES = 109
ENTRIES_NS = SECOND_NS // 100
FOREIGN_NS = SECOND_NS // 50
FIRST_UTC = 1_790_000_000
Address = tuple[int, int]
LogPath = Callable[[int, int], str]


def ardupilot_path(number: int, _utc: int) -> str:
    """Where ArduPilot has its log of a number."""
    return f"/APM/LOGS/{number:08d}.BIN"


def px4_path(_number: int, utc: int) -> str:
    """Where PX4 has the log that began at a UNIX time."""
    return f"{datetime.fromtimestamp(utc, UTC):/fs/microsd/log/%Y-%m-%d/%H_%M_%S.ulg}"


class LogServer:
    """Serves logs.

    Args:
        logs: their contents, the newest last.
        line_bytes_per_s: of the line; None = as fast as USB.
        path_of: where they are for MAVLink FTP, by number and time; None = it has none.
    """

    def __init__(
        self, logs: tuple[bytes, ...], line_bytes_per_s: float | None, path_of: LogPath | None
    ) -> None:
        self._logs = list(logs)
        self._path_of = path_of
        rate = line_bytes_per_s or USB_BYTES_PER_S
        self._file_ns = max(QUEUE_NS, round(FILE_WIRE_BYTES / rate * SECOND_NS))
        self._log_ns = round(LOG_WIRE_BYTES / rate * SECOND_NS)
        self.restart()

    def restart(self) -> None:
        """Serves nobody any more, as after a reboot; the logs stay."""
        self._entries: deque[int] = deque()  # to be listed
        self._sending: tuple[int, int, int] | None = None  # log, offset, end
        self._asked: deque[tuple[Address, FileMessage, bool]] = deque()  # asker, what, is_taken
        self._open: tuple[Address, int] | None = None  # whose, log
        self._due_ns: int | None = None
        self._foreign_ns = 0

    @property
    def next_deadline_ns(self) -> int | None:
        """When `due` returns the next message; None while it sends nothing."""
        return self._due_ns

    def add(self, log: bytes) -> None:
        """A log has ended: it is the newest one."""
        self._logs.append(log)

    def handle(
        self,
        t_ns: int,
        sender: Address,
        message_id: int,
        fields: Any,
        *,
        is_armed: bool,
        is_taken: bool,
    ) -> list[Any]:
        """Takes a message of `LOG_MESSAGES`; returns the answers at once.

        Args:
            is_taken: another station is being served.
        """
        if message_id == mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL:
            if self._path_of is not None and len(self._asked) < QUEUED_REQUESTS:
                self._asked.append((sender, FileMessage.read(bytes(fields.payload)), is_taken))
                self._wake(t_ns + QUEUE_NS)
            return []
        if message_id == mavlink.MAVLINK_MSG_ID_LOG_REQUEST_END:
            self._entries.clear()
            self._sending = None
            return []
        if is_armed:
            return [_text(mavlink.MAV_SEVERITY_ERROR, b"Disarm for log download")]
        if is_taken:
            self._foreign_ns = t_ns
            self._wake(t_ns)
            return [_text(mavlink.MAV_SEVERITY_INFO, b"Log download in progress")]
        if self._entries or self._sending:
            if self._due_ns is None:  # it was armed meanwhile
                self._wake(t_ns)
            return []
        if message_id == mavlink.MAVLINK_MSG_ID_LOG_REQUEST_LIST:
            last = min(fields.end, len(self._logs))
            self._entries.extend(range(max(fields.start, 1), last + 1) if self._logs else (0,))
        elif 1 <= fields.id <= len(self._logs):
            size = len(self._logs[fields.id - 1])
            start = min(fields.ofs, size)
            self._sending = fields.id, start, min(size, start + fields.count)
        self._wake(t_ns)
        return []

    def due(self, t_ns: int, *, is_armed: bool, is_taken: bool, has_room: bool) -> list[Any]:
        """Returns what is sent now.

        Args:
            has_room: the line accepts another message.
        """
        if self._due_ns is None or t_ns < self._due_ns:
            return []
        self._due_ns = None
        sent: list[Any] = []
        if is_taken and t_ns >= self._foreign_ns:
            self._foreign_ns = t_ns + FOREIGN_NS
            sent.append(mavlink.MAVLink_log_data_message(0xFFFE, 0, 1, [0] * LOG_DATA_BYTES))
        pause_ns = FOREIGN_NS if is_taken else None
        if not has_room:
            pause_ns = self._log_ns
        elif self._asked:
            sender, asked, was_taken = self._asked.popleft()
            sent.append(_answer(sender, self._answered(sender, asked, is_taken=was_taken)))
            pause_ns = self._file_ns
        elif self._entries:
            sent.append(self._entry(self._entries.popleft()))
            pause_ns = ENTRIES_NS
        elif self._sending is not None and not is_armed:
            sent.append(self._log_data())
            pause_ns = self._log_ns
        if pause_ns is not None and (is_taken or self._asked or self._entries or self._sending):
            self._wake(t_ns + pause_ns)
        return sent

    def _wake(self, t_ns: int) -> None:
        self._due_ns = t_ns if self._due_ns is None else min(self._due_ns, t_ns)

    def _entry(self, number: int) -> Any:
        size = len(self._logs[number - 1]) if number else 0
        utc = _utc_of(number) if number else 0
        count = len(self._logs)
        return mavlink.MAVLink_log_entry_message(number, count, count, utc, size)

    def _log_data(self) -> Any:
        assert self._sending is not None
        number, start, end = self._sending
        data = self._logs[number - 1][start : min(end, start + LOG_DATA_BYTES)]
        rest = start + len(data)
        is_over = rest >= end or len(data) < LOG_DATA_BYTES
        self._sending = None if is_over else (number, rest, end)
        padded = list(data.ljust(LOG_DATA_BYTES, b"\0"))
        return mavlink.MAVLink_log_data_message(number, start, len(data), padded)

    # --- MAVLink FTP --------------------------------------------------------------------------

    def _answered(self, sender: Address, asked: FileMessage, *, is_taken: bool) -> FileMessage:
        if is_taken:
            return _refused(asked, FileError.NO_SESSIONS)
        if asked.opcode == FileOpcode.LIST_DIRECTORY:
            return self._listed(asked)
        if asked.opcode == FileOpcode.OPEN_FILE_RO:
            return self._opened(sender, asked)
        if asked.opcode == FileOpcode.TERMINATE_SESSION:
            self._open = None
            return _accepted(asked)
        if asked.opcode != FileOpcode.READ_FILE:
            return _refused(asked, FileError.UNKNOWN_COMMAND)
        if self._open is None or self._open[0] != sender:
            return _refused(asked, FileError.FILE_NOT_FOUND)
        data = self._logs[self._open[1]][asked.offset : asked.offset + asked.size]
        return _accepted(asked, data) if data else _refused(asked, FileError.END_OF_FILE)

    def _paths(self) -> list[str]:
        assert self._path_of is not None
        return [self._path_of(each, _utc_of(each)) for each in range(1, len(self._logs) + 1)]

    def _listed(self, asked: FileMessage) -> FileMessage:
        folder = asked.data.decode(errors="replace") + "/"
        found: list[str] = []
        for path, log in zip(self._paths(), self._logs, strict=True):
            name, _, rest = path.removeprefix(folder).partition("/")
            entry = f"D{name}\0" if rest else f"F{name}\t{len(log)}\0"
            if path.startswith(folder) and entry not in found:
                found.append(entry)
        if not found:
            return _refused(asked, FileError.FAIL_ERRNO)
        data = b""
        for entry in found[asked.offset :]:
            if len(data) + len(entry) >= DATA_BYTES:
                break
            data += entry.encode()
        return _accepted(asked, data) if data else _refused(asked, FileError.END_OF_FILE)

    def _opened(self, sender: Address, asked: FileMessage) -> FileMessage:
        if self._open is not None and self._open[0] != sender:
            return _refused(asked, FileError.FAIL)
        name = asked.data.decode(errors="replace")
        for number, (path, log) in enumerate(zip(self._paths(), self._logs, strict=True)):
            if name == path:
                self._open = sender, number
                return _accepted(asked, len(log).to_bytes(4, "little"))
        return _refused(asked, FileError.FAIL_ERRNO)


def _utc_of(number: int) -> int:
    return FIRST_UTC + 3600 * number


def _accepted(asked: FileMessage, data: bytes = b"") -> FileMessage:
    return FileMessage(
        asked.sequence + 1,
        FileOpcode.ACK,
        asked.session,
        len(data),
        asked.opcode,
        offset=asked.offset,
        data=data,
    )


def _refused(asked: FileMessage, error: FileError) -> FileMessage:
    return _accepted(asked, bytes((error,)))._replace(opcode=FileOpcode.NAK)


def _answer(to: Address, said: FileMessage) -> Any:
    return mavlink.MAVLink_file_transfer_protocol_message(0, *to, said.packed())


def _text(severity: int, text: bytes) -> Any:
    return mavlink.MAVLink_statustext_message(severity, text)

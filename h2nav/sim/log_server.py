"""The autopilot's logger: list of logs, LOG_REQUEST_DATA and MAVLink FTP, as ArduPilot does them.

One station is served at a time; requests are ignored while it sends, and by the logger while the
vehicle is armed. An FTP burst is a hundred packets at a third of the line.
"""

from collections import deque
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
BURST_PACKETS = 100
USB_BYTES_PER_S = 1e6
FILE_WIRE_BYTES = 266
LOG_WIRE_BYTES = 109
ENTRIES_NS = SECOND_NS // 100
FOREIGN_NS = SECOND_NS // 50
FOLDER = "/APM/LOGS"
FIRST_UTC = 1_790_000_000
Address = tuple[int, int]


class LogServer:
    """Serves logs.

    Args:
        logs: their contents, the newest last.
        line_bytes_per_s: of the line; None = as fast as USB.
        has_files: by MAVLink FTP too.
    """

    def __init__(
        self, logs: tuple[bytes, ...], line_bytes_per_s: float | None, *, has_files: bool
    ) -> None:
        self._logs = logs
        self._has_files = has_files
        rate = line_bytes_per_s or USB_BYTES_PER_S
        self._file_ns = round(3.0 * FILE_WIRE_BYTES / rate * SECOND_NS)
        self._log_ns = round(LOG_WIRE_BYTES / rate * SECOND_NS)
        self._entries: deque[int] = deque()  # to be listed
        self._sending: tuple[int, int, int] | None = None  # log, offset, end
        self._burst: tuple[Address, FileMessage, int] | None = None  # asker, next packet, how many
        self._open: tuple[Address, int] | None = None  # whose, log
        self._due_ns: int | None = None
        self._foreign_ns = 0

    @property
    def next_deadline_ns(self) -> int | None:
        """When `due` returns the next message; None while it sends nothing."""
        return self._due_ns

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
            return self._file(t_ns, sender, FileMessage.read(bytes(fields.payload)), is_taken)
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
        elif self._burst is not None:
            sent.append(self._next_packet())
            pause_ns = self._file_ns
        elif self._entries:
            sent.append(self._entry(self._entries.popleft()))
            pause_ns = ENTRIES_NS
        elif self._sending is not None and not is_armed:
            sent.append(self._log_data())
            pause_ns = self._log_ns
        if pause_ns is not None and (is_taken or self._burst or self._entries or self._sending):
            self._wake(t_ns + pause_ns)
        return sent

    def _wake(self, t_ns: int) -> None:
        self._due_ns = t_ns if self._due_ns is None else min(self._due_ns, t_ns)

    def _entry(self, number: int) -> Any:
        size = len(self._logs[number - 1]) if number else 0
        utc = FIRST_UTC + 3600 * number if number else 0
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

    def _file(self, t_ns: int, sender: Address, asked: FileMessage, is_taken: bool) -> list[Any]:
        if not self._has_files:
            return []
        if is_taken:
            return [_answer(sender, _refused(asked, FileError.NO_SESSIONS))]
        if asked.opcode == FileOpcode.LIST_DIRECTORY:
            return [_answer(sender, self._listed(asked))]
        if asked.opcode == FileOpcode.OPEN_FILE_RO:
            return [_answer(sender, self._opened(sender, asked))]
        if asked.opcode == FileOpcode.TERMINATE_SESSION:
            self._open = self._burst = None
            return [_answer(sender, _accepted(asked))]
        if self._open is None or self._open[0] != sender:
            return [_answer(sender, _refused(asked, FileError.FILE_NOT_FOUND))]
        if asked.opcode == FileOpcode.BURST_READ_FILE:
            self._burst = sender, asked._replace(sequence=asked.sequence + 1), BURST_PACKETS
            self._wake(t_ns + self._file_ns)
            return []
        data = self._logs[self._open[1]][asked.offset : asked.offset + asked.size]
        if not data:
            return [_answer(sender, _refused(asked, FileError.END_OF_FILE))]
        return [_answer(sender, _accepted(asked, data))]

    def _listed(self, asked: FileMessage) -> FileMessage:
        if asked.data.decode(errors="replace") != FOLDER:
            return _refused(asked, FileError.FAIL_ERRNO)
        names = [
            f"F{number:08d}.BIN\t{len(log)}\0".encode() for number, log in enumerate(self._logs, 1)
        ]
        data = b""
        for name in names[asked.offset :]:
            if len(data) + len(name) >= DATA_BYTES:
                break
            data += name
        return _accepted(asked, data) if data else _refused(asked, FileError.END_OF_FILE)

    def _opened(self, sender: Address, asked: FileMessage) -> FileMessage:
        if self._open is not None and self._open[0] != sender:
            return _refused(asked, FileError.FAIL)
        name = asked.data.decode(errors="replace")
        for number, log in enumerate(self._logs):
            if name == f"{FOLDER}/{number + 1:08d}.BIN":
                self._open = sender, number
                return _accepted(asked, len(log).to_bytes(4, "little"))
        return _refused(asked, FileError.FAIL_ERRNO)

    def _next_packet(self) -> Any:
        assert self._burst is not None
        asker, asked, left = self._burst
        log = self._logs[self._open[1]] if self._open is not None else b""
        data = log[asked.offset : asked.offset + (asked.size or DATA_BYTES)]
        if not data:
            self._burst = None
            said = _refused(asked, FileError.END_OF_FILE)
            return _answer(asker, said._replace(sequence=asked.sequence, is_burst_over=True))
        said = _accepted(asked, data)._replace(sequence=asked.sequence, is_burst_over=left == 1)
        following = asked._replace(
            sequence=asked.sequence + 1, offset=asked.offset + len(data), is_burst_over=False
        )
        self._burst = None if left == 1 else (asker, following, left - 1)
        return _answer(asker, said)


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

"""Fetches an autopilot's newest log: by MAVLink FTP where it has that, else by LOG_REQUEST_DATA.

It never asks for more than its share of the link in advance: what has arrived is paid for before
the next request. Lost parts are asked for again, repeated and late ones fill what is missing or
nothing. While somebody else fetches it waits, and asks the autopilot for nothing.

Source: MAVLink, log transfer and file transfer protocols; ArduPilot 4.6, AP_Logger and GCS_FTP: the
logger serves one link at a time, ignores requests while it sends, and nobody while it is armed; an
FTP burst is 100 packets.
"""

from enum import Enum
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.fetch.file_transfer import DATA_BYTES, FileError, FileMessage, FileOpcode, entries
from h2nav.fetch.gaps import Gaps
from h2nav.maths.units import SECOND_NS
from h2nav.wire.outbound import Address, OutMessage

# A window lasts this long at the share of the link, so that little is on its way when it stops.
FETCH_WINDOW_S = 0.08
LOG_DATA_BYTES = 90
LOG_DATA_WIRE_BYTES = 109  # with the frame
FILE_WIRE_BYTES = 266
# Silence after which an answer is lost.
ANSWER_NS = SECOND_NS
WINDOW_QUIET_NS = 7 * SECOND_NS // 10
MAX_LOST = 3
LIST_AGAIN_NS = 2 * SECOND_NS
# Somebody else fetches until nothing was seen of it for this long.
OTHERS_NS = 30 * SECOND_NS
STRAYS = 3
# A gap of fewer packets is read, not streamed: a burst would bring what is there already.
FEW_PACKETS = 4
MAX_LOGS = 4096
MAX_ENTRIES = 4096
LARGEST_LOG_BYTES = 1 << 31
FOLDER = "/APM/LOGS"
SUFFIX = ".BIN"
IN_PROGRESS = "Log download in progress"

HEARD = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_LOG_ENTRY,
        mavlink.MAVLINK_MSG_ID_LOG_DATA,
        mavlink.MAVLINK_MSG_ID_LOG_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_LOG_REQUEST_DATA,
        mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,
        mavlink.MAVLINK_MSG_ID_STATUSTEXT,
    }
)
"""The messages that a fetch has to hear, of every sender."""


class FetchState(Enum):
    """What is asked for."""

    LISTING = "listing the logs"
    FINDING = "looking for the file"
    OPENING = "opening the file"
    READING = "reading"
    DONE = "done"
    FAILED = "failed"


class OwnLog(NamedTuple):
    """A log of the autopilot."""

    number: int  # in its list
    size: int  # bytes
    time_utc: int  # UNIX time, s; 0 if unknown


class LogFetch:
    """The fetch of one log.

    Args:
        autopilot: its address.
        ours: our address.
        bytes_per_s: share of the link.
        has_files: tries MAVLink FTP first.
    """

    def __init__(
        self, autopilot: Address, ours: Address, bytes_per_s: float, *, has_files: bool
    ) -> None:
        self.state = FetchState.LISTING
        self.reason = ""  # why it failed
        self.log: OwnLog | None = None  # that is fetched
        self.size = 0  # of the file
        self.received = 0  # bytes of it so far
        self.chunks: list[tuple[int, bytes]] = []  # offset and bytes for the file; for the caller
        self._autopilot, self._ours = autopilot, ours
        self._rate = bytes_per_s
        self._by_file = has_files
        self._gaps: Gaps | None = None
        self._list: dict[int, OwnLog] = {}
        self._count: int | None = None
        self._last = 0
        self._names: list[tuple[str, int]] = []
        self._path = ""
        self._session = 0
        self._sequence = 0
        self._window: tuple[int, int] | None = None
        self._asked_ns: int | None = None
        self._heard_ns = 0
        self._lost = 0
        self._budget = 0.0
        self._paid_ns: int | None = None
        self._quiet_until_ns = 0
        self._strays = 0

    @property
    def is_over(self) -> bool:
        """Whether nothing more is asked for."""
        return self.state in (FetchState.DONE, FetchState.FAILED)

    def waits_for_others(self, t_ns: int) -> bool:
        """Whether somebody else fetches."""
        return t_ns < self._quiet_until_ns

    def resume(self) -> None:
        """Begins again after an interruption; what has arrived is kept."""
        if not self.is_over:
            self._list.clear()
            self._count = None
            self._enter(FetchState.LISTING)

    def stop(self) -> list[OutMessage]:
        """Ends what the autopilot is doing for us; `resume` takes it up again."""
        if self.state is not FetchState.READING:
            return []
        self._window = None
        if self._by_file:
            return [self._file(FileOpcode.TERMINATE_SESSION)]
        return [mavlink.MAVLink_log_request_end_message(*self._autopilot)]

    def take(self, t_ns: int, sender: Address, message_id: int, fields: Any) -> None:
        """Takes a message of `HEARD`."""
        if message_id == mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL:
            self._take_file(t_ns, sender, fields)
        elif sender != self._autopilot:
            is_request = message_id in (
                mavlink.MAVLINK_MSG_ID_LOG_REQUEST_LIST,
                mavlink.MAVLINK_MSG_ID_LOG_REQUEST_DATA,
            )
            if is_request and sender != self._ours:
                self._leave_it_to_others(t_ns)
        elif message_id == mavlink.MAVLINK_MSG_ID_LOG_ENTRY:
            self._take_entry(t_ns, fields)
        elif message_id == mavlink.MAVLINK_MSG_ID_LOG_DATA:
            self._take_log_data(t_ns, fields)
        elif message_id == mavlink.MAVLINK_MSG_ID_STATUSTEXT and fields.text == IN_PROGRESS:
            self._leave_it_to_others(t_ns)

    def due(self, t_ns: int) -> list[OutMessage]:
        """What is to be sent now; called some ten times a second or oftener."""
        self._earn(t_ns)
        if self.is_over or self.waits_for_others(t_ns):
            return []
        if self.state is FetchState.LISTING:
            return self._listing(t_ns)
        if self.state is FetchState.FINDING:
            return self._finding(t_ns)
        if self.state is FetchState.OPENING:
            return self._opening(t_ns)
        return self._reading(t_ns)

    # --- what is asked ------------------------------------------------------------------------

    def _listing(self, t_ns: int) -> list[OutMessage]:
        is_quiet = self._asked_ns is None or t_ns - self._heard_ns > LIST_AGAIN_NS
        if self._count is not None and (len(self._list) >= self._count or is_quiet):
            newest = self._newest()
            if newest is not None or self._count == 0:
                return self._choose(t_ns, newest)
        if not is_quiet:
            return []
        self._asked_ns = self._heard_ns = t_ns
        return [mavlink.MAVLink_log_request_list_message(*self._autopilot, 0, 0xFFFF)]

    def _newest(self) -> OwnLog | None:
        """The newest log; None while the list may lack it."""
        logs = self._list.values()
        complete = self._count is not None and len(self._list) >= self._count
        if not logs or not (complete or max(self._list) == self._last):
            return None
        if all(log.time_utc for log in logs) and complete:
            return max(logs, key=lambda log: (log.time_utc, log.number))
        return self._list[max(self._list)]

    def _choose(self, t_ns: int, newest: OwnLog | None) -> list[OutMessage]:
        if self.log is not None:  # resumed: the log may have another number by now
            same = (self.log.size, self.log.time_utc)
            found = [log for log in self._list.values() if (log.size, log.time_utc) == same]
            newest = found[-1] if found else None
        if newest is None or not 0 < newest.size < LARGEST_LOG_BYTES:
            return self._fail("the autopilot has no such log")
        self.log = newest
        if self._gaps is None:
            self._gaps, self.size = Gaps(newest.size), newest.size
        if not self._by_file:
            self._enter(FetchState.READING)
        elif self._path:
            self._enter(FetchState.OPENING)
        else:
            self._names.clear()
            self._enter(FetchState.FINDING)
        return self.due(t_ns)

    def _finding(self, t_ns: int) -> list[OutMessage]:
        if not self._may_ask(t_ns):
            return [] if self._by_file else self.due(t_ns)
        name = FOLDER.encode()
        return [
            self._file(
                FileOpcode.LIST_DIRECTORY, size=len(name), offset=len(self._names), data=name
            )
        ]

    def _opening(self, t_ns: int) -> list[OutMessage]:
        if not self._may_ask(t_ns):
            return [] if self._by_file else self.due(t_ns)
        name = self._path.encode()
        return [self._file(FileOpcode.OPEN_FILE_RO, size=len(name), data=name)]

    def _may_ask(self, t_ns: int) -> bool:
        """Whether a question may be sent now; where FTP never answers, it is given up."""
        if self._asked_ns is not None and t_ns - self._asked_ns <= ANSWER_NS:
            return False
        if self._asked_ns is not None:
            self._lost += 1
            if self._lost >= MAX_LOST and not self._path:
                self._by_file = False
                self._enter(FetchState.READING)
                return False
        self._asked_ns = t_ns
        return True

    def _reading(self, t_ns: int) -> list[OutMessage]:
        assert self._gaps is not None
        gap = self._gaps.first
        if gap is None:
            ended = self.stop()
            self._enter(FetchState.DONE)
            return ended
        before: list[OutMessage] = []
        if self._window is not None:
            if t_ns - self._heard_ns <= WINDOW_QUIET_NS:
                return []
            self._lost += 1
            if not self._by_file:  # it ignores requests while it believes to be sending
                before = self.stop()
            elif self._lost >= MAX_LOST:
                self._enter(FetchState.OPENING)
                return []
            self._window = None
        if self._budget <= 0.0:
            return before
        self._heard_ns = t_ns
        return [*before, self._request(*gap)]

    def _request(self, start: int, end: int) -> OutMessage:
        if self._by_file:
            is_small = end - start <= FEW_PACKETS * DATA_BYTES
            opcode = FileOpcode.READ_FILE if is_small else FileOpcode.BURST_READ_FILE
            self._window = start, min(end, start + DATA_BYTES) if is_small else end
            return self._file(opcode, size=min(DATA_BYTES, end - start), offset=start)
        assert self.log is not None
        packets = max(1, int(self._rate * FETCH_WINDOW_S / LOG_DATA_WIRE_BYTES))
        end = min(end, start + packets * LOG_DATA_BYTES)
        self._window = start, end
        return mavlink.MAVLink_log_request_data_message(
            *self._autopilot, self.log.number, start, end - start
        )

    def _file(
        self, opcode: FileOpcode, *, size: int = 0, offset: int = 0, data: bytes = b""
    ) -> OutMessage:
        self._sequence += 1
        asked = FileMessage(self._sequence, opcode, self._session, size, offset=offset, data=data)
        return mavlink.MAVLink_file_transfer_protocol_message(0, *self._autopilot, asked.packed())

    # --- what is answered ---------------------------------------------------------------------

    def _take_entry(self, t_ns: int, fields: Any) -> None:
        if self.state is not FetchState.LISTING or self._asked_ns is None:
            self._stray(t_ns)
            return
        self._heard_ns = t_ns
        self._count = min(fields.num_logs, MAX_LOGS)
        self._last = fields.last_log_num
        if fields.num_logs and len(self._list) < MAX_LOGS:
            self._list[fields.id] = OwnLog(fields.id, fields.size, fields.time_utc)

    def _take_log_data(self, t_ns: int, fields: Any) -> None:
        is_ours = (
            self.state is FetchState.READING
            and not self._by_file
            and self.log is not None
            and fields.id == self.log.number
            and (self._window is None or fields.ofs < self._window[1])
        )
        if not is_ours:
            self._stray(t_ns)
            return
        data = bytes(fields.data[: min(fields.count, LOG_DATA_BYTES)])
        self._arrived(t_ns, fields.ofs, data, LOG_DATA_WIRE_BYTES)
        if self._window is not None and fields.ofs + len(data) >= self._window[1]:
            self._window = None

    def _take_file(self, t_ns: int, sender: Address, fields: Any) -> None:
        target = fields.target_system, fields.target_component
        if sender != self._autopilot or target != self._ours:
            if sender != self._ours:
                self._leave_it_to_others(t_ns)
            return
        said = FileMessage.read(bytes(fields.payload))
        if said.opcode == FileOpcode.ACK:
            self._take_ack(t_ns, said)
        elif said.opcode == FileOpcode.NAK:
            self._take_nak(t_ns, said)

    def _take_ack(self, t_ns: int, said: FileMessage) -> None:
        if said.asked == FileOpcode.LIST_DIRECTORY and self.state is FetchState.FINDING:
            # One that is repeated would list its names twice.
            if self._asked_ns is not None and said.sequence == (self._sequence + 1) & 0xFFFF:
                self._names += entries(said.data)
                self._asked_ns, self._lost = None, 0
        elif said.asked == FileOpcode.OPEN_FILE_RO and self.state is FetchState.OPENING:
            if len(said.data) >= 4 and int.from_bytes(said.data[:4], "little") == self.size:
                self._session = said.session
                self._enter(FetchState.READING)
            else:
                self._fail("the log has changed while it was fetched")
        elif said.asked in (FileOpcode.BURST_READ_FILE, FileOpcode.READ_FILE):
            if self.state is not FetchState.READING or not self._by_file:
                return
            self._arrived(t_ns, said.offset, said.data, FILE_WIRE_BYTES)
            window = self._window
            is_read = window is not None and said.offset + len(said.data) >= window[1]
            if said.is_burst_over or said.asked == FileOpcode.READ_FILE or is_read:
                self._window = None

    def _take_nak(self, t_ns: int, said: FileMessage) -> None:
        error = said.data[0] if said.data else 0
        if error == FileError.NO_SESSIONS:
            self._leave_it_to_others(t_ns)
        elif self.state is FetchState.FINDING and said.asked == FileOpcode.LIST_DIRECTORY:
            self._found_names(error)
        elif self.state is FetchState.OPENING and said.asked == FileOpcode.OPEN_FILE_RO:
            if error == FileError.FAIL:  # a file is open: ours of before a cut, or another's
                self._leave_it_to_others(t_ns, ANSWER_NS)
            else:
                self._by_file = False
                self._enter(FetchState.READING)
        elif self.state is FetchState.READING and said.asked != FileOpcode.OPEN_FILE_RO:
            self._window = None
            if error != FileError.END_OF_FILE:  # the session is gone
                self._enter(FetchState.OPENING)

    def _found_names(self, error: int) -> None:
        """Ends the listing of the folder: the log is the file of its size with the highest name."""
        assert self.log is not None
        matching = sorted(
            name
            for name, size in self._names
            if size == self.log.size and name.upper().endswith(SUFFIX)
        )
        if error == FileError.END_OF_FILE and matching and "/" not in matching[-1]:
            self._path = f"{FOLDER}/{matching[-1]}"
            self._enter(FetchState.OPENING)
        else:
            self._by_file = False
            self._enter(FetchState.READING)

    def _arrived(self, t_ns: int, offset: int, data: bytes, wire_bytes: int) -> None:
        assert self._gaps is not None
        self._budget -= wire_bytes
        self._heard_ns = t_ns
        if not data or offset + len(data) > self.size:
            return
        if self._gaps.fill(offset, offset + len(data)):
            self._lost = 0
            self.chunks.append((offset, data))
            self.received = self.size - self._gaps.missing

    def _stray(self, t_ns: int) -> None:
        """Takes a part of a log that we have not asked for: late, or another's."""
        self._strays += 1
        if self._strays >= STRAYS:
            self._leave_it_to_others(t_ns)

    # --- the rest -----------------------------------------------------------------------------

    def _leave_it_to_others(self, t_ns: int, pause_ns: int = OTHERS_NS) -> None:
        self._quiet_until_ns = max(self._quiet_until_ns, t_ns + pause_ns)
        self._window = self._asked_ns = None
        self._strays = 0

    def _earn(self, t_ns: int) -> None:
        if self._paid_ns is not None:
            earned = self._rate * (t_ns - self._paid_ns) / SECOND_NS
            self._budget = min(self._budget + earned, 1.0)
        self._paid_ns = t_ns

    def _enter(self, state: FetchState) -> None:
        self.state = state
        self._window = self._asked_ns = None
        self._lost = self._strays = 0

    def _fail(self, reason: str) -> list[OutMessage]:
        self.reason = reason
        self._enter(FetchState.FAILED)
        return []

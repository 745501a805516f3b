"""Fetches a log of an autopilot: by MAVLink FTP where it has that, else by LOG_REQUEST_DATA.

It never asks for more than its share of the link in advance: what was asked for is paid for before
the next request. Lost parts are asked for again, repeated and late ones fill what is missing or
nothing. While somebody else fetches it waits, and asks the autopilot for nothing.

By FTP it reads a few packets ahead and never in bursts: a burst of ArduPilot cannot be ended (up to
2,000 packets, while which its server hears nothing), takes a third of the line whatever our share
is, and would go on when the vehicle is armed.

Source: MAVLink, log transfer and file transfer protocols; ArduPilot, AP_Logger and GCS_FTP: the
logger serves one link at a time, ignores requests while it sends, and nobody while it is armed; the
file server has a queue of five requests and closes a file that is not read for 20 s (when another
is opened: 3 s). PX4, mavlink_log_handler and mavlink_ftp: one file at a time, closed after 10 s.
"""

from enum import Enum
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.fetch.file_transfer import (
    DATA_BYTES,
    FOLDER_SIZE,
    Entry,
    FileError,
    FileMessage,
    FileOpcode,
    entries,
)
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
# Reads in a row that the autopilot refuses: its card, and no session, is at fault.
MAX_REFUSED = 10
LIST_AGAIN_NS = 2 * SECOND_NS
# Somebody else fetches until nothing was seen of it for this long.
OTHERS_NS = 30 * SECOND_NS
STRAYS = 3
# Reads that are on their way: fewer than a queue holds.
MAX_READS = 4
MAX_LOGS = 4096
MAX_ENTRIES = 4096
# Of PX4's folders, one a day, the newest ones.
MAX_FOLDERS = 16
LARGEST_LOG_BYTES = 1 << 31
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


class LogFolder(NamedTuple):
    """Where an autopilot has its logs for MAVLink FTP."""

    path: str
    suffix: str  # of a log's name
    has_folders: bool  # the logs are in folders, one a day or one a start


ARDUPILOT_LOGS = LogFolder("/APM/LOGS", ".BIN", has_folders=False)
PX4_LOGS = LogFolder("/fs/microsd/log", ".ulg", has_folders=True)


class PartOfLog(NamedTuple):
    """A log of which some is there already: its size and time say which one."""

    size: int  # bytes
    time_utc: int  # UNIX time, s; 0 if unknown
    gaps: tuple[tuple[int, int], ...]  # what is missing, from and to


class LogFetch:
    """The fetch of one log.

    Args:
        autopilot: its address.
        ours: our address.
        bytes_per_s: share of the link.
        files: tries MAVLink FTP first, there; None = LOG_REQUEST_DATA alone.
        begun: the log that was begun before; None = the newest one.
    """

    def __init__(
        self,
        autopilot: Address,
        ours: Address,
        bytes_per_s: float,
        files: LogFolder | None,
        begun: PartOfLog | None = None,
    ) -> None:
        self.state = FetchState.LISTING
        self.reason = ""  # why it failed
        self.log: OwnLog | None = None  # that is fetched
        self.size = 0  # of the file
        self.received = 0  # bytes of it so far
        self.chunks: list[tuple[int, bytes]] = []  # offset and bytes for the file; for the caller
        self._autopilot, self._ours = autopilot, ours
        self._rate = bytes_per_s
        self._files = files
        self._by_file = files is not None
        self._gaps: Gaps | None = None
        if begun is not None:
            self.log = OwnLog(0, begun.size, begun.time_utc)
            self._gaps, self.size = Gaps(begun.size, begun.gaps), begun.size
            self.received = self.size - self._gaps.missing
        self._list: dict[int, OwnLog] = {}
        self._count: int | None = None
        self._last = 0
        self._names: list[Entry] = []
        self._folders: list[str] = []  # to be listed, the next one last
        self._path = ""
        self._session = 0
        self._sequence = 0
        self._window: tuple[int, int] | None = None  # of LOG_REQUEST_DATA
        self._reads: dict[int, int] = {}  # offset and time of those on their way
        self._asked_ns: int | None = None
        self._heard_ns = 0
        self._lost = 0
        self._refused = 0  # reads since the last part that came
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

    @property
    def part(self) -> PartOfLog | None:
        """What can be gone on with by another fetch; None while the log is not known."""
        if self.log is None or self._gaps is None:
            return None
        return PartOfLog(self.size, self.log.time_utc, tuple(self._gaps))

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
        self._reads.clear()
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
            assert self._files is not None
            self._names.clear()
            self._folders = [self._files.path]
            self._enter(FetchState.FINDING)
        return self.due(t_ns)

    def _finding(self, t_ns: int) -> list[OutMessage]:
        if not self._may_ask(t_ns):
            return [] if self._by_file else self.due(t_ns)
        name = self._folders[-1].encode()
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
        if self._gaps.first is None:
            ended = self.stop()
            self._enter(FetchState.DONE)
            return ended
        return self._read_file(t_ns) if self._by_file else self._read_log(t_ns, self._gaps.first)

    def _read_log(self, t_ns: int, gap: tuple[int, int]) -> list[OutMessage]:
        before: list[OutMessage] = []
        if self._window is not None:
            if t_ns - self._heard_ns <= WINDOW_QUIET_NS:
                return []
            before = self.stop()  # it ignores requests while it believes to be sending
        if self._budget <= 0.0:
            return before
        self._heard_ns = t_ns
        start, end = gap
        packets = max(1, int(self._rate * FETCH_WINDOW_S / LOG_DATA_WIRE_BYTES))
        end = min(end, start + packets * LOG_DATA_BYTES)
        self._window = start, end
        self._budget -= -(-(end - start) // LOG_DATA_BYTES) * LOG_DATA_WIRE_BYTES
        assert self.log is not None
        asked = mavlink.MAVLink_log_request_data_message(
            *self._autopilot, self.log.number, start, end - start
        )
        return [*before, asked]

    def _read_file(self, t_ns: int) -> list[OutMessage]:
        if self._reads and t_ns - self._heard_ns > WINDOW_QUIET_NS:
            self._lost += 1
            self._heard_ns = t_ns
            if self._lost >= MAX_LOST:
                ended = self.stop()
                self._enter(FetchState.OPENING)
                return ended
        late = [each for each, at_ns in self._reads.items() if t_ns - at_ns > WINDOW_QUIET_NS]
        for offset in late:
            del self._reads[offset]
        asked: list[OutMessage] = []
        while self._budget > 0.0 and len(self._reads) < MAX_READS:
            part = self._next_part()
            if part is None:
                break
            if not self._reads:
                self._heard_ns = t_ns
            self._reads[part[0]] = t_ns
            self._budget -= FILE_WIRE_BYTES
            asked.append(self._file(FileOpcode.READ_FILE, size=part[1] - part[0], offset=part[0]))
        return asked

    def _next_part(self) -> tuple[int, int] | None:
        """The first missing packet that is not on its way, from and to."""
        assert self._gaps is not None
        for start, end in self._gaps:
            for offset in range(start, end, DATA_BYTES):
                if offset not in self._reads:
                    return offset, min(end, offset + DATA_BYTES)
        return None

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
        if not data and self._is_unreadable(t_ns):
            return
        self._arrived(t_ns, fields.ofs, data)
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
                self._session = said.session
                self._names += entries(said.data)
                self._asked_ns, self._lost = None, 0
                if not said.data or len(self._names) > MAX_ENTRIES:  # PX4 ends a list so
                    self._found_names()
        elif said.asked == FileOpcode.OPEN_FILE_RO and self.state is FetchState.OPENING:
            if len(said.data) >= 4 and int.from_bytes(said.data[:4], "little") == self.size:
                self._session = said.session
                self._enter(FetchState.READING)
            else:
                self._fail("the log has changed while it was fetched")
        elif said.asked == FileOpcode.READ_FILE:
            if self.state is not FetchState.READING or not self._by_file:
                return
            self._reads.pop(said.offset, None)
            self._arrived(t_ns, said.offset, said.data)

    def _take_nak(self, t_ns: int, said: FileMessage) -> None:
        error = said.data[0] if said.data else 0
        if error == FileError.NO_SESSIONS:
            self._leave_it_to_others(t_ns)
        elif self.state is FetchState.FINDING and said.asked == FileOpcode.LIST_DIRECTORY:
            if said.sequence == (self._sequence + 1) & 0xFFFF:
                self._found_names()
        elif self.state is FetchState.OPENING and said.asked == FileOpcode.OPEN_FILE_RO:
            if error == FileError.FAIL:  # a file is open: ours of before a cut, or another's
                self._leave_it_to_others(t_ns, ANSWER_NS)
            else:
                self._by_file = False
                self._enter(FetchState.READING)
        elif (
            self.state is FetchState.READING
            and said.asked == FileOpcode.READ_FILE
            and not self._is_unreadable(t_ns)
        ):
            self._enter(FetchState.OPENING)  # the session is gone

    def _found_names(self) -> None:
        """Ends the listing of a folder: the log is the file of its size with the highest name."""
        assert self.log is not None
        assert self._files is not None
        folder = self._folders.pop()
        room = DATA_BYTES - len(f"{folder}/".encode())
        plain = [
            each
            for each in self._names
            if "/" not in each.name and 0 < len(each.name.encode()) <= room
        ]
        matching = [
            each.name
            for each in plain
            if each.size == self.log.size and each.name.lower().endswith(self._files.suffix.lower())
        ]
        if not matching and self._files.has_folders and folder == self._files.path:
            below = sorted(each.name for each in plain if each.size == FOLDER_SIZE)
            self._folders = [f"{folder}/{name}" for name in below[-MAX_FOLDERS:]]
        self._names.clear()
        if matching:
            self._path = f"{folder}/{max(matching)}"
            self._enter(FetchState.OPENING)
        elif self._folders:
            self._enter(FetchState.FINDING)
        else:
            self._by_file = False
            self._enter(FetchState.READING)

    def _arrived(self, t_ns: int, offset: int, data: bytes) -> None:
        assert self._gaps is not None
        self._heard_ns = t_ns
        if not data or offset + len(data) > self.size:
            return
        if self._gaps.fill(offset, offset + len(data)):
            self._lost = self._refused = 0
            self.chunks.append((offset, data))
            self.received = self.size - self._gaps.missing

    def _is_unreadable(self, t_ns: int) -> bool:
        """Counts a read that was refused, and waits; whether the fetch has failed by that."""
        assert self._gaps is not None
        self._refused += 1
        if self._refused > 1:
            self._leave_it_to_others(t_ns, ANSWER_NS)
        gap = self._gaps.first
        if self._refused < MAX_REFUSED or gap is None:
            return False
        self._fail(f"the autopilot cannot read it from byte {gap[0]} on")
        return True

    def _stray(self, t_ns: int) -> None:
        """Takes a part of a log that we have not asked for: late, or another's."""
        self._strays += 1
        if self._strays >= STRAYS:
            self._leave_it_to_others(t_ns)

    # --- the rest -----------------------------------------------------------------------------

    def _leave_it_to_others(self, t_ns: int, pause_ns: int = OTHERS_NS) -> None:
        self._quiet_until_ns = max(self._quiet_until_ns, t_ns + pause_ns)
        self._window = self._asked_ns = None
        self._reads.clear()
        self._strays = 0

    def _earn(self, t_ns: int) -> None:
        if self._paid_ns is not None:
            earned = self._rate * (t_ns - self._paid_ns) / SECOND_NS
            self._budget = min(self._budget + earned, float(MAX_READS * FILE_WIRE_BYTES))
        self._paid_ns = t_ns

    def _enter(self, state: FetchState) -> None:
        self.state = state
        self._window = self._asked_ns = None
        self._reads.clear()
        self._lost = self._strays = 0

    def _fail(self, reason: str) -> list[OutMessage]:
        self.reason = reason
        self._enter(FetchState.FAILED)
        return []

"""Surveys a log, intact or not, in one pass."""

from pathlib import Path
from typing import Any, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Attachment, Metadata

from h2nav.errors import BadInput
from h2nav.log.account import Account, LogAccount, LoggedDifference, StateSpan
from h2nav.log.magic import is_mcap
from h2nav.log.progress import Progress
from h2nav.log.reader import Directory, LogScan, is_closed, records_of
from h2nav.log.recorder import RECEIVED_TOPIC
from h2nav.log.records import StoredMessage, message, parse
from h2nav.maths.units import SECOND_NS

GAP_NS = 1_000_000_000
MAX_GAPS = 100


class TopicSurvey(NamedTuple):
    """One channel."""

    topic: str  # its name
    encoding: str  # of its messages
    schema: str  # its schema's name, empty without one
    messages: int  # their number
    data_bytes: int  # their total length, uncompressed
    rate_hz: float  # mean rate between the first and the last message; 0 for fewer than two
    longest_gap_s: float  # longest time between two messages


class Gap(NamedTuple):
    """A period longer than a second without bytes from a link."""

    topic: str  # the link's channel
    after_s: float  # its beginning, from the start of the log
    length_s: float  # how long it lasts


class LogSurvey(NamedTuple):
    """The survey of a whole log."""

    path: str  # the file
    file_bytes: int  # its size
    closed: bool  # it was closed regularly and has an index
    start_unix_ns: int  # first message; 0 without messages
    duration_s: float  # from the first to the last message
    topics: list[TopicSurvey]  # the channels, by name
    gaps: list[Gap]  # at most `MAX_GAPS`
    attachments: dict[str, int]  # name -> bytes
    metadata: dict[str, dict[str, str]]  # name -> texts
    damaged_records: int  # runs of bytes without an intact record, including a cut-off end
    lost_bytes: int  # their total length
    states: list[StateSpan]  # of the service, in order
    refusals: dict[str, int]  # reason -> number of samples or messages
    findings: list[dict[str, Any]]  # of the service; see `LogAccount`
    differences: list[LoggedDifference]  # the largest ones to the autopilot's attitudes


class _Tally:
    """Counts one channel's messages."""

    def __init__(self) -> None:
        self.messages = self.data_bytes = self.longest_gap_ns = 0
        self.first_ns = self.last_ns = 0
        self.gaps: list[tuple[int, int]] = []

    def take(self, stored: StoredMessage) -> None:
        if self.messages == 0:
            self.first_ns = self.last_ns = stored.log_ns
        gap_ns = stored.log_ns - self.last_ns
        if gap_ns > GAP_NS and len(self.gaps) < MAX_GAPS:
            self.gaps.append((self.last_ns, gap_ns))
        self.longest_gap_ns = max(self.longest_gap_ns, gap_ns)
        self.last_ns = max(self.last_ns, stored.log_ns)
        self.messages += 1
        self.data_bytes += len(stored.data)

    @property
    def rate_hz(self) -> float:
        span_s = (self.last_ns - self.first_ns) / SECOND_NS
        return (self.messages - 1) / span_s if span_s > 0 else 0.0


class _Contents:
    """Passes the service's records to the account, by channel."""

    def __init__(self, directory: Directory) -> None:
        self._directory = directory
        self._account = Account()
        self._topics: dict[int, str | None] = {}

    def take(self, stored: StoredMessage) -> None:
        number = stored.channel_id
        if number not in self._topics:
            channel = self._directory.channel(number)
            topic = channel.topic if channel and channel.message_encoding == "json" else None
            self._topics[number] = topic if topic in self._account.topics else None
        topic = self._topics[number]
        if topic is not None:
            self._account.take(topic, stored.log_ns, stored.data)

    def result(self, start_ns: int) -> LogAccount:
        return self._account.result(start_ns)


def require_mcap(path: Path) -> None:
    """Raises BadInput unless the file can be read and is an MCAP log."""
    try:
        known = is_mcap(path)
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}; expected an MCAP log") from error
    if not known:
        raise BadInput(
            f"{path}: not an MCAP log; expected a file recorded by h2nav "
            "(h2nav replay converts other recordings)"
        )


def survey(path: Path, progress: Progress = lambda done, total: None) -> LogSurvey:
    """Surveys a log.

    Args:
        path: an MCAP file, closed, cut off or damaged.
        progress: called with the bytes done and the total.

    Raises:
        BadInput: no such file, or not an MCAP file.
    """
    require_mcap(path)
    directory = Directory(path)
    tallies: dict[int, _Tally] = {}
    contents = _Contents(directory)
    attachments: dict[str, int] = {}
    metadata: dict[str, dict[str, str]] = {}
    with path.open("rb") as stream:
        scan = LogScan(stream)
        for entry in scan.entries():
            progress(scan.position, scan.size)
            if entry.opcode == Opcode.ATTACHMENT:
                attachment = parse(Attachment.read, entry.body)
                attachments[attachment.name] = len(attachment.data)
            elif entry.opcode == Opcode.METADATA:
                texts = parse(Metadata.read, entry.body)
                metadata[texts.name] = texts.metadata
            for opcode, body in records_of(entry):
                if opcode == Opcode.MESSAGE:
                    stored = message(body)
                    tallies.setdefault(stored.channel_id, _Tally()).take(stored)
                    contents.take(stored)
                else:
                    directory.note(opcode, body)
        damaged, lost = scan.damaged_records, scan.skipped_bytes
    start_ns = min((tally.first_ns for tally in tallies.values()), default=0)
    end_ns = max((tally.last_ns for tally in tallies.values()), default=0)
    topics = {number: _topic(directory, number, tally) for number, tally in tallies.items()}
    return LogSurvey(
        path=str(path),
        file_bytes=path.stat().st_size,
        closed=is_closed(path),
        start_unix_ns=start_ns,
        duration_s=(end_ns - start_ns) / SECOND_NS,
        topics=sorted(topics.values()),
        gaps=_gaps(topics, tallies, start_ns),
        attachments=attachments,
        metadata=metadata,
        damaged_records=damaged,
        lost_bytes=lost,
        **contents.result(start_ns)._asdict(),
    )


def _topic(directory: Directory, number: int, tally: _Tally) -> TopicSurvey:
    channel = directory.channel(number)
    schema = directory.schema(channel) if channel else None
    return TopicSurvey(
        topic=channel.topic if channel else f"(lost channel {number})",
        encoding=channel.message_encoding if channel else "",
        schema=schema.name if schema else "",
        messages=tally.messages,
        data_bytes=tally.data_bytes,
        rate_hz=tally.rate_hz,
        longest_gap_s=tally.longest_gap_ns / SECOND_NS,
    )


def _gaps(topics: dict[int, TopicSurvey], tallies: dict[int, _Tally], start_ns: int) -> list[Gap]:
    gaps = [
        Gap(topics[number].topic, (at_ns - start_ns) / SECOND_NS, length_ns / SECOND_NS)
        for number, tally in tallies.items()
        for at_ns, length_ns in tally.gaps
        if topics[number].topic.startswith(RECEIVED_TOPIC)
    ]
    return sorted(gaps, key=lambda gap: gap.after_s)[:MAX_GAPS]

"""What a fetch asks for and when, step by step: windows, silence, other stations, lists."""

from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.fetch.file_transfer import DATA_BYTES, FileError, FileMessage, FileOpcode
from h2nav.fetch.gaps import MAX_GAPS, Gaps
from h2nav.fetch.log_fetch import (
    ARDUPILOT_LOGS,
    PX4_LOGS,
    FetchState,
    LogFetch,
    PartOfLog,
)

AUTOPILOT, OURS, STATION = (1, 1), (1, 191), (255, 190)
SECOND = 10**9
# 80 ms of it are eleven packets of 109 bytes.
RATE = 15_000.0
ENTRY, DATA = mavlink.MAVLINK_MSG_ID_LOG_ENTRY, mavlink.MAVLINK_MSG_ID_LOG_DATA
FTP = mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL
TEXT = mavlink.MAVLINK_MSG_ID_STATUSTEXT


def entry(number, size=5000, time_utc=0, count=1, last=None):
    return SimpleNamespace(
        id=number, num_logs=count, last_log_num=last or count, time_utc=time_utc, size=size
    )


def data_of(offset, count=90, number=1):
    return SimpleNamespace(id=number, ofs=offset, count=count, data=[7] * 90)


def listed(*entries, files=None, begun=None, t_ns=0):
    """A fetch that has asked for the list and got these entries."""
    fetch = LogFetch(AUTOPILOT, OURS, RATE, files, begun)
    assert [one.get_type() for one in fetch.due(t_ns)] == ["LOG_REQUEST_LIST"]
    for each in entries:
        fetch.take(t_ns, AUTOPILOT, ENTRY, each)
    return fetch


def reading(size=5000):
    """A fetch by LOG_REQUEST_DATA that has asked for its first window at 1 s."""
    fetch = listed(entry(1, size))
    (asked,) = fetch.due(SECOND)
    return fetch, asked


def asked_of(messages):
    return [FileMessage.read(bytes(one.payload)) for one in messages]


def ftp(fetch, t_ns, asked, opcode, data=b"", offset=0, session=1):
    said = FileMessage(asked.sequence + 1, opcode, session, len(data), asked.opcode, offset, data)
    fields = mavlink.MAVLink_file_transfer_protocol_message(0, *OURS, said.packed())
    fetch.take(t_ns, AUTOPILOT, FTP, fields)


# --- the list ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("after_ns", "again"), [(2 * SECOND, 0), (2 * SECOND + 1, 1)])
def test_a_list_is_asked_for_again_after_two_silent_seconds(after_ns, again):
    fetch = listed()
    asked = fetch.due(after_ns)
    assert len(asked) == again
    if again:
        assert (asked[0].target_system, asked[0].target_component) == AUTOPILOT
        assert (asked[0].start, asked[0].end) == (0, 0xFFFF)
    # While entries come there is no silence.
    fetch = listed(entry(1, count=3))
    fetch.take(SECOND, AUTOPILOT, ENTRY, entry(2, count=3))
    assert fetch.due(3 * SECOND) == []


@pytest.mark.parametrize(
    ("entries", "number"),
    [
        ([entry(1, 10, 500, 2), entry(2, 20, 400, 2)], 1),  # the latest of those with a time
        ([entry(1, 10, 500, 2), entry(2, 20, 500, 2)], 2),
        ([entry(1, 10, 500, 2), entry(2, 20, 0, 2)], 2),  # one has none: the highest number
        ([entry(7, 10, 0, 1, 7)], 7),
    ],
)
def test_the_newest_log_by_its_time_or_its_number(entries, number):
    fetch = listed(*entries)
    (asked,) = fetch.due(SECOND)
    assert (asked.get_type(), asked.id, asked.ofs) == ("LOG_REQUEST_DATA", number, 0)
    assert (fetch.log.number, fetch.state) == (number, FetchState.READING)


def test_a_list_with_holes_is_enough_once_its_last_log_is_known_and_all_is_silent():
    holes = entry(1, count=3, last=3), entry(3, 77, count=3, last=3)
    assert listed(*holes).due(SECOND) == []
    (asked,) = listed(*holes).due(3 * SECOND)
    assert asked.id == 3
    (again,) = listed(*holes[:1]).due(3 * SECOND)
    assert again.get_type() == "LOG_REQUEST_LIST"


@pytest.mark.parametrize(
    ("size", "is_read"), [(0, False), (1, True), ((1 << 31) - 1, True), (1 << 31, False)]
)
def test_a_log_has_a_size(size, is_read):
    fetch = listed(entry(1, size))
    fetch.due(SECOND)
    assert fetch.state is (FetchState.READING if is_read else FetchState.FAILED)
    assert fetch.reason == ("" if is_read else "the autopilot has no such log")
    assert (fetch.is_over, fetch.part is None) == (not is_read, not is_read)


def test_a_log_that_was_begun_is_known_by_its_size_and_time():
    begun = PartOfLog(5000, 400, ((90, 180),))
    entries = [entry(n, size, time, 3) for n, size, time in
               ((1, 5000, 300), (2, 5000, 400), (3, 6000, 400))]  # fmt: skip
    fetch = listed(*entries, begun=begun)
    assert (fetch.size, fetch.received) == (5000, 4910)
    (asked,) = fetch.due(SECOND)
    assert (asked.id, asked.ofs, asked.count) == (2, 90, 90)
    assert fetch.part == begun
    gone = listed(entry(1, 5000, 300), begun=begun)
    gone.due(SECOND)
    assert gone.state is FetchState.FAILED


# --- by LOG_REQUEST_DATA ----------------------------------------------------------------------


def test_a_window_is_eighty_milliseconds_of_the_share():
    fetch, asked = reading()
    assert (asked.ofs, asked.count) == (0, 11 * 90)
    assert fetch.due(SECOND + 1) == []  # until it has come
    fetch.take(SECOND + 2, AUTOPILOT, DATA, data_of(10 * 90))
    # It is paid for before the next one is asked for; what is missing of it comes first.
    assert fetch.due(SECOND + 3) == []
    cost_ns = round((11 * 109 - 4 * 266) / RATE * SECOND)
    assert fetch.due(SECOND + cost_ns - 1000) == []
    (again,) = fetch.due(SECOND + cost_ns + 1000)
    assert (again.ofs, again.count) == (0, 10 * 90)
    assert (fetch.received, fetch.chunks) == (90, [(900, bytes([7] * 90))])


def test_the_end_of_a_log_is_asked_for_to_the_byte_and_then_ended():
    fetch, asked = reading(100)
    assert (asked.ofs, asked.count) == (0, 100)
    fetch.take(SECOND, AUTOPILOT, DATA, data_of(0))
    fetch.take(SECOND, AUTOPILOT, DATA, data_of(90, 10))
    assert fetch.received == 100
    (ended,) = fetch.due(SECOND + 1)
    assert ended.get_type() == "LOG_REQUEST_END"
    assert (fetch.state, fetch.is_over, fetch.due(9 * SECOND)) == (FetchState.DONE, True, [])
    fetch.resume()
    assert fetch.is_over


@pytest.mark.parametrize(("after_ns", "kinds"), [
    (700_000_000, []), (700_000_001, ["LOG_REQUEST_END", "LOG_REQUEST_DATA"])])  # fmt: skip
def test_a_silent_window_is_ended_and_asked_for_again(after_ns, kinds):
    fetch, _ = reading()
    assert [one.get_type() for one in fetch.due(SECOND + after_ns)] == kinds


@pytest.mark.parametrize(
    ("fields", "received"),
    [
        (data_of(0), 90),
        (data_of(0, 255), 90),
        (data_of(4910, 90, 1), 0),  # beyond its window: somebody else's
        (data_of(0, 90, 2), 0),
        (data_of(900, 90), 90),
        (data_of(990, 90), 0),
    ],
)
def test_a_part_is_ours_within_the_window(fields, received):
    fetch, _ = reading()
    fetch.take(SECOND, AUTOPILOT, DATA, fields)
    assert fetch.received == received
    fetch.take(SECOND, STATION, DATA, data_of(90))
    assert fetch.received == received


def test_a_part_that_reaches_beyond_the_log_is_none():
    fetch, _ = reading(100)
    fetch.take(SECOND, AUTOPILOT, DATA, data_of(11, 90))
    assert (fetch.received, fetch.chunks) == (0, [])
    fetch.take(SECOND, AUTOPILOT, DATA, data_of(10, 90))
    assert fetch.received == 90
    fetch.take(SECOND, AUTOPILOT, DATA, data_of(10, 90))  # repeated
    assert len(fetch.chunks) == 1


# --- other stations ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sender", "message_id", "fields", "waits"),
    [
        (STATION, mavlink.MAVLINK_MSG_ID_LOG_REQUEST_LIST, None, True),
        (STATION, mavlink.MAVLINK_MSG_ID_LOG_REQUEST_DATA, None, True),
        (OURS, mavlink.MAVLINK_MSG_ID_LOG_REQUEST_DATA, None, False),
        (STATION, ENTRY, entry(1), False),
        (AUTOPILOT, TEXT, SimpleNamespace(text="Log download in progress"), True),
        (AUTOPILOT, TEXT, SimpleNamespace(text="Armed"), False),
        (STATION, TEXT, SimpleNamespace(text="Log download in progress"), False),
    ],
)
def test_others_are_left_alone_for_half_a_minute(sender, message_id, fields, waits):
    fetch, _ = reading()
    fetch.take(SECOND, sender, message_id, fields)
    assert fetch.waits_for_others(31 * SECOND - 1) == waits
    assert not fetch.waits_for_others(31 * SECOND)
    if waits:
        assert fetch.due(31 * SECOND - 1) == []
        assert [one.get_type() for one in fetch.due(31 * SECOND)] == ["LOG_REQUEST_DATA"]


def test_three_strays_are_somebody_elses_fetch():
    fetch, _ = reading()
    for number in range(3):
        assert not fetch.waits_for_others(SECOND)
        fetch.take(SECOND, AUTOPILOT, *((DATA, data_of(0, 90, 9)), (ENTRY, entry(1)))[number % 2])
    assert fetch.waits_for_others(SECOND)


def test_a_file_transfer_of_another_is_left_alone():
    payload = FileMessage(1, FileOpcode.ACK).packed()
    to = mavlink.MAVLink_file_transfer_protocol_message
    for sender, target, waits in (
        (AUTOPILOT, STATION, True), (STATION, AUTOPILOT, True), (OURS, AUTOPILOT, False),
    ):  # fmt: skip
        fetch, _ = reading()
        fetch.take(SECOND, sender, FTP, to(0, *target, payload))
        assert fetch.waits_for_others(SECOND) == waits


# --- by files ---------------------------------------------------------------------------------


def finding(files=ARDUPILOT_LOGS, size=5000):
    fetch = listed(entry(1, size), files=files)
    (asked,) = asked_of(fetch.due(SECOND))
    return fetch, asked


def opening(size=5000):
    fetch, asked = finding(size=size)
    ftp(fetch, SECOND, asked, FileOpcode.ACK, f"F1.BIN\t{size}\0".encode())
    (more,) = asked_of(fetch.due(SECOND))
    assert more.offset == 1
    ftp(fetch, SECOND, more, FileOpcode.ACK)
    (asked,) = asked_of(fetch.due(SECOND))
    return fetch, asked


def open_file(size=5000):
    fetch, asked = opening(size)
    ftp(fetch, SECOND, asked, FileOpcode.ACK, size.to_bytes(4, "little"), session=5)
    return fetch, asked_of(fetch.due(SECOND))


def test_a_folder_is_listed_and_a_file_of_its_size_opened():
    fetch, asked = finding()
    assert (asked.opcode, asked.data, asked.offset) == (FileOpcode.LIST_DIRECTORY, b"/APM/LOGS", 0)
    fetch, asked = opening()
    assert (asked.opcode, asked.data) == (FileOpcode.OPEN_FILE_RO, b"/APM/LOGS/1.BIN")
    assert fetch.state is FetchState.OPENING


@pytest.mark.parametrize(
    ("names", "path"),
    [
        ("F1.BIN\t5000\0F2.bin\t5000\0F3.BIN\t5001", b"/APM/LOGS/2.bin"),
        ("F1.BIN\t5000\0F2.TXT\t5000", b"/APM/LOGS/1.BIN"),
        ("F1.BIN\t5000\0Fa/2.BIN\t5000", b"/APM/LOGS/1.BIN"),
        ("F1.BIN\t4999\0DA\0", None),
        ("", None),
    ],
)
def test_which_file_is_the_log(names, path):
    fetch, asked = finding()
    ftp(fetch, SECOND, asked, FileOpcode.ACK, names.encode())
    if names:
        (more,) = asked_of(fetch.due(SECOND))
        ftp(fetch, SECOND, more, FileOpcode.NAK, bytes([FileError.END_OF_FILE]))
    messages = fetch.due(SECOND)
    if path is None:  # it is fetched by its number
        assert [one.get_type() for one in messages] == ["LOG_REQUEST_DATA"]
    else:
        assert asked_of(messages)[0].data == path


def test_of_px4s_folders_the_newest_sixteen_are_looked_into():
    fetch, asked = finding(PX4_LOGS)
    days = "\0".join(f"D2026-01-{day:02d}" for day in range(1, 21)).encode()
    assert len(days) == DATA_BYTES
    ftp(fetch, SECOND, asked, FileOpcode.ACK, days)
    seen = []
    for _ in range(40):
        messages = fetch.due(SECOND)
        if messages[0].get_type() != "FILE_TRANSFER_PROTOCOL":
            break
        (asked,) = asked_of(messages)
        if not asked.offset:
            seen.append(asked.data.decode())
        ftp(fetch, SECOND, asked, FileOpcode.NAK, bytes([FileError.END_OF_FILE]))
    assert seen == [f"/fs/microsd/log/2026-01-{day:02d}" for day in range(20, 4, -1)]
    assert fetch.state is FetchState.READING


@pytest.mark.parametrize(
    ("silent_s", "questions"), [([1.0], 1), ([1.01], 2), ([1.01, 2.02], 3), ([1.01, 2.02, 3.03], 3)]
)
def test_where_files_are_never_answered_the_log_is_fetched_by_its_number(silent_s, questions):
    fetch, _ = finding()
    asked = [one for s in silent_s for one in fetch.due(SECOND + round(s * SECOND))]
    kinds = [one.get_type() for one in asked]
    assert 1 + kinds.count("FILE_TRANSFER_PROTOCOL") == questions
    assert ("LOG_REQUEST_DATA" in kinds) == (len(silent_s) == 3)


@pytest.mark.parametrize(
    ("answer", "state"),
    [
        ((FileOpcode.ACK, (5000).to_bytes(4, "little")), FetchState.READING),
        ((FileOpcode.ACK, (5001).to_bytes(4, "little")), FetchState.FAILED),
        ((FileOpcode.ACK, b"\x88\x13\0"), FetchState.FAILED),
        ((FileOpcode.NAK, bytes([FileError.FAIL])), FetchState.OPENING),
        ((FileOpcode.NAK, bytes([FileError.NO_SESSIONS])), FetchState.OPENING),
        ((FileOpcode.NAK, bytes([FileError.FILE_NOT_FOUND])), FetchState.READING),
        ((FileOpcode.NAK, b""), FetchState.READING),
    ],
)
def test_what_a_file_that_is_opened_answers(answer, state):
    fetch, asked = opening()
    ftp(fetch, SECOND, asked, *answer)
    assert fetch.state is state
    if state is FetchState.FAILED:
        assert fetch.reason == "the log has changed while it was fetched"
    error = answer[1][:1] if answer[0] == FileOpcode.NAK else b""
    # Another's file is closed within a second, or in half a minute.
    wait_s = {bytes([FileError.FAIL]): 1, bytes([FileError.NO_SESSIONS]): 30}.get(error, 0)
    assert fetch.waits_for_others((wait_s + 1) * SECOND - 1) == bool(wait_s)
    assert not fetch.waits_for_others((wait_s + 1) * SECOND)


def test_at_most_four_reads_are_on_their_way():
    fetch, asked = open_file()
    assert [(one.opcode, one.session, one.offset, one.size) for one in asked] == [
        (FileOpcode.READ_FILE, 5, place * 239, 239) for place in range(len(asked))
    ]
    assert 1 <= len(asked) <= 4
    late = fetch.due(SECOND + 100_000_000)
    assert len(asked) + len(late) <= 4
    everything = [*asked, *asked_of(late)]
    ftp(fetch, SECOND + 100_000_000, everything[1], FileOpcode.ACK, b"x" * 239, 239)
    assert fetch.received == 239
    (next_one, *_) = asked_of(fetch.due(SECOND + 200_000_000))
    assert next_one.offset == len(everything) * 239


def test_a_lost_read_is_asked_for_again_and_three_silences_open_the_file_again():
    fetch, asked = open_file(239)
    assert [(one.offset, one.size) for one in asked] == [(0, 239)]
    t_ns, kinds = SECOND, []
    for _ in range(3):
        assert fetch.due(t_ns + 700_000_000) == []
        t_ns += 700_000_001
        kinds.append([one.opcode for one in asked_of(fetch.due(t_ns))])
    again, ended = [FileOpcode.READ_FILE], [FileOpcode.TERMINATE_SESSION]
    assert kinds == [again, again, ended]
    assert fetch.state is FetchState.OPENING


def test_stopped_it_ends_what_runs_and_nothing_else():
    fetch = listed()
    assert fetch.stop() == []
    fetch, _ = reading()
    assert [one.get_type() for one in fetch.stop()] == ["LOG_REQUEST_END"]
    fetch, _ = open_file()
    (ended,) = asked_of(fetch.stop())
    assert (ended.opcode, ended.session) == (FileOpcode.TERMINATE_SESSION, 5)


# --- what is missing --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("start", "end", "is_new", "left"),
    [
        (0, 10, False, [(10, 20), (30, 40)]),
        (20, 30, False, [(10, 20), (30, 40)]),
        (40, 99, False, [(10, 20), (30, 40)]),
        (9, 11, True, [(11, 20), (30, 40)]),
        (10, 20, True, [(30, 40)]),
        (19, 31, True, [(10, 19), (31, 40)]),
        (12, 15, True, [(10, 12), (15, 20), (30, 40)]),
        (0, 99, True, []),
    ],
)
def test_a_part_fills_what_is_missing(start, end, is_new, left):
    gaps = Gaps(50, [(30, 40), (10, 20)])
    assert (gaps.first, gaps.missing) == ((10, 20), 20)
    assert gaps.fill(start, end) is is_new
    assert list(gaps) == left
    assert gaps.first == (left[0] if left else None)


def test_a_file_without_bytes_lacks_none_and_gaps_are_bounded():
    assert (list(Gaps(0)), Gaps(0).first, Gaps(0).missing) == ([], None, 0)
    gaps = Gaps(10_000, [(4 * i, 4 * i + 3) for i in range(MAX_GAPS)])
    assert not gaps.fill(1, 2)
    assert gaps.missing == 3 * MAX_GAPS
    assert gaps.fill(0, 1)
    assert gaps.missing == 3 * MAX_GAPS - 1
    assert MAX_GAPS == 1000

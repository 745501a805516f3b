"""The fake autopilot's logger, request by request: what it sends, how much and when."""

from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.fetch.file_transfer import (
    Entry,
    FileError,
    FileMessage,
    FileOpcode,
    entries,
)
from h2nav.sim.log_server import LogServer, ardupilot_path, px4_path

ME, OTHER = (255, 190), (254, 191)
LIST = mavlink.MAVLINK_MSG_ID_LOG_REQUEST_LIST
DATA = mavlink.MAVLINK_MSG_ID_LOG_REQUEST_DATA
END = mavlink.MAVLINK_MSG_ID_LOG_REQUEST_END
FILES = mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL
LOGS = (bytes(range(200)), b"", b"abc" * 60)
LINE_BYTES_PER_S = 10_900.0  # 100 packets of log data a second
MS = 1_000_000


class Bench:
    """A logger with a clock that goes from deadline to deadline."""

    def __init__(self, logs=LOGS, rate=LINE_BYTES_PER_S, path_of=ardupilot_path):
        self.server = LogServer(logs, rate, path_of)
        self.t_ns = 0

    def ask(self, message_id, is_armed=False, is_taken=False, sender=ME, **fields):
        return self.server.handle(
            self.t_ns,
            sender,
            message_id,
            SimpleNamespace(**fields),
            is_armed=is_armed,
            is_taken=is_taken,
        )

    def ask_for_file(self, opcode, data=b"", offset=0, size=None, sender=ME, is_taken=False):
        size = len(data) if size is None else size
        asked = FileMessage(7, opcode, 3, size, offset=offset, data=data)
        return self.ask(FILES, sender=sender, is_taken=is_taken, payload=asked.packed())

    def next(self, is_armed=False, is_taken=False, has_room=True):
        """Time since the one before, ms, and what is sent then."""
        due_ns = self.server.next_deadline_ns
        if due_ns is None:
            return None
        since_ms, self.t_ns = (due_ns - self.t_ns) / MS, due_ns
        sent = self.server.due(due_ns, is_armed=is_armed, is_taken=is_taken, has_room=has_room)
        return since_ms, sent

    def all_sent(self, **how):
        found = []
        while (one := self.next(**how)) is not None:
            found.append(one)
            assert len(found) < 20
        return found

    def file_answer(self, *args, **how):
        assert self.ask_for_file(*args, **how) == []
        ((_, (sent,)),) = self.all_sent()
        assert (sent.target_system, sent.target_component) == how.get("sender", ME)
        assert sent.target_network == 0
        answer = FileMessage.read(bytes(sent.payload))
        assert (answer.sequence, answer.asked, answer.session) == (8, args[0], 3)
        assert answer.offset == how.get("offset", 0)
        return answer

    def error(self, *args, **how):
        answer = self.file_answer(*args, **how)
        assert answer.opcode == FileOpcode.NAK
        return FileError(answer.data[0])

    def accepted(self, *args, **how):
        answer = self.file_answer(*args, **how)
        assert answer.opcode == FileOpcode.ACK
        return answer.data


@pytest.mark.parametrize(
    ("start", "end", "numbers"),
    [
        (0, 0xFFFF, [1, 2, 3]),
        (1, 3, [1, 2, 3]),
        (2, 2, [2]),
        (2, 0xFFFF, [2, 3]),
        (3, 2, []),
        (4, 9, []),
    ],
)
def test_the_list_has_an_entry_for_each_log(start, end, numbers):
    bench = Bench()
    assert bench.ask(LIST, start=start, end=end) == []
    sent = bench.all_sent()
    listed = [entry for _, entries in sent for entry in entries]
    assert [entry.id for entry in listed] == numbers
    for entry in listed:
        assert (entry.num_logs, entry.last_log_num) == (3, 3)
        assert entry.size == len(LOGS[entry.id - 1])
    assert [one.time_utc - listed[0].time_utc for one in listed] == [
        3600 * (number - numbers[0]) for number in numbers
    ]
    assert [since_ms for since_ms, _ in sent] == [0.0, *[10.0] * (len(sent) - 1)]


def test_a_logger_without_logs_lists_an_empty_one():
    bench = Bench(logs=())
    bench.ask(LIST, start=0, end=0xFFFF)
    ((_, (entry,)),) = bench.all_sent()
    assert (entry.id, entry.num_logs, entry.last_log_num, entry.size, entry.time_utc) == (0,) * 5
    bench.server.add(b"later")
    bench.ask(LIST, start=0, end=0xFFFF)
    ((_, (entry,)),) = bench.all_sent()
    assert (entry.id, entry.num_logs, entry.size) == (1, 1, 5)


@pytest.mark.parametrize(
    ("number", "offset", "count", "parts"),
    [
        (1, 0, 0xFFFFFFFF, [(0, 90), (90, 90), (180, 20)]),
        (1, 0, 90, [(0, 90)]),
        (1, 0, 91, [(0, 90), (90, 1)]),
        (1, 5, 7, [(5, 7)]),
        (1, 200, 90, [(200, 0)]),
        (1, 900, 90, [(200, 0)]),
        (2, 0, 90, [(0, 0)]),
        (3, 0, 180, [(0, 90), (90, 90)]),
        (3, 0, 181, [(0, 90), (90, 90)]),
        (0, 0, 90, []),
        (4, 0, 90, []),
    ],
)
def test_data_are_sent_in_packets_at_the_rate_of_the_line(number, offset, count, parts):
    bench = Bench()
    assert bench.ask(DATA, id=number, ofs=offset, count=count) == []
    sent = bench.all_sent()
    packets = [packet for _, packets in sent for packet in packets]
    assert [(packet.ofs, packet.count) for packet in packets] == parts
    for packet in packets:
        assert packet.id == number
        data = LOGS[number - 1][packet.ofs : packet.ofs + packet.count]
        assert bytes(packet.data) == data + bytes(90 - packet.count)
    assert [since_ms for since_ms, _ in sent] == [0.0, *[10.0] * (len(sent) - 1)]


def test_an_end_stops_what_is_sent():
    for asked in ({"message_id": LIST, "start": 0, "end": 9},
                  {"message_id": DATA, "id": 1, "ofs": 0, "count": 200}):  # fmt: skip
        bench = Bench()
        bench.ask(**asked)
        assert len(bench.next()[1]) == 1
        assert bench.ask(END) == []
        assert bench.all_sent() == [(10.0, [])]


def test_a_second_request_waits_for_nothing_and_changes_nothing():
    bench = Bench()
    bench.ask(LIST, start=2, end=3)
    assert bench.ask(DATA, id=1, ofs=0, count=200) == []
    assert bench.next()[1][0].id == 2
    assert bench.ask(LIST, start=1, end=1) == []
    assert [one.id for _, sent in bench.all_sent() for one in sent] == [3]
    bench.ask(DATA, id=3, ofs=0, count=180)
    assert bench.ask(LIST, start=1, end=1) == []
    assert {one.id for _, sent in bench.all_sent() for one in sent} == {3}


def test_an_armed_vehicle_sends_no_log():
    bench = Bench()
    (said,) = bench.ask(LIST, is_armed=True, start=0, end=9)
    assert (said.severity, said.text) == (mavlink.MAV_SEVERITY_ERROR, "Disarm for log download")
    assert bench.next() is None
    bench.ask(DATA, id=1, ofs=0, count=200)
    assert bench.next(is_armed=True) == (0.0, [])
    assert bench.next() is None
    bench.ask(DATA, id=1, ofs=0, count=200)
    assert sum(one.count for _, sent in bench.all_sent() for one in sent) == 200


def test_a_reboot_ends_what_is_sent_and_closes_files():
    bench = Bench()
    bench.ask_for_file(FileOpcode.OPEN_FILE_RO, b"/APM/LOGS/00000001.BIN")
    bench.all_sent()
    bench.ask(DATA, id=1, ofs=0, count=200)
    bench.server.restart()
    assert bench.next() is None
    assert bench.error(FileOpcode.READ_FILE, size=9) == FileError.FILE_NOT_FOUND
    assert bench.ask(LIST, start=1, end=1) == []
    assert {one.id for _, sent in bench.all_sent() for one in sent} == {1}


def test_a_line_that_is_full_delays():
    bench = Bench()
    bench.ask(DATA, id=1, ofs=0, count=100)
    assert bench.next(has_room=False) == (0.0, [])
    assert [(since, sent[0].ofs) for since, sent in bench.all_sent()] == [(10.0, 0), (10.0, 90)]


def test_before_the_deadline_nothing_is_sent():
    bench = Bench()
    still = {"is_armed": False, "is_taken": False, "has_room": True}
    assert bench.server.due(5 * MS, **still) == []
    bench.ask_for_file(FileOpcode.READ_FILE)
    assert bench.server.next_deadline_ns == 2 * MS
    assert bench.server.due(2 * MS - 1, **still) == []
    assert len(bench.server.due(2 * MS, **still)) == 1


def test_while_another_is_served_its_packets_are_heard():
    bench = Bench()
    (said,) = bench.ask(LIST, is_taken=True, start=0, end=9)
    assert (said.severity, said.text) == (mavlink.MAV_SEVERITY_INFO, "Log download in progress")
    for since_ms in (0.0, 20.0, 20.0):
        since, (packet,) = bench.next(is_taken=True)
        assert since == since_ms
        assert (packet.id, packet.ofs, packet.count) == (0xFFFE, 0, 1)
        assert bytes(packet.data) == bytes(90)
    assert bench.next() == (20.0, [])
    assert bench.next() is None


def test_whoever_asks_meanwhile_hears_no_more_of_them():
    bench = Bench()
    bench.ask(LIST, is_taken=True, start=0, end=9)
    assert len(bench.next(is_taken=True)[1]) == 1
    bench.t_ns = 5 * MS
    bench.ask_for_file(FileOpcode.READ_FILE, is_taken=True)
    since_ms, (sent,) = bench.next(is_taken=True)
    assert (since_ms, sent.get_type()) == (2.0, "FILE_TRANSFER_PROTOCOL")
    bench.t_ns = 19 * MS
    bench.ask(LIST, is_taken=True, start=0, end=9)  # which is told at once
    since_ms, (sent,) = bench.next(is_taken=True)
    assert (since_ms, sent.get_type()) == (0.0, "LOG_DATA")


@pytest.mark.parametrize(("rate", "pause_ms"), [(None, 2.0), (133_000.0, 2.0), (26_600.0, 10.0)])
def test_files_are_read_as_fast_as_queue_and_line_allow(rate, pause_ms):
    bench = Bench(rate=rate)
    for _ in range(7):
        bench.ask_for_file(FileOpcode.READ_FILE, size=9)
    sent = bench.all_sent()
    assert [since_ms for since_ms, _ in sent] == [2.0, *[pause_ms] * 4]  # the queue holds five


def test_a_log_is_read_as_a_file():
    bench = Bench()
    assert bench.error(FileOpcode.READ_FILE, size=9) == FileError.FILE_NOT_FOUND
    path = ardupilot_path(3, 0).encode()
    assert path == b"/APM/LOGS/00000003.BIN"
    assert bench.accepted(FileOpcode.OPEN_FILE_RO, path) == (180).to_bytes(4, "little")
    assert bench.accepted(FileOpcode.READ_FILE, offset=1, size=5) == b"bcabc"
    assert bench.accepted(FileOpcode.READ_FILE, offset=178, size=5) == b"bc"
    assert bench.error(FileOpcode.READ_FILE, offset=180, size=5) == FileError.END_OF_FILE
    # it is the file of who has opened it, until that one is done with it
    assert bench.error(FileOpcode.READ_FILE, size=5, sender=OTHER) == FileError.FILE_NOT_FOUND
    assert bench.error(FileOpcode.OPEN_FILE_RO, path, sender=OTHER) == FileError.FAIL
    again = ardupilot_path(1, 0).encode()
    assert bench.accepted(FileOpcode.OPEN_FILE_RO, again) == (200).to_bytes(4, "little")
    assert bench.accepted(FileOpcode.TERMINATE_SESSION) == b""
    assert bench.accepted(FileOpcode.OPEN_FILE_RO, path, sender=OTHER)[:1] == b"\xb4"


@pytest.mark.parametrize(
    ("opcode", "data", "how", "error"),
    [
        (FileOpcode.OPEN_FILE_RO, b"/APM/LOGS/00000004.BIN", {}, FileError.FAIL_ERRNO),
        (FileOpcode.LIST_DIRECTORY, b"/nowhere", {}, FileError.FAIL_ERRNO),
        (FileOpcode.LIST_DIRECTORY, b"/APM/LOGS", {"offset": 3}, FileError.END_OF_FILE),
        (2, b"", {}, FileError.UNKNOWN_COMMAND),
        (FileOpcode.LIST_DIRECTORY, b"/APM/LOGS", {"is_taken": True}, FileError.NO_SESSIONS),
    ],
)
def test_what_is_refused(opcode, data, how, error):
    assert Bench().error(opcode, data, **how) == error


@pytest.mark.parametrize(
    ("path_of", "folder", "offset", "found"),
    [
        (ardupilot_path, b"/APM/LOGS", 0, [Entry(f"0000000{n}.BIN", s)
                                           for n, s in ((1, 200), (2, 0), (3, 180))]),
        (ardupilot_path, b"/APM/LOGS", 2, [Entry("00000003.BIN", 180)]),
        (ardupilot_path, b"/APM", 0, [Entry("LOGS", -1)]),
        (px4_path, b"/fs/microsd/log", 0, [Entry("2026-09-21", -1)]),
        (px4_path, b"/fs/microsd/log/2026-09-21", 1, [Entry("16_13_20.ulg", 0),
                                                      Entry("17_13_20.ulg", 180)]),
    ],
)  # fmt: skip
def test_folders_are_listed(path_of, folder, offset, found):
    bench = Bench(path_of=path_of)
    assert entries(bench.accepted(FileOpcode.LIST_DIRECTORY, folder, offset=offset)) == found


def test_a_listing_comes_in_parts_that_fit():
    bench = Bench(logs=(b"x",) * 40)
    sizes = []
    while sum(sizes) < 40:
        listed = bench.accepted(FileOpcode.LIST_DIRECTORY, b"/APM/LOGS", offset=sum(sizes))
        assert len(listed) < 239
        sizes.append(len(entries(listed)))
    assert sizes == [14, 14, 12]  # of 16 bytes each


def test_a_part_ends_at_the_first_entry_that_does_not_fit():
    bench = Bench(logs=tuple(bytes(size) for size in (*[100] * 7, *[1] * 6, 10, 1)))
    for offset, sizes in ((0, [100] * 7 + [1] * 6), (13, [10, 1])):
        listed = entries(bench.accepted(FileOpcode.LIST_DIRECTORY, b"/APM/LOGS", offset=offset))
        assert [one.size for one in listed] == sizes


def test_without_files_nobody_answers():
    bench = Bench(path_of=None)
    assert bench.ask_for_file(FileOpcode.LIST_DIRECTORY, b"/") == []
    assert bench.next() is None

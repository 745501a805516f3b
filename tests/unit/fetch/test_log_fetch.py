"""A log is fetched from the fake autopilot, over a line that loses, repeats, delays and is cut."""

import os
import random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.autopilot_bytes import AutopilotBytes
from h2nav.fetch.file_transfer import DATA_BYTES, FileError, FileMessage, FileOpcode
from h2nav.fetch.gaps import Gaps
from h2nav.fetch.log_fetch import (
    ARDUPILOT_LOGS,
    HEARD,
    MAX_REFUSED,
    PX4_LOGS,
    FetchState,
    LogFetch,
)
from h2nav.maths.units import SECOND_NS
from h2nav.sim.autopilot import AutopilotOptions, FakeAutopilot
from h2nav.sim.faults import parse_fault
from h2nav.sim.personalities import ARDUPILOT, PX4
from h2nav.sim.scenarios import scenario
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer

AUTOPILOT, OURS, STATION = (1, 1), (1, 191), (255, 190)
STEP_NS = 10_000_000
BYTES_PER_S = 92_160.0  # 921,600 baud
SHARE = 0.5
# More by hand: `pytest tests/unit/fetch` with H2NAV_LOG_MB=10.
LOG = random.Random(3).randbytes(round(float(os.environ.get("H2NAV_LOG_MB", "0.2")) * 1e6))
OLDER = random.Random(4).randbytes(50_000)


class Bench:
    """The fetch and the fake autopilot on one line, in steps of 10 ms."""

    def __init__(
        self,
        *faults,
        flown="rest",
        has_files=True,
        logs=(OLDER, LOG),
        files=ARDUPILOT_LOGS,
        personality=ARDUPILOT,
        begun=None,
    ):
        options = AutopilotOptions(
            scenario(flown),
            personality,
            faults=tuple(parse_fault(text) for text in faults),
            line_bytes_per_s=BYTES_PER_S,
            logs=logs,
            has_files=has_files,
        )
        self.autopilot = FakeAutopilot(options)
        self.line = AutopilotBytes(self.autopilot, 0)
        self.deframer = Deframer()
        self.encoders = {each: Encoder(*each) for each in (OURS, STATION)}
        self.fetch = LogFetch(AUTOPILOT, OURS, SHARE * BYTES_PER_S, files, begun)
        self.t_ns = 0
        self.content = bytearray(len(logs[-1]) if logs else 0)
        self.wire_bytes: list[tuple[int, int]] = []  # time and size of what the fetch brings
        self.asked = []
        self.attitudes = 0
        self.send(mavlink.MAVLink_command_long_message(1, 1, 511, 0, 30, 20_000, 0, 0, 0, 0, 0))

    def send(self, message, sender=OURS):
        self.line.received(self.t_ns, self.encoders[sender].encode(message))

    def run(self, seconds, until=lambda: False, *, asks=True):
        end_ns = self.t_ns + round(seconds * SECOND_NS)
        while self.t_ns < end_ns and not until():
            self.t_ns += STEP_NS
            for data in self.line.advance(self.t_ns):
                for frame in self.deframer.feed(data):
                    self.hear(frame)
            for message in self.fetch.due(self.t_ns) if asks else ():
                self.asked.append((self.t_ns, message.get_type()))
                self.send(message)
            for offset, part in self.fetch.chunks:
                self.content[offset : offset + len(part)] = part
            self.fetch.chunks.clear()

    def hear(self, frame):
        self.attitudes += frame.msg_id == mavlink.MAVLINK_MSG_ID_ATTITUDE
        if frame.msg_id in (
            mavlink.MAVLINK_MSG_ID_LOG_DATA,
            mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,
        ):
            self.wire_bytes.append((self.t_ns, len(frame.raw)))
        if frame.msg_id in HEARD:
            self.fetch.take(self.t_ns, (frame.sysid, frame.compid), frame.msg_id, decode(frame))

    def fetched(self, within_s=60.0):
        self.run(within_s + 2.0 * len(LOG) / (SHARE * BYTES_PER_S), lambda: self.fetch.is_over)
        assert self.fetch.state is FetchState.DONE, (self.fetch.state, self.fetch.received)
        assert bytes(self.content) == LOG


@pytest.fixture(params=["ftp", "log-data"])
def has_files(request):
    return request.param == "ftp"


def test_it_fetches_the_newest_log(has_files):
    bench = Bench(has_files=has_files)
    bench.fetched()
    kinds = {kind for _, kind in bench.asked}
    assert ("LOG_REQUEST_DATA" in kinds) != has_files


def test_from_px4_it_fetches_from_the_folder_of_the_day():
    day = 24  # logs an hour apart: the newest one is in the second of two folders
    logs = (OLDER,) * day + (LOG,)
    bench = Bench(logs=logs, files=PX4_LOGS, personality=PX4)
    bench.fetched()
    assert "LOG_REQUEST_DATA" not in {kind for _, kind in bench.asked}


def test_an_unfinished_log_is_gone_on_with_though_it_is_not_the_newest_any_more(has_files):
    first = Bench(has_files=has_files)
    first.run(4.0)
    part = first.fetch.part
    had = first.fetch.received
    assert 0 < had < len(LOG)
    second = Bench(has_files=has_files, logs=(OLDER, LOG, OLDER[:1000]), begun=part)
    second.content = first.content
    second.fetched()
    brought = sum(size for _, size in second.wire_bytes)
    assert brought < 1.4 * (len(LOG) - had) + 5_000


def test_an_unfinished_log_that_is_gone_is_given_up(has_files):
    first = Bench(has_files=has_files)
    first.run(4.0)
    second = Bench(has_files=has_files, logs=(OLDER,), begun=first.fetch.part)
    second.run(10.0)
    assert second.fetch.state is FetchState.FAILED


def test_it_keeps_within_its_share_and_loses_no_attitude(has_files):
    bench = Bench(has_files=has_files)
    bench.run(2.0)
    begun_ns, before = bench.t_ns, bench.attitudes
    bench.fetched()
    seconds = (bench.t_ns - begun_ns) / SECOND_NS
    print(f"{len(LOG) / 1e6:.1f} MB in {seconds:.0f} s, {bench.attitudes - before} attitudes")
    used = sum(size for t_ns, size in bench.wire_bytes if t_ns > begun_ns)
    assert used / seconds < 1.05 * SHARE * BYTES_PER_S
    assert used / seconds > 0.5 * SHARE * BYTES_PER_S
    assert bench.attitudes - before == pytest.approx(50.0 * seconds, abs=2)
    assert bench.line.counts()["streams_put_off"] == 0


@pytest.mark.parametrize(
    "faults",
    [
        ("drop=0.05@0",),
        ("duplicate=0.3@0", "reorder=0.2@0"),
        ("delay=300@0",),
        ("drop=0.3@2+4", "duplicate=0.1@0"),
        ("stall@3+20",),
    ],
    ids="_".join,
)
def test_lost_repeated_and_late_parts_and_cuts(has_files, faults):
    Bench(*faults, has_files=has_files).fetched(within_s=180.0)


def test_after_a_cut_it_goes_on_where_it_was(has_files):
    bench = Bench("drop=1@4+20", has_files=has_files)
    bench.run(4.0)
    had = bench.fetch.received
    assert had > 0
    bench.run(20.0)
    assert bench.fetch.received >= had
    before = sum(size for _, size in bench.wire_bytes)
    bench.fetched()
    after = sum(size for _, size in bench.wire_bytes) - before
    assert after < 1.4 * (len(LOG) - had) + 30_000


def test_stopped_it_asks_for_nothing_and_is_resumed(has_files):
    bench = Bench(has_files=has_files)
    bench.run(4.0)
    for message in bench.fetch.stop():
        bench.send(message)
    bench.run(0.2, asks=False)
    count = len(bench.wire_bytes)
    bench.run(5.0, asks=False)
    assert len(bench.wire_bytes) == count
    bench.fetch.resume()
    bench.fetched()


def test_while_another_station_is_served_it_asks_once_in_half_a_minute(has_files):
    bench = Bench("other-fetch@0+45", has_files=has_files)
    bench.run(45.0)
    assert len(bench.asked) <= 4
    bench.fetched(within_s=120.0)


def test_another_station_that_begins_is_left_alone():
    bench = Bench(has_files=False)
    bench.run(3.0)
    bench.fetch.take(
        bench.t_ns,
        STATION,
        mavlink.MAVLINK_MSG_ID_LOG_REQUEST_DATA,
        mavlink.MAVLink_log_request_data_message(1, 1, 1, 0, 90),
    )
    asked = len(bench.asked)
    bench.run(29.0)
    assert len(bench.asked) == asked
    bench.fetched()


def test_an_autopilot_without_logs_and_one_without_an_answer():
    bench = Bench(logs=())
    bench.run(10.0)
    assert bench.fetch.state is FetchState.FAILED
    assert bench.fetch.reason
    silent = Bench("drop=1@0")
    silent.run(60.0)
    assert silent.fetch.state is FetchState.LISTING
    assert len(silent.asked) < 40


class Scripted:
    """A fetch and what an autopilot answers by hand, each on the step after the question."""

    def __init__(self, *, has_files=True, name="1.BIN", files=ARDUPILOT_LOGS):
        self.fetch = LogFetch(AUTOPILOT, OURS, SHARE * BYTES_PER_S, files if has_files else None)
        self.t_ns = 0
        self.listing = f"F{name}\t{len(LOG)}".encode()
        self.reads = 0
        self.refuses = lambda number: False  # of the reads by their number, from 1

    def run(self, seconds):
        end_ns = self.t_ns + round(seconds * SECOND_NS)
        while self.t_ns < end_ns and not self.fetch.is_over:
            self.t_ns += STEP_NS
            for asked in self.fetch.due(self.t_ns):
                Encoder(*OURS).encode(asked)
                self.answer(asked)

    def hear(self, message):
        self.fetch.take(self.t_ns, AUTOPILOT, message.get_msgId(), message)

    def answer(self, asked):
        if asked.get_type() == "LOG_REQUEST_LIST":
            self.hear(mavlink.MAVLink_log_entry_message(1, 1, 1, 100, len(LOG)))
        elif asked.get_type() == "LOG_REQUEST_DATA":
            self.reads += 1
            data = b"" if self.refuses(self.reads) else LOG[asked.ofs : asked.ofs + 90]
            padded = list(data.ljust(90, b"\0"))
            self.hear(mavlink.MAVLink_log_data_message(1, asked.ofs, len(data), padded))
        elif asked.get_type() == "FILE_TRANSFER_PROTOCOL":
            said = FileMessage.read(bytes(asked.payload))
            if said.opcode == FileOpcode.LIST_DIRECTORY:
                listing = b"" if said.offset else self.listing
                self.ftp(said, FileOpcode.ACK, listing)
            elif said.opcode == FileOpcode.OPEN_FILE_RO:
                self.ftp(said, FileOpcode.ACK, len(LOG).to_bytes(4, "little"))
            elif said.opcode == FileOpcode.READ_FILE and self.fetch.state is FetchState.READING:
                self.reads += 1
                if self.refuses(self.reads):
                    self.ftp(said, FileOpcode.NAK, bytes([FileError.FAIL_ERRNO]))
                else:
                    self.ftp(said, FileOpcode.ACK, LOG[said.offset :][: said.size], said.offset)

    def ftp(self, asked, opcode, data, offset=0):
        said = FileMessage(asked.sequence + 1, opcode, 1, len(data), asked.opcode, offset, data)
        self.hear(mavlink.MAVLink_file_transfer_protocol_message(0, *OURS, said.packed()))


def test_a_log_that_the_card_does_not_give_is_given_up_after_ten_tries(has_files):
    bench = Scripted(has_files=has_files)
    bench.refuses = lambda number: number > 5
    bench.run(60.0)
    assert bench.fetch.state is FetchState.FAILED
    at = 5 * (DATA_BYTES if has_files else 90)
    assert bench.fetch.reason == f"the autopilot cannot read it from byte {at} on"
    assert bench.reads == 5 + MAX_REFUSED
    assert bench.t_ns > (MAX_REFUSED - 2) * SECOND_NS  # it gave the card time


def test_a_read_that_is_refused_now_and_then_is_tried_again(has_files):
    bench = Scripted(has_files=has_files)
    bench.refuses = lambda number: number % MAX_REFUSED
    bench.run(30.0)
    assert not bench.fetch.is_over
    assert bench.reads > MAX_REFUSED
    assert bench.fetch.received >= bench.reads // MAX_REFUSED * 90


@pytest.mark.parametrize(("beyond", "is_opened"), [(0, True), (1, False)])
def test_a_file_whose_path_fits_into_no_request_is_not_asked_for(beyond, is_opened):
    name = "x" * (DATA_BYTES - len(ARDUPILOT_LOGS.path) - len("/.BIN") + beyond) + ".BIN"
    bench = Scripted(name=name)
    bench.run(0.1)
    assert bench.fetch.state is FetchState.READING
    assert bench.fetch._by_file == is_opened


def test_scattered_parts_leave_a_bounded_number_of_gaps(monkeypatch):
    monkeypatch.setattr("h2nav.fetch.gaps.MAX_GAPS", 20)
    gaps = Gaps(200)
    taken = [gaps.fill(start, start + 1) for start in range(5, 200, 5)]
    assert taken == [number < 19 for number in range(len(taken))]
    assert len(list(gaps)) == 20
    assert gaps.fill(0, 5)


def test_hostile_answers_cost_nothing():
    dice = random.Random(5)
    bench = Bench(has_files=False)
    bench.run(2.0)
    for _ in range(3000):
        payload = list(dice.randbytes(251))
        data = list(dice.randbytes(90))
        for message in (
            mavlink.MAVLink_file_transfer_protocol_message(0, *OURS, payload),
            mavlink.MAVLink_log_data_message(2, dice.randrange(1 << 32), dice.randrange(256), data),
            mavlink.MAVLink_log_entry_message(*(dice.randrange(1 << 16) for _ in range(5))),
        ):
            bench.fetch.take(bench.t_ns, AUTOPILOT, message.get_msgId(), message)
        bench.fetch.due(bench.t_ns)
    assert bench.fetch.received <= len(LOG)
    assert all(offset + len(part) <= len(LOG) for offset, part in bench.fetch.chunks)


def test_gaps_agree_with_a_plain_set_of_bytes():
    dice = random.Random(2)
    gaps, missing = Gaps(500), set(range(500))
    while missing:
        start = dice.randrange(500)
        end = min(500, start + dice.randrange(1, 40))
        part = set(range(start, end))
        assert gaps.fill(start, end) == bool(part & missing)
        missing -= part
        assert gaps.missing == len(missing)
        assert (gaps.first[0] if gaps.first else None) == min(missing, default=None)
    assert gaps.first is None

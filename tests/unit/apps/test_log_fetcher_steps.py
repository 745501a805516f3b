"""When the autopilot's log is asked for, left alone, gone on with and given up, step by step."""

import dataclasses
from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from wire_frames import FrameMaker, raw_imu

from h2nav.apps import fetched_file, log_fetcher
from h2nav.apps.configuration import Configuration, LinkSettings, LogSettings
from h2nav.apps.fetched_file import FetchedFile, unfinished
from h2nav.apps.log_fetcher import LogFetcher
from h2nav.fetch.log_fetch import ARDUPILOT_LOGS, PX4_LOGS, LogFetch, PartOfLog
from h2nav.integrity.severity import Severity
from h2nav.maths.units import SECOND_NS
from h2nav.service.autopilot import Identity
from h2nav.service.effects import Notice
from h2nav.wire.deframer import Deframer

STEP_NS = SECOND_NS // 10
T_NS = 100 * SECOND_NS
# Of no known make: it is asked with LOG_REQUEST_DATA alone.
OTHER = Identity(1, 1, mavlink.MAV_AUTOPILOT_GENERIC, mavlink.MAV_TYPE_QUADROTOR)
FIRST, SECOND = bytes(range(250)) * 60, bytes(range(1, 251)) * 48
WINDOW = 33 * 90  # of half of 92160 bytes a second, in 80 ms


class Watcher:
    """Notes what is passed on."""

    message_ids = frozenset({mavlink.MAVLINK_MSG_ID_RAW_IMU})

    def __init__(self):
        self.calls = []

    def __getattr__(self, name):
        return lambda *args: self.calls.append((name, *args))


class Bench:
    """A fetcher, and an autopilot that answers in the same step; `logs` by number, with dates."""

    def __init__(self, folder, identity=OTHER, **logs):
        self.folder, self.t_ns = folder, T_NS
        self.logs = {int(name[1:]): content for name, content in logs.items()}
        self.service = SimpleNamespace(identity=identity, system_id=7, is_armed=False)
        self.configuration = dataclasses.replace(
            Configuration(), log=LogSettings(folder=str(folder))
        )
        self.watcher = Watcher()
        self.fetcher = LogFetcher(self.configuration, self.watcher)
        self.frames = FrameMaker()
        self.answers = True

    def step(self, steps=1):
        """What is asked, by name, and what is told."""
        asked, told = [], []
        for _ in range(steps):
            for said in self.fetcher.tend(self.t_ns, 0, self.service):
                if isinstance(said, Notice):
                    told.append(said)
                    continue
                assert said.system_id == 7
                asked.append(said.message.get_type())
                for answer in self._answers(said.message) if self.answers else ():
                    self.hear(answer)
            self.t_ns += STEP_NS
        return asked, told

    def hear(self, message, sender=None):
        data = (sender or self.frames).frame(message)
        for frame in Deframer().feed(data):
            self.fetcher.frame(self.t_ns, frame)

    def armed(self, is_armed, sender=None):
        mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if is_armed else 0
        self.hear(mavlink.MAVLink_heartbeat_message(2, 0, mode, 0, 0, 3), sender)

    def wanted(self, stem="flight"):
        """A flight has just ended, and the autopilot has closed its log."""
        self.fetcher.want(self.t_ns, stem)
        self.t_ns += log_fetcher.CLOSED_NS
        return self

    def fetched(self, most=60):
        """All that is told until a notice comes."""
        for _ in range(most):
            _, told = self.step()
            file = self.fetcher._file
            if file is not None and file._is_complete:
                file.wait(10.0)
            if told:
                return told
        raise AssertionError("nothing is told")

    def files(self):
        return {path.name: path.read_bytes() for path in self.folder.iterdir()}

    def _answers(self, message):
        if message.get_type() == "LOG_REQUEST_LIST":
            last = max(self.logs, default=0)
            for number, content in self.logs.items() or {0: b""}.items():
                yield mavlink.MAVLink_log_entry_message(
                    number, len(self.logs), last, 1_000 * number, len(content)
                )
        elif message.get_type() == "LOG_REQUEST_DATA":
            content = self.logs[message.id]
            end = min(message.ofs + message.count, len(content))
            for offset in range(message.ofs, end, 90):
                data = content[offset : min(offset + 90, end)]
                yield mavlink.MAVLink_log_data_message(
                    message.id, offset, len(data), list(data.ljust(90, b"\0"))
                )


def ended(file):
    file.wait(10.0)
    return file


@pytest.mark.parametrize(("early_ns", "asked"), [(1, []), (0, ["LOG_REQUEST_LIST"])])
def test_a_log_is_asked_for_when_the_autopilot_has_closed_it(tmp_path, early_ns, asked):
    """Ten seconds after the flight has ended."""
    bench = Bench(tmp_path, _1=FIRST)
    assert bench.step() == ([], [])
    bench.fetcher.want(bench.t_ns, "flight")
    bench.t_ns += 10 * SECOND_NS - early_ns
    assert bench.step()[0] == asked


@pytest.mark.parametrize(
    ("make", "suffix", "files"),
    [
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, ".bin", ARDUPILOT_LOGS),
        (mavlink.MAV_AUTOPILOT_PX4, ".ulg", PX4_LOGS),
        (mavlink.MAV_AUTOPILOT_GENERIC, ".bin", None),
    ],
)
@pytest.mark.parametrize(
    ("url", "bytes_per_s"),
    [("udpin:0.0.0.0:14550", 92_160.0), ("serial:/dev/ttyUSB0:57600", 5_760.0)],
)
def test_the_fetch_is_of_the_autopilots_kind_and_takes_its_share_of_the_link(
    tmp_path, monkeypatch, make, suffix, files, url, bytes_per_s
):
    made = []

    class Noted(LogFetch):
        def __init__(self, *args):
            made.append(args)
            super().__init__(*args)

    monkeypatch.setattr(log_fetcher, "LogFetch", Noted)
    bench = Bench(tmp_path, OTHER._replace(system_id=3, autopilot=make))
    chosen = dataclasses.replace(bench.configuration, link=LinkSettings(url))
    bench.fetcher = LogFetcher(chosen, bench.watcher)
    bench.wanted().step()
    assert made == [((3, 1), (7, chosen.output.component_id), bytes_per_s / 2, files, None)]
    assert [each.path for each in bench.fetcher._wanted] == [tmp_path / f"flight{suffix}"]


def test_the_newest_log_becomes_the_flights_and_is_told(tmp_path):
    bench = Bench(tmp_path, _1=FIRST, _2=SECOND).wanted()
    (told,) = bench.fetched()
    assert told == (Severity.INFO, "log fetched: flight.bin, 0.0 MB", "log fetched")
    assert bench.files() == {"flight.bin": SECOND}
    assert bench.fetcher.fetched_bytes == len(SECOND)
    assert bench.step(30) == ([], [])


def test_the_size_is_told_in_megabytes(tmp_path):
    bench = Bench(tmp_path, _1=FIRST * 10).wanted()
    (told,) = bench.fetched(200)
    assert told.text == "log fetched: flight.bin, 0.1 MB"


def test_logs_of_two_flights_are_counted_together(tmp_path):
    bench = Bench(tmp_path, _1=FIRST).wanted("a")
    bench.fetched()
    bench.logs[2] = SECOND
    bench.wanted("b").fetched()
    assert bench.files() == {"a.bin": FIRST, "b.bin": SECOND}
    assert bench.fetcher.fetched_bytes == len(FIRST) + len(SECOND)


@pytest.mark.parametrize("by", ["heartbeat", "service"])
def test_while_it_is_armed_nothing_is_asked_and_then_it_goes_on(tmp_path, by):
    bench = Bench(tmp_path, _1=FIRST).wanted()
    bench.step(3)
    had = bench.fetcher.fetched_bytes
    assert had == 2 * WINDOW
    bench.answers = False  # a window is under way
    bench.step()
    bench.answers = True
    if by == "heartbeat":
        bench.armed(True)
        assert bench.step(20)[0] == ["LOG_REQUEST_END"]
        bench.armed(False)
    else:
        bench.service.is_armed = True
        assert bench.step(20)[0] == []
        bench.service.is_armed = False
    bench.fetched()
    assert bench.files() == {"flight.bin": FIRST}
    assert bench.fetcher.fetched_bytes == len(FIRST)


def test_another_vehicle_that_arms_stops_nothing(tmp_path):
    bench = Bench(tmp_path, _1=FIRST).wanted()
    bench.step(2)
    bench.armed(True, FrameMaker(1, 2))
    bench.hear(mavlink.MAVLink_statustext_message(6, b"Arming motors"), FrameMaker(2, 1))
    assert bench.step()[0] == ["LOG_REQUEST_DATA"]


@pytest.mark.parametrize(
    ("text", "stops"),
    [
        (b"Arming motors", True),
        (b"Throttle armed", True),
        (b"Armed by RC", True),
        (b"PreArm: Arming motors", False),
        (b"Disarming motors", False),
    ],
)
def test_a_text_that_it_arms_gives_two_seconds_to_the_heartbeat(tmp_path, text, stops):
    bench = Bench(tmp_path, _1=FIRST).wanted()
    bench.step(2)
    bench.hear(mavlink.MAVLink_statustext_message(6, text))
    if not stops:
        assert bench.step()[0] == ["LOG_REQUEST_DATA"]
        return
    assert bench.step(20)[0] == ["LOG_REQUEST_END"]
    assert bench.step()[0] == ["LOG_REQUEST_LIST"]
    bench.fetched()
    assert bench.files() == {"flight.bin": FIRST}


def test_it_is_told_to_stop_once(tmp_path):
    bench = Bench(tmp_path, _1=FIRST).wanted()
    bench.step(2)
    bench.armed(True)
    bench.armed(True)
    bench.hear(mavlink.MAVLink_statustext_message(6, b"Arming motors"))
    assert bench.step(30)[0] == ["LOG_REQUEST_END"]


def test_a_folder_that_is_gone_is_told_and_the_log_given_up(tmp_path):
    bench = Bench(tmp_path / "gone", _1=FIRST).wanted()
    bench.step(2)
    ended(bench.fetcher._file)
    (told,) = bench.step()[1]
    part = tmp_path / "gone" / "flight.bin.part"
    assert told == (
        Severity.WARNING,
        f"log not fetched: {part}: No such file or directory",
        "log not fetched",
    )
    assert bench.step(30) == ([], [])


def test_an_autopilot_without_a_log_is_told(tmp_path):
    (told,) = Bench(tmp_path).wanted().fetched()
    assert told.text == "log not fetched: the autopilot has no such log"
    assert list(tmp_path.iterdir()) == []


def test_a_log_that_can_no_longer_be_read_leaves_nothing(tmp_path):
    bench = Bench(tmp_path, _1=FIRST).wanted()
    bench.step(2)
    file = bench.fetcher._file
    bench.fetcher._fetch._fail("the autopilot cannot read it from byte 9 on")
    (told,) = bench.step()[1]
    assert told.text == "log not fetched: the autopilot cannot read it from byte 9 on"
    ended(file)
    assert bench.files() == {}
    assert bench.step(30) == ([], [])


def test_a_disk_that_does_not_keep_up_is_waited_for(tmp_path, monkeypatch):
    bench = Bench(tmp_path, _1=FIRST).wanted()
    bench.step(2)
    monkeypatch.setattr(fetched_file, "MAX_WAITING", 0)
    assert bench.step(5) == ([], [])
    monkeypatch.undo()
    bench.fetched()
    assert bench.files() == {"flight.bin": FIRST}


def test_another_flight_comes_first_and_the_unfinished_log_after_it(tmp_path):
    bench = Bench(tmp_path, _1=FIRST).wanted("a")
    bench.step(3)
    file, had = bench.fetcher._file, bench.fetcher.fetched_bytes
    bench.logs[2] = SECOND
    bench.wanted("b")
    ended(file)
    ((path, part),) = unfinished(tmp_path)
    assert path.name == "a.bin"
    assert part == PartOfLog(len(FIRST), 1_000, ((had, len(FIRST)),))
    assert bench.fetched()[0].text.startswith("log fetched: b.bin")
    bench.armed(True)  # between two logs there is nothing to stop
    bench.armed(False)
    assert bench.fetched()[0].text.startswith("log fetched: a.bin")
    assert bench.files() == {"a.bin": FIRST, "b.bin": SECOND}
    assert bench.fetcher.fetched_bytes == len(FIRST) + len(SECOND)


def test_after_a_restart_it_goes_on_where_it_was(tmp_path):
    bench = Bench(tmp_path, _1=FIRST).wanted()
    bench.step(3)
    had = bench.fetcher.fetched_bytes
    bench.fetcher.close()
    assert set(bench.files()) == {"flight.bin.part", "flight.bin.part.json"}
    again = Bench(tmp_path, _1=FIRST, _2=SECOND)
    assert again.step()[0] == ["LOG_REQUEST_LIST"]
    again.fetched()
    assert again.files() == {"flight.bin": FIRST}
    assert again.fetcher.fetched_bytes == len(FIRST) - had


def test_a_begun_log_that_the_autopilot_has_deleted_is_given_up(tmp_path):
    bench = Bench(tmp_path, _1=FIRST).wanted()
    bench.step(3)
    bench.fetcher.close()
    (told,) = Bench(tmp_path, _2=SECOND).fetched()
    assert told.text == "log not fetched: the autopilot has no such log"
    assert bench.files() == {}


def test_a_log_that_has_come_whole_is_kept_when_another_flight_begins(tmp_path):
    bench = Bench(tmp_path, _1=FIRST[:WINDOW]).wanted("a")
    bench.step(2)
    file = bench.fetcher._file
    bench.fetcher.want(bench.t_ns, "b")
    ended(file)
    assert bench.files() == {"a.bin": FIRST[:WINDOW]}
    assert [each.path.name for each in bench.fetcher._wanted] == []


def test_of_a_log_that_was_not_begun_nothing_would_say_which_it_is(tmp_path):
    bench = Bench(tmp_path, _1=FIRST).wanted("a")
    bench.answers = False
    bench.step()
    bench.answers = True
    bench.wanted("b")
    bench.fetched()
    assert bench.files() == {"b.bin": FIRST}
    assert bench.step(30) == ([], [])


def test_begun_logs_of_another_make_wait_for_it(tmp_path):
    part = PartOfLog(len(FIRST), 1_000, ((90, len(FIRST)),))
    file = FetchedFile(tmp_path / "a.ulg", part._replace(gaps=((0, len(FIRST)),)))
    file.write(0, FIRST[:90])
    file.set_aside(part)
    ended(file)
    bench = Bench(tmp_path, _1=FIRST)
    assert bench.step(30) == ([], [])
    bench.wanted("b").fetched()
    assert set(bench.files()) == {"b.bin", "a.ulg.part", "a.ulg.part.json"}


def test_another_autopilot_is_asked_anew(tmp_path):
    bench = Bench(tmp_path, _1=FIRST).wanted()
    bench.step(3)
    file, had = bench.fetcher._file, bench.fetcher.fetched_bytes
    bench.service.identity = OTHER._replace(system_id=2)
    bench.frames = FrameMaker(2, 1)
    assert bench.step()[0] == ["LOG_REQUEST_LIST"]
    ended(file)
    bench.fetched()
    assert bench.files() == {"flight.bin": FIRST}
    assert bench.fetcher.fetched_bytes == len(FIRST)
    assert had == 2 * WINDOW


def test_without_an_autopilot_or_a_flight_nothing_is_asked_or_read(tmp_path):
    bench = Bench(tmp_path, None, _1=FIRST).wanted()
    bench.armed(True)
    assert bench.step(3) == ([], [])
    bench.service.identity = OTHER
    assert bench.step()[0] == ["LOG_REQUEST_LIST"]


def test_only_the_newest_unfinished_logs_are_gone_on_with(tmp_path):
    bench = Bench(tmp_path, _1=FIRST)
    for number in range(6):
        bench.wanted(f"{number}").step(2)
        file = bench.fetcher._file
        bench.fetcher.want(bench.t_ns, "next")
        ended(file)
    names = [each.path.name for each in bench.fetcher._wanted]
    assert names == ["5.bin", "4.bin", "3.bin", "2.bin"]
    assert set(bench.files()) == {
        f"{name}{end}" for name in names for end in (".part", ".part.json")
    }


def test_what_has_come_is_noted_now_and_then(tmp_path, monkeypatch):
    noted = []
    monkeypatch.setattr(FetchedFile, "note", lambda _, part: noted.append(part.gaps))
    monkeypatch.setattr(FetchedFile, "wants_note", True)
    bench = Bench(tmp_path, _1=FIRST[: WINDOW + 90]).wanted()
    bench.step(2)
    assert noted[0] == ((90, WINDOW + 90),)
    assert noted[-1] == ((WINDOW, WINDOW + 90),)
    assert len(noted) == WINDOW // 90
    monkeypatch.setattr(FetchedFile, "wants_note", False)
    bench.fetched()
    assert len(noted) == WINDOW // 90


def test_what_the_watcher_asks_for_is_passed_on(tmp_path):
    bench = Bench(tmp_path)
    assert bench.watcher.message_ids < bench.fetcher.message_ids
    assert mavlink.MAVLINK_MSG_ID_HEARTBEAT in bench.fetcher.message_ids
    bench.hear(raw_imu(1))
    bench.armed(False)
    bench.fetcher.estimate(1, "estimate", 2)
    bench.fetcher.notice(3, Severity.INFO, "text")
    (frame, *rest) = bench.watcher.calls
    assert (frame[0], frame[1], frame[2].msg_id) == ("frame", T_NS, 27)
    assert rest == [("estimate", 1, "estimate", 2), ("notice", 3, Severity.INFO, "text")]

"""One turn of the daemon's loop, with a link and a pipeline that note what they are told."""

import os
import socket
from types import SimpleNamespace

import pytest

from h2nav.apps import daemon
from h2nav.apps.daemon import Daemon
from h2nav.integrity.severity import Severity
from h2nav.links.link_statistics import LinkStatistics
from h2nav.maths.units import SECOND_NS
from h2nav.service.effects import Notice

T_NS = 50 * SECOND_NS


class Bench:
    """A daemon on a manual clock; `told` has what the pipeline and systemd were told."""

    def __init__(self, monkeypatch):
        self.now_ns, self.step_ns, self.waits_s, self.told = T_NS, 0, [], []
        self.reader, self.writer = os.pipe()
        self.arriving: list[list] = []  # what each read gives
        self.is_progressing = True
        self.takes_ns = 0  # between the wait and what follows
        self.wake, self.waker = socket.socketpair()
        self.link = SimpleNamespace(
            is_up=True, last_error="no error", has_backlog=False, has_more=False,
            statistics=LinkStatistics(), fileno=lambda: self.reader,
            maintain=lambda t_ns: self.told.append(("maintain", t_ns)), read=self.read,
        )  # fmt: skip
        self.pipeline = SimpleNamespace(
            next_timer_ns=T_NS + SECOND_NS,
            link=self.note("link"), tick=self.note("tick"), received=self.note("received"),
            stalled=self.note("stalled"), note=self.note("note"), report=self.note("report"),
            service=SimpleNamespace(
                is_progressing=lambda t_ns: self.is_progressing,
                health=SimpleNamespace(summary="active"),
            ),
        )  # fmt: skip
        self.manager = SimpleNamespace(
            ready=self.note("ready"),
            alive=self.note("alive"),
            status=self.note("status"),
            stopping=self.note("stopping"),
        )
        clock = SimpleNamespace(step_ns=lambda: self.step_ns)
        self.daemon = Daemon(self.link, self.pipeline, clock, self.manager)
        monkeypatch.setattr(daemon.time, "monotonic_ns", lambda: self.now_ns)
        monkeypatch.setattr(daemon.select, "select", self.select)

    def note(self, name):
        return lambda *words: self.told.append((name, *words))

    def select(self, readers, writers, _, wait_s):
        self.waits_s.append(wait_s)
        self.waited_for = readers, writers
        self.now_ns += self.takes_ns
        return [fd for fd in readers if fd == self.reader and self.arriving], [], []

    def read(self):
        self.link.has_more = len(self.arriving) > 1
        return self.arriving.pop(0)

    def turn(self, later_ns=0):
        self.now_ns += later_ns
        self.told.clear()
        return self.daemon.turn(self.now_ns, self.wake)

    def what(self, name):
        return [words[1:] for words in self.told if words[0] == name]

    def close(self):
        for descriptor in (self.reader, self.writer):
            os.close(descriptor)
        self.wake.close()
        self.waker.close()


@pytest.fixture
def bench(monkeypatch):
    made = Bench(monkeypatch)
    yield made
    monkeypatch.undo()
    made.close()


@pytest.mark.parametrize(
    ("timer_ns", "wait_s"), [(SECOND_NS, 0.1), (30_000_000, 0.03), (0, 0.0), (-SECOND_NS, 0.0)]
)
def test_it_waits_for_the_next_timer_but_no_longer_than_a_tenth_of_a_second(
    bench, timer_ns, wait_s
):
    bench.pipeline.next_timer_ns = T_NS + timer_ns
    bench.turn()
    assert bench.waits_s == [pytest.approx(wait_s)]


def test_a_turn_tells_the_pipeline_of_the_link_first_and_of_the_time_last(bench):
    bench.takes_ns = 1000
    bench.arriving = [[(b"data", None)]]
    assert bench.turn() == T_NS + 1000
    assert [words[0] for words in bench.told][:5] == ["maintain", "link", "received", "tick", "alive"]  # fmt: skip  # noqa: E501
    assert bench.what("maintain") == [(T_NS,)]
    assert bench.what("link") == [(T_NS, True, "no error")]
    assert bench.what("tick") == bench.what("alive") == [(T_NS + 1000,)]


def test_without_progress_the_watchdog_is_not_fed(bench):
    bench.is_progressing = False
    bench.turn()
    assert bench.what("alive") == []


@pytest.mark.parametrize(
    ("descriptor", "has_backlog", "reads", "writes"),
    [(True, False, 2, 0), (True, True, 2, 1), (False, False, 1, 0), (False, True, 1, 0)],
)
def test_it_waits_for_room_only_while_frames_are_queued(
    bench, descriptor, has_backlog, reads, writes
):
    bench.link.has_backlog = has_backlog
    if not descriptor:
        bench.link.fileno = lambda: None
    bench.turn()
    readers, writers = bench.waited_for
    assert (len(readers), len(writers)) == (reads, writes)
    assert readers[0] == bench.wake.fileno()


def test_a_stamp_of_the_kernel_is_the_time_of_arrival_unless_it_is_of_the_future(bench):
    bench.arriving = [
        [(b"a", T_NS - 500), (b"b", None), (b"c", T_NS + 10**9)],
    ]
    bench.turn()
    assert bench.what("received") == [
        (T_NS - 500, b"a", T_NS), (T_NS, b"b", T_NS), (T_NS, b"c", T_NS),
    ]  # fmt: skip


def test_times_of_arrival_never_go_back(bench):
    bench.arriving = [[(b"a", T_NS), (b"b", T_NS - SECOND_NS)]]
    bench.turn()
    assert [words[0] for words in bench.what("received")] == [T_NS, T_NS]


def test_of_a_backlog_eight_reads_are_taken_before_timers_run(bench):
    bench.arriving = [[(bytes([number]), None)] for number in range(20)]
    bench.turn()
    assert len(bench.what("received")) == 8
    bench.turn()
    assert len(bench.what("received")) == 8
    bench.turn()
    assert len(bench.what("received")) == 4
    bench.turn()
    assert bench.what("received") == []


def test_each_second_the_link_is_recorded_and_systemd_has_the_state(bench):
    bench.turn()
    assert bench.what("report") == [(T_NS, LinkStatistics())]
    assert bench.what("status") == [("active",)]
    bench.turn(SECOND_NS - 1)
    assert bench.what("report") == bench.what("status") == []
    bench.turn(1)
    assert len(bench.what("report")) == len(bench.what("status")) == 1
    bench.turn(SECOND_NS - 1)
    assert bench.what("report") == []


@pytest.mark.parametrize(("took_ns", "is_told"), [(400_000_000, False), (400_000_001, True)])
def test_a_turn_that_ended_long_ago_is_a_stall(bench, took_ns, is_told):
    bench.turn()
    assert bench.what("stalled") == []
    bench.turn(took_ns)
    assert bench.what("stalled") == [(T_NS + took_ns, took_ns)] * is_told
    bench.turn()
    assert bench.what("stalled") == []


@pytest.mark.parametrize(
    ("step_ns", "text"),
    [
        (500_000_000, ""),
        (500_000_001, "host clock stepped by +0.5 s"),
        (-500_000_000, ""),
        (-2_000_000_000, "host clock stepped by -2.0 s"),
    ],
)
def test_a_step_of_the_host_clock_is_told_once(bench, step_ns, text):
    bench.step_ns = step_ns
    bench.turn()
    notice = Notice(Severity.NOTICE, text, "host clock stepped")
    assert bench.what("note") == ([(T_NS, notice)] if text else [])
    bench.turn(SECOND_NS)
    assert bench.what("note") == []


def test_small_steps_add_up_to_one_that_is_told(bench):
    bench.step_ns = 400_000_000
    bench.turn()
    assert bench.what("note") == []
    bench.step_ns = 800_000_000
    bench.turn(SECOND_NS)
    ((_, notice),) = bench.what("note")
    assert notice.text == "host clock stepped by +0.8 s"
    bench.step_ns = 1_400_000_000  # 0.6 s more than what was told
    bench.turn(SECOND_NS)
    ((_, notice),) = bench.what("note")
    assert notice.text == "host clock stepped by +0.6 s"


def test_turns_go_on_until_the_time_or_the_signal(bench, monkeypatch):
    intervals = []
    monkeypatch.setattr(daemon.sys, "setswitchinterval", intervals.append)
    monkeypatch.setattr(daemon.gc, "freeze", lambda: intervals.append("frozen"))
    bench.takes_ns = 100_000_000
    stop = SimpleNamespace(stopped=False, wake=bench.wake)
    ends = list(bench.daemon.turns(stop, T_NS + 300_000_000))
    assert ends == [T_NS + n * 100_000_000 for n in (1, 2, 3)]
    assert bench.what("ready") == bench.what("stopping") == [()]
    assert intervals == [1e-4, "frozen"]
    turns = bench.daemon.turns(stop)
    next(turns)
    stop.stopped = True
    assert list(turns) == []

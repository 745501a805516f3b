"""When the log of a flight ends, and when it is reviewed: just enough, and just too little."""

import os
from types import SimpleNamespace

import pytest

from h2nav.apps import configuration, flight_keeper
from h2nav.apps.flight_keeper import FlightKeeper
from h2nav.apps.review_process import ReviewOutcome
from h2nav.flights.folder import UPLOADS, flight_id
from h2nav.integrity.findings import Severity
from h2nav.maths.units import SECOND_NS
from h2nav.service.effects import Notice

NOTHING = ReviewOutcome()
# Our logs: the date of the start, the boot, and a running number.
FIRST, SECOND, THIRD = (f"20250101T120000Z_0123abcd_00000{n}.mcap" for n in (1, 2, 3))
FLIGHT, NEXT_FLIGHT = (flight_id(name.removesuffix(".mcap")) for name in (FIRST, SECOND))


class FakeProcess:
    """A process that ends when a test says so."""

    def __init__(self, _job):
        self.is_running, self.starts, self.stops, self.ended, self.error = False, 0, 0, None, None

    def start(self):
        if self.error is not None:
            raise self.error
        self.starts += 1
        self.is_running = True

    def stop(self):
        self.stops += 1
        self.is_running = False

    def outcome(self):
        ended, self.ended = self.ended, None
        if ended is not None:
            self.is_running = False
        return ended


class FakeRecorder:
    """Begins another log when it is told to, at once or later."""

    def __init__(self, folder):
        self.folder, self.path, self.rolls, self.is_quick = folder, folder / FIRST, 0, True

    def roll(self):
        self.rolls += 1
        if self.is_quick:
            self.path = self.folder / (FIRST, SECOND, THIRD)[self.rolls]


class Bench:
    """A keeper of a folder, looked after ten times a second."""

    def __init__(self, monkeypatch, folder, *, fetcher=None, **flights):
        monkeypatch.setattr(flight_keeper, "ReviewProcess", FakeProcess)
        chosen = configuration.build({"log": {"folder": str(folder)}, "flights": flights}, "a test")
        self.folder, self.recorder, self.told = folder, FakeRecorder(folder), []
        self.keeper = FlightKeeper(
            chosen, self.recorder, lambda *about: self.told.append(about), fetcher
        )
        self.process = self.keeper._process
        self.t_ns, self.is_armed, self.said = 0, False, []

    def run(self, seconds, is_armed=None):
        """Until so many seconds later."""
        self.is_armed = self.is_armed if is_armed is None else is_armed
        end_ns = self.t_ns + round(seconds * SECOND_NS)
        while self.t_ns < end_ns:
            self.t_ns += SECOND_NS // 10
            service = SimpleNamespace(is_armed=self.is_armed)
            self.said += self.keeper.tend(self.t_ns, self.t_ns, service)
        return self

    def fly(self, seconds=10.0):
        return self.run(seconds, is_armed=True)

    def land(self, seconds):
        return self.run(seconds, is_armed=False)

    def end(self, outcome):
        self.process.ended = outcome
        return self.run(0.1)


@pytest.fixture
def bench(monkeypatch, tmp_path):
    return Bench(monkeypatch, tmp_path)


# --- the log ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("seconds", "ends"), [(3.0, False), (3.1, True)])
def test_the_log_of_a_flight_ends_three_seconds_after_disarming(bench, seconds, ends):
    bench.fly().land(seconds)
    assert bench.recorder.rolls == int(ends)
    assert bench.keeper.record.flown == int(ends)
    bench.run(30.0)
    assert bench.recorder.rolls == 1


def test_what_is_armed_again_at_once_is_one_flight(bench):
    bench.fly().land(2.9).fly().land(2.0)
    assert bench.recorder.rolls == 0
    bench.run(2.0)
    assert (bench.recorder.rolls, bench.keeper.record.flown) == (1, 1)


def test_what_was_never_armed_is_no_flight(bench):
    bench.land(60.0)
    assert (bench.recorder.rolls, bench.process.starts, bench.keeper.record.flown) == (0, 0, 0)


@pytest.mark.parametrize("step_ns", [1, 99_999_999])
def test_it_looks_ten_times_a_second(bench, step_ns):
    bench.fly()
    asked = []

    class Service:
        @property
        def is_armed(self):
            asked.append(1)
            return True

    bench.keeper.tend(bench.t_ns + step_ns, 0, Service())
    assert asked == []
    bench.keeper.tend(bench.t_ns + 100_000_000, 0, Service())
    assert asked == [1]


# --- when it is reviewed ----------------------------------------------------------------------


def test_a_flight_is_reviewed_when_its_log_has_ended(bench):
    bench.recorder.is_quick = False
    bench.fly().land(5.0)
    assert bench.process.starts == 0
    assert not bench.keeper.record.is_reviewing
    bench.recorder.path = bench.folder / SECOND
    bench.run(0.2)
    assert bench.process.starts == 1
    assert bench.keeper.record.is_reviewing


@pytest.mark.parametrize(("seconds", "starts"), [(10.0, 0), (10.2, 1)])
def test_a_log_that_does_not_end_is_not_waited_for_longer_than_ten_seconds(bench, seconds, starts):
    bench.recorder.is_quick = False
    bench.fly().land(3.1).run(seconds)
    assert bench.process.starts == starts


def test_no_review_runs_in_flight_and_one_that_did_is_taken_up_again(bench):
    bench.fly().land(3.3)
    assert bench.process.starts == 1
    bench.fly()
    assert (bench.process.stops, bench.process.is_running) == (1, False)
    assert bench.keeper.record.interrupted == 1
    bench.land(2.9)
    assert bench.process.starts == 1
    bench.run(0.5)
    assert bench.process.starts == 2
    assert bench.keeper.record.interrupted == 1


def test_one_review_follows_another_until_nothing_waits(bench):
    bench.fly().land(3.3)
    bench.end(ReviewOutcome("another", "a.bin", severity="info", text="fine")).run(0.3)
    assert bench.process.starts == 2
    bench.end(NOTHING).run(5.0)
    assert bench.process.starts == 2


@pytest.mark.parametrize(
    ("name", "starts"),
    [(FIRST, 1), ("notes.txt", 0), (UPLOADS, 1), (None, 0)],
)
def test_what_former_runs_have_left_is_reviewed(monkeypatch, tmp_path, name, starts):
    if name == UPLOADS:
        (tmp_path / name).mkdir()
    elif name:
        (tmp_path / name).write_bytes(b"")
    assert Bench(monkeypatch, tmp_path).run(5.0).process.starts == starts


def test_a_folder_that_is_not_there_has_no_recordings(monkeypatch, tmp_path):
    assert Bench(monkeypatch, tmp_path / "none").run(30.0).process.starts == 0


@pytest.mark.parametrize("where", [".", UPLOADS])
def test_what_comes_otherwise_is_noticed_every_ten_seconds(monkeypatch, tmp_path, where):
    folder = tmp_path / where
    folder.mkdir(exist_ok=True)
    bench = Bench(monkeypatch, tmp_path)
    bench.run(1.0)
    if where == UPLOADS:
        bench.end(NOTHING)
    before = bench.process.starts
    stamp_ns = folder.stat().st_mtime_ns + 7_000_000
    os.utime(folder, ns=(stamp_ns, stamp_ns))
    bench.run(8.9)
    assert bench.process.starts == before
    bench.run(1.0)
    assert bench.process.starts == before + 1


def test_where_no_reviews_are_wanted_none_begin(monkeypatch, tmp_path):
    bench = Bench(monkeypatch, tmp_path, review=False)
    bench.fly().land(30.0)
    assert (bench.recorder.rolls, bench.process.starts) == (1, 0)


@pytest.mark.parametrize(
    "how",
    ["not started", ReviewOutcome(trouble="no memory"), ReviewOutcome(is_busy=True)],
    ids=["not started", "ended in trouble", "busy"],
)
def test_trouble_that_is_not_a_recordings_is_tried_again_after_a_minute(bench, how):
    if how == "not started":
        bench.process.error = OSError("no memory")
        bench.fly().land(3.3)
        bench.process.error = None
        first = 0
    else:
        bench.fly().land(3.3).end(how)
        first = 1
    bench.run(59.5)
    assert bench.process.starts == first
    bench.run(1.0)
    assert bench.process.starts == first + 1


# --- how it ended -----------------------------------------------------------------------------


def reviewed(flight, **how):
    usual = {"name": "a.mcap", "severity": "warning", "text": "a compass is off"}
    return ReviewOutcome(flight, **usual | how)


@pytest.mark.parametrize(
    ("outcome", "counts", "notice"),
    [
        (
            reviewed(FLIGHT, summary={"errors": 0}),
            (1, 0, 0),
            Notice(Severity.WARNING, "a compass is off", f"flight {FLIGHT}"),
        ),
        (
            reviewed(FLIGHT, summary={"errors": 2}, severity="critical"),
            (1, 0, 1),
            Notice(Severity.CRITICAL, "a compass is off", f"flight {FLIGHT}"),
        ),
        (
            reviewed(FLIGHT, error="too long", text="", severity=""),
            (0, 1, 0),
            Notice(Severity.WARNING, "flight not reviewed: too long", f"flight {FLIGHT}"),
        ),
        (reviewed("another"), (1, 0, 0), None),
        (NOTHING, (0, 0, 0), None),
    ],
)
def test_how_a_review_ended_is_counted_and_that_of_the_last_flight_is_said(
    bench, outcome, counts, notice
):
    bench.fly().land(3.3).end(outcome)
    record = bench.keeper.record
    assert (record.reviewed, record.failed, record.with_errors) == counts
    assert bench.said == ([] if notice is None else [notice])
    if outcome is NOTHING:
        assert bench.told == []
        return
    ((_, about),) = bench.told
    assert (about["id"], about["error"]) == (outcome.flight, outcome.error)
    assert not {"flight", "trouble", "is_busy"} & about.keys()


def test_a_flight_is_said_once(bench):
    bench.fly().land(3.3).end(reviewed(FLIGHT))
    bench.run(0.5).end(reviewed(FLIGHT))
    assert len(bench.said) == 1
    assert len(bench.told) == 2


def test_trouble_is_said_and_no_flight_is_blamed(bench):
    bench.fly().land(3.3).end(ReviewOutcome(trouble="no memory"))
    text = "flights not reviewed: no memory"
    assert bench.said == [Notice(Severity.WARNING, text, "flights not reviewed")]
    assert bench.told == []
    assert bench.keeper.record.failed == 0


def test_of_a_new_flight_the_parts_of_the_one_before_are_not_said(bench):
    bench.fly().land(3.3)
    bench.fly().land(0.5).end(reviewed(FLIGHT))
    assert bench.said == []
    bench.end(reviewed(NEXT_FLIGHT))
    assert len(bench.said) == 1


# --- the autopilot's own logs -----------------------------------------------------------------


class FakeFetcher:
    """Notes what is wanted."""

    def __init__(self):
        self.wanted, self.tended, self.is_closed, self.fetched_bytes = [], 0, False, 4711

    def tend(self, *_):
        self.tended += 1
        return ["from the fetcher"]

    def want(self, t_ns, stem):
        self.wanted.append(stem)

    def close(self):
        self.is_closed = True


def test_the_log_of_the_autopilot_is_fetched_after_each_flight(monkeypatch, tmp_path):
    fetcher = FakeFetcher()
    bench = Bench(monkeypatch, tmp_path, fetcher=fetcher)
    bench.fly().land(3.3)
    assert fetcher.wanted == [FIRST.removesuffix(".mcap")]
    assert bench.keeper.record.fetched_bytes == 4711
    # it is tended more often than the keeper looks
    looked = fetcher.tended
    assert bench.keeper.tend(bench.t_ns + 1, 0, SimpleNamespace()) == ["from the fetcher"]
    assert fetcher.tended == looked + 1
    bench.keeper.close()
    assert fetcher.is_closed
    assert bench.process.stops == 1


def test_without_a_log_nothing_is_fetched(monkeypatch, tmp_path):
    fetcher = FakeFetcher()
    bench = Bench(monkeypatch, tmp_path, fetcher=fetcher)
    bench.recorder.path = None
    bench.recorder.is_quick = False
    bench.fly().land(3.3)
    assert fetcher.wanted == []
    assert bench.keeper.record.flown == 1

"""When a viewer is started, lost, started again and given up; time is what the test says."""

import dataclasses
import os
import socket
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from needs import need_package
from simulated_flight import SimulatedFlight

from h2nav.apps import extras, live_view
from h2nav.apps.configuration import Configuration, LiveSettings, build, warnings
from h2nav.apps.live_view import LOOK_NS, MAX_REFUSED, LiveView
from h2nav.errors import BadInput
from h2nav.integrity.findings import Alarm, Findings, Kind, Sensor, SensorKind, Severity
from h2nav.links.live_feed import FeedReader, Word

need_package("foxglove")
S = 1_000_000_000
LIVE = LiveSettings("127.0.0.1:8080", 8765)


class Viewer:
    """A viewer in this process: it has its end of the feed, and lives until it is ended."""

    def __init__(self, end):
        self.end = end.dup()
        self.reader = FeedReader(self.end)
        self.status = None
        self.was_killed = False
        self.is_stubborn = False

    def poll(self):
        return self.status

    def kill(self):
        self.was_killed = True
        self.ends(-9)

    def wait(self, timeout=None):
        if self.status is None and self.is_stubborn:
            raise subprocess.TimeoutExpired("viewer", timeout)
        self.ends(0 if self.status is None else self.status)
        return self.status

    def ends(self, status):
        self.status = status
        self.end.close()

    def topics(self):
        """What has come since the last time."""
        packets = iter(self.reader.entries, [])
        return [entry.topic for packet in packets for entry in packet]


class Beside:
    """A live view at some time, beside a service that has just begun."""

    def __init__(self, monkeypatch, settings=LIVE):
        self.started = []
        monkeypatch.setattr(live_view, "start_viewer", self._start)
        self.view = LiveView(dataclasses.replace(Configuration(), live=settings))
        self.service = SimulatedFlight("rest").pipeline.service
        self.t_ns = 10 * S

    @property
    def viewer(self):
        return self.started[-1]

    def run(self, seconds):
        """What is said meanwhile."""
        said = []
        end_ns = self.t_ns + round(seconds * S)
        while self.t_ns < end_ns:
            self.t_ns += LOOK_NS
            said += self.view.tend(self.t_ns, self.t_ns, self.service)
            self.view.feed.flush()
        return said

    def _start(self, end):
        self.started.append(Viewer(end))
        return self.viewer


@pytest.fixture
def beside(monkeypatch):
    running = Beside(monkeypatch)
    yield running
    running.view.close()


def test_a_viewer_is_greeted_and_told_how_things_are(beside):
    assert beside.run(0.1) == []
    greeting = beside.viewer.reader.greeting()
    assert greeting[:3] == ("127.0.0.1", 8080, 8765)
    assert greeting.configuration["autopilot"]["imu_rate_hz"] == 100.0
    beside.viewer.topics()
    beside.run(2.0)
    topics = beside.viewer.topics()
    assert topics.count("/status") == 10
    assert topics.count("/feed") == 2


def test_a_viewer_that_comes_late_is_given_what_goes_on(beside):
    ledger = Findings()
    alarm = Alarm(
        Kind.GPS_LOST, Sensor(SensorKind.GPS), Severity.WARNING, 9.0, "s", "no fix", "none"
    )
    ledger.update(5.0, [alarm])
    beside.service = SimpleNamespace(status=beside.service.status, open_findings=ledger.open)
    beside.run(1.0)
    beside.viewer.reader.greeting()
    given = [entry for entry in beside.viewer.reader.entries() if entry.topic == "/finding"]
    assert [entry.record.id for entry in given] == ["gps_lost.gps.1"]
    assert beside.viewer.topics().count("/finding") == 0


def test_where_it_can_be_seen_is_said_once(beside):
    beside.run(0.1)
    beside.viewer.reader.say(Word(8080))
    ((severity, text, _),) = beside.run(0.2)
    assert severity is Severity.INFO
    assert text == "live view at http://127.0.0.1:8080/, Foxglove at ws://127.0.0.1:8765"
    beside.viewer.reader.say(Word(8080, wants_all=True))
    assert beside.run(0.2) == []
    assert beside.view.feed.wants_all


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        (LiveSettings("0.0.0.0:80", 0), "live view at http://0.0.0.0:80/, open to all who"),
        (LiveSettings("[::]:0", 9), "live view at http://[::]:80/, Foxglove at ws://[::]:9, open"),
    ],
)
def test_an_open_address_is_warned_of(monkeypatch, settings, text):
    beside = Beside(monkeypatch, settings)
    beside.run(0.1)
    beside.viewer.reader.say(Word(80))
    ((severity, said, _),) = beside.run(0.2)
    assert severity is Severity.WARNING
    assert said.startswith(text)
    beside.view.close()


def test_a_viewer_that_dies_is_started_again_after_growing_pauses(beside):
    beside.run(0.1)
    pauses_s = []
    for number in range(8):
        beside.viewer.ends(-9)
        start_ns = beside.t_ns
        said = beside.run(0.1)
        assert [one.severity for one in said] == [Severity.WARNING]
        assert "live view lost" in said[0].text
        while len(beside.started) == number + 1:
            assert beside.run(0.1) == []
        pauses_s.append((beside.t_ns - start_ns) / S)
    assert pauses_s == pytest.approx([1, 2, 4, 8, 16, 32, 60, 60], abs=0.21)
    beside.run(61.0)
    beside.viewer.ends(-9)
    beside.run(1.2)
    assert len(beside.started) == 10


def test_a_system_that_starts_nothing_costs_the_view_alone(beside, monkeypatch):
    def refuse(_end):
        raise BlockingIOError(11, "Resource temporarily unavailable")

    with monkeypatch.context() as without:
        without.setattr(live_view, "start_viewer", refuse)
        (said,) = beside.run(0.5)
        assert said.text.startswith("live view cannot be started: Resource temporarily")
    beside.run(1.0)
    assert len(beside.started) == 1


def test_its_last_words_say_why(beside):
    beside.run(0.1)
    beside.viewer.reader.greeting()
    beside.viewer.reader.say(Word(trouble="live.address: 127.0.0.1:8080: Address already in use"))
    beside.viewer.ends(1)
    (said,) = beside.run(0.1)
    assert said.text == (
        "live view lost: live.address: 127.0.0.1:8080: Address already in use; it is started again"
    )


def test_one_that_reads_no_more_is_ended_and_another_started(beside):
    beside.run(0.1)
    seconds = 0
    while not (said := beside.run(1.0)):
        for number in range(400):
            beside.view.feed.text(number, 1, "x" * 1000)
            beside.view.feed.flush()
        seconds += 1
        assert seconds < 10
    assert "has stopped reading" in said[0].text
    assert beside.started[0].was_killed
    beside.run(2.0)
    assert len(beside.started) == 2
    assert beside.view.feed.refused < MAX_REFUSED


def test_one_that_talks_nonsense_is_ended(beside):
    beside.run(0.1)
    beside.viewer.end.send(b"{}")
    (said,) = beside.run(0.1)
    assert "sent an invalid message" in said.text
    assert beside.viewer.was_killed


@pytest.mark.parametrize("is_stubborn", [False, True])
def test_at_the_end_it_is_waited_for_a_little(beside, is_stubborn):
    beside.run(0.1)
    beside.viewer.is_stubborn = is_stubborn
    beside.view.close()
    assert beside.viewer.was_killed is is_stubborn
    assert beside.viewer.status is not None


def test_a_missing_package_is_named_with_its_extra():
    with pytest.raises(BadInput, match=r"live.address: needs the extra live \(no_such is not in"):
        extras.require_installed("live", "live.address", "json", "no_such")


@pytest.mark.parametrize(
    ("section", "complaint"),
    [
        ({"address": "8080"}, "live.address: '8080' is not HOST:PORT"),
        ({"address": "[::1]:99999"}, "is not HOST:PORT"),
        (
            {"address": "127.0.0.1:8765"},
            "live.foxglove_port: 8765 is also the port of live.address",
        ),
        ({"foxglove_port": 65536}, "live.foxglove_port"),
        ({"adress": "127.0.0.1:80"}, "live.adress"),
    ],
)
def test_what_cannot_work_is_told_with_key_and_remedy(section, complaint):
    with pytest.raises(BadInput) as refused:
        build({"live": section}, "x.yaml")
    (line,) = refused.value.lines
    assert line.startswith("x.yaml: ")
    assert complaint in line


def test_an_address_that_others_reach_is_warned_of():
    def warned(address):
        return warnings(build({"live": {"address": address}}, "x.yaml"))

    assert warned("") == warned("127.0.0.1:8080") == warned("[::1]:8080") == []
    ((line),) = warned("0.0.0.0:8080")
    assert line.startswith("live.address: 0.0.0.0:8080 shows")


def test_a_viewer_is_a_module_that_hears_the_feed_and_says_nothing(monkeypatch):
    started = []
    monkeypatch.setattr(live_view, "start_module", lambda *a, **k: started.append((a, k)) or "it")
    ours, theirs = socket.socketpair()
    with ours, theirs:
        assert live_view.start_viewer(theirs) == "it"
        nowhere = subprocess.DEVNULL
        streams = {"stdin": theirs.fileno(), "stdout": nowhere, "stderr": nowhere}
        assert started == [(("h2nav.live",), streams)]


def test_without_its_packages_there_is_no_view(monkeypatch):
    asked = []

    def missing(*words):
        asked.append(words)
        raise BadInput("live.address: needs the extra live")

    monkeypatch.setattr(extras, "require_installed", missing)
    with pytest.raises(BadInput, match="needs the extra live"):
        LiveView(dataclasses.replace(Configuration(), live=LIVE))
    assert asked == [("live", "live.address", "foxglove", "prometheus_client", "tornado")]


def test_the_greeting_has_the_record_of_flights_its_token_and_the_largest_upload(
    monkeypatch, tmp_path
):
    sections = {
        "log": {"folder": "/logs"},
        "flights": {"upload_mb": 3, "token_file": str(tmp_path / "token")},
    }
    made = build({"live": {"address": "127.0.0.1:80"}, **sections}, "x")
    beside = Beside(monkeypatch)
    beside.view.close()
    beside.view = LiveView(made)
    beside.run(0.1)
    greeting = beside.viewer.reader.greeting()
    assert greeting[4:] == ("/logs", (tmp_path / "token").read_text().strip(), 3 << 20)
    beside.view.close()


def test_it_is_looked_after_ten_times_a_second(beside):
    beside.run(0.1)
    looks = []
    beside.view.feed.words = lambda: looks.append(1) or ()
    for later_ns in (LOOK_NS - 1, LOOK_NS, 2 * LOOK_NS - 1, 2 * LOOK_NS):
        beside.view.tend(beside.t_ns + later_ns, 0, beside.service)
    assert len(looks) == 2


@pytest.mark.parametrize(("refused", "is_lost"), [(150, False), (151, True)])
def test_half_a_minute_of_packets_that_are_not_read_is_too_much(
    beside, monkeypatch, refused, is_lost
):
    beside.run(0.1)
    monkeypatch.setattr(beside.view.feed, "refused", refused)
    said = beside.view.tend(beside.t_ns + LOOK_NS, 0, beside.service)
    assert [one.text for one in said] == (
        ["live view lost: it has stopped reading; it is started again"] if is_lost else []
    )


def test_what_the_daemon_needs_is_shown(beside):
    beside.view.feed.want_all(True)
    packets, dropped, wants_all, cpu_s, memory_bytes = beside.view._record()
    assert (packets, dropped, wants_all) == (beside.view.feed.packets, 0, True)
    assert 0.0 < cpu_s <= time.process_time()
    status = Path("/proc/self/status").read_text()
    resident_kib = int(status.partition("VmRSS:")[2].split()[0])
    assert memory_bytes == pytest.approx(resident_kib * 1024, rel=0.1)


def test_a_view_that_cannot_be_started_leaves_no_socket_open(beside, monkeypatch):
    def refuse(_end):
        raise OSError("odd")

    monkeypatch.setattr(live_view, "start_viewer", refuse)
    before = len(os.listdir("/proc/self/fd"))
    (said,) = beside.view.tend(beside.t_ns, 0, beside.service)
    assert said == (
        Severity.WARNING, "live view cannot be started: odd; tried again later",
        "live view not started",
    )  # fmt: skip
    assert len(os.listdir("/proc/self/fd")) == before

"""What a scan does when: on made links, and on a clock that passes where the scan waits."""

import itertools
from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.links import link_scan
from h2nav.links.link_scan import BAUDS, Hearing, LinkPlace, scan, serial_place
from h2nav.links.received import Received
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer
from h2nav.wire.vehicle import Firmware, Heartbeat

UART = serial_place("/dev/ttyAMA0")
USB = serial_place("/dev/ttyACM0")
VEHICLE = mavlink.MAVLink_heartbeat_message(
    mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, 0, 0, 4, 3
)
STATION = mavlink.MAVLink_heartbeat_message(
    mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3
)
IMU = mavlink.MAVLink_raw_imu_message(0, 0, 0, -1000, 0, 0, 0, 0, 0, 0)
VERSION = mavlink.MAVLink_autopilot_version_message(0, 0x040507FF, 0, 0, 0, *[[0] * 8] * 3, 0, 0, 0)

Arrivals = Callable[[str, float], bytes]


class Bench:
    """Links whose bytes are those of a function of URL and time; what is written to them."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, arrivals: Arrivals, error: str = ""
    ) -> None:
        self.now_ns, self.arrivals, self.error = 10_000_000_000, arrivals, error
        self.opened: list[str] = []
        self.written: list[tuple[float, str, tuple[int, int], str, tuple[int, int]]] = []
        self.open_links = 0
        self.progress: list[tuple[int, int]] = []
        monkeypatch.setattr(link_scan, "open_link", self._open)
        monkeypatch.setattr(link_scan.time, "monotonic_ns", lambda: self.now_ns)
        monkeypatch.setattr(link_scan.select, "select", self._wait)

    @property
    def now_s(self) -> float:
        return (self.now_ns - 10_000_000_000) / 1e9

    def _wait(self, _readers: object, _writers: object, _failing: object, timeout_s: float) -> None:
        self.now_ns += round(1e9 * timeout_s)

    def _open(self, url: str) -> "MadeLink":
        self.opened.append(url)
        self.open_links += 1
        return MadeLink(self, url)

    def scan(self, *places: LinkPlace) -> list[Hearing]:
        found = scan(places, lambda done, total: self.progress.append((done, total)))
        assert self.open_links == 0
        return found


class MadeLink:
    def __init__(self, bench: Bench, url: str) -> None:
        self._bench, self.url, self._since_s = bench, url, bench.now_s
        self.is_up = not bench.error
        self.last_error = f"{url}: {bench.error}" if bench.error else ""

    def fileno(self) -> int | None:
        return None

    def maintain(self, _t_ns: int) -> None:
        pass

    def read(self) -> list[Received]:
        data = self._bench.arrivals(self.url, self._bench.now_s)
        return [Received(data)] if data else []

    def write(self, data: bytes) -> bool:
        (frame,) = Deframer().feed(data)
        fields = decode(frame)
        target = getattr(fields, "target_system", 0), getattr(fields, "target_component", 0)
        sender = frame.sysid, frame.compid
        name = type(fields).__name__
        self._bench.written.append((round(self._bench.now_s, 2), self.url, sender, name, target))
        return True

    def close(self) -> None:
        self._bench.open_links -= 1


def nothing(_url: str, _now_s: float) -> bytes:
    return b""


def turns(now_s: float) -> int:
    """The scan looks twenty times a second."""
    return round(20 * now_s)


class Vehicle:
    """Says something at some turns; each frame has its own number."""

    def __init__(self, sender: tuple[int, int] = (1, 1), at: str = "") -> None:
        self._encoder, self._at = Encoder(*sender), at
        self.at_turn: dict[int, list[object]] = {}
        self.every: dict[int, object] = {}

    def __call__(self, url: str, now_s: float) -> bytes:
        if self._at not in url:
            return b"junk"
        turn = turns(now_s)
        said = [*self.at_turn.get(turn, ())]
        said += [message for period, message in self.every.items() if turn % period == 0]
        return b"".join(self._encoder.encode(message) for message in said)


def test_a_silent_port_is_listened_to_once_and_nothing_is_sent(monkeypatch):
    bench = Bench(monkeypatch, nothing)
    (hearing,) = bench.scan(UART)
    assert hearing == (UART, f"serial:/dev/ttyAMA0:{BAUDS[0]}", (), 0, 0, "")
    assert not hearing.is_junk
    assert (len(bench.opened), bench.written) == (1, [])
    assert bench.now_s == pytest.approx(1.7, abs=0.06)


def test_a_silent_usb_autopilot_is_woken_once(monkeypatch):
    bench = Bench(monkeypatch, nothing)
    (hearing,) = bench.scan(USB)
    url = "serial:/dev/ttyACM0:921600"
    assert (hearing.url, bench.opened) == (url, [url])
    ((at_s, *rest),) = bench.written
    assert rest == [url, (1, 191), "HEARTBEAT", (0, 0)]
    assert at_s == pytest.approx(1.65, abs=0.06)
    assert bench.now_s == pytest.approx(3.35, abs=0.11)


def test_a_usb_autopilot_that_wakes_up_is_heard(monkeypatch):
    vehicle = Vehicle()
    vehicle.at_turn = {turn: [VEHICLE] for turn in range(50, 200, 20)}
    (hearing,) = Bench(monkeypatch, vehicle).scan(USB)
    assert [speaker.address for speaker in hearing.speakers] == [(1, 1)]


def test_bytes_that_are_no_frames_are_tried_at_every_rate(monkeypatch):
    bench = Bench(monkeypatch, lambda _url, _now_s: b"junk")
    (hearing,) = bench.scan(UART)
    assert bench.opened == list(UART.urls)
    assert (hearing.is_junk, hearing.frames, hearing.url) == (True, 0, UART.urls[-1])
    assert hearing.bytes_in % 4 == 0
    assert bench.now_s == pytest.approx(8 * 1.7, abs=0.5)


def test_a_port_that_does_not_open_says_why_without_its_name(monkeypatch):
    bench = Bench(monkeypatch, nothing, "another program has it open")
    (hearing,) = bench.scan(USB)
    assert hearing.error == "another program has it open"
    assert (len(bench.opened), bench.written) == (1, [])


def test_rates_are_those_of_three_seconds_after_the_first_heartbeat(monkeypatch):
    vehicle = Vehicle((7, 2), "460800")
    vehicle.every = {20: VEHICLE, 2: IMU}
    bench = Bench(monkeypatch, vehicle)
    (hearing,) = bench.scan(UART)
    assert hearing.url == UART.urls[3]
    (speaker,) = hearing.speakers
    assert speaker[:3] == ((7, 2), Heartbeat(mavlink.MAV_AUTOPILOT_PX4, 2, False), None)
    rates = speaker.rates_hz
    assert rates[mavlink.MAVLINK_MSG_ID_RAW_IMU] == pytest.approx(10.0, rel=0.07)
    assert rates[mavlink.MAVLINK_MSG_ID_HEARTBEAT] == pytest.approx(1.0, rel=0.4)
    assert list(rates) == sorted(rates)
    assert hearing.frames == pytest.approx(3 * 11, abs=4)
    assert bench.now_s == pytest.approx(3 * 1.7 + 3.1, abs=1.1)
    # Every second, as the autopilot with that system id would know it.
    assert {row[1:] for row in bench.written} == {(UART.urls[3], (7, 191), "COMMAND_LONG", (7, 2))}
    times_s = [row[0] for row in bench.written]
    assert [b - a for a, b in itertools.pairwise(times_s)] == [pytest.approx(1.0)] * 2


def test_a_version_is_asked_for_until_it_comes(monkeypatch):
    vehicle = Vehicle()
    vehicle.at_turn = {1: [VEHICLE], 30: [VERSION]}
    bench = Bench(monkeypatch, vehicle)
    (hearing,) = bench.scan(UART)
    assert hearing.speakers[0].firmware == Firmware("4.5.7", "")
    assert len(bench.written) == 2


@pytest.mark.parametrize(
    ("said", "frames", "is_heard"),
    [([], 1, False), ([IMU], 2, True), ([STATION], 2, True)],
)
def test_one_frame_may_be_noise_and_two_are_none(monkeypatch, said, frames, is_heard):
    vehicle = Vehicle()
    vehicle.at_turn = {1: [STATION, *said]}
    bench = Bench(monkeypatch, vehicle)
    (hearing,) = bench.scan(LinkPlace("udpin", ("udpin:0.0.0.0:14550",)))
    assert (hearing.frames, hearing.speakers) == (frames, ())
    assert bench.now_s == pytest.approx(3.15 if is_heard else 1.7, abs=0.06)
    assert bench.written == []


@pytest.mark.parametrize("sender", [(0, 1), (1, 0)])
def test_an_address_of_everybody_is_no_autopilot(monkeypatch, sender):
    vehicle = Vehicle(sender)
    vehicle.every = {5: VEHICLE}
    (hearing,) = Bench(monkeypatch, vehicle).scan(UART)
    assert hearing.speakers == ()
    assert hearing.frames > 2


def test_several_autopilots_are_sorted_and_have_their_own_rates(monkeypatch):
    second, first = Vehicle((2, 1)), Vehicle((1, 1))
    second.every, first.every = {10: VEHICLE}, {10: VEHICLE, 4: IMU}
    bench = Bench(monkeypatch, lambda url, now_s: second(url, now_s) + first(url, now_s))
    (hearing,) = bench.scan(UART)
    assert [speaker.address for speaker in hearing.speakers] == [(1, 1), (2, 1)]
    assert [mavlink.MAVLINK_MSG_ID_RAW_IMU in s.rates_hz for s in hearing.speakers] == [True, False]


def test_places_are_scanned_at_once_and_their_end_is_told(monkeypatch):
    quick = LinkPlace("udpin", ("udpin:0.0.0.0:14550",))
    bench = Bench(monkeypatch, nothing)
    hearings = bench.scan(USB, quick)
    assert [hearing.place for hearing in hearings] == [USB, quick]
    assert bench.opened == [USB.urls[0], quick.urls[0]]
    assert sorted(set(bench.progress)) == [(0, 2), (1, 2), (2, 2)]
    assert bench.progress[-1] == (2, 2)


def test_the_usual_rates_are_tried_first():
    assert [url.rsplit(":", 1)[1] for url in UART.urls][:3] == ["57600", "115200", "921600"]
    assert [url.rsplit(":", 1)[1] for url in USB.urls][:3] == ["921600", "57600", "115200"]
    assert (UART.name, UART.is_usb_autopilot, USB.is_usb_autopilot) == ("/dev/ttyAMA0", False, True)

import pytest

from h2nav.links.frame_queue import QUEUE_BYTES
from h2nav.links.received import Received
from h2nav.links.stream_link import OPEN_TIMEOUT_NS, StreamLink

MS = 1_000_000


class FakeTransport:
    """A byte stream whose behaviour the test sets: absent, opening, full, gone."""

    def __init__(self) -> None:
        self.present = True
        self.ready = True
        self.room = 1 << 30
        self.sent = b""
        self.incoming = b""
        self.starts = 0
        self.is_open = False

    def start(self) -> None:
        self.starts += 1
        if not self.present:
            raise FileNotFoundError("no such device")

    def is_ready(self) -> bool:
        self.is_open = self.ready
        return self.ready

    def fileno(self) -> int:
        return 99

    def receive(self) -> bytes:
        if not self.present:
            raise ConnectionResetError("gone")
        data, self.incoming = self.incoming, b""
        return data

    def send(self, data: bytes) -> int:
        if not self.present:
            raise BrokenPipeError("gone")
        taken = data[: self.room]
        self.room -= len(taken)
        self.sent += taken
        return len(taken)

    def close(self) -> None:
        self.is_open = False


@pytest.fixture
def transport() -> FakeTransport:
    return FakeTransport()


@pytest.fixture
def link(transport: FakeTransport) -> StreamLink:
    return StreamLink("serial:/dev/fake:115200", transport)


def test_absent_device_is_tried_with_growing_delays(
    link: StreamLink, transport: FakeTransport
) -> None:
    transport.present = False
    for ms in range(10_000):
        link.maintain(ms * MS)
    # 0, 0.1, 0.3, 0.7, 1.5 s, then once a second.
    assert transport.starts == 13
    assert link.statistics.errors == 13
    assert link.last_error == "no such device"
    assert not link.is_up
    assert link.fileno() is None


def test_returning_device_is_open_within_a_second_and_starts_anew(
    link: StreamLink, transport: FakeTransport
) -> None:
    transport.present = False
    for ms in range(10_000):
        link.maintain(ms * MS)
    transport.present = True
    for ms in range(10_000, 11_001):
        link.maintain(ms * MS)
    assert link.is_up
    transport.incoming = b"data"
    assert link.read() == [Received(b"data")]
    assert link.has_more
    transport.present = False
    assert link.read() == []
    assert not link.has_more
    assert not link.is_up
    transport.present = True
    link.maintain(11_000 * MS + 100 * MS)
    assert link.is_up
    assert link.statistics.opened == 2


def test_link_that_breaks_at_once_each_time_does_not_spin(
    link: StreamLink, transport: FakeTransport
) -> None:
    for ms in range(10_000):
        transport.present = True
        link.maintain(ms * MS)
        transport.present = False
        link.read()
    assert transport.starts == 13


def test_opening_that_never_ends_times_out(link: StreamLink, transport: FakeTransport) -> None:
    transport.ready = False
    link.maintain(0)
    link.maintain(OPEN_TIMEOUT_NS - 1)
    assert link.statistics.errors == 0
    link.maintain(OPEN_TIMEOUT_NS)
    assert link.statistics.errors == 1
    assert "no answer within 3 s" in link.last_error
    assert transport.starts == 1


def test_only_whole_frames_leave_and_old_ones_are_dropped(
    link: StreamLink, transport: FakeTransport
) -> None:
    link.maintain(0)
    frames = [bytes([number]) * 100 for number in range(200)]
    transport.room = 150
    assert all(link.write(frame) for frame in frames)
    assert link.has_backlog
    transport.room = 1 << 30
    link.maintain(1)
    assert not link.has_backlog
    kept = QUEUE_BYTES // 100
    assert transport.sent == b"".join(frames[:2] + frames[-kept:])
    statistics = link.statistics
    assert statistics.frames_dropped == 200 - 2 - kept
    assert statistics.frames_out == 200
    assert statistics.bytes_out == len(transport.sent)


def test_rest_of_a_begun_frame_does_not_lead_the_next_connection(
    link: StreamLink, transport: FakeTransport
) -> None:
    link.maintain(0)
    transport.room = 10
    link.write(b"A" * 30)
    transport.present = False
    link.maintain(1)
    assert not link.is_up
    transport.present, transport.room, transport.sent = True, 1000, b""
    link.maintain(200 * MS)
    assert link.write(b"B" * 30)
    assert transport.sent == b"B" * 30


def test_write_to_a_link_that_is_down_or_breaks(link: StreamLink, transport: FakeTransport) -> None:
    assert not link.write(b"x")
    link.maintain(0)
    transport.present = False
    assert not link.write(b"x")
    assert not link.is_up
    assert link.statistics.frames_dropped == 2

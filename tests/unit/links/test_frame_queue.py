from h2nav.links.frame_queue import FrameQueue


class SlowStream:
    """Takes `room` bytes, then none until room is made."""

    def __init__(self) -> None:
        self.taken = b""
        self.room = 0

    def send(self, data: bytes) -> int:
        count = min(self.room, len(data))
        self.room -= count
        self.taken += data[:count]
        return count


def test_everything_goes_in_order_while_there_is_room() -> None:
    queue, stream = FrameQueue(), SlowStream()
    stream.room = 100
    assert queue.push(b"abc") == 0
    assert queue.push(b"def") == 0
    assert queue.send(stream.send) == 6
    assert stream.taken == b"abcdef"
    assert not queue


def test_oldest_whole_frames_are_dropped_and_a_begun_one_is_finished() -> None:
    queue, stream = FrameQueue(limit_bytes=8), SlowStream()
    queue.push(b"AAAA")
    stream.room = 1
    assert queue.send(stream.send) == 1
    assert queue.push(b"BBBB") == 0
    assert queue.push(b"CCCC") == 0
    assert queue.push(b"DDDD") == 1
    stream.room = 100
    queue.send(stream.send)
    assert stream.taken == b"AAAACCCCDDDD"


def test_frame_larger_than_the_queue_is_dropped_itself() -> None:
    queue = FrameQueue(limit_bytes=4)
    assert queue.push(b"12345") == 1
    assert not queue


def test_clear_forgets_a_begun_frame_too() -> None:
    queue, stream = FrameQueue(), SlowStream()
    queue.push(b"AAAA")
    queue.push(b"BBBB")
    stream.room = 2
    queue.send(stream.send)
    assert queue.clear() == 2
    stream.room = 100
    assert queue.send(stream.send) == 0
    assert stream.taken == b"AA"

"""Text is written at once or not at all, and nobody is waited for."""

import io
import os
import select
import tty

import pytest

from h2nav.apps.voice import ROOM_BYTES, Voice


@pytest.fixture
def pipe():
    """The end of a pipe that is read, a voice at the other, and its descriptor."""
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as end, os.fdopen(writing, "w") as stream:
        yield end, Voice(stream), writing


def read(descriptor, count=65_536):
    """What has been written; fails where nothing comes."""
    assert select.select([descriptor], [], [], 5.0)[0]
    return os.read(descriptor, count)


def filled(descriptor):
    """Fills what a descriptor holds; how much that was."""
    os.set_blocking(descriptor, False)
    count = 0
    try:
        while True:
            count += os.write(descriptor, b"." * 512)
    except BlockingIOError:
        return count
    finally:
        os.set_blocking(descriptor, True)


def test_what_is_written_is_there_at_once(pipe):
    end, voice, _ = pipe
    assert voice.say("one\n") is True
    assert read(end.fileno()) == b"one\n"


def test_into_a_full_pipe_nothing_is_written_and_later_all(pipe):
    end, voice, descriptor = pipe
    count = filled(descriptor)
    assert voice.say("lost\n") is False
    while count:
        count -= len(read(end.fileno(), count))
    assert voice.say("heard\n") is True
    assert read(end.fileno()) == b"heard\n"


@pytest.mark.parametrize(("size", "is_said"), [(ROOM_BYTES, True), (ROOM_BYTES + 1, False)])
def test_a_pipe_promises_room_for_so_much_and_no_more(pipe, size, is_said):
    assert pipe[1].say("x" * size) is is_said


def test_a_reader_that_is_gone_ends_it_without_an_error(pipe):
    end, voice, _ = pipe
    end.close()
    assert voice.say("one\n") is False
    assert voice.say("two\n") is False


def test_a_buffer_takes_everything():
    stream = io.StringIO()
    assert Voice(stream).say("x" * (ROOM_BYTES + 1)) is True
    assert len(stream.getvalue()) == ROOM_BYTES + 1


def test_a_terminal_that_stands_still_gets_the_rest_of_a_text_before_the_next_one():
    screen, keyboard = os.openpty()
    tty.setraw(keyboard)
    with os.fdopen(keyboard, "w") as stream:
        voice = Voice(stream)
        count = filled(keyboard)
        count -= len(read(screen, 600))
        text = "y" * 100_000
        assert voice.say(text) is True  # begun
        assert voice.say("lost\n") is False
        shown = b""
        while not voice.say("next\n"):
            shown += read(screen)
        while not shown.endswith(b"next\n"):
            shown += read(screen)
        assert shown[count:].decode() == text + "next\n"
    os.close(screen)


def test_a_terminal_that_is_gone_ends_it_without_an_error():
    screen, keyboard = os.openpty()
    with os.fdopen(keyboard, "w") as stream:
        voice = Voice(stream)
        os.close(screen)
        assert voice.say("one\n") is False
        assert voice.say("two\n") is False

import os
import resource
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from link_drivers import Clock, bring_up
from pseudo_devices import PseudoDevice

from h2nav.errors import BadInput
from h2nav.links.links import Link, open_link

KINDS = ["udpin", "udpout", "tcp", "serial"]


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture(params=KINDS)
def link(request: pytest.FixtureRequest, stack: ExitStack, tmp_path: Path) -> Link:
    """A link of each kind, still down, whose other end is there."""
    if request.param == "serial":
        device = PseudoDevice(tmp_path / "tty")
        device.plug()
        stack.callback(device.unplug)
        url = f"serial:{device.path}:115200"
    elif request.param == "tcp":
        listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        url = f"tcp:127.0.0.1:{listener.getsockname()[1]}"
    else:
        url = f"{request.param}:127.0.0.1:{0 if request.param == 'udpin' else 9}"
    link = open_link(url)
    stack.callback(link.close)
    assert link.url == url
    return link


@contextmanager
def no_descriptor_left() -> Iterator[None]:
    """The process may open nothing more (EMFILE)."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    spare = os.dup(0)
    os.close(spare)
    resource.setrlimit(resource.RLIMIT_NOFILE, (spare, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_every_kind_is_quiet_while_down(link: Link) -> None:
    assert not link.is_up
    assert link.fileno() is None
    assert link.local_port is None
    assert not link.has_backlog
    assert link.read() == []
    assert not link.write(b"frame")
    assert link.statistics.frames_dropped == 1
    assert link.last_error == ""
    link.close()


def test_every_kind_survives_a_process_without_descriptors(link: Link) -> None:
    clock = Clock()
    with no_descriptor_left():
        for _ in range(30):
            link.maintain(clock.advance(100))
            assert not link.is_up
    assert link.statistics.errors == 6  # at 0, 0.1, 0.3, 0.7, 1.5, 2.5 s: it does not spin
    assert "Too many open files" in link.last_error
    clock.advance(1000)
    bring_up(link, clock)
    assert link.statistics.opened == 1


def test_every_kind_can_be_closed_and_comes_back(link: Link) -> None:
    clock = Clock()
    for opened in (1, 2, 3):
        bring_up(link, clock)
        descriptor = link.fileno()
        assert descriptor is not None
        assert link.statistics.opened == opened
        link.close()
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(descriptor)
        clock.advance(1000)
    assert link.statistics.errors == 0


def test_bad_url_is_refused_at_once() -> None:
    with pytest.raises(BadInput, match="'bluetooth' is not a kind of link"):
        open_link("bluetooth:00:11:22")

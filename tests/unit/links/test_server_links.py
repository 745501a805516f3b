"""The autopilot's ends of stream links: a pseudo-terminal behind a link, a listening TCP port."""

import os
import select
import socket

import pytest
from link_drivers import read

from h2nav.errors import BadInput
from h2nav.links.links import open_link
from h2nav.links.server_links import PtyTransport, open_server_link
from h2nav.links.stream_link import StreamLink

SECOND = 1_000_000_000


def up(link):
    """The link, opened."""
    for i in range(100):
        link.maintain(i * SECOND)
        if link.is_up:
            return link
    raise AssertionError(link.last_error)


def arrived(link):
    """What the link reads next; waits for it."""
    for i in range(100, 200):
        link.maintain(i * SECOND)
        select.select([link.fileno()], [], [], 0.2)
        data = b"".join(read(link))
        if data:
            return data
    raise AssertionError("nothing has arrived")


def test_serial_link_of_the_daemon_talks_to_the_pty(tmp_path):
    path = tmp_path / "ttyFAKE"
    ours = up(open_server_link(f"pty:{path}"))
    theirs = up(open_link(f"serial:{path}:115200"))
    every_byte = bytes(range(256))
    assert ours.write(every_byte)
    assert arrived(theirs) == every_byte
    assert theirs.write(every_byte[::-1])
    assert arrived(ours) == every_byte[::-1]
    theirs.close()
    ours.close()
    assert not path.is_symlink()


def test_readers_that_come_and_go_cost_no_descriptors(tmp_path):
    path = tmp_path / "ttyFAKE"
    ours = up(open_server_link(f"pty:{path}"))
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(5):
        os.close(os.open(path, os.O_RDWR | os.O_NOCTTY))
        assert ours.read() == []
    assert len(os.listdir("/proc/self/fd")) == before
    ours.close()


def test_a_reader_that_leaves_gets_a_new_terminal_behind_the_same_link(tmp_path):
    path = tmp_path / "ttyFAKE"
    ours = up(open_server_link(f"pty:{path}"))
    node = os.readlink(path)
    os.close(os.open(path, os.O_RDWR | os.O_NOCTTY))
    assert ours.read() == []
    assert os.readlink(path) != node
    # Nobody there yet: neither readable nor hung up, so that no loop spins.
    assert select.select([ours.fileno()], [], [], 0)[0] == []
    again = up(open_link(f"serial:{path}:57600"))
    ours.write(b"hello")
    assert arrived(again) == b"hello"
    again.close()
    ours.close()


def test_what_is_written_just_before_closing_is_read(tmp_path):
    path = tmp_path / "ttyFAKE"
    ours = up(open_server_link(f"pty:{path}"))
    for size in range(1, 2000, 97):
        node = os.readlink(path)
        theirs = os.open(path, os.O_RDWR | os.O_NOCTTY)
        os.write(theirs, bytes(size))
        os.close(theirs)
        arrived = []
        while os.readlink(path) == node:
            arrived += read(ours)
        assert b"".join(arrived) == bytes(size)
    ours.close()


def test_what_nobody_reads_is_lost_without_growing(tmp_path):
    ours = up(open_server_link(f"pty:{tmp_path / 'ttyFAKE'}"))
    for _ in range(5000):
        ours.write(bytes(100))
    assert ours.is_up
    assert ours.statistics.frames_dropped > 1000
    ours.close()


def test_a_file_that_is_no_link_is_not_replaced(tmp_path):
    path = tmp_path / "precious"
    path.write_text("data")
    link = StreamLink("pty", PtyTransport(str(path)))
    link.maintain(0)
    assert not link.is_up
    assert "exists" in link.last_error
    assert path.read_text() == "data"


def test_tcp_port_serves_the_next_client_after_the_first():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    server = up(open_server_link(f"tcpin:127.0.0.1:{port}"))
    assert server.write(b"lost")
    for number in range(2):
        with socket.create_connection(("127.0.0.1", port)) as client:
            client.sendall(b"question %d" % number)
            assert arrived(server) == b"question %d" % number
            server.write(b"answer")
            assert client.recv(100) == b"answer"
    server.close()


@pytest.mark.parametrize("url", ["pty:relative/path", "pty:", "tcpin:nowhere", "smoke:1"])
def test_bad_urls(url):
    with pytest.raises(BadInput, match="URL"):
        open_server_link(url)

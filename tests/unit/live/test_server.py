"""The port of the page: what it serves, what it refuses, and whom it hangs up on."""

import contextlib
import itertools
import json
import time

import pytest
from live_records import UNIX_NS, WAIT_S, estimate, flying_state, served

from h2nav import __version__
from h2nav.integrity.severity import Severity
from h2nav.live import server as live_server


@pytest.fixture
def page(caplog):
    with served(flying_state()) as running:
        yield running
    assert not caplog.records  # whatever others send, nothing is worth a line in the journal


def exchange(page, request, *, host="127.0.0.1"):
    """Status, headers and body of the answer to one request on a connection of its own."""
    with page.connect() as connection:
        connection.sendall(
            f"{request} HTTP/1.1\r\nHost: {host}:{page.port}\r\nConnection: close\r\n\r\n".encode()
        )
        answer = b"".join(iter(lambda: connection.recv(65536), b""))
    head, _, body = answer.partition(b"\r\n\r\n")
    first, *lines = head.decode().split("\r\n")
    return int(first.split()[1]), dict(line.split(": ", 1) for line in lines), body


def events(connection):
    """The events of a stream, as they come."""
    with connection.makefile("rb") as lines:
        for line in lines:
            if line.startswith(b"event: "):
                name = line[7:].strip().decode()
                yield name, json.loads(next(lines).removeprefix(b"data: "))


def listening(page):
    connection = page.connect()
    connection.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
    return connection


def until(condition):
    end = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def is_hung_up_on(connection):
    """Reads to the end of what comes."""
    with contextlib.suppress(ConnectionResetError):
        while connection.recv(65536):
            pass
    return True


@pytest.mark.parametrize(
    ("path", "kind", "part"),
    [
        ("/", "text/html", b"<title>h2nav</title>"),
        ("/page.js", "text/javascript", b"EventSource"),
        ("/page.css", "text/css", b"body"),
        ("/icon.svg", "image/svg+xml", b"<svg"),
        ("/metrics", "text/plain", b"h2nav_samples_used_total 2000.0"),
    ],
)
def test_it_serves_the_page_and_the_metrics(page, path, kind, part):
    status, headers, body = exchange(page, f"GET {path}")
    assert status == 200
    assert headers["Content-Type"].startswith(kind)
    assert part in body
    policy = headers["Content-Security-Policy"]
    assert policy.startswith("default-src 'none'")
    assert "unsafe" not in policy
    assert headers["X-Content-Type-Options"] == "nosniff"


def test_blueos_finds_the_page_among_its_services(page):
    status, headers, body = exchange(page, "GET /register_service")
    assert status == 200
    assert headers["Content-Type"].startswith("application/json")
    told = json.loads(body)
    assert told["name"] == "h2nav"
    assert told["version"] == __version__
    assert {"description", "icon", "company", "webpage", "api"} < told.keys()


@pytest.mark.parametrize(
    ("request_line", "status"),
    [
        ("GET /nothing", 404),
        ("GET /../pyproject.toml", 404),
        ("GET /page.html%00", 404),
        ("POST /", 405),
        ("PUT /metrics", 405),
        ("DELETE /events", 405),
    ],
)
def test_there_is_nothing_else_and_nothing_can_be_changed(page, request_line, status):
    told, _, body = exchange(page, request_line)
    assert told == status
    assert body.startswith(str(status).encode())


def test_a_strangers_name_for_this_computer_is_refused(page):
    """A web page from anywhere could give its own name our address (DNS rebinding)."""
    assert exchange(page, "GET /metrics", host="rebound.example")[0] == 403
    assert exchange(page, "GET /metrics", host="localhost")[0] == 200
    assert exchange(page, "GET /metrics", host="[::1]")[0] == 200


def test_an_address_for_all_may_have_any_name():
    with served(flying_state(), "0.0.0.0") as page:
        assert exchange(page, "GET /", host="vehicle.example")[0] == 200


def test_the_stream_brings_attitudes_and_overviews(page):
    with listening(page) as connection:
        stream = events(connection)
        first = dict(itertools.islice(stream, 3))
        assert [line["text"] for line in first["told"]["lines"]] == ["active"]
        overview = first["overview"]
        assert overview["health"]["state"] == "active"
        assert overview["holding"] == ["gravity", "compass", "velocity"]
        page.take("/estimate", estimate(roll_deg=33.0))
        roll = next(
            data["h2nav"]["roll_deg"]
            for name, data in stream
            if name == "attitudes" and data["h2nav"]["roll_deg"] != 10.4
        )
        assert roll == 33.0
        names = itertools.takewhile(lambda name: name != "overview", (name for name, _ in stream))
        assert "told" not in names  # nothing new was told
        page.run(page.state.text, UNIX_NS, Severity.WARNING, "degraded: a cause")
        told = next(data for name, data in stream if name == "told")
        assert [line["text"] for line in told["lines"]] == ["degraded: a cause", "active"]


def test_one_viewer_too_many_is_told_so(page, monkeypatch):
    monkeypatch.setattr(live_server, "MAX_VIEWERS", 1)
    with listening(page) as connection:
        next(events(connection))
        assert exchange(page, "GET /events")[0] == 503
    until(lambda: b"h2nav_live_viewers 0.0" in exchange(page, "GET /metrics")[2])


def test_one_connection_too_many_is_hung_up_on(page, monkeypatch):
    monkeypatch.setattr(live_server, "MAX_CONNECTIONS", 2)
    first, second = page.connect(), page.connect()
    with page.connect() as third:
        assert is_hung_up_on(third)
    first.close()
    second.close()
    until(lambda: can_connect(page))


def can_connect(page):
    try:
        return exchange(page, "GET /")[0] == 200
    except (ConnectionError, ValueError):
        return False


@pytest.mark.parametrize(
    "sent",
    [
        b"",
        b"GET / HTTP/1.1\r\nHost: a\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\nabc",
    ],
    ids=["nothing", "half a head", "half a body"],
)
def test_a_request_that_does_not_end_is_hung_up_on(monkeypatch, sent):
    monkeypatch.setattr(live_server, "PATIENCE_S", 0.2)
    with served(flying_state()) as page, page.connect() as connection:
        connection.sendall(sent)
        assert is_hung_up_on(connection)


@pytest.mark.parametrize(
    "sent",
    [
        b"\x00\xff" * 5000,
        b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 5000 + b"\r\n",
        b"GET / HTTP/1.1\r\nContent-Length: 9999999999\r\n\r\n",
        b"GET / HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
        b"GET / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nffffffff\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n",
    ],
    ids=["garbage", "huge head", "huge body", "negative body", "huge chunk", "TLS"],
)
def test_what_is_no_request_is_hung_up_on(page, sent):
    with page.connect() as connection:
        with contextlib.suppress(ConnectionError):  # it may hang up before the end
            connection.sendall(sent)
        assert is_hung_up_on(connection)
    assert exchange(page, "GET /")[0] == 200


@pytest.mark.thorough
def test_a_viewer_that_never_reads_is_hung_up_on(monkeypatch):
    monkeypatch.setattr(live_server, "PATIENCE_S", 0.2)
    with served(flying_state()) as page, listening(page) as connection:
        next(events(connection))
        page.run(lengthen, page.state)  # fills the buffers on the way sooner
        until(lambda: b"h2nav_live_viewers 0.0" in exchange(page, "GET /metrics")[2])


def lengthen(state):
    for number in range(1000):
        state.text(UNIX_NS, state.texts[0].severity, f"{number} " + "long " * 10_000)

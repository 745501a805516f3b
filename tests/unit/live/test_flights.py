"""Flights over HTTP: what is served to whom, what a hostile client gets."""

import contextlib
import http.client
import json
import os
import random
import time
from urllib.parse import quote

import pytest
from flight_folders import add_flights
from live_records import WAIT_S, served
from tornado.http1connection import HTTP1Connection

from h2nav.flights.folder import UPLOADS, FlightFolder
from h2nav.flights.uploads import safe_name
from h2nav.live.flights_site import SiteRights

TOKEN = "0123456789abcdefTOKEN"
MAX_UPLOAD_BYTES = 1 << 20
ULOG = b"ULog\x01\x12\x35\x01" + bytes(2000)
UNLOCKED = {"Authorization": f"Bearer {TOKEN}"}


@pytest.fixture
def folder(tmp_path) -> FlightFolder:
    return add_flights(tmp_path / "flights", 3)


@pytest.fixture
def page(folder):
    with served(None, flights=folder, rights=SiteRights(TOKEN, MAX_UPLOAD_BYTES)) as running:
        yield running


def ask(page, method, path, body=None, headers=None):
    connection = http.client.HTTPConnection("127.0.0.1", page.port, timeout=30)
    with contextlib.closing(connection):
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()


def listed(page, query="", headers=None):
    return json.loads(ask(page, "GET", f"/flights.json{query}", headers=headers)[2])


def upload(page, content, name="flight.ulg", headers=UNLOCKED):
    return ask(page, "POST", f"/flights/{UPLOADS}?name={quote(name)}", content, headers)


def test_list_review_document_and_recording(page, folder):
    rows = listed(page)["flights"]
    assert len(rows) == 3
    row = rows[0]
    status, headers, body = ask(page, "GET", f"/flights/{row['id']}")
    assert (status, body[:15]) == (200, b"<!DOCTYPE html>")
    assert "sandbox" in headers["Content-Security-Policy"]
    assert ask(page, "GET", f"/flights/{row['id']}/review.json")[2] == b"{}"
    status, headers, body = ask(page, "GET", f"/flights/{row['id']}/files/0")
    assert body == (folder.root / row["name"]).read_bytes()
    assert headers["Content-Disposition"].endswith(row["name"])


@pytest.mark.parametrize(
    "path",
    [
        "/flights/none",
        "/flights/none/files/0",
        "/flights/..%2f..%2fetc%2fpasswd",
        "/flights/../flights.json/x",
        "/flights/%00",
        "/flights/{id}/files/1",
        "/flights/{id}/files/99",
        "/flights/{id}/files/-1",
    ],
)
def test_what_is_not_there(page, path):
    row = listed(page)["flights"][0]
    assert ask(page, "GET", path.format(id=row["id"]))[0] == 404


def test_a_recording_that_became_a_link_is_not_followed(page, folder, tmp_path):
    row = listed(page)["flights"][0]
    secret = tmp_path / "secret"
    secret.write_text("secret")
    (folder.root / row["name"]).unlink()
    (folder.root / row["name"]).symlink_to(secret)
    assert ask(page, "GET", f"/flights/{row['id']}/files/0")[0] == 404


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Authorization": "Bearer wrong"},
        {"Authorization": TOKEN},
        {**UNLOCKED, "Origin": "http://evil.example"},
        {**UNLOCKED, "Origin": "null"},
        {**UNLOCKED, "Host": "evil.example"},
    ],
)
def test_without_the_token_or_from_elsewhere_nothing_changes(page, folder, headers):
    row = listed(page)["flights"][0]
    assert upload(page, ULOG, headers=headers)[0] == 403
    assert ask(page, "DELETE", f"/flights/{row['id']}", headers=headers)[0] == 403
    assert ask(page, "POST", f"/flights/{row['id']}/again", b"", headers)[0] == 403
    assert len(folder.flights()) == 3
    assert folder.record(row["id"]) is not None


def test_without_a_configured_token_no_token_helps(folder):
    with served(None, flights=folder) as page:
        assert not listed(page)["may_be_changed"]
        assert upload(page, ULOG, headers={"Authorization": "Bearer "})[0] == 403


def test_an_upload_is_listed_and_waits_for_its_review(page, folder):
    assert listed(page, headers=UNLOCKED)["is_unlocked"]
    own = {**UNLOCKED, "Origin": f"http://127.0.0.1:{page.port}"}
    status, _, body = upload(page, ULOG, "my flight.ulg", own)
    assert status == 201
    said = json.loads(body)
    assert said["name"] == "my flight.ulg"
    assert (folder.root / UPLOADS / "my flight.ulg").read_bytes() == ULOG
    row = next(each for each in listed(page)["flights"] if each["id"] == said["id"])
    assert row["state"] == "waiting"
    assert json.loads(upload(page, ULOG, "my flight.ulg")[2])["name"] == "my flight-2.ulg"


def test_delete_and_review_again(page, folder):
    first, second, _ = (row["id"] for row in listed(page)["flights"])
    assert ask(page, "DELETE", f"/flights/{first}", headers=UNLOCKED)[0] == 204
    assert ask(page, "POST", f"/flights/{second}/again", b"", UNLOCKED)[0] == 204
    states = {row["id"]: row["state"] for row in listed(page)["flights"]}
    assert first not in states
    assert states[second] == "waiting"
    assert first not in folder.flights()


def test_what_is_no_recording_too_large_or_cut_off_leaves_nothing(page, folder):
    for content, status in ((b"", 415), (b"hello" * 99, 415), (bytes(MAX_UPLOAD_BYTES + 1), 413)):
        with contextlib.suppress(ConnectionError):  # hung up on before its body was read
            assert upload(page, content)[0] == status
    with page.connect() as connection:
        head = f"POST /flights/{UPLOADS} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5000\r\n"
        connection.sendall(f"{head}Authorization: Bearer {TOKEN}\r\n\r\n".encode() + ULOG)
    end = time.monotonic() + WAIT_S
    while upload(page, ULOG)[0] != 201:  # until the server sees that the cut one is gone
        assert time.monotonic() < end
        time.sleep(0.01)
    assert [path.name for path in (folder.root / UPLOADS).iterdir()] == ["flight.ulg"]


def test_what_the_disk_or_a_client_does_wrong_is_answered_in_a_line_and_not_logged(
    page, monkeypatch, caplog
):
    row = listed(page)["flights"][0]

    def refuses(*_):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(FlightFolder, "forget_review", refuses)
    monkeypatch.setattr("h2nav.live.flights.sync_folder", refuses)
    again = ask(page, "POST", f"/flights/{row['id']}/again", b"", UNLOCKED)
    assert (again[0], again[2]) == (500, b"500 Read-only file system\n")
    assert ask(page, "DELETE", f"/flights/{row['id']}", headers=UNLOCKED)[0] == 500
    assert upload(page, ULOG)[0] == 507
    assert ask(page, "GET", "/flights.json?search=%ff")[0] == 400
    assert caplog.records == []


def test_an_upload_may_take_half_an_hour(page, monkeypatch):
    given = []
    monkeypatch.setattr(HTTP1Connection, "set_body_timeout", lambda _, s: given.append(s))
    assert upload(page, ULOG)[0] == 201
    assert given == [1800.0]


def test_one_upload_at_a_time(page, folder):
    with page.connect() as connection:
        head = f"POST /flights/{UPLOADS} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5000\r\n"
        connection.sendall(f"{head}Authorization: Bearer {TOKEN}\r\n\r\n".encode() + ULOG)
        end = time.monotonic() + WAIT_S
        while not list((folder.root / UPLOADS).glob(".*.part")):
            assert time.monotonic() < end
            time.sleep(0.01)
        assert upload(page, ULOG)[0] == 503


def test_hostile_names_and_contents(page, folder):
    dice = random.Random(4)
    names = [
        "../../evil.ulg",
        "/etc/passwd",
        ".hidden.ulg",
        "a\0b\nc.ulg",
        "x" * 5000,
        "..",
        "\\.ulg",
    ]
    for name in names:
        assert upload(page, ULOG, name[:1500])[0] == 201
    for _ in range(60):
        upload(page, dice.randbytes(dice.randrange(1, 3000)), dice.randbytes(8).hex())
    places = {path.parent for path in folder.root.rglob("*.ulg")}
    assert places == {folder.root / UPLOADS}
    end = time.monotonic() + WAIT_S
    while list((folder.root / UPLOADS).glob(".*")):  # the last one, just answered
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.parametrize("seed", range(200))
def test_a_safe_name_is_one(seed):
    dice = random.Random(seed)
    name = "".join(
        chr(dice.choice((dice.randrange(128), dice.randrange(0x300)))) for _ in range(99)
    )
    safe = safe_name(name, ".bin")
    assert safe.endswith(".bin")
    assert not safe.startswith(".")
    assert "/" not in safe
    assert len(os.fsencode(safe)) <= 120

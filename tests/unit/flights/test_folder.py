"""Which files are a flight, and when a review exists."""

import itertools
import os
import sys
from pathlib import Path

import pytest
from flight_folders import add_flights, summary

from h2nav.errors import BadInput
from h2nav.flights.folder import FlightFolder, flight_id

OURS = "20260101T080000Z_0123abcd_000001"


def written(folder: FlightFolder, text: str = "new") -> Path:
    made = folder.reviews / ".written"
    made.mkdir(parents=True, exist_ok=True)
    (made / "review.html").write_text(text)
    (made / "review.json").write_text("{}")
    return made


def the_flight(folder: FlightFolder):
    (flight,) = folder.flights().values()
    return flight


def test_the_autopilots_log_beside_ours_is_of_the_same_flight_and_the_better_one(tmp_path):
    for name in (f"{OURS}.mcap", f"{OURS}.bin"):
        (tmp_path / name).write_bytes(b"x")
    flight = the_flight(FlightFolder(tmp_path))
    assert [each.name for each in flight.recordings] == [f"{OURS}.bin", f"{OURS}.mcap"]
    assert flight.id == flight_id(OURS)
    assert flight.size == 2


def test_logs_of_others_with_one_stem_are_two_flights(tmp_path):
    for name in ("flight.tlog", "flight.BIN", "below/flight.ulg"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    assert len(FlightFolder(tmp_path).flights()) == 3


def test_what_is_still_written_hidden_linked_or_no_recording_is_no_flight(tmp_path):
    outside = tmp_path / "outside.bin"
    outside.write_bytes(b"x")
    root = tmp_path / "root"
    root.mkdir()
    for name in (f"{OURS}.mcap.active", ".hidden.bin", "notes.txt", "part.bin.part"):
        (root / name).write_bytes(b"x")
    (root / "link.bin").symlink_to(outside)
    (root / "pipe.bin").parent.mkdir(exist_ok=True)
    os.mkfifo(root / "pipe.bin")
    assert FlightFolder(root).flights() == {}


def test_a_folder_below_that_cannot_be_read_hides_no_other(tmp_path, monkeypatch):
    """Such as lost+found, which is root's on every disk."""
    for name in ("flight.tlog", "lost+found/old.tlog", "below/flight.ulg"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    closed = {tmp_path / "lost+found"}
    scandir = os.scandir

    def scanned(path):
        if path in closed:
            raise PermissionError(13, "Permission denied", str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", scanned)
    names = {each.best.name for each in FlightFolder(tmp_path).flights().values()}
    assert names == {"flight.tlog", "below/flight.ulg"}
    closed.add(tmp_path)
    with pytest.raises(PermissionError):
        FlightFolder(tmp_path).flights()


def test_names_that_are_no_text_have_ids_that_are(tmp_path):
    (tmp_path / os.fsdecode(b"\xff \xe4<b>.bin")).write_bytes(b"x")
    folder = FlightFolder(tmp_path)
    flight = the_flight(folder)
    assert flight.id.isascii()
    assert "/" not in flight.id
    record = folder.commit(flight, summary(1), written=written(folder))
    assert folder.record(flight.id) == record
    assert folder.is_current(flight, folder.record(flight.id))


def test_another_recording_makes_a_review_out_of_date(tmp_path):
    folder = add_flights(tmp_path, 1)
    flight = the_flight(folder)
    record = folder.record(flight.id)
    assert folder.is_current(flight, record)
    (tmp_path / Path(flight.best.name).with_suffix(".bin").name).write_bytes(b"more")
    assert not folder.is_current(the_flight(folder), record)


def test_a_new_review_takes_the_place_of_the_old_one_and_leaves_nothing(tmp_path):
    folder = add_flights(tmp_path, 2)
    flight = next(iter(folder.flights().values()))
    before = folder.record(flight.id)
    folder.attempt(flight.id)
    after = folder.commit(flight, summary(9), written=written(folder))
    assert after.page != before.page
    names = {path.name for path in folder.reviews.iterdir() if path.name.startswith(flight.id)}
    assert names == {after.page, after.document, f"{flight.id}.flight.json"}


def test_attempts_are_counted_until_one_ends(tmp_path):
    folder = add_flights(tmp_path, 1)
    flight = the_flight(folder)
    assert [folder.attempt(flight.id) for _ in range(3)] == [1, 2, 3]
    folder.forget_attempt(flight.id)
    assert folder.attempt(flight.id) == 1


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[]", b'{"format": 1}', b'{"format": 1, "recordings": 3}', b"\xff"]
)
def test_a_record_that_cannot_be_read_is_none(tmp_path, content):
    folder = add_flights(tmp_path, 1)
    flight = the_flight(folder)
    (folder.reviews / f"{flight.id}.flight.json").write_bytes(content)
    assert folder.record(flight.id) is None


def test_a_record_that_somebody_edited_leads_nowhere_else(tmp_path):
    folder = add_flights(tmp_path, 1)
    flight = the_flight(folder)
    place = folder.reviews / f"{flight.id}.flight.json"
    page = folder.record(flight.id).page
    whole = place.read_bytes()
    place.write_bytes(whole.replace(page.encode(), b"../../etc/passwd"))
    assert folder.record(flight.id) is None
    place.write_bytes(whole.replace(b'"kinds":', b'"kinds": null, "other":'))
    assert folder.record(flight.id) is None


@pytest.mark.parametrize("name", ["../secret", "below/../../secret", "/etc/passwd"])
def test_a_name_that_leads_out_of_the_root_is_refused(tmp_path, name):
    with pytest.raises(BadInput, match="is not below"):
        FlightFolder(tmp_path / "root").path_of(name)


def test_deleting_removes_recordings_and_review(tmp_path):
    folder = add_flights(tmp_path, 1)
    folder.delete(the_flight(folder))
    assert folder.flights() == {}
    assert list(folder.reviews.iterdir()) == []


WRITES = {"open", "os.rename", "os.remove", "os.mkdir"}


def committed_until(folder: FlightFolder, flight, step: int) -> bool:
    """Commits a review in a process that dies before its `step`-th change; whether it died."""
    pid = os.fork()
    if pid == 0:
        left = step

        def dies(event, _):
            nonlocal left
            left -= event in WRITES
            if left < 0:
                os._exit(9)

        sys.addaudithook(dies)
        folder.attempt(flight.id)
        folder.commit(flight, summary(9), written=written(folder))
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 9


def test_killed_before_any_of_its_changes_it_holds_the_old_review_or_the_new_one(tmp_path):
    folder = add_flights(tmp_path, 1)
    flight = the_flight(folder)
    before = folder.record(flight.id)
    seen = []
    for step in itertools.count():
        died = committed_until(folder, flight, step)
        record = folder.record(flight.id)
        seen.append(record != before)
        assert folder.is_current(flight, record)
        assert ((folder.reviews / record.page).read_text() == "new") is (record != before)
        assert (folder.reviews / record.document).exists()
        if not died:
            break
    assert seen == sorted(seen)  # once there, it stays
    assert seen[-1]
    assert not seen[9]

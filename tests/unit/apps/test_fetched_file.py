"""A file that arrives in parts: its name, what is kept of it, and what is removed."""

import stat
import time

import orjson
import pytest

from h2nav.apps import fetched_file
from h2nav.apps.fetched_file import FetchedFile, remove_unfinished, unfinished
from h2nav.fetch.gaps import MAX_GAPS
from h2nav.fetch.log_fetch import LARGEST_LOG_BYTES, PartOfLog

WHOLE = PartOfLog(10, 1_700_000_000, ((0, 10),))


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def note_of(folder):
    return orjson.loads((folder / "a.bin.part.json").read_bytes())


def ended(file):
    file.wait(10.0)
    return file


def test_parts_in_any_order_make_the_file_and_it_has_its_name_only_when_it_is_whole(tmp_path):
    file = FetchedFile(tmp_path / "a.bin", WHOLE)
    file.write(6, b"6789")
    file.write(0, b"012345")
    file.note(WHOLE)
    file.complete()
    ended(file)
    assert (file.is_whole, file.trouble) == (True, "")
    assert names(tmp_path) == ["a.bin"]
    assert (tmp_path / "a.bin").read_bytes() == b"0123456789"
    assert stat.S_IMODE((tmp_path / "a.bin").stat().st_mode) & ~0o640 == 0


@pytest.mark.parametrize("size", [9, 11])
def test_a_file_of_another_size_than_was_said_is_none(tmp_path, size):
    file = FetchedFile(tmp_path / "a.bin", WHOLE)
    file.write(0, b"x" * size)
    file.complete()
    ended(file)
    assert not file.is_whole
    part = tmp_path / "a.bin.part"
    assert file.trouble == f"{part}: has another size than the autopilot said"
    assert names(tmp_path) == []


def test_what_is_set_aside_stays_with_a_note_and_the_next_goes_on_with_it(tmp_path):
    first = FetchedFile(tmp_path / "a.bin", WHOLE)
    first.write(0, b"01234")
    left = WHOLE._replace(gaps=((5, 10),))
    first.set_aside(left)
    ended(first)
    assert (first.is_whole, first.trouble) == (False, "")
    assert names(tmp_path) == ["a.bin.part", "a.bin.part.json"]
    assert note_of(tmp_path) == {"size": 10, "time_utc": 1_700_000_000, "gaps": [[5, 10]]}
    assert stat.S_IMODE((tmp_path / "a.bin.part.json").stat().st_mode) & ~0o640 == 0
    assert unfinished(tmp_path) == [(tmp_path / "a.bin", left)]
    second = FetchedFile(tmp_path / "a.bin", left)
    second.write(5, b"56789")
    second.complete()
    assert ended(second).is_whole
    assert (tmp_path / "a.bin").read_bytes() == b"0123456789"
    assert names(tmp_path) == ["a.bin"]


def test_what_is_begun_anew_holds_nothing_of_an_earlier_one(tmp_path):
    (tmp_path / "a.bin.part").write_bytes(b"x" * 100)
    file = FetchedFile(tmp_path / "a.bin", WHOLE)
    file.write(0, b"0123456789")
    file.complete()
    assert ended(file).is_whole
    assert (tmp_path / "a.bin").read_bytes() == b"0123456789"


@pytest.mark.parametrize("is_complete", [False, True])
def test_what_is_given_up_leaves_nothing(tmp_path, is_complete):
    file = FetchedFile(tmp_path / "a.bin", WHOLE)
    file.write(0, b"01234")
    file.note(WHOLE)
    file.give_up()
    if is_complete:
        file.complete()
    ended(file)
    assert (file.is_whole, file.trouble) == (False, "")
    assert names(tmp_path) == []


def test_a_folder_that_is_gone_is_the_trouble_and_no_exception(tmp_path):
    file = FetchedFile(tmp_path / "none" / "a.bin", WHOLE)
    ended(file)
    part = tmp_path / "none" / "a.bin.part"
    assert file.trouble == f"{part}: No such file or directory"


def test_a_link_in_the_place_of_the_part_is_not_followed(tmp_path):
    other = tmp_path / "other"
    other.write_bytes(b"of somebody else")
    (tmp_path / "a.bin.part").symlink_to(other)
    file = FetchedFile(tmp_path / "a.bin", WHOLE)
    ended(file)
    assert file.trouble.startswith(f"{tmp_path / 'a.bin.part'}: ")
    assert other.read_bytes() == b"of somebody else"


def test_it_has_room_for_four_thousand_parts_that_the_disk_has_not_taken(tmp_path, monkeypatch):
    monkeypatch.setattr(FetchedFile, "_run", lambda itself: None)  # a disk that hangs
    file = FetchedFile(tmp_path / "a.bin", WHOLE)
    for _ in range(4095):
        file.write(0, b"")
    assert file.has_room
    file.write(0, b"")
    assert not file.has_room


@pytest.mark.parametrize(("later_s", "wants"), [(5.0, False), (5.001, True)])
def test_what_is_missing_is_noted_every_five_seconds(tmp_path, monkeypatch, later_s, wants):
    now_s = [1000.0]
    monkeypatch.setattr(fetched_file.time, "monotonic", lambda: now_s[0])
    file = FetchedFile(tmp_path / "a.bin", WHOLE)
    now_s[0] += later_s
    assert file.wants_note is wants
    file.note(WHOLE)
    assert not file.wants_note
    file.give_up()
    monkeypatch.undo()
    ended(file)


def test_parts_are_written_while_more_are_awaited(tmp_path):
    file = FetchedFile(tmp_path / "a.bin", WHOLE)
    file.write(0, b"01234")
    until_s = time.monotonic() + 10.0
    part = tmp_path / "a.bin.part"
    while not (part.exists() and part.stat().st_size == 5) and time.monotonic() < until_s:
        pass
    assert part.read_bytes() == b"01234"
    file.give_up()
    ended(file)


# --- what the next start finds ----------------------------------------------------------------


def left_behind(folder, name="a.bin", **said):
    note = {"size": 100, "time_utc": 7, "gaps": [[50, 60], [70, 100]]} | said
    (folder / f"{name}.part").write_bytes(b"x" * 50)
    (folder / f"{name}.part.json").write_bytes(orjson.dumps(note))


@pytest.mark.parametrize(
    ("said", "is_taken"),
    [
        ({}, True),
        ({"gaps": [[0, 100]]}, True),
        ({"gaps": [[0, 101]]}, False),
        ({"gaps": [[-1, 100]]}, False),
        ({"gaps": []}, False),
        ({"gaps": [[50, 60], [55, 100]]}, False),
        ({"gaps": [[50, 60], [60, 100]]}, True),
        ({"gaps": [[n, n] for n in range(MAX_GAPS)], "size": MAX_GAPS}, True),
        ({"gaps": [[n, n] for n in range(MAX_GAPS + 1)], "size": MAX_GAPS + 1}, False),
        ({"size": 0, "gaps": [[0, 0]]}, False),
        ({"size": 1, "gaps": [[0, 1]]}, True),
        ({"size": LARGEST_LOG_BYTES - 1}, True),
        ({"size": LARGEST_LOG_BYTES}, False),
        ({"gaps": [[1, 2, 3]]}, False),
        ({"gaps": 3}, False),
        ({"time_utc": None}, False),
    ],
)
def test_a_note_is_believed_only_if_it_can_be_true(tmp_path, said, is_taken):
    left_behind(tmp_path, **said)
    found = unfinished(tmp_path)
    assert len(found) == int(is_taken)
    assert names(tmp_path) == (["a.bin.part", "a.bin.part.json"] if is_taken else [])
    if not said:
        assert found == [(tmp_path / "a.bin", PartOfLog(100, 7, ((50, 60), (70, 100))))]


def test_a_part_without_a_note_or_beside_the_whole_file_is_removed(tmp_path):
    (tmp_path / "b.bin.part").write_bytes(b"x")
    left_behind(tmp_path)
    (tmp_path / "a.bin").write_bytes(b"whole")
    assert unfinished(tmp_path) == []
    assert names(tmp_path) == ["a.bin"]


def test_removing_what_is_not_there_is_no_error(tmp_path):
    remove_unfinished(tmp_path / "none.bin")
    left_behind(tmp_path)
    remove_unfinished(tmp_path / "a.bin")
    assert names(tmp_path) == []

"""The stamp on disk; a kill is a keeper that is left as it is, a restart a new one."""

import shutil
import threading

import pytest
from signing_peer import NOW_STAMP, Clock

from h2nav.files.stamp_file import SAVE_EVERY_S, StampFile, StampKeeper
from h2nav.files.whole_file import NEW_SUFFIX
from h2nav.wire.signing import LARGEST_STAMP

DAY = 24 * 3600 * 100_000
INTERVAL = round(SAVE_EVERY_S * 100_000)


def test_a_stored_stamp_is_read_back_by_its_owner_alone(tmp_path):
    file = StampFile(tmp_path / "stamp")
    assert file.load() == 0
    for stamp in (1, NOW_STAMP, LARGEST_STAMP):
        file.save(stamp)
        assert file.load() == stamp
    assert file.path.stat().st_mode & 0o777 == 0o600
    assert [path.name for path in tmp_path.iterdir()] == ["stamp"]


def test_a_save_that_fails_leaves_the_one_before(tmp_path):
    file = StampFile(tmp_path / "stamp")
    file.save(7)
    (tmp_path / f"stamp{NEW_SUFFIX}").mkdir()
    with pytest.raises(OSError, match="stamp"):
        file.save(8)
    assert file.load() == 7


@pytest.mark.parametrize("content", ["", "soon", "-1", str(LARGEST_STAMP + 1), "9" * 5000])
def test_a_file_without_a_stamp_is_told_and_signing_goes_on(tmp_path, content):
    path = tmp_path / "stamp"
    path.write_text(content)
    keeper = StampKeeper(path, Clock())
    assert keeper.stamp.next() == NOW_STAMP
    keeper.close()
    (notice,) = keeper.notices()
    assert notice.is_error
    assert str(path) in notice.text
    assert StampFile(path).load() == NOW_STAMP


def test_stamps_go_on_after_a_restart_with_a_right_clock(tmp_path):
    clock = Clock()
    for _ in range(3):
        keeper = StampKeeper(tmp_path / "stamp", clock)
        assert keeper.stamp.next() == clock.stamp
        keeper.close()
        clock.stamp += 12_345


@pytest.mark.parametrize("set_back_by", [1, DAY, NOW_STAMP])
def test_stamps_grow_over_a_restart_with_the_clock_set_back(tmp_path, set_back_by):
    clock, used = Clock(), []
    for _ in range(4):
        keeper = StampKeeper(tmp_path / "stamp", clock)
        used += [keeper.stamp.next() for _ in range(3)]
        keeper.close()
        clock.stamp = max(clock.stamp - set_back_by, 0)
    assert used == sorted(set(used))


def test_stamps_grow_over_a_kill_with_the_clock_set_back(tmp_path):
    """What was used since the last save is not on disk."""
    clock = Clock()
    path = tmp_path / "stamp"
    killed = StampKeeper(path, clock)
    killed.stamp.next()
    killed.close()
    saved = StampFile(path).load()
    clock.stamp += INTERVAL - 1
    latest = killed.stamp.next()
    assert StampFile(path).load() == saved < latest
    clock.stamp = 0
    restarted = StampKeeper(path, clock)
    restarted.close()
    assert restarted.stamp.next() > latest


def test_a_clock_that_is_ahead_of_the_stored_stamp_is_believed(tmp_path):
    """A crash loop must not run ahead of the clock."""
    clock, path = Clock(), tmp_path / "stamp"
    for _ in range(20):
        keeper = StampKeeper(path, clock)
        keeper.stamp.next()
        keeper.close()
        clock.stamp += 100
    assert keeper.stamp.ahead_s == 0.0


def test_a_folder_that_is_missing_is_told_once_and_so_is_its_return(tmp_path):
    folder = tmp_path / "state"
    keeper = StampKeeper(folder / "stamp", Clock())
    keeper.stamp.next()
    keeper.close()
    (notice,) = keeper.notices()
    assert notice.is_error
    assert "signing goes on" in notice.text
    assert keeper.notices() == []
    folder.mkdir()
    keeper = StampKeeper(folder / "stamp", Clock())
    keeper.close()
    assert keeper.notices() == []


def test_the_return_of_the_folder_is_told(tmp_path):
    folder = tmp_path / "state"
    folder.mkdir()
    keeper = StampKeeper(folder / "stamp", Clock())
    keeper.close()
    shutil.rmtree(folder)
    keeper.save()
    folder.mkdir()
    keeper.save()
    assert [notice.is_error for notice in keeper.notices()] == [True, False]


@pytest.mark.parametrize(
    ("stored", "clock", "first"),
    [
        (1_000, 2_000, 2_000),
        (2_000, 2_000, 2_000),
        (2_001, 2_000, 2_001 + 1_000_000),  # what ten seconds may have used
        (LARGEST_STAMP - 1_000_001, 2_000, LARGEST_STAMP - 1),
        (LARGEST_STAMP - 10, 2_000, LARGEST_STAMP),
    ],
)
def test_a_clock_behind_the_stored_stamp_is_not_believed(tmp_path, stored, clock, first):
    StampFile(tmp_path / "stamp").save(stored)
    now = Clock()
    now.stamp = clock
    keeper = StampKeeper(tmp_path / "stamp", now)
    keeper.close()
    assert max(keeper.stamp.latest, clock) == first


def test_what_was_used_is_stored_at_the_end(tmp_path):
    keeper = StampKeeper(tmp_path / "stamp", Clock())
    used = [keeper.stamp.next() for _ in range(3)]
    keeper.close()
    assert StampFile(tmp_path / "stamp").load() == used[-1]


def test_a_file_is_read_no_further_than_a_stamp_is_long(tmp_path):
    (tmp_path / "stamp").write_bytes(b"7".ljust(64) + b"x" * 1000)
    assert StampFile(tmp_path / "stamp").load() == 7


def test_the_notices_name_file_trouble_and_remedy(tmp_path):
    folder = tmp_path / "state"
    keeper = StampKeeper(folder / "stamp", Clock())
    keeper.close()
    keeper.save()  # the same again: told once
    folder.mkdir()
    keeper.save()
    keeper.save()
    told = f"{folder / 'stamp'}: the signing time stamp"
    lost = f"[Errno 2] No such file or directory: '{folder / 'stamp'}{NEW_SUFFIX}'"
    assert keeper.notices() == [
        (True, f"{told} cannot be stored: {lost}; signing goes on, make its folder writable"),
        (False, f"{told} is stored again"),
    ]
    (folder / "stamp").write_text("soon")
    keeper = StampKeeper(folder / "stamp", Clock())
    keeper.close()
    ((is_error, text),) = keeper.notices()
    assert is_error
    assert text.startswith(f"{told} cannot be read: invalid literal")
    assert text.endswith("; it starts from the host's clock, right or wrong")


def test_a_disk_that_hangs_keeps_no_program_from_ending(tmp_path):
    keeper = StampKeeper(tmp_path / "stamp", Clock())
    (thread,) = (each for each in threading.enumerate() if each.name == "h2nav-signing")
    assert thread.daemon
    keeper.close()

"""Names of logs, and what may be deleted to make room."""

import shutil
from pathlib import Path

import pytest
from log_limits import limits

from h2nav.log.folder import (
    MIB,
    MIN_RUN_BYTES,
    left_over_logs,
    make_room,
    next_log_path,
    our_logs,
    run_budget,
    trim_run,
)

UNIX_NS = 1_795_260_679_845_863_513  # 2026-11-21 11:31:19 UTC
NO_FLOOR = limits(files=3)


def log(folder: Path, number: int, stamp: str = "20260101T000000Z", suffix: str = "") -> Path:
    path = folder / f"{stamp}_0123abcd_{number:06d}.mcap{suffix}"
    path.write_bytes(b"x")
    return path


def test_numbers_rise_whatever_the_clock_says(tmp_path: Path) -> None:
    assert next_log_path(tmp_path, UNIX_NS).name.startswith("20261121T113119Z_")
    assert next_log_path(tmp_path, UNIX_NS).name.endswith("_000001.mcap")
    log(tmp_path, 41, stamp="20990101T000000Z")
    assert next_log_path(tmp_path, 0).name.startswith("19700101T000000Z_")
    assert next_log_path(tmp_path, 0).name.endswith("_000042.mcap")


def test_only_our_files_count(tmp_path: Path) -> None:
    ours = [log(tmp_path, 1, "20990101T000000Z"), log(tmp_path, 2, suffix=".active")]
    for name in ("notes.txt", "flight.mcap", "20260101T000000Z_0123abcd_000003.mcap.bak"):
        (tmp_path / name).write_text("mine")
    (tmp_path / "20260101T000000Z_0123abcd_000004.mcap").mkdir()
    (tmp_path / "20260101T000000Z_0123abcd_000005.mcap").symlink_to(tmp_path / "notes.txt")
    assert our_logs(tmp_path) == ours
    assert left_over_logs(tmp_path) == [ours[1]]


def test_the_oldest_go_first_and_foreign_files_stay(tmp_path: Path) -> None:
    logs = [log(tmp_path, number, f"20{30 - number}0101T000000Z") for number in range(1, 6)]
    foreign = tmp_path / "flight.mcap"
    foreign.write_text("mine")
    assert make_room(tmp_path, NO_FLOOR, None) == logs[:3]
    assert our_logs(tmp_path) == logs[3:], "two stay, and the next one makes three"
    assert foreign.exists()


def test_the_present_log_is_never_deleted(tmp_path: Path) -> None:
    present = log(tmp_path, 1, suffix=".active")
    others = [log(tmp_path, number) for number in (2, 3, 4)]
    assert make_room(tmp_path, NO_FLOOR, present) == others[:1]
    with pytest.raises(OSError, match="below the floor") as raised:
        make_room(tmp_path, limits(files=3, free_bytes=1 << 62), present)
    assert raised.value.filename == str(tmp_path)
    assert our_logs(tmp_path) == [present], "all others were given up for the space"


def test_a_run_gives_up_its_own_oldest_files_first(tmp_path: Path) -> None:
    earlier = log(tmp_path, 1)
    run = [log(tmp_path, number) for number in (2, 3, 4)]
    present = log(tmp_path, 5, suffix=".active")
    assert trim_run([*run, present], present, budget=4) == []
    assert trim_run([*run, present], present, budget=2) == run[:2]
    assert our_logs(tmp_path) == [earlier, run[2], present]
    assert trim_run([run[2], present], present, budget=0) == [run[2]], "never the present one"


def test_a_run_may_take_a_quarter_of_the_room(tmp_path: Path) -> None:
    assert run_budget(tmp_path, limits(run_bytes=7)) == 7
    assert run_budget(tmp_path, limits(files=100, file_bytes=MIB)) == 25 * MIB
    disk = shutil.disk_usage(tmp_path)
    without_end = limits(files=10_000, file_bytes=disk.total)
    assert run_budget(tmp_path, without_end) <= disk.total // 4
    full = limits(free_bytes=2 * disk.total)
    assert run_budget(tmp_path, full) == MIN_RUN_BYTES

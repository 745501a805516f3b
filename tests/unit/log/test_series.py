"""One log after another: rotation, disks that fail and come back, files left over from a crash."""

import contextlib
import errno
import os
import resource
import shutil
import stat
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from random import Random

import pytest
from log_limits import limits
from mcap.reader import make_reader

from h2nav.integrity.severity import Severity
from h2nav.log.file import Attachment, LogFile
from h2nav.log.folder import MIB, LogLimits, our_logs
from h2nav.log.repair import complete_in_place, replace_damaged
from h2nav.log.series import RETRY_FIRST_S, SYNC_S, FolderTarget, LogSeries
from h2nav.recordings.recording import open_recording
from h2nav.service.records import RejectionRecord

LIMITS = limits(file_bytes=64 * MIB, file_age_s=100.0, files=50)
NOISE = bytes(range(256)) * 16


class ManualClock:
    """A clock that the test moves."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


def series_in(folder: Path, clock: ManualClock, limits: LogLimits = LIMITS) -> LogSeries:
    return LogSeries(FolderTarget(folder, limits), 0, clock)


def put(series: LogSeries, *numbers: int, data: bytes = b"") -> None:
    for number in numbers:
        series.write(lambda file, n=number: file.add_raw("/mavlink/rx/a", n, data or b"%d" % n))


def numbers_in(path: Path) -> list[int]:
    return [t_ns for t_ns, _ in open_recording(path).received()]


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """No file of this process grows beyond `size` (EFBIG)."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_write_that_the_disk_refuses_is_told_and_the_next_file_goes_on(
    tmp_path: Path, clock: ManualClock
) -> None:
    def refused(_file: LogFile) -> None:
        raise OSError(errno.EIO, "the disk is broken")

    series = series_in(tmp_path, clock)
    series.begin()
    put(series, 1)
    series.write(refused)
    assert series.trouble is not None
    assert "the disk is broken" in series.trouble
    put(series, 2)
    assert series.lost > 0
    clock.now_s += RETRY_FIRST_S
    series.tend()
    put(series, 3)
    series.end()
    assert [n for path in our_logs(tmp_path) for n in numbers_in(path)][-1] == 3


def test_each_file_begins_with_attachments_and_metadata(tmp_path: Path, clock: ManualClock) -> None:
    series = series_in(tmp_path, clock)
    series.begin()
    series.keep("attachment", "c", lambda file: file.attach(_attachment(b"old"), 1))
    series.keep("metadata", "m", lambda file: file.describe("autopilot", {"version": "4.7"}))
    put(series, 1)
    series.keep("attachment", "c", lambda file: file.attach(_attachment(b"new"), 1))
    series.tend()
    clock.now_s += LIMITS.file_age_s
    series.tend()
    put(series, 2, 3)
    series.end()
    first, second = our_logs(tmp_path)
    assert (numbers_in(first), numbers_in(second)) == ([1], [2, 3])
    recording = open_recording(second)
    assert recording.attachments["configuration.yaml"].data == b"new"
    assert recording.metadata["autopilot"] == {"version": "4.7"}
    about = recording.metadata["recording"]
    assert (about["series"], about["part"]) == (first.stem, "2")
    assert series.written == 3


def test_rotation_by_size_keeps_every_message_in_order(tmp_path: Path, clock: ManualClock) -> None:
    small = limits(file_bytes=2_000, file_age_s=1e9, files=50)
    series = series_in(tmp_path, clock, small)
    series.begin()
    for number in range(40):
        put(series, number)
        clock.now_s += SYNC_S
        series.tend()
    series.end()
    logs = our_logs(tmp_path)
    assert len(logs) > 1
    assert all(log.suffix == ".mcap" for log in logs)
    assert [number for log in logs for number in numbers_in(log)] == list(range(40))


def test_the_file_count_is_held(tmp_path: Path, clock: ManualClock) -> None:
    small = limits(file_age_s=1.0, files=3)
    series = series_in(tmp_path, clock, small)
    series.begin()
    for number in range(10):
        put(series, number)
        clock.now_s += 1.0
        series.tend()
        assert len(our_logs(tmp_path)) <= 3
    series.end()
    assert numbers_in(our_logs(tmp_path)[-2]) == [9]


def test_a_file_that_may_not_grow_is_left_valid_and_followed_by_another(
    tmp_path: Path, clock: ManualClock
) -> None:
    series = series_in(tmp_path, clock)
    series.begin()
    put(series, *range(100))
    clock.now_s += SYNC_S
    series.tend()
    saved = our_logs(tmp_path)[0]
    with largest_file(saved.stat().st_size + 100):
        put(series, *range(100, 200))
        clock.now_s += SYNC_S
        series.tend()
        assert series.trouble is not None
        put(series, 200, 201)
        series.tend()
    assert series.lost == 102
    (notice,) = series.notices
    assert notice.severity == Severity.ERROR, "one error, however much is lost"
    assert os.strerror(errno.EFBIG) in notice.text
    assert numbers_in(saved) == list(range(100)), "cut after its last whole record"
    clock.now_s += RETRY_FIRST_S
    series.tend()
    put(series, 202)
    clock.now_s += SYNC_S
    series.tend()
    assert series.trouble is None
    series.end()
    assert numbers_in(our_logs(tmp_path)[-1]) == [202]
    assert [notice.severity for notice in series.notices] == [Severity.ERROR, Severity.NOTICE]
    assert "102 messages lost" in series.notices[-1].text
    assert series.written == 101


def test_retries_grow_rarer(tmp_path: Path, clock: ManualClock) -> None:
    """Faults 19 and 20: no folder, no recording, no storm of errors either."""
    blocked = tmp_path / "logs"
    blocked.write_text("a file where the folder should be")
    series = series_in(blocked, clock)
    series.begin()
    tries = []
    for step in range(1, 200):
        clock.now_s += 1.0
        before = series._retry_at_s
        series.tend()
        put(series, step)
        if series._retry_at_s != before:
            tries.append(step)
    assert tries[:4] == [1, 3, 7, 15]
    assert len(tries) < 12
    assert len(series.notices) == 1
    assert str(blocked) in series.notices[0].text
    assert series.lost == 199
    blocked.unlink()
    clock.now_s += 30.0
    series.tend()
    put(series, 1000)
    series.end()
    assert numbers_in(our_logs(blocked)[0]) == [1000]


def test_a_full_disk(tmp_path: Path, clock: ManualClock) -> None:
    """Fault 19 on a file system that is really full."""
    disk = tmp_path / "disk"
    disk.mkdir()
    with small_disk(disk):
        series = series_in(disk, clock)
        series.begin()
        put(series, *range(10))
        clock.now_s += SYNC_S
        series.tend()
        fill(disk / "hog")
        put(series, *range(10, 500))
        clock.now_s += SYNC_S
        series.tend()
        assert "No space" in str(series.trouble)
        assert numbers_in(our_logs(disk)[0]) == list(range(10))
        (disk / "hog").unlink()
        clock.now_s += RETRY_FIRST_S
        series.tend()
        put(series, 500)
        series.end()
        assert series.lost == 490
        assert numbers_in(our_logs(disk)[-1]) == [500]


def test_a_space_floor_that_cannot_be_held_ends_the_file_properly(
    tmp_path: Path, clock: ManualClock
) -> None:
    free = shutil.disk_usage(tmp_path).free
    series = series_in(tmp_path, clock)
    series.begin()
    put(series, 1)
    series._target = FolderTarget(tmp_path, limits(free_bytes=2 * free))
    clock.now_s += SYNC_S
    series.tend()
    assert "below the floor" in str(series.trouble)
    (log,) = our_logs(tmp_path)
    with log.open("rb") as stream:
        assert make_reader(stream).get_summary() is not None
    series.end()


def test_messages_that_cannot_be_written_do_not_end_the_recording(
    tmp_path: Path, clock: ManualClock
) -> None:
    series = series_in(tmp_path, clock)
    series.begin()
    put(series, 1)
    for _ in range(3):
        series.write(lambda file: file.add_record("/x", (1, 2), 5, 5))
        series.write(lambda file: file.add_raw("/mavlink/rx/a", -1, b"before 1970"))
        series.write(lambda file: file.add_raw("/mavlink/rx/a", 1 << 64, b"too late"))
        series.write(lambda file: file.add_raw("/mavlink/rx/\ud800", 1, b"no text"))
    put(series, 2)
    series.end()
    assert numbers_in(our_logs(tmp_path)[0]) == [1, 2]
    assert series.rejected == 12
    assert len(series.notices) == 3, "each kind is told once"


def test_an_attachment_that_cannot_be_written_does_not_end_the_recording(
    tmp_path: Path, clock: ManualClock
) -> None:
    series = series_in(tmp_path, clock)
    for name in ("gains/\udc80", "gains/a"):
        attachment = Attachment(name, "application/yaml", b"a: 1")
        series.keep("attachment", name, lambda file, one=attachment: file.attach(one, 1))
    series.begin()
    put(series, 1)
    series.end()
    (path,) = our_logs(tmp_path)
    assert (numbers_in(path), series.rejected) == ([1], 1)
    assert open_recording(path).attachments.keys() == {"gains/a"}
    assert "UnicodeEncodeError" in series.notices[0].text


def test_a_source_time_that_mcap_cannot_hold_gives_way_to_the_log_time(
    tmp_path: Path, clock: ManualClock
) -> None:
    series = series_in(tmp_path, clock)
    series.begin()
    record = RejectionRecord("late", 1)
    for publish_ns in (-1, 1 << 64, 3):
        series.write(lambda file, p=publish_ns: file.add_record("/rejected", record, 7, p))
    series.end()
    with our_logs(tmp_path)[0].open("rb") as stream:
        times = [message.publish_time for _, _, message in make_reader(stream).iter_messages()]
    assert times == [7, 7, 3]
    assert series.rejected == 0


def test_left_over_files_are_repaired_at_the_next_start(tmp_path: Path, clock: ManualClock) -> None:
    crashed = series_in(tmp_path, clock)
    crashed.begin()
    put(crashed, *range(50))
    clock.now_s += SYNC_S
    crashed.tend()
    left_over = our_logs(tmp_path)[0]
    assert left_over.suffix == ".active"
    killed = tmp_path / "killed"
    killed.mkdir()
    shutil.copy(left_over, killed)
    with (killed / left_over.name).open("ab") as stream:
        stream.write(b"\x06\x99\x00\x00\x00\x00\x00\x00\x00 half a chunk")

    series = series_in(killed, clock)
    series.begin()
    wait_for_repair(series)
    put(series, 99)
    series.end()
    repaired, fresh = our_logs(killed)
    assert (repaired.suffix, fresh.suffix) == (".mcap", ".mcap")
    with repaired.open("rb") as stream:
        assert len(list(make_reader(stream).iter_messages())) == 50
    assert numbers_in(fresh) == [99]
    crashed.end()


def test_a_file_that_another_process_writes_is_left_alone(
    tmp_path: Path, clock: ManualClock
) -> None:
    other = LogFile(tmp_path / "20260101T000000Z_0123abcd_000001.mcap")
    other.add_raw("/mavlink/rx/a", 1, b"x")
    other.sync()
    size = other.active_path.stat().st_size
    series = series_in(tmp_path, clock)
    series.begin()
    wait_for_repair(series)
    assert other.active_path.stat().st_size == size
    assert not series.notices
    series.end()
    other.close()


def wait_for_repair(series: LogSeries) -> None:
    if series.repairing is not None:
        series.repairing.join()


def fill(path: Path) -> None:
    """Writes until the disk is full."""
    with contextlib.suppress(OSError), path.open("wb", 0) as stream:
        while stream.write(NOISE):
            pass


@contextmanager
def small_disk(folder: Path) -> Iterator[None]:
    command = ["mount", "-t", "tmpfs", "-o", "size=64k", "none", str(folder)]
    try:
        mounted = subprocess.run(command, check=False, capture_output=True).returncode == 0
    except FileNotFoundError:
        mounted = False
    if not mounted:
        pytest.skip("mounting a small file system is not permitted here; EFBIG is tested anyway")
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def _attachment(data: bytes) -> Attachment:
    return Attachment("configuration.yaml", "application/yaml", data)


def test_a_disk_that_fails_at_any_operation_never_raises(
    tmp_path: Path, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of write, fsync and rename fails at each of its first calls in turn."""
    for name in ("write", "fsync", "rename", "open"):
        true_call = getattr(os, name)
        for failing in range(12):
            folder = tmp_path / f"{name}{failing}"
            calls = count()

            def flaky(*arguments, call=true_call, calls=calls, failing=failing, **keywords):
                if next(calls) == failing:
                    raise OSError(errno.EIO, "Input/output error")
                return call(*arguments, **keywords)

            series = series_in(folder, clock)
            monkeypatch.setattr(os, name, flaky)
            series.begin()
            series.keep("metadata", "m", lambda file: file.describe("m", {"a": "b"}))
            for number in range(6):
                put(series, number)
                clock.now_s += 40.0
                series.tend()
            series.end()
            monkeypatch.setattr(os, name, true_call)
            found = [number for log in our_logs(folder) for number in numbers_in(log)]
            assert found == sorted(set(found))
            # What fails after the data were written costs nothing but is counted as if.
            assert len(found) + series.lost >= 6
            assert len(found) >= 4


def test_a_flood_does_not_rotate_earlier_flights_away(tmp_path: Path, clock: ManualClock) -> None:
    bounds = limits(file_bytes=20_000, files=10, run_bytes=40_000)
    for flight in range(3):
        with closing_series(tmp_path, clock, bounds) as series:
            put(series, flight)
    earlier = our_logs(tmp_path)
    random = Random(5)
    with closing_series(tmp_path, clock, bounds) as series:
        for number in range(200):
            noise = random.randbytes(2_000)
            series.write(lambda file, n=number, d=noise: file.add_raw("/mavlink/rx/a", n, d))
            clock.now_s += SYNC_S
            series.tend()
            flood = sum(log.stat().st_size for log in our_logs(tmp_path) if log not in earlier)
            assert flood <= 40_000 + 20_000, "the budget and the file in progress"
    assert our_logs(tmp_path)[:3] == earlier
    assert numbers_in(earlier[0]) == [0]
    assert series.opened > 10


@contextmanager
def closing_series(folder: Path, clock: ManualClock, bounds: LogLimits) -> Iterator[LogSeries]:
    series = series_in(folder, clock, bounds)
    series.begin()
    yield series
    series.end()


def test_logs_are_not_for_everybody(tmp_path: Path, clock: ManualClock) -> None:
    before = os.umask(0)
    try:
        with closing_series(tmp_path, clock, LIMITS) as series:
            put(series, 1)
    finally:
        os.umask(before)
    (log,) = our_logs(tmp_path)
    assert stat.S_IMODE(log.stat().st_mode) == 0o640


@pytest.mark.parametrize("is_damaged", [False, True])
def test_a_repaired_log_is_not_for_everybody_either(tmp_path: Path, is_damaged: bool) -> None:
    log = LogFile(tmp_path / "flight.mcap")
    for number in range(400):
        log.add_raw("/mavlink/rx/a", number, Random(number).randbytes(1_000))
    log.sync()
    log.abandon()
    log.active_path.chmod(0o644)
    if is_damaged:
        with log.active_path.open("r+b") as stream:
            stream.seek(300_000)  # not the first chunk, which names the channel
            stream.write(bytes(100))
        final = replace_damaged(log.active_path)
    else:
        final = complete_in_place(log.active_path)
    assert stat.S_IMODE(final.stat().st_mode) & 0o137 == 0

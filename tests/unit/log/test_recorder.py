"""The recorder as its callers see it: nothing lost, nothing raised, everything readable."""

import os
import signal
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path
from random import Random

import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from log_limits import limits
from mcap.reader import make_reader

from h2nav.errors import BadInput
from h2nav.integrity.severity import Severity
from h2nav.log import recorder as recorder_module
from h2nav.log.folder import our_logs
from h2nav.log.foxglove_messages import flat_fields
from h2nav.log.reader import is_closed
from h2nav.log.recorder import Recorder, RecorderRecord
from h2nav.log.series import LogSeries
from h2nav.recordings.recording import open_recording

LIMITS = limits()
SEED = 20_261_121
PROMISED_LOSS_NS = 1_000_000_000


def test_without_an_offset_the_log_is_on_the_monotonic_clock(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Recorder.to_file(path) as recorder:
        recorder.raw("udp", 12_345, b"bytes")
    recording = open_recording(path)
    assert recording.unix_offset_ns == 0
    assert [t_ns for t_ns, _ in recording.received()] == [12_345]


def test_what_goes_in_comes_out(tmp_path: Path) -> None:
    offset = 1_700_000_000_000_000_000
    half = 0.5**0.5
    status = RecorderRecord(1, 2, 3, 4, 5, 6)
    with Recorder(tmp_path / "new" / "folder", LIMITS, unix_offset_ns=offset) as recorder:
        recorder.attach("gains/a.yaml", "application/yaml", b"gains: 1\n")
        recorder.metadata("autopilot", {"version": "4.7.0"})
        recorder.raw("serial", offset + 1, b"\xfd\x00")
        recorder.raw("udp", offset + 1, b"second at the same time")
        recorder.raw("serial", offset + 1, b"third")
        recorder.sent("udp", offset + 2, b"ours")
        recorder.record("/recorder", status, offset + 3, publish_ns=offset - 7)
        recorder.transform(offset + 4, (half, 0.0, 0.0, half))
        recorder.text(offset + 5, Severity.WARNING, "link down")
    assert recorder.dropped == 0
    assert recorder.trouble is None
    assert recorder.path is not None
    recording = open_recording(recorder.path)
    assert list(recording.received()) == [
        (1, b"\xfd\x00"),
        (1, b"second at the same time"),
        (1, b"third"),
    ]
    assert list(recording.records("/recorder")) == [(offset + 3, status._asdict())]
    assert recording.attachments["gains/a.yaml"].data == b"gains: 1\n"
    assert recording.metadata["autopilot"] == {"version": "4.7.0"}
    by_topic = messages_of(recorder.path)
    assert by_topic["/mavlink/tx/udp"].data == b"ours"
    assert by_topic["/recorder"].publish_time == offset - 7
    q_nb = {"q_w": half, "q_x": 0.0, "q_y": 0.0, "q_z": half}
    assert flat_fields("foxglove.FrameTransform", by_topic["/tf"].data) == q_nb
    # A viewer takes a transform or pose without a place for a broken one.
    assert FrameTransform.FromString(by_topic["/tf"].data).HasField("translation")
    assert PoseInFrame.FromString(by_topic["/pose"].data).pose.HasField("position")
    assert flat_fields("foxglove.PoseInFrame", by_topic["/pose"].data) == q_nb
    assert flat_fields("foxglove.Log", by_topic["/log"].data) == {
        "level": "WARNING",
        "message": "link down",
    }


def test_a_single_file_is_lossless_even_when_the_queue_is_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "QUEUE_MESSAGES", 50)
    path = tmp_path / "replay.mcap"
    with Recorder.to_file(path) as recorder:
        for number in range(5_000):
            recorder.raw("a", number, b"")
    assert recorder.dropped == 0
    assert [t_ns for t_ns, _ in open_recording(path).received()] == list(range(5_000))


def test_a_single_file_never_replaces_another(tmp_path: Path) -> None:
    path = tmp_path / "replay.mcap"
    path.write_text("precious")
    with pytest.raises(BadInput, match="exists"):
        Recorder.to_file(path)
    with pytest.raises(BadInput, match="no such folder"):
        Recorder.to_file(tmp_path / "absent" / "replay.mcap")
    assert path.read_text() == "precious"


def test_a_hanging_disk_costs_messages_but_never_the_caller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk hangs in its first fsync; the queue stays bounded by count and by bytes."""
    released = threading.Event()
    hanging = threading.Event()
    true_fsync = os.fsync

    def hanging_fsync(descriptor: int) -> None:
        hanging.set()
        released.wait()
        true_fsync(descriptor)

    monkeypatch.setattr(os, "fsync", hanging_fsync)
    monkeypatch.setattr(recorder_module, "QUEUE_MESSAGES", 100)
    monkeypatch.setattr(recorder_module, "QUEUE_BYTES", 1000)
    recorder = Recorder(tmp_path, LIMITS)
    hanging.wait()
    for number in range(150):
        recorder.raw("a", number, b"")
    assert recorder.dropped == 50
    recorder.close(timeout_s=0.0)
    released.set()
    recorder.close()
    assert [t_ns for t_ns, _ in open_recording(our_logs(tmp_path)[0]).received()] == list(
        range(100)
    )
    assert recorder.statistics().dropped_queue_full == 50


def test_the_queue_is_bounded_in_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    released = threading.Event()
    true_fsync = os.fsync
    monkeypatch.setattr(os, "fsync", lambda fd: (released.wait(), true_fsync(fd))[1])
    monkeypatch.setattr(recorder_module, "QUEUE_BYTES", 10_000)
    recorder = Recorder(tmp_path, LIMITS)
    for number in range(100):
        recorder.raw("a", number, bytes(1_000))
    assert recorder.dropped == 89, "eleven thousand bytes are the first beyond ten thousand"
    released.set()
    recorder.close()


def test_no_folder_is_said_once_and_counted(tmp_path: Path) -> None:
    """Fault 20: a file stands where the folder should be."""
    blocked = tmp_path / "logs"
    blocked.write_text("")
    with Recorder(blocked, LIMITS) as recorder:
        for number in range(10):
            recorder.raw("a", number, b"x")
        recorder.transform(11, (1.0, 0.0, 0.0, 0.0))
    assert recorder.dropped == 11
    (notice,) = recorder.notices()
    assert notice.severity == Severity.ERROR
    assert str(blocked) in notice.text
    assert recorder.notices() == []
    assert recorder.path is None


def test_a_fault_in_the_recorder_itself_is_told_and_harms_nobody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def faulty(series: LogSeries) -> None:
        raise RuntimeError("a fault of ours")

    monkeypatch.setattr(LogSeries, "tend", faulty)
    monkeypatch.setattr(recorder_module, "QUEUE_MESSAGES", 10)
    recorder = Recorder(tmp_path, LIMITS)
    recorder.close()
    for number in range(20):
        recorder.raw("a", number, b"")
    assert recorder.dropped == 10
    (notice,) = recorder.notices()
    assert notice.text == "recording ended: RuntimeError: a fault of ours"
    assert recorder.trouble is not None


def test_kill_at_random_moments_loses_at_most_a_second(tmp_path: Path) -> None:
    """Fault 21: SIGKILL while writing; the next start repairs what it left."""
    random = Random(SEED)
    for trial in range(5):
        folder = tmp_path / str(trial)
        accepted_ns = kill_a_writer(folder, after_s=random.uniform(0.1, 1.8))
        (left_over,) = our_logs(folder)
        assert left_over.suffix == ".active"
        stored = list(open_recording(left_over).received())
        assert [data for _, data in stored] == [b"%d" % n for n in range(len(stored))]
        last_ns = stored[-1][0] if stored else accepted_ns[0]
        assert accepted_ns[1] - last_ns <= PROMISED_LOSS_NS
        with Recorder(folder, LIMITS) as recorder:
            recorder.wait_for_repair()
        assert is_closed(our_logs(folder)[0])
        assert len(list(open_recording(our_logs(folder)[0]).received())) == len(stored)


def kill_a_writer(folder: Path, after_s: float) -> tuple[int, int]:
    """Monotonic times (ns) of the first and last message that the killed process handed over."""
    mark = folder.with_suffix(".mark")
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(folder), str(mark)], stdout=subprocess.PIPE
    )
    assert writer.stdout is not None
    assert writer.stdout.readline() == b"running\n"
    time.sleep(after_s)  # the random moment itself
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    writer.stdout.close()
    first_ns, last_ns = struct.unpack("<qq", mark.read_bytes())
    return first_ns, last_ns


WRITER = """
import mmap, struct, sys, time
from h2nav.apps.configuration import LogSettings
from h2nav.apps.log_contents import log_limits
from h2nav.log.series import LogSeries
from h2nav.log.recorder import Recorder
with open(sys.argv[2], "w+b") as mark:
    mark.write(bytes(16)); mark.flush()
    shared = mmap.mmap(mark.fileno(), 16)
    recorder = Recorder(sys.argv[1], log_limits(LogSettings(min_free_mb=0)))
    number = 0
    while True:
        now = time.monotonic_ns()
        recorder.raw("a", now, b"%d" % number)
        if number == 0:
            shared[:8] = struct.pack("<q", now)
            while recorder.path is None:
                time.sleep(0.001)
            print("running", flush=True)
        shared[8:] = struct.pack("<q", now)
        number += 1
        time.sleep(0.0005)
"""


def messages_of(path: Path) -> dict[str, object]:
    with path.open("rb") as stream:
        return {
            channel.topic: message for _, channel, message in make_reader(stream).iter_messages()
        }

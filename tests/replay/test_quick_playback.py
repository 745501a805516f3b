"""A replay that looks at many frames at once gives what the daemon's own way gives.

Of long flights a part is played; `H2NAV_WHOLE_FLIGHTS=1` plays all of them, which takes minutes.
"""

import os
from pathlib import Path

import pytest
from needs import REPOSITORY, shared_data

from h2nav.apps.pipeline import Pipeline
from h2nav.apps.playback import (
    SILENCE_NS,
    TICK_NS,
    Playback,
    PlaybackOptions,
    inputs_for,
    pipeline_for,
)
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.integrity.findings import Severity
from h2nav.log.recorder import Recorder
from h2nav.recordings.link_recording import Recording
from h2nav.recordings.recording import open_recording
from h2nav.wire.deframer import Frame

pytestmark = pytest.mark.thorough

TAKEOFF = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"
ATTITUDE = 30
UNIX_S = 1_795_000_000.0  # of recordings without a date it is today
FLIGHTS = (
    "boot.bytes",
    "brisk_wind.tlog",
    "calm.tlog",
    "compass_1_hard_iron.tlog",
    "gps_lost.tlog",
    "imu_1_fails.tlog",
    "magnet_vibration.tlog",
    "plane.tlog",
    "px4_agile_reboot.tlog",
    "px4_hard_iron.tlog",
)


class Everything:
    """Keeps what it is told, as a watcher and as an observer."""

    message_ids = frozenset({ATTITUDE})

    def __init__(self) -> None:
        self.told: list[tuple[object, ...]] = []

    def frame(self, t_ns: int, frame: Frame) -> None:
        self.told.append((t_ns, frame))

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        self.told.append((t_ns, repr(estimate), late_ns))  # NaN is not equal to itself

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        self.told.append((t_ns, severity, text))

    def message(self, t_ns: int, message: object) -> None:
        self.told.append((t_ns, message))

    def record(self, t_ns: int, topic: str, record: object) -> None:
        self.told.append((t_ns, topic, repr(record)))


def as_the_daemon_does(recording: Recording, pipeline: Pipeline) -> object:
    """Datagram by datagram, with timers that run on in silence."""
    newest_ns = None
    for t_ns, data in recording.received():
        if newest_ns is None:
            newest_ns = t_ns
            pipeline.link(t_ns, True)
        for silent_ns in range(newest_ns + TICK_NS, min(t_ns, newest_ns + SILENCE_NS), TICK_NS):
            pipeline.tick(silent_ns)
        pipeline.tick(t_ns)
        pipeline.received(t_ns, data)
        newest_ns = t_ns
    return pipeline.deframer.counters


def quickly(recording: Recording, pipeline: Pipeline) -> object:
    played = Playback(recording, whole_frames=False)
    for _ in played.through(pipeline):
        pass
    return played.counters


def outcome(path: Path, play, recorder: Recorder | None = None) -> tuple[list[object], object]:
    recording = open_recording(path)
    inputs = inputs_for(recording, PlaybackOptions())._replace(unix_s=UNIX_S)
    heard = Everything()
    pipeline = pipeline_for(recording, inputs, recorder, heard, observer=heard)
    counters = play(recording, pipeline)
    service = pipeline.service
    states = [service.findings, service.rejected, service.state_s, repr(service.health)]
    return heard.told, [counters, recording.notes, *states]


def cut(path: Path, folder: Path) -> Path:
    """The beginning and a part of the middle: damage where they meet, and a long silence."""
    if os.environ.get("H2NAV_WHOLE_FLIGHTS") == "1":
        return path
    data = path.read_bytes()
    short = folder / path.name
    middle = len(data) // 2
    short.write_bytes(data[:200_000] + data[middle : middle + 300_000])
    return short


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_comes_out_the_same(name: str, tmp_path: Path) -> None:
    path = cut(shared_data(f"flights/{name}"), tmp_path)
    told, ends = outcome(path, quickly)
    expected_told, expected_ends = outcome(path, as_the_daemon_does)
    assert len(told) > 600
    assert told == expected_told
    assert ends == expected_ends


def test_the_log_of_a_replay_is_the_same_and_replays_the_same(tmp_path: Path) -> None:
    path = tmp_path / "takeoff.tlog"
    path.write_bytes(TAKEOFF.read_bytes()[:150_000])
    contents, outcomes = [], []
    for name, play in (("quick", quickly), ("daemon", as_the_daemon_does)):
        log = tmp_path / f"{name}.mcap"
        with Recorder.to_file(log, open_recording(path).unix_offset_ns) as recorder:
            outcomes.append(outcome(path, play, recorder))
        contents.append(log)
    assert outcomes[0] == outcomes[1]
    quick, daemon = (list(open_recording(log).received()) for log in contents)
    assert quick == daemon == list(open_recording(path).received())
    again = [outcome(log, quickly)[0] for log in contents]
    assert again[0] == again[1]

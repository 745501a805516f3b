"""A recording through the pipeline, in this process, with everything that came out."""

import dataclasses
import math
import struct
from pathlib import Path

from needs import REPOSITORY

from h2nav.apps.configuration import Configuration
from h2nav.apps.filters import FilterFactory
from h2nav.apps.pipeline import Outlets, Pipeline
from h2nav.apps.playback import Playback
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.files.earth_field import earth_field_at
from h2nav.integrity.findings import Severity
from h2nav.recordings.link_recording import Recording
from h2nav.recordings.recording import open_recording
from h2nav.recordings.reference import ErrorTable, Reference
from h2nav.service.records import EstimateRecord, estimate_record
from h2nav.service.service import Service, Surroundings
from h2nav.wire.deframer import Deframer, Frame

TAKEOFF = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"


def rewritten(
    path: Path, *, without: int = -1, times: int = 1, first_s: float = float("inf")
) -> Path:
    """The take-off as a tlog: without a message, several times in a row, or its first seconds."""
    entries = list(open_recording(TAKEOFF).received())
    start_ns = entries[0][0]
    kept = [
        (t_ns, data)
        for t_ns, data in entries
        if t_ns - start_ns < first_s * 1e9
        and without not in (frame.msg_id for frame in Deframer().feed(data))
    ]
    span_ns = kept[-1][0] - kept[0][0] + 1_000_000_000
    path.write_bytes(
        b"".join(
            struct.pack(">Q", (t_ns + turn * span_ns) // 1000) + data
            for turn in range(times)
            for t_ns, data in kept
        )
    )
    return path


class Replayed:
    """Looks on while a recording runs through the service.

    Args:
        path: a recording.
        configuration: of the daemon.

    Attributes:
        pipeline: at the end of the recording.
        estimates: all of them.
        notices: what the service said.
    """

    def __init__(self, path: Path, configuration: Configuration) -> None:
        recording = open_recording(path)
        self.reference = Reference()
        self.message_ids = self.reference.message_ids
        self.estimates: list[EstimateRecord] = []
        self.notices: list[tuple[Severity, str]] = []
        quiet = dataclasses.replace(configuration.autopilot, request_streams=False)
        configuration = dataclasses.replace(configuration, autopilot=quiet)
        filters = FilterFactory.shipped(configuration.filter, configuration.autopilot.imu_rate_hz)
        unix_s = recording.unix_start_ns * 1e-9
        service = Service(
            configuration.service, Surroundings(filters.filter_for, earth_field_at, unix_s)
        )
        outlets = Outlets(lambda t_ns: t_ns, None, None, self)
        self.pipeline = Pipeline(service, configuration.output.component_id, outlets)
        self._run(recording)

    def _run(self, recording: Recording) -> None:
        for t_ns, data in recording.received():
            self.pipeline.link(t_ns, True)
            self.pipeline.tick(t_ns)
            self.pipeline.received(t_ns, data)

    def errors(self, skip_s: float = 0.0) -> ErrorTable:
        """Against SIMSTATE, else ATTITUDE, without the first `skip_s` seconds."""
        return self.reference.table(skip_s)

    def frame(self, t_ns: int, frame: Frame) -> None:
        self.reference.frame(t_ns, frame)

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        record = estimate_record(estimate, late_ns)
        self.reference.estimate(t_ns, estimate)
        self.estimates.append(record)

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        self.notices.append((severity, text))


class QuicklyReplayed(Replayed):
    """The same by the way of `h2nav replay`, in half the time (replay/test_quick_playback.py).

    Args:
        path: a recording.
        configuration: of the daemon.
        until_s: how much of it is played.
    """

    def __init__(self, path: Path, configuration: Configuration, until_s: float = math.inf) -> None:
        self._until_s = until_s
        super().__init__(path, configuration)

    def _run(self, recording: Recording) -> None:
        playback = Playback(recording, whole_frames=False)
        for _ in playback.through(self.pipeline):
            if playback.span_ns > 1e9 * self._until_s:
                break

"""What the pipeline tells of the recording, and how loudly."""

import time
from pathlib import Path

from log_limits import limits

from h2nav.apps.configuration import Configuration
from h2nav.apps.filters import FilterFactory
from h2nav.apps.pipeline import Outlets, Pipeline
from h2nav.files.earth_field import earth_field_at
from h2nav.integrity.findings import Severity
from h2nav.links.link_statistics import LinkStatistics
from h2nav.log.recorder import Recorder
from h2nav.service.service import Service, Surroundings


class Listener:
    """Keeps what it is told."""

    message_ids: frozenset[int] = frozenset()

    def __init__(self) -> None:
        self.told: list[tuple[Severity, str]] = []

    def frame(self, *_: object) -> None:
        """Not of interest."""

    def estimate(self, *_: object) -> None:
        """Not of interest."""

    def notice(self, _: int, severity: Severity, text: str) -> None:
        self.told.append((severity, text))


def told_of_a_recording_to(folder: Path) -> list[tuple[Severity, str]]:
    configuration, listener = Configuration(), Listener()
    filters = FilterFactory.shipped(configuration.filter, configuration.autopilot.imu_rate_hz)
    recorder = Recorder(folder, limits())
    surroundings = Surroundings(filters.filter_for, earth_field_at, time.time(), 0)
    service = Service(configuration.service, surroundings)
    pipeline = Pipeline(service, 191, Outlets(lambda t_ns: t_ns, None, recorder, listener))
    recorder.wait_for_repair()
    recorder.close()
    pipeline.report(1, LinkStatistics())
    return listener.told


def test_a_recording_that_stops_is_told_as_an_error(tmp_path: Path) -> None:
    place = tmp_path / "no_folder"
    place.write_text("in the way")
    ((severity, text),) = told_of_a_recording_to(place)
    assert severity == Severity.ERROR
    assert text.startswith(f"recording stopped: {place}: ")


def test_a_repaired_log_is_told_as_a_notice(tmp_path: Path) -> None:
    left_over = tmp_path / "20260101T000000Z_0123abcd_000001.mcap.active"
    with Recorder(tmp_path / "made", limits()) as recorder:
        recorder.raw("a", 1, b"x")
    (made,) = (tmp_path / "made").iterdir()
    left_over.write_bytes(made.read_bytes()[:-100])
    ((severity, text),) = told_of_a_recording_to(tmp_path)
    assert severity == Severity.NOTICE
    assert text.endswith("_000001.mcap: repaired")

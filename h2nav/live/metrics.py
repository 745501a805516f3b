"""Prometheus metrics of the daemon: base units, counters that end in ``_total``.

An unknown value has no sample.
"""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.metrics_core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from h2nav import __version__
from h2nav.live.state import LiveState
from h2nav.service.health import ServiceState


class _Row(NamedTuple):
    """A field of a record that becomes a metric."""

    name: str  # of the metric, without ``h2nav_`` and ``_total``
    help: str  # its help text
    topic: str  # of the record
    field: str  # of the record
    scale: float = 1.0  # from the field's unit to the metric's


_COUNTERS = (
    _Row("samples_used", "Inertial samples that made an estimate.", "/health", "samples_used"),
    _Row("samples_refused", "Inertial samples refused.", "/health", "samples_rejected"),
    _Row("attitudes_sent", "Attitude messages sent.", "/health", "estimates_sent"),
    _Row("link_received_bytes", "Bytes received from the link.", "/link", "bytes_in"),
    _Row("link_sent_bytes", "Bytes sent on the link.", "/link", "bytes_out"),
    _Row("link_dropped_frames", "Frames that could not be sent.", "/link", "frames_dropped"),
    _Row("link_opened", "How often the link came up.", "/link", "opened"),
    _Row("link_errors", "Failed openings, losses, failed sends.", "/link", "errors"),
    _Row("frames", "Good MAVLink frames.", "/deframer", "frames"),
    _Row("frames_bad_checksum", "Frames with a wrong checksum.", "/deframer", "bad_crc"),
    _Row("skipped_bytes", "Bytes outside of good frames.", "/deframer", "skipped_bytes"),
    _Row("log_messages", "Messages written to the log.", "/recorder", "written"),
    _Row("log_dropped", "Messages the disk was too slow for.", "/recorder", "dropped_queue_full"),
    _Row("log_lost", "Messages lost to a failed or full disk.", "/recorder", "lost_disk"),
    _Row("log_files", "Log files opened.", "/recorder", "files"),
    _Row("flights", "Flights that ended.", "/flights", "flown"),
    _Row("flights_reviewed", "Recordings that were reviewed.", "/flights", "reviewed"),
    _Row("flights_failed", "Recordings that could not be reviewed.", "/flights", "failed"),
    _Row("flights_with_errors", "Reviews with an error.", "/flights", "with_errors"),
    _Row("fetched_bytes", "Of the autopilot's own logs.", "/flights", "fetched_bytes"),
    _Row("cpu_seconds", "Processor time of the daemon.", "/feed", "cpu_s"),
    _Row("live_dropped", "Packets that found no room.", "/feed", "dropped"),
)
_GAUGES = (
    _Row("imu_rate_hertz", "Rate of the inertial samples.", "/health", "imu_rate_hz"),
    _Row("lateness_seconds", "Of the newest estimate.", "/health", "late_ms", 1e-3),
    _Row("armed", "What the autopilot says.", "/health", "armed"),
    _Row("sample_age_seconds", "Since the newest sample arrived.", "/status", "age_ms", 1e-3),
    _Row("log_file_bytes", "Size of the present log file.", "/recorder", "file_bytes"),
    _Row("flights_reviewing", "A review runs.", "/flights", "is_reviewing"),
    _Row("resident_memory_bytes", "Of the daemon.", "/feed", "memory_bytes"),
)
_RATIOS = ("velocity", "force", "field", "turn")
_PARTS = ("tilt", "heading")
_ANGLES = ("roll", "pitch", "yaw")


def metrics_text(state: LiveState, viewers: int) -> bytes:
    """The exposition format of Prometheus."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Snapshot(state, viewers))
    return generate_latest(registry)


class _Snapshot(Collector):
    """The metrics at one moment."""

    def __init__(self, state: LiveState, viewers: int) -> None:
        self._state = state
        self._viewers = viewers

    def collect(self) -> Iterator[Metric]:
        yield _gauge("info", "Which h2nav this is.", ("version",), [((__version__,), 1.0)])
        yield _gauge(
            "silence_seconds", "Since the daemon was heard.", (), [((), self._state.silent_s)]
        )
        yield _gauge("live_viewers", "Who look at the page.", (), [((), self._viewers)])
        yield from self._states()
        for row in _COUNTERS:
            yield from self._of(row, CounterMetricFamily)
        for row in _GAUGES:
            yield from self._of(row, GaugeMetricFamily)
        yield from self._attitude()
        yield from self._tests()
        yield from self._troubles()

    def _of(
        self, row: _Row, kind: type[CounterMetricFamily] | type[GaugeMetricFamily]
    ) -> Iterator[Metric]:
        value = self._value(row.topic, row.field)
        if value is not None:
            yield kind(f"h2nav_{row.name}", row.help, value=value * row.scale)

    def _states(self) -> Iterator[Metric]:
        seen = self._state.newest("/health")
        if seen is not None:
            rows = [
                ((each.value,), float(each.value == seen.record.state)) for each in ServiceState
            ]
            yield _gauge("state", "1 for the state that the service is in.", ("state",), rows)

    def _attitude(self) -> Iterator[Metric]:
        ours = [((name,), self._value("/estimate", f"{name}_deg")) for name in _ANGLES]
        yield _gauge("attitude_degrees", "Our attitude, Euler angles z-y-x.", ("angle",), ours)
        sure = [((part,), self._value("/estimate", f"sigma_{part}_deg")) for part in _PARTS]
        yield _gauge("deviation_degrees", "One sigma of our attitude.", ("part",), sure)
        apart = [((part,), self._value("/status", f"{part}_deg")) for part in _PARTS]
        yield _gauge("difference_degrees", "Autopilot against us.", ("part",), apart)
        sigma = [((part,), self._value("/status", f"sigma_{part}_deg")) for part in _PARTS]
        yield _gauge(
            "difference_deviation_degrees", "One sigma of the difference.", ("part",), sigma
        )

    def _tests(self) -> Iterator[Metric]:
        ratios = [((name,), self._value("/status", f"{name}_ratio")) for name in _RATIOS]
        yield _gauge("test_ratio", "Innovation test ratios; 1 = it fails.", ("test",), ratios)
        lanes = [seen.record for seen in self._state.all_of("/lanes")]
        yield _gauge(
            "lane_ratio",
            "Test ratio of each IMU; 1 = it fails.",
            ("imu",),
            [((str(lane.imu),), lane.ratio) for lane in lanes],
        )

    def _troubles(self) -> Iterator[Metric]:
        alarms = len(self._state.alarms)
        wrong = len(self._state.preflight)
        yield _gauge("preflight_faults", "What is wrong before arming.", (), [((), wrong)])
        yield _gauge("alarms", "Things that are wrong at present.", (), [((), alarms)])
        findings = CounterMetricFamily("h2nav_findings", "Things that were found to be wrong.")
        findings.add_metric([], self._state.findings_begun)
        yield findings
        refused = CounterMetricFamily(
            "h2nav_refusals", "Samples and messages refused.", labels=["reason"]
        )
        for seen in self._state.all_of("/rejected"):
            refused.add_metric([seen.record.reason], seen.record.total)
        yield refused

    def _value(self, topic: str, field: str) -> float | None:
        seen = self._state.newest(topic)
        return None if seen is None else getattr(seen.record, field)


def _gauge(
    name: str,
    text: str,
    labels: tuple[str, ...],
    rows: Iterable[tuple[tuple[str, ...], float | None]],
) -> GaugeMetricFamily:
    gauge = GaugeMetricFamily(f"h2nav_{name}", text, labels=labels)
    for values, value in rows:
        if value is not None and not math.isnan(value):
            gauge.add_metric(values, value)
    return gauge

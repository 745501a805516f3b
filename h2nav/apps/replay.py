"""``h2nav replay``: plays any recording through the service, as fast as possible."""

import argparse
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from h2nav.apps import playback
from h2nav.apps.filters import FilterFactory
from h2nav.apps.json_output import print_json
from h2nav.apps.log_contents import attach_inputs, version_of
from h2nav.apps.log_progress import byte_bar
from h2nav.apps.pipeline import Pipeline
from h2nav.apps.playback import Playback
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.errors import TaskFailed
from h2nav.integrity.findings import Severity, as_mapping
from h2nav.maths import quaternion
from h2nav.maths.units import DEG
from h2nav.recordings.frame_tables import TableMaker
from h2nav.recordings.link_recording import Recording
from h2nav.recordings.listener import Listener
from h2nav.recordings.opening import open_flight
from h2nav.recordings.reference import Reference, TimedEstimates
from h2nav.recordings.smoothed import smoothed, smoothed_record
from h2nav.service.records import EstimateRecord, estimate_record
from h2nav.wire.deframer import Frame
from h2nav.wire.readers import Message

if TYPE_CHECKING:  # loaded where a log is written
    from h2nav.log.recorder import Recorder

ESTIMATE_TOPIC = "/estimate"
SMOOTHED_TOPIC = "/smoothed"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    parser.add_argument(
        "log",
        type=Path,
        metavar="LOG",
        help="a .tlog, raw .bytes, our .mcap, or an autopilot's .bin, .log or .ulg",
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="OUT.mcap", help="default: LOG's name + .replay.mcap"
    )
    parser.add_argument("--no-log", action="store_true", help="write no MCAP")
    playback.add_arguments(parser)
    parser.add_argument("--no-gps", action="store_true", help="do not fuse the GPS velocity")
    parser.add_argument(
        "--smooth",
        action="store_true",
        help="also run the filter backward: the attitude from past and future samples becomes the "
        "channel /smoothed and a second error table",
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Replays the recording and prints the error table."""
    recording = open_flight(args.log)
    options = playback.options(args)._replace(gps_velocity=False if args.no_gps else None)
    inputs = playback.inputs_for(recording, options)
    output = None if args.no_log else (args.output or _free_name(args.log))
    recorder = None
    if output is not None:
        from h2nav.log.recorder import Recorder

        recorder = Recorder.to_file(output, recording.unix_offset_ns)
        attach_inputs(recorder, inputs.configuration, inputs.filters, inputs.unix_s)
    # A second pass over the file, in step with the first, yields the estimates to compare with.
    original = open_flight(args.log) if inputs.is_original else None
    watcher = _Watcher(original if isinstance(original, Recording) else None)
    listener = Listener(inputs.filters.filter_for)
    filters = listener if args.smooth else inputs.filters
    pipeline = playback.pipeline_for(
        recording, inputs, recorder, watcher, filters.filter_for, watcher
    )
    tables = TableMaker(watcher.reference.message_ids)
    played = playback.Playback(recording, whole_frames=inputs.whole_frames, tables=tables)
    smoothed_table = None
    started_s = time.perf_counter()
    try:
        with byte_bar("replaying") as progress:
            for _ in played.through(pipeline, before=listener.arrives if args.smooth else None):
                progress(*recording.progress)
        watcher.reference.tables(tables.tables())
        elapsed_s = time.perf_counter() - started_s
        if args.smooth:
            estimates = _smooth(listener, inputs.filters, recorder, recording.unix_offset_ns)
            smoothed_table = watcher.reference.table(estimates=estimates)
    finally:
        if recorder is not None:
            recorder.close()
    loss = None if recorder is None else _loss(recorder)
    result = _result(pipeline, played, watcher, elapsed_s)
    if smoothed_table is not None:
        result["rms_deg_smoothed"] = smoothed_table.as_mapping()
    result["log"] = None if output is None else str(output)
    if args.json:
        print_json(result)
    else:
        _show(result)
    if loss is not None:
        raise TaskFailed(f"{output}: {loss}")
    if not result["imu_samples"]:
        raise TaskFailed(f"{args.log}: no IMU samples of a known autopilot in it")
    return 0


def _smooth(
    listener: Listener, filters: FilterFactory, recorder: "Recorder | None", offset_ns: int
) -> TimedEstimates:
    """The smoothed estimates, which are also logged."""
    estimates = TimedEstimates()
    for arrived_us, attitudes in smoothed(listener, filters.filter_for):
        for at_us, estimate in zip(arrived_us.tolist(), attitudes.estimates(), strict=True):
            assert estimate is not None
            t_ns = 1000 * at_us
            estimates.add(t_ns, estimate)
            if recorder is not None:
                recorder.record(SMOOTHED_TOPIC, smoothed_record(estimate), t_ns + offset_ns)
    return estimates


def _loss(recorder: "Recorder") -> str | None:
    """What is missing in the log, and why; None if it is complete."""
    if not recorder.dropped and recorder.trouble is None:
        return None
    statistics = recorder.statistics()
    return (
        f"the log is incomplete: {recorder.dropped} of {recorder.dropped + statistics.written} "
        f"messages are lost ({recorder.trouble or 'they could not be encoded'}); name another "
        "place with -o, or use --no-log"
    )


class _Watcher:
    """Collects the error table and, for logs of h2nav, compares every estimate."""

    message_ids: frozenset[int] = frozenset()

    def __init__(self, original: Recording | None) -> None:
        self.reference = Reference()
        self.compared = 0
        self.equal = 0
        self.apart_rad = 0.0
        self.compares = original is not None
        self.recorded_by = "" if original is None else version_of(original)
        self._recorded: Iterator[tuple[int, dict[str, Any]]] = iter(())
        if original is not None:
            self._recorded = original.records(ESTIMATE_TOPIC)
        self._next = next(self._recorded, None)

    def frame(self, t_ns: int, frame: Frame) -> None:
        """The tables have them."""

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        self.reference.estimate(t_ns, estimate)
        # one that another version did not make, or only it made, has nothing to be compared with
        while self._next is not None and self._next[1]["t_us"] < estimate.t_us:
            self._next = next(self._recorded, None)
        if self._next is not None and self._next[1]["t_us"] == estimate.t_us:
            self.compared += 1
            self._compare(self._next[1], estimate_record(estimate, late_ns))
            self._next = next(self._recorded, None)

    def _compare(self, recorded: dict[str, Any], record: EstimateRecord) -> None:
        if _is_equal(recorded, record):
            self.equal += 1
            return
        q_nb = (record.q_w, record.q_x, record.q_y, record.q_z)
        before = (recorded["q_w"], recorded["q_x"], recorded["q_y"], recorded["q_z"])
        self.apart_rad = max(self.apart_rad, quaternion.angle(before, q_nb))

    def message(self, t_ns: int, message: Message) -> None:
        self.reference.message(message)

    def record(self, t_ns: int, topic: str, record: object) -> None:
        """The log has it."""

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        print(f"{severity.word}: {text}", file=sys.stderr)


def _is_equal(recorded: dict[str, Any], record: EstimateRecord) -> bool:
    """Bit-for-bit equality of everything logged except lateness; NaN is null there."""
    return all(
        recorded[name] == value or (recorded[name] is None and math.isnan(value))
        for name, value in record._asdict().items()
        if name != "late_ms" and name in recorded
    )


def _compared(result: dict[str, Any]) -> str:
    """How they compare with the log's: another version's kernel may round otherwise."""
    compared = result["estimates_compared"]
    differ = compared - result["estimates_equal"]
    if not differ:
        return f"estimates equal: {compared} of {compared}"
    apart, version = result["estimates_apart_deg"], result["recorded_by"] or "unknown"
    return (
        f"{differ} of {compared} estimates differ by up to {apart:.2g} deg "
        f"(recorded by version {version})"
    )


def _free_name(log: Path) -> Path:
    """An unused name in the working directory."""
    name, number = Path(f"{log.stem}.replay.mcap"), 1
    while name.exists():
        number += 1
        name = Path(f"{log.stem}.replay-{number}.mcap")
    return name


def _result(
    pipeline: Pipeline, played: Playback, watcher: _Watcher, elapsed_s: float
) -> dict[str, Any]:
    health = pipeline.service.health
    table = watcher.reference.table()
    duration_s = played.span_ns * 1e-9
    counters = played.counters
    damaged = {name: getattr(counters, name) for name in ("bad_crc", "unknown_id", "skipped_bytes")}
    result: dict[str, Any] = {
        "imu_samples": health.samples_used,
        "imu_message": health.imu_message,
        "duration_s": round(duration_s, 3),
        "x_realtime": round(duration_s / elapsed_s, 1),
        "reference": table.reference or None,
        "compared": table.compared,
        "rms_deg": table.as_mapping(),
        "rejected": {**pipeline.service.rejected, **damaged},
        "states": {name: round(s, 3) for name, s in pipeline.service.state_s.items()},
        "honesty": watcher.reference.honesty(),
        "findings": [as_mapping(finding) for finding in pipeline.service.findings],
    }
    if watcher.compares:
        result["estimates_compared"] = watcher.compared
        result["estimates_equal"] = watcher.equal
        result["estimates_apart_deg"] = watcher.apart_rad / DEG
        result["recorded_by"] = watcher.recorded_by
    return result


def _show(result: dict[str, Any]) -> None:
    print(
        f"{result['imu_samples']} samples of {result['imu_message'] or 'no IMU message'} in "
        f"{result['duration_s']:.1f} s of recording, {result['x_realtime']:.0f} x real time"
    )
    if result["reference"]:
        for key, what in (("rms_deg", "RMS error"), ("rms_deg_smoothed", "smoothed")):
            if key in result:
                rms = "  ".join(f"{name} {value:.3f}" for name, value in result[key].items())
                print(f"{what} against {result['reference']} in deg:  {rms}")
    else:
        print("the recording holds neither SIMSTATE nor ATTITUDE to compare with")
    rejected = {reason: count for reason, count in result["rejected"].items() if count}
    print(f"refused: {rejected or 'nothing'}")
    states = "  ".join(f"{name} {lasted_s:.1f} s" for name, lasted_s in result["states"].items())
    print(f"states: {states}")
    for finding in result["findings"]:
        span = f"{finding['from_s']:.1f} to {finding['to_s']:.1f} s"
        print(f"{span}: {finding['source']}: {finding['text']} ({finding['evidence']})")
    if "estimates_compared" in result:
        print(_compared(result))
    if result["log"]:
        print(f"log: {result['log']}")

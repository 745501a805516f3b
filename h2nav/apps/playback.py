"""Plays a recording through the daemon's service: its inputs, and the playback."""

import argparse
import dataclasses
import sys
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from h2nav.airframes.features import FlightRow
from h2nav.apps import configuration
from h2nav.apps.algorithms import NAMES, algorithm
from h2nav.apps.configuration import Configuration
from h2nav.apps.filters import FilterFactory
from h2nav.apps.log_contents import RecordedInputs, inputs_of
from h2nav.apps.pipeline import Observer, Outlets, Pipeline, PlayedFrames, Watcher
from h2nav.attitude.gains.envelope import VEHICLE_CLASSES
from h2nav.errors import BadInput
from h2nav.files.earth_field import UNDATED_UNIX_S, earth_field_at
from h2nav.recordings.frame_tables import TableMaker
from h2nav.recordings.imported import ImportedLog
from h2nav.recordings.imu_frames import ImuFrames
from h2nav.recordings.link_recording import Recording
from h2nav.service.lane import FilterFor
from h2nav.service.service import Service, Surroundings
from h2nav.wire.arrivals import Arrivals
from h2nav.wire.deframer import DeframerCounters
from h2nav.wire.frame_scan import FoundFrames, FrameScan

if TYPE_CHECKING:  # loaded where a log is written
    from h2nav.log.recorder import Recorder

Source = Recording | ImportedLog
TICK_NS = 100_000_000
# After a silence of this length the service has nothing more to report.
SILENCE_NS = 60_000_000_000


class PlaybackOptions(NamedTuple):
    """The user's changes to the recording's own inputs; None = unchanged."""

    config: Path | None = None  # configuration file
    filter_name: str | None = None  # filter to run
    vehicle_class: str | None = None  # instead of the heartbeat's
    gps_velocity: bool | None = None  # fuse the GPS velocity
    calibrates: bool = False  # a review also reports what could be calibrated better
    earlier: tuple[FlightRow, ...] = ()  # of earlier flights, which a review compares it with


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the options that `options` reads."""
    parser.add_argument(
        "-c",
        "--config",
        type=Path,
        metavar="CONFIG.yaml",
        help="configuration (default: the one in our MCAP, else the defaults)",
    )
    parser.add_argument(
        "--filter",
        choices=NAMES,
        help="filter to run instead of the configured one",
    )
    parser.add_argument(
        "--class",
        dest="vehicle_class",
        choices=VEHICLE_CLASSES,
        help="vehicle class instead of the heartbeat's",
    )


def options(args: argparse.Namespace) -> PlaybackOptions:
    """Reads the changes from the command line."""
    return PlaybackOptions(args.config, args.filter, args.vehicle_class)


class Inputs(NamedTuple):
    """The inputs of a playback."""

    configuration: Configuration  # in force
    filters: FilterFactory  # creates the filter
    unix_s: float  # the date of the run
    is_original: bool  # nothing differs from the run that made the recording
    # the run verified signatures: its recording holds exactly the admitted frames
    whole_frames: bool


def inputs_for(recording: Source, options: PlaybackOptions) -> Inputs:
    """Configuration and gains: the recording's own, with the user's changes.

    Raises:
        BadInput: a configuration or a gain file is not usable.
    """
    recorded = _recorded(recording, has_own=options.config is not None)
    if recorded is not None and recorded.remark and options.config is None:
        print(f"{recording.path}: {recorded.remark}", file=sys.stderr)
    if options.config is not None:
        chosen = configuration.read(options.config)
    else:
        chosen = recorded.configuration if recorded else Configuration()
    chosen = _changed(chosen, options)
    whole_frames = recorded is not None and bool(recorded.configuration.signing.key_file)
    if recorded is not None and not recorded.remark and chosen == recorded.configuration:
        filters = FilterFactory.recorded(
            chosen.filter, chosen.autopilot.imu_rate_hz, recorded.gain_files
        )
        filters.check()
        return Inputs(chosen, filters, recorded.unix_s, True, whole_frames)
    filters = FilterFactory.shipped(chosen.filter, chosen.autopilot.imu_rate_hz)
    if chosen.filter.gains != "auto":  # the user's own; of the shipped ones most are not needed
        filters.check()
    return Inputs(chosen, filters, date_of(recording, recorded), False, whole_frames)


def date_of(recording: Source, recorded: RecordedInputs | None) -> float:
    """The initial date, UNIX seconds; where the recording has none, that of the field's model."""
    if recorded is not None:
        return recorded.unix_s
    return recording.unix_start_ns * 1e-9 or UNDATED_UNIX_S


def _changed(chosen: Configuration, options: PlaybackOptions) -> Configuration:
    changes: dict[str, Any] = {}
    if options.filter_name is not None:
        changes["name"] = options.filter_name
        # The name alone selects the arithmetic.
        possible = algorithm(options.filter_name).makers
        if chosen.filter.arithmetic not in possible:
            changes["arithmetic"] = next(iter(possible))
    if options.vehicle_class is not None:
        changes["vehicle_class"] = options.vehicle_class
    chosen = dataclasses.replace(chosen, filter=dataclasses.replace(chosen.filter, **changes))
    if options.gps_velocity is not None:
        chosen = fusing_gps(chosen, options.gps_velocity)
    return chosen


def fusing_gps(chosen: Configuration, is_wanted: bool) -> Configuration:
    """The configuration with or without the GPS velocity."""
    aiding = dataclasses.replace(chosen.aiding, gps_velocity=is_wanted)
    return dataclasses.replace(chosen, aiding=aiding)


def _recorded(recording: Source, *, has_own: bool) -> RecordedInputs | None:
    """The inputs of the recording's run; unusable ones are ignored if the user gives inputs."""
    if isinstance(recording, ImportedLog):
        return None
    try:
        return inputs_of(recording)
    except BadInput:
        if has_own:
            return None
        raise


def pipeline_for(
    recording: Source,
    inputs: Inputs,
    recorder: "Recorder | None",
    watcher: Watcher,
    filter_for: FilterFor | None = None,
    observer: Observer | None = None,
) -> Pipeline:
    """The daemon's pipeline without requests and outputs.

    Args:
        recording: whose times the log uses.
        filter_for: creates the filter instead of the inputs.
    """
    offset_ns = recording.unix_offset_ns
    settings = inputs.configuration.service
    asks_nobody = dataclasses.replace(settings.autopilot, request_streams=False)
    service = Service(
        dataclasses.replace(settings, autopilot=asks_nobody),
        Surroundings(
            filter_for or inputs.filters.filter_for,
            earth_field_at,
            inputs.unix_s,
            offset_ns,
            has_listener=False,
        ),
    )
    outlets = Outlets(lambda t_ns: t_ns + offset_ns, None, recorder, watcher, observer)
    return Pipeline(service, inputs.configuration.output.component_id, outlets)


class Playback:
    """Plays a recording as fast as possible.

    Args:
        whole_frames: see `Inputs`.
        tables: also gets all frames, however many services hear them.
    """

    def __init__(
        self, recording: Source, *, whole_frames: bool, tables: TableMaker | None = None
    ) -> None:
        self._tables = tables
        self.span_ns = 0  # from the first arrival to the newest one
        self._recording = recording
        self._scan = FrameScan(whole_frames=whole_frames)
        self._first_ns: int | None = None
        self._newest_ns = 0

    @property
    def counters(self) -> DeframerCounters:
        """Counters of the recording's bytes."""
        return self._scan.deframer.counters

    def through(
        self, *pipelines: Pipeline, before: Callable[[int], object] | None = None
    ) -> Iterator[int]:
        """Plays everything through all pipelines.

        Args:
            before: called with the time (ns) of each message and timer before a pipeline is.

        Yields:
            The time (ns) of the playback: at the first arrival, at the last one, and often enough
            in between for timers to run on time.
        """
        if isinstance(self._recording, ImportedLog):
            yield from self._imported(self._recording, pipelines, before)
            return
        ids = frozenset[int]().union(*(pipeline.wanted_ids for pipeline in pipelines))
        for arrivals in self._recording.batches():
            found = self._scan.frames_of(arrivals)
            if self._tables is not None:
                self._tables.add(found)
            batch = _Batch(arrivals, found, ids)
            first = 0
            while first < len(batch.times):
                is_very_first = self._first_ns is None
                yield from self._time_passes(batch.times[first], pipelines, before)
                stop = first + 1
                if not is_very_first:
                    stop = batch.end(first, min(each.next_timer_ns for each in pipelines))
                for pipeline in pipelines:
                    batch.play(pipeline, first, stop, before)
                self._passed(batch.times[stop - 1])
                yield self._newest_ns
                first = stop

    def _time_passes(
        self,
        t_ns: int,
        pipelines: Sequence[Pipeline],
        before: Callable[[int], object] | None,
    ) -> Iterator[int]:
        """Advances the clock to an arrival: links come up, timers run."""
        if self._first_ns is None:
            self._first_ns = self._newest_ns = t_ns
            for pipeline in pipelines:
                pipeline.link(t_ns, True)
        # As in the daemon, timers also run while nothing arrives.
        newest_ns = self._newest_ns
        for silent_ns in range(newest_ns + TICK_NS, min(t_ns, newest_ns + SILENCE_NS), TICK_NS):
            for pipeline in pipelines:
                pipeline.tick(silent_ns)
            yield silent_ns
        if before is not None:
            before(t_ns)
        for pipeline in pipelines:
            pipeline.tick(t_ns)

    def _passed(self, t_ns: int) -> None:
        assert self._first_ns is not None
        self._newest_ns = t_ns
        self.span_ns = t_ns - self._first_ns

    def _imported(
        self,
        log: ImportedLog,
        pipelines: Sequence[Pipeline],
        before: Callable[[int], object] | None,
    ) -> Iterator[int]:
        """Plays a log whose events are not bytes."""
        t_ns = due_ns = 0
        for envelope, message in log.events():
            t_ns = envelope.t_ns
            if self._first_ns is None:
                self._first_ns = t_ns
                for pipeline in pipelines:
                    pipeline.link(t_ns, True)
            if before is not None:
                before(t_ns)
            for pipeline in pipelines:
                pipeline.imported(envelope, message)
            if t_ns >= due_ns:
                due_ns = t_ns + TICK_NS
                self._passed(t_ns)
                yield t_ns
        if self._newest_ns < t_ns:
            self._passed(t_ns)
            yield t_ns


class _Batch:
    """Arrivals with those of their frames that are needed."""

    def __init__(self, arrivals: Arrivals, found: FoundFrames, ids: Collection[int]) -> None:
        self.times: list[int] = arrivals.t_ns.tolist()  # of arrival, ns
        self._arrivals = arrivals
        self._data = found.data
        self._completed_by, self._frames, rows = found.wanted(ids)
        self._readings = ImuFrames(found, rows)
        self._pauses = [*arrivals.pauses(TICK_NS), len(self.times)]

    def end(self, first: int, due_ns: int) -> int:
        """End of the arrivals, from `first`, before a timer is due or a gap begins."""
        pause = self._pauses[bisect_right(self._pauses, first)]
        return min(bisect_left(self.times, due_ns, first + 1), pause)

    def play(
        self,
        pipeline: Pipeline,
        first: int,
        stop: int,
        before: Callable[[int], object] | None,
    ) -> None:
        """Sends the arrivals from `first` up to `stop` through a pipeline."""
        if not pipeline.records:
            pipeline.play(self._frames_of(first, stop), before)
            return
        for number in range(first, stop):
            pipeline.record_stream(self.times[number], self._arrivals.piece(number))
            pipeline.play(self._frames_of(number, number + 1), before)

    def _frames_of(self, first: int, stop: int) -> PlayedFrames:
        begin = bisect_left(self._completed_by, first)
        frames = self._frames[begin : bisect_left(self._completed_by, stop, begin)]
        return PlayedFrames(self._data, frames, begin, self._readings.reading)

"""Plays one recording through the service and analyses it as a whole, for `h2nav review`."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import orjson

from h2nav.apps import playback
from h2nav.apps.filters import FilterFactory
from h2nav.apps.playback import Playback, PlaybackOptions
from h2nav.calibration.evidence import PX4, Evidence
from h2nav.calibration.files import ParameterFormat, written
from h2nav.calibration.vehicle import calibrate, document_of
from h2nav.errors import BadInput
from h2nav.files.path_text import readable
from h2nav.log.progress import Progress
from h2nav.recordings.autopilot_log import has_enough_samples
from h2nav.recordings.context import Context
from h2nav.recordings.imported import ImportedLog
from h2nav.recordings.listener import Listener
from h2nav.recordings.opening import Source, open_flight
from h2nav.recordings.smoothed import smoothed
from h2nav.recordings.telemetry import read_context
from h2nav.reviews.analysis import Analysis, analyse
from h2nav.reviews.collecting import Collector, EstimateRows, most_trusted
from h2nav.reviews.document import document
from h2nav.reviews.flight import Estimates, Flight
from h2nav.reviews.page import page
from h2nav.service.service import Service

# A note of a review: of so many samples.
UNSMOOTHED = "samples without a smoothed attitude, because its arithmetic failed"


class Reviewed(NamedTuple):
    """The parts of a review."""

    flight: Flight  # as played
    analysis: Analysis  # of the whole flight


def review(
    source: Source,
    options: PlaybackOptions,
    *,
    smooths: bool = True,
    progress: Progress = lambda done, total: None,
) -> Reviewed:
    """Plays, smooths and analyses a recording.

    Args:
        source: the recording; unless the caller holds it, it is freed before the smoother runs.
        smooths: runs the filter backward as well.
        progress: called with the bytes done and the total.

    Raises:
        BadInput: the configuration is not usable.
    """
    return _reviewed(source, options, smooths, progress)[0]


def _reviewed(
    source: Source, options: PlaybackOptions, smooths: bool, progress: Progress
) -> tuple[Reviewed, "_Heard | None"]:
    """The review, and what a calibration needs."""
    flight, heard = _played(source, options, progress)
    flight = flight._replace(earlier=options.earlier)
    del source  # it may hold half of the memory
    if smooths and heard is not None:
        failed: list[int] = []
        flight = flight._replace(smoothed=_smoothed(*heard, left_out=failed.append))
        if failed:
            notes = flight.context.notes | {UNSMOOTHED: sum(failed)}
            flight = flight._replace(context=flight.context._replace(notes=notes))
    return Reviewed(flight, analyse(flight)), heard


def _calibration(flight: Flight, heard: "_Heard") -> dict[str, Any]:
    """The calibration from one flight, in the form of the document, with the file's text."""
    free = _smoothed(*heard, with_field=False)
    if free is None:
        return {}
    found = calibrate([Evidence(flight, free, flight.context.parameters)])
    is_px4 = found.autopilot == PX4
    form = ParameterFormat.QGROUNDCONTROL if is_px4 else ParameterFormat.ARDUPILOT
    return document_of(found) | {
        "file_name": f"{flight.name}.{'params' if is_px4 else 'param'}",
        "file": written(found, form) if found.changes else "",
    }


def evidence_of(
    source: Source,
    options: PlaybackOptions,
    parameters: Mapping[str, float],
    *,
    progress: Progress = lambda done, total: None,
) -> Evidence:
    """The evidence for a calibration: the flight, and its attitude without any compass.

    Args:
        parameters: of the autopilot, which override those in the recording.

    Raises:
        BadInput: the recording gives no attitude, or the configuration is not usable.
    """
    name = source.path
    flight, heard = _played(source, options, progress)
    free = None if heard is None else _smoothed(*heard, with_field=False)
    if free is None:
        raise BadInput(f"{name}: {flight.why_no_estimate or 'no attitude'}; nothing to calibrate")
    return Evidence(flight, free, {**flight.context.parameters, **parameters})


class _Heard(NamedTuple):
    """The parts of a played flight that its smoother needs."""

    listener: Listener  # the inputs of the most trusted IMU's filter
    filters: FilterFactory  # creates such a filter
    start_ns: int  # host time of the recording's first arrival


def _played(
    source: Source, options: PlaybackOptions, progress: Progress
) -> tuple[Flight, _Heard | None]:
    """Plays a flight without smoothing and analysis; frees what only the playback needs."""
    context = _context(source)
    collector = Collector()
    if not has_enough_samples(context):
        return _without_estimate(source, context), None
    inputs = playback.inputs_for(source, options)
    listener = Listener(inputs.filters.filter_for)
    pipeline = playback.pipeline_for(
        source, inputs, None, collector, listener.filter_for, observer=collector
    )
    played = Playback(source, whole_frames=inputs.whole_frames)
    for t_ns in played.through(pipeline, before=listener.arrives):
        collector.arrives(t_ns)
        progress(*source.progress)
    flight = _flight(source, context, collector, pipeline.service)
    if flight.estimates is None:
        return flight, None
    chosen = (listener, *listener.others)[most_trusted(flight.findings, collector.sent_s())]
    chosen.others.clear()
    return flight, _Heard(chosen, inputs.filters, collector.start_ns)


def write_review(
    path: Path,
    folder: Path,
    name: str,
    options: PlaybackOptions,
    *,
    smooths: bool = True,
    progress: Progress = lambda done, total: None,
) -> dict[str, Any]:
    """Reviews a recording and writes ``folder/name.html`` and ``folder/name.json``.

    Args:
        path: of any kind that `open_flight` accepts.
        folder: existing folder.
        name: of the files, without suffix.

    Returns:
        The JSON document.

    Raises:
        BadInput: not a recording, or the configuration is not usable.
        OSError: a file cannot be written.
    """
    reviewed, heard = _reviewed(open_flight(path), options, smooths, progress)
    found = document(*reviewed)
    if options.calibrates and heard is not None:
        found["calibration"] = _calibration(reviewed.flight, heard)
    (folder / f"{name}.html").write_text(page(*reviewed, found), encoding="utf-8")
    (folder / f"{name}.json").write_bytes(orjson.dumps(found, option=orjson.OPT_INDENT_2))
    return found


def _context(source: Source) -> Context:
    return source.context() if isinstance(source, ImportedLog) else read_context(source)


def _without_estimate(source: Source, context: Context) -> Flight:
    """A flight whose sensors were recorded too seldom, or not at all."""
    lacks = [phrase for phrase in context.missing if "IMU" in phrase]
    return _flight(source, context, Collector(), None)._replace(
        why_no_estimate=f"the recording holds {lacks[0] if lacks else 'too few IMU samples'}"
    )


def _flight(
    source: Source, context: Context, collector: Collector, service: Service | None
) -> Flight:
    """A flight without smoothing and analysis; without a service it was not played."""
    estimates = collector.estimates()
    reason = "" if service is None else service.health.reason
    return Flight(
        name=readable(source.path.stem),
        file=readable(source.path.name),
        kind=source.kind,
        autopilot="" if service is None else service.bound_to,
        context=context,
        estimates=estimates,
        smoothed=None,
        why_no_estimate="" if estimates is not None else _why_none(context, reason),
        imu_message="" if service is None else service.health.imu_message,
        ratios=collector.ratios(),
        earth=collector.earth(),
        states=collector.states(),
        lanes=collector.lanes(),
        notices=tuple(collector.notices),
        findings=() if service is None else service.findings,
        rejected={} if service is None else service.rejected,
        held=collector.held(),
    )


def _why_none(context: Context, reason: str) -> str:
    lacks = [phrase for phrase in context.missing if "heartbeats" in phrase]
    return f"the recording holds {lacks[0]}" if lacks else reason


def _smoothed(
    listener: Listener,
    filters: FilterFactory,
    start_ns: int,
    *,
    with_field: bool = True,
    left_out: Callable[[int], object] = lambda count: None,
) -> Estimates | None:
    rows = EstimateRows()
    found = smoothed(listener, filters.filter_for, with_field=with_field, left_out=left_out)
    for arrived_us, attitudes in found:
        rows.add_all(1000 * arrived_us - start_ns, attitudes)
    return rows.estimates()

"""One recording, played through the service and looked at as a whole, for `h2nav review`."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import orjson

from h2nav.apps import playback
from h2nav.apps.filters import FilterFactory
from h2nav.apps.playback import Playback, Wishes
from h2nav.evaluation.dataset.recorded import Listener
from h2nav.evaluation.dataset.smoothed import smoothed
from h2nav.flightlogs.autopilot_log import has_enough_samples
from h2nav.flightlogs.context import Context
from h2nav.flightlogs.imported import ImportedLog
from h2nav.flightlogs.opening import Source, open_flight
from h2nav.flightlogs.telemetry import read_context
from h2nav.review.analysis import Analysis, analyse
from h2nav.review.collecting import Collector, estimates_of, most_trusted
from h2nav.review.document import document
from h2nav.review.flight import Estimates, Flight
from h2nav.review.page import page
from h2nav.service.service import Service

Progress = Callable[[int, int], object]


class Reviewed(NamedTuple):
    """What a review is made of.

    Attributes:
        flight: as it was played.
        analysis: what only the whole of it shows.
    """

    flight: Flight
    analysis: Analysis


def review(
    path: Path,
    wished: Wishes,
    *,
    smooths: bool = True,
    progress: Progress = lambda done, total: None,
) -> Reviewed:
    """Plays a recording, smooths, and looks at the whole of it.

    Args:
        path: of any kind that `open_flight` knows.
        wished: configuration, filter and vehicle class.
        smooths: runs the filter backward as well.
        progress: is called with the bytes done and in all.

    Raises:
        BadInput: the file is no recording, or the configuration cannot be used.
    """
    return review_source(open_flight(path), wished, smooths=smooths, progress=progress)


def review_source(
    source: Source,
    wished: Wishes,
    *,
    smooths: bool = True,
    progress: Progress = lambda done, total: None,
) -> Reviewed:
    """The same of a recording that is open.

    Args:
        source: the recording.
        wished: see `review`.
        smooths: see `review`.
        progress: see `review`.

    Raises:
        BadInput: the configuration cannot be used.
    """
    context = _context(source)
    collector = Collector()
    if not has_enough_samples(context):
        flight = _without_estimate(source, context)
        return Reviewed(flight, analyse(flight))
    inputs = playback.inputs_for(source, wished)
    listener = Listener(inputs.filters.filter_for)
    pipeline = playback.pipeline_for(
        source, inputs, None, collector, listener.filter_for, observer=collector
    )
    played = Playback(source, whole_frames=inputs.whole_frames)
    for t_ns in played.through(pipeline, before=listener.arrives):
        collector.arrives(t_ns)
        progress(*source.progress)
    flight = _flight(source, context, collector, pipeline.service)
    if smooths and flight.estimates is not None:
        lane = most_trusted(flight.findings, flight.lanes)
        heard = (listener, *listener.others)[lane]
        flight = flight._replace(smoothed=_smoothed(heard, inputs.filters, collector))
    return Reviewed(flight, analyse(flight))


def write_review(
    path: Path,
    folder: Path,
    name: str,
    wished: Wishes,
    *,
    smooths: bool = True,
    progress: Progress = lambda done, total: None,
) -> dict[str, Any]:
    """Reviews a recording and writes ``folder/name.html`` and ``folder/name.json``.

    Args:
        path: see `review`.
        folder: that exists.
        name: of the files.
        wished: see `review`.
        smooths: see `review`.
        progress: see `review`.

    Returns:
        What the JSON holds.

    Raises:
        BadInput: see `review`.
        OSError: a file cannot be written.
    """
    reviewed = review(path, wished, smooths=smooths, progress=progress)
    found = document(*reviewed)
    (folder / f"{name}.html").write_text(page(*reviewed), encoding="utf-8")
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
    """A flight before it is smoothed and analysed; without a service it was not played."""
    estimates = collector.estimates()
    reason = "" if service is None else service.health.reason
    return Flight(
        name=source.path.stem,
        file=source.path.name,
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


def _smoothed(listener: Listener, filters: FilterFactory, collector: Collector) -> Estimates | None:
    rows = [
        (
            (t_ns - collector.start_ns) * 1e-9,
            *record[1:5],
            record.bias_x_rad_s,
            record.bias_y_rad_s,
            record.bias_z_rad_s,
            record.sigma_tilt_deg,
            record.sigma_heading_deg,
        )
        for t_ns, record in smoothed(listener, filters.filter_for)
    ]
    return estimates_of(rows) if rows else None

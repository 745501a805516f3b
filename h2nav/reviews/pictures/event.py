"""The end of a flight in one picture: some 20 s of attitude, demand, motors and height."""

from h2nav.integrity.findings import Finding, Severity
from h2nav.reviews.flight import Flight
from h2nav.reviews.pictures.attitude import attitude_lines
from h2nav.reviews.pictures.columns import Columns
from h2nav.reviews.pictures.control import stick_lines
from h2nav.reviews.pictures.picture import Lines, PictureRow, PictureRows, Section, Stack
from h2nav.reviews.pictures.timeline import MOMENTS, vehicle_rows
from h2nav.reviews.pictures.vehicle import height_lines, motor_lines, voltage_lines

BEFORE_S, AFTER_S = 15.0, 5.0
# An impact this soon after a loss of control belongs to the same event.
SAME_EVENT_S = 15.0
COLUMNS = 500
MAX_EVENTS = 4


def event(flight: Flight, findings: tuple[Finding, ...]) -> Section:
    """The first event, and the others on demand."""
    stacks = [_stack(flight, group) for group in _events(findings)[:MAX_EVENTS]]
    return Section(
        "event",
        stacks[0].title if stacks else "",
        tuple(stack._replace(title="") for stack in stacks[:1]),
        further=tuple(stacks[1:]),
        further_title=f"later: {'; '.join(stack.title.lower() for stack in stacks[1:])}",
    )


def _events(findings: tuple[Finding, ...]) -> list[list[Finding]]:
    """Groups findings of moments into events, in order of time."""
    groups: list[list[Finding]] = []
    for one in sorted(findings, key=lambda finding: finding.from_s):
        if one.kind not in MOMENTS or one.severity > Severity.WARNING:
            continue
        if groups and one.from_s - groups[-1][0].from_s <= SAME_EVENT_S:
            groups[-1].append(one)
        else:
            groups.append([one])
    return groups


def _stack(flight: Flight, group: list[Finding]) -> Stack:
    context = flight.context
    first_s, last_s = group[0].from_s, group[-1].from_s
    begin_s = max(0.0, min(first_s - 0.25 * BEFORE_S, last_s - BEFORE_S))
    end_s = max(min(context.duration_s, last_s + AFTER_S), begin_s + 1.0)
    window_s = begin_s, end_s
    columns = Columns(end_s - begin_s, COLUMNS, begin_s)
    lanes: list[Lines | PictureRows] = [
        picture._replace(window_s=window_s)
        for picture in (
            *attitude_lines(flight, columns, window_s),
            stick_lines(context, columns),
            motor_lines(context, columns)._replace(title="Motors"),
            height_lines(context, columns),
            voltage_lines(context, columns)._replace(title="Battery"),
        )
        if picture.traces
    ]
    rows = tuple(_part(row, window_s) for row in vehicle_rows(flight) if _changes(row, window_s))
    if rows:
        lanes.append(PictureRows("", "", rows, window_s))
    title = ", ".join(f"{MOMENTS[one.kind]} at {one.from_s:.1f} s" for one in group)
    about = "Dashed violet is the demand. A brown line is the moment itself."
    return Stack(title[:1].upper() + title[1:], about, tuple(lanes))


def _changes(row: PictureRow, window_s: tuple[float, float]) -> bool:
    """Whether something begins or ends in the window; constant rows are omitted."""
    begin_s, end_s = window_s
    return any(begin_s < one.from_s <= end_s or begin_s < one.to_s < end_s for one in row.spans)


def _part(row: PictureRow, window_s: tuple[float, float]) -> PictureRow:
    """The part of a row in the window."""
    begin_s, end_s = window_s
    kept = [
        (span, colour)
        for span, colour in zip(row.spans, row.colours, strict=True)
        if span.from_s <= end_s and span.to_s >= begin_s
    ]
    return PictureRow(
        row.label, tuple(span for span, _ in kept), tuple(colour for _, colour in kept)
    )

"""The time line as rows of bars: modes, armed, states, sensors in use, aids, findings."""

from h2nav.integrity.findings import Finding, Severity
from h2nav.recordings.context import Span
from h2nav.reviews.certainty import GROUPS, aids
from h2nav.reviews.flight import Flight
from h2nav.reviews.pictures import colours
from h2nav.reviews.pictures.picture import PictureRow, PictureRows, Section

_STATES = {"active": colours.GOOD, "degraded": colours.BAD, "aligning": colours.DOUBTFUL}
# Limit for recordings with more spans than a picture can show.
MAX_SPANS = 500
MAX_FINDING_ROWS = 4
MAX_MARKS = 12
# Findings of a moment, marked in every picture.
MOMENTS = {
    "crash": "impact",
    "hard_landing": "hard landing",
    "loss_of_control": "control lost",
    "motor_failed": "motor failed",
}


def mode_backdrop(flight: Flight) -> list[tuple[float, float, str, str]]:
    """From, to, name and pale colour of every flight mode, as background of the pictures."""
    spans = flight.context.modes[:MAX_SPANS]
    return [
        (*span, colour) for span, colour in zip(spans, _by_name(spans, colours.MODES), strict=True)
    ]


def marks(flight: Flight, findings: tuple[Finding, ...]) -> list[tuple[float, str, str]]:
    """Moments marked in every picture over time: time, text, colour."""
    found = [
        (one.from_s, MOMENTS[one.kind], colours.IMPACT)
        for one in findings
        if one.kind in MOMENTS and one.severity <= Severity.WARNING
    ]
    reported = [
        (fault.t_s, fault.text, colours.REPORTED) for fault in flight.context.faults if fault.code
    ]
    return sorted(found[:MAX_MARKS] + reported[:MAX_MARKS])


def vehicle_rows(flight: Flight) -> list[PictureRow]:
    """Modes, arming, take-off, and the autopilot's reports."""
    context = flight.context
    airborne = _airborne(flight)
    rows = [
        _row(label, spans)
        for label, spans in (
            ("flight mode", context.modes),
            ("armed", context.armed),
            ("in the air (autopilot)", airborne),
        )
    ]
    return [*rows, *_reported(flight), *_moments(flight)]


def timeline(flight: Flight, findings: tuple[Finding, ...]) -> Section:
    """The vehicle's time line as one picture."""
    context = flight.context
    rows = _found(findings[:MAX_SPANS])
    rows += vehicle_rows(flight)
    rows.append(_row("autopilot's estimator", context.primary))
    picture = PictureRows(
        "Time line",
        "Findings, the worst in the first row; modes, states and reports of the autopilot.",
        tuple(row for row in rows if row.spans),
    )
    return Section("timeline", "Time line", (picture,) if picture.rows else ())


def own_rows(flight: Flight) -> PictureRows:
    """h2nav itself: its state, its aids, its tests."""
    states = flight.states[:MAX_SPANS]
    rows = [
        _row("IMU that h2nav used", flight.lanes),
        PictureRow("h2nav", states, tuple(_state(span.name) for span in states)),
    ]
    for name in dict.fromkeys(span.name for span in flight.held):
        spans = tuple(span for span in flight.held if span.name == name)[:MAX_SPANS]
        rows.append(PictureRow(f"held by {name}", spans, (colours.GOOD,) * len(spans)))
    rows += [
        PictureRow(
            f"tested: {GROUPS[group]}",
            spans[:MAX_SPANS],
            (colours.GOOD,) * len(spans[:MAX_SPANS]),
        )
        for group, spans in aids(flight).items()
    ]
    return PictureRows(
        "What held our attitude",
        "h2nav is 'active' while its attitude can be trusted and 'degraded' while it cannot. "
        "'Held by' says what else than gyro and gravity it rested on; 'tested' what could be "
        "compared with what.",
        tuple(row for row in rows if row.spans),
    )


def _airborne(flight: Flight) -> tuple[Span, ...]:
    series = flight.context.airborne
    if series is None or len(series.t_s) == 0:
        return ()
    ends = (*series.t_s[1:], flight.context.duration_s)
    spans = [
        Span(float(begin), float(end), "airborne")
        for begin, end, value in zip(series.t_s, ends, series.values, strict=True)
        if value > 0.0
    ]
    joined: list[Span] = []
    for span in spans:
        if joined and span.from_s <= joined[-1].to_s:
            joined[-1] = joined[-1]._replace(to_s=span.to_s)
        else:
            joined.append(span)
    return tuple(joined)


def _moments(flight: Flight) -> list[PictureRow]:
    """Moments: warnings in words, events, changed parameters."""
    context = flight.context
    warnings = [said for said in context.said if said.severity <= Severity.WARNING][:MAX_SPANS]
    occurrences = context.occurrences[:MAX_SPANS]
    changes = context.changes[:MAX_SPANS]
    return [
        PictureRow(
            "autopilot says",
            tuple(Span(one.t_s, one.t_s, one.text) for one in warnings),
            tuple(_severity(one.severity) for one in warnings),
        ),
        PictureRow(
            "events",
            tuple(Span(one.t_s, one.t_s, one.text) for one in occurrences),
            (colours.REPORTED,) * len(occurrences),
        ),
        PictureRow(
            "parameters changed",
            tuple(Span(one.t_s, one.t_s, f"{one.name} {one.after:.6g}") for one in changes),
            (colours.REPORTED,) * len(changes),
        ),
    ]


def _reported(flight: Flight) -> list[PictureRow]:
    """Faults reported by the autopilot until they are resolved, one row per subsystem."""
    spans: dict[str, list[Span]] = {}
    for fault in flight.context.faults:
        row = spans.setdefault(fault.subsystem, [])
        if row and row[-1].to_s == flight.context.duration_s:
            row[-1] = row[-1]._replace(to_s=fault.t_s)
        if fault.code:
            row.append(Span(fault.t_s, flight.context.duration_s, fault.text))
    return [
        PictureRow(
            f"autopilot reports: {subsystem.replace('_', ' ')}",
            tuple(row[:MAX_SPANS]),
            (colours.BAD,) * len(row[:MAX_SPANS]),
        )
        for subsystem, row in spans.items()
        if row
    ]


def _found(findings: tuple[Finding, ...]) -> list[PictureRow]:
    """The worst findings in the first row, overlapping ones in unlabelled rows below."""
    rows: list[list[Finding]] = []
    for one in findings:
        free = [row for row in rows if all(_is_apart(one, other) for other in row)]
        if free:
            free[0].append(one)
        elif len(rows) < MAX_FINDING_ROWS:
            rows.append([one])
    for row in rows:
        row.sort(key=lambda one: one.from_s)
    return [
        PictureRow(
            "findings" if number == 0 else "",
            tuple(Span(one.from_s, one.to_s, one.text) for one in row),
            tuple(_severity(one.severity) for one in row),
        )
        for number, row in enumerate(rows)
    ]


def _is_apart(one: Finding, other: Finding) -> bool:
    return one.from_s > other.to_s or other.from_s > one.to_s


def _row(label: str, spans: tuple[Span, ...]) -> PictureRow:
    return PictureRow(label, spans[:MAX_SPANS], _by_name(spans[:MAX_SPANS], colours.BARS))


def _by_name(spans: tuple[Span, ...], palette: tuple[str, ...]) -> tuple[str, ...]:
    numbers: dict[str, int] = {}
    return tuple(colours.of(palette, numbers.setdefault(span.name, len(numbers))) for span in spans)


def _state(name: str) -> str:
    return _STATES.get(name.partition(":")[0], colours.UNKNOWN)


def _severity(severity: Severity) -> str:
    if severity <= Severity.ERROR:
        return colours.BAD
    return colours.DOUBTFUL if severity == Severity.WARNING else colours.BARS[0]

"""What was when, as rows of bars: modes, armed, states, sensors in use, aids, findings."""

from h2nav.flightlogs.context import Span
from h2nav.integrity.findings import Finding, Severity
from h2nav.review.certainty import GROUPS, aids
from h2nav.review.flight import Flight
from h2nav.review.pictures import colours
from h2nav.review.pictures.picture import Row, Rows, Section

_STATES = {"active": colours.GOOD, "degraded": colours.BAD, "aligning": colours.DOUBTFUL}
# What is drawn and told of recordings with more spans than a picture can show.
MOST_SPANS = 500
MOST_FINDING_ROWS = 4


def mode_backdrop(flight: Flight) -> list[tuple[float, float, str, str]]:
    """From, to, name and pale colour of every flight mode, for behind the pictures."""
    spans = flight.context.modes[:MOST_SPANS]
    return [
        (*span, colour) for span, colour in zip(spans, _by_name(spans, colours.MODES), strict=True)
    ]


def timeline(flight: Flight, findings: tuple[Finding, ...]) -> Section:
    """One picture."""
    context = flight.context
    rows = _found(findings[:MOST_SPANS])
    rows += [
        _row(label, spans)
        for label, spans in (
            ("flight mode", context.modes),
            ("armed", context.armed),
            ("autopilot's estimator", context.primary),
            ("IMU that h2nav used", flight.lanes),
        )
    ]
    states = flight.states[:MOST_SPANS]
    rows.append(Row("h2nav", states, tuple(_state(span.name) for span in states)))
    for name in dict.fromkeys(span.name for span in flight.held):
        spans = tuple(span for span in flight.held if span.name == name)[:MOST_SPANS]
        rows.append(Row(f"held by {name}", spans, (colours.GOOD,) * len(spans)))
    rows += [
        Row(
            f"tested: {GROUPS[group]}",
            spans[:MOST_SPANS],
            (colours.GOOD,) * len(spans[:MOST_SPANS]),
        )
        for group, spans in aids(flight).items()
    ]
    picture = Rows(
        "What was when",
        "h2nav is 'active' while its attitude can be trusted and 'degraded' while it cannot. "
        "'Held by' says what else than gyro and gravity it rested on; 'tested' what could be "
        "compared with what.",
        tuple(row for row in rows if row.spans),
    )
    return Section("timeline", "Time line", (picture,) if picture.rows else ())


def _found(findings: tuple[Finding, ...]) -> list[Row]:
    """The worst findings in the first row, what overlaps them in rows without a label below."""
    rows: list[list[Finding]] = []
    for one in findings:
        free = [row for row in rows if all(_is_apart(one, other) for other in row)]
        if free:
            free[0].append(one)
        elif len(rows) < MOST_FINDING_ROWS:
            rows.append([one])
    return [
        Row(
            "findings" if number == 0 else "",
            tuple(Span(one.from_s, one.to_s, one.text) for one in row),
            tuple(_severity(one.severity) for one in row),
        )
        for number, row in enumerate(rows)
    ]


def _is_apart(one: Finding, other: Finding) -> bool:
    return one.from_s > other.to_s or other.from_s > one.to_s


def _row(label: str, spans: tuple[Span, ...]) -> Row:
    return Row(label, spans[:MOST_SPANS], _by_name(spans[:MOST_SPANS], colours.BARS))


def _by_name(spans: tuple[Span, ...], palette: tuple[str, ...]) -> tuple[str, ...]:
    numbers: dict[str, int] = {}
    return tuple(colours.of(palette, numbers.setdefault(span.name, len(numbers))) for span in spans)


def _state(name: str) -> str:
    return _STATES.get(name.partition(":")[0], colours.UNKNOWN)


def _severity(severity: Severity) -> str:
    if severity <= Severity.ERROR:
        return colours.BAD
    return colours.DOUBTFUL if severity == Severity.WARNING else colours.BARS[0]

"""The page of a flight's review: one self-contained HTML file."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from h2nav.integrity.findings import Finding
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.calibration import calibration_section
from h2nav.reviews.cards import cards, is_wrong
from h2nav.reviews.certainty import GROUPS
from h2nav.reviews.chain import chain
from h2nav.reviews.crash_card import crash_cards
from h2nav.reviews.flight import Flight
from h2nav.reviews.html import asset, data_block, escape, frame, table
from h2nav.reviews.parameters import Value, matters_for_attitude
from h2nav.reviews.pictures import (
    attitude,
    colours,
    compass,
    control,
    event,
    grounds,
    past,
    sensors,
    spectra,
    timeline,
    track,
    vehicle,
)
from h2nav.reviews.pictures.columns import shown_s
from h2nav.reviews.pictures.picture import (
    Curves,
    Lines,
    Picture,
    PictureRows,
    Section,
    Shown,
    Stack,
    Trace,
    for_script,
)
from h2nav.reviews.verdict import first_sentence

LONG_VERDICT = 160  # characters: set smaller, so that it does not fill a phone
MIN_PERCENT = 0.05  # smaller values are shown as nothing
_USELESS = (
    "Our own attitude is not shown: it came from a gyro that turned while the vehicle stood still."
)
_KINDS = {
    "tlog": "telemetry log",
    "bytes": "recorded link",
    "mcap": "h2nav log",
    "dataflash": "ArduPilot log",
    "ulog": "PX4 log",
}


def page(flight: Flight, analysis: Analysis, document: dict[str, Any]) -> str:
    """Renders the review as HTML.

    Returns:
        A file that opens without a network: findings, uncertainty, pictures.
    """
    findings = chain(flight, analysis).findings
    flight = attitude.without_useless(flight, findings)
    happened = [one for one in (_event(flight, findings, document),) if _is_filled(one)]
    sections = [one for one in _sections(flight, analysis, findings) if _is_filled(one)]
    is_ours_shown = flight.estimates is not None
    drawn = _Drawn()
    body = "\n".join(
        (
            '<a class="skip" href="#findings">to the findings</a>',
            _title(document),
            "<main>",
            _findings(document, is_ours_shown=is_ours_shown),
            *map(drawn.section, happened),
            _contents(sections),
            *map(drawn.section, sections),
            _certainty(document) if is_ours_shown or not document["certainty"]["h2nav"] else "",
            calibration_section(document.get("calibration", {})),
            _texts(document),
            _parameters(document["parameters"]),
            "</main>",
            _bar(),
        )
    )
    data = {
        "duration_s": shown_s(flight.context.duration_s),
        "modes": timeline.mode_backdrop(flight),
        "marks": timeline.marks(flight, findings),
        "impact": colours.IMPACT,
        "dark": colours.DARK,
        "early_to_late": (colours.EARLY_TO_LATE, colours.EARLY_TO_LATE_DARK),
        "pictures": [for_script(picture) for picture in drawn.pictures],
    }
    return frame(
        f"Flight review: {flight.name}",
        body,
        styles=(asset("uplot.css"), asset("pictures.css")),
        scripts=(asset("uplot.js"), asset("pictures.js")),
        data=data_block("review", data),
    )


def _sections(
    flight: Flight, analysis: Analysis, findings: tuple[Finding, ...]
) -> tuple[Section, ...]:
    return (
        timeline.timeline(flight, findings),
        attitude.attitude(flight),
        control.control(flight),
        vehicle.height(flight, grounds.contacts(flight.context, findings)),
        vehicle.motors(flight),
        vehicle.battery(flight),
        track.track(flight, findings),
        track.wind(flight),
        attitude.difference(flight),
        attitude.certainty(flight),
        attitude.innovations(flight),
        compass.compass(flight, analysis),
        sensors.bias(flight, analysis),
        sensors.vibration(flight, analysis),
        spectra.spectra(analysis),
        sensors.receivers(flight, analysis),
        sensors.timing(flight, analysis),
        past.past(flight, analysis),
    )


def _event(flight: Flight, findings: tuple[Finding, ...], document: dict[str, Any]) -> Section:
    """The first event in pictures, with the cards of the crashes."""
    found = event.event(flight, findings)
    lead, others = crash_cards(document["crashes"])
    return found._replace(lead=lead, html=others) if found.pictures else found


def _is_filled(section: Section) -> bool:
    return bool(section.pictures or section.html)


class _Drawn:
    """Numbers the pictures in the order of the page.

    Attributes:
        pictures: all so far.
    """

    def __init__(self) -> None:
        self.pictures: list[Picture] = []
        self._title = ""

    def section(self, section: Section) -> str:
        """HTML of a section, with a placeholder for every picture."""
        self._title = section.title
        parts = [f'<section id="{section.name}"><h2>{escape(section.title)}</h2>', section.lead]
        parts.append(self._pictures(section.pictures))
        parts.append(section.html)
        if section.further:
            parts.append(f"<details><summary>{escape(section.further_title)}</summary>")
            parts.append(self._pictures(section.further) + "</details>")
        return "".join(parts) + "</section>"

    def _pictures(self, pictures: Iterable[Shown]) -> str:
        return f'<div class="pictures">{"".join(self._figure(one) for one in pictures)}</div>'

    def _figure(self, picture: Shown) -> str:
        lanes = picture.lanes if isinstance(picture, Stack) else (picture,)
        look = "half" if isinstance(picture, Curves) else "whole"
        look += " stack" if isinstance(picture, Stack) else ""
        about = f'<p class="about">{escape(picture.about)}</p>' if picture.about else ""
        named = picture.title or self._title
        places = "".join(self._place(one, _described(one, named)) for one in lanes)
        title = f"<h3>{escape(picture.title)}</h3>" if picture.title else ""
        return f'<figure class="{look}">{title}{about}{places}</figure>'

    def _place(self, picture: Picture, described: str) -> str:
        self.pictures.append(picture)
        return (
            f'<div class="plot" role="img" aria-label="{escape(described)}" '
            f'data-picture="{len(self.pictures) - 1}"></div>'
        )


def _described(picture: Picture, of: str) -> str:
    """A picture in words, for those who do not see it: its lines with their ranges."""
    title = picture.title if isinstance(picture, Lines) and picture.title else of
    if isinstance(picture, PictureRows):
        rows = ", ".join(dict.fromkeys(row.label for row in picture.rows if row.label))
        return f"{of}: bars over time of {rows}"
    if not isinstance(picture, Lines | Curves):
        return f"{of}: strength by frequency over time"
    lines = "; ".join(
        f"{trace.label} {span}" for trace in picture.traces if (span := _span(trace, picture))
    )
    over = "over time" if isinstance(picture, Lines) else f"over {picture.x_text}"
    return f"{title} {over}: {lines}"


def _span(trace: Trace, picture: Lines | Curves) -> str:
    known = trace.values[np.isfinite(trace.values)]
    if not len(known):
        return ""
    low, high = (f"{float(end):.{picture.digits}f}" for end in (known.min(), known.max()))
    return f"{low} to {high} {picture.unit}".strip()


def _title(document: dict[str, Any]) -> str:
    facts = [
        ("vehicle", document["vehicle"]),
        ("firmware", document["firmware"]),
        ("autopilot", "" if document["firmware"] else document["autopilot"]),
        ("begun", (document["start_utc"] or "").replace("T", " ").replace("Z", " UTC")),
        ("lasted", duration(document["duration_s"])),
        (_KINDS.get(document["kind"], document["kind"]), document["file"]),
    ]
    line = " · ".join(f"{escape(name)} <b>{escape(value)}</b>" for name, value in facts if value)
    title = f"<h1>Flight review: {escape(document['name'])}</h1>"
    return f'<header>{title}<p class="facts">{line}</p></header>'


def duration(seconds: float) -> str:
    """For people: ``42 s``, ``12 min 5 s`` or ``1 h 2 min``."""
    whole = round(seconds)
    if whole < 120:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def _no_estimate(document: dict[str, Any], *, is_ours_shown: bool) -> str:
    if not document["why_no_estimate"]:
        return "" if is_ours_shown else f'<p class="lack">{_USELESS}</p>'
    return (
        f'<p class="lack">No attitude of our own: {escape(document["why_no_estimate"])}</p>'
        "<p>So the autopilot's attitude could not be judged. What the recording shows of itself "
        "stands below.</p>"
    )


def _findings(document: dict[str, Any], *, is_ours_shown: bool) -> str:
    found = [one for one in document["findings"] if not _is_own(one)]
    look = "verdict long" if len(document["verdict"]) > LONG_VERDICT else "verdict"
    return (
        f'<section id="findings"><p class="{look}">{_verdict(document["verdict"])}</p>'
        f"{_no_estimate(document, is_ours_shown=is_ours_shown)}{cards(found)}"
        f"{_looked_at(document, is_open=not any(map(is_wrong, found)))}</section>"
    )


def _verdict(text: str) -> str:
    """The verdict with its first sentence marked, and what was not looked at apart."""
    said, blind, lacking = text.partition(" Not looked at: ")
    first, rest = first_sentence(said)
    lacks = f'<span class="blind"><b>Not looked at:</b> {escape(lacking)}</span>' if blind else ""
    return f"<b>{escape(first)}</b> {escape(rest)}{lacks}"


def _is_own(finding: dict[str, Any]) -> bool:
    """Whether it concerns our own attitude, and is no fault of the vehicle."""
    return bool(finding["about"] == "h2nav")


def _looked_at(document: dict[str, Any], *, is_open: bool) -> str:
    """The basis of the verdict; unfolded if nothing was found wrong."""
    checked = [
        one["what"] + (f" ({duration(one['for_s'])})" if one["for_s"] is not None else "")
        for one in document["checked"]
    ]
    # A verdict without findings names these itself.
    subjects = ((), ()) if is_open else (document["looked_at"], document["not_looked_at"])
    lines = "".join(
        f"<p><b>{title}:</b> {escape('; '.join(what))}.</p>"
        for title, what in (
            *zip(("Looked at", "Not looked at"), subjects, strict=True),
            ("Checked", checked),
            ("Could not be checked", _untested(document)),
            ("Missing in the recording", document["missing"]),
        )
        if what
    )
    if not lines:
        return ""
    opened = " open" if is_open else ""
    title = "What was checked, and what could not be"
    return f"<details{opened}><summary>{title}</summary>{lines}</details>"


def _untested(document: dict[str, Any]) -> list[str]:
    """Tests without data in the recording; gravity only tests where no velocity does."""
    if document["why_no_estimate"]:
        return []
    tested = document["certainty"]["tested"]
    untested = [name for name, one in tested.items() if not one["spans"]]
    if tested[GROUPS["velocity"]]["spans"]:
        untested = [name for name in untested if name != GROUPS["force"]]
    return untested


def _certainty(document: dict[str, Any]) -> str:
    certainty = document["certainty"]
    rows = [
        (
            name,
            part,
            *(_deg(deviations[part][f"{key}_deg"]) for key in ("median", "largest", "last")),
        )
        for name, deviations in (
            ("h2nav, as in flight", certainty["h2nav"]),
            ("h2nav, smoothed", certainty["smoothed"]),
        )
        if deviations is not None
        for part in ("tilt", "heading")
    ]
    own = cards([one for one in document["findings"] if _is_own(one)], opens_first=False)
    parts = [f'<section id="sure"><h2>How sure we are</h2>{own}']
    if rows:
        parts.append(
            '<p class="about">One standard deviation of our attitude: two errors of three are '
            "smaller. Tilt is roll and pitch together. The smoothed attitude knows what came "
            "later, and is the more accurate one.</p>"
        )
    tables = [_compared(document), _tested(document)]
    if rows:
        heads = ("whose", "of", "usual", "largest", "at the end")
        tables.insert(0, "<div><h3>Our own attitude</h3>" + table(heads, rows) + "</div>")
    parts.append(f'<div class="beside">{"".join(tables)}</div>')
    return "".join(parts) + "</section>" if own or any(tables) else ""


def _compared(document: dict[str, Any]) -> str:
    rows = [
        (
            one["name"],
            part,
            _deg(one[part]["median_deg"]),
            _deg(one[part]["largest_deg"]),
            _percent(one[part]["beyond_limit_percent"]),
        )
        for one in document["differences"]
        for part in ("tilt", "heading")
    ]
    if not rows:
        return ""
    heads = ("whose", "of", "usual", "largest", "beyond 3 sigma")
    return "<div><h3>Other attitudes against h2nav</h3>" + table(heads, rows) + "</div>"


def _tested(document: dict[str, Any]) -> str:
    duration_s = document["duration_s"] or 1.0
    shares = {
        f"tested: {name}": one["share_percent"]
        for name, one in document["certainty"]["tested"].items()
        if one["spans"]
    }
    for name, seconds in document["certainty"]["states_s"].items():
        shares[f"h2nav: {name.replace('_', ' ')}"] = 100.0 * seconds / duration_s
    rows = [(name, _percent(share)) for name, share in shares.items() if share >= MIN_PERCENT]
    if not rows:
        return ""
    return "<div><h3>What was tested</h3>" + table(("", "share of the time"), rows) + "</div>"


def _deg(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.2f} deg"


def _percent(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.1f} %"


def _contents(sections: Sequence[Section]) -> str:
    links = " · ".join(f'<a href="#{one.name}">{escape(one.title)}</a>' for one in sections)
    about = (
        "All pictures over time share one axis: drag over a part to see it closer, double click "
        "for the whole flight, or use the buttons at the lower edge; on a touch screen one finger "
        "moves it and two stretch it. A click on a name below a picture hides its line; colours "
        "behind the lines are flight modes."
    )
    how = f"<details><summary>How to use the pictures</summary><p>{escape(about)}</p></details>"
    return f'<nav class="contents"><h2>The flight</h2><p>{links}</p>{how}</nav>' if links else ""


def _texts(document: dict[str, Any]) -> str:
    parts = [
        f"<details><summary>{escape(title)} ({len(rows)})</summary>"
        f"{table(('s', 'severity', 'text'), rows)}</details>"
        for title, rows in (
            ("Texts of the autopilot", _rows(document["said"])),
            ("Texts of h2nav", _rows(document["notices"])),
        )
        if rows
    ]
    skipped = [*document["damaged"].items(), *document["rejected"].items()]
    if skipped:
        parts.append(
            f"<details><summary>Damaged, skipped or refused ({len(skipped)})</summary>"
            f"{table(('what', 'how often'), skipped)}</details>"
        )
    if not parts:
        return ""
    return f'<section id="texts"><h2>Texts and skipped data</h2>{"".join(parts)}</section>'


def _rows(texts: list[dict[str, Any]]) -> list[tuple[str, str, str]]:
    return [(f"{one['t_s']:.1f}", one["severity"], one["text"]) for one in texts]


def _parameters(parameters: dict[str, Value]) -> str:
    """A folded table; a script filters its rows by the words of the search."""
    if not parameters:
        return ""
    names = list(parameters)
    matter = sum(map(matters_for_attitude, names))
    parts = [
        _parameter_group(title, {name: parameters[name] for name in group})
        for title, group in (
            ("What the attitude depends on", names[:matter]),
            ("All others", names[matter:]),
        )
        if group
    ]
    search = (
        '<input type="search" data-search="parameters" aria-label="search in the parameters" '
        'placeholder="search, such as compass ofs">'
    )
    return (
        '<section id="parameters"><h2>Parameters of the autopilot</h2><details>'
        f"<summary>All {len(parameters)}, those that the attitude depends on first</summary>"
        f'{search}<div class="searched">{"".join(parts)}</div></details></section>'
    )


def _parameter_group(title: str, parameters: dict[str, Value]) -> str:
    rows = ((name, "no number" if v is None else v) for name, v in parameters.items())
    return f"<h3>{title}</h3>{table(('name', 'value'), rows)}"


def _bar() -> str:
    buttons = "".join(
        f'<button type="button" data-move="{move}" aria-label="{label}" title="{label}">'
        f"{sign}</button>"
        for move, label, sign in (
            ("whole", "whole flight", "all"),
            ("back", "earlier", "&#9664;"),
            ("closer", "closer", "+"),
            ("wider", "wider", "&minus;"),
            ("on", "later", "&#9654;"),
        )
    )
    findings = '<a href="#findings">findings</a>'
    return f'<nav class="bar">{findings}{buttons}<output id="shown"></output></nav>'

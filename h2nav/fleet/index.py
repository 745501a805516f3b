"""The page that lists a fleet's flights, worst first, with links to their reviews."""

import math
import posixpath
from collections import Counter
from collections.abc import Iterable, Sequence
from datetime import datetime
from importlib import resources
from typing import Any, NamedTuple
from urllib.parse import quote

from h2nav.fleet.store import Store
from h2nav.fleet.tables import FINDINGS, FLIGHTS, TableRow, severity_rank
from h2nav.integrity.severity import Severity
from h2nav.reviews.html import escape, frame

INDEX = "index.html"
# The limit of what browsers handle well; the tables hold all.
MAX_LISTED = 10_000
_MAX_SHOWN = 4


class _Cell(NamedTuple):
    """A cell of the table."""

    html: str  # its content
    key: float | None = None  # sort key; None = its text
    look: str = ""  # CSS class


def write_index(rows: Sequence[TableRow], store: Store) -> None:
    """Writes the page of a fleet's flights."""
    store.write(INDEX, page(rows).encode())


def page(rows: Sequence[TableRow]) -> str:
    """The page as HTML; it loads nothing from elsewhere."""
    listed = sorted(rows, key=_rank)[:MAX_LISTED]
    above = _above([_address(row) for row in rows])
    heads = "".join(f'<th scope="col">{escape(name)}</th>' for name in _HEADS)
    body = "\n".join(_row(row, above) for row in listed)
    left_out = len(rows) - len(listed)
    more = f"<p>The {len(listed)} worst flights are listed; {FLIGHTS} has all.</p>"
    title = "1 flight" if len(rows) == 1 else f"{len(rows)} flights"
    whole = f"""<h1>{title}</h1>
<p class="facts">{_summary(rows)}</p>
{more if left_out else ""}
<p class="about">A click on a head sorts. The whole tables: <a href="{FLIGHTS}">{FLIGHTS}</a>,
<a href="{FINDINGS}">{FINDINGS}</a>.</p>
<p><input id="search" type="search" placeholder="show only flights with" hidden></p>
<div class="wide"><table><thead><tr>{heads}</tr></thead><tbody>
{body}
</tbody></table></div>"""
    return frame("Flights", whole, styles=[_asset("index.css")], scripts=[_asset("index.js")])


def _asset(name: str) -> str:
    return resources.files("h2nav.fleet").joinpath("assets", name).read_text(encoding="utf-8")


def _rank(row: TableRow) -> tuple[int, int, str]:
    """Sort key: worst first by severity, number of findings, address; without a review last."""
    values = row.values
    rank = severity_rank(values["worst_severity"]) + (100 if values["error"] else 0)
    return rank, -values["finding_count"], values["source"]


def _summary(rows: Iterable[TableRow]) -> str:
    counts = Counter(_verdict(row.values) for row in rows)
    order = sorted(counts, key=lambda name: (name == "not reviewed", severity_rank(name)))
    return ", ".join(f"<b>{counts[name]}</b> {escape(name)}" for name in order)


def _verdict(values: dict[str, Any]) -> str:
    if values["error"]:
        return "not reviewed"
    return values["worst_severity"] or "nothing found"


_HEADS = (
    "worst", "flight", "crash", "verdict", "date", "minutes", "vehicle", "firmware", "kind",
    "findings", "tilt apart deg", "heading apart deg", "active %", "folder",
)  # fmt: skip


def _address(row: TableRow) -> str:
    return str(row.values["source"]).partition("::")[0]


def _above(addresses: Sequence[str]) -> int:
    """Length of the folder that all addresses share."""
    folders = [address.rpartition("/")[0] + "/" for address in addresses]
    return posixpath.commonprefix(folders).rfind("/") + 1


def _row(row: TableRow, above: int) -> str:
    values = row.values
    worst = Severity.of(values["worst_severity"])
    look = "failed" if values["error"] else "good" if worst is None else worst.look
    folder, _, name = _address(row).rpartition("/")
    # Names of flights repeat between folders, such as 00000001.BIN.
    below = folder[above:].lstrip("/")
    title = (f'<span class="below">{escape(below)}/</span>' if below else "") + escape(name)
    if values["review"]:
        title = f'<a href="{escape(quote(values["review"]))}">{title}</a>'
    cells = (
        _Cell(escape(_verdict(values)), float(_rank(row)[0])),
        _Cell(title, look="path"),
        _crash(values["crash_s"]),
        _Cell(_findings_cell(row), look="told"),
        _date(values["start"]),
        _number(values["duration_s"], 1 / 60.0, 1),
        _Cell(escape(values["vehicle"] or "")),
        _Cell(escape(values["firmware"] or "")),
        _Cell(escape(values["kind"] or "")),
        _number(values["finding_count"], 1.0, 0),
        _number(values["largest_tilt_deg"], 1.0, 1),
        _number(values["largest_heading_deg"], 1.0, 1),
        _number(values["active_share"], 100.0, 0),
        _Cell(escape(folder), look="path"),
    )
    return f'<tr class="{look}">' + "".join(map(_cell, cells)) + "</tr>"


def _findings_cell(row: TableRow) -> str:
    """The verdict with the findings below it; or why there is no review."""
    values, findings = row.values, row.findings
    if values["error"]:
        return escape(values["error"])
    lines = [escape(text) for text in findings[:_MAX_SHOWN]]
    if len(findings) > _MAX_SHOWN:
        lines.append(f"and {len(findings) - _MAX_SHOWN} more")
    first = escape(values["verdict"] or values["no_estimate"] or "")
    if not lines:
        return first
    return f"{first}<details><summary>findings</summary>{'<br>'.join(lines)}</details>"


def _cell(cell: _Cell) -> str:
    key = f' data-key="{cell.key!r}"' if cell.key is not None else ""
    look = f' class="{cell.look}"' if cell.look else ""
    return f"<td{key}{look}>{cell.html}</td>"


def _number(value: float | None, scale: float, digits: int) -> _Cell:
    if value is None or not math.isfinite(value):
        return _Cell("", -1e300, "number")  # smaller than any
    return _Cell(f"{value * scale:.{digits}f}", float(value), "number")


def _crash(at_s: float | None) -> _Cell:
    return _Cell("", -1.0) if at_s is None else _Cell(f"at {at_s:.0f} s", at_s, "crash")


def _date(start: datetime | None) -> _Cell:
    if start is None:
        return _Cell("", 0.0)
    return _Cell(f"{start:%Y-%m-%d %H:%M}", start.timestamp())

"""The section of a review with suggested calibrations and a file to save."""

from typing import Any
from urllib.parse import quote

from h2nav.reviews.html import escape, table

HEADS = ("parameter", "in use", "better", "deviation")


def calibration_section(fields: dict[str, Any]) -> str:
    """The section; empty if nothing was examined."""
    sensors = fields.get("sensors", [])
    if not sensors:
        return ""
    parts = [_sensor(sensor) for sensor in sensors]
    return (
        '<section id="calibration"><h2>Calibration from this flight</h2>'
        f"{''.join(parts)}{_file(fields)}</section>"
    )


def _sensor(sensor: dict[str, Any]) -> str:
    device = f" (device {sensor['device']})" if sensor["device"] else ""
    parts = [f"<h3>{escape(sensor['sensor'])}{escape(device)}</h3>"]
    rows = [
        (
            change["name"],
            _figure(change["old"]),
            _figure(change["new"]),
            _figure(change["sigma"]),
        )
        for change in sensor["changes"]
    ]
    if rows:
        parts.append(table(HEADS, rows))
    parts += [f"<p>{escape(note)}</p>" for note in sensor["notes"]]
    reasons = sensor["not_from_these_flights"]
    parts += [f"<p>Nothing to set: {escape(reason)}.</p>" for reason in reasons]
    if sensor["shown_by"]:
        parts.append(f"<p>Shown by: {escape(sensor['shown_by'])}.</p>")
    return "".join(parts)


def _figure(value: float | None) -> str:
    return "" if value is None else f"{value:.5g}"


def _file(fields: dict[str, Any]) -> str:
    """The parameters to load: to save, or to copy."""
    text = fields.get("file", "")
    if not text:
        return ""
    address = f"data:text/plain;charset=utf-8,{quote(text)}"
    return (
        "<p>Look at each value before you load it, and fly carefully after: "
        f'<a download="{escape(fields["file_name"])}" href="{address}">save the file</a>, or copy:'
        f'</p><pre class="file">{"<br>".join(map(escape, text.splitlines()))}</pre>'
    )

"""Recordings and reviews for notebooks and programs."""

from pathlib import Path
from typing import Any

from h2nav.apps import reviewing
from h2nav.apps.playback import PlaybackOptions
from h2nav.recordings.context import Context
from h2nav.recordings.imported import ImportedLog
from h2nav.recordings.opening import open_flight
from h2nav.recordings.telemetry import read_context
from h2nav.reviews.document import document
from h2nav.reviews.page import page


def read_flight(path: Path | str) -> Context:
    """Reads a recording as arrays: IMUs, receivers, estimators, motors, modes, parameters.

    Args:
        path: dataflash (`.bin`, `.log`), ULog, telemetry log, MCAP of h2nav, or raw MAVLink.

    Returns:
        Series in SI units and radians, body forward-right-down, on the recording's clock; see
        `h2nav.recordings.context.Context`.

    Raises:
        BadInput: not a recording, or not readable.
    """
    source = open_flight(path)
    return source.context() if isinstance(source, ImportedLog) else read_context(source)


def review(path: Path | str, *, html: Path | str | None = None) -> dict[str, Any]:
    """Reviews a flight; returns the JSON document of `h2nav review`.

    Args:
        path: as for `read_flight`.
        html: where to write the page; None = nowhere.

    Raises:
        BadInput: not a recording, or not readable.
        OSError: the page cannot be written.
    """
    reviewed = reviewing.review(open_flight(path), PlaybackOptions())
    found = document(*reviewed)
    if html is not None:
        Path(html).write_text(page(*reviewed, found), encoding="utf-8")
    return found

"""What is remembered of earlier flights, by the documents of their reviews in folders."""

from collections.abc import Iterable
from pathlib import Path

import orjson

from h2nav.airframes.features import FlightRow, row_of_document
from h2nav.errors import BadInput

# A larger file is no document of a review.
_MAX_BYTES = 64 << 20


def rows_in(folders: Iterable[Path]) -> tuple[FlightRow, ...]:
    """The flights whose documents lie in folders; files that are none are passed over.

    Raises:
        BadInput: a folder cannot be read.
    """
    found = []
    for folder in folders:
        try:
            paths = sorted(path for path in folder.iterdir() if path.suffix == ".json")
        except OSError as error:
            raise BadInput(f"{folder}: {error.strerror}; name a folder with reviews") from error
        found += [row for path in paths if (row := row_in(path)) is not None]
    return tuple(found)


def row_in(path: Path) -> FlightRow | None:
    """The flight whose document this is; None if it is none."""
    try:
        if path.stat().st_size > _MAX_BYTES:
            return None
        document = orjson.loads(path.read_bytes())
    except (OSError, orjson.JSONDecodeError):
        return None
    return row_of_document(document) if isinstance(document, dict) else None

"""The autopilot's texts in logs of every format: their column table, and what was said.

As in `h2nav.recordings.field_tables`: one row for each format.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.integrity.findings import Severity
from h2nav.recordings.columns import Field, RowFinder, Source, column, read
from h2nav.recordings.context import Array, Said
from h2nav.recordings.log_rows import Rows
from h2nav.recordings.row_tables import Table


class TextColumns(NamedTuple):
    """Texts, some of them in pieces; NaN where unknown."""

    rows: Rows  # with their times
    text: NDArray[np.object_]  # (N,) bytes of UTF-8; the end of a piece may split a character
    level: Array  # (N,) MAV_SEVERITY, which are syslog's
    whole: Array  # (N,) number of the text that this is a piece of; 0 = it is whole
    piece: Array  # (N,) number of the piece, from 0


def words(table: Table, name: str) -> NDArray[Any]:
    """(N,) bytes."""
    return np.array(table.words(name), np.object_)


TEXTS = Field(
    "texts",
    "MAV_SEVERITY",
    record=TextColumns,
    dataflash=(Source("MSG", {"text": column("Message", form=words)}),),
    ulog=(
        Source("logged_messages", {"text": column("text", form=words), "level": column("level")}),
    ),
    telemetry=(
        Source(
            "STATUSTEXT",
            {
                "text": column("text", form=words),
                "level": column("severity"),
                "whole": column("id"),
                "piece": column("chunk_seq"),
            },
        ),
    ),
)


def said_of(log: RowFinder) -> tuple[Said, ...]:
    """Whole texts, in order; without a severity in the log they are information."""
    found: list[tuple[float, Severity, bytes]] = []
    last = 0.0
    for texts in read(log, (TEXTS,)).values["texts"]:
        levels = np.nan_to_num(texts.level, nan=Severity.INFO)
        levels = levels.clip(Severity.CRITICAL, Severity.INFO)
        columns = (texts.rows.t_s, texts.text, levels, texts.whole, texts.piece)
        rows = zip(*(each.tolist() for each in columns), strict=True)
        for t_s, text, level, whole, piece in rows:
            if whole and whole == last and piece and found:
                began_s, first_level, before = found[-1]
                found[-1] = began_s, first_level, before + text
            else:
                found.append((t_s, Severity(int(level)), text))
            last = whole
    return tuple(
        Said(t_s, level, text.decode(errors="replace")) for t_s, level, text in found if text
    )

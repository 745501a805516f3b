"""Fields of the state that both arithmetics have, declared once, in the memory of the floats.

Of each field with a declared form (`record.Grid`) the integers have one of the same name.
"""

from collections.abc import Callable
from typing import TypeVar

from h2nav.attitude.record import Row, integer_row, rows, with_rows
from h2nav.attitude.velocity_aided import memory

R = TypeVar("R")


def shared_rows() -> list[Row]:
    """The integer fields."""
    return [integer_row(row) for row in rows(memory.State) if row.grids]


def of_floats(record: type[R]) -> type[R]:
    """The record with these fields before its own."""
    return with_rows(record, shared_rows())


# What the translator, which reads the text of a record, makes of this decorator.
SHARED_ROWS: dict[str, Callable[[], list[Row]]] = {of_floats.__name__: shared_rows}

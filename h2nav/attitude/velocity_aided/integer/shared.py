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
    """The record with these fields after its own.

    What every sample needs is of this arithmetic alone. A Cortex-M0 reaches the first 31 words of
    a record with one instruction, others with two.
    """
    return with_rows(record, (), shared_rows())


# What the translator, which reads the text of a record, puts behind its rows for this decorator.
ROWS_BEHIND: dict[str, Callable[[], list[Row]]] = {of_floats.__name__: shared_rows}

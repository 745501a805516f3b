"""LogColumn tables: one row for each field of a `Context` and each format, and what reads them.

A `Field` says where every format stores one quantity: message, columns, factor to SI. `read` fills
fields out of a log of any format; nothing behind it knows a format. A field that a format spells
differently over the years has several sources there, and the first one that the log has counts.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from enum import StrEnum
from itertools import islice
from typing import Any, NamedTuple, Protocol

import numpy as np

from h2nav.recordings.context import Array, Series
from h2nav.recordings.imu_series import Mask
from h2nav.recordings.log_rows import Rows
from h2nav.recordings.row_tables import Table

Form = Callable[..., Array]
"""Table, then names of columns -> values in the unit of the field, where a factor does not do."""


class Format(StrEnum):
    """The formats of logs, by the names of their sources in a `Field`."""

    DATAFLASH = "dataflash"
    ULOG = "ulog"
    TELEMETRY = "telemetry"


class RowFinder(Protocol):
    """A log of any format: the rows of its messages."""

    @property
    def format(self) -> Format:
        """Its format."""

    def instances(self, name: str, *columns: str) -> Iterator[Rows]:
        """The rows of each instance of a message or topic that has these columns."""


class LogColumn(NamedTuple):
    """Where one value is stored."""

    names: tuple[str, ...]  # of its columns; several make (N, k), an empty one is unknown
    scale: float = 1.0  # to the unit of the field
    least: float = -math.inf  # anything less means that it is unknown
    most: float = math.inf  # anything more as well
    form: Form | None = None  # in place of the plain numbers
    may_lack: bool = False  # an absent column is unknown; others must be there

    def values(self, table: Table) -> Array:
        """(N,) of one name, (N, k) of several; NaN where unknown."""
        values = (self.form or Table.numbers_or_nan)(table, *self.names)
        values = values if self.scale == 1.0 else values * self.scale
        if math.isfinite(self.least) or math.isfinite(self.most):
            with np.errstate(invalid="ignore"):
                values = np.where((values >= self.least) & (values <= self.most), values, np.nan)
        return values


class Source(NamedTuple):
    """Where one message of a format stores the columns of a record."""

    message: str  # or topic
    columns: Mapping[str, LogColumn]  # field of the record -> its column
    # records in each row, or messages with a number: ``{0}`` in the names is the number from 0,
    # ``{1}`` the one from 1; 0 = the instances of the message
    packed: int = 0
    first: int = 0  # number of the first instance
    needs: str = ""  # the field that must have been known and not zero once; empty = none
    kind: str = ""  # of the record, where one field has several kinds

    def parts(self) -> Iterator["Source"]:
        """One source for each of `packed`."""
        if not self.packed:
            yield self
        for number in range(self.packed):
            yield self._replace(
                message=self.message.format(number, number + 1),
                columns={
                    name: each._replace(
                        names=tuple(one.format(number, number + 1) for one in each.names)
                    )
                    for name, each in self.columns.items()
                },
                first=self.first + number,
                packed=0,
            )

    def needed(self) -> tuple[str, ...]:
        """The columns without which a message is no source."""
        must = (each.names for each in self.columns.values() if not each.may_lack)
        return tuple(name for names in must for name in names if name)


class Field(NamedTuple):
    """A quantity of the `Context`: its name there, and a row per format that stores it.

    An element of a format's sources is one source, or several whose records belong together.
    """

    name: str  # of the field of `Context`; otherwise in `Context.measured`
    unit: str  # SI, angles in rad; of records, in the names of their fields
    dataflash: tuple["Source | tuple[Source, ...]", ...] = ()
    ulog: tuple["Source | tuple[Source, ...]", ...] = ()
    telemetry: tuple["Source | tuple[Source, ...]", ...] = ()
    record: Any = Series  # what a source makes; `Series` for one, anything else for any number
    is_partial: bool = False  # of a `Series`: keeps the times at which a part of it is unknown


class Filled(NamedTuple):
    """What a log has of the fields."""

    values: dict[str, Any]  # by name: a `Series` or None, or a tuple of records
    origins: dict[str, str]  # by name: message and column, such as ``CTUN.Alt``


def column(*names: str, largest: float = math.inf, **others: Any) -> LogColumn:
    """A column; see `LogColumn`.

    Args:
        largest: anything larger, of either sign, is unknown.
    """
    bounds = {"least": -largest, "most": largest} if math.isfinite(largest) else {}
    return LogColumn(names, **{**bounds, **others})


def series(message: str, *names: str, is_filled: bool = False, **others: Any) -> Source:
    """The source of a `Series`.

    Args:
        is_filled: whether a message that holds zeros throughout is no source.
        **others: of the `column`.
    """
    needs = "values" if is_filled else ""
    return Source(message, {"values": column(*names, **others)}, needs=needs)


def axes(name: str, count: int = 3) -> tuple[str, ...]:
    """The columns of an array."""
    return tuple(f"{name}[{number}]" for number in range(count))


def messages_of(format_: Format, fields: tuple[Field, ...]) -> frozenset[str]:
    """Names of the messages that the fields come from in a format."""
    alternatives = (each for field in fields for each in getattr(field, format_.value))
    sources = ((one,) if isinstance(one, Source) else one for one in alternatives)
    return frozenset(part.message for group in sources for one in group for part in one.parts())


def read(log: RowFinder, fields: tuple[Field, ...]) -> Filled:
    """Fills fields out of a log."""
    found = Filled({}, {})
    for field in fields:
        alternatives = getattr(field, log.format.value)
        value, origin = next(
            (
                each
                for source in alternatives
                if (each := _of_sources(log, field, source)) is not None
            ),
            (None if field.record is Series else (), ""),
        )
        found.values[field.name] = value
        if origin:
            found.origins[field.name] = origin
    return found


def _of_sources(
    log: RowFinder, field: Field, sources: Source | tuple[Source, ...]
) -> tuple[Any, str] | None:
    """What one alternative has, and its name; None if it has nothing."""
    group = (sources,) if isinstance(sources, Source) else sources
    records, names = [], []
    for whole in group:
        for source in whole.parts():
            own = list(islice(_records(log, field, source), 1 if field.record is Series else None))
            records += own
            if own and whole.message not in names:
                names.append(whole.message)
    if not records:
        return None
    if field.record is not Series:
        return tuple(records), ", ".join(names)
    return records[0], f"{names[0]}.{group[0].columns['values'].names[0]}"


def _records(log: RowFinder, field: Field, source: Source) -> Iterator[Any]:
    for rows in log.instances(source.message, *source.needed()):
        values = {name: each.values(rows.table) for name, each in source.columns.items()}
        if source.needs and not np.nan_to_num(values[source.needs]).any():
            continue
        if not any(each.dtype.kind == "O" or np.isfinite(each).any() for each in values.values()):
            continue
        if field.record is not Series:
            yield _record(field.record, source, rows, values)
            continue
        is_known = np.isfinite(values["values"]).reshape(len(rows.t_s), -1)
        known: Mask = (np.any if field.is_partial else np.all)(is_known, axis=1)
        if known.any():
            yield Series(rows.t_s[known], values["values"][known])


def _record(record: Any, source: Source, rows: Rows, values: Mapping[str, Array]) -> Any:
    """A record: number, times or rows, columns; NaN where the source has no column."""
    number = rows.number + source.first
    fixed = {"rows": rows, "t_s": rows.t_s, "number": number, "imu": number, "kind": source.kind}
    fixed["message"] = source.message
    unknown = np.full(len(rows.t_s), np.nan)
    return record(*(values.get(name, fixed.get(name, unknown)) for name in record._fields))

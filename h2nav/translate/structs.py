"""Records in C: a struct with a named member per field, and constants of one."""

from collections.abc import Sequence

from h2nav.attitude.record import Number, Row
from h2nav.translate.c_expressions import DOUBLE, INT32, c_number
from h2nav.translate.layout import broken, comment_lines


def struct_text(about: str, rows: Sequence[Row], name: str) -> str:
    """The definition of a struct, its members in the order of the record."""
    members = [f"    {_declaration(row)};" for row in rows]
    width = max(map(len, members))
    lines = [*comment_lines(about, ""), "typedef struct {"]
    for member, row in zip(members, rows, strict=True):
        lines += _remarked(member, meaning(row), width)
    return "\n".join([*lines, f"}} {name};", ""])


def meaning(row: Row) -> str:
    """What a field is and in which format, for a comment or a table."""
    # a unit such as "64 uT" has its own number
    unit = row.unit if row.unit[:1].isdigit() else f"1 {row.unit}".strip()
    scale = f"2^{row.q} = {unit}" if row.q else row.unit
    return "; ".join(part for part in (row.about, scale) if part)


def constant_text(rows: Sequence[Row], values: Sequence[Number], declaration: str) -> str:
    """The definition of a constant struct.

    Args:
        values: all numbers, in the order of the record.
        declaration: what stands before the ``=``.
    """
    lines = [f"{declaration} = {{"]
    place = 0
    for row in rows:
        part = ", ".join(c_number(value) for value in values[place : place + row.length])
        place += row.length
        lines.extend(broken(f"    .{row.name} = {part if row.size is None else f'{{{part}}}'},"))
    return "\n".join([*lines, "};", ""])


def _declaration(row: Row) -> str:
    kind = DOUBLE if row.range is None else INT32
    return f"{kind} {row.name}" if row.size is None else f"{kind} {row.name}[{row.size}]"


def _remarked(member: str, remark: str, width: int) -> list[str]:
    """A member and the comment behind it, in as many lines as that needs."""
    line = f"{member:{width}} /* {remark} */"
    return [line] if len(line) <= 100 else [f"    /* {remark} */", member]

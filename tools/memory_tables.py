"""Writes docs/memory.md: what every kernel remembers, is given, and is fed with.

The tables come from the records that the kernels use, so that they cannot say anything else.
`python tools/memory_tables.py` writes the page; a test holds it to the records.
"""

import importlib
import pkgutil
from pathlib import Path
from types import ModuleType

from h2nav import attitude, integrity
from h2nav.attitude.record import Row, rows, size_of

PAGE = Path(__file__).parents[1] / "docs" / "memory.md"
HEAD = """\
# Memory of the kernels

Every field of every kernel: its attribute in Python, its member in C. The tables are written by
`tools/memory_tables.py` from the records in `h2nav/attitude/*/memory.py` (the filters) and
`h2nav/integrity/kernel/memory.py` (the checks of one IMU); change a record and run it. Format Q24
means that the integer counts 2^-24 of the unit beside it. The ranges of the integers
are proved for every sequence of samples ([fixed-point.md](fixed-point.md)).
"""


def page() -> str:
    """The whole text."""
    parts = [HEAD]
    for module in kernels():
        _, room, folder, *_ = module.__name__.split(".")
        title = folder if room == "attitude" else room
        arithmetic = "integers" if rows(module.Sample)[0].range else "floats"
        parts.append(f"\n## {title}, in {arithmetic}\n")
        for name in ("State", "Memory", "Workspace", "Sample", "Gains"):
            if hasattr(module, name):
                parts.append(_table(name, getattr(module, name)))
    return "".join(parts)


def kernels() -> list[ModuleType]:
    """The `memory` modules of all filters, and of the watch."""
    return [
        importlib.import_module(module.name)
        for room in (attitude, integrity)
        for module in pkgutil.walk_packages(room.__path__, f"{room.__name__}.")
        if module.name.endswith(".memory")
    ]


def _table(name: str, record_type: type) -> str:
    is_integer = rows(record_type)[0].range is not None
    header = "| field | numbers | meaning | unit |"
    rule = "|---|---|---|---|"
    if is_integer:
        header, rule = f"{header} format | range |", f"{rule}---|---|"
    lines = [_line(row, is_integer) for row in rows(record_type)]
    about = f"\n### {name}: {size_of(record_type)} numbers\n\n<!-- table: no measurement -->"
    return "\n".join((about, header, rule, *lines, ""))


def _line(row: Row, is_integer: bool) -> str:
    cells = [f"`{row.name}`", str(row.length), row.about, row.unit]
    if is_integer:
        low, high = row.range or (0, 0)
        cells += [f"Q{row.q}" if row.q else "", f"{low} .. {high}"]
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

"""Writes the integer functions that are derived from the float kernel, and their table.

`python tools/derive.py` writes `integer/kernel/derived.py` and `integer/shared_fields.py` of the
velocity-aided filter and the tables of docs/fixed-point.md; a test holds them to the float kernel
and its declarations.
"""

import subprocess
import sys
from pathlib import Path

from h2nav.apps.export_c import kernel_sources
from h2nav.attitude.kernel_files import VELOCITY_AIDED
from h2nav.attitude.velocity_aided.integer.shared import shared_rows
from h2nav.translate.derivation import Derived, derive
from h2nav.translate.recipes_velocity_aided import RECIPES, fields
from h2nav.translate.source import read_kernel

ROOT = Path(__file__).parents[1]
MODULE = ROOT / "h2nav/attitude/velocity_aided/integer/kernel/derived.py"
FIELDS = ROOT / "h2nav/attitude/velocity_aided/integer/shared_fields.py"
PAGE = ROOT / "docs/fixed-point.md"
# where the tables begin in the document, and what follows them
BEGIN = "<!-- table: no measurement -->\n| function of the integers |"
END = "\n# Both filters\n"
HEAD = '''\
"""What the integers have from the floats: derived by tools/derive.py, not to be edited.

The equations are those of the float kernel; formats, shifts and rounding follow from what is
declared beside the state (`velocity_aided/memory.py`) and in
`h2nav/translate/recipes_velocity_aided.py`.

Source: docs/fixed-point.md, What is derived.
"""

from h2nav.maths.fixedpoint import I32, clamp

from ..memory import Gains, State
from .functions import limited, product, ratio, shifted, square_q28


'''
FIELDS_HEAD = '''\
"""Names and types of the fields that both arithmetics have; written by tools/derive.py.

Source: the forms in `velocity_aided/memory.py`.
"""

from h2nav.maths.fixedpoint import I32


class SharedFields:
    """What `shared.of_floats` adds to the state of the integers, for the type checker."""

'''


def found() -> list[Derived]:
    """All derived functions."""
    kernel, operands = read_kernel(kernel_sources(VELOCITY_AIDED)), fields()
    return [derive(kernel, recipe, operands) for recipe in RECIPES]


def module(derived: list[Derived]) -> str:
    """The Python of the functions."""
    text = HEAD + "\n\n".join(one.text for one in derived)
    command = [sys.executable, "-m", "ruff", "format", "--stdin-filename", MODULE.name, "-"]
    return subprocess.run(command, input=text, capture_output=True, text=True, check=True).stdout


def shared_fields() -> str:
    """The Python of the shared fields."""
    kinds = {row.name: "I32" if row.size is None else "list[I32]" for row in shared_rows()}
    return FIELDS_HEAD + "".join(f"    {name}: {kind}\n" for name, kind in kinds.items())


def page(derived: list[Derived], text: str) -> str:
    """The document with the tables of the functions and of their variables."""
    before, after = text.split(BEGIN, maxsplit=1)[0], text.split(END)[1]
    return before + tables(derived) + END + after


def tables(derived: list[Derived]) -> str:
    """One row per function, one per variable."""
    functions = [
        f"| `{one.recipe.name}` | `{one.recipe.source}` | {_names(one.recipe.writes)} |"
        for one in derived
    ]
    variables = []
    for name, operand in fields().items():
        written = [
            (one.recipe.name, bound)
            for one in derived
            for key, bound in one.bounds.items()
            if key.split("[")[0] == name
        ]
        if not written:
            continue
        worst = max(bound.error_steps for _, bound in written)
        grid = operand.grids[0]
        places = ", ".join(f"`{place}`" for place in dict.fromkeys(place for place, _ in written))
        ends = "saturates" if any(bound.saturates for _, bound in written) else "proved"
        steps = sorted({one.step for one in operand.grids})
        variables.append(
            f"| `{operand.text[2:]}` | {' / '.join(f'{step:.4g}' for step in steps)} | Q{grid.q} | "
            f"{grid.low} .. {grid.high} | {ends} | {places} | "
            f"{worst:.3g} = {worst / grid.high:.1e} of the range |"
        )
    return (
        "<!-- table: no measurement -->\n"
        "| function of the integers | from | writes |\n|---|---|---|\n"
        + "\n".join(functions)
        + "\n\n<!-- table: no measurement -->\n"
        "| variable | step, in the unit of the floats | format | range | at its ends | written by |"
        " error of one update, in steps |\n|---|---|---|---|---|---|---|\n"
        + "\n".join(variables)
        + "\n"
    )


def _names(writes: tuple[str, ...]) -> str:
    return ", ".join(f"`{name[2:]}`" for name in writes)


if __name__ == "__main__":
    functions = found()
    FIELDS.write_text(shared_fields(), encoding="utf-8")
    MODULE.write_text(module(functions), encoding="utf-8")
    PAGE.write_text(page(functions, PAGE.read_text(encoding="utf-8")), encoding="utf-8")

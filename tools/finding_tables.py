"""Writes the table of kinds in docs/review-findings.md from the declarations of the subjects.

`python tools/finding_tables.py` writes it; a test holds the document to the declarations.
"""

from pathlib import Path

from h2nav.reviews.declared import Declared
from h2nav.reviews.subjects import SUBJECTS

PAGE = Path(__file__).parents[1] / "docs" / "review-findings.md"
BEGIN, END = "## The kinds\n", "\nSeveral sensors of one kind"


def page(text: str) -> str:
    """The document with the table as it has to be."""
    before, rest = text.split(BEGIN, 1)
    return before + BEGIN + _table() + END + rest.split(END, 1)[1]


def _table() -> str:
    lines = ["", "<!-- table: no measurement -->", "| kind | meaning | evidence | limit |"]
    lines.append("|---|---|---|---|")
    for subject in SUBJECTS:
        lines += [_line(one) for one in subject.kinds if one.shown_by]
    return "\n".join((*lines, ""))


def _line(one: Declared) -> str:
    means = one.meaning.means or "the autopilot said so"
    return f"| `{one.kind.value}` | {means} | {one.shown_by} | {one.limit} |"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")

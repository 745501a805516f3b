"""Brings the figures that the documents quote up to docs/figures.toml, digits as they are quoted.

After a measurement: change the value (and the day) in docs/figures.toml, run this, read the diff.
What is bold, and the words around a figure, stay as they are, and want a look.

Run: python tools/figures.py
"""

import re
import tomllib
from decimal import ROUND_HALF_UP, Decimal
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
DOCUMENTS = ("README.md", "CHANGELOG.md", "docs/**/*.md")
MARK = re.compile(r"<!-- (\w+)\.(\w+) -->")
NUMBER = re.compile(r"\d[\d,]*(?:\.\d+)?")
LONGEST = 200


def main() -> None:
    source = tomllib.loads((REPOSITORY / "docs" / "figures.toml").read_text(encoding="utf-8"))
    for pattern in DOCUMENTS:
        for path in sorted(REPOSITORY.glob(pattern)):
            text = path.read_text(encoding="utf-8")
            updated = brought_up(text, source)
            if updated != text:
                path.write_text(updated, encoding="utf-8")
                print(path.relative_to(REPOSITORY))


def brought_up(text: str, source: dict[str, dict[str, dict[str, str]]]) -> str:
    """The text with every figure before a mark replaced by that of the source."""
    pieces, at = [], 0
    for mark in MARK.finditer(text):
        printed = source.get(mark[1], {}).get("figures", {}).get(mark[2])
        before = text[at : mark.start()]
        pieces += [before if printed is None else _replaced(before, printed), mark[0]]
        at = mark.end()
    return "".join([*pieces, text[at:]])


def _replaced(before: str, printed: str) -> str:
    """What stands before a mark, its last figures replaced; other words and signs stay."""
    shape = re.escape(NUMBER.sub("#", printed)).replace(r"\#", NUMBER.pattern)
    shape = shape.replace(r"\ ", r"\s+")
    start = max(0, len(before) - LONGEST)
    found = re.search(rf"(?<![\d.,]){shape}(?=[*`]*$)", before[start:])
    if found is None:
        return before
    exact = iter(NUMBER.findall(printed))
    quoted = NUMBER.sub(lambda old: _rounded(next(exact), old[0]), found[0])
    return before[: start + found.start()] + quoted + before[start + found.end() :]


def _rounded(exact: str, quoted: str) -> str:
    digits = Decimal(exact.replace(",", "")).quantize(
        Decimal(quoted.replace(",", "")), ROUND_HALF_UP
    )
    return f"{digits:,}" if "," in quoted else str(digits)


if __name__ == "__main__":
    main()

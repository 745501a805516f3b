"""docs/figures.toml is the one source of the figures that the documents quote."""

import re
import tomllib
from decimal import ROUND_HALF_UP, Decimal
from itertools import pairwise

import pytest
from needs import REPOSITORY

SOURCE = tomllib.loads((REPOSITORY / "docs" / "figures.toml").read_text(encoding="utf-8"))
DOCUMENTS = {
    str(path.relative_to(REPOSITORY)): path.read_text(encoding="utf-8")
    for pattern in ("README.md", "CHANGELOG.md", "docs/**/*.md")
    for path in sorted(REPOSITORY.glob(pattern))
}
MARK = re.compile(r"<!-- (\w+)\.(\w+) -->")
# A part of a page that a tool writes; a test of its own holds it to that.
WRITTEN = re.compile(r"^<!-- (\w+: written by tools/\w+\.py|end of \w+) -->$", re.MULTILINE)
TABLE_MARK = re.compile(r"^<!-- table: (\w+|no measurement) -->$", re.MULTILINE)
NUMBER = re.compile(r"\d[\d,]*(?:\.\d+)?")
MEASURED = re.compile(r"(?<![\w.])\d[\d,]*\.?\d*(?![\w-])")  # a number that stands for itself
NAMES = re.compile(r"`[^`]*`|\[[^]]*\]\([^)]*\)|<!--.*?-->")


def rounds_to(printed: str, quoted: str) -> bool:
    """Whether the quoted words are the printed ones, with numbers rounded to fewer digits."""
    if NUMBER.sub("#", printed) != NUMBER.sub("#", quoted):
        return False
    pairs = zip(NUMBER.findall(printed), NUMBER.findall(quoted), strict=True)
    for exact, shown in (
        (Decimal(a.replace(",", "")), Decimal(b.replace(",", ""))) for a, b in pairs
    ):
        if exact.quantize(shown, ROUND_HALF_UP) != shown or shown.adjusted() < exact.adjusted():
            return False
    return True


def quoted_before(text: str, end: int, printed: str) -> str:
    """What stands before a mark, as many words and signs as the source's value has."""
    before = " ".join(text[max(0, end - 200) : end].rstrip("*`").split())
    shape = re.escape(NUMBER.sub("#", printed)).replace(r"\#", NUMBER.pattern)
    found = re.search(rf"(?<![\d.,]){shape}$", before)
    return found[0] if found else before[-20:]


def marks() -> list[tuple[str, str, str, str]]:
    """(document, measurement, figure, text before the mark) of all marks."""
    return [
        (name, mark[1], mark[2], quoted_before(text, mark.start(), value_of(mark[1], mark[2])))
        for name, text in DOCUMENTS.items()
        for mark in MARK.finditer(text)
    ]


def value_of(measurement: str, figure: str) -> str:
    return str(SOURCE.get(measurement, {}).get("figures", {}).get(figure, ""))


@pytest.mark.parametrize(
    ("printed", "quoted", "is_right"),
    [
        ("0.176 / 0.083", "0.18 / 0.08", True),
        ("0.176 / 0.083", "0.18 / 0.09", False),
        ("2,272", "2,272", True),
        ("11.01", "11.0", True),
        ("1.364", "1.37", False),
        ("746 ms", "746 us", False),
        ("0.63", "0", False),
    ],
)
def test_a_quoted_figure_may_have_fewer_digits_and_no_others(printed, quoted, is_right):
    assert rounds_to(printed, quoted) == is_right


def test_every_quoted_figure_is_that_of_the_source():
    found = marks()
    assert len(found) > 100  # the pattern still matches
    wrong = [
        f"{document}: {quoted!r} for {measurement}.{figure} = {value_of(measurement, figure)!r}"
        for document, measurement, figure, quoted in found
        if not value_of(measurement, figure) or not rounds_to(value_of(measurement, figure), quoted)
    ]
    assert not wrong, "\n".join(wrong)


def test_every_comment_is_a_mark():
    """A mark with a misspelt form would be looked at by no test."""
    for name, text in DOCUMENTS.items():
        rest = re.sub(r"`[^`\n]*`", "", WRITTEN.sub("", text))
        rest = TABLE_MARK.sub("", MARK.sub("", rest))
        assert "<!--" not in rest, f"{name}: {rest[rest.index('<!--') :][:60]}"


def test_every_source_is_used_and_says_how_it_was_measured():
    used = {(measurement, figure) for _, measurement, figure, _ in marks()}
    tables = {name for text in DOCUMENTS.values() for name in TABLE_MARK.findall(text)}
    for measurement, entry in SOURCE.items():
        assert {"command", "machine", "measured"} <= set(entry), measurement
        figures = entry.get("figures", {})
        assert figures or measurement in tables, f"{measurement} is quoted nowhere"
        unused = [figure for figure in figures if (measurement, figure) not in used]
        assert not unused, f"{measurement}: {unused} quoted nowhere"
    assert tables <= set(SOURCE) | {"no measurement"}


def test_every_table_with_figures_names_its_source():
    """By a comment above it, or by a mark in each cell that holds a number."""
    bare = [
        f"{name}: {row}"
        for name, text in DOCUMENTS.items()
        for row in unmarked_rows(text.splitlines())
    ]
    assert not bare, "\n".join(bare)


def unmarked_rows(lines: list[str]) -> list[str]:
    """Rows of tables without a comment above, where a cell after the first has bare numbers."""
    found = []
    is_covered = False
    for above, line in pairwise(["", *lines]):
        if not line.startswith("|"):
            continue
        if not above.startswith("|"):
            is_covered = TABLE_MARK.match(above) is not None
        cells = line.strip("|").split("|")[1:]
        if not is_covered and any(
            MEASURED.search(NAMES.sub(" ", cell)) and not MARK.search(cell) for cell in cells
        ):
            found.append(line)
    return found

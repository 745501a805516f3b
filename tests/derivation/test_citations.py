"""Every equation that code cites exists in the document that it names, exactly once."""

import re
from collections import Counter
from pathlib import Path

import pytest
from needs import REPOSITORY

# An equation is an indented line that ends in its number, "    e' = A e          (4.6)"; a document
# without such lines numbers paragraphs instead, "(5) eps = K zeta".
EQUATION = re.compile(r"^ {4}.*\S {2,}\((\d+(?:\.\d+)?)\)\s*$", re.MULTILINE)
PARAGRAPH = re.compile(r"^\((\d+(?:\.\d+)?)\) \S", re.MULTILINE)
NUMBER = r"\(\d+(?:\.\d+)?\)"
# "docs/x.md Eq. (1.2)", also with ", (1.3)", " and (1.4)", " - (1.6)", " to (1.6)", " (kind), ".
CITATION = re.compile(
    rf"(docs/[\w.-]+\.md)\s+Eqs?\.\s+({NUMBER}(?:\s+\([a-z][^)]*\))?"
    rf"(?:(?:\s*,\s*|\s+and\s+|\s*[-–]\s*|\s+to\s+){NUMBER}(?:\s+\([a-z][^)]*\))?)*)"
)
FOLDERS = ("h2nav", "tools", "tests")
DOCUMENTS = ("derivation.md", "filter.md", "fixed-point.md", "motion.md", "rotations.md")


def numbers_of(document: Path) -> list[str]:
    return equations(document.read_text(encoding="utf-8"))


def equations(text: str) -> list[str]:
    return EQUATION.findall(text) or PARAGRAPH.findall(text)


def cited(text: str) -> list[tuple[str, str]]:
    """(document, number) of all citations of a Python file, ranges written out."""
    found = []
    for document, list_text in CITATION.findall(" ".join(text.split())):
        parts = re.findall(rf"({NUMBER})|(\s[-–]\s|\sto\s)", list_text)
        previous, is_range = "", False
        for number, dash in parts:
            if dash:
                is_range = True
                continue
            value = number.strip("()")
            if is_range:
                found += [(document, between) for between in written_out(previous, value)]
            found.append((document, value))
            previous, is_range = value, False
    return found


def written_out(first: str, last: str) -> list[str]:
    """The numbers strictly between two of one section."""
    section, _, low = first.rpartition(".")
    other, _, high = last.rpartition(".")
    assert section == other, f"a range over sections: ({first}) - ({last})"
    prefix = f"{section}." if section else ""
    return [f"{prefix}{number}" for number in range(int(low) + 1, int(high))]


def all_citations() -> list[tuple[str, str, str]]:
    """(file, document, number) of everything in the repository's code."""
    return [
        (str(path.relative_to(REPOSITORY)), document, number)
        for folder in FOLDERS
        for path in sorted((REPOSITORY / folder).rglob("*.py"))
        if path != Path(__file__)
        for document, number in cited(path.read_text(encoding="utf-8"))
    ]


def test_citations_are_found_in_all_their_spellings() -> None:
    text = """Source: docs/a.md Eq. (3.1), (3.3) - (3.5) and (4.1).
    See docs/b.md Eq. (7)
      to (9). Source: docs/a.md Eq. (4.5) (continuous), (4.14) (discrete)."""
    assert cited(text) == [
        ("docs/a.md", "3.1"),
        ("docs/a.md", "3.3"),
        ("docs/a.md", "3.4"),
        ("docs/a.md", "3.5"),
        ("docs/a.md", "4.1"),
        ("docs/b.md", "7"),
        ("docs/b.md", "8"),
        ("docs/b.md", "9"),
        ("docs/a.md", "4.5"),
        ("docs/a.md", "4.14"),
    ]


def test_equations_are_found() -> None:
    text = "Text (1).\n\n    a = b      (1.2)\n    c = d,\n    e = f  (3)\n    f(7)\n(9) prose\n"
    assert equations(text) == ["1.2", "3"]
    assert equations("(1) a = b.\n\n(2) c = d, by (1).\n") == ["1", "2"]


def test_code_cites() -> None:
    """If the pattern stopped matching, the tests below would pass on nothing."""
    per_document = Counter(document for _, document, _ in all_citations())
    assert per_document["docs/derivation.md"] > 40
    assert per_document["docs/motion.md"] > 10


def test_every_cited_equation_exists() -> None:
    known = {
        document: set(numbers_of(REPOSITORY / document))
        for document in {document for _, document, _ in all_citations()}
        if (REPOSITORY / document).is_file()
    }
    missing = [
        f"{file}: {document} Eq. ({number})"
        for file, document, number in all_citations()
        if number not in known.get(document, ())
    ]
    assert not missing, "\n".join(missing)


@pytest.mark.parametrize("name", DOCUMENTS)
def test_equation_numbers_are_unique(name: str) -> None:
    counts = Counter(numbers_of(REPOSITORY / "docs" / name))
    assert counts, f"docs/{name} has no numbered equation"
    assert not [number for number, count in counts.items() if count > 1]

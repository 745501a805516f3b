"""docs/faults.md: every fault has a row, and every test that a row names is there."""

import re

from needs import REPOSITORY

FAULTS = 30
TABLE = (REPOSITORY / "docs" / "faults.md").read_text()


def test_every_fault_has_a_row():
    numbers = re.findall(r"^\| (\d+) \|", TABLE, re.MULTILINE)
    assert [int(number) for number in numbers] == list(range(1, FAULTS + 1))


def test_the_tests_that_hold_the_promises_exist():
    named = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", TABLE)
    assert len(named) >= FAULTS
    for path, name in named:
        text = (REPOSITORY / path).read_text()
        assert not name or f"def {name}(" in text, f"{path}::{name}"

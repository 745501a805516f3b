"""Severities by the numbers and words of logs."""

import pytest

from h2nav.integrity.severity import Severity


@pytest.mark.parametrize("severity", Severity)
def test_a_severity_is_found_by_its_number_and_its_word(severity):
    assert Severity.of(severity.word) is Severity.of(severity.value) is severity
    assert Severity.of(float(severity)) is severity


@pytest.mark.parametrize("value", [None, True, 1, 7, "", "Error", "3", 3.5, float("nan"), [3]])
def test_anything_else_is_none(value):
    assert Severity.of(value) is None


def test_the_worst_is_the_least():
    assert min(Severity) is Severity.CRITICAL
    assert [one.tag for one in sorted(Severity)] == ["serious"] * 2 + ["warning"] + ["note"] * 2
    assert [one.look for one in sorted(Severity)] == ["severe"] * 2 + ["doubtful"] + ["noted"] * 2

"""Complaints about sections that others wrote: place, key, remedy."""

import math

import pytest

from h2nav.validation import Within, finite_numbers, key_complaints, numbers_within

LIMITS = {"rate_hz": Within(1.0, 100.0), "noise": Within(0.0, 1.0)}


def test_numbers_come_as_floats_and_the_others_as_complaints() -> None:
    complaints: list[str] = []
    numbers = numbers_within({"rate_hz": 50, "noise": 2.0}, LIMITS, complaints, "f.yaml", "gains.")
    assert numbers == {"rate_hz": 50.0}
    assert type(numbers["rate_hz"]) is float
    assert complaints == ["f.yaml: gains.noise: expected a number from 0 to 1, found 2.0"]


@pytest.mark.parametrize("value", [True, "50", None, [50.0], math.nan, math.inf, 0.9, 10**400])
def test_what_is_no_number_within_the_limits_is_a_complaint(value: object) -> None:
    complaints: list[str] = []
    assert numbers_within({"rate_hz": value}, LIMITS, complaints, "f.yaml") == {}
    (line,) = complaints
    assert line.startswith("f.yaml: rate_hz: expected a number from 1 to 100, found ")


def test_keys_that_are_unknown_or_missing_are_named_with_a_remedy() -> None:
    section = {"rate_zh": 50.0, "x\x1b[2J": 1}
    assert key_complaints(section, LIMITS, ["noise"], "f.yaml", "gains.") == [
        "f.yaml: gains.rate_zh: unknown key; did you mean gains.rate_hz?",
        "f.yaml: gains.'x\\x1b[2J': unknown key; known: rate_hz, noise",
        "f.yaml: gains.noise: missing; this key is required",
    ]
    assert key_complaints({"noise": 0.0}, LIMITS, ["noise"], "f.yaml") == []


def test_a_list_of_finite_numbers_is_taken_whole_or_not_at_all() -> None:
    assert finite_numbers([1, 2.5]) == [1.0, 2.5]
    assert finite_numbers((0.0,)) == [0.0]
    for damaged in ([1.0, math.nan], [1.0, "2"], [True], [10**400], "12", 3.0, None, {1.0: 2.0}):
        assert finite_numbers(damaged) == []

"""What a log says of its run: states, refusals, findings and differences, whatever is in it."""

import json
import math
from typing import Any

import pytest

from h2nav.log import account
from h2nav.log.account import Account, LogAccount

START_NS = 1_795_260_679 * 10**9


def told(topic: str, *records: Any) -> LogAccount:
    """The account of some records, a second apart."""
    found = Account()
    for number, record in enumerate(records):
        data = record if isinstance(record, bytes) else json.dumps(record).encode()
        found.take(topic, START_NS + number * 10**9, data)
    return found.result(START_NS)


def health(state: str, reason: str = "", cause: str = "") -> dict[str, str]:
    return {"state": state, "reason": reason, "cause": cause}


def test_a_state_lasts_until_another_or_another_cause() -> None:
    records = [
        health("aligning", "1 s", "first"),
        health("aligning", "2 s", "first"),
        health("aligning", "no field", "field"),
        health("active"),
        health("active"),
    ]
    assert [tuple(one) for one in told("/health", *records).states] == [
        ("aligning", "1 s", 0.0, 2.0),
        ("aligning", "no field", 2.0, 3.0),
        ("active", "", 3.0, 4.0),
    ]


def test_the_largest_total_of_each_refusal_counts() -> None:
    records = [
        {"reason": "late", "total": 3},
        {"reason": "late", "total": 2},
        {"reason": "bad", "total": True},
        {"reason": "worse", "total": "4"},
    ]
    assert told("/rejected", *records).refusals == {"late": 3}


@pytest.mark.parametrize(
    ("is_open", "ended"), [([True], False), ([True, False], True), ([True, False, True], False),
                           ([None], False), ([None, None], True), ([None, None, None], False)]
)  # fmt: skip
def test_a_finding_ends_with_its_last_record_and_old_ones_with_their_second(
    is_open: list[bool | None], ended: bool
) -> None:
    records = [
        {"kind": "x", "source": "IMU 1", "from_s": 2.5, "severity": "error", "is_open": one}
        for one in is_open
    ]
    (found,) = told("/finding", *records).findings
    assert (found["ended"], found["severity"]) == (ended, "error")


def test_findings_are_told_apart_by_their_id_or_what_they_are() -> None:
    base = {"kind": "x", "source": "IMU 1", "from_s": 2.5, "severity": "loud"}
    records = [
        base | {"id": "x.1"}, base | {"id": "x.2", "from_s": 1.5}, base, base | {"from_s": 3.5},
        base | {"from_s": None}, base | {"from_s": "1"},
    ]  # fmt: skip
    found = told("/finding", *records).findings
    assert [one["from_s"] for one in found] == [1.5, 2.5, 2.5, 3.5]
    assert {one["severity"] for one in found} == {"unknown"}


def test_the_largest_differences_of_each_source() -> None:
    records = [
        {"source": "b", "tilt_deg": 1.0, "heading_deg": -4.0, "heading_verdict": "ours"},
        {"source": "b", "tilt_deg": 3.0, "heading_deg": 2.0, "tilt_verdict": "theirs"},
        {"source": "b", "tilt_deg": None, "heading_deg": None},
        {"source": "a", "tilt_deg": "far"},
    ]
    first, second = told("/comparison", *records).differences
    assert (first.source, first.compared, first.tilt_at_s) == ("a", 1, 3.0)
    assert math.isnan(first.tilt_deg)
    assert second[1:] == (3, 3.0, 1.0, "theirs", -4.0, 0.0, "ours")


@pytest.mark.parametrize("topic", sorted(Account().topics))
@pytest.mark.parametrize("record", [b"", b"nothing", [1], None, 3, {}, {"from_s": []}])
def test_what_is_no_record_of_ours_says_nothing(topic: str, record: Any) -> None:
    found = told(topic, record)
    assert (found.states, found.refusals, found.findings) == ([], {}, [])
    assert all(math.isnan(one.tilt_deg) for one in found.differences)


@pytest.mark.parametrize(
    ("limit", "topic", "record", "name"),
    [
        ("MAX_STATES", "/health", {"state": "{}"}, "states"),
        ("MAX_REASONS", "/rejected", {"reason": "{}", "total": 1}, "refusals"),
        ("MAX_FINDINGS", "/finding", {"id": "{}", "from_s": 1.0}, "findings"),
        ("MAX_SOURCES", "/comparison", {"source": "{}", "tilt_deg": 1.0}, "differences"),
    ],
)
def test_no_log_makes_more_of_them_than_the_limit(
    monkeypatch: pytest.MonkeyPatch, limit: str, topic: str, record: dict[str, Any], name: str
) -> None:
    monkeypatch.setattr(account, limit, 3)
    (key, _), *_ = record.items()
    records = [record | {key: str(number)} for number in range(5)]
    assert len(getattr(told(topic, *records), name)) == 3
    assert len(getattr(told(topic, *records[:3], *records[:3]), name)) == 3

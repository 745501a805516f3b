"""The list of flights: what a row says, in which order, and within which limits."""

import pytest
from flight_folders import add_flights, summary

from h2nav.flights.folder import FlightFiles, FlightFolder, RecordedFile
from h2nav.flights.index import FlightIndex, Question
from h2nav.flights.retention import DAY_NS, FIRST_DATED_NS, KeptFlight, RetentionLimits, to_delete
from h2nav.flights.summary import sentence_of, summary_of
from h2nav.integrity.severity import Severity


def document(*findings, **more):
    found = [dict(zip(("severity", "kind", "text"), each, strict=True)) for each in findings]
    return {
        "findings": found, "spans": {"armed": []}, "start_utc": "2026-01-01T00:00:00Z",
        "vehicle": "quadrotor", "airframe": {"id": "uid:1", "uid": "1"}, "autopilot": "ArduPilot",
        "firmware": "V4", "kind": "bin", "duration_s": 90.0, "flown": {"distance_m": 120.5},
        "receivers": [1], "headline": "Sound.", "why_no_estimate": None, **more,
    }  # fmt: skip


ERROR, WARNING = ("error", "crash", "crashed"), ("warning", "vibration", "shakes")
NOTICE, INFO = ("notice", "clock_drift", "slow"), ("info", "clock_drift", "slower")


@pytest.mark.parametrize(
    ("findings", "counts", "worst"),
    [
        ([], (0, 0, 0), ("", "", "")),
        ([NOTICE], (0, 0, 1), ("notice", "clock_drift", "slow")),
        ([INFO, WARNING, NOTICE], (0, 1, 2), ("warning", "vibration", "shakes")),
        ([WARNING, ERROR, ("critical", "x", "y")], (2, 1, 0), ("critical", "x", "y")),
        ([ERROR, ("error", "x", "y")], (2, 0, 0), ERROR),  # causes come first
        ([("loud", "x", "y")], (0, 0, 1), ("notice", "x", "y")),
    ],
)
def test_a_row_counts_findings_and_names_the_worst(findings, counts, worst):
    row = summary_of(document(*findings))
    assert (row["errors"], row["warnings"], row["notices"]) == counts
    assert (row["worst"], row["worst_kind"], row["worst_text"]) == worst
    assert set(row["kinds"]) == {kind for _, kind, _ in findings}
    if NOTICE in findings and INFO in findings:
        assert row["kinds"]["clock_drift"] == "notice"  # the worst of each kind


@pytest.mark.parametrize(
    ("more", "name", "value"),
    [
        ({}, "date", "2026-01-01T00:00:00Z"),
        ({}, "airframe", "uid:1"),
        ({"airframe": {"id": "system:1", "uid": ""}}, "airframe", "ArduPilot"),
        ({"airframe": {"id": "system:1", "uid": ""}, "autopilot": ""}, "airframe", "quadrotor"),
        ({}, "duration_s", 90.0),
        ({"spans": {"armed": [{"from_s": 1.0, "to_s": 11.0}, {"from_s": 20.0, "to_s": 25.5}]}},
         "duration_s", 15.5),
        ({}, "distance_m", 120.5),
        ({"receivers": []}, "distance_m", None),
        ({}, "verdict", "Sound."),
        ({"headline": "x" * 241}, "verdict", "x" * 240),
        ({"why_no_estimate": "no IMU"}, "verdict", "Not judged: no IMU."),
        ({"why_no_estimate": "y" * 300}, "worst_text", "y" * 240),
    ],
)  # fmt: skip
def test_a_row_of_the_list(more, name, value):
    assert summary_of(document(**more))[name] == value


@pytest.mark.parametrize(
    ("findings", "more", "severity", "text"),
    [
        ([], {}, Severity.INFO, "flight sound"),
        ([NOTICE], {}, Severity.INFO, "flight sound, 1 notice"),
        ([NOTICE, INFO], {}, Severity.INFO, "flight sound, 2 notices"),
        ([WARNING], {}, Severity.WARNING, "flight: Sound."),
        ([NOTICE, ERROR], {}, Severity.ERROR, "flight: Sound."),
        ([("critical", "x", "y")], {}, Severity.CRITICAL, "flight: Sound."),
        ([], {"why_no_estimate": "no IMU"}, Severity.NOTICE, "flight not judged: no IMU"),
        ([NOTICE], {"why_no_estimate": "no IMU"}, Severity.INFO, "flight sound, 1 notice"),
    ],
)
def test_what_a_ground_station_is_told(findings, more, severity, text):
    assert sentence_of(summary_of(document(*findings, **more))) == (severity, text)


# --- the index --------------------------------------------------------------------------------


@pytest.fixture
def listed(tmp_path):
    """Flights by their summaries, newest last; the index is refreshed."""
    opened = []

    def made(*summaries, errors=()):
        folder = FlightFolder(tmp_path)
        folder.reviews.mkdir()
        for number, row in enumerate(summaries):
            (tmp_path / f"{number}.bin").write_bytes(bytes(10 * (number + 1)))
            flight = next(
                each for each in folder.flights().values() if each.best.name == f"{number}.bin"
            )
            if row is not None:
                folder.commit(flight, row, error="broken" if number in errors else "")
        index = FlightIndex(folder)
        index.refresh()
        opened.append(index)
        return index

    yield made
    for index in opened:
        index.close()


def names(index, **asked):
    return [row["name"] for row in index.page(Question(**asked))["flights"]]


def rows_of(*severities):
    return [
        {**summary(number), "worst": worst, "kinds": {"crash": worst} if worst else {}}
        for number, worst in enumerate(severities)
    ]


def test_the_worst_come_first_then_failures_then_what_waits(listed):
    rows = [*rows_of("", "warning", "error", "", "info", "critical"), None]
    index = listed(*rows, errors=(3,))
    order = ["5.bin", "2.bin", "1.bin", "4.bin", "3.bin", "6.bin", "0.bin"]
    assert names(index, sort="verdict", descending=False) == order
    assert [row["state"] for row in index.page(Question("worst", False))["flights"]] == [
        *["reviewed"] * 4, "failed", "waiting", "reviewed",
    ]  # fmt: skip
    assert names(index, sort="worst", descending=False, severity="warning") == order[:3]
    assert names(index, sort="worst", descending=False, severity="info") == order[:4]
    assert names(index, state="failed") == ["3.bin"]
    assert index.page(Question())["states"] == {"failed": 1, "reviewed": 5, "waiting": 1}


def test_a_row_says_what_the_files_say(listed):
    index = listed({**summary(1), "date": None, "duration_s": 12.5, "files": "no"})
    (row,) = index.page(Question())["flights"]
    assert (row["name"], row["files"], row["size"]) == ("0.bin", ["0.bin"], 10)
    assert row["duration_s"] == 12.5
    # A flight without a date has that of its file.
    assert row["date"].endswith("Z")
    assert len(row["date"]) == len("2026-01-01T00:00:00Z")
    assert index.flight(row["id"]) == row
    assert index.flight("nothing") is None


def test_a_page_has_one_to_five_hundred_rows(tmp_path):
    index = FlightIndex(FlightFolder(tmp_path))
    files = (RecordedFile("x.bin", 1, 1),)
    ids = [f"x-{number:03d}" for number in range(501)]
    assert index.take({flight: (FlightFiles(flight, files), None) for flight in ids}) == 501
    for offset, limit, rows, shown_offset in (
        (0, 2, 2, 0), (499, 5, 2, 499), (-3, 2, 2, 0), (0, 0, 1, 0), (0, -1, 1, 0),
        (600, 1, 0, 600), (0, 500, 500, 0), (0, 501, 500, 0),
    ):  # fmt: skip
        page = index.page(Question(offset=offset, limit=limit))
        assert (len(page["flights"]), page["offset"]) == (rows, shown_offset)
        assert (page["total"], page["matching"]) == (501, 501)
    index.close()


def test_a_search_reads_two_hundred_letters(listed):
    index = listed(*rows_of("", "error"))
    assert names(index, search="1.b " + " " * 196 + "@") == ["1.bin"]
    assert names(index, search="1.b " + " " * 195 + "@") == []
    assert names(index, search="CRASH") == ["1.bin"]  # a kind of finding
    assert names(index, search="crash 0.b") == []
    assert names(index, sort="no such column") == ["1.bin", "0.bin"]


def test_a_listing_is_taken_once(tmp_path):
    folder = add_flights(tmp_path, 2)
    index = FlightIndex(folder)
    listing = index.look()
    assert (index.take(listing), index.take(listing), index.take({})) == (2, 0, 2)
    assert index.page(Question())["flights"] == []
    index.close()


# --- what is kept -----------------------------------------------------------------------------

NOW_NS = FIRST_DATED_NS + 1000 * DAY_NS


def flight(name, age_days=1.0, size=10, *, errors=False, reviewed=True):
    return KeptFlight(name, size, NOW_NS - round(age_days * DAY_NS), reviewed, errors)


@pytest.mark.parametrize(
    ("flights", "limits", "deleted"),
    [
        ([flight("a", 30), flight("b", 0)], (0, 30), ()),
        ([flight("a", 30.0001), flight("b", 0)], (0, 30), ("a",)),
        ([flight("a", 99), flight("b", 0)], (0, 0), ()),
        ([flight("a", 99, errors=True), flight("b", 0)], (0, 30), ()),
        ([flight("a", 99, reviewed=False), flight("b", 0)], (5, 30), ()),
        ([flight("a", 1000), flight("b", 0)], (0, 30), ("a",)),
        ([flight("a", 1000.1), flight("b", 0)], (0, 30), ()),  # its clock was never set
        ([flight("a", 2), flight("b", 1), flight("c", 0)], (30, 0), ()),
        ([flight("a", 2), flight("b", 1), flight("c", 0)], (29, 0), ("a",)),
        ([flight("a", 2), flight("b", 1), flight("c", 0)], (10, 0), ("a", "b")),
        ([flight("a", 2), flight("b", 1), flight("c", 0)], (1, 0), ("a", "b")),  # not the newest
        ([flight("a", 2, errors=True), flight("b", 1), flight("c", 0)], (29, 0), ("b",)),
        ([flight("a", 2, errors=True), flight("b", 1), flight("c", 0)], (19, 0), ("b", "a")),
        ([], (1, 1), ()),
    ],
)
def test_which_flights_go(flights, limits, deleted):
    assert to_delete(flights[::-1], RetentionLimits(*limits), NOW_NS) == deleted

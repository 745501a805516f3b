"""The index says what is in the files, whatever became of the index."""

import pytest
from flight_folders import add_flights, summary

from h2nav.flights.folder import FlightFolder
from h2nav.flights.index import INDEX, SORTS, FlightIndex, Question, _date

COUNT = 40


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> FlightFolder:
    return add_flights(tmp_path_factory.mktemp("flights"), COUNT)


@pytest.fixture
def index(folder):
    made = FlightIndex(folder)
    made.refresh()
    yield made
    made.close()


def rows(index, **asked):
    return index.page(Question(**asked, limit=500))["flights"]


def test_it_lists_all_newest_first(index):
    dates = [row["date"] for row in rows(index)]
    assert len(dates) == COUNT
    assert dates == sorted(dates, reverse=True)


@pytest.mark.parametrize("sort", SORTS)
def test_every_sort_lists_every_flight_in_both_orders(index, sort):
    up = [row["id"] for row in rows(index, sort=sort, descending=False)]
    down = [row["id"] for row in rows(index, sort=sort, descending=True)]
    assert sorted(up) == sorted(down)
    assert len(set(up)) == COUNT


def test_unknown_values_come_last_in_both_orders(index):
    for descending in (False, True):
        found = [row["distance_m"] for row in rows(index, sort="distance", descending=descending)]
        known = [value for value in found if value is not None]
        assert found[: len(known)] == sorted(known, reverse=descending)


def test_filters_agree_with_the_summaries(index):
    summaries = [summary(number) for number in range(COUNT)]
    for kind in ("crash", "vibration"):
        expected = sum(kind in each["kinds"] for each in summaries)
        assert expected > 0
        assert len(rows(index, kind=kind)) == expected
        assert index.page(Question())["kinds"][kind] == expected
    errors = sum(each["worst"] == "error" for each in summaries)
    warnings = sum(each["worst"] in ("error", "warning") for each in summaries)
    assert len(rows(index, severity="error")) == errors
    assert len(rows(index, severity="warning")) == warnings


def test_a_search_finds_all_of_its_words_and_takes_signs_as_they_are(index):
    found = rows(index, search="vibration PLANE")
    expected = [
        each
        for each in map(summary, range(COUNT))
        if "vibration" in each["kinds"] and "Plane" in each["firmware"]
    ]
    assert len(found) == len(expected) > 0
    for nothing in ("%", "_x_", "' OR 1=1 --", "\\"):
        assert rows(index, search=nothing + "zzz") == []
    assert rows(index, search="%") == []


def test_pages_are_parts_of_the_list(index):
    whole = [row["id"] for row in rows(index)]
    pages = [index.page(Question(offset=start, limit=15)) for start in range(0, COUNT, 15)]
    assert [row["id"] for page in pages for row in page["flights"]] == whole
    assert all(page["matching"] == page["total"] == COUNT for page in pages)


def test_it_follows_the_files(tmp_path):
    folder = add_flights(tmp_path, 5)
    index = FlightIndex(folder)
    assert index.refresh() == 5
    assert index.refresh() == 0
    flights = list(folder.flights().values())
    (tmp_path / "new.bin").write_bytes(b"x")
    folder.delete(flights[0])
    (tmp_path / flights[1].best.name).unlink()
    assert index.refresh() == 3
    states = index.page(Question())["states"]
    assert states == {"recording deleted": 1, "reviewed": 3, "waiting": 1}
    index.close()


@pytest.mark.parametrize("content", [b"", b"SQLite format 3\0" + bytes(4000), b"nonsense" * 99])
def test_a_damaged_index_is_built_anew(tmp_path, content):
    folder = add_flights(tmp_path, 3)
    (folder.reviews / INDEX).write_bytes(content)
    index = FlightIndex(folder)
    index.refresh()
    assert index.page(Question())["total"] == 3
    index.close()


def test_an_index_whose_damage_only_a_page_of_the_list_shows_is_built_anew(tmp_path):
    folder = add_flights(tmp_path, 5)
    index = FlightIndex(folder)
    index.refresh()
    index.close()
    whole = (folder.reviews / INDEX).read_bytes()
    size = int.from_bytes(whole[16:18], "big")  # of a page of SQLite
    for place in range(size, len(whole), size):
        damaged = whole[:place] + b"\xff" * size + whole[place + size :]
        (folder.reviews / INDEX).write_bytes(damaged)
        index = FlightIndex(folder)
        index.refresh()
        assert len(rows(index)) == 5
        index.close()


def test_without_a_place_to_write_it_is_in_memory(tmp_path):
    add_flights(tmp_path / "root", 3)
    blocked = tmp_path / "a-file"
    blocked.write_bytes(b"")
    index = FlightIndex(FlightFolder(tmp_path / "root", blocked / "reviews"))
    index.refresh()
    assert index.page(Question())["states"] == {"waiting": 3}
    index.close()


@pytest.mark.parametrize(
    ("unix_ns", "date"),
    [
        (0, "1970-01-01T00:00:00Z"),
        (-1, "1969-12-31T23:59:59Z"),
        (951_827_696_999_999_999, "2000-02-29T12:34:56Z"),
        (951_827_697_000_000_000, "2000-02-29T12:34:57Z"),
        (1_767_225_599_000_000_000, "2025-12-31T23:59:59Z"),
        (253_402_300_799_999_999_999, "9999-12-31T23:59:59Z"),
        (253_402_300_800_000_000_000, None),
        (-62_135_596_800_000_000_000 - 1, None),
        (10**40, None),
    ],
)
def test_dates_are_of_whole_seconds_in_utc_and_no_date_is_made_up(unix_ns, date):
    assert _date(unix_ns) == date

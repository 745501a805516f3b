"""How old the list of flights may be, and what happens while a client changes the folder."""

import asyncio

import pytest
from flight_folders import add_flights

from h2nav.flights.index import Question
from h2nav.live import flights_site
from h2nav.live.flights_site import READ_ONLY, FlightsSite


class Clock:
    """Seconds that pass only where a test says so."""

    def __init__(self):
        self.now_s = 1_000.0

    def monotonic(self):
        return self.now_s


@pytest.fixture
def clock(monkeypatch):
    found = Clock()
    monkeypatch.setattr(flights_site, "time", found)
    return found


async def count(site):
    """The flights of an answer, once whatever it began is done."""
    page = await site.page(Question())
    if site._looking is not None:
        await site._looking
    return len(page["flights"])


def test_a_list_older_than_two_seconds_is_brought_up_to_date_while_it_answers(tmp_path, clock):
    async def check():
        site = FlightsSite(add_flights(tmp_path / "flights", 1))
        assert await count(site) == 1
        add_flights(tmp_path / "flights", 2)
        clock.now_s += 2.0
        assert [await count(site), await count(site)] == [1, 1]
        clock.now_s += 0.1
        assert [await count(site), await count(site)] == [1, 2]  # the answer does not wait
        site.close()

    asyncio.run(check())


def test_what_a_client_has_changed_is_in_the_next_answer(tmp_path, clock):
    async def check():
        site = FlightsSite(add_flights(tmp_path / "flights", 1))
        assert await count(site) == 1
        add_flights(tmp_path / "flights", 2)
        assert not site.changed.is_set()
        await site.has_changed()
        assert site.changed.is_set()
        assert await count(site) == 2
        assert await site.flight("no such flight") is None
        site.close()

    asyncio.run(check())


def test_a_site_is_read_only_unless_told_and_takes_one_upload_at_a_time(tmp_path):
    site = FlightsSite(add_flights(tmp_path / "flights", 0))
    assert site.rights == READ_ONLY == ("", 0)
    assert not site.is_uploading
    site.begin_upload()
    assert site.is_uploading
    site.end_upload()
    assert not site.is_uploading
    site.close()  # nothing was open

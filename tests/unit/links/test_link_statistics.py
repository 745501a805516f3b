"""What a link counts."""

from h2nav.links.link_statistics import LinkStatistics, LinkTally


def test_a_link_begins_with_nothing():
    assert LinkTally().snapshot() == LinkStatistics() == (0,) * len(LinkStatistics._fields)
    assert LinkTally().last_error == ""


def test_each_counter_counts_by_itself():
    tally = LinkTally()
    for number, name in enumerate(LinkStatistics._fields):
        tally.add(**{name: number})
        tally.add(**{name: 100})
    before = tally.snapshot()
    assert before == tuple(100 + number for number in range(len(before)))
    tally.error(OSError("gone"))
    tally.error("again")
    assert tally.snapshot() == before._replace(errors=before.errors + 2)
    assert tally.last_error == "again"

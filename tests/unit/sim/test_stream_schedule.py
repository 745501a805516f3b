"""When each stream of the fake autopilot is due, on a line that may be too slow."""

from types import SimpleNamespace

import pytest

from h2nav.sim.stream_schedule import StreamSchedule

S = 1_000_000_000
MS = 1_000_000
QUICK, SLOW, SILENT = 1, 2, 3


def stream(message_id, default_hz=0.0, group=None):
    return SimpleNamespace(message_id=message_id, default_hz=default_hz, group=group)


def schedule(line_bytes_per_s=None):
    return StreamSchedule(
        [stream(QUICK, 50.0, group=6), stream(SLOW, 4.0), stream(SILENT, group=7)],
        line_bytes_per_s,
    )


def popped(one, t_ns):
    """Message ids that are due until a time, with their times."""
    found = []
    while (due_ns := one.next_deadline_ns) is not None and due_ns <= t_ns:
        due = one.pop_due(due_ns)
        found.append((due_ns, None if due is None else due.message_id))
    return found


def test_defaults_are_those_with_a_rate():
    one = schedule()
    assert one.next_deadline_ns is None
    one.start_defaults(S)
    assert one.running() == [QUICK, SLOW]
    assert [one.interval_ns(each) for each in (QUICK, SLOW, SILENT)] == [20 * MS, 250 * MS, 0]
    assert popped(one, S + 41 * MS) == [(S + 20 * MS, QUICK), (S + 40 * MS, QUICK)]
    one.stop_all()
    assert (one.running(), one.next_deadline_ns) == ([], None)


@pytest.mark.parametrize(
    ("group", "ids"), [(0, [QUICK, SILENT]), (6, [QUICK]), (7, [SILENT]), (1, [])]
)
def test_a_stream_without_a_group_is_in_none(group, ids):
    assert schedule().of_group(group) == ids


def test_a_new_interval_counts_from_when_it_is_set_and_replaces_the_old_one():
    one = schedule()
    one.set_interval(0, QUICK, 20 * MS)
    one.set_interval(10 * MS, QUICK, 30 * MS)
    assert popped(one, 69 * MS) == [(40 * MS, QUICK)]
    one.set_interval(69 * MS, QUICK, 0)
    assert one.next_deadline_ns is None
    assert one.running() == []


def test_of_two_that_are_due_the_one_set_first_is_first():
    one = schedule()
    for message_id in (SLOW, QUICK):
        one.set_interval(0, message_id, 20 * MS)
    assert [message_id for _, message_id in popped(one, 20 * MS)] == [SLOW, QUICK]


def test_what_was_due_while_the_process_was_stopped_is_skipped():
    one = schedule()
    one.set_interval(0, QUICK, 20 * MS)
    one.skip_to(S)
    assert popped(one, S + 20 * MS) == [(S + 20 * MS, QUICK)]


@pytest.mark.parametrize(("size_bytes", "has_room"), [(20, True), (21, False)])
def test_a_line_takes_messages_while_20_ms_are_queued(size_bytes, has_room):
    one = schedule(line_bytes_per_s=1_000.0)  # a byte takes 1 ms
    one.occupy(5 * MS, size_bytes)
    assert one.has_room(5 * MS) is has_room
    one.occupy(5 * MS, 10)  # behind the first
    assert one.has_room((size_bytes - 5) * MS)
    assert not one.has_room((size_bytes - 5) * MS - 1)


def test_a_line_without_a_capacity_is_never_full():
    one = schedule()
    one.occupy(0, 10**9)
    assert one.has_room(0)


def test_on_a_full_line_a_stream_waits_until_there_is_room():
    one = schedule(line_bytes_per_s=1_000.0)
    one.set_interval(0, QUICK, 10 * MS)
    one.occupy(10 * MS, 35)  # free again at 45 ms, so that there is room at 25 ms
    assert popped(one, 25 * MS + 1) == [(10 * MS, None), (25 * MS + 1, QUICK)]
    assert one.put_off == 1
    assert one.next_deadline_ns == 35 * MS + 1

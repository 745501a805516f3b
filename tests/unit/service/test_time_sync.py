import random

from h2nav.maths.units import SECOND_NS
from h2nav.service.time_sync import TimeSync

MS = 1_000_000


def exchange(sync, t_ns, offset_ns, out_ns=MS, back_ns=MS):
    ts1 = sync.request(t_ns)
    return sync.answer(t_ns + out_ns + back_ns, t_ns + out_ns + offset_ns, ts1)


def test_locks_to_the_offset():
    sync = TimeSync()
    for i in range(10):
        exchange(sync, i * SECOND_NS, 5 * SECOND_NS)
    assert sync.is_locked
    assert abs(sync.offset_ns(10 * SECOND_NS) - 5 * SECOND_NS) < MS // 100


def test_delayed_exchanges_are_not_believed():
    random.seed(1)
    sync = TimeSync()
    for i in range(40):
        late_ns = 0 if i % 4 == 0 else random.randrange(2 * MS, 150 * MS)
        exchange(sync, i * SECOND_NS, 7 * SECOND_NS, back_ns=MS + late_ns)
    assert abs(sync.offset_ns(40 * SECOND_NS) - 7 * SECOND_NS) < 2 * MS


def test_skew_is_seen():
    sync = TimeSync()
    for i in range(16):
        exchange(sync, i * 10 * SECOND_NS, 3 * SECOND_NS + round(i * 10 * SECOND_NS * 50e-6))
    assert abs(sync.skew - 50e-6) < 2e-6


def test_a_jump_forgets_the_past():
    sync = TimeSync()
    for i in range(10):
        exchange(sync, i * SECOND_NS, 5 * SECOND_NS)
    exchange(sync, 11 * SECOND_NS, -20 * SECOND_NS)
    assert not sync.is_locked
    for i in range(12, 16):
        exchange(sync, i * SECOND_NS, -20 * SECOND_NS)
    assert abs(sync.offset_ns(16 * SECOND_NS) + 20 * SECOND_NS) < MS // 100


def test_answers_to_others_are_ignored():
    sync = TimeSync()
    sync.request(100)
    assert sync.answer(2 * MS, 5, ts1=999) is None

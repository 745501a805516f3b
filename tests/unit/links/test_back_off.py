from h2nav.links.back_off import LONGEST_DELAY_NS, BackOff

MS = 1_000_000


def wait_ms(back_off: BackOff, t_ns: int) -> int:
    back_off.failed(t_ns)
    return next(ms for ms in range(5000) if back_off.is_due(t_ns + ms * MS))


def test_first_attempt_is_due_at_once() -> None:
    assert BackOff().is_due(0)
    assert BackOff().is_due(-5)


def test_delay_doubles_up_to_one_second_and_starts_anew_after_success() -> None:
    back_off = BackOff()
    assert [wait_ms(back_off, 0) for _ in range(6)] == [100, 200, 400, 800, 1000, 1000]
    assert LONGEST_DELAY_NS == 1000 * MS
    back_off.succeeded()
    assert wait_ms(back_off, 0) == 100

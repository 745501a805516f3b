"""One constant between the host's clocks, for a whole run."""

import time

import pytest

from h2nav.host.host_clock import UnixClock


def test_differences_of_monotonic_times_stay_exact() -> None:
    clock = UnixClock()
    times = [0, 1, 10**9, 2**62]
    assert [clock.unix_ns(t_ns) - clock.offset_ns for t_ns in times] == times


def test_a_step_of_the_unix_clock_is_told_and_not_followed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Fault 5."""
    clock = UnixClock()
    before = clock.unix_ns(7)
    true_time_ns = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: true_time_ns() + 3_600_000_000_000)
    assert clock.step_ns() == pytest.approx(3_600_000_000_000, abs=1_000_000_000)
    assert clock.unix_ns(7) == before

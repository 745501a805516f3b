"""What a receiver says against itself: velocities that repeat, and places that move otherwise."""

import math

import pytest

from h2nav.attitude.samples import VelocityFix
from h2nav.integrity.receiver_track import ReceiverTrack, way_to

PERIOD_US = 200_000
DEG_PER_M = 1.0 / math.radians(6_371_000.0)


class Receiver:
    """Fixes of a vehicle by its velocity and its place, north in metres."""

    def __init__(self) -> None:
        self.track, self.t_us = ReceiverTrack(), 0

    def take(self, north_m_s, north_m=0.0, *, apart_us=PERIOD_US, east_m_s=0.0) -> bool:
        self.t_us += apart_us
        fix = VelocityFix(self.t_us, (north_m_s, east_m_s, math.nan), 0.2)
        return self.track.take(fix, 60.0 + north_m * DEG_PER_M, 8.0)

    def fly(self, velocity, place, seconds=4.0, *, period_s=0.2):
        """Flies by functions of time; by how much the places deny the velocities now, m."""
        for i in range(round(seconds / period_s) + 1):
            t_s = i * period_s
            self.take(velocity(t_s) + 1e-4 * (i % 2), place(t_s), apart_us=round(1e6 * period_s))
        return self.track.denied_m


@pytest.mark.parametrize(
    ("north_m_s", "north_m", "is_new"),
    [
        (0.51, 0.0, False),
        (0.51, 0.2, True),  # the place goes on
        (0.49, 0.0, True),
        (0.0, 0.0, True),  # receivers hold a vehicle that stands
    ],
)
def test_a_fix_of_a_moving_vehicle_that_repeats_measures_nothing(
    north_m_s, north_m, is_new
) -> None:
    receiver = Receiver()
    assert receiver.take(north_m_s)
    assert receiver.take(north_m_s, north_m) is is_new
    assert receiver.track.is_stuck is not is_new
    assert receiver.take(north_m_s, 9.0)
    assert not receiver.track.is_stuck


def test_a_fix_that_is_sent_again_measures_nothing_and_is_not_held() -> None:
    receiver = Receiver()
    for _ in range(10):
        assert receiver.take(1.0)
        for _ in range(3):
            assert not receiver.take(1.0, apart_us=0)
        assert receiver.take(1.01)
    assert receiver.track.held is None


@pytest.mark.parametrize(
    ("repeats", "apart_us", "is_held"),
    [
        (10, 200_000, True),
        (9, 200_000, False),  # 1.8 s
        (4, 1_000_000, True),
        (3, 1_000_000, False),  # 4 fixes
    ],
)
def test_it_is_held_from_2_s_and_5_fixes_on(repeats, apart_us, is_held) -> None:
    receiver = Receiver()
    receiver.take(2.0, apart_us=1_000_000)
    for _ in range(repeats):
        receiver.take(2.0, apart_us=apart_us)
    found = receiver.track.held
    assert found == ((1_000_000, repeats + 1) if is_held else None)
    receiver.take(2.01)
    assert receiver.track.held is None


@pytest.mark.parametrize("after_us", [0, 400_000])
def test_its_age_is_that_of_the_latest_fix_repeated_or_not(after_us) -> None:
    receiver = Receiver()
    receiver.take(2.0)
    if after_us:
        receiver.take(2.0, apart_us=after_us)
    assert receiver.track.is_older_than(receiver.t_us)
    assert not receiver.track.is_older_than(receiver.t_us - 1)


def test_nothing_is_older_where_nothing_came() -> None:
    assert not ReceiverTrack().is_older_than(10**9)


def test_places_that_follow_deny_nothing_whatever_the_manoeuvre() -> None:
    def velocity(t_s):
        return 10.0 * math.sin(t_s)

    assert Receiver().fly(velocity, lambda t_s: 10.0 * (1.0 - math.cos(t_s)), 9.0) == 0.0
    # filtered by 0.3 s
    assert Receiver().fly(velocity, lambda t_s: 10.0 * (1.0 - math.cos(t_s - 0.3)), 9.0) == 0.0


def test_a_velocity_that_is_held_in_a_turn_is_denied() -> None:
    assert Receiver().fly(lambda t_s: 4.0, lambda t_s: 4.0 * t_s - 1.5 * t_s * t_s, 3.0) == (
        pytest.approx(13.5, abs=0.1)
    )


@pytest.mark.parametrize("period_s", [0.2, 1.0])
def test_one_jump_of_the_place_denies_nothing(period_s) -> None:
    def jumped(t_s):
        return 2.0 * t_s + (80.0 if t_s > 2.5 else 0.0)

    assert Receiver().fly(lambda t_s: 2.0, jumped, period_s=period_s) == 0.0


def test_a_velocity_off_by_5_m_s_is_denied_at_1_hz() -> None:
    assert Receiver().fly(lambda t_s: 7.0, lambda t_s: 2.0 * t_s, period_s=1.0) > 10.0


def test_places_that_are_held_or_unknown_deny_nothing() -> None:
    assert Receiver().fly(lambda t_s: 20.0, lambda t_s: 0.0) == 0.0


def test_a_silence_begins_anew() -> None:
    receiver = Receiver()
    receiver.take(5.0, 0.0)
    receiver.take(5.1, 100.0, apart_us=2_500_000)
    assert len(receiver.track.fixes) == 1
    assert receiver.track.compared() == (0.0, 0.0)


def test_fixes_are_kept_for_5_s_with_their_ways() -> None:
    receiver = Receiver()
    receiver.fly(lambda t_s: 3.0, lambda t_s: 4.0 * t_s, 8.0)
    assert len(receiver.track.fixes) == 26
    way_m, differs_m = receiver.track.compared()
    assert (way_m, differs_m) == (pytest.approx(15.0, abs=0.01), pytest.approx(5.0, abs=0.01))


def test_a_flood_of_fixes_is_not_kept() -> None:
    receiver = Receiver()
    for i in range(1000):
        receiver.take(1.0 + 1e-4 * i, apart_us=1)
    assert len(receiver.track.fixes) == 250


def test_the_way_between_places_goes_over_the_date_line() -> None:
    receiver = Receiver()
    receiver.take(1.0)
    (first,) = receiver.track.fixes
    first = first._replace(latitude_deg=0.0, longitude_deg=179.9999)
    north_m, east_m = way_to(first, 0.0, -179.9999)
    assert north_m == 0.0
    assert east_m == pytest.approx(0.0002 / DEG_PER_M, rel=1e-6)

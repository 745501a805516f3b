"""Which ground stations have just come."""

from h2nav.maths.units import SECOND_NS
from h2nav.service.ground_stations import AWAY_NS, MAX_STATIONS, GroundStations


def test_a_station_is_new_once_and_again_when_it_was_away():
    stations = GroundStations()
    assert stations.is_newcomer(0, (255, 190))
    assert not any(stations.is_newcomer(k * SECOND_NS, (255, 190)) for k in range(1, 100))
    assert stations.is_newcomer(100 * SECOND_NS + AWAY_NS, (255, 190))


def test_ids_that_somebody_invents_cost_little():
    stations = GroundStations()
    new = [
        stations.is_newcomer(k * SECOND_NS // 100, (k % 256, k // 256 % 256)) for k in range(10_000)
    ]
    assert sum(new) <= 2 + 100 * 0.1 + 1
    assert len(stations._heard_ns) <= MAX_STATIONS


def test_a_station_that_stays_is_not_forgotten_among_invented_ones():
    stations = GroundStations()
    assert stations.is_newcomer(0, (255, 190))
    for second in range(1, 3 * MAX_STATIONS):
        stations.is_newcomer(second * SECOND_NS, (1 + second // 256, second % 256))
        assert not stations.is_newcomer(second * SECOND_NS, (255, 190))


def test_who_was_away_for_more_than_half_a_minute_has_missed_something():
    stations = GroundStations()
    assert AWAY_NS == 30 * SECOND_NS
    assert stations.is_newcomer(0, (255, 190))
    assert not stations.is_newcomer(AWAY_NS, (255, 190))
    assert stations.is_newcomer(2 * AWAY_NS + 1, (255, 190))


def test_two_newcomers_at_once_and_one_in_ten_seconds():
    stations = GroundStations()
    assert [stations.is_newcomer(0, (number, 190)) for number in (1, 2, 3)] == [True, True, False]
    assert not stations.is_newcomer(10 * SECOND_NS - 1, (4, 190))
    assert stations.is_newcomer(10 * SECOND_NS, (5, 190))


def test_the_eight_that_were_heard_last_are_remembered():
    stations = GroundStations()
    for number in range(8):
        stations.is_newcomer(0, (1, number))
    later_ns = 20 * SECOND_NS
    assert not stations.is_newcomer(later_ns, (1, 0))
    assert stations.is_newcomer(later_ns, (1, 8))  # in place of the second
    assert not stations.is_newcomer(later_ns, (1, 2))
    assert stations.is_newcomer(later_ns, (1, 1))

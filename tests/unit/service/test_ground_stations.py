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

"""One short flight of a campaign: what is kept of its estimates, and when its fault is told."""

import numpy as np
import pytest

from h2nav.apps import campaign_flights
from h2nav.errors import BadInput
from h2nav.evaluation.campaign.draw import Draw, FlightDraw, ImuDraw

FROZEN_S, LENGTH_S = 8.0, 12.0
DRAW = Draw(
    3,
    flight=FlightDraw(length_min=LENGTH_S / 60.0, rest_s=5.0),
    imu=ImuDraw(rate_hz=50.0),
    faults=(f"gyro-frozen@{FROZEN_S:g}+4",),
)


@pytest.fixture(scope="module")
def heard():
    scored = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(campaign_flights, "score", lambda *both: scored.append(both) or {"a": 1})
        assert campaign_flights.fly(DRAW) == {"a": 1}
    ((flight, found),) = scored
    assert flight.draw == DRAW
    return found


def test_ten_estimates_a_second_are_kept_with_their_deviations_in_degrees(heard):
    t_us = np.array(heard.t_us)
    assert np.diff(t_us) == pytest.approx(100_000, abs=45_000)
    assert np.median(np.diff(t_us)) == pytest.approx(100_000, abs=500)
    rows = np.array(heard.rows).reshape(len(t_us), 6)
    assert np.linalg.norm(rows[:, :4], axis=1) == pytest.approx(1.0, abs=1e-6)
    assert 0.3 < rows[-1, 4] < 10.0
    assert rows[-1, 4] < rows[-1, 5] < 60.0


def test_the_fault_is_told_in_seconds_from_the_start(heard):
    (told_s,) = (at_s for name, at_s in heard.told_s.items() if name.startswith("gyro_frozen"))
    assert FROZEN_S < told_s < LENGTH_S
    assert [finding.id for finding in heard.findings] == list(heard.told_s)
    assert heard.handler_errors == 0
    assert heard.cpu_s > 0.0


def test_where_there_is_no_declination_nothing_is_flown(monkeypatch):
    monkeypatch.setattr(campaign_flights, "earth_field_at", lambda *place: None)
    with pytest.raises(BadInput) as caught:
        campaign_flights.fly(DRAW)
    assert str(caught.value) == "flight.latitude_deg: 47: no declination there"

"""A gyro's scale by the field alone, whatever attitude is made of it."""

import numpy as np
import pytest
from reviewed_flights import body_field, flight, with_imu

from h2nav.integrity.findings import Finding
from h2nav.maths.rows import select_rows
from h2nav.reviews.analysis import analyse
from h2nav.reviews.flight import Flight
from h2nav.reviews.gyro_scale import detect_gyro_scale


def told(flown: Flight) -> list[Finding]:
    (track,) = flown.context.imus
    return detect_gyro_scale(track, flown.context.armed)


def scaled(flown: Flight, factor: float, magnet_ut: tuple[float, float, float]) -> Flight:
    (track,) = flown.context.imus
    return with_imu(flown, w_b=factor * track.w_b, m_b_ut=track.m_b_ut + np.array(magnet_ut))


@pytest.mark.parametrize("magnet_ut", [(0.0, 0.0, 0.0), (8.0, -5.0, 10.0)])
@pytest.mark.parametrize("factor", [1.06, 0.92])
def test_a_scale_beyond_the_data_sheet_is_told_beside_a_magnet_too(factor, magnet_ut):
    (finding,) = told(scaled(flight("aggressive"), factor, magnet_ut))
    assert finding.kind == "gyro_scale"
    assert finding.size == pytest.approx(100.0 * abs(factor - 1.0), abs=2.0)
    assert ("much" if factor > 1.0 else "little") in finding.text


@pytest.mark.parametrize("name", ["flight", "aggressive", "hover"])
def test_a_scale_within_the_data_sheet_is_not_told(name):
    assert told(scaled(flight(name), 1.01, (8.0, -5.0, 10.0))) == []


def test_seldom_samples_show_no_turn_between_them():
    flown = with_imu(flight("spin"), m_b_ut=body_field("spin"))
    (track,) = flown.context.imus
    seldom = select_rows(track, slice(None, None, 20))
    assert told(flown._replace(context=flown.context._replace(imus=(seldom,)))) == []


def test_a_magnet_that_comes_in_flight_is_no_scale():
    flown = flight("aggressive")
    (track,) = flown.context.imus
    m_b_ut = track.m_b_ut.copy()
    m_b_ut[track.t_s > 50.0] += np.array([15.0, 10.0, 0.0])
    assert told(with_imu(flown, m_b_ut=m_b_ut)) == []


def test_a_flight_without_a_compass_shows_no_scale():
    flown = flight("aggressive")
    (track,) = flown.context.imus
    blind = with_imu(flown, w_b=1.1 * track.w_b, m_b_ut=np.full_like(track.m_b_ut, np.nan))
    assert "gyro_scale" not in {finding.kind for finding in analyse(blind).findings}

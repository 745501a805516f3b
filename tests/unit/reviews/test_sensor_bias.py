"""Biases of known size, against data sheets and against other IMUs."""

import numpy as np
import pytest
from known_evidence import imu_track
from reviewed_flights import flight, with_imu

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.rows import product
from h2nav.maths.units import DEG
from h2nav.recordings.context import ImuTrack
from h2nav.reviews.analysis import analyse
from h2nav.reviews.inertial import exponential
from h2nav.reviews.sensor_bias import _apart, detect_biases

BIAS_DEG_S = np.array([0.1, -0.1, 0.05])


@pytest.mark.parametrize("name", ["flight", "aggressive", "hover"])
def test_the_bias_is_that_of_the_gyro(name):
    bias = analyse(flight(name)).biases[0]
    mean = np.nanmedian(bias.gyro_b, axis=0) / DEG
    np.testing.assert_allclose(mean, BIAS_DEG_S, atol=0.05)


def test_a_bias_beyond_the_data_sheet_is_told():
    flown = flight()
    more = np.array([0.0, 4.0, 0.0])
    w_b = flown.context.imus[0].w_b + more * DEG
    (finding,) = analyse(with_imu(flown, w_b=w_b)).findings
    assert finding.kind == "gyro_bias"
    assert finding.size == pytest.approx(np.linalg.norm(BIAS_DEG_S + more), abs=0.1)


@pytest.mark.parametrize("step_deg_s", [1.2, -1.8])
def test_a_step_of_the_bias_has_its_time_and_size(step_deg_s):
    flown = flight()
    first = flown.context.imus[0]
    w_b = first.w_b.copy()
    w_b[first.t_s > 64.0, 0] += step_deg_s * DEG
    (finding,) = analyse(with_imu(flown, w_b=w_b)).findings
    assert finding.kind == "gyro_bias_step"
    assert finding.size == pytest.approx(abs(step_deg_s), abs=0.15)
    assert finding.from_s - 10.0 < 64.0 < finding.to_s + 10.0


@pytest.mark.parametrize("axis", [0, 2])
def test_a_step_on_the_ground_is_told_though_the_attitude_follows_the_gyro(axis):
    flown = flight("rest")
    first = flown.context.imus[0]
    w_b = first.w_b.copy()
    w_b[first.t_s > 64.0, axis] += 1.2 * DEG
    # An attitude that turns with the gyro, as that of a filter that believes it.
    turned = np.zeros((len(first.t_s), 3))
    turned[:, axis] = 1.2 * DEG * np.maximum(first.t_s - 64.0, 0.0)
    biased = flown.estimates._replace(q_nb=product(flown.estimates.q_nb, exponential(turned)))
    found = analyse(with_imu(flown._replace(estimates=biased), w_b=w_b)).findings
    (finding,) = [f for f in found if f.kind == "gyro_bias_step"]
    assert finding.size == pytest.approx(1.2, abs=0.15)
    assert finding.from_s - 10.0 < 64.0 < finding.to_s + 10.0


def test_a_compass_that_stands_still_by_itself_shows_no_bias():
    flown = flight("aggressive")
    first = flown.context.imus[0]
    frozen = Finding(
        Kind.COMPASS_FROZEN,
        Sensor(SensorKind.IMU, 1),
        Severity.WARNING,
        30.0,
        60.0,
        0.0,
        "",
        "frozen",
        "",
    )
    still = with_imu(flown, m_b_ut=np.tile(first.m_b_ut[0], (len(first.t_s), 1)))
    bias = analyse(still._replace(findings=(frozen,))).biases[0]
    np.testing.assert_allclose(np.nanmedian(bias.gyro_b, axis=0) / DEG, BIAS_DEG_S, atol=0.05)


def test_of_three_imus_the_odd_one_is_named():
    flown = flight(imus=3)
    tracks = list(flown.context.imus)
    tracks[1] = tracks[1]._replace(
        w_b=tracks[1].w_b + 3.0 * DEG * np.array([0.0, 0.0, 1.0]),
        f_b=tracks[1].f_b + np.array([1.2, 0.0, 0.0]),
    )
    flown = flown._replace(context=flown.context._replace(imus=tuple(tracks)))
    found = {f.kind: f for f in analyse(flown).findings}
    assert found["gyro_apart"].source == "IMU 2"
    assert found["gyro_apart"].size == pytest.approx(3.0, abs=0.2)
    assert found["accelerometer_apart"].source == "IMU 2"
    assert found["accelerometer_apart"].size == pytest.approx(1.2, abs=0.1)


def test_of_two_imus_the_one_with_a_bias_is_named():
    flown = flight(imus=2)
    one, other = flown.context.imus
    more = 3.0 * DEG * np.array([0.0, 0.0, 1.0])
    one = one._replace(w_b=one.w_b + more, f_b=one.f_b + np.array([1.2, 0.0, 0.0]))
    flown = flown._replace(context=flown.context._replace(imus=(one, other)))
    found = {f.kind: f for f in analyse(flown).findings}
    assert found["gyro_apart"].source == "IMU 1"
    assert "differs from IMU 2" in found["gyro_apart"].text
    assert found["accelerometer_apart"].source == "IMU 1 or IMU 2"
    assert "not known" in found["accelerometer_apart"].evidence


@pytest.mark.parametrize("began_s", [50.0, 52.0, 53.5])
def test_two_gyros_that_disagree_from_some_time_on_do_so_from_then(began_s):
    """To a second, in means of five: a cause begins no later than what it brings about."""
    still = np.arange(0.0, 120.0, 0.01)
    begins = still >= began_s
    tracks = []
    for imu, off in enumerate((30.0 * DEG, 0.0)):
        w_b = np.outer(begins * off, (0.0, 0.0, 1.0))
        tracks.append(imu_track(still, w_b)._replace(imu=imu))
    (found,) = _apart(tuple(tracks), ())
    assert found.kind is Kind.GYRO_APART
    assert found.from_s == pytest.approx(began_s, abs=0.1)
    assert found.size == pytest.approx(30.0)


def test_a_sensor_that_is_known_to_be_frozen_has_no_bias():
    flown = flight(imus=2)
    first = flown.context.imus[0]
    is_frozen = (first.t_s > 40.0) & (first.t_s < 80.0)
    w_b = np.where(is_frozen[:, None], 1.0, first.w_b)
    told = Finding(
        Kind.GYRO_FROZEN, Sensor(SensorKind.IMU, 1), Severity.ERROR, 40.0, 80.0, 40.0, "s", "", ""
    )
    flown = with_imu(flown, w_b=w_b)._replace(findings=(told,))
    assert not [f for f in analyse(flown).findings if "gyro" in f.kind]


def test_an_accelerometer_that_does_not_show_gravity_at_rest_is_told():
    flown = flight("rest", armed=(), gps=())
    f_b = 1.12 * flown.context.imus[0].f_b
    (finding,) = analyse(with_imu(flown, f_b=f_b)).findings
    assert finding.kind == "accelerometer_scale"
    assert finding.size == pytest.approx(120.0, abs=10.0)
    assert not analyse(flight("rest", armed=())).findings


def test_what_shakes_on_the_ground_is_not_at_rest():
    track = flight("rest").context.imus[0]
    off = track._replace(f_b=1.12 * track.f_b)
    assert [one.kind for one in detect_biases((off,), None, (), ())[1]] == ["accelerometer_bias"]
    shaken = off._replace(f_b=off.f_b + np.sin(9.0 * off.t_s)[:, None])
    assert not detect_biases((shaken,), None, (), ())[1]


def slow_stream(seed, turned_deg_s, extra_deg_s):
    """Two IMUs that turn to and fro, of which some samples a second come, of other moments."""
    random, tracks = np.random.default_rng(seed), []
    for imu in range(2):
        t_s = np.sort(random.uniform(0.0, 100.0, 1200))
        along = turned_deg_s * np.sign(np.sin(0.6 * t_s)) + imu * extra_deg_s
        w_b = DEG * along[:, None] * np.array([0.0, 0.0, 1.0])
        f_b = np.tile([0.0, 0.0, -9.8], (len(t_s), 1))
        stamp_us = np.round(1e6 * t_s).astype(np.int64)
        tracks.append(ImuTrack(imu, "RAW_IMU", t_s, stamp_us, w_b, f_b, np.full_like(f_b, np.nan)))
    return {one.kind for one in _apart(tuple(tracks), ())}


def test_slow_samples_of_a_moving_vehicle_differ_by_chance():
    assert not any(slow_stream(seed, 60.0, 0.0) for seed in range(20))
    assert slow_stream(1, 0.0, 3.0) == {Kind.GYRO_APART}

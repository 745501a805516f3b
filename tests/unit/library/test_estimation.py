"""The library's estimates are those of the filter behind every command."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from needs import shared_data

import h2nav
from h2nav import AttitudeFilter, BadInput, Velocity, estimate, smooth
from h2nav.attitude.samples import ImuSample, VelocityFix
from h2nav.evaluation.dataset.filters import (
    Conditions,
    run_velocity_aided,
    smooth_velocity_aided,
)
from h2nav.maths.units import DEG
from h2nav.recordings.trials import Trial, read_trial

RATE_HZ = 100.0


def rocking(count: int = 3000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A body that turns to and fro about its x axis, in a field of 48 uT that dips by 65 deg."""
    t_s = np.arange(count) / RATE_HZ
    roll = 0.4 * np.sin(t_s)
    gyr = np.zeros((count, 3))
    gyr[:, 0] = np.gradient(roll, 1.0 / RATE_HZ)
    acc = -9.80665 * np.stack((np.zeros(count), np.sin(roll), np.cos(roll)), axis=1)
    north, down = 20.3, 43.5
    mag = np.stack((np.full(count, north), down * np.sin(roll), down * np.cos(roll)), axis=1)
    return gyr, acc, mag


def trial() -> Trial:
    return read_trial(Path(shared_data("imu/broad__02_undisturbed_slow_rotation_B.npz")))


def same_turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.minimum(np.abs(a - b).max(axis=1), np.abs(a + b).max(axis=1))


def test_a_recording_gets_the_very_attitudes_of_evaluate_dataset() -> None:
    data = trial()
    found = estimate(data.w_s, data.f_s, data.m_s, t_s=data.t_us * 1e-6, frame="enu")
    expected = run_velocity_aided(data, Conditions("handheld"))
    known = np.isfinite(found.q[:, 0])
    assert known[20:].all()
    assert same_turn(found.q[known], expected.q_es[known]).max() == 0.0
    assert np.isfinite(found.sigma_tilt_rad[known]).all()
    assert np.isfinite(found.sigma_heading_rad[known]).all()


def test_the_smoother_is_that_of_evaluate_dataset() -> None:
    data = trial()
    part = slice(0, 8000)
    short = data._replace(
        t_us=data.t_us[part], w_s=data.w_s[part], f_s=data.f_s[part], m_s=data.m_s[part]
    )
    found = smooth(short.w_s, short.f_s, short.m_s, t_s=short.t_us * 1e-6, frame="enu")
    expected = smooth_velocity_aided(short, Conditions("handheld"))
    assert same_turn(found.q, expected.q_es).max() == 0.0


def test_samples_one_by_one_in_parts_and_as_a_whole_are_the_same() -> None:
    gyr, acc, mag = rocking(1000)
    whole = AttitudeFilter(RATE_HZ).batch(gyr, acc, mag)
    parts = AttitudeFilter(RATE_HZ)
    first, second = (parts.batch(gyr[k], acc[k], mag[k]) for k in (slice(600), slice(600, None)))
    single = AttitudeFilter(RATE_HZ)
    estimates = [single.update(*row) for row in zip(gyr, acc, mag, strict=True)]
    rows = np.array([np.full(4, np.nan) if e is None else e.q_nb for e in estimates])
    np.testing.assert_array_equal(np.concatenate((first.q, second.q)), whole.q)
    np.testing.assert_array_equal(rows, whole.q)


def test_the_frames_are_the_same_attitude() -> None:
    gyr, acc, mag = rocking()
    ned, enu = estimate(gyr, acc, mag, rate_hz=RATE_HZ), AttitudeFilter(RATE_HZ, frame="enu")
    q_enu = enu.batch(gyr, acc, mag).q
    # Body x points north at the start: to the east-north-up frame's y.
    w, x, y, z = q_enu[-1]
    assert (1 - 2 * (y * y + z * z), 2 * (x * y + w * z)) == pytest.approx((0.0, 1.0), abs=0.01)
    w, x, y, z = ned.q[-1]
    assert 1 - 2 * (y * y + z * z) == pytest.approx(1.0, abs=0.01)


def test_the_attitude_is_the_true_one_and_the_deviations_cover_it() -> None:
    gyr, acc, mag = rocking()
    found = estimate(gyr, acc, mag, rate_hz=RATE_HZ)
    roll = 2.0 * np.arctan2(found.q[:, 1], found.q[:, 0])
    error = np.abs(roll - 0.4 * np.sin(np.arange(len(roll)) / RATE_HZ))[500:]
    assert error.max() < 1.0 * DEG
    assert (error < 3.0 * found.sigma_tilt_rad[500:]).mean() > 0.98
    assert not found.is_disturbed[500:].any()
    assert not found.is_at_rest[500:].any()


def test_a_body_at_rest_shows_its_gyro_bias() -> None:
    bias = np.array([0.01, -0.02, 0.005])
    found = estimate(np.tile(bias, (3000, 1)), np.tile([0, 0, 9.81], (3000, 1)), rate_hz=RATE_HZ)
    assert found.is_at_rest[-1]
    np.testing.assert_allclose(found.gyro_bias_rad_s[-1], bias, atol=0.02 * DEG)


def test_a_row_that_is_not_finite_is_no_sample_and_nothing_becomes_nan() -> None:
    gyr, acc, mag = rocking()
    gyr[700], acc[900], mag[::3] = np.nan, np.inf, np.nan
    found = estimate(gyr, acc, mag, rate_hz=RATE_HZ)
    known = np.isfinite(found.q[:, 0])
    first = int(np.argmax(known))
    assert first < 10
    for column in found[:4]:
        assert np.isfinite(column[first:]).all()
    np.testing.assert_array_equal(found.q[700], found.q[699])


def test_a_disturbed_field_is_flagged() -> None:
    gyr, acc, mag = rocking()
    mag[1500:2000] += [60.0, 0.0, 0.0]
    found = estimate(gyr, acc, mag, rate_hz=RATE_HZ)
    assert found.is_disturbed[1500:2000].mean() > 0.9
    assert not found.is_disturbed[500:1500].any()


@pytest.mark.parametrize("frame", ["ned", "enu"])
def test_velocities_are_those_that_the_filter_takes_one_by_one(frame: str) -> None:
    gyr, acc, mag = rocking(2000)
    t_s = 5.0 + np.arange(2000) / RATE_HZ
    v_m_s = np.tile([1.0, 2.0, np.nan], (19, 1))
    times_s = 5.5 + np.arange(19.0)
    chosen = AttitudeFilter(RATE_HZ, "multirotor", frame)
    found = chosen.batch(gyr, acc, mag, t_s=t_s, velocity=Velocity(times_s, v_m_s, 0.2))
    by_hand = AttitudeFilter(RATE_HZ, "multirotor", frame)
    single = AttitudeFilter(RATE_HZ, "multirotor", frame)
    rows, single_rows = [], []
    for i in range(2000):
        if i % 100 == 50 and i // 100 < 19:
            v_n = (1.0, 2.0, np.nan) if frame == "ned" else (2.0, 1.0, np.nan)
            by_hand._filter.use_velocity(VelocityFix(i * 10_000, v_n, 0.2))
        sample = ImuSample(i * 10_000, tuple(gyr[i]), tuple(acc[i]), tuple(mag[i]))
        estimate_ = by_hand._filter.update(sample)
        rows.append(np.full(3, np.nan) if estimate_ is None else estimate_.bias_b)
        estimate_ = single.update(gyr[i], acc[i], mag[i])
        single_rows.append(np.full(3, np.nan) if estimate_ is None else estimate_.bias_b)
        if i % 100 == 49 and i // 100 < 19:
            single.use_velocity((1.0, 2.0, np.nan), 0.2)
    np.testing.assert_array_equal(found.gyro_bias_rad_s, np.array(rows))
    # It is valid at the sample that has been, not at the next one.
    np.testing.assert_allclose(np.array(single_rows), np.array(rows), atol=2e-5)


def test_wrong_arguments_name_what_is_known() -> None:
    gyr, acc, _ = rocking(10)
    with pytest.raises(BadInput, match="expected one of handheld, multirotor"):
        estimate(gyr, acc, rate_hz=RATE_HZ, vehicle="submarine")
    with pytest.raises(BadInput, match="ned or enu"):
        estimate(gyr, acc, rate_hz=RATE_HZ, frame="flu")  # type: ignore[arg-type]
    with pytest.raises(BadInput, match="rate_hz: missing"):
        estimate(gyr, acc)
    with pytest.raises(BadInput, match="rate_hz: expected 5 to 2000 Hz"):
        AttitudeFilter(0.0)
    with pytest.raises(ValueError, match="shape"):
        estimate(gyr, acc[:5], rate_hz=RATE_HZ)


@pytest.mark.parametrize(
    "t_s",
    [[0.0, 0.0, 0.0], [0.2, 0.1, 0.0], [0.0, np.nan, 1.0], [0.0, 1.0, np.inf], [[0.0]] * 3],
)
@pytest.mark.parametrize("call", [estimate, smooth])
def test_times_that_do_not_increase_give_no_rate(
    call: Callable[..., object], t_s: list[object]
) -> None:
    with pytest.raises(ValueError, match="times that increase"):
        call(np.zeros((3, 3)), np.ones((3, 3)), t_s=t_s)


def test_importing_the_package_loads_no_numpy() -> None:
    code = "import h2nav, sys; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
    assert set(h2nav.__all__) <= set(dir(h2nav)) | set(h2nav._PLACES)


def test_an_array_without_samples_changes_no_clock():
    """Whatever the epoch of the times that follow."""
    gyr, acc, mag = (column[:40] for column in rocking(40))

    def flown(empty: int) -> np.ndarray:
        chosen = AttitudeFilter(rate_hz=RATE_HZ)
        chosen.batch(gyr, acc, mag)
        for _ in range(empty):
            chosen.batch(gyr[:0], acc[:0], mag[:0], t_s=[])
        return chosen.batch(gyr, acc, mag, t_s=1.7e9 + np.arange(40) / RATE_HZ).q

    assert np.array_equal(flown(1), flown(0))

"""Vibration that is strong throughout, or grows: tables of just enough and just too little."""

import numpy as np
import pytest

from h2nav.integrity.findings import Kind, Severity
from h2nav.recordings.context import Context, ImuTrack, Motors, Span, VibrationTrack
from h2nav.reviews.impacts import BIN_S, Bins, Impact
from h2nav.reviews.shaking import detect_shaking, deviations

RATE_HZ = 50
SECONDS = 60
T_S = np.arange(RATE_HZ * SECONDS) / RATE_HZ
BIN_TIMES_S = np.arange(0.0, SECONDS, BIN_S)
BLOW = Impact(
    t_s=30.0, to_s=30.0, peak_g=9.0, peak_rad_s=1.0, tilt_rad=0.0, turned_rad=0.0, turned_s=30.0,
    is_crash=False,
)  # fmt: skip


def track(level, axis=None):
    """A force whose neighbouring samples deviate by a level, (SECONDS,) m/s^2, over all axes.

    Its parts are Gaussian and of the same rms in each second, or of one axis.
    """
    random = np.random.default_rng(1)
    steps = random.normal(size=(SECONDS, RATE_HZ, 3))
    if axis is not None:
        steps[:, :, [one for one in range(3) if one != axis]] = 0.0
    steps /= np.sqrt((steps**2).sum(axis=2).mean(axis=1))[:, None, None]
    steps *= np.sqrt(2.0) * np.broadcast_to(level, SECONDS)[:, None, None]
    f_b = np.cumsum(steps.reshape(-1, 3), axis=0) + np.array([0.0, 0.0, -9.81])
    zeros = np.zeros_like(f_b)
    return ImuTrack(1, "RAW_IMU", T_S, (1e6 * T_S).astype(np.int64), zeros, f_b, zeros)


def shaking(level, axis=None, impacts=(), armed_s=SECONDS, **changes):
    random = np.random.default_rng(2)
    shape = (len(BIN_TIMES_S), 3)
    ones = np.ones(len(BIN_TIMES_S))
    made = Bins(
        BIN_TIMES_S, np.zeros(shape), random.normal(0.0, 0.05, shape), ones, ones, 0.5 * ones
    )
    pwm_us = np.full((len(BIN_TIMES_S), 4), 1500.0)
    context = Context(
        motors=Motors((1, 2, 3, 4), BIN_TIMES_S, pwm_us, 1000.0, 2000.0),
        armed=(Span(0.0, armed_s, ""),),
    )._replace(**changes)
    found = detect_shaking(track(level, axis), made, context, impacts)
    assert len(found) <= 1
    for one in found:
        assert (one.kind, one.severity) == (Kind.VIBRATION, Severity.WARNING)
        assert one.sensor.number == 2
    return found[0] if found else None


def grows(before, after, lasts=30, at=30):
    level = np.full(SECONDS, before)
    level[at : at + lasts] = after
    return level


def test_levels_are_rms_of_all_axes_of_each_and_of_most_samples():
    for axis in range(3):
        t_s, sizes = deviations(track(2.0, axis))
        assert t_s == pytest.approx(0.5 + np.arange(SECONDS))
        assert sizes[1:, 0] == pytest.approx(2.0, rel=0.03)
        assert sizes[1:, 1 + axis] == pytest.approx(2.0, rel=0.03)
        assert np.delete(sizes, 1 + axis, axis=1)[1:, 1:3].max() < 1e-9
    typical = deviations(track(2.0))[1][1:, 4]
    assert np.median(typical) == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize(("level", "is_told"), [(4.9, False), (5.1, True)])
def test_strong_throughout(level, is_told):
    found = shaking(level)
    assert (found is not None) == is_told
    if found:
        assert found.text == "vibration of 5.1 m/s^2 in the whole flight"
        assert found.size == pytest.approx(5.1, rel=0.01)
        assert (found.from_s, found.to_s) == (pytest.approx(0.0, abs=1.0), pytest.approx(59.5))


@pytest.mark.parametrize(("armed_s", "is_told"), [(9.4, False), (12.4, True)])
def test_of_ten_seconds_at_least(armed_s, is_told):
    assert (shaking(6.0, armed_s=armed_s) is not None) == is_told


@pytest.mark.parametrize(
    ("before", "after", "lasts", "is_told"),
    [
        # a little, if it is three times as much, for five seconds
        (0.5, 1.6, 30, True),
        (0.5, 1.45, 30, False),
        (0.6, 1.7, 30, False),
        (0.6, 1.9, 30, True),
        (0.5, 1.6, 3, True),  # for more than half of them
        (0.5, 1.6, 2, False),
        # two and a half times, if it is strong
        (1.25, 3.2, 30, True),
        (1.1, 2.4, 3, False),
        # twice, for two seconds
        (1.4, 2.9, 2, True),
        (1.5, 2.9, 2, False),
        (1.2, 2.4, 2, False),
    ],
)
def test_it_grew(before, after, lasts, is_told):
    found = shaking(grows(before, after, lasts))
    assert (found is not None) == is_told
    if found:
        assert found.text.startswith("vibration ")
        assert found.text.endswith("m/s^2 at 30 s")
        if lasts > 2:
            assert f"grew from {before:.1f} to {after:.1f} m/s^2" in found.text
        assert found.from_s == pytest.approx(30.0)
        assert found.to_s == pytest.approx(30.0 + lasts)
        assert found.size == pytest.approx(after, rel=0.05)


def test_what_grows_along_one_axis_is_told_with_it():
    level = grows(0.5, 4.0)
    found = shaking(level, axis=2)
    assert "grew from 0.5 to 4.0 m/s^2 at 30 s" in found.text
    assert "8.0 times that of the flight until then; up to 4.0" in found.evidence


@pytest.mark.parametrize(("at", "is_told"), [(4, False), (12, True)])
def test_ten_seconds_before_are_needed(at, is_told):
    assert (shaking(grows(0.5, 2.0, 60 - at, at)) is not None) == is_told


@pytest.mark.parametrize(("at", "is_told"), [(22, True), (30, False)])
def test_around_a_blow_nothing_is_looked_at(at, is_told):
    """Three seconds to either side."""
    level = grows(0.5, 9.0, lasts=3, at=at)
    assert (shaking(level, impacts=(BLOW,)) is not None) == is_told


def test_what_the_autopilot_measured_is_beside_it():
    vibration = VibrationTrack(
        1, T_S[:3], np.array([[3.0, 4.0], [np.nan, 31.0], [1.0, 1.0]]), np.array([5.0, 9.0, 2.0])
    )
    told = shaking(6.0, vibrations=(vibration._replace(imu=0), vibration)).evidence
    assert told.endswith("; the autopilot measured up to 31 m/s^2; 4 samples clipped")
    calm = vibration._replace(clipped=np.zeros(3), level=np.full((3, 2), np.nan))
    assert shaking(6.0, vibrations=(calm,)).evidence.endswith("stays below 3")


def test_without_outputs_nothing_is_told():
    assert shaking(9.0, motors=None) is None

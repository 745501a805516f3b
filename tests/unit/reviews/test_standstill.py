"""What a vehicle at rest shows of its own sensors: tables of just enough and just too little."""

import numpy as np
import pytest

from h2nav.integrity.findings import Kind, Severity
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import Context, GpsTrack, ImuTrack
from h2nav.reviews.standstill import (
    NEVER,
    REST_WINDOW_S,
    Rest,
    bias_at_rest,
    detect_rest,
    force_error,
    rest_of,
)

DOWN = (0.0, 0.0, -GRAVITY_M_S2)
MG = 1e-3 * GRAVITY_M_S2


def rest(rate_deg_s=(0.0, 0.0, 0.0), f_b=DOWN, count=8):
    t_s = 10.0 + REST_WINDOW_S * np.arange(count)
    return Rest(t_s, np.tile(f_b, (count, 1)), np.tile(np.multiply(rate_deg_s, DEG), (count, 1)))


def found_in(windows, kind=None):
    found = detect_rest(windows, 1)
    assert all(one.sensor.number == 2 for one in found)
    return next((one for one in found if kind in (None, one.kind)), None)


def test_a_vehicle_that_circles_feels_more_than_gravity():
    stands, circles = rest(count=4), rest((0.0, 0.0, 55.0), (0.0, 5.8, -GRAVITY_M_S2), 3)
    both = Rest(*(np.concatenate(columns) for columns in zip(stands, circles, strict=True)))
    assert found_in(both) is None
    found = found_in(both._replace(f_b=1.2 * both.f_b), Kind.ACCELEROMETER_SCALE)
    assert found.size == pytest.approx(200.0)
    assert found.to_s == 10.0 + 4 * REST_WINDOW_S


@pytest.mark.parametrize(
    ("rate_deg_s", "count", "severity"),
    [
        # across gravity, that has not turned in all windows together by 15 deg
        ((1.9, 0.0, 0.0), 8, None),
        ((2.1, 0.0, 0.0), 8, Severity.WARNING),
        ((2.1, 0.0, 0.0), 2, None),
        ((2.1, 0.0, 0.0), 3, Severity.WARNING),
        ((4.9, 0.0, 0.0), 2, Severity.WARNING),
        ((0.0, 5.1, 0.0), 2, Severity.ERROR),
        ((9.0, 0.0, 0.0), 1, None),
        # about the vertical, for ten seconds
        ((0.0, 0.0, 3.0), 3, None),
        ((0.0, 0.0, 3.0), 4, Severity.WARNING),
        ((0.0, 0.0, 19.0), 8, Severity.ERROR),
        ((0.0, 0.0, 21.0), 8, None),  # a table
    ],
)
def test_a_rate_that_gravity_denies_is_a_bias(rate_deg_s, count, severity):
    found = found_in(rest(rate_deg_s, count=count))
    assert (found and found.severity) == severity
    if found:
        size = np.linalg.norm(rate_deg_s)
        assert (found.kind, found.unit, found.size) == (
            Kind.GYRO_BIAS, "deg/s", pytest.approx(size),
        )  # fmt: skip
        assert (found.from_s, found.to_s) == (10.0, 10.0 + REST_WINDOW_S * count)
        x, y, z = rate_deg_s
        assert found.evidence.startswith(
            f"({x:+.1f}, {y:+.1f}, {z:+.1f}) deg/s about x, y, z in {count} windows"
        )


@pytest.mark.parametrize(("apart_deg_s", "is_even"), [(0.28, True), (0.35, False)])
def test_a_turn_about_the_vertical_is_a_bias_where_it_is_even(apart_deg_s, is_even):
    windows = rest((0.0, 0.0, 3.0))
    windows.w_b[3, 2] += apart_deg_s * DEG
    assert (found_in(windows) is not None) == is_even


@pytest.mark.parametrize(("apart_deg_s", "count"), [(1.4, 8), (1.6, 7)])
def test_windows_that_differ_do_not_belong_together(apart_deg_s, count):
    windows = rest((6.0, 0.0, 0.0))
    windows.w_b[0, 0] += apart_deg_s * DEG
    found = found_in(windows)
    assert f"in {count} windows" in found.evidence
    assert found.from_s == (10.0 if count == 8 else 10.0 + REST_WINDOW_S)


@pytest.mark.parametrize(
    ("apart_mg", "kind"),
    [
        (79.0, None),
        (-79.0, None),
        (81.0, Kind.ACCELEROMETER_BIAS),
        (-81.0, Kind.ACCELEROMETER_BIAS),
        (99.0, Kind.ACCELEROMETER_BIAS),
        (101.0, Kind.ACCELEROMETER_SCALE),
        (-101.0, Kind.ACCELEROMETER_SCALE),
    ],
)
def test_a_force_that_is_not_gravity(apart_mg, kind):
    found = found_in(rest(f_b=(0.0, 0.0, -GRAVITY_M_S2 - apart_mg * MG)))
    assert (found and found.kind) == kind
    if found:
        is_scale = kind is Kind.ACCELEROMETER_SCALE
        assert found.severity is (Severity.ERROR if is_scale else Severity.WARNING)
        assert found.unit == ("mg" if is_scale else "m/s^2")
        assert found.size == pytest.approx(abs(apart_mg) * (1.0 if is_scale else MG))
        assert (found.from_s, found.to_s) == (10.0, 30.0)
        assert f"{abs(apart_mg):.0f} mg of bias, or {1e-3 * apart_mg:+.1%} of scale, over 20 s" in (
            found.evidence
        )


@pytest.mark.parametrize(("count", "is_told"), [(1, False), (2, True)])
def test_a_force_takes_two_windows(count, is_told):
    assert (found_in(rest(f_b=(0.0, 0.0, -11.0), count=count)) is not None) == is_told


@pytest.mark.parametrize(("other", "is_told"), [(8.5, True), (9.8, False)])
def test_of_windows_that_show_two_forces_none_shows_the_one_between(other, is_told):
    two = rest(f_b=(0.0, 0.0, -8.0), count=2)
    two.f_b[1] = (0.0, 0.0, -other)
    assert (found_in(two) is not None) == is_told


def test_what_it_shows_in_numbers():
    assert force_error(NEVER) == 0.0
    assert force_error(rest(f_b=(0.0, 6.0, -8.0))) == pytest.approx(10.0 - GRAVITY_M_S2)
    assert bias_at_rest(NEVER).tolist() == [0.0] * 3
    assert bias_at_rest(rest((1.9, 0.0, 0.0))).tolist() == [0.0] * 3
    assert bias_at_rest(rest((3.0, 0.0, 0.0), count=1)).tolist() == [0.0] * 3
    assert bias_at_rest(rest((3.0, 0.0, 0.0), count=2)) == pytest.approx([3.0 * DEG, 0.0, 0.0])


T_S = np.arange(0.0, 20.0, 0.02)


def recorded(w_b=(0.0, 0.0, 0.0), f_b=DOWN, gps=(), seconds=20.0):
    kept = T_S - seconds < 0.0
    w_b, f_b = (np.broadcast_to(each, (len(T_S), 3))[kept] for each in (w_b, f_b))
    t_s = T_S[kept]
    track = ImuTrack(0, "RAW_IMU", t_s, (1e6 * t_s).astype(np.int64), w_b, f_b, np.zeros_like(w_b))
    return rest_of(track, Context(gps=gps))


def shaken(size, axis):
    """Back and forth from sample to sample."""
    found = np.zeros((len(T_S), 3))
    found[:, axis] = size * (-1.0) ** np.arange(len(T_S))
    return found


def slowly(size):
    """Once up and once down in each window, so that its parts differ from its mean."""
    return np.outer(
        size * np.sign(np.sin(2.0 * np.pi * (T_S + 1e-6) / REST_WINDOW_S)), [1.0, 0.0, 0.0]
    )


def test_at_rest_there_is_window_after_window():
    found = recorded(w_b=(0.01, 0.02, 0.03))
    assert found.t_s == pytest.approx(REST_WINDOW_S * np.arange(7))
    np.testing.assert_allclose(found.w_b, np.tile([0.01, 0.02, 0.03], (7, 1)))
    np.testing.assert_allclose(found.f_b, np.tile(DOWN, (7, 1)))
    assert len(recorded(seconds=0.1).t_s) == len(recorded(seconds=2.4).t_s) == 0


@pytest.mark.parametrize(
    ("changes", "is_rest"),
    [
        ({"w_b": shaken(1.4 * DEG, 1)}, True),
        ({"w_b": shaken(1.6 * DEG, 1)}, False),
        ({"f_b": shaken(0.5, 0) + DOWN}, True),
        ({"f_b": shaken(0.7, 0) + DOWN}, False),
        ({"w_b": slowly(0.8 * DEG)}, True),
        ({"w_b": slowly(1.3 * DEG)}, False),
        ({"f_b": slowly(0.14) + DOWN}, True),
        ({"f_b": slowly(0.22) + DOWN}, False),
        ({"f_b": (0.0, 0.0, 0.0)}, False),  # it says nothing
    ],
)
def test_what_turns_or_shakes_is_not_at_rest(changes, is_rest):
    assert bool(len(recorded(**changes).t_s)) == is_rest


@pytest.mark.parametrize(
    ("speed_m_s", "has_fix", "moving_s"),
    [(0.9, True, []), (1.1, True, [2.5, 5.0]), (1.1, False, [])],
)
def test_where_a_receiver_moves_it_is_not_at_rest(speed_m_s, has_fix, moving_s):
    """One fix, 4.1 s after the beginning: windows from a second before to a second after."""
    unknown = np.zeros(1)
    gps = GpsTrack(
        0, np.array([4.1]), np.array([has_fix]),
        **{name: unknown for name in GpsTrack._fields[3:] if name != "v_n"},
        v_n=np.array([[0.0, speed_m_s, 0.0]]),
    )  # fmt: skip
    missing_s = np.setdiff1d(recorded().t_s, recorded(gps=(gps,)).t_s)
    assert missing_s.tolist() == pytest.approx(moving_s)

"""Drag and wind of simulated multirotors, and flights that show neither."""

import math

import numpy as np
import pytest

from h2nav.calibration.drag import DRAG_WINDOW_S, calibrate_drag, rows_of
from h2nav.calibration.drag_fit import DragRows, excited, fitted_drag
from h2nav.maths.air import SEA_LEVEL_KG_M3
from h2nav.maths.rows import from_euler
from h2nav.recordings.context import Context, GpsTrack, Span
from h2nav.reviews.flight import Estimates
from h2nav.reviews.inertial import conjugate, rotate
from tests.unit.calibration.logs import evidence_of_log, imu_track

BCOEF_X, BCOEF_Y, MCOEF = 40.0, 25.0, 0.25
WIND = np.array((4.0, -3.0, 0.0))
SECONDS, RATE_HZ = 420.0, 50.0
UNSET = {"EK3_DRAG_BCOEF_X": 0.0, "EK3_DRAG_BCOEF_Y": 0.0, "EK3_DRAG_MCOEF": 0.0}
PX4_UNSET = {"EKF2_BCOEF_X": 100.0, "EKF2_BCOEF_Y": 100.0, "EKF2_MCOEF": 0.15}


def steps(t_s, speeds=(0.0, 4.0, 8.0, 12.0), course_every_s=60.0):
    """Velocity over ground: steps of speed ahead, back and aside, in all directions."""
    number = (t_s // 5.0).astype(int)
    speed = np.array(speeds)[number % len(speeds)]
    course = (t_s // course_every_s) * 1.1 + np.where(number % 8 >= 4, math.pi, 0.0)
    sharp = np.stack((speed * np.cos(course), speed * np.sin(course)), axis=1)
    kernel = np.ones(75) / 75.0  # 1.5 s of acceleration
    smooth = [np.convolve(np.pad(axis, 37, "edge"), kernel, "valid") for axis in sharp.T]
    return np.column_stack((*smooth, np.zeros(len(t_s))))


def drag_force(v_b, whole_speed, density):
    speed = np.linalg.norm(v_b, axis=1, keepdims=True) if whole_speed else np.abs(v_b[:, :2])
    k = 1.0 / np.array((BCOEF_X, BCOEF_Y))
    thin = np.sqrt(density / SEA_LEVEL_KG_M3)
    return -(0.5 * density * k * speed + MCOEF * thin) * v_b[:, :2]


def flown(
    parameters=UNSET, kind="dataflash", gusts_m_s=0.6, heading=None, wind=WIND,
    sure_deg=(0.3, 1.2), **how,
):  # fmt: skip
    """A flight whose IMU leans by 1 deg, is off by 0.1 m/s^2, in gusty wind.

    Args:
        sure_deg: deviations of the attitude's tilt and heading.
    """
    t_s = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    rng = np.random.default_rng(3)
    v_n = steps(t_s, **how)
    yaw = t_s * 0.05 if heading is None else np.full(len(t_s), heading)
    tilt = 0.05 * np.sin(t_s)
    q_nb = from_euler(np.column_stack((tilt, -tilt, yaw)))
    gusts = rng.normal(0.0, gusts_m_s, (len(t_s) // 100 + 2, 3))
    gust = np.stack([np.interp(t_s, 2.0 * np.arange(len(gusts)), each) for each in gusts.T], axis=1)
    gust[:, 2] = 0.0
    v_b = rotate(conjugate(q_nb), v_n - wind - gust)
    lift = 9.8 + 0.5 * np.sin(0.7 * t_s)
    lean = np.array((math.radians(1.0), math.radians(-0.5)))
    across = drag_force(v_b, kind == "ulog", SEA_LEVEL_KG_M3) + lean * lift[:, None] + (0.1, -0.05)
    f_b = np.column_stack((across, -lift)) + rng.normal(0.0, 0.3, (len(t_s), 3))
    fix = slice(None, None, 10)
    count = len(t_s[fix])
    gps = GpsTrack(
        0,
        t_s[fix] + 0.15,
        np.ones(count, bool),
        np.full(count, 47.0),
        np.full(count, 8.0),
        np.zeros(count),
        v_n[fix] + rng.normal(0.0, 0.1, (count, 3)),
        np.full(count, 0.2),
        np.full(count, 12.0),
    )
    context = Context(
        vehicle_type=2,
        duration_s=SECONDS,
        imus=(imu_track(np.zeros((len(t_s), 3)), f_b, rate_hz=RATE_HZ),),
        gps=(gps,),
        armed=(Span(0.0, SECONDS, "armed"),),
    )
    sigmas = (np.full(len(t_s), math.radians(sure)) for sure in sure_deg)
    free = Estimates(t_s, q_nb, np.zeros((len(t_s), 3)), *sigmas)
    return evidence_of_log(context, parameters, kind=kind, free=free)


@pytest.mark.parametrize(
    ("parameters", "kind", "names"),
    [(UNSET, "dataflash", list(UNSET)), (PX4_UNSET, "ulog", list(PX4_UNSET))],
)
def test_steps_of_speed_show_drag_and_wind(parameters, kind, names):
    outcome = calibrate_drag([flown(parameters, kind)])
    changes = {change.name: change for change in outcome.changes}
    assert sorted(changes) == sorted(names), outcome.left
    for name, true in zip(names, (BCOEF_X, BCOEF_Y, MCOEF), strict=True):
        change = changes[name]
        assert change.new == pytest.approx(true, rel=0.15)
        assert abs(change.new - true) < 4.0 * change.sigma
    wind = outcome.wind_n_m_s
    assert np.abs(np.median(wind.values, axis=0) - WIND[:2]).max() < 0.4
    assert np.abs(wind.values - WIND[:2]).max() < 2.0


def test_a_hover_shows_no_drag():
    outcome = calibrate_drag([flown(speeds=(0.0, 0.5), wind=0.0 * WIND)])
    assert outcome.changes == ()
    assert "steps of speed" in outcome.left[0]


def test_forces_that_contradict_the_speeds_show_neither_drag_nor_wind():
    flight = flown()
    (track,) = flight.context.imus
    rng = np.random.default_rng(5)
    window = (track.t_s / DRAG_WINDOW_S).astype(int)
    f_b = track.f_b.copy()
    f_b[:, 0] += np.where(rng.random(window.max() + 1) < 0.4, 4.0, 0.0)[window]
    context = flight.context._replace(imus=(track._replace(f_b=f_b),))
    flight = flight._replace(flight=flight.flight._replace(context=context))
    outcome = calibrate_drag([flight])
    assert "contradict" in outcome.left[0]
    assert (outcome.changes, outcome.wind_n_m_s) == ((), None)


def test_one_axis_alone_is_not_enough():
    """Always ahead, to the north: the wind along it cannot be told from drag either."""
    outcome = calibrate_drag([flown(heading=0.0, course_every_s=1e9)])
    assert outcome.changes == ()


@pytest.mark.parametrize(
    ("sure_deg", "counts"), [((2.8, 11.5), True), ((3.2, 1.2), False), ((0.3, 12.5), False)]
)
def test_windows_count_only_where_the_attitude_is_sure(sure_deg, counts):
    assert (rows_of(flown(sure_deg=sure_deg), 0) is not None) is counts


def test_in_strong_gusts_what_is_found_is_as_true_as_it_says():
    fit = fitted_drag(
        rows_of(flown(speeds=(0.0, 2.0, 4.0, 5.0), gusts_m_s=1.5), 0), is_whole_speed=False
    )
    true = np.array((1.0 / BCOEF_X, 1.0 / BCOEF_Y, MCOEF))
    assert (np.abs(fit.values[:3] - true) < 3.0 * fit.sigma[:3]).all()


def test_half_of_the_model_is_not_written():
    outcome = calibrate_drag([flown(speeds=(0.0, 2.0, 4.0, 5.0), gusts_m_s=1.5)])
    assert outcome.changes == ()
    assert any("too uncertain" in reason for reason in outcome.left)
    assert any("only together" in reason for reason in outcome.left)


def test_slow_flight_in_little_wind_writes_nothing():
    outcome = calibrate_drag([flown(speeds=(0.0, 2.0, 3.0, 3.0), wind=0.3 * WIND)])
    assert outcome.changes == ()


def test_what_is_set_already_stays():
    own = {"EK3_DRAG_BCOEF_X": 40.0, "EK3_DRAG_BCOEF_Y": 25.0, "EK3_DRAG_MCOEF": 0.25}
    outcome = calibrate_drag([flown(own)])
    assert outcome.changes == ()
    assert all("as set" in reason for reason in outcome.left)
    assert outcome.notes == ()


def test_without_parameters_it_is_said():
    outcome = calibrate_drag([flown({})])
    assert outcome.changes == ()
    assert all("--parameters" in reason for reason in outcome.left)


def test_a_plane_has_none():
    evidence = flown()
    context = evidence.context._replace(vehicle_type=1)
    plane = evidence._replace(flight=evidence.flight._replace(context=context))
    assert calibrate_drag([plane]).left == ("only rotors push along one axis",)


def test_derivatives():
    """Those of the fit against differences of its model."""
    from h2nav.calibration.drag_fit import _model

    rows = rows_of(flown(), 0)
    assert isinstance(rows, DragRows)
    x = np.array([0.02, 0.03, 0.2, 0.1, 0.1, 0.01, 0.01])
    wind_n = np.random.default_rng(1).normal(0, 3, (len(rows.t_s), 2))
    for whole in (False, True):
        predicted, by_values, by_wind, _ = _model(rows, x, wind_n, whole)
        for place in range(len(x)):
            moved = x + 1e-6 * (np.arange(len(x)) == place)
            numeric = (_model(rows, moved, wind_n, whole)[0] - predicted) / 1e-6
            assert np.abs(numeric - by_values[:, :, place]).max() < 1e-3
        for axis in range(2):
            numeric = _model(rows, x, wind_n + 1e-6 * np.eye(2)[axis], whole)[0] - predicted
            assert np.abs(numeric / 1e-6 - by_wind[:, :, axis]).max() < 1e-3


def test_the_range_of_speeds():
    fit = fitted_drag(rows_of(flown(), 0), is_whole_speed=False)
    assert min(excited(fit)) > 8.0


def test_the_first_values_come_with_a_warning_and_later_ones_do_not():
    """What is 0 was not used before; what was set already was."""
    (note,) = calibrate_drag([flown(UNSET)]).notes
    assert "fly carefully" in note
    wrong = {"EK3_DRAG_BCOEF_X": 90.0, "EK3_DRAG_BCOEF_Y": 70.0, "EK3_DRAG_MCOEF": 0.6}
    again = calibrate_drag([flown(wrong)])
    assert again.changes
    assert again.notes == ()

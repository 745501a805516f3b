"""When drag, notch and level are set and when not, in tables; and the words for it."""

import math

import numpy as np
import pytest

from h2nav.calibration import drag, level, notch
from h2nav.calibration.drag_fit import DragFit
from h2nav.calibration.notch import Line
from h2nav.calibration.outcome import ParameterChange
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import Context, Esc, Series, Span
from tests.unit.calibration.logs import evidence_of_log

# --- drag -----------------------------------------------------------------------------------------


def made_fit(place=0, value=0.02, sigma=0.0, *, count=2):
    values, sigmas = np.zeros(7), np.zeros(7)
    values[place], sigmas[place] = value, sigma
    nothing = np.zeros((count, 2))
    return DragFit(values, sigmas, nothing, np.zeros(count), nothing, nothing, np.ones(count))


def drag_change(place, value, sigma=0.0, halves=None, kind="dataflash", **parameters):
    last = evidence_of_log(Context(), parameters, kind=kind)
    parts = [made_fit(place, half) for half in halves or (value, value)]
    return drag._change(place, last, made_fit(place, value, sigma), parts)


X, Y, M = "EK3_DRAG_BCOEF_X", "EK3_DRAG_BCOEF_Y", "EK3_DRAG_MCOEF"


@pytest.mark.parametrize(
    ("place", "value", "sigma", "halves", "parameters", "found"),
    [
        # 15 % in all, 8 % of which are the model's
        (2, 0.2, 0.2 * math.sqrt(0.149**2 - 0.08**2), None, {M: 0.0}, 0.2),
        (2, 0.2, 0.2 * math.sqrt(0.151**2 - 0.08**2), None, {M: 0.0},
         f"{M}: 0.2 ± 0.03 is too uncertain"),
        (0, 0.02, 0.01, None, {X: 0.0}, f"{X}: 1/0.02 ± 0.01 is too uncertain"),
        (0, -0.02, 0.0, None, {X: 0.0}, f"{X}: 1/-0.02 ± 0.0016 is too uncertain"),
        (2, 0.2, 0.0, (0.2, 0.281), {M: 0.0}, f"{M}: the halves of the flight disagree"),
        (2, 0.2, 0.0, (0.2, 0.279), {M: 0.0}, 0.2),
        (2, 0.2, 0.0, None, {}, f"{M} 0.2 ± 0.016: its parameter is not in the recording "
         "(--parameters)"),
        (0, 0.02, 0.0, None, {X: 0.0}, 50.0),
        (1, 0.04, 0.0, None, {Y: -1.0}, 25.0),
        # a fifth of the one in use, or four deviations of a twelfth
        (0, 0.02, 0.0, None, {X: 67.0}, 50.0),
        (0, 0.02, 0.0, None, {X: 65.0}, f"{X} 50 ± 4: as set"),
        (2, 0.5, 0.0, None, {M: 0.3}, 0.5),
        (2, 0.5, 0.0, None, {M: 0.35}, f"{M} 0.5 ± 0.04: as set"),
        (2, 0.5, 0.0, None, {M: 0.615}, f"{M} 0.5 ± 0.04: as set"),
        (2, 0.1, 0.0, None, {M: 0.134}, 0.1),
        (2, 1.01, 0.0, None, {M: 0.0}, f"{M} 1.01 ± 0.081: beyond the firmware's limit"),
        (0, 1 / 999.0, 0.0, None, {X: 0.0}, 999.0),
        (0, 1 / 1001.0, 0.0, None, {X: 0.0}, f"{X} 1e+03 ± 80: beyond the firmware's limit"),
    ],
)  # fmt: skip
def test_a_drag_is_set_if_it_is_certain_lasting_relevant_and_possible(
    place, value, sigma, halves, parameters, found
):
    change = drag_change(place, value, sigma, halves, **parameters)
    if isinstance(found, str):
        assert change == found
    else:
        (name, old) = next(iter(parameters.items()))
        share = math.hypot(0.08, sigma / value)
        assert change == ParameterChange(
            name, old, pytest.approx(found), pytest.approx(share * found)
        )


def test_px4_has_other_names_and_limits():
    change = drag_change(0, 1 / 199.0, kind="ulog", EKF2_BCOEF_X=100.0)
    assert change[:2] == ("EKF2_BCOEF_X", 100.0)
    beyond = drag_change(1, 1 / 201.0, kind="ulog", EKF2_BCOEF_Y=100.0)
    assert beyond == "EKF2_BCOEF_Y 201 ± 16: beyond the firmware's limit"
    assert drag_change(2, 0.3, kind="ulog", EKF2_MCOEF=0.15)[0] == "EKF2_MCOEF"


def test_the_wind_is_that_of_the_last_flight_where_it_is_known():
    fit = made_fit(count=4)._replace(
        wind_n=np.arange(8.0).reshape(4, 2), sigma_wind=np.array((0.1, 2.49, 2.51, 0.1))
    )
    rows = drag.DragRows(np.array((0, 1, 1, 1)), np.arange(4.0), *[np.zeros(4)] * 5)
    wind = drag._wind(rows, fit, 1)
    assert (wind.t_s.tolist(), wind.values.tolist()) == ([1.0, 3.0], [[2.0, 3.0], [6.0, 7.0]])
    assert drag._wind(rows, fit, 2) is None


def test_how_far_the_next_fix_is():
    found = drag._nearest_s(np.array((1.0, 2.0, 4.0)), np.array((0.0, 1.0, 1.6, 2.9, 3.1, 9.0)))
    assert found == pytest.approx((1.0, 0.0, 0.4, 0.9, 0.9, 5.0))


def test_figures_of_drag_are_in_their_units():
    values, sigma = np.arange(1.0, 8.0), np.arange(0.1, 0.8, 0.1)
    fit = made_fit()._replace(
        values=values, sigma=sigma, residual=np.array([(3.0, -4.0), (0.0, 0.0), (6.0, 8.0)])
    )
    assert drag._figures(fit) == {
        "inverse_bcoef_x_m2_kg": 1.0, "inverse_bcoef_x_m2_kg_sigma": pytest.approx(0.1),
        "inverse_bcoef_y_m2_kg": 2.0, "inverse_bcoef_y_m2_kg_sigma": pytest.approx(0.2),
        "mcoef_1_s": 3.0, "mcoef_1_s_sigma": pytest.approx(0.3), "residual_m_s2": 5.0,
    }  # fmt: skip


# --- notch ----------------------------------------------------------------------------------------

FREE = {"INS_HNTCH_ENABLE": 0.0}


def flights(parameters=FREE, throttle=None, escs=()):
    return [
        evidence_of_log(
            Context(
                armed=(Span(10.0, 20.0, ""),),
                throttle=throttle and Series(np.arange(30.0), np.array(throttle)),
                escs=escs,
            ),
            parameters,
        )
    ]


@pytest.mark.parametrize(
    ("mask", "harmonics"), [(0b1, [1]), (0b11, [1, 2]), (0b1010, [2, 4]), (0, [])]
)
def test_harmonics_are_bits(mask, harmonics):
    assert Line(90.0, mask, 3.0).harmonics == harmonics


@pytest.mark.parametrize(
    ("flying", "reference"),
    [(0.32456, 0.325), (0.101, 0.101), (0.1, None), (0.899, 0.899), (0.9, None)],
)
def test_a_family_follows_the_middle_of_the_throttle_in_flight(flying, reference):
    """Of what turns the motors, while armed."""
    throttle = [0.8] * 10 + [0.05] * 5 + [flying] * 6 + [0.7] * 9
    found = notch._ardupilot(flights(throttle=throttle), Line(90.4, 3, 3.0))
    if reference is None:
        assert found == "no usable throttle to follow"
    else:
        assert found == {
            "INS_HNTCH_ENABLE": 1.0, "INS_HNTCH_FREQ": 90, "INS_HNTCH_BW": 45, "INS_HNTCH_HMNCS": 3,
            "INS_HNTCH_MODE": 1.0, "INS_HNTCH_REF": reference,
        }  # fmt: skip


def test_without_throttle_or_with_a_notch_in_use_none_is_chosen():
    line = Line(90.0, 3, 3.0)
    assert notch._ardupilot(flights(), line) == "no usable throttle to follow"
    assert notch._ardupilot(flights({}), line) == (
        "its firmware's notch is not known (--parameters)"
    )
    in_use = {"INS_HNTCH_ENABLE": 1.0}
    assert notch._ardupilot(flights(in_use), line) == "a notch is in use: check it first"
    assert notch._ardupilot(flights(), Line(90.0, 2, 3.0))["INS_HNTCH_MODE"] == 0.0


def test_speeds_of_all_motors_are_followed():
    t_s = np.arange(3.0)
    one, dead = (Esc(n, t_s, rpm, t_s, t_s) for n, rpm in ((1, 60.0 * t_s), (2, np.nan * t_s)))
    values = notch._ardupilot(flights(escs=(one,)), Line(90.0, 3, 3.0))
    assert (values["INS_HNTCH_MODE"], values["INS_HNTCH_REF"]) == (3.0, 1.0)
    assert notch._ardupilot(flights(escs=(one, dead)), Line(90.0, 3, 3.0)) == (
        "no usable throttle to follow"
    )


@pytest.mark.parametrize(("line_hz", "width_hz"), [(3.0, 20), (9.9, 20), (10.6, 21), (40.0, 80)])
def test_notches_of_px4_are_twice_as_wide_as_their_line(line_hz, width_hz):
    own = {f"IMU_GYRO_NF{i}_{name}": 0.0 for i in range(2) for name in ("FRQ", "BW")}
    assert notch._px4(flights(own), Line(90.3, 0b1110, line_hz)) == {
        "IMU_GYRO_NF0_FRQ": 181, "IMU_GYRO_NF0_BW": width_hz,
        "IMU_GYRO_NF1_FRQ": 271, "IMU_GYRO_NF1_BW": width_hz,
    }  # fmt: skip
    assert notch._px4(flights({}), Line(90.0, 1, 3.0)) == "its firmware's notches are not known"


# --- level ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "armed", "inside"),
    [
        (((0.0, 0.0), (2.0, 1.0)), (), [False, False, True, True, True]),
        (((0.0, 0.0), (1.5, 1.0), (3.5, 0.0)), (), [False, False, True, False, False]),
        (((2.5, 1.0),), (), [False, False, False, True, True]),
        (((0.0, 1.0),), (Span(1.9, 3.5, ""),), [False, True, True, False, False]),
        (None, (), [False] * 5),
    ],
)
def test_a_window_is_in_the_air_from_end_to_end(changes, armed, inside):
    airborne = changes and Series(*np.array(changes).T)
    evidence = evidence_of_log(Context(airborne=airborne, armed=armed), {})
    assert level.in_air(evidence, np.arange(6.0)).tolist() == inside


def hover(roll, pitch, count=60, wind=(0.0, 0.0), drag_per_s=0.0, turns=3.0):
    """A multirotor that turns in a wind; its board leans in the frame."""
    yaw = np.linspace(0.0, 2.0 * math.pi * turns, count, endpoint=False)
    north = np.stack((np.cos(yaw), -np.sin(yaw)), axis=1)
    east = np.stack((np.sin(yaw), np.cos(yaw)), axis=1)
    lean = GRAVITY_M_S2 * np.array((-math.tan(pitch) / math.cos(roll), math.tan(roll)))
    J = np.zeros((count, 2, 5))
    J[:, 0, 1], J[:, 1, 0] = GRAVITY_M_S2, -GRAVITY_M_S2
    J[:, :, 3], J[:, :, 4] = north, east
    force = drag_per_s * (wind[0] * north + wind[1] * east)
    return level._Rows(np.zeros(count, np.int64), np.arange(count) + 0.5, force - lean, J)


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(0.0, 0.0), (3.0, 0.0), (-2.0, 4.0)])
def test_the_tilt_is_what_does_not_turn_with_the_wind(roll_deg, pitch_deg):
    roll, pitch = roll_deg * DEG, pitch_deg * DEG
    rows = hover(roll, pitch, wind=(5.0, -3.0), drag_per_s=0.3)
    angles, sigma = level._tilt(rows, 0.0)
    assert angles / DEG == pytest.approx((roll_deg, pitch_deg), abs=0.03)
    assert (sigma >= 0.3 * DEG).all()
    assert (sigma < 0.5 * DEG).all()
    # an offset of the accelerometer stands beside it
    assert level._tilt(rows, 0.1)[1] == pytest.approx(np.hypot(sigma, 0.1 / GRAVITY_M_S2))


def test_the_tilt_of_a_quiet_hover_is_as_uncertain_as_a_wind_that_may_have_changed():
    """0.3 deg, beside 0.05 m/s^2 of noise in each window."""
    found = level._tilt(hover(0.0, 0.0), 0.0)[1]
    noise = 0.05 / GRAVITY_M_S2 / math.sqrt(60.0)
    assert found == pytest.approx([math.hypot(0.3 * DEG, noise)] * 2, rel=1e-3)


def test_without_a_turn_a_lean_is_as_uncertain_as_a_wind_is_strong():
    """2 m/s^2 of drag in a wind, or 6 deg of a board that was meant to be level."""
    rows = hover(0.0, 0.0, count=400, turns=0.0)
    lean = np.array((6.0 * DEG, 2.0 / GRAVITY_M_S2)) ** -2.0
    expected = math.hypot(lean.sum() ** -0.5, 0.3 * DEG)
    assert level._tilt(rows, 0.0)[1] == pytest.approx([expected] * 2, rel=0.01)

"""Which outputs of an autopilot drive motors, and over which range: tables."""

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.recordings.context import OutputBank, Series
from h2nav.recordings.motor_outputs import (
    ardupilot_channels,
    ardupilot_range,
    motors_by_share,
    motors_of,
    px4_channels,
    px4_motors,
)

QUAD, HEXA, PLANE = (
    mavlink.MAV_TYPE_QUADROTOR,
    mavlink.MAV_TYPE_HEXAROTOR,
    mavlink.MAV_TYPE_FIXED_WING,
)
T_S = np.arange(10.0)


def outputs(*amplitudes_us, middle_us=1500.0):
    """(N, k) outputs that move by so much."""
    return middle_us + np.outer((-1.0) ** np.arange(len(T_S)), amplitudes_us)


@pytest.mark.parametrize(
    ("parameters", "kind", "expected"),
    [
        ({"SERVO1_FUNCTION": 33.0, "SERVO2_FUNCTION": 40.0}, QUAD, {0: 1, 1: 8}),
        ({"SERVO3_FUNCTION": 82.0, "SERVO4_FUNCTION": 85.0}, QUAD, {2: 9, 3: 12}),
        ({"SERVO1_FUNCTION": 32.0, "SERVO2_FUNCTION": 41.0, "SERVO3_FUNCTION": 81.0,
          "SERVO4_FUNCTION": 86.0}, QUAD, {}),
        ({"SERVO1_FUNCTION": 33.0}, PLANE, {}),
        # until 2016
        ({}, QUAD, {0: 1, 1: 2, 2: 3, 3: 4}),
        ({}, mavlink.MAV_TYPE_TRICOPTER, {0: 1, 1: 2, 2: 3}),
        ({}, PLANE, {}),
    ],
)  # fmt: skip
def test_channels_of_ardupilot(parameters, kind, expected):
    assert ardupilot_channels(parameters, kind, outputs(*[100.0] * 4)) == expected


@pytest.mark.parametrize(
    ("amplitudes_us", "parameters", "count"),
    [
        ([100.0] * 4 + [0.0] * 4, {}, 4),
        ([100.0] * 6 + [0.0] * 2, {}, 6),
        ([100.0] * 8, {}, 8),
        ([100.0] * 7 + [0.0], {}, 4),  # an odd number is something else
        ([100.0] * 4 + [6.0] * 2 + [0.0] * 2, {}, 6),
        ([100.0] * 4 + [4.0] * 2 + [0.0] * 2, {}, 4),  # random memory
        ([100.0] * 4 + [900.0] * 2 + [0.0] * 2, {}, 4),  # no pulse width
        ([100.0] * 8, {"RC7_FUNCTION": 7.0, "RC8_FUNCTION": 7.0}, 6),
        ([100.0] * 2, {}, 2),
    ],
)
def test_only_the_firmware_knew_how_many(amplitudes_us, parameters, count):
    found = ardupilot_channels(parameters, QUAD, outputs(*amplitudes_us))
    assert found == {i: i + 1 for i in range(count)}


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({}, (1000.0, 2000.0)),
        ({"MOT_PWM_MIN": 1100.0, "MOT_PWM_MAX": 1900.0, "RC3_MIN": 1.0}, (1100.0, 1900.0)),
        ({"MOT_PWM_MIN": 0.0, "RC3_MIN": 1050.0, "RC3_MAX": 1950.0}, (1050.0, 1950.0)),
        ({"MOT_SPIN_MAX": 0.95}, (1000.0, 1950.0)),
        ({"MOT_THST_MAX": 0.9}, (1000.0, 1900.0)),
        ({"MOT_SPIN_MAX": 0.5}, (1000.0, 1500.0)),
        ({"MOT_SPIN_MAX": 0.49}, (1000.0, 2000.0)),
        ({"MOT_SPIN_MAX": 1.1}, (1000.0, 2000.0)),
        ({"MOT_TCRV_ENABLE": 1.0, "MOT_TCRV_MXPCT": 80.0}, (1000.0, 1800.0)),
        ({"MOT_TCRV_ENABLE": 1.0, "MOT_TCRV_MAXPCT": 70.0}, (1000.0, 1700.0)),
        ({"MOT_TCRV_ENABLE": 0.0, "MOT_TCRV_MXPCT": 80.0}, (1000.0, 2000.0)),
        ({"MOT_TCRV_ENABLE": 1.0}, (1000.0, 2000.0)),
    ],
)
def test_the_range_of_ardupilot(parameters, expected):
    assert ardupilot_range(parameters) == pytest.approx(expected)


def test_channels_of_px4():
    assert px4_channels({}, HEXA) == [{i: i + 1 for i in range(6)}]
    assert px4_channels({}, PLANE) == [{}]
    by_bank = {"PWM_AUX_FUNC3": 101.0, "PWM_MAIN_FUNC16": 112.0, "UAVCAN_EC_FUNC1": 113.0}
    assert px4_channels(by_bank, QUAD) == [{15: 12}, {2: 1}]


def bank(values):
    return OutputBank(0, T_S, np.asarray(values, dtype=float))


def test_the_motors_of_px4_are_on_the_bank_that_moves():
    still, moving = bank(outputs(*[0.0] * 4)), bank(outputs(*[100.0] * 4))
    zeros = bank(np.zeros((len(T_S), 4)))
    narrow = bank(outputs(*[100.0] * 3))
    limits = {"PWM_MAIN_MIN": 1075.0, "PWM_MIN": 1.0, "PWM_MAX": 1950.0}
    found = px4_motors((zeros, narrow, still, moving), limits, QUAD)
    assert found.numbers == (1, 2, 3, 4)
    np.testing.assert_array_equal(found.pwm_us, moving.values)
    assert (found.least_us, found.most_us) == (1075.0, 1950.0)
    at_rest = px4_motors((zeros, still), {}, QUAD)
    np.testing.assert_array_equal(at_rest.pwm_us, still.values)
    assert (at_rest.least_us, at_rest.most_us) == (1000.0, 2000.0)
    assert px4_motors((zeros,), {}, QUAD) is None
    assert px4_motors((moving,), {}, PLANE) is None


def test_a_motor_controller_on_can_has_no_pulse_width():
    found = px4_motors((bank(outputs(*[100.0] * 4, middle_us=8091.0)),), {}, QUAD)
    assert found.pwm_us.max() == pytest.approx(2000.0)
    assert found.pwm_us.min() == pytest.approx(1000.0 + 1000.0 * 7991.0 / 8191.0)
    assert (found.least_us, found.most_us) == (1000.0, 2000.0)


def test_shares_are_motors_by_number():
    shares = np.full((len(T_S), 12), np.nan)
    shares[:, 1], shares[:, 3] = 0.25, 1.0
    found = motors_by_share(Series(T_S, shares))
    assert found.numbers == (2, 4)
    assert found.pwm_us[0].tolist() == [1250.0, 2000.0]
    assert found.share()[0].tolist() == [0.25, 1.0]
    assert motors_by_share(Series(T_S, np.full((len(T_S), 2), np.nan))) is None


def test_motors_are_in_the_order_of_their_numbers_and_what_is_no_width_is_unknown():
    values = outputs(0.0, 0.0, 0.0)
    values[:4, 0] = [0.9, 1.0, 2300.0, 2301.0]
    found = motors_of({0: 3, 2: 1, 7: 2}, T_S, values, (1000.0, 2000.0))
    assert found.numbers == (1, 3)
    assert np.isnan(found.pwm_us[:4, 1]).tolist() == [True, False, False, True]
    assert motors_of({7: 1}, T_S, values, (1000.0, 2000.0)) is None
    assert motors_of({0: 1}, T_S[:0], values[:0], (1000.0, 2000.0)) is None

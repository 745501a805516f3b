"""Parameters of compasses against the formulas of the autopilots, there and back."""

import numpy as np
import pytest

from h2nav.calibration import rotations
from h2nav.calibration.settings import (
    Lever,
    ardupilot_compass,
    ardupilot_values,
    px4_compass,
    px4_values,
)

RAW_MG = np.array([120.0, -310.0, 405.0])
ARDUPILOT = {
    "COMPASS_DEV_ID": 97539.0,
    "COMPASS_DEV_ID2": 131874.0,
    "COMPASS_PRIO1_ID": 131874.0,
    "COMPASS_PRIO2_ID": 97539.0,
    **{f"COMPASS_OFS2_{k}": v for k, v in zip("XYZ", (30.0, -45.0, 12.0), strict=True)},
    **{f"COMPASS_DIA2_{k}": v for k, v in zip("XYZ", (1.02, 0.97, 1.01), strict=True)},
    **{f"COMPASS_ODI2_{k}": v for k, v in zip("XYZ", (0.02, -0.01, 0.03), strict=True)},
    **{f"COMPASS_MOT2_{k}": v for k, v in zip("XYZ", (90.0, 20.0, -30.0), strict=True)},
    "COMPASS_SCALE2": 1.05,
    "COMPASS_MOTCT": 1.0,
    "COMPASS_ORIENT2": 2.0,
    "COMPASS_EXTERN2": 1.0,
}
PX4 = {
    "CAL_MAG0_ID": 1.0,
    "CAL_MAG1_ID": 527625.0,
    **{f"CAL_MAG1_{k}OFF": v for k, v in zip("XYZ", (0.04, 0.11, -0.07), strict=True)},
    **{f"CAL_MAG1_{k}SCALE": v for k, v in zip("XYZ", (1.04, 1.0, 0.94), strict=True)},
    **{f"CAL_MAG1_{k}ODIAG": v for k, v in zip("XYZ", (-0.04, 0.01, -0.002), strict=True)},
    **{f"CAL_MAG1_{k}COMP": v for k, v in zip("XYZ", (2.0, -1.0, 0.5), strict=True)},
    "CAL_MAG1_ROT": 6.0,
    "CAL_MAG_COMP_TYP": 2.0,
}


def test_ardupilot_corrects_as_its_backend_does():
    settings = ardupilot_compass(ARDUPILOT, 0)
    throttle = np.array([0.4])
    D = np.array(((1.02, 0.02, -0.01), (0.02, 0.97, 0.03), (-0.01, 0.03, 1.01)))
    expected = D @ (1.05 * (RAW_MG + np.array((30.0, -45.0, 12.0)))) + 0.4 * np.array(
        (90.0, 20.0, -30.0)
    )
    found = settings.correction.corrected(0.1 * RAW_MG[None], throttle)[0]
    assert 10.0 * found == pytest.approx(expected)
    assert settings.correction.undone(found[None], throttle)[0] == pytest.approx(0.1 * RAW_MG)


def test_the_preferred_compass_has_the_parameters_of_its_device():
    settings = ardupilot_compass(ARDUPILOT, 0)
    assert (settings.slot, settings.device_id) == (1, 131874)
    assert settings.can_turn
    assert settings.rotation == 2


def test_ardupilot_parameters_come_back():
    settings = ardupilot_compass(ARDUPILOT, 0)
    values = ardupilot_values(settings, ARDUPILOT)
    # Scale and diagonals say one thing between them.
    assert values["COMPASS_SCALE2"] == pytest.approx(1.05 * 1.0)
    for name, value in values.items():
        assert value == pytest.approx(ARDUPILOT[name], rel=1e-9), name


def test_what_a_firmware_does_not_know_is_not_set():
    old = {f"COMPASS_OFS_{axis}": 1.0 for axis in "XYZ"}
    settings = ardupilot_compass(old, 0)
    assert not settings.can_shape
    assert set(ardupilot_values(settings, old)) == set(old)


def test_px4_corrects_as_its_library_does():
    settings = px4_compass(PX4, 0, 527625)
    R = rotations.matrix(6)
    S = np.array(((1.04, -0.04, 0.01), (-0.04, 1.0, -0.002), (0.01, -0.002, 0.94)))
    raw, power = np.array([0.12, -0.31, 0.40]), 0.015  # gauss, kA
    expected = R @ S @ (raw + power * np.array((2.0, -1.0, 0.5)) - (0.04, 0.11, -0.07))
    found = settings.correction.corrected(100.0 * (R @ raw)[None], np.array([15.0]))[0]
    assert found == pytest.approx(100.0 * expected)
    assert settings.lever is Lever.CURRENT


def test_px4_parameters_come_back():
    settings = px4_compass(PX4, 0, 527625)
    assert settings.slot == 1
    for name, value in px4_values(settings, PX4).items():
        assert value == pytest.approx(PX4[name], abs=1e-12), name


def test_without_parameters_nothing_is_known():
    assert ardupilot_compass({}, 0) is None
    assert px4_compass({}, 0, 0) is None

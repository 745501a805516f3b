"""Parameters of accelerometers and gyros against the formulas of the autopilots."""

import numpy as np
import pytest

from h2nav.calibration.imu_settings import board_of, sensor_settings
from h2nav.maths.units import DEG
from h2nav.recordings.context import Context
from tests.unit.calibration.logs import evidence_of_log, imu_track

TRACK = imu_track(np.zeros((3, 3)), np.ones((3, 3)))
ARDUPILOT = {
    "INS_ACC_ID": 2621706.0,
    **{f"INS_ACCOFFS_{k}": v for k, v in zip("XYZ", (0.1, -0.2, 0.3), strict=True)},
    **{f"INS_ACCSCAL_{k}": v for k, v in zip("XYZ", (1.01, 0.99, 1.02), strict=True)},
    **{f"INS_GYROFFS_{k}": v for k, v in zip("XYZ", (0.01, 0.02, -0.03), strict=True)},
}
PX4 = {
    "CAL_ACC0_ID": 1.0,
    "CAL_ACC1_ID": 2949146.0,
    "CAL_ACC1_ROT": -1.0,
    "SENS_BOARD_ROT": 4.0,
    "SENS_BOARD_X_OFF": 2.0,
    "SENS_BOARD_Y_OFF": -1.0,
    **{f"CAL_ACC1_{k}OFF": v for k, v in zip("XYZ", (0.1, -0.2, 0.3), strict=True)},
    **{f"CAL_ACC1_{k}SCALE": v for k, v in zip("XYZ", (1.01, 0.99, 1.02), strict=True)},
}


def found(parameters, track=TRACK, *, kind="dataflash", is_gyro=False):
    return sensor_settings(
        evidence_of_log(Context(), parameters, kind=kind), track, is_gyro=is_gyro
    )


def test_ardupilot_has_one_set_per_imu():
    settings = found(ARDUPILOT)
    assert settings.device == "2621706"
    assert settings.offset == pytest.approx((0.1, -0.2, 0.3))
    assert settings.scale == pytest.approx((1.01, 0.99, 1.02))
    assert settings.axes == pytest.approx(np.eye(3))
    gyro = found(ARDUPILOT, is_gyro=True)
    assert (gyro.offset_name % "Y", gyro.scale_name) == ("INS_GYROFFS_Y", "")


def test_a_log_shows_the_body_and_the_parameters_are_of_the_sensor():
    turned = ARDUPILOT | {"AHRS_ORIENTATION": 2.0, "AHRS_TRIM_Y": 3.0 * DEG}
    axes = found(turned).axes
    # Yaw 90: x of the sensor lies along y of the board; the trim turns about y alone.
    assert axes @ (1.0, 0.0, 0.0) == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)
    # The board's pitch of 3 deg: down of the body is not its z.
    assert axes @ (0.0, 0.0, 1.0) == pytest.approx(
        (np.sin(3.0 * DEG), 0.0, np.cos(3.0 * DEG)), abs=1e-9
    )
    # Telemetry is in the axes of the board.
    assert found(turned, kind="tlog").axes @ (0, 0, 1) == pytest.approx((0, 0, 1), abs=1e-9)


def test_px4_finds_the_sensor_by_its_id():
    track = TRACK._replace(source="sensor_combined", device_ids=(2949146, 7))
    settings = found(PX4, track, kind="ulog")
    assert settings.offset_name % "X" == "CAL_ACC1_XOFF"
    level = board_of(evidence_of_log(Context(), PX4, kind="ulog")).vectors(np.eye(3)).T
    yaw_180 = np.diag([-1.0, -1.0, 1.0])
    assert settings.axes == pytest.approx(level @ yaw_180, abs=1e-9)


@pytest.mark.parametrize(
    ("parameters", "track", "kind", "why"),
    [
        ({}, TRACK, "tlog", "--parameters"),
        (ARDUPILOT, TRACK._replace(source="HIGHRES_IMU"), "tlog", "HIGHRES_IMU"),
        (ARDUPILOT | {"AHRS_ORIENTATION": 101.0}, TRACK, "dataflash", "AHRS_ORIENTATION 101"),
        (ARDUPILOT | {"INS_ACCSCAL_X": 0.0}, TRACK, "dataflash", "never calibrated"),
        (PX4, TRACK._replace(device_ids=(5, 5)), "ulog", "identify its sensor"),
        (PX4, TRACK._replace(source="sensor_gyro"), "ulog", "raw values"),
    ],
)
def test_what_is_not_known_has_a_reason(parameters, track, kind, why):
    assert why in found(parameters, track, kind=kind)


@pytest.mark.parametrize(
    ("scale", "is_known"), [(0.79, False), (0.8, True), (1.2, True), (1.21, False), (np.nan, False)]
)
def test_a_scale_beyond_a_fifth_is_no_calibration(scale, is_known):
    settings = found(ARDUPILOT | {"INS_ACCSCAL_Z": scale})
    if is_known:
        assert settings.scale[2] == scale
    else:
        assert settings == (
            "the parameters INS_ACCOFFS_* are not known, or it was never calibrated"
        )


def test_each_imu_of_ardupilot_has_a_number_from_the_second_on():
    own = {name.replace("ACC", "ACC3").replace("GYR", "GYR3"): v for name, v in ARDUPILOT.items()}
    third = TRACK._replace(imu=2)
    settings = found(own, third)
    assert (settings.device, settings.offset_name) == ("2621706", "INS_ACC3OFFS_%s")
    assert settings.scale_name == "INS_ACC3SCAL_%s"
    gyro = found(own, third, is_gyro=True)
    assert gyro.device == ""
    assert gyro.offset == pytest.approx((0.01, 0.02, -0.03))
    assert gyro.scale.tolist() == [1.0, 1.0, 1.0]
    assert "INS_ACCOFFS_*" in found(own, TRACK)


@pytest.mark.parametrize(
    ("rotation", "board", "says"),
    [(37.0, 0.0, ""), (38.0, 0.0, "ROT 38"), (-1.0, 37.0, ""), (-1.0, 38.0, "ROT 38")],
)
def test_px4_has_38_rotations(rotation, board, says):
    own = PX4 | {"CAL_ACC1_ROT": rotation, "SENS_BOARD_ROT": board}
    track = TRACK._replace(source="sensor_combined", device_ids=(2949146, 7))
    settings = found(own, track, kind="ulog")
    if says:
        assert settings == f"CAL_ACC1_{says} is not known here"
    else:
        assert settings.device == "2949146"


def test_a_gyro_of_px4_is_found_by_its_own_id():
    own = {f"CAL_GYRO3_{k}OFF": v for k, v in zip("XYZ", (0.1, 0.2, 0.3), strict=True)}
    own |= {"CAL_GYRO3_ID": 7.0, "CAL_ACC0_ID": 7.0, "CAL_ACC1_ID": 2949146.0}
    track = TRACK._replace(source="sensor_combined", device_ids=(2949146, 7))
    settings = found(own, track, kind="ulog", is_gyro=True)
    assert (settings.offset_name, settings.scale_name) == ("CAL_GYRO3_%sOFF", "")
    assert settings.offset == pytest.approx((0.1, 0.2, 0.3))
    nobody = track._replace(device_ids=(2949146, 0))
    assert "identify" in found(own | {"CAL_GYRO3_ID": 0.0}, nobody, kind="ulog", is_gyro=True)

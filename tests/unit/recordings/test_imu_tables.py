"""IMUs in each format: samples in SI units, what they are means over, and which are new."""

import math

import numpy as np
import pytest
from made_rows import MadeLog, MadeMessage, table

from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.imu_tables import (
    averaging_us,
    devices_in_use,
    field_unless_zero,
    highres_field_ut,
    imu_columns,
    none_is_zero,
    of_integral,
    same_throughout,
)

NAN = math.nan
W_B, F_B = (0.5, -0.25, 1.0), (1.0, 2.0, -9.0)


def axes(name, values, form="{}[{}]"):
    return {form.format(name, axis): value for axis, value in enumerate(values)}


def letters(start, values, end=""):
    return {f"{start}{axis}{end}": v for axis, v in zip("xyz", values, strict=True)}


def found_in(kind, **messages):
    return imu_columns(MadeLog(kind, *(MadeMessage(*each) for each in messages.items())))


INTEGERS = {
    **letters("", [round(1000 * w) for w in W_B], "gyro"),
    **letters("", [round(1000 * f / GRAVITY_M_S2) for f in F_B], "acc"),
    **letters("", (200, 10, 400), "mag"),
}
HIGHRES = {
    **letters("", W_B, "gyro"),
    **letters("", F_B, "acc"),
    **letters("", (0.2, 0.01, 0.4), "mag"),
    "fields_updated": 0x1FF,
    "time_usec": 7_000_001,
}
GYRO_ONLY, FORCE_ONLY = (W_B, (NAN,) * 3), ((NAN,) * 3, F_B)


@pytest.mark.parametrize(
    ("kind", "message", "columns", "number", "values", "stamp_us"),
    [
        ("dataflash", "IMU",
         {**dict(zip(("GyrX", "GyrY", "GyrZ"), W_B, strict=True)),
          **dict(zip(("AccX", "AccY", "AccZ"), F_B, strict=True))}, 0, (W_B, F_B), NAN),
        ("ulog", "vehicle_imu",
         {**axes("delta_angle", np.multiply(W_B, 0.01)),
          **axes("delta_velocity", np.multiply(F_B, 0.02)),
          "delta_angle_dt": 10_000, "delta_velocity_dt": 20_000}, 0, (W_B, F_B), NAN),
        ("ulog", "sensor_combined",
         {**axes("gyro_rad", W_B), **axes("accelerometer_m_s2", F_B)}, 0, (W_B, F_B), NAN),
        ("ulog", "sensor_gyro", letters("", W_B), 0, GYRO_ONLY, NAN),
        ("ulog", "sensor_accel", letters("", F_B), 0, FORCE_ONLY, NAN),
        ("telemetry", "HIGHRES_IMU", HIGHRES, 0, (W_B, F_B), 7_000_001),
        ("telemetry", "RAW_IMU", {**INTEGERS, "time_usec": 7_000_001}, 0, (W_B, F_B), 7_000_001),
        ("telemetry", "SCALED_IMU", {**INTEGERS, "time_boot_ms": 7_001}, 0, (W_B, F_B), 7_001_000),
        ("telemetry", "SCALED_IMU2", {**INTEGERS, "time_boot_ms": 7_001}, 1, (W_B, F_B), 7_001_000),
        ("telemetry", "SCALED_IMU3", {**INTEGERS, "time_boot_ms": 7_001}, 2, (W_B, F_B), 7_001_000),
    ],
)  # fmt: skip
def test_samples_in_si_units(kind, message, columns, number, values, stamp_us):
    (found,) = found_in(kind, **{message: columns})
    assert (found.number, found.message) == (number, message)
    np.testing.assert_allclose(found.w_b[0], values[0], atol=1e-9)
    np.testing.assert_allclose(found.f_b[0], values[1], atol=0.005)
    np.testing.assert_array_equal(found.stamp_us[:1], [stamp_us])
    is_wired = kind == "telemetry"
    np.testing.assert_allclose(np.broadcast_to(found.m_b_ut.T, (3, 1)).T,
                               [(20.0, 1.0, 40.0) if is_wired else (NAN,) * 3])  # fmt: skip


def test_a_fourth_imu_is_one_too_many():
    columns = {**axes("gyro_rad", W_B), **axes("accelerometer_m_s2", F_B)}
    log = MadeLog("ulog", *(MadeMessage("sensor_combined", columns, n) for n in range(4)))
    assert [one.number for one in imu_columns(log)] == [0, 1, 2]


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (np.array([0.01, 0.1, 0.1001, 0.0, -0.01, NAN]), [1e4, 1e5, 0.0, 0.0, 0.0, 0.0]),
        (np.array([1, 10_000, 100_000, 100_001, 0, -5]), [1.0, 1e4, 1e5, 0.0, 0.0, 0.0]),
    ],
)
def test_an_averaging_time_is_at_most_a_tenth_of_a_second(values, expected):
    np.testing.assert_allclose(averaging_us(table({"dt": values}), "dt"), expected)
    np.testing.assert_array_equal(averaging_us(table({"other": values}), "dt"), [0.0] * 6)


def test_an_integral_is_over_its_own_time():
    columns = {**axes("delta_velocity", [0.5, 1.0, 2.0]), "delta_angle_dt": 10_000}
    names = tuple(columns)[:3]
    np.testing.assert_allclose(of_integral(table(columns), *names), [(50.0, 100.0, 200.0)])
    columns["delta_velocity_dt"] = 20_000
    np.testing.assert_allclose(of_integral(table(columns), *names), [(25.0, 50.0, 100.0)])
    # Over no time at all it is no mean.
    columns["delta_velocity_dt"] = 0
    assert not np.isfinite(of_integral(table(columns), *names)).any()


def test_a_sample_is_healthy_unless_a_flag_is_zero():
    both = table({"GH": [1, 0, 1, 0], "AH": [1, 1, 0, 0]})
    assert none_is_zero(both, "GH", "AH").tolist() == [1.0, 0.0, 0.0, 0.0]
    assert none_is_zero(both, "GH").tolist() == [1.0, 0.0, 1.0, 0.0]
    assert none_is_zero(both, "XH", "YH").tolist() == [1.0] * 4
    assert none_is_zero(both, "XH", "AH").tolist() == [1.0, 1.0, 0.0, 0.0]


def test_a_compass_that_shows_zeros_is_absent():
    columns = table({"x": [0, 0, 5], "y": [0, 0, 0], "z": [0, -1, 0]})
    np.testing.assert_array_equal(
        field_unless_zero(columns, "x", "y", "z"), [(NAN,) * 3, (0, 0, -1), (5, 0, 0)]
    )


@pytest.mark.parametrize(
    ("bits", "gauss", "expected"),
    [
        (0x1C0, (0.2, 0.01, 0.4), (20.0, 1.0, 40.0)),
        (0x40, (0.2, 0.01, 0.4), (20.0, 1.0, 40.0)),
        (0x100, (0.2, 0.01, 0.4), (20.0, 1.0, 40.0)),
        (0x3F, (0.2, 0.01, 0.4), (NAN,) * 3),  # rates and forces alone are new
        (0x200, (0.2, 0.01, 0.4), (NAN,) * 3),
        (0x1C0, (0.0, 0.0, 0.0), (NAN,) * 3),
        (0x1C0, (0.2, NAN, 0.4), (NAN,) * 3),
        # ArduPilot's factor of a million, which no field of the earth has.
        (0x1C0, (2e5, 1e4, 4e5), (20.0, 1.0, 40.0)),
        (0x1C0, (9999.0, 0.0, 0.0), (999_900.0, 0.0, 0.0)),
        (0x1C0, (10_001.0, 0.0, 0.0), (1.0001, 0.0, 0.0)),
    ],
)
def test_a_field_of_highres_imu(bits, gauss, expected):
    columns = table({**letters("", gauss), "fields_updated": bits})
    np.testing.assert_allclose(highres_field_ut(columns, "x", "y", "z"), [expected])


@pytest.mark.parametrize(
    ("devices", "ids"),
    [
        ([(11, 12)], (11, 12)),
        ([(11, 12), (11, 12)], (11, 12)),
        ([(11, 12), (11, 13)], (0, 0)),
        ([(11, 12), (10, 12)], (0, 0)),
        ([NAN], (0, 0)),
    ],
)
def test_ids_are_known_where_they_stay(devices, ids):
    assert same_throughout(np.array(devices, float)) == ids


def test_the_devices_in_use():
    both = {
        "sensors_status_imu": {"accel_device_id_primary": 1, "gyro_device_id_primary": 2},
        "sensor_selection": {"accel_device_id": [3, 3], "gyro_device_id": [4, 4]},
    }
    for names, ids in ((tuple(both), (1, 2)), (("sensor_selection",), (3, 4)), ((), (0, 0))):
        log = MadeLog("ulog", *(MadeMessage(name, both[name]) for name in names))
        assert devices_in_use(log) == ids


@pytest.mark.parametrize("length_us", [10_000, 0])  # 0: not known of this sample
def test_rows_of_a_log_say_how_long_they_are_means(length_us):
    columns = {**axes("gyro_rad", W_B), **axes("accelerometer_m_s2", F_B)}
    (found,) = found_in("ulog", sensor_combined={**columns, "gyro_integral_dt": length_us})
    rows = found.as_rows((5, 6), is_timed=False)
    assert rows[0:2] == (0, "sensor_combined")
    assert (rows.device_ids, rows.is_timed) == ((5, 6), False)
    assert rows.samples.t_us.tolist() == [1_000_000]
    np.testing.assert_array_equal(rows.averaged_us, [length_us])


def test_a_topic_of_single_values_tells_no_averaging_time_and_no_device():
    (found,) = found_in("ulog", sensor_gyro=letters("", W_B))
    assert found.as_rows().averaged_us is None
    assert found.as_rows().is_timed
    assert found.device_ids == (0, 0)

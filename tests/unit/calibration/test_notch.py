"""Notches from spectra: what is in a gyro's samples, and what is in the file."""

import numpy as np
import pytest

from h2nav.calibration.notch import calibrate_notch
from h2nav.recordings.context import Burst, Context, Esc, Series, Span
from tests.unit.calibration.logs import evidence_of_log

RATE_HZ, SECONDS = 1000.0, 20.0
ARMED = (Span(0.0, SECONDS, "armed"),)
ARDUPILOT = {"INS_HNTCH_ENABLE": 0.0}
PX4 = {
    f"IMU_GYRO_NF{i}_{name}": value
    for i in range(2)
    for name, value in (("FRQ", 0.0), ("BW", 20.0))
} | {"IMU_GYRO_DNF_EN": 0.0}


def gyro(imu: int, lines: dict[float, float]) -> list[Burst]:
    """Bursts of a second: noise, and lines of so many rad/s at so many Hz."""
    rng = np.random.default_rng(imu)
    t_s = np.arange(round(RATE_HZ * SECONDS)) / RATE_HZ
    values = 0.003 * rng.standard_normal((len(t_s), 3))
    for hz, size in lines.items():
        values += size * np.sin(2.0 * np.pi * hz * t_s + rng.uniform(0.0, 6.0, 3)[:, None]).T
    pieces = np.split(values, round(SECONDS))
    return [Burst(imu, "gyro", float(i), RATE_HZ, piece) for i, piece in enumerate(pieces)]


def found(*lines, parameters=ARDUPILOT, kind="dataflash", **context):
    t_s = np.arange(0.0, SECONDS, 0.1)
    flight = Context(
        bursts=tuple(burst for imu, own in enumerate(lines) for burst in gyro(imu, own)),
        armed=ARMED,
        throttle=Series(t_s, np.full(len(t_s), 0.32)),
        **context,
    )
    outcome = calibrate_notch([evidence_of_log(flight, parameters, kind=kind)])
    return {change.name: change.new for change in outcome.changes}, " ".join(outcome.left)


def test_a_family_follows_the_throttle():
    values, _ = found({90.0: 0.4, 180.0: 0.2}, {90.5: 0.4, 181.0: 0.2})
    assert values.pop("INS_HNTCH_FREQ") == pytest.approx(90.0, abs=1.0)
    assert values.pop("INS_HNTCH_BW") == pytest.approx(45.0, abs=1.0)
    assert values == {
        "INS_HNTCH_ENABLE": 1.0,
        "INS_HNTCH_HMNCS": 3.0,
        "INS_HNTCH_MODE": 1.0,
        "INS_HNTCH_REF": 0.32,
    }


def test_motors_that_report_their_speed_are_followed():
    t_s = np.arange(0.0, SECONDS)
    escs = tuple(Esc(i, t_s, 5400.0 + 0.0 * t_s, t_s, t_s) for i in range(1, 5))
    lines = {90.0: 0.4, 180.0: 0.2}
    assert found(lines, escs=escs)[0]["INS_HNTCH_MODE"] == 3.0
    values, _ = found(lines, escs=escs, parameters=PX4, kind="ulog")
    assert values == {"IMU_GYRO_DNF_EN": 1.0}


def test_px4_has_two_that_stay():
    values, _ = found({90.0: 0.4, 180.0: 0.2}, parameters=PX4, kind="ulog")
    assert values["IMU_GYRO_NF0_FRQ"] == pytest.approx(90.0, abs=1.0)
    assert values["IMU_GYRO_NF1_FRQ"] == pytest.approx(180.0, abs=1.0)


def test_a_lone_line_gets_one_that_stays():
    values, _ = found({90.0: 0.4})
    assert values["INS_HNTCH_MODE"] == 0.0
    assert "INS_HNTCH_REF" not in values


@pytest.mark.parametrize(
    ("lines", "parameters", "why"),
    [
        (({90.0: 0.4}, {140.0: 0.4}), ARDUPILOT, "not alike"),
        (({90.0: 0.4}, {}), ARDUPILOT, "not alike"),
        (({},), ARDUPILOT, "no line"),
        (({12.0: 0.4},), ARDUPILOT, "none of motors"),
        (({90.0: 0.4},), {"INS_HNTCH_ENABLE": 1.0}, "in use"),
        (({90.0: 0.4},), {}, "not known"),
    ],
)
def test_otherwise_nothing_is_set(lines, parameters, why):
    values, left = found(*lines, parameters=parameters)
    assert not values
    assert why in left


@pytest.mark.parametrize(
    "used", [{"IMU_GYRO_DNF_EN": 1.0}, {"IMU_GYRO_NF0_FRQ": 80.0}, {"IMU_GYRO_NF1_FRQ": 80.0}]
)
def test_a_notch_of_px4_that_is_in_use_stays(used):
    values, left = found({90.0: 0.4}, parameters=PX4 | used, kind="ulog")
    assert not values
    assert "in use" in left

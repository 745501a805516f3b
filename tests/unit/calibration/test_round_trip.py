"""Wrong in, parameters out, loaded and flown again: the autopilot's heading is right then."""

import math
import struct
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.parameter_files import parameters_of
from h2nav.apps.playback import PlaybackOptions
from h2nav.apps.reviewing import evidence_of
from h2nav.calibration.evidence import Evidence
from h2nav.calibration.files import ParameterFormat, written
from h2nav.calibration.imu import OWN_SHARE
from h2nav.calibration.outcome import Calibration, ParameterChange
from h2nav.calibration.vehicle import calibrate
from h2nav.maths.units import DEG
from h2nav.recordings.opening import open_flight
from h2nav.sim.autopilot import AutopilotOptions, FakeAutopilot
from h2nav.sim.calibrations import FULL_CURRENT_A, Miscalibration
from h2nav.sim.scenarios import scenario
from h2nav.wire.codec import Encoder

UNIX_NS = 1_790_000_000_000_000_000
RATES_HZ = {
    mavlink.MAVLINK_MSG_ID_RAW_IMU: 50.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 20.0,
    mavlink.MAVLINK_MSG_ID_SIMSTATE: 20.0,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 5.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 10.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 5.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 2.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 5.0,
}
ERRORS_HZ = {
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 20.0,
    mavlink.MAVLINK_MSG_ID_SIMSTATE: 20.0,
}
SECONDS = 85.0  # five rounds; the fits want a minute of flight


class Flown(NamedTuple):
    """A flight of the fake autopilot: its recording, and the rms errors of its attitude."""

    path: Path
    heading_error_deg: float
    tilt_error_deg: float


def flown(path: Path, options: AutopilotOptions, rates_hz: Mapping[int, float] = RATES_HZ) -> Flown:
    autopilot = FakeAutopilot(options)
    autopilot.advance(UNIX_NS)
    for message_id, rate_hz in rates_hz.items():
        autopilot.streams.set_interval(UNIX_NS, message_id, round(1e9 / rate_hz))
    asks = mavlink.MAVLink_param_request_list_message(1, 1)
    autopilot.on_message(UNIX_NS, 255, 190, asks.get_msgId(), asks)
    encoder, said, errors = Encoder(1, 1), None, []
    with path.open("wb") as out:
        for t_ns in range(UNIX_NS, UNIX_NS + round(SECONDS * 1e9), 10_000_000):
            for sent_ns, _, _, message in autopilot.advance(t_ns):
                out.write(struct.pack(">Q", sent_ns // 1000) + encoder.encode(message))
                if isinstance(message, mavlink.MAVLink_attitude_message):
                    said = message
                elif isinstance(message, mavlink.MAVLink_simstate_message) and said is not None:
                    pairs = (said.yaw, message.yaw), (said.roll, message.roll)
                    pairs = (*pairs, (said.pitch, message.pitch))
                    errors.append([math.remainder(one - other, math.tau) for one, other in pairs])
    yaw, roll, pitch = np.sqrt(np.mean(np.square(errors), axis=0)) / DEG
    return Flown(path, float(yaw), math.hypot(roll, pitch))


def shown(path: Path) -> Evidence:
    return evidence_of(open_flight(path), PlaybackOptions(), {})


def calibrated(path: Path):
    return calibrate([shown(path)])


def wrongs() -> list[Miscalibration]:
    """Two vehicles: a compass as it should be mounted, and one that is turned."""
    rng = np.random.default_rng(26)

    def drawn(low: float, high: float, count: int = 3) -> tuple[float, ...]:
        return tuple((rng.choice((-1.0, 1.0), count) * rng.uniform(low, high, count)).tolist())

    five = [
        Miscalibration(
            drawn(90.0, 250.0),
            float(rng.choice((0.0, 0.0, 90.0, 180.0, 270.0))),
            accelerometer_offset_m_s2=(*drawn(0.3, 0.6, 2), 0.0),
            gyro_offset_deg_s=drawn(0.5, 1.5),
            board_deg=drawn(2.0, 4.0, 2),
        )
        for _ in range(5)
    ]
    return [five[0], five[4]]


def expected(wrong: Miscalibration, seed: int) -> dict[str, float]:
    """The parameters that undo it."""
    vehicle = FakeAutopilot(AutopilotOptions(scenario("flight"), seed=seed)).vehicle
    board = [angle * DEG for angle in wrong.board_deg]
    bias = np.array(wrong.gyro_offset_deg_s) * DEG + vehicle.gyro_bias(0)
    values = {"AHRS_TRIM_X": board[0], "AHRS_TRIM_Y": board[1]}
    for i, axis in enumerate("XYZ"):
        values[f"COMPASS_OFS_{axis}"] = -wrong.compass_offset_mg[i]
        values[f"INS_ACCOFFS_{axis}"] = wrong.accelerometer_offset_m_s2[i]
        values[f"INS_GYROFFS_{axis}"] = float(bias[i])
    return values


@pytest.mark.thorough
@pytest.mark.parametrize("wrong", wrongs())
def test_loaded_and_flown_again_the_attitude_is_right(wrong, tmp_path):
    options = AutopilotOptions(scenario("flight"), seed=3, wrong=wrong)
    before = flown(tmp_path / "before.tlog", options)
    found = calibrated(before.path)
    values = parameters_of(written(found, ParameterFormat.ARDUPILOT).splitlines(), "fix")
    after = flown(tmp_path / "after.tlog", replace(options, parameters=values))
    assert before.heading_error_deg > 10.0 * after.heading_error_deg
    # An offset and a board that is tilted may make up for each other.
    assert after.tilt_error_deg < min(0.7, before.tilt_error_deg)
    assert values.get("COMPASS_ORIENT", 0.0) == wrong.compass_turned_deg / 45.0
    true = expected(wrong, options.seed)
    for change in found.changes:
        if change.name in true:
            assert abs(change.new - true[change.name]) < 3.0 * change.sigma, change
    assert {"INS_ACCOFFS_X", "INS_ACCOFFS_Y", "INS_GYROFFS_X", "AHRS_TRIM_X"} <= set(values)
    # What is right stays as it is.
    assert not calibrated(after.path).changes


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """The flight of a compass without a fault, for its noise and its latency."""
    almost = Miscalibration((0.1, 0.0, 0.0))
    options = AutopilotOptions(scenario("aggressive"), seed=4, wrong=almost)
    return flown(tmp_path_factory.mktemp("sound") / "sound.tlog", options, ERRORS_HZ)


DISTURBED = AutopilotOptions(
    scenario("aggressive"),
    seed=4,
    wrong=Miscalibration((100.0, -60.0, 40.0), motor_field_mg=(-260.0, 180.0, 120.0)),
)


@pytest.fixture(scope="module")
def disturbed(tmp_path_factory):
    """The flight of a compass that the motors disturb, and what it shows."""
    before = flown(tmp_path_factory.mktemp("disturbed") / "before.tlog", DISTURBED)
    return before, shown(before.path)


@pytest.mark.thorough
@pytest.mark.parametrize("motct", [1.0, 2.0])
def test_motors_that_disturb_the_compass_are_compensated(motct, sound, disturbed, tmp_path):
    # The lever in use stays; without one, throttle and current would show the same here.
    parameters = {"COMPASS_MOTCT": motct}
    before, found = disturbed
    found = found._replace(parameters=found.parameters | parameters)
    changes = {c.name: c for c in calibrate([found]).outcomes[0].changes}
    values = parameters | {name: change.new for name, change in changes.items()}
    full = {1.0: 1.0, 2.0: FULL_CURRENT_A}[motct]
    for axis, field in zip("XYZ", DISTURBED.wrong.motor_field_mg, strict=True):
        change = changes[f"COMPASS_MOT_{axis}"]
        assert abs(full * change.new + field) < full * 3.0 * change.sigma + 5.0
    after = flown(tmp_path / "after.tlog", replace(DISTURBED, parameters=values), ERRORS_HZ)
    assert before.heading_error_deg > 5.0 * after.heading_error_deg
    # Noise and latency of the compass and the estimator's own error: those of a sound compass.
    own = sound.heading_error_deg**2
    left = math.sqrt(max(after.heading_error_deg**2 - own, 0.0))
    assert math.sqrt(before.heading_error_deg**2 - own) > 10.0 * max(left, 0.1)


@pytest.mark.thorough
def test_two_flights_of_a_vehicle_show_more_than_one(tmp_path):
    wrong = Miscalibration(accelerometer_offset_m_s2=(0.4, -0.35, 0.0))
    options = AutopilotOptions(scenario("flight"), seed=5, wrong=wrong)
    flights = []
    for seed in (5, 6):
        flights.append(shown(flown(tmp_path / f"{seed}.tlog", replace(options, seed=seed)).path))
    alone = [_offset(calibrate([one])) for one in flights]
    together = _offset(calibrate(flights))
    for place, true in enumerate(wrong.accelerometer_offset_m_s2[:2]):
        assert abs(together[place].new - true) < 3.0 * together[place].sigma
        assert _shown(together[place]) < min(_shown(one[place]) for one in alone)


def _shown(change: ParameterChange) -> float:
    """Its deviation by what the flights show; the rest is a share of the value, in every flight."""
    return math.sqrt(change.sigma**2 - (OWN_SHARE * change.new) ** 2)


def _offset(found: Calibration) -> list[ParameterChange]:
    """Of the accelerometer, x and y."""
    return [change for change in found.changes if change.name.startswith("INS_ACCOFFS_")]

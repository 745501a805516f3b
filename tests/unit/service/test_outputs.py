import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.velocity_witness import Verdicts
from h2nav.integrity.witness import AttitudeSource, Comparison
from h2nav.service.outputs import Assessment, Outputs
from h2nav.service.settings import OutputSettings

YAW_EAST = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))


def estimate(t_us, q_nb=YAW_EAST):
    zero = (0.0, 0.0, 0.0)
    return AttitudeEstimate(t_us, q_nb, (0.1, 0.2, 0.3), zero, zero, 0.01, Trust.ALIGNED)


def counts(outputs, rate_hz, seconds):
    names = [
        message.get_type()
        for i in range(round(rate_hz * seconds))
        for message in outputs.due(estimate(round(i * 1e6 / rate_hz)))
    ]
    return names.count("ATTITUDE"), names.count("ATTITUDE_QUATERNION")


@pytest.mark.parametrize(("imu_hz", "att_hz"), [(100.0, 50.0), (400.0, 100.0), (99.0, 33.0)])
def test_rates_are_kept(imu_hz, att_hz):
    outputs = Outputs(OutputSettings(attitude_rate_hz=att_hz, attitude_quaternion_rate_hz=0.0))
    sent, quaternions = counts(outputs, imu_hz, 10.0)
    assert sent == pytest.approx(10.0 * att_hz, abs=2)
    assert quaternions == 0


def test_a_rate_above_the_samples_sends_every_sample_once():
    outputs = Outputs(OutputSettings(attitude_rate_hz=1000.0, attitude_quaternion_rate_hz=1000.0))
    assert counts(outputs, 100.0, 1.0) == (100, 100)


def test_messages_that_nobody_gets_are_counted_and_not_made():
    settings = OutputSettings(attitude_rate_hz=50.0, attitude_quaternion_rate_hz=20.0)
    heard, unheard = Outputs(settings), Outputs(settings, has_listener=False)
    assert sum(counts(heard, 100.0, 2.0)) == heard.sent > 100
    assert counts(unheard, 100.0, 2.0) == (0, 0)
    assert unheard.sent == heard.sent


def test_nothing_stale_is_handed_out():
    outputs = Outputs(OutputSettings())
    list(outputs.due(estimate(0)))
    assert outputs.latest(mavlink.MAVLINK_MSG_ID_ATTITUDE)
    outputs.forget()
    assert not outputs.latest(mavlink.MAVLINK_MSG_ID_ATTITUDE)


def test_late_estimates_are_held_back_and_not_handed_out():
    outputs = Outputs(OutputSettings(attitude_rate_hz=100.0))
    outputs.hold(are_late=True)
    assert list(outputs.due(estimate(0))) == []
    assert not outputs.latest(mavlink.MAVLINK_MSG_ID_ATTITUDE)
    outputs.hold(are_late=False)
    assert [m.get_type() for m in outputs.due(estimate(10_000))] == ["ATTITUDE"]
    assert outputs.sent == 1


def test_rates_follow_time_over_an_epoch_change():
    outputs = Outputs(OutputSettings(attitude_rate_hz=50.0, attitude_quaternion_rate_hz=0.0))
    counts(outputs, 100.0, 1.0)
    assert counts(outputs, 100.0, 1.0)[0] == pytest.approx(50, abs=2)


def status(trust, **assessment):
    outputs = Outputs(OutputSettings(), assess=lambda: Assessment(**assessment))
    (message,) = [
        message
        for message in outputs.due(estimate(0)._replace(trust=trust))
        if message.get_type() == "ESTIMATOR_STATUS"
    ]
    return message


def alarm(kind, sensor=SensorKind.IMU, degrades=False):
    return Alarm(kind, Sensor(sensor), Severity.ERROR, 1.0, "deg", "text", "evidence", degrades)


CONVERGED = Trust.ALIGNED | Trust.CONVERGED


@pytest.mark.parametrize(
    ("trust", "alarms", "flags"),
    [
        (Trust.ALIGNED, (), 0),
        (CONVERGED, (), mavlink.ESTIMATOR_ATTITUDE),
        (CONVERGED, (alarm(Kind.VIBRATION),), mavlink.ESTIMATOR_ATTITUDE),
        (CONVERGED, (alarm(Kind.GYRO_FROZEN, degrades=True),), 0),
        (Trust.VELOCITY_USED, (), mavlink.ESTIMATOR_VELOCITY_HORIZ),
        (Trust(0), (alarm(Kind.ATTITUDE_VELOCITY, SensorKind.GPS),), mavlink.ESTIMATOR_GPS_GLITCH),
        (Trust(0), (alarm(Kind.ACCELEROMETER_FROZEN),), mavlink.ESTIMATOR_ACCEL_ERROR),
    ],
)
def test_the_status_says_what_is_known_and_what_is_wrong(trust, alarms, flags):
    assert status(trust, alarms=alarms).flags == flags


def test_the_status_carries_the_ratios_at_one_hertz():
    message = status(CONVERGED, ratios=InnovationRatios(velocity_1s=0.3, velocity_10s=0.7))
    assert (message.vel_ratio, message.mag_ratio) == (0.7, 0.0)
    outputs = Outputs(OutputSettings())
    sent = [m.get_type() for i in range(1000) for m in outputs.due(estimate(i * 10_000))]
    assert sent.count("ESTIMATOR_STATUS") == pytest.approx(10, abs=1)


def test_the_differences_go_out_when_there_are_any():
    found = Assessment()
    outputs = Outputs(OutputSettings(difference_rate_hz=10.0), assess=lambda: found)
    list(outputs.due(estimate(0)))
    assert outputs.latest(mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT) == ()
    found = Assessment(
        difference=Comparison(5_000, AttitudeSource.AUTOPILOT, 0.1, -0.2, 0.01, 0.02, Verdicts())
    )
    tilt, heading = outputs.latest(mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT)
    assert (tilt.name, tilt.value) == ("h2_tiltdif", pytest.approx(math.degrees(0.1)))
    assert (heading.name, heading.value) == ("h2_yaw_dif", pytest.approx(-math.degrees(0.2)))


def test_the_covariance_is_off_by_default():
    asked = OutputSettings(attitude_covariance_rate_hz=5.0)
    for settings, count in ((OutputSettings(), 0), (asked, 5)):
        outputs = Outputs(settings)
        sent = [m.get_type() for i in range(100) for m in outputs.due(estimate(i * 10_000))]
        assert sent.count("ATTITUDE_QUATERNION_COV") == pytest.approx(count, rel=0.2)

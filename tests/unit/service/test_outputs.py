import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.preflight import GroundFault, GroundVerdict, Item
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.velocity_witness import Verdicts
from h2nav.integrity.witness import AttitudeSource, Comparison
from h2nav.motion.samples import OdometryRecord, PoseFrame
from h2nav.service.outputs import Assessment, Outputs, SentMotion
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


ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE
NOTHING = {"attitude_quaternion_rate_hz": 0.0, "estimator_status_rate_hz": 0.0}
GYRO_FAULT = GroundFault(Item.GYRO, "IMU 1", 4.0, "deg/s", 2.0)


def sent_at(times_us, rate_hz):
    """The times of those that are sent."""
    outputs = Outputs(OutputSettings(attitude_rate_hz=rate_hz, **NOTHING))
    return [t_us for t_us in times_us if outputs.due(estimate(t_us))]


@pytest.mark.parametrize(
    ("times_us", "sent_us"),
    [
        # a period of 100 ms: a quarter of it early is now
        ([0, 74_999, 75_000], [0, 75_000]),
        ([0, 74_999, 75_001], [0, 75_001]),
        # from then on by the period, not by when it was sent
        ([0, 75_001, 174_999, 175_001], [0, 75_001, 175_001]),
        ([0, 190_000, 200_000, 300_000], [0, 190_000, 200_000, 300_000]),
        # what is due is followed over two periods and 0.1 s; beyond, it begins anew
        ([0, 400_000, 401_000], [0, 400_000, 401_000]),
        ([0, 400_001, 401_000], [0, 400_001]),
        ([1_000_000, 800_000, 800_001], [1_000_000]),
        ([1_000_000, 799_999, 800_001], [1_000_000, 799_999]),
    ],
)
def test_when_a_sample_is_due(times_us, sent_us):
    assert sent_at(times_us, 10.0) == sent_us


@pytest.mark.parametrize(
    ("asked_hz", "rate_hz"), [(-1.0, 0.0), (0.0, 0.0), (999.0, 999.0), (1000.1, 1000.0)]
)
def test_a_rate_is_set_within_limits_and_the_usual_one_stays_known(asked_hz, rate_hz):
    outputs = Outputs(OutputSettings(attitude_rate_hz=50.0, **NOTHING))
    outputs.due(estimate(0))
    outputs.set_rate(ATTITUDE, asked_hz)
    assert (outputs.rate_hz(ATTITUDE), outputs.default_hz(ATTITUDE)) == (rate_hz, 50.0)
    assert bool(outputs.due(estimate(1))) is (rate_hz > 0.0)  # from the next one on


@pytest.mark.parametrize(
    ("odometry_rate_hz", "more"), [(None, set()), (0.0, {mavlink.MAVLINK_MSG_ID_ODOMETRY})]
)
def test_what_is_offered(odometry_rate_hz, more):
    outputs = Outputs(OutputSettings(), odometry_rate_hz)
    offered = {message_id for message_id in mavlink.mavlink_map if outputs.offers(message_id)}
    assert offered - more == {
        ATTITUDE,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION_COV,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
        mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT,
    }
    assert more <= offered
    assert not outputs.latest(mavlink.MAVLINK_MSG_ID_RAW_IMU)


def test_attitudes_are_counted_and_nothing_else():
    every_hz = dict.fromkeys(
        (
            "attitude_rate_hz",
            "attitude_quaternion_rate_hz",
            "attitude_covariance_rate_hz",
            "estimator_status_rate_hz",
            "difference_rate_hz",
        ),
        10.0,
    )
    found = Assessment(
        difference=Comparison(5_000, AttitudeSource.AUTOPILOT, 0.1, -0.2, 0.01, 0.02, Verdicts())
    )
    outputs = Outputs(OutputSettings(**every_hz), assess=lambda: found)
    assert [message.get_type() for message in outputs.due(estimate(0))] == [
        "ATTITUDE",
        "ATTITUDE_QUATERNION",
        "ATTITUDE_QUATERNION_COV",
        "ESTIMATOR_STATUS",
        "NAMED_VALUE_FLOAT",
        "NAMED_VALUE_FLOAT",
    ]
    assert outputs.sent == 3


@pytest.mark.parametrize(
    ("faults", "alarms", "flags"),
    [
        ((GYRO_FAULT,), (), 0),  # an attitude that is doubted before arming is none
        ((GYRO_FAULT._replace(item=Item.GPS),), (), mavlink.ESTIMATOR_GPS_GLITCH),
        ((GYRO_FAULT._replace(item=Item.ACCELEROMETER),), (), mavlink.ESTIMATOR_ACCEL_ERROR),
        ((GYRO_FAULT._replace(item=Item.ACCELEROMETERS_APART),), (),
         mavlink.ESTIMATOR_ACCEL_ERROR),
        ((GYRO_FAULT._replace(item=Item.VIBRATION),), (), mavlink.ESTIMATOR_ACCEL_ERROR),
        ((), (alarm(Kind.IMU_FROZEN),),
         mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_ACCEL_ERROR),
        ((), (alarm(Kind.ATTITUDE_GRAVITY),),
         mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_ACCEL_ERROR),
        ((), (alarm(Kind.GYRO_FROZEN),), mavlink.ESTIMATOR_ATTITUDE),
        ((), (alarm(Kind.GPS_JUMP, SensorKind.GPS, True),), mavlink.ESTIMATOR_GPS_GLITCH),
    ],
)  # fmt: skip
def test_the_status_names_what_is_wrong_on_the_ground_and_in_flight(faults, alarms, flags):
    found = status(CONVERGED, alarms=alarms, on_ground=GroundVerdict(faults))
    assert found.flags == flags


@pytest.mark.parametrize(
    ("trust", "is_attitude"),
    [(Trust.ALIGNED, False), (Trust.CONVERGED, False), (CONVERGED | Trust.REST, True)],
)
def test_an_attitude_is_one_when_it_has_converged(trust, is_attitude):
    assert bool(status(trust).flags & mavlink.ESTIMATOR_ATTITUDE) is is_attitude


def test_odometry_is_timed_and_forgotten_by_itself():
    outputs = Outputs(OutputSettings(), 10.0)
    zero = (0.0, 0.0, 0.0)
    record = OdometryRecord(
        0, PoseFrame.LOCAL_FRD, YAW_EAST, zero, zero, zero, (0.0,) * 21, (0.0,) * 21, 0
    )
    times_us = (0, 50_000, 100_000)
    motions = [SentMotion(record._replace(t_us=t_us), 3, 50) for t_us in times_us]
    assert [len(outputs.due_odometry(motion)) for motion in motions] == [1, 0, 1]
    outputs.due(estimate(100_000))
    odometry_id = mavlink.MAVLINK_MSG_ID_ODOMETRY
    (latest,) = outputs.latest(odometry_id)
    assert (latest.time_usec, latest.quality) == (100_000, 50)
    outputs.forget_odometry()
    assert outputs.latest(odometry_id) == ()
    assert outputs.latest(ATTITUDE)
    outputs.due_odometry(motions[0])
    outputs.forget()
    assert outputs.latest(odometry_id) == outputs.latest(ATTITUDE) == ()

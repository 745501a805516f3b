"""The twist observer in the service: whose poses it gets, and when what it says is published."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Trust
from h2nav.integrity.findings import Severity
from h2nav.maths.quaternion import from_euler
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.motion.samples import PoseFrame
from h2nav.service.autopilot import Autopilot
from h2nav.service.effects import Notice, Record, Send
from h2nav.service.motion import NoMotion, motion_for, odometry_rate_hz
from h2nav.service.motion_output import REFUSED_IN_A_ROW
from h2nav.service.outputs import Outputs
from h2nav.service.settings import (
    AutopilotSettings,
    MotionSettings,
    OutputSettings,
    ServiceSettings,
)
from h2nav.wire.motion import POSE_OF_AUTOPILOT, PoseReading, WheelDistances
from h2nav.wire.readers import Envelope
from h2nav.wire.vehicle import Heartbeat

POSE, MOCAP = mavlink.MAVLINK_MSG_ID_ODOMETRY, mavlink.MAVLINK_MSG_ID_ATT_POS_MOCAP
VISION = mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE
WHEELS = mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE
CAMERA, OTHER = (1, 197), (1, 198)
LEVEL, ZERO = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
START_US = 50_000_000


class Bench:
    """A vehicle 1/1 at rest with samples at 100 Hz; a camera sends poses at 20 Hz."""

    def __init__(self, q_nb=LEVEL, **settings):
        autopilot = Autopilot(AutopilotSettings())
        autopilot.take_heartbeat(0, (1, 1), Heartbeat(3, 2, is_armed=False))
        chosen = ServiceSettings(motion=MotionSettings("twist", **settings))
        outputs = Outputs(OutputSettings(), 20.0)
        self.motion = motion_for(chosen, autopilot, outputs, self._tell, 0)
        self.q_nb, self.t_us, self.told = q_nb, START_US, []

    def _tell(self, _t_ns, severity, text, _cause=""):
        self.told.append((severity, text))
        return [Notice(severity, text)]

    def sample(self, f_b=(0.0, 0.0, -GRAVITY_M_S2), *, aligned=True):
        self.t_us += 10_000
        estimate = AttitudeEstimate(self.t_us, self.q_nb, ZERO, ZERO, ZERO, 0.01, Trust.ALIGNED)
        taken = ImuSample(self.t_us, ZERO, f_b)
        return self.motion.on_sample(1000 * self.t_us, taken, estimate if aligned else None)

    def envelope(self, sender=CAMERA, message_id=POSE):
        return Envelope(1000 * self.t_us, 1000 * self.t_us, sender, message_id)

    def pose(self, sender=CAMERA, message_id=POSE, late_us=0, p_o=ZERO):
        reading = PoseReading(self.t_us - late_us, LEVEL, p_o, PoseFrame.LOCAL_FRD, 0)
        return self.motion.on_message(self.envelope(sender, message_id), reading)

    def rests(self, seconds, *, poses=True, f_b=(0.0, 0.0, -GRAVITY_M_S2)):
        effects = []
        for number in range(round(100 * seconds)):
            effects += self.sample(f_b)
            if poses and number % 5 == 0:
                effects += self.pose()
        return effects


def topics(effects):
    return [effect.topic for effect in effects if isinstance(effect, Record)]


@pytest.mark.parametrize(
    ("chosen", "message_ids"),
    [
        ("auto", {POSE, VISION, MOCAP}),
        ("ODOMETRY", {POSE}),
        ("VISION_POSITION_ESTIMATE", {VISION}),
        ("ATT_POS_MOCAP", {MOCAP}),
    ],
)
def test_poses_are_taken_from_the_chosen_message(chosen, message_ids):
    motion = Bench(pose_message=chosen).motion
    assert (motion.is_estimated, motion.message_ids) == (True, message_ids)
    assert motion.wanted_streams == ()  # of a camera, not of the autopilot


def test_before_the_first_attitude_a_pose_is_counted_alone():
    bench = Bench()
    assert bench.sample(aligned=False) == []
    assert bench.pose() == []
    assert bench.motion.rejected == {"pose_before_attitude": 1}
    bench.sample()
    assert topics(bench.pose()) == ["/pose_measured"]
    assert bench.motion.rejected == {"pose_before_attitude": 1}


def test_a_vehicle_at_rest_stays_where_its_poses_are():
    bench = Bench()
    effects = bench.rests(2.0)
    sent = [effect for effect in effects if isinstance(effect, Send)]
    assert len(sent) == pytest.approx(40, abs=2)
    assert {(send.system_id, send.message.get_type()) for send in sent} == {(1, "ODOMETRY")}
    assert {send.message.estimator_type for send in sent} == {mavlink.MAV_ESTIMATOR_TYPE_VIO}
    latest = bench.motion.latest
    assert latest.t_us == bench.t_us
    assert (*latest.p_o, *latest.v_b) == pytest.approx((0.0,) * 6, abs=1e-6)
    assert bench.told == [(Severity.INFO, "odometry from poses")]
    assert bench.motion.rejected == {}


def test_gravity_is_taken_off_along_the_attitude_of_the_filter():
    roll = math.radians(30.0)
    leaning = (0.0, -GRAVITY_M_S2 * math.sin(roll), -GRAVITY_M_S2 * math.cos(roll))
    bench = Bench(from_euler(roll, 0.0, 1.0))
    bench.rests(0.2)
    for _ in range(50):
        bench.sample(leaning)
    moved = Bench(from_euler(roll, 0.0, 1.0))
    moved.rests(0.2, f_b=leaning)
    for _ in range(50):
        moved.sample(leaning)
    assert moved.motion.latest.v_b == pytest.approx(ZERO, abs=1e-6)
    assert math.dist(bench.motion.latest.v_b, ZERO) > 0.1


def test_quality_falls_with_the_age_of_the_pose_until_it_is_stale():
    bench = Bench()
    bench.rests(0.5)
    age_s, quality = [], []
    for _ in range(197):
        for effect in bench.sample():
            if isinstance(effect, Send):
                quality.append(effect.message.quality)
                age_s.append(bench.motion.latest.pose_age_s)
    wanted = [max(1.0, 100.0 - 50.0 * age) for age in age_s]
    assert quality == [pytest.approx(one, abs=0.501) for one in wanted]
    assert (quality[0] > 95, quality[-1]) == (True, 1)  # 0 is an unknown one
    while bench.motion.latest is not None:
        assert bench.motion.latest.pose_age_s <= 2.0
        bench.sample()
    assert bench.told[-1][1] == "odometry from poses"
    for _ in range(51):
        bench.sample()
    assert bench.told[-1] == (Severity.WARNING, "no ODOMETRY: no poses")


def test_another_source_is_counted_until_the_first_has_been_silent():
    bench = Bench()
    bench.rests(0.2)
    assert bench.pose(OTHER) == bench.pose(CAMERA, MOCAP) == []
    assert bench.motion.on_refusal(bench.envelope(OTHER), "pose_failed") == []
    assert bench.motion.rejected == {"pose_other_source": 3}
    bench.pose((2, 197))  # of another vehicle
    bench.motion.on_refusal(bench.envelope((2, 197)), "pose_failed")
    wheels = WheelDistances(bench.t_us, (0.0, 0.0))
    assert bench.motion.on_message(bench.envelope(CAMERA, WHEELS), wheels) == []
    assert bench.motion.rejected == {"pose_other_source": 3}
    resets = bench.motion.latest.reset_counter
    bench.rests(5.2, poses=False)
    for _ in range(3):
        bench.pose(OTHER)
        bench.sample()
    assert bench.motion.latest.reset_counter > resets
    assert bench.motion.rejected["pose_other_source"] == 3


def test_refusals_in_a_row_are_told_and_the_autopilots_own_poses_are_none():
    bench = Bench()
    bench.rests(0.2)
    bench.told.clear()
    for reason in [POSE_OF_AUTOPILOT] * 20 + ["pose_failed"] * (REFUSED_IN_A_ROW - 1):
        assert bench.motion.on_refusal(bench.envelope(), reason) == []
    assert bench.motion.on_refusal(bench.envelope(), "pose_failed") != []
    assert bench.told == [(Severity.WARNING, "poses refused: pose_failed")]
    assert bench.motion.rejected == {POSE_OF_AUTOPILOT: 20, "pose_failed": REFUSED_IN_A_ROW}


def test_poses_that_the_observer_refuses_are_logged_counted_and_told():
    bench = Bench()
    bench.rests(0.5)
    bench.told.clear()
    effects = []
    for _ in range(REFUSED_IN_A_ROW):
        effects += bench.pose(late_us=600_000)
    assert topics(effects) == ["/pose_measured"] * REFUSED_IN_A_ROW
    records = [effect.record for effect in effects if isinstance(effect, Record)]
    assert {record.verdict for record in records} == {"pose_not_later"}
    assert {record.age_ms for record in records} == {600.0}
    assert bench.motion.rejected == {"pose_not_later": REFUSED_IN_A_ROW}
    assert bench.told == [(Severity.WARNING, "poses refused: pose_not_later")]


def test_a_stray_time_is_refused_without_a_record():
    bench = Bench()
    bench.rests(0.2)
    assert bench.pose(late_us=-77_000_000_000) == []
    assert bench.motion.rejected == {"pose_stray_time": 1}


def test_after_a_restart_poses_wait_for_an_attitude_again():
    bench = Bench()
    bench.rests(0.2)
    bench.motion.restart()
    assert bench.motion.latest is None
    assert bench.pose() == []
    assert bench.motion.rejected == {"pose_before_attitude": 1}


def test_motion_that_is_not_estimated_does_nothing():
    settings = ServiceSettings()
    motion = motion_for(settings, None, None, None, 0)
    assert isinstance(motion, NoMotion)
    assert (motion.is_estimated, motion.message_ids, motion.wanted_streams) == (
        False,
        frozenset(),
        (),
    )
    assert motion.rejected == {}
    envelope = Envelope(0, 0, CAMERA, POSE)
    assert motion.on_message(envelope, None) == motion.on_refusal(envelope, "why") == []
    assert motion.on_sample(0, None, None) == []
    motion.restart()
    assert odometry_rate_hz(settings) is None


@pytest.mark.parametrize(
    ("odometry_hz", "wheels_hz"), [(0.0, 20.0), (20.0, 20.0), (21.0, 21.0), (1000.0, 1000.0)]
)
def test_wheel_distances_are_wanted_as_often_as_odometry_and_twenty_times_a_second(
    odometry_hz, wheels_hz
):
    chosen = ServiceSettings(motion=MotionSettings("wheels", odometry_rate_hz=odometry_hz))
    assert odometry_rate_hz(chosen) == odometry_hz
    outputs = Outputs(OutputSettings(), odometry_hz)
    motion = motion_for(chosen, Autopilot(AutopilotSettings()), outputs, None, 0)
    (stream,) = motion.wanted_streams
    assert (stream.message_id, stream.rate_hz, stream.is_optional) == (WHEELS, wheels_hz, False)
    assert motion.message_ids == {WHEELS}


def test_only_the_chosen_component_sends_poses():
    bench = Bench(pose_component_id=198)
    bench.sample()
    assert bench.pose(CAMERA) == []
    assert bench.pose(OTHER)
    assert bench.motion.rejected == {"pose_other_source": 1}

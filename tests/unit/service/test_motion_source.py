"""Whose poses and wheels count, and what is told when they cease to."""

from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import Vec3
from h2nav.integrity.findings import Severity
from h2nav.motion.samples import OdometryRecord, PoseFrame
from h2nav.service.autopilot import Identity
from h2nav.service.effects import Notice, Record, Send
from h2nav.service.motion_output import (
    LASTING_NS,
    REFUSED_IN_A_ROW,
    OdometryOut,
    RefusalStreak,
    is_finite,
)
from h2nav.service.motion_source import SILENT_NS, MotionSource
from h2nav.service.outputs import Outputs, SentMotion
from h2nav.service.settings import OutputSettings

CAMERA, OTHER = (1, 197), (1, 198)
POSE, MOCAP = mavlink.MAVLINK_MSG_ID_ODOMETRY, mavlink.MAVLINK_MSG_ID_ATT_POS_MOCAP
COPTER = Identity(1, 1, mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_TYPE_QUADROTOR)
ZERO: Vec3 = (0.0, 0.0, 0.0)


def reported(t_ns, severity, text, cause=""):
    return [Notice(severity, text, cause)]


def source(component_id=0, identity=COPTER):
    return MotionSource(SimpleNamespace(identity=identity), 191, component_id)


@pytest.mark.parametrize(
    ("sender", "is_one"), [((1, 197), True), ((1, 1), True), ((1, 191), False), ((2, 197), False)]
)
def test_a_source_is_another_component_of_the_vehicle(sender, is_one):
    assert source().is_of_vehicle(sender) is is_one
    assert not source(identity=None).is_of_vehicle(sender)


def test_the_first_source_stays_until_it_has_long_been_silent():
    one = source()
    assert not one.heard(0, CAMERA, POSE)
    for sender, message_id in ((OTHER, POSE), (CAMERA, MOCAP)):
        assert not one.may_be(SILENT_NS, sender, message_id)
        assert one.may_be(SILENT_NS + 1, sender, message_id)
    assert one.may_be(0, CAMERA, POSE)
    assert not one.heard(SILENT_NS, CAMERA, POSE)
    assert not one.may_be(SILENT_NS + 1, OTHER, POSE)
    assert one.heard(2 * SILENT_NS + 1, OTHER, POSE)
    assert not one.may_be(2 * SILENT_NS + 1, CAMERA, POSE)


def test_a_configured_component_alone_may_be_the_source():
    assert source(197).may_be(0, CAMERA, POSE)
    assert not source(197).may_be(0, OTHER, POSE)


def test_refusals_in_a_row_are_told_once():
    streak = RefusalStreak("poses", reported)
    told = [streak.refused(n, "why") for n in range(3 * REFUSED_IN_A_ROW)]
    assert [n for n, notices in enumerate(told) if notices] == [REFUSED_IN_A_ROW - 1]
    streak.good()
    assert not any(streak.refused(n, "why") for n in range(REFUSED_IN_A_ROW - 1))
    assert streak.refused(0, "why") == reported(0, Severity.WARNING, "poses refused: why")


def moved(t_us, resets=0, x_m=0.0):
    record = OdometryRecord(
        t_us, PoseFrame.LOCAL_FRD, (1.0, 0.0, 0.0, 0.0), (x_m, 0.0, 0.0), ZERO, ZERO,
        (0.01,) * 21, (0.01,) * 21, resets,
    )  # fmt: skip
    return SentMotion(record, mavlink.MAV_ESTIMATOR_TYPE_VIO, 50)


def out_with(identity=COPTER):
    outputs = Outputs(OutputSettings(), 20.0)
    return OdometryOut(SimpleNamespace(identity=identity), outputs, "poses", reported), outputs


def kinds(effects):
    return [type(effect) for effect in effects]


def test_what_is_due_is_sent_and_logged_and_the_first_is_told():
    out, _ = out_with()
    assert kinds(out.put(0, moved(0))) == [Send, Record, Notice]
    assert kinds(out.put(1, moved(1_000))) == []
    assert kinds(out.put(2, moved(50_000))) == [Send, Record]
    assert kinds(out.put(3, moved(100_000, resets=1))) == [Send, Record, Notice]
    assert kinds(out.put(4, moved(150_000, resets=1))) == [Send, Record]


def test_late_estimates_are_logged_alone_and_without_a_vehicle_nothing_is():
    out, outputs = out_with()
    outputs.hold(are_late=True)
    assert kinds(out.put(0, moved(0))) == [Record, Notice]
    assert kinds(out_with(None)[0].put(0, moved(0))) == [Notice]


def test_a_lack_that_lasts_is_told_once_and_nothing_stale_is_handed_out():
    out, outputs = out_with()
    assert out.nothing(0) == []
    out.put(0, moved(0))
    assert outputs.latest(POSE)
    assert out.nothing(LASTING_NS) == []
    assert not outputs.latest(POSE)
    told = out.nothing(LASTING_NS + 1)
    assert told == reported(0, Severity.WARNING, "no ODOMETRY: no poses")
    assert out.nothing(LASTING_NS + 2) == []


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_an_estimate_with_a_number_that_is_none_is_not_finite(bad):
    assert is_finite(moved(0))
    assert not is_finite(moved(0, x_m=bad))
    for field in ("pose_covariance", "velocity_covariance"):
        record = moved(0).record._replace(**{field: (*(0.01,) * 20, bad)})
        assert not is_finite(moved(0)._replace(record=record))


def test_a_source_is_silent_after_five_seconds():
    one = source()
    one.heard(7, CAMERA, POSE)
    assert not one.may_be(5_000_000_007, OTHER, POSE)
    assert one.may_be(5_000_000_008, OTHER, POSE)


def test_ten_refusals_in_a_row_and_half_a_second_without_estimates_are_told():
    streak = RefusalStreak("wheel distances", reported)
    assert [bool(streak.refused(n, "why")) for n in range(11)] == [False] * 9 + [True, False]
    out, _ = out_with()
    out.put(7, moved(0))
    assert out.nothing(500_000_007) == []
    assert out.nothing(500_000_008)


def test_what_is_told_of_resets_and_of_a_new_source():
    out, _ = out_with()
    told = [effect for effect in out.put(0, moved(0)) if isinstance(effect, Notice)]
    assert told == [Notice(Severity.INFO, "odometry from poses")]
    told = [effect for effect in out.put(1, moved(50_000, resets=3)) if isinstance(effect, Notice)]
    assert told == [Notice(Severity.NOTICE, "odometry reset, number 3", "odometry")]
    out.nothing(10**12)
    told = [effect for effect in out.put(2, moved(100_000, resets=3)) if isinstance(effect, Notice)]
    assert told == [Notice(Severity.INFO, "odometry from poses")]


def test_odometry_is_sent_as_the_vehicles_system_and_logged_at_its_time():
    out, _ = out_with(COPTER._replace(system_id=9))
    send, record, _ = out.put(0, moved(70_000))
    assert (send.system_id, send.message.time_usec) == (9, 70_000)
    assert (record.topic, record.t_us, record.record.quality) == ("/odometry", 70_000, 50)


@pytest.mark.parametrize("field", ["q", "p_m", "v_b_m_s", "w_b_rad_s"])
def test_every_part_of_an_estimate_has_to_be_finite(field):
    values = getattr(moved(0).record, field)
    for place in range(len(values)):
        bad = tuple(float("nan") if place == n else value for n, value in enumerate(values))
        record = moved(0).record._replace(**{field: bad})
        assert not is_finite(moved(0)._replace(record=record))

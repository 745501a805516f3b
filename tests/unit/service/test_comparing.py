"""Which attitudes of the autopilot are asked for and compared, and which count as its newest."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Trust
from h2nav.integrity.witness import AttitudeSource
from h2nav.maths.units import SECOND_NS
from h2nav.service.comparing import Comparing, wanted_streams
from h2nav.wire.attitude import ReportedAttitude

ATTITUDE, AHRS2 = mavlink.MAVLINK_MSG_ID_ATTITUDE, mavlink.MAVLINK_MSG_ID_AHRS2
ARDUPILOT, PX4 = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4
LEVEL, TILTED = (1.0, 0.0, 0.0, 0.0), (math.cos(0.1), math.sin(0.1), 0.0, 0.0)
ZERO = (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("autopilot", "rate_hz", "streams"),
    [
        (ARDUPILOT, 10.0, [(ATTITUDE, 10.0), (AHRS2, 5.0)]),
        (PX4, 10.0, [(ATTITUDE, 10.0)]),
        (ARDUPILOT, 0.0, []),
        (PX4, 0.5, [(ATTITUDE, 0.5)]),
    ],
)
def test_what_is_asked_for_is_never_worth_more_than_samples(autopilot, rate_hz, streams):
    found = wanted_streams(autopilot, rate_hz)
    assert [(one.message_id, one.rate_hz) for one in found] == streams
    assert all(one.is_optional for one in found)


def test_ten_a_second_of_each_message_are_compared():
    one = Comparing()
    for message_id in (ATTITUDE, AHRS2):
        taken = sum(one.on_arrival(t * 10_000_000, message_id) for t in range(1000))
        assert 100 <= taken <= 102


def test_until_the_next_is_due_none_is_read():
    one = Comparing()
    assert one.idle_until_ns(ATTITUDE) == 0
    t_ns = 5 * SECOND_NS
    while one.on_arrival(t_ns, ATTITUDE):
        pass
    due_ns = one.idle_until_ns(ATTITUDE)
    assert not one.on_arrival(due_ns - 1, ATTITUDE)
    assert one.on_arrival(due_ns, ATTITUDE)
    assert one.idle_until_ns(AHRS2) == 0


@pytest.mark.parametrize(
    ("first_s", "second_s", "now_s", "found"),
    [
        (1.0, 1.5, 2.0, (AttitudeSource.AUTOPILOT, LEVEL)),
        (1.0, 1.5, 3.0, (AttitudeSource.AUTOPILOT, LEVEL)),
        (1.0, 1.5, 3.1, (AttitudeSource.AHRS2, TILTED)),
        (1.0, 1.5, 3.6, None),
        (None, 1.5, 2.0, (AttitudeSource.AHRS2, TILTED)),
        (None, None, 2.0, None),
    ],
)
def test_the_newest_attitude_is_that_of_the_main_estimator_while_it_is_fresh(
    first_s, second_s, now_s, found
):
    one = Comparing()
    for at_s, is_second, q_nb in ((first_s, False, LEVEL), (second_s, True, TILTED)):
        if at_s is not None:
            one.on_report(round(at_s * SECOND_NS), ReportedAttitude(is_second, None, q_nb))
    latest = one.latest(round(now_s * SECOND_NS))
    assert (None if latest is None else latest[1:]) == found


def test_comparisons_are_recorded_in_degrees():
    one, effects = Comparing(), []
    for number in range(1000):
        t_us = 1_000_000 + number * 10_000
        sample = ImuSample(t_us, ZERO, (0.0, 0.0, -9.8))
        estimate = AttitudeEstimate(
            t_us, LEVEL, ZERO, ZERO, ZERO, 0.01, Trust.ALIGNED | Trust.CONVERGED, 0.02
        )
        effects += one.on_sample(sample, estimate)
        if number % 10 == 0:
            effects += one.on_report(t_us * 1000, ReportedAttitude(False, t_us // 1000, TILTED))
    assert effects
    assert {effect.topic for effect in effects} == {"/comparison"}
    last = effects[-1]
    assert last.t_us == last.record.t_us
    assert last.record.tilt_deg == pytest.approx(math.degrees(0.2), abs=0.01)
    assert last.record.heading_deg == pytest.approx(0.0, abs=0.01)
    assert last.record.source == "autopilot"
    assert one.on_sample(ImuSample(99_000_000, ZERO, (0.0, 0.0, -9.8)), None) == []


S = SECOND_NS


@pytest.mark.parametrize(("later_ns", "is_fresh"), [(2 * S, True), (2 * S + 1, False)])
def test_an_attitude_is_fresh_for_two_seconds(later_ns, is_fresh):
    one = Comparing()
    one.on_report(S, ReportedAttitude(False, None, TILTED))
    expected = (S, AttitudeSource.AUTOPILOT, TILTED)
    assert one.latest(S + later_ns) == (expected if is_fresh else None)


def test_two_at_once_and_then_one_in_a_tenth_of_a_second():
    one = Comparing()
    assert [one.on_arrival(0, ATTITUDE) for _ in range(3)] == [True, True, False]
    assert one.idle_until_ns(ATTITUDE) == S // 10
    assert one.on_arrival(0, AHRS2)

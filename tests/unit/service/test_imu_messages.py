import math
from collections import namedtuple

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.imu_messages import IDS_BY_NAME, IMU_MESSAGES, ImuChoice, preference

RawImu = namedtuple("RawImu", "time_usec xacc yacc zacc xgyro ygyro zgyro xmag ymag zmag")
Highres = namedtuple(
    "Highres", "time_usec xacc yacc zacc xgyro ygyro zgyro xmag ymag zmag fields_updated"
)
RAW, HIGHRES = IDS_BY_NAME["RAW_IMU"], IDS_BY_NAME["HIGHRES_IMU"]
SCALED, SCALED3 = IDS_BY_NAME["SCALED_IMU"], IDS_BY_NAME["SCALED_IMU3"]
SECOND_NS = 1_000_000_000


def raw_imu(**changes):
    level = RawImu(1_000_000, 0, 0, -1000, 10, 0, 0, 224, 80, -528)
    return IMU_MESSAGES[RAW].read(level._replace(**changes))


def highres(**changes):
    level = Highres(1_000_000, 0.0, 0.0, -9.8, 0.01, 0.0, 0.0, 0.224, 0.08, -0.528, 0x1FF)
    return IMU_MESSAGES[HIGHRES].read(level._replace(**changes))


def test_raw_imu_is_milli_g_mrad_and_mgauss():
    sample = raw_imu()
    assert sample.f_b == pytest.approx((0.0, 0.0, -9.80665))
    assert sample.w_b == pytest.approx((0.01, 0.0, 0.0))
    assert sample.m_b_ut == pytest.approx((22.4, 8.0, -52.8))
    assert not sample.clipped


@pytest.mark.parametrize("end", [32767, -32767, -32768])
def test_integers_at_their_end_are_clipped(end):
    assert raw_imu(xacc=end).clipped
    assert raw_imu(zgyro=end).clipped


def test_an_all_zero_field_is_no_field():
    assert raw_imu(xmag=0, ymag=0, zmag=0).m_b_ut is None


def test_highres_field_a_million_times_too_large_is_undone():
    sane, faulty = highres(), highres(xmag=224e3, ymag=80e3, zmag=-528e3)
    assert faulty.m_b_ut == pytest.approx(sane.m_b_ut)


def test_highres_without_new_field_brings_none():
    assert highres(fields_updated=0x3F).m_b_ut is None


def test_highres_without_new_motion_has_no_force():
    assert highres(fields_updated=0x1C0).f_b == (0.0, 0.0, 0.0)


def test_px4_avoids_the_message_whose_bias_its_estimator_removed():
    ranked = preference(mavlink.MAV_AUTOPILOT_PX4, "auto")
    assert ranked.index(SCALED) < ranked.index(HIGHRES)
    assert RAW not in ranked
    assert mavlink.MAV_AUTOPILOT_PX4 in IMU_MESSAGES[HIGHRES].bias_removed_by


def uses(choice, message_id, raw, t_ns):
    return choice.considers(message_id, t_ns) and choice.takes(message_id, raw, t_ns)


def test_a_better_message_takes_over_at_the_start_only():
    choice = ImuChoice((HIGHRES, RAW))
    assert uses(choice, RAW, raw_imu(), 0)
    assert uses(choice, HIGHRES, highres(), 1)
    assert not uses(choice, RAW, raw_imu(), 2)
    settled = ImuChoice((HIGHRES, RAW))
    for i in range(ImuChoice.SETTLED):
        assert uses(settled, RAW, raw_imu(), i)
    assert not uses(settled, HIGHRES, highres(), ImuChoice.SETTLED)


def test_a_silent_message_is_replaced():
    choice = ImuChoice((HIGHRES, RAW))
    uses(choice, HIGHRES, highres(), 0)
    assert not uses(choice, RAW, raw_imu(), SECOND_NS // 8)
    assert uses(choice, RAW, raw_imu(), SECOND_NS)


def test_scaled_imu3_with_only_a_compass_is_never_chosen():
    choice = ImuChoice((SCALED3,))
    dead = IMU_MESSAGES[RAW].read(RawImu(1, 0, 0, 0, 0, 0, 0, 224, 80, -528))
    assert not uses(choice, SCALED3, dead, 0)
    assert choice.chosen is None


def test_nan_stays_visible_for_the_finite_check():
    assert math.isnan(highres(xacc=math.nan).f_b[0])

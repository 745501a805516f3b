import math
from collections import namedtuple

import pytest

from h2nav.wire.imu import IDS_BY_NAME, IMU_MESSAGES
from h2nav.wire.refused import Refused

RawImu = namedtuple("RawImu", "time_usec xacc yacc zacc xgyro ygyro zgyro xmag ymag zmag")
Highres = namedtuple(
    "Highres", "time_usec xacc yacc zacc xgyro ygyro zgyro xmag ymag zmag fields_updated id"
)
RAW, HIGHRES = IDS_BY_NAME["RAW_IMU"], IDS_BY_NAME["HIGHRES_IMU"]


def raw_imu(**changes):
    level = RawImu(1_000_000, 0, 0, -1000, 10, 0, 0, 224, 80, -528)
    return IMU_MESSAGES[RAW].read(level._replace(**changes))


def highres(**changes):
    level = Highres(1_000_000, 0.0, 0.0, -9.8, 0.01, 0.0, 0.0, 0.224, 0.08, -0.528, 0x1FF, 0)
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


@pytest.mark.parametrize(("rate_mrad_s", "clipped"), [(30_628, False), (30_629, True)])
def test_a_rate_that_may_have_wrapped_is_clipped(rate_mrad_s, clipped):
    """A cast makes 2000 deg/s, 34,907 mrad/s, to -30,629."""
    assert (34_907 + 32_768) % 65_536 - 32_768 == -30_629
    assert raw_imu(ygyro=-rate_mrad_s).clipped == clipped
    assert raw_imu(ygyro=rate_mrad_s).clipped == clipped


def test_values_at_the_end_of_usual_sensors_are_clipped_in_every_message():
    assert highres(xgyro=math.radians(-1995.0)).clipped
    assert not highres(xgyro=math.radians(-1985.0)).clipped
    assert highres(zacc=-15.6 * 9.80665).clipped
    assert not highres(zacc=-15.4 * 9.80665).clipped
    assert raw_imu(zacc=-15_600).clipped
    assert not raw_imu(zacc=-15_400).clipped


def test_an_all_zero_field_is_no_field():
    assert raw_imu(xmag=0, ymag=0, zmag=0).m_b_ut is None


def test_highres_field_a_million_times_too_large_is_undone():
    sane, faulty = highres(), highres(xmag=224e3, ymag=80e3, zmag=-528e3)
    assert faulty.m_b_ut == pytest.approx(sane.m_b_ut)


def test_highres_without_new_field_brings_none():
    assert highres(fields_updated=0x3F).m_b_ut is None


def test_an_absurd_field_costs_the_field_and_not_the_sample():
    assert highres(xmag=1e30).m_b_ut is None


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"fields_updated": 0x1C0}, "zero_force"),
        ({"xacc": 0.0, "yacc": 0.0, "zacc": 0.0}, "zero_force"),
        ({"xacc": math.nan}, "non_finite"),
        ({"zgyro": -math.inf}, "non_finite"),
        ({"ymag": math.nan}, "non_finite"),
        ({"xgyro": 101.0}, "rate_out_of_range"),
        ({"yacc": -2_000.0}, "force_out_of_range"),
        ({"time_usec": 1 << 63}, "time_out_of_range"),
    ],
)
def test_what_is_no_sample_is_refused_by_name(changes, reason):
    with pytest.raises(Refused) as refused:
        highres(**changes)
    assert refused.value.reason == reason


def test_an_imu_with_nothing_but_a_compass_is_refused():
    with pytest.raises(Refused, match="zero_force"):
        raw_imu(xacc=0, yacc=0, zacc=0)


def test_highres_says_which_imu_it_holds():
    assert highres(id=1).imu == 1
    assert highres(id=200).imu == 0  # no IMU has this number
    assert raw_imu().imu is None

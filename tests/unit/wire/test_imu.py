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


@pytest.mark.parametrize(
    ("changes", "clipped"),
    [
        ({"xacc": 15_499}, False),
        ({"yacc": 15_500}, True),
        ({"zacc": -15_500}, True),
        ({"zgyro": 30_628}, False),
        ({"xgyro": -30_629}, True),
    ],
)
def test_integers_are_clipped_from_15500_mg_and_30629_mrad_s_on(changes, clipped):
    assert raw_imu(**changes).clipped is clipped


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_si_values_are_clipped_and_refused_at_their_limits(axis, sign):
    gyro, acc = f"{axis}gyro", f"{axis}acc"
    g_m_s2 = 9.80665
    assert not highres(**{gyro: sign * math.radians(1989.9)}).clipped
    assert highres(**{gyro: sign * math.radians(1990.1)}).clipped
    assert not highres(**{acc: sign * 15.499 * g_m_s2}).clipped
    assert highres(**{acc: sign * 15.501 * g_m_s2}).clipped
    assert highres(**{gyro: sign * 100.0, acc: sign * 199.9 * g_m_s2}).clipped
    for changes, reason in (
        ({gyro: sign * 100.1}, "rate_out_of_range"),
        ({acc: sign * 200.1 * g_m_s2}, "force_out_of_range"),
    ):
        with pytest.raises(Refused, match=reason):
            highres(**changes)


@pytest.mark.parametrize(
    ("gauss", "field_ut"),
    [
        (0.5, 50.0),
        (9_999.0, 999_900.0),  # beyond the earth's, and not beyond a magnet's
        (10_001.0, 1.0001),  # a million times too large
        (9.9e9, 990_000.0),
        (1.1e10, None),
        (0.0, None),
    ],
)
def test_a_field_is_as_it_is_a_million_times_smaller_or_none(gauss, field_ut):
    found = highres(xmag=gauss, ymag=0.0, zmag=0.0).m_b_ut
    assert found == (None if field_ut is None else pytest.approx((field_ut, 0.0, 0.0)))


@pytest.mark.parametrize(
    ("updated", "has_field"),
    [(0x3F, False), (0x7F, True), (0xBF, True), (0x13F, True), (0xE3F, False)],
)
def test_a_field_is_new_where_one_of_its_bits_is_set(updated, has_field):
    assert (highres(fields_updated=updated).m_b_ut is not None) is has_field


@pytest.mark.parametrize("bit", range(6))
def test_a_sample_needs_each_axis_of_rate_and_force(bit):
    with pytest.raises(Refused, match="zero_force"):
        highres(fields_updated=0x1FF & ~(1 << bit))


def test_one_axis_is_a_force_and_a_field():
    assert raw_imu(xacc=0, yacc=0, zacc=-1).f_b[2] == pytest.approx(-0.00980665)
    assert raw_imu(xacc=1, yacc=0, zacc=0).f_b[0] == pytest.approx(0.00980665)
    assert raw_imu(xacc=0, yacc=1, zacc=0).f_b[1] == pytest.approx(0.00980665)
    for axis in "xyz":
        only = {"xmag": 0, "ymag": 0, "zmag": 0, f"{axis}mag": 1}
        assert sum(raw_imu(**only).m_b_ut) == pytest.approx(0.1)


@pytest.mark.parametrize(("number", "imu"), [(0, 0), (1, 1), (2, 2), (3, 0), (255, 0)])
def test_there_are_three_imus(number, imu):
    assert highres(id=number).imu == imu


@pytest.mark.parametrize(
    ("name", "unit_us", "imu", "raw_of_px4", "removed_by_px4"),
    [
        ("HIGHRES_IMU", 1, 0, False, True),
        ("RAW_IMU", 1, 0, False, False),
        ("SCALED_IMU", 1000, 0, True, False),
        ("SCALED_IMU2", 1000, 1, True, False),
        ("SCALED_IMU3", 1000, 2, True, False),
        ("recorded IMU", 1, 0, False, False),
    ],
)
def test_each_message_has_its_clock_its_imu_and_what_px4_does_to_it(
    name, unit_us, imu, raw_of_px4, removed_by_px4
):
    row = IMU_MESSAGES[IDS_BY_NAME[name]]
    px4, ardupilot = 12, 3
    assert (row.name, row.time_unit_us, row.imu) == (name, unit_us, imu)
    assert (px4 in row.raw_field_of, px4 in row.bias_removed_by) == (raw_of_px4, removed_by_px4)
    assert ardupilot not in row.raw_field_of | row.bias_removed_by


def test_a_reading_becomes_a_sample_at_its_time():
    reading = raw_imu(xacc=16_000)
    sample = reading.at(77)
    assert sample == (77, reading.w_b, reading.f_b, reading.m_b_ut, True)
    scaled = IMU_MESSAGES[IDS_BY_NAME["SCALED_IMU2"]].read
    fields = namedtuple("Scaled", ("time_boot_ms", *RawImu._fields[1:]))
    assert scaled(fields(5, *RawImu(0, 0, 0, -1000, 10, 0, 0, 224, 80, -528)[1:])).time == 5

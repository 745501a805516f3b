"""Whose field a sample takes: that of PX4's SCALED_IMU is raw, that of HIGHRES_IMU is not."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.field_source import STALE_NS, TRUSTED_NS, WAIT_NS, FieldSource
from h2nav.wire.imu import IDS_BY_NAME, IMU_MESSAGES

SCALED, HIGHRES = (IMU_MESSAGES[IDS_BY_NAME[name]] for name in ("SCALED_IMU", "HIGHRES_IMU"))
PX4, ARDUPILOT = mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
RAW, CALIBRATED = (30.0, 1.0, 40.0), (20.0, 0.0, 45.0)


def field_at(source, t_ns, message=SCALED, own=RAW):
    return source.choose(t_ns, message, own)


def test_each_calibrated_field_is_used_once_and_no_raw_one_beside_it():
    source = FieldSource(PX4, lends=True)
    assert source.is_wanted(SCALED)
    assert field_at(source, 0) is None
    source.take_field(1, CALIBRATED)
    assert [field_at(source, t_ns) for t_ns in (2, 3)] == [CALIBRATED, None]
    source.take_field(4, None)
    assert field_at(source, 5) is None
    assert source.has_lent


def test_where_no_calibrated_field_comes_the_raw_one_is_what_there_is():
    source = FieldSource(PX4, lends=True)
    assert field_at(source, 0) is None
    assert not source.is_raw
    assert field_at(source, WAIT_NS + 1) == RAW
    assert source.is_raw
    assert not source.has_lent


def test_a_raw_field_returns_when_the_calibrated_ones_have_long_stopped():
    source = FieldSource(PX4, lends=True)
    source.take_field(0, CALIBRATED)
    assert field_at(source, 1) == CALIBRATED
    assert field_at(source, TRUSTED_NS) is None
    assert field_at(source, TRUSTED_NS + 1) == RAW


@pytest.mark.parametrize(("age_ns", "used"), [(STALE_NS, CALIBRATED), (STALE_NS + 1, None)])
def test_a_field_from_before_a_silence_is_not_used_after_it(age_ns, used):
    source = FieldSource(PX4, lends=True)
    source.take_field(0, CALIBRATED)
    assert field_at(source, age_ns) == used
    assert field_at(source, age_ns + 1) is None


def test_a_field_that_came_with_its_own_message_is_not_lent_again():
    source = FieldSource(PX4, lends=True)
    assert field_at(source, 0, HIGHRES, CALIBRATED) == CALIBRATED
    assert field_at(source, 1) is None
    assert not source.has_lent


def test_after_a_reboot_the_streams_are_waited_for_again():
    source = FieldSource(PX4, lends=True)
    assert field_at(source, WAIT_NS) is None
    assert field_at(source, 2 * WAIT_NS + 1) == RAW
    source.restart()
    assert field_at(source, 2 * WAIT_NS + 2) is None


def test_other_autopilots_and_a_chosen_message_keep_their_own_field():
    for source in (FieldSource(ARDUPILOT, lends=True), FieldSource(PX4, lends=False)):
        assert not source.is_wanted(SCALED)
        source.take_field(0, CALIBRATED)
        assert field_at(source, 1) == RAW
    assert not FieldSource(PX4, lends=True).is_wanted(HIGHRES)


S = 1_000_000_000


@pytest.mark.parametrize(("waits_ns", "found"), [(2 * S, None), (2 * S + 1, RAW)])
def test_a_calibrated_field_is_waited_for_two_seconds(waits_ns, found):
    source = FieldSource(PX4, lends=True)
    assert field_at(source, S) is None
    assert field_at(source, S + waits_ns) == found
    assert source.is_raw is (found is RAW)


@pytest.mark.parametrize(
    ("age_ns", "found"), [(S, CALIBRATED), (S + 1, None), (5 * S, None), (5 * S + 1, RAW)]
)
def test_a_calibrated_field_is_used_for_one_second_and_waited_for_five(age_ns, found):
    source = FieldSource(PX4, lends=True)
    source.take_field(7 * S, CALIBRATED)
    assert field_at(source, 7 * S + age_ns) == found
    assert source.has_lent is (found is CALIBRATED)


def test_no_field_is_wanted_before_a_message_is_in_use():
    assert not FieldSource(PX4, lends=True).is_wanted(None)


def test_a_calibrated_field_of_the_sample_itself_counts_as_heard():
    source = FieldSource(PX4, lends=True)
    assert field_at(source, 0) is None
    assert field_at(source, 4 * S, HIGHRES, CALIBRATED) == CALIBRATED
    assert not source.is_raw
    assert field_at(source, 9 * S) is None
    source = FieldSource(PX4, lends=True)
    assert field_at(source, 0) is None
    assert field_at(source, 4 * S, HIGHRES, None) is None
    assert field_at(source, 9 * S) == RAW
    assert source.is_raw


def test_a_field_that_waits_is_older_than_that_of_the_calibrated_message_itself():
    source = FieldSource(PX4, lends=True)
    source.take_field(0, RAW)
    assert field_at(source, 1, HIGHRES, CALIBRATED) == CALIBRATED
    assert field_at(source, 2) is None


@pytest.mark.parametrize("lends", [True, False])
def test_whether_a_field_is_the_raw_sensors_follows_from_its_message(lends):
    source = FieldSource(PX4, lends=lends)
    field_at(source, 0)
    assert field_at(source, 9 * S) == RAW
    assert source.is_raw
    assert field_at(source, 9 * S + 1, HIGHRES, CALIBRATED) == CALIBRATED
    assert not source.is_raw

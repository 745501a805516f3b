"""What of the arriving messages becomes a sample, at what time and with whose field."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.imu_choice import ImuChoice, LaneMessages
from h2nav.service.intake import CONTESTED_NS, Incoming, Intake, Need
from h2nav.service.sample_clock import TimeVerdict
from h2nav.wire.imu import IDS_BY_NAME, ImuReading

PX4 = mavlink.MAV_AUTOPILOT_PX4
SCALED, SECOND, HIGHRES = (IDS_BY_NAME[n] for n in ("SCALED_IMU", "SCALED_IMU2", "HIGHRES_IMU"))
RATE, FORCE = (0.1, 0.2, 0.3), (0.0, 0.0, -9.8)
RAW, CALIBRATED = (1.0, 2.0, 3.0), (21.0, 1.0, 40.0)
START_MS = 20_000


def reading(time, field=None, imu=None):
    return ImuReading(time, RATE, FORCE, field, clipped=False, imu=imu)


def intake(messages=(SCALED, HIGHRES), others_too=False, lends=True):
    return Intake(LaneMessages(0, messages, others_too), PX4, lends=lends)


def scaled(one, tick, field=RAW, newest_sent=None):
    """The next SCALED_IMU of 100 Hz."""
    t_ns = tick * 10_000_000
    need = one.need(t_ns, SCALED)
    return one.take(Incoming(t_ns, SCALED, reading(START_MS + 10 * tick, field), newest_sent), need)


def test_a_message_of_another_lane_is_not_needed():
    one = intake()
    assert one.need(0, SECOND) is Need.NONE
    assert one.need(0, SCALED) is Need.SAMPLE
    assert not Need.NONE
    assert Need.FIELD


def test_the_calibrated_field_is_needed_beside_the_samples_in_use():
    one = intake()
    for tick in range(ImuChoice.SETTLED):
        scaled(one, tick)
    t_ns = ImuChoice.SETTLED * 10_000_000
    assert one.need(t_ns, HIGHRES) is Need.FIELD
    assert one.need(t_ns, SCALED) is Need.SAMPLE
    assert one.idle_until_ns(HIGHRES) == t_ns - 10_000_000 + ImuChoice.SILENT_NS
    assert intake(lends=False).need(t_ns, HIGHRES) is Need.SAMPLE, "nothing is settled yet"


def test_a_sample_carries_the_field_that_was_lent():
    one = intake()
    scaled(one, 0)
    lent = one.take(Incoming(0, HIGHRES, reading(20_005_000, CALIBRATED)), Need.FIELD)
    assert lent == (None, None)
    _, sample = scaled(one, 1)
    assert sample == (1000 * (START_MS + 10), RATE, FORCE, CALIBRATED, False)
    assert one.has_lent
    assert not one.field_is_raw
    assert scaled(one, 2)[1].m_b_ut is None, "each field once"


def test_a_reading_of_another_imu_lends_its_field_alone():
    one = intake((HIGHRES,))
    other = one.take(Incoming(0, HIGHRES, reading(20_000_000, CALIBRATED, imu=1)), Need.SAMPLE)
    assert other == (None, None)
    assert one.newest_us is None
    both = intake((HIGHRES,), others_too=True)
    _, sample = both.take(Incoming(0, HIGHRES, reading(20_000_000, CALIBRATED, imu=1)), Need.SAMPLE)
    assert sample.m_b_ut == CALIBRATED


def test_a_clock_goes_on_from_the_sample_that_was_sent_last():
    one = intake()
    sent_us = 1000 * START_MS + 5_000
    verdict, sample = scaled(one, 0, newest_sent=(sent_us, 0))
    assert (verdict, sample) == (TimeVerdict.LATE, None)
    assert one.newest_us is None
    verdict, sample = scaled(one, 1)
    assert verdict is TimeVerdict.NEXT
    assert one.newest_us == sample.t_us == 1000 * (START_MS + 10)


def test_two_senders_are_an_objection_for_five_seconds():
    one = intake()
    assert one.objections(0) == ()
    for tick in range(20):
        scaled(one, tick)
        t_ns = tick * 10_000_000 + 5_000_000
        one.take(Incoming(t_ns, SCALED, reading(900_000 + 10 * tick, RAW)), Need.SAMPLE)
    (objection,) = one.objections(t_ns)
    assert objection.cause == "two senders"
    last_ns = 19 * 10_000_000
    assert one.objections(last_ns + CONTESTED_NS - 1)
    assert not one.objections(last_ns + CONTESTED_NS)


def test_a_reboot_begins_an_epoch_without_the_fields_of_the_one_before():
    one = intake()
    for tick in range(5):
        scaled(one, tick)
    one.take(Incoming(0, HIGHRES, reading(20_045_000, CALIBRATED)), Need.FIELD)
    verdicts = []
    for tick in range(3):
        t_ns = 5 * 10**9 + tick * 10_000_000
        found = one.take(Incoming(t_ns, SCALED, reading(1_000 + 10 * tick, RAW)), Need.SAMPLE)
        verdicts.append(found.verdict)
    assert verdicts[-1] is TimeVerdict.REBOOT
    assert found.sample.t_us == one.newest_us == 1_020_000
    assert found.sample.m_b_ut is None, "the lent field was of the epoch before"


@pytest.mark.parametrize(("messages", "is_removed"), [((HIGHRES,), True), ((SCALED,), False)])
def test_the_bias_is_removed_from_highres_imu_of_px4_alone(messages, is_removed):
    one = intake(messages)
    assert not one.bias_is_removed
    one.take(Incoming(0, messages[0], reading(20_000, RAW)), Need.SAMPLE)
    assert one.bias_is_removed == is_removed
    assert one.message.message_id == messages[0]


RAW_IMU = IDS_BY_NAME["RAW_IMU"]


@pytest.mark.parametrize(
    ("messages", "others_too", "autopilot", "lends", "ignores"),
    [
        ((SECOND, HIGHRES), False, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, True, True),
        ((HIGHRES, RAW_IMU), False, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, True, False),
        ((HIGHRES, RAW_IMU), True, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, True, False),
        ((SECOND, HIGHRES), False, PX4, True, False),
        ((SECOND, HIGHRES), False, PX4, False, True),
    ],
)
def test_who_neither_compares_nor_borrows_ignores_readings_of_other_imus(
    messages, others_too, autopilot, lends, ignores
):
    one = Intake(LaneMessages(1, messages, others_too), autopilot, lends=lends)
    assert one.ignores_others is ignores


@pytest.mark.parametrize("lends", [True, False])
def test_what_is_ignored_would_have_changed_no_sample(lends):
    """Of another IMU's number come field and time, and leave no trace."""
    heard, alone = (
        Intake(LaneMessages(1, (SECOND, HIGHRES)), mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, lends=lends)
        for _ in range(2)
    )
    for tick in range(30):
        t_ns = tick * 10_000_000
        heard.take(Incoming(t_ns, HIGHRES, reading(1_000 * tick, CALIBRATED, imu=0)), Need.SAMPLE)
        own = Incoming(t_ns, SECOND, reading(START_MS + 10 * tick, RAW))
        assert heard.take(own, Need.SAMPLE) == alone.take(own, Need.SAMPLE)
    assert (heard.message, heard.has_lent) == (alone.message, alone.has_lent)


ARDUPILOT = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
FOREVER_NS = 1 << 62
S = 1_000_000_000


def of_ardupilot(messages=(HIGHRES, RAW_IMU), count=100, used=HIGHRES):
    """The first IMU's intake, of which one message has been in use for some samples, until 2 s."""
    one = Intake(LaneMessages(0, messages), ARDUPILOT, lends=True)
    for number in range(count):
        time_us = 20_000_000 + 10_000 * number
        t_ns = 2 * S - (count - 1 - number) * 10_000_000
        one.take(Incoming(t_ns, used, reading(time_us, RAW)), Need.SAMPLE)
    return one


@pytest.mark.parametrize(
    ("later_ns", "message_id", "need"),
    [
        (0, HIGHRES, Need.SAMPLE),
        (0, RAW_IMU, Need.IDENTITY),
        (200_000_000, RAW_IMU, Need.IDENTITY),
        (200_000_001, RAW_IMU, Need.SAMPLE),  # the one in use is silent
        (0, SCALED, Need.NONE),
        (0, SECOND, Need.NONE),
    ],
)
def test_what_a_message_is_needed_for(later_ns, message_id, need):
    assert of_ardupilot().need(2 * S + later_ns, message_id) is need


def test_whose_samples_come_is_looked_at_ten_times_a_second():
    one = of_ardupilot()
    incoming = Incoming(2 * S, RAW_IMU, reading(20_990_000, RAW))
    assert one.take(incoming, one.need(2 * S, RAW_IMU)) == (None, None)
    assert one.need(2 * S + 99_999_999, RAW_IMU) is Need.NONE
    assert one.need(2 * S + 100_000_000, RAW_IMU) is Need.IDENTITY
    assert one.idle_until_ns(RAW_IMU) == 2 * S + 100_000_000


@pytest.mark.parametrize(
    ("message_id", "need", "until_ns"),
    [
        (HIGHRES, Need.SAMPLE, FOREVER_NS),
        (RAW_IMU, Need.SAMPLE, 0),
        (RAW_IMU, Need.IDENTITY, 0),
        (RAW_IMU, Need.NONE, 0),  # the next look is due
        (SECOND, Need.NONE, FOREVER_NS),
    ],
)
def test_how_long_an_answer_holds(message_id, need, until_ns):
    assert of_ardupilot().needs_until_ns(message_id, need) == until_ns


def test_before_the_first_sample_an_answer_holds_for_a_message_of_several_imus_alone():
    one = Intake(LaneMessages(0, (HIGHRES, RAW_IMU)), ARDUPILOT, lends=True)
    assert one.needs_until_ns(RAW_IMU, Need.SAMPLE) == 0
    assert one.needs_until_ns(HIGHRES, Need.SAMPLE) == FOREVER_NS
    assert one.idle_until_ns(HIGHRES) == 0
    assert (one.message, one.is_left, one.has_lent, one.bias_is_removed) == (
        None,
        False,
        False,
        False,
    )


def test_an_imu_that_the_autopilot_has_left_is_known_by_the_number_of_another():
    one = of_ardupilot(count=1, used=RAW_IMU)
    assert not one.is_left
    named = Incoming(2 * S, HIGHRES, reading(20_000_000, RAW, imu=1))
    assert one.take(named, Need.SAMPLE) == (None, None)
    assert one.message.message_id == RAW_IMU
    assert one.is_left


@pytest.mark.parametrize(("later_ns", "is_told"), [(4_999_999_999, True), (5_000_000_000, False)])
def test_two_senders_are_told_for_five_seconds(later_ns, is_told):
    one = intake()
    for tick in range(20):
        scaled(one, tick)
        t_ns = tick * 10_000_000 + 5_000_000
        one.take(Incoming(t_ns, SCALED, reading(900_000 + 10 * tick, RAW)), Need.SAMPLE)
    told = one.objections(190_000_000 + later_ns)
    expected = ("two senders", "two senders use the autopilot's identity")
    assert told == ((expected,) if is_told else ())


def test_a_time_that_is_refused_is_no_newest_one():
    one = intake()
    scaled(one, 0)
    newest_us = one.newest_us
    for time_ms, verdict in (
        (START_MS, TimeVerdict.DUPLICATE),
        (START_MS - 10, TimeVerdict.LATE),
        (START_MS + 60_000, TimeVerdict.STRAY),
    ):
        found = one.take(Incoming(10_000_000, SCALED, reading(time_ms, RAW)), Need.SAMPLE)
        assert found == (verdict, None)
        assert one.newest_us == newest_us
    one.restart()
    assert one.newest_us is None

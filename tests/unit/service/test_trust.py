"""When a lane is relied on: what is refused, what rests, what has to restart and is good again."""

import pytest

from h2nav.maths.units import SECOND_NS
from h2nav.service.trust import GOOD_AGAIN_NS, REFUSALS, REST_NS, RESTART_AFTER_NS, LaneTrust

NOW_NS = 100 * SECOND_NS


@pytest.fixture
def counted():
    return []


@pytest.fixture
def trust(counted):
    return LaneTrust(counted.append)


def test_refused_readings_are_counted_and_explained_for_a_second(trust, counted):
    assert trust.why_no_samples(NOW_NS) is None
    trust.refuse(NOW_NS, "zero_force")
    assert counted == ["zero_force"]
    assert trust.why_no_samples(NOW_NS + SECOND_NS) == (
        "zero_force",
        "the accelerometer reads exactly zero",
    )
    assert trust.why_no_samples(NOW_NS + SECOND_NS + 1) is None
    trust.refuse(NOW_NS, "unheard_of")
    assert trust.why_no_samples(NOW_NS) == ("unheard_of", "unheard_of")


def test_only_refusals_in_a_row_make_a_stream_refused(trust):
    for _ in range(REFUSALS - 1):
        trust.refuse(NOW_NS, "late")
    assert not trust.is_refused
    trust.accept()
    trust.refuse(NOW_NS, "late")
    assert not trust.is_refused
    for _ in range(REFUSALS - 1):
        trust.refuse(NOW_NS, "late")
    assert trust.is_refused


def test_a_fault_of_the_filter_is_counted_and_no_refusal(trust, counted):
    for _ in range(REFUSALS):
        trust.fault("filter_error")
    assert counted == ["filter_error"] * REFUSALS
    assert not trust.is_refused
    assert trust.why_no_samples(NOW_NS) is None


def test_a_stream_rests_for_a_minute_and_its_filter_begins_anew(trust):
    assert not trust.rests(NOW_NS)
    for _ in range(REFUSALS):
        trust.refuse(NOW_NS, "late")
    trust.rest(NOW_NS)
    assert trust.rests_until_ns == NOW_NS + REST_NS
    assert trust.rests(NOW_NS + REST_NS - 1)
    trust.wake(NOW_NS + REST_NS - 1)
    assert trust.rests_until_ns == NOW_NS + REST_NS
    assert not trust.needs_restart
    assert not trust.rests(NOW_NS + REST_NS)
    trust.wake(NOW_NS + REST_NS)
    assert trust.rests_until_ns is None
    assert trust.needs_restart
    assert not trust.is_refused, "it has another chance"


def test_bad_sensors_restart_a_filter_after_a_second(trust):
    trust.judge(NOW_NS, sensor_is_bad=True)
    assert trust.sensor_is_bad
    trust.judge(NOW_NS + RESTART_AFTER_NS, sensor_is_bad=True)
    assert not trust.needs_restart
    trust.judge(NOW_NS + RESTART_AFTER_NS + 1, sensor_is_bad=True)
    assert trust.needs_restart


def test_sensors_that_are_bad_now_and_then_restart_nothing(trust):
    for second in range(10):
        trust.judge(NOW_NS + second * RESTART_AFTER_NS, sensor_is_bad=second % 2 == 0)
    assert not trust.needs_restart


def test_a_filter_that_needs_a_restart_waits_until_its_sensors_have_been_good_for_a_second(trust):
    trust.require_restart()
    assert not trust.is_good_again(NOW_NS), "nobody has looked yet"
    trust.judge(NOW_NS, sensor_is_bad=False)
    assert not trust.is_good_again(NOW_NS + GOOD_AGAIN_NS - 1)
    assert trust.is_good_again(NOW_NS + GOOD_AGAIN_NS)
    trust.judge(NOW_NS + GOOD_AGAIN_NS, sensor_is_bad=True)
    assert not trust.is_good_again(NOW_NS + 2 * GOOD_AGAIN_NS)
    trust.judge(NOW_NS + 2 * GOOD_AGAIN_NS, sensor_is_bad=False)
    trust.judge(NOW_NS + 3 * GOOD_AGAIN_NS, sensor_is_bad=False)
    assert trust.is_good_again(NOW_NS + 3 * GOOD_AGAIN_NS)
    trust.renew()
    assert not trust.is_good_again(NOW_NS + 4 * GOOD_AGAIN_NS), "it needs no restart"


S = SECOND_NS


@pytest.mark.parametrize(
    ("reason", "text"),
    [
        ("non_finite", "IMU messages hold NaN or infinity"),
        ("frozen", "the gyro repeats its values: it is frozen"),
        ("zero_force", "the accelerometer reads exactly zero"),
        ("rate_out_of_range", "the gyro's values are beyond any gyro's range"),
        ("force_out_of_range", "the accelerometer's values are beyond any accelerometer's range"),
        ("time_out_of_range", "the time stamps of the IMU messages are no times"),
        ("duplicate", "the time stamps of the IMU messages stand still"),
        ("late", "the time stamps of the IMU messages run backwards"),
        ("stray_time", "the time stamps of the IMU messages jump"),
        ("second_sender", "second_sender"),
    ],
)
def test_each_refusal_is_told_in_words(trust, reason, text):
    trust.refuse(NOW_NS, reason)
    assert trust.why_no_samples(NOW_NS + S) == (reason, text)
    assert trust.lost == ""
    for _ in range(99):
        trust.refuse(NOW_NS, reason)
    assert (trust.is_refused, trust.lost) == (True, text)
    trust.accept()
    assert (trust.is_refused, trust.refusals, trust.lost) == (False, 0, "")


def test_times_of_trust(trust):
    assert (RESTART_AFTER_NS, GOOD_AGAIN_NS) == (S, S)
    trust.rest(NOW_NS)
    assert trust.rests(NOW_NS + 60 * S - 1)
    assert not trust.rests(NOW_NS + 60 * S)
    trust.judge(NOW_NS, sensor_is_bad=False)
    assert not trust.sensor_is_bad
    assert not trust.is_good_again(NOW_NS + 9 * S)  # nothing has to be
    trust.require_restart()
    assert trust.is_good_again(NOW_NS + S)

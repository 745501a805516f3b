"""HIGHRES_IMU is left for RAW_IMU once it shows another IMU."""

import random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.imu_choice import LaneMessages
from h2nav.service.imu_identity import (
    ANYONES_ID,
    FIRST_ID,
    PERIOD_NS,
    ImuIdentity,
    Shown,
)
from h2nav.service.intake import Incoming, Intake, Need
from h2nav.wire.imu import ImuReading


def messages_in_use(highres_shows_another_from, ticks=600, until=10_000, first_every=1):
    """The message in use after each tick of 10 ms."""
    one = Intake(
        LaneMessages(0, (ANYONES_ID, FIRST_ID)), mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, lends=True
    )
    numbers, used, identified = random.Random(1), [], 0
    for tick in range(ticks):
        mine, others = ([numbers.gauss(0.0, 0.05) for _ in range(6)] for _ in range(2))
        shown = others if highres_shows_another_from <= tick < until else mine
        t_ns, time = tick * 10_000_000, 1_000_000 + 10_000 * tick
        for message_id, values in ((FIRST_ID, mine), (ANYONES_ID, shown)):
            if message_id == FIRST_ID and tick % first_every:
                continue
            need = one.need(t_ns, message_id)
            identified += need is Need.IDENTITY
            if need is not Need.NONE:
                x, y, z, a, b, c = values
                reading = ImuReading(time, (x, y, z), (a, b, c - 9.8), None, clipped=False)
                one.take(Incoming(t_ns, message_id, reading), need)
        used.append(one.message.message_id)
    return used, identified


def test_while_both_show_the_same_the_finer_one_stays_at_ten_looks_a_second():
    used, identified = messages_in_use(10_000)
    assert set(used[1:]) == {ANYONES_ID}
    assert 40 <= identified <= 60


def test_it_is_left_within_half_a_second_of_showing_another_gyro():
    used, _ = messages_in_use(300)
    assert used[299] == ANYONES_ID
    assert used[350] == FIRST_ID
    assert set(used[350:]) == {FIRST_ID}


def test_messages_that_never_agreed_prove_nothing():
    used, _ = messages_in_use(0)
    assert set(used[1:]) == {ANYONES_ID}


@pytest.mark.parametrize("first_every", [1, 10])
def test_once_both_agree_again_the_finer_one_is_used_again(first_every):
    """RAW_IMU comes at the rate of the finer one, or at ten a second."""
    used, _ = messages_in_use(300, 900, until=500, first_every=first_every)
    assert used[499] == FIRST_ID
    assert set(used[650:]) == {ANYONES_ID}


MIN_AGREED, MIN_APART = 10, 3
MINE = ImuReading(1, (0.01, 0.02, 0.03), (0.1, 0.2, -9.8), None, clipped=False)
OTHER = MINE._replace(w_b=(0.5, 0.02, 0.03), f_b=(2.0, 0.2, -9.8))


def shown_by(identity, newest, number, apart_us=0):
    """What the `number`-th pair of readings shows, whose newest one is of HIGHRES_IMU."""
    time_us = 100_000 * (number + 1)
    identity.take(0, FIRST_ID, MINE._replace(time=time_us), is_sample=False)
    reading = newest._replace(time=time_us + apart_us)
    return identity.take(0, ANYONES_ID, reading, is_sample=True)


@pytest.mark.parametrize("agreed", range(MIN_AGREED + 3))
def test_so_many_have_to_agree_and_so_many_to_differ(agreed):
    identity = ImuIdentity()
    before = [shown_by(identity, MINE, number) for number in range(agreed)]
    assert before == [
        Shown.FIRST if number >= MIN_AGREED - 1 else Shown.UNDECIDED for number in range(agreed)
    ]
    after = [shown_by(identity, OTHER, agreed + number) for number in range(MIN_APART + 2)]
    is_told = agreed >= MIN_AGREED
    assert after == [
        Shown.ANOTHER if is_told and number >= MIN_APART - 1 else Shown.UNDECIDED
        for number in range(MIN_APART + 2)
    ]


def test_one_that_names_another_imu_agrees_with_none():
    identity = ImuIdentity()
    for number in range(MIN_AGREED):
        shown_by(identity, MINE._replace(imu=0), number)
    told = [shown_by(identity, MINE._replace(imu=1), 50 + number) for number in range(MIN_APART)]
    assert told[-1] is Shown.ANOTHER


def test_readings_of_different_times_say_nothing():
    identity = ImuIdentity()
    for number in range(2 * MIN_AGREED):
        assert shown_by(identity, MINE, number, apart_us=50_000) is Shown.UNDECIDED


def test_only_what_is_looked_at_for_this_sets_the_next_look():
    identity = ImuIdentity()
    identity.take(7, ANYONES_ID, MINE, is_sample=True)
    assert identity.next_ns == 0
    identity.take(7, FIRST_ID, MINE, is_sample=False)
    assert identity.next_ns == 7 + PERIOD_NS

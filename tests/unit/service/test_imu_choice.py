import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import SECOND_NS
from h2nav.service.imu_choice import ImuChoice, lanes_wanted, preference
from h2nav.service.settings import AutopilotSettings
from h2nav.wire.imu import IDS_BY_NAME, IMU_MESSAGES, RECORDED_IMU

RAW, HIGHRES = IDS_BY_NAME["RAW_IMU"], IDS_BY_NAME["HIGHRES_IMU"]
SCALED = IDS_BY_NAME["SCALED_IMU"]


def test_px4_avoids_the_message_whose_bias_its_estimator_removed():
    ranked = preference(mavlink.MAV_AUTOPILOT_PX4, "auto")
    assert ranked.index(SCALED) < ranked.index(HIGHRES)
    assert RAW not in ranked
    assert mavlink.MAV_AUTOPILOT_PX4 in IMU_MESSAGES[HIGHRES].bias_removed_by


def uses(choice, message_id, t_ns):
    considered = choice.is_candidate(message_id, t_ns)
    if considered:
        choice.takes(message_id, t_ns)
    return considered


def test_a_better_message_takes_over_at_the_start_only():
    choice = ImuChoice((HIGHRES, RAW))
    assert uses(choice, RAW, 0)
    assert uses(choice, HIGHRES, 1)
    assert not uses(choice, RAW, 2)
    settled = ImuChoice((HIGHRES, RAW))
    for i in range(ImuChoice.SETTLED):
        assert uses(settled, RAW, i)
    assert not uses(settled, HIGHRES, ImuChoice.SETTLED)


def test_a_silent_message_is_replaced():
    choice = ImuChoice((HIGHRES, RAW))
    uses(choice, HIGHRES, 0)
    assert not uses(choice, RAW, SECOND_NS // 8)
    assert uses(choice, RAW, SECOND_NS)


ARDUPILOT, PX4 = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4
SCALED2, SCALED3 = IDS_BY_NAME["SCALED_IMU2"], IDS_BY_NAME["SCALED_IMU3"]


@pytest.mark.parametrize(
    ("autopilot", "chosen", "ranked"),
    [
        (PX4, "auto", (SCALED, HIGHRES, SCALED2, SCALED3)),
        (ARDUPILOT, "auto", (HIGHRES, RAW, SCALED, SCALED2, SCALED3)),
        (ARDUPILOT, "SCALED_IMU2", (SCALED2,)),
        (PX4, "RAW_IMU", (RAW,)),
    ],
)
def test_which_messages_are_used_best_first(autopilot, chosen, ranked):
    assert preference(autopilot, chosen) == ranked


@pytest.mark.parametrize(
    ("autopilot", "lanes", "chosen", "expected"),
    [
        (
            ARDUPILOT, "auto", "auto",
            [(0, (HIGHRES, RAW, SCALED, RECORDED_IMU), False),
             (1, (SCALED2, HIGHRES, RECORDED_IMU), False),
             (2, (SCALED3, HIGHRES, RECORDED_IMU), False)],
        ),
        (
            ARDUPILOT, 2, "auto",
            [(0, (HIGHRES, RAW, SCALED, RECORDED_IMU), False),
             (1, (SCALED2, HIGHRES, RECORDED_IMU), False)],
        ),
        (ARDUPILOT, 1, "auto",
         [(0, (HIGHRES, RAW, SCALED, SCALED2, SCALED3, RECORDED_IMU), True)]),
        (ARDUPILOT, "auto", "SCALED_IMU2", [(1, (SCALED2, RECORDED_IMU), True)]),
        (
            PX4, 3, "SCALED_IMU2",
            [(1, (SCALED2,), False),
             (0, (HIGHRES, RECORDED_IMU, RAW, SCALED), False),
             (2, (SCALED3, HIGHRES, RECORDED_IMU), False)],
        ),
        (
            PX4, 2, "auto",
            [(0, (SCALED, HIGHRES, RECORDED_IMU), False),
             (1, (SCALED2, HIGHRES, RECORDED_IMU), False)],
        ),
    ],
)  # fmt: skip
def test_each_imu_has_a_filter_of_its_own(autopilot, lanes, chosen, expected):
    settings = AutopilotSettings(lanes=lanes, imu_message=chosen)
    assert list(lanes_wanted(autopilot, settings)) == expected


def in_use(count, last_ns=1_000_000_000):
    """RAW_IMU in use for so many samples, HIGHRES_IMU is better."""
    choice = ImuChoice((HIGHRES, RAW, SCALED))
    for _ in range(count):
        choice.takes(RAW, last_ns)
    return choice


@pytest.mark.parametrize(
    ("count", "message_id", "later_ns", "is_one"),
    [
        (99, HIGHRES, 0, True),
        (100, HIGHRES, 0, False),
        (1, SCALED, 0, False),
        (100, HIGHRES, 200_000_000, False),
        (100, HIGHRES, 200_000_001, True),
        (100, SCALED, 200_000_001, True),
        (100, SCALED2, 9_000_000_000, False),
        (100, RAW, 0, True),
    ],
)
def test_another_message_may_be_used_at_first_and_after_a_silence(
    count, message_id, later_ns, is_one
):
    assert in_use(count).is_candidate(message_id, 1_000_000_000 + later_ns) is is_one


@pytest.mark.parametrize(("count", "is_settled"), [(0, False), (99, False), (100, True)])
def test_a_choice_is_settled_after_a_hundred_samples(count, is_settled):
    assert in_use(count).is_settled is is_settled


def test_how_long_a_message_is_of_no_use():
    forever_ns = 1 << 62
    assert ImuChoice((HIGHRES,)).idle_until_ns(HIGHRES) == forever_ns
    assert in_use(100).idle_until_ns(HIGHRES) == 1_200_000_000
    assert in_use(100).idle_until_ns(SCALED2) == forever_ns


def test_what_is_preferred_stays_and_what_takes_over_begins_to_count():
    choice = in_use(100)
    choice.prefer(HIGHRES, 2_000_000_000)
    assert (choice.chosen.message_id, choice.is_settled) == (HIGHRES, True)
    assert not choice.is_candidate(RAW, 2_200_000_000)
    choice.takes(RAW, 3_000_000_000)
    assert (choice.chosen.message_id, choice.is_settled) == (RAW, False)

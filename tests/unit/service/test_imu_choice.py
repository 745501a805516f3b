from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import SECOND_NS
from h2nav.service.imu_choice import ImuChoice, preference
from h2nav.wire.imu import IDS_BY_NAME, IMU_MESSAGES

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

import math

import numpy as np
import pytest

from h2nav.errors import BadInput
from h2nav.motion.samples import WheelSample
from h2nav.motion.settings import OdometrySettings
from h2nav.motion.wheel_odometry import NEW_EPOCH_SAMPLES, WheelEvent, WheelOdometry
from h2nav.motion.wheels import DifferentialDrive

SETTINGS = OdometrySettings(track_m=0.4)
STEP_US = 50_000
DRIVE = DifferentialDrive(0.4)


def circle(steps, start_us=STEP_US, speed=1.0, turn=0.5):
    left, right = DRIVE.wheels((speed, 0.0, turn))
    for i in range(steps):
        t_s = i * STEP_US * 1e-6
        yield WheelSample(start_us + i * STEP_US, (3.0 + left * t_s, -1.0 + right * t_s))


def run(odometry, samples):
    return [odometry.update(sample) for sample in samples]


def test_half_circle_from_any_counter_reading():
    steps = round(math.pi / 0.5 / 0.05) + 1
    last = run(WheelOdometry(SETTINGS), circle(steps))[-1]
    turned = 0.5 * (steps - 1) * 0.05
    end = (2.0 * math.sin(turned), 2.0 - 2.0 * math.cos(turned), turned)
    assert last.pose[:2] == pytest.approx(end[:2], abs=1e-12)
    assert math.remainder(last.pose[2] - turned, math.tau) == pytest.approx(0.0, abs=1e-12)
    assert last.twist == pytest.approx((1.0, 0.0, 0.5))
    assert np.all(np.linalg.eigvalsh(last.covariance) > 0.0)


def test_first_reading_only_sets_the_counters():
    odometry = WheelOdometry(SETTINGS)
    assert odometry.update(WheelSample(1, (100.0, 200.0))) is None
    assert odometry.update(WheelSample(100_001, (100.1, 200.1))).pose == pytest.approx((0.1, 0, 0))


def test_radii_scale_the_autopilots_distances():
    settings = OdometrySettings(
        track_m=0.4, radius_left_m=0.055, radius_right_m=0.055, autopilot_radius_m=0.05
    )
    odometry = WheelOdometry(settings)
    odometry.update(WheelSample(0, (0.0, 0.0)))
    assert odometry.update(WheelSample(STEP_US, (0.1, 0.1))).pose[0] == pytest.approx(0.11)


@pytest.mark.parametrize("ways", [(math.nan, 1.0), (1.0, math.inf), (1.0,), ()])
def test_a_damaged_reading_loses_no_way(ways):
    clean = run(WheelOdometry(SETTINGS), circle(20))[-1]
    odometry = WheelOdometry(SETTINGS)
    samples = list(circle(20))
    samples[7] = samples[7]._replace(ways=ways)
    estimates = run(odometry, samples)
    assert estimates[7] is None
    assert odometry.counts[WheelEvent.NOT_FINITE] == 1
    assert estimates[-1].pose == pytest.approx(clean.pose, abs=1e-9)
    assert estimates[-1].reset_counter == 0


def test_a_counter_that_restarts_at_zero_counts_a_reset_and_moves_nothing():
    odometry = WheelOdometry(SETTINGS)
    before = run(odometry, circle(20))[-1]
    assert odometry.update(WheelSample(2_000_000, (500.0, 500.0))) is None
    assert odometry.counts[WheelEvent.JUMP] == 1
    after = odometry.update(WheelSample(2_050_000, (500.01, 500.01)))
    assert after.reset_counter == 1
    assert math.dist(after.pose[:2], before.pose[:2]) == pytest.approx(0.01)


def test_time_going_back_is_refused_and_a_new_epoch_accepted():
    odometry = WheelOdometry(SETTINGS)
    run(odometry, circle(20, start_us=10_000_000))
    estimates = run(odometry, circle(NEW_EPOCH_SAMPLES + 2, start_us=1))
    assert estimates[:NEW_EPOCH_SAMPLES] == [None] * NEW_EPOCH_SAMPLES
    assert odometry.counts[WheelEvent.NOT_LATER] == NEW_EPOCH_SAMPLES - 1
    assert odometry.counts[WheelEvent.NEW_EPOCH] == 1
    assert estimates[-1].reset_counter == 1


def test_a_repeated_reading_is_refused():
    odometry = WheelOdometry(SETTINGS)
    samples = list(circle(3))
    run(odometry, samples)
    assert odometry.update(samples[-1]) is None
    assert odometry.counts[WheelEvent.NOT_LATER] == 1


def test_restart_keeps_the_pose():
    odometry = WheelOdometry(SETTINGS)
    before = run(odometry, circle(10))[-1]
    odometry.restart()
    assert run(odometry, circle(2, start_us=1))[0] is None
    assert odometry.state().pose != before.pose
    assert odometry.state().reset_counter == 1


def test_a_restart_forgets_the_readings_that_were_not_later():
    odometry = WheelOdometry(SETTINGS)
    (sample,) = circle(1)
    run(odometry, [sample] * NEW_EPOCH_SAMPLES)
    odometry.restart()
    run(odometry, [sample] * NEW_EPOCH_SAMPLES)
    assert odometry.counts[WheelEvent.NEW_EPOCH] == 0
    assert odometry.counts[WheelEvent.NOT_LATER] == 2 * (NEW_EPOCH_SAMPLES - 1)


def test_split_and_restore_is_identical():
    samples = list(circle(30))
    samples[9] = samples[9]._replace(ways=(math.nan, 0.0))
    samples[15] = samples[15]._replace(t_us=1)
    whole = WheelOdometry(SETTINGS)
    expected = run(whole, samples)
    for split in range(0, 30, 3):
        first, second = WheelOdometry(SETTINGS), WheelOdometry(SETTINGS)
        head = run(first, samples[:split])
        second.restore(first.state())
        assert head + run(second, samples[split:]) == expected
        assert second.state() == whole.state()


def test_omni_layout():
    settings = OdometrySettings(layout="omni", arm_m=0.2)
    odometry = WheelOdometry(settings)
    odometry.update(WheelSample(0, (0.0, 0.0, 0.0)))
    estimate = odometry.update(WheelSample(100_000, (0.1, 0.1, 0.1)))
    assert estimate.pose == pytest.approx((0.0, 0.0, 0.5))


def test_a_singular_layout_is_refused_at_the_start():
    with pytest.raises(BadInput, match="singular"):
        WheelOdometry(OdometrySettings(layout="omni", angle_2_deg=0.0))


def test_a_correction_matrix_acts_on_the_increments():
    odometry = WheelOdometry(OdometrySettings(track_m=0.4, ahead_per_ahead=1.1))
    odometry.update(WheelSample(0, (0.0, 0.0)))
    assert odometry.update(WheelSample(STEP_US, (0.1, 0.1))).pose[0] == pytest.approx(0.11)

"""What each part of a frame does in integers, and which gain it uses: by what has changed."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from velocity_flights import GAINS

from h2nav.attitude.integer.motion import rotation
from h2nav.attitude.record import values
from h2nav.attitude.velocity_aided.integer.gains import integer_gains
from h2nav.attitude.velocity_aided.integer.kernel.frame import (
    accept_field,
    begin_frame,
    close_jitter,
    coast,
    rests,
    second_stage,
    take_time,
    use_followed_gain,
    use_motion_gain,
)
from h2nav.attitude.velocity_aided.integer.kernel.start import reset
from h2nav.attitude.velocity_aided.integer.memory import (
    FIELD_USED,
    FRAME,
    RESTING,
    Sample,
    State,
)

ATTITUDE = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
G = integer_gains(GAINS, "a test").gains
FRAME_US = 160_000


def known():
    s, sample, r = State(), Sample(), [0] * 9
    reset(s, G)
    x, y, z, w = ATTITUDE.as_quat().tolist()
    s.q_nb[:] = [round(part * 2.0**29) for part in (w, x, y, z)]
    rotation(s.q_nb, r)
    s.age_us, s.frame_us, s.frame_time = 99_000_000, FRAME_US, round(0.16 * 2**17)
    s.heading_reset, sample.dt_us, sample.parts = 0, 10_000, 1
    return s, sample, r


@pytest.mark.parametrize(
    ("rest_us", "least_us", "found"), [(0, 0, 0), (1, 0, 1), (999, 1000, 0), (1000, 1000, 1)]
)
def test_a_vehicle_rests_after_a_time(rest_us, least_us, found):
    s, g = State(), integer_gains(GAINS, "a test").gains
    s.rest_us, g.rest_time_us = rest_us, least_us
    assert rests(s, g) == found


def test_a_frame_has_its_time_and_the_field_has_been_silent_for_as_long():
    s = State()
    s.field_silence_us = 5_000_000
    take_time(s, FRAME_US)
    assert s.frame_time == pytest.approx(0.16 * 2**17, abs=1)
    assert s.field_silence_us == 5_160_000


@pytest.mark.parametrize("aided", [0, 1])
def test_a_frame_begins_with_the_sums_of_the_one_before(aided):
    s, sample, _ = known()
    sample.aided = aided
    s.innovation_sum_n, s.innovation_sum_e, s.turning_sum = 1234, -4321, 777
    s.jitter_sum = s.force_sum = 99
    begin_frame(s, G, sample)
    assert (s.innovation_n, s.innovation_e, s.velocity_use) == (1234, -4321, 1 - aided)
    assert (s.innovation_sum_n, s.innovation_sum_e, s.turning_sum, s.frame_us) == (0, 0, 0, 0)
    assert (s.jitter_sum, s.force_sum) == (0, 0)
    assert s.turning > 0


@pytest.mark.parametrize("share", [1.0, 0.25])
def test_a_force_has_the_density_of_its_second_differences(share):
    """Over three axes of six variances each, 16 samples, and a sixteenth of the frame's time."""
    s, _, _ = known()
    jolt_g2 = 0.5
    s.force_sum = round(jolt_g2 * 16 * 2**16)
    s.force_jitter = before = 1 << 16
    close_jitter(s, G, min(round(share * 2**15), 32767))
    density = jolt_g2 / 18.0 * 0.01 * 2**30
    assert s.force_jitter == pytest.approx(before + share * (density - before), rel=2e-3)


def test_a_rate_has_the_density_of_its_second_differences():
    """Twice as many second differences, twice the density."""
    found = []
    for jolts in (1 << 10, 1 << 11):
        s, _, _ = known()
        s.jitter_sum = jolts
        close_jitter(s, G, 32767)
        found.append(s.gyro_jitter)
    assert found[0] > 0
    assert found[1] == pytest.approx(2.0 * found[0], rel=1e-2)


def test_sixteen_samples_are_a_frame():
    s, sample, r = known()
    phases = []
    for _ in range(FRAME + 1):
        phases.append(s.phase)
        second_stage(s, G, sample, r)
    assert phases == [*range(FRAME), 0]


@pytest.mark.parametrize(("rest_us", "bits"), [(0, 0), (1 << 29, RESTING)])
def test_rest_is_told_once_in_a_frame(rest_us, bits):
    s, sample, r = known()
    s.phase, s.rest_us = 9, rest_us
    assert second_stage(s, G, sample, r) == bits


@pytest.mark.parametrize(
    ("phase", "frame_us", "after", "covariance", "sensitivities"),
    [
        (1, 100_000, 2, False, True),
        (1, 240_000, 2, False, True),
        (5, 230_000, 5, False, False),
        (5, 230_001, 1, True, False),
    ],
)
def test_over_clipped_samples_theta_is_predicted(phase, frame_us, after, covariance, sensitivities):
    s, _, r = known()
    s.phase, s.frame_us, s.dtilt_n[0] = phase, frame_us, 1 << 20
    s.mag_held, s.mag_held_us = 3, 30_000
    before = s.p_zh, s.dvelocity_n[0]
    coast(s, G, r)
    assert s.phase == after
    assert (s.p_zh != before[0]) is covariance
    assert (s.dvelocity_n[0] != before[1]) is sensitivities
    assert s.mag_held == 0
    assert (s.frame_us == frame_us) is not covariance


def gained(**changes):
    """A gain on all of theta, with a bias of the accelerometer and a latency that share it."""
    s, _, r = known()
    s.gain_h[:] = [1000, -2000, 3000, 20_000]
    s.gain_inverse, s.gain_innovation, s.gain_p_shift, s.gain_theta_shift = 20_000, 3000, 8, 4
    s.gain_accel[:], s.p_accel[:], s.accel_learns = [900, -800], [1 << 24, 0, 1 << 24], 32767
    s.gain_lag, s.fix_lag_variance, s.gain_digits = 1 << 18, 1 << 22, 60
    s.accel_n = -1 << 12  # what a latency shows
    for name, value in changes.items():
        setattr(s, name, value)
    use_motion_gain(s, G, r, 0)
    return s


@pytest.mark.parametrize(
    ("changes", "moves_heading", "moves_accel", "adds_uncertainty", "follows_bias"),
    [
        ({"velocity_use": 0}, False, False, False, False),
        ({"velocity_use": 1}, True, False, False, False),
        # without a field a bounded velocity does not turn the heading
        ({"velocity_use": 1, "field_silence_us": 1 << 30}, False, False, False, False),
        ({"velocity_use": 2, "aided": 1}, True, True, True, True),
        # a rate at rest teaches the accelerometer nothing
        ({"rest_us": 1 << 29, "velocity_use": 2}, True, False, False, False),
        ({"rest_us": 1 << 29, "velocity_use": 2, "aided": 1}, True, False, True, False),
    ],
)
def test_a_gain_is_used_for_what_its_measurement_shows(
    changes, moves_heading, moves_accel, adds_uncertainty, follows_bias
):
    s = gained(**changes)
    assert (s.dtheta[3] != 0) is moves_heading
    assert (s.daccel[:] != [0, 0]) is moves_accel
    assert (s.p_accel_x[0] != 0) is adds_uncertainty
    assert (s.bias_moved[:] != [0, 0, 0]) is follows_bias
    assert (s.dfix_lag != 0) is follows_bias
    assert (s.fix_predicted != 0) is follows_bias


def test_corrections_of_the_bias_are_followed_with_what_they_were_expected_to_be():
    s, _, _ = known()
    s.dtheta[:] = [50, 60, 70, 80]
    s.gain_h[:], s.gain_inverse, s.gain_innovation = [1000, -2000, 3000, 20_000], 20_000, 3000
    s.gain_p_shift, s.gain_theta_shift = 0, 4
    before = np.array((s.p_xx, s.p_yy, s.p_zz))
    use_followed_gain(s)
    assert s.bias_moved[:] == [a - b for a, b in zip(s.dtheta[:3], (50, 60, 70), strict=True)]
    assert s.bias_expected[:] == (before - (s.p_xx, s.p_yy, s.p_zz)).tolist()
    assert all(s.bias_expected)


@pytest.mark.parametrize(("accepted", "learns"), [(1, True), (2, True), (3, False)])
def test_a_field_is_told_once_and_learnt_from_unless_it_gave_the_heading(accepted, learns):
    s, _, _ = known()
    s.mag_accepted, s.mag_frame_us, s.field_silence_us, s.heading_rejected_us = accepted, 99, 7, 8
    s.mag_horizontal, s.mag_norm, s.mag_ref_norm = 8000, 16_000, 16_000 << 12
    s.mag_ref_horizontal = 8000 << 12
    assert accept_field(s, G) == FIELD_USED
    assert (s.mag_frame_us, s.heading_rejected_us, s.field_silence_us) == (0, 0, 0)
    assert s.mag_learn_us == (99 if learns else 0)


def test_a_field_that_contradicts_the_heading_is_not_used():
    s, _, _ = known()
    s.mag_accepted, s.mag_frame_us, s.field_silence_us = 4, 99, 7
    assert accept_field(s, G) == 0
    assert (s.mag_accepted, s.mag_frame_us, s.field_silence_us) == (0, 99, 7)


def test_nothing_is_measured_of_a_vehicle_that_does_not_move_but_time():
    """A frame without velocity, field and rest: theta is as it was, but for its prediction."""
    s, sample, r = known()
    s.velocity_use, s.phase = 0, 4
    before = values(s, State)
    for _ in range(FRAME - 4):
        second_stage(s, G, sample, r)
    assert values(s, State)[:10] == before[:10]

"""An attitude that is off by far is found to be lost; one that is contradicted otherwise is not."""

import math

import pytest
from monitored_flights import flown
from needs import DEG
from velocity_flights import accelerating, turning, with_noise, with_samples, with_turned_compass

from h2nav.integrity.lost_attitude import LASTING_US, LostAttitude
from h2nav.maths.quaternion import exp, multiply

FAULT_S, END_S = 30.0, 50.0


def drive(seed=7):
    return with_noise(accelerating(END_S, seed, law=turning), 0.2, seed)


def lost_after_s(drive, velocity_at=lambda t_s, v_n: v_n, turn_n=None):
    """From the fault, until the attitude is lost; None if it never is.

    Args:
        turn_n: by which the attitude is off from the fault on, rad; None: a filter finds it.
    """

    def off(i, estimate):
        q_nb = drive.flight.q_nb[i]
        is_off = drive.flight.samples[i].t_us >= FAULT_S * 1e6
        return estimate._replace(q_nb=multiply(exp(turn_n), q_nb) if is_off else q_nb)

    seen = None if turn_n is None else off
    for t_s, _, _, monitor in flown(drive, velocity_at, seen=seen):
        if monitor.attitude_is_lost:
            return t_s - FAULT_S
    return None


@pytest.mark.parametrize("turn_deg", [-60.0, 70.0, 120.0])
def test_an_attitude_that_stays_far_off_is_lost_within_ten_seconds(turn_deg):
    lost_s = lost_after_s(drive(), turn_n=(turn_deg * DEG, 0.0, 0.0))
    assert lost_s is not None
    assert 1e-6 * LASTING_US < lost_s < 10.0


def test_without_a_compass_a_force_that_lasts_shows_it():
    without = with_samples(drive(), lambda _i, sample: sample._replace(m_b_ut=None))
    lost_s = lost_after_s(without, turn_n=(100.0 * DEG, 0.0, 0.0))
    assert lost_s is not None
    assert lost_s < 20.0


def test_an_attitude_that_is_off_by_what_a_filter_corrects_is_not_lost():
    assert lost_after_s(drive(), turn_n=(12.0 * DEG, 0.0, 0.0)) is None


def test_a_heading_that_is_off_is_no_lost_attitude():
    assert lost_after_s(drive(), turn_n=(0.0, 0.0, 90.0 * DEG)) is None


@pytest.mark.parametrize("ramp_m_s2", [0.5, 2.0, 5.0])
def test_a_spoofed_velocity_loses_no_attitude(ramp_m_s2):
    def spoofed(t_s, v_n):
        return (v_n[0] + ramp_m_s2 * max(t_s - FAULT_S, 0.0), v_n[1], v_n[2])

    assert lost_after_s(drive(), spoofed) is None


@pytest.mark.parametrize("push_m_s2", [1.0, 3.0, 6.0])
def test_an_accelerometer_that_is_off_loses_no_attitude(push_m_s2):
    def pushed(_i, sample):
        if sample.t_us < FAULT_S * 1e6:
            return sample
        x, y, z = sample.f_b
        return sample._replace(f_b=(x + push_m_s2, y, z))

    assert lost_after_s(with_samples(drive(), pushed)) is None


def test_a_turned_compass_loses_no_attitude():
    assert lost_after_s(with_turned_compass(drive(), math.pi, FAULT_S)) is None


def test_nothing_is_lost_in_a_sound_flight():
    assert lost_after_s(drive()) is None


def test_what_is_shown_for_just_enough_time_counts_and_an_interruption_begins_anew():
    lost = LostAttitude()
    for t_us, is_shown, is_lost in (
        (1_000_000, True, False),
        (1_000_000 + LASTING_US - 1, True, False),
        (1_000_000 + LASTING_US, True, True),
        (1_000_001 + LASTING_US, None, True),
        (1_000_001 + LASTING_US, False, False),
        (1_000_002 + LASTING_US, True, False),
        (1_000_001 + 2 * LASTING_US, True, False),
        (1_000_002 + 2 * LASTING_US, True, True),
    ):
        lost.take(t_us, is_shown)
        assert lost.is_lost is is_lost

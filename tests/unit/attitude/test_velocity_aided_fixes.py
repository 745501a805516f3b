"""The default filter held by velocity fixes: latency, quality, loss."""

import math
from itertools import pairwise

import pytest
from lanes import few
from needs import DEG
from synthetic_imu import GRAVITY, rms_deg
from velocity_flights import PERIOD, accelerating, follow, new_filter, surge, tilt_errors

from h2nav.attitude.samples import Trust, VelocityFix
from h2nav.maths import quaternion


def test_velocity_gives_the_tilt_under_lasting_acceleration() -> None:
    drive = accelerating(80.0, 1)
    aided = rms_deg(tilt_errors(drive, follow(new_filter(), drive), 4000))
    alone = rms_deg(tilt_errors(drive, follow(new_filter(), drive, until=0), 4000))
    assert aided < 0.15
    assert alone > 5.0 * aided


@pytest.mark.parametrize("latency", few(2, [0, 10, 25, 40]))
def test_the_age_of_a_fix_costs_next_to_nothing(latency: int) -> None:
    drive = accelerating(60.0, 2)
    found = follow(new_filter(), drive, latency)
    assert rms_deg(tilt_errors(drive, found, 4000)) < 0.2


def test_velocity_holds_the_heading_without_magnetometer() -> None:
    """With a gyro that nothing has calibrated: its bias is 1 deg/s."""
    drive = accelerating(90.0, 3)
    found = follow(new_filter(vertical_bias_variance=DEG**2), drive, field=False)
    last = found[-1]
    assert last is not None
    assert quaternion.angle(last.q_nb, drive.flight.q_nb[-1]) < 1.0 * DEG
    assert last.trust & Trust.YAW_REFERENCED


def test_aiding_starts_with_the_third_fix_and_ends_without_fixes() -> None:
    drive = accelerating(40.0, 4)
    found = follow(new_filter(), drive, until=2000)
    is_aided = [bool(e and e.trust & Trust.VELOCITY_USED) for e in found]
    assert not any(is_aided[:60])
    assert all(is_aided[70:2000])
    assert not any(is_aided[2000 + 280 :])
    # The change itself moves nothing.
    for before, after in pairwise(found[2000:2400]):
        assert before is not None
        assert after is not None
        step = quaternion.angle(before.q_nb, after.q_nb)
        assert step < 0.01 * math.hypot(*after.w_b) + 0.02 * DEG


@pytest.mark.parametrize(
    "damaged",
    [
        VelocityFix(0, (math.nan, 0.0, 0.0), 0.1),
        VelocityFix(0, (math.inf, 0.0, 0.0), 0.1),
        VelocityFix(0, (0.0, 5000.0, 0.0), 0.1),
        VelocityFix(0, (0.0, 0.0, 0.0), 30.0),
        VelocityFix(0, (0.0, 0.0, 0.0), math.nan),
        VelocityFix(-900_000, (0.0, 0.0, 0.0), 0.1),
        VelocityFix(900_000, (0.0, 0.0, 0.0), 0.1),
    ],
)
def test_a_bad_fix_is_as_none(damaged: VelocityFix) -> None:
    drive = accelerating(10.0, 5)
    filter_ = new_filter()
    found = []
    for i, sample in enumerate(drive.flight.samples):
        if i % PERIOD == 0:
            filter_.use_velocity(damaged._replace(t_us=sample.t_us + damaged.t_us))
        found.append(filter_.update(sample))
    alone = new_filter()
    assert found == [alone.update(sample) for sample in drive.flight.samples]
    assert not any(e and e.trust & Trust.VELOCITY_USED for e in found)


def test_an_outlier_is_refused_and_a_lasting_jump_is_taken() -> None:
    drive = accelerating(60.0, 6)
    filter_ = new_filter()
    found = []
    for i, sample in enumerate(drive.flight.samples):
        if i % PERIOD == 0:
            north = drive.v_n[i][0] + (40.0 if i == 4000 else 0.0)
            fix = VelocityFix(sample.t_us, (north, drive.v_n[i][1], 0.0), 0.1)
            filter_.use_velocity(fix)
        found.append(filter_.update(sample))
    assert rms_deg(tilt_errors(drive, found, 3900)) < 0.2


def test_rest_of_the_force_is_gravity() -> None:
    drive = accelerating(1.0, 7)
    q, sample = drive.flight.q_nb[50], drive.flight.samples[50]
    f_n = quaternion.rotate(q, sample.f_b)
    a_n = quaternion.rotate(q, surge(0.5))
    assert f_n[2] - a_n[2] == pytest.approx(-GRAVITY, abs=0.2)

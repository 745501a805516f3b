"""The default filter held by velocity fixes: latency, quality, loss."""

import math
from itertools import pairwise
from typing import NamedTuple

import pytest
from needs import DEG
from synthetic_imu import GRAVITY, Disturbance, Flight, fly, rms_deg

from h2nav.attitude.samples import AttitudeEstimate, Trust, Vec3, VehicleState, VelocityFix
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.io import gain_files
from h2nav.maths import quaternion

GAINS = velocity_aided_gains(gain_files.load("multirotor_100hz"), "multirotor_100hz")
PERIOD = 20  # samples between fixes: 5 Hz


class Drive(NamedTuple):
    """A flight with real accelerations and its velocity."""

    flight: Flight
    v_n: list[Vec3]


def surge(t: float) -> Vec3:
    """Long accelerations of 3 m/s^2 forward and sideways."""
    return (3.0 * math.sin(0.35 * t), 3.0 * math.cos(0.27 * t), 0.0)


def sway(t: float) -> Vec3:
    return (0.3 * math.cos(0.7 * t), 0.3 * math.cos(0.9 * t), 0.1 * math.sin(0.2 * t))


def accelerating(seconds: float, seed: int) -> Drive:
    flight = fly(sway, seconds, seed, disturbance=Disturbance(force=surge))
    v: Vec3 = (0.0, 0.0, 0.0)
    velocities = []
    for i, q in enumerate(flight.q_nb):
        a = quaternion.rotate(q, surge(i / 100.0))
        v = (v[0] + 0.01 * a[0], v[1] + 0.01 * a[1], v[2] + 0.01 * a[2])
        velocities.append(v)
    return Drive(flight, velocities)


def follow(
    filter_: VelocityAidedFilter,
    drive: Drive,
    latency: int = 15,
    until: int | None = None,
    field=True,
) -> list[AttitudeEstimate | None]:
    """Fixes of 0.1 s to 0.2 s age, as receivers give them, up to the sample `until`."""
    filter_.use_vehicle(VehicleState(on_ground=False))
    found = []
    for i, sample in enumerate(drive.flight.samples):
        if i % PERIOD == 0 and i >= latency and (until is None or i < until):
            at = i - latency
            v_n = (drive.v_n[at][0], drive.v_n[at][1], math.nan)
            filter_.use_velocity(VelocityFix(drive.flight.samples[at].t_us, v_n, 0.1))
        found.append(filter_.update(sample if field else sample._replace(m_b_ut=None)))
    return found


def tilt_errors(drive: Drive, found: list[AttitudeEstimate | None], after: int) -> list[float]:
    errors = []
    for q, estimate in list(zip(drive.flight.q_nb, found, strict=True))[after:]:
        assert estimate is not None
        down = quaternion.rotate(quaternion.conjugate(q), (0.0, 0.0, 1.0))
        own = quaternion.rotate(quaternion.conjugate(estimate.q_nb), (0.0, 0.0, 1.0))
        errors.append(math.dist(down, own))
    return errors


def test_velocity_gives_the_tilt_under_lasting_acceleration() -> None:
    drive = accelerating(80.0, 1)
    aided = rms_deg(tilt_errors(drive, follow(VelocityAidedFilter(GAINS), drive), 4000))
    alone = rms_deg(tilt_errors(drive, follow(VelocityAidedFilter(GAINS), drive, until=0), 4000))
    assert aided < 0.15
    assert alone > 5.0 * aided


@pytest.mark.parametrize("latency", [0, 10, 25, 40])
def test_the_age_of_a_fix_costs_next_to_nothing(latency: int) -> None:
    drive = accelerating(60.0, 2)
    found = follow(VelocityAidedFilter(GAINS), drive, latency)
    assert rms_deg(tilt_errors(drive, found, 4000)) < 0.2


def test_velocity_holds_the_heading_without_magnetometer() -> None:
    drive = accelerating(90.0, 3)
    found = follow(VelocityAidedFilter(GAINS), drive, field=False)
    last = found[-1]
    assert last is not None
    assert quaternion.angle(last.q_nb, drive.flight.q_nb[-1]) < 1.0 * DEG
    assert last.trust & Trust.YAW_REFERENCED


def test_aiding_starts_with_the_third_fix_and_ends_without_fixes() -> None:
    drive = accelerating(40.0, 4)
    found = follow(VelocityAidedFilter(GAINS), drive, until=2000)
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
    "spoilt",
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
def test_a_bad_fix_is_as_none(spoilt: VelocityFix) -> None:
    drive = accelerating(10.0, 5)
    filter_ = VelocityAidedFilter(GAINS)
    found = []
    for i, sample in enumerate(drive.flight.samples):
        if i % PERIOD == 0:
            filter_.use_velocity(spoilt._replace(t_us=sample.t_us + spoilt.t_us))
        found.append(filter_.update(sample))
    alone = VelocityAidedFilter(GAINS)
    assert found == [alone.update(sample) for sample in drive.flight.samples]
    assert not any(e and e.trust & Trust.VELOCITY_USED for e in found)


def test_an_outlier_is_refused_and_a_lasting_jump_is_taken() -> None:
    drive = accelerating(60.0, 6)
    filter_ = VelocityAidedFilter(GAINS)
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

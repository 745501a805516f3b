"""Seeded flights that accelerate, with their velocities, and the default filter held by them."""

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from needs import DEG
from synthetic_imu import FIELD, FIELD_N, Disturbance, Flight, RateLaw, fly

from h2nav.attitude.kernel_files import VELOCITY_AIDED, VELOCITY_AIDED_INTEGER
from h2nav.attitude.native import compiled_step
from h2nav.attitude.samples import (
    AttitudeEstimate,
    ImuSample,
    Quat,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.files import gain_files
from h2nav.maths import quaternion

GAINS = velocity_aided_gains(gain_files.load("multirotor_100hz"), "multirotor_100hz")
FLYING = VehicleState(on_ground=False)
PERIOD = 20  # samples between fixes: 5 Hz
DOWN = (0.0, 0.0, 1.0)
# Of the norm: a few percent, across the nose.
IRON: Vec3 = (0.02, -0.06, 0.04)


class Drive(NamedTuple):
    """A flight with real accelerations and its velocity."""

    flight: Flight
    v_n: list[Vec3]


def surge(t: float) -> Vec3:
    """Long accelerations of 3 m/s^2 forward and sideways."""
    return (3.0 * math.sin(0.35 * t), 3.0 * math.cos(0.27 * t), 0.0)


def sway(t: float) -> Vec3:
    return (0.3 * math.cos(0.7 * t), 0.3 * math.cos(0.9 * t), 0.1 * math.sin(0.2 * t))


def turning(t: float) -> Vec3:
    """Every axis, the heading both ways: what the sensors' errors are told apart by."""
    return (0.5 * math.cos(0.7 * t), 0.5 * math.cos(0.9 * t), 0.8 * math.sin(0.15 * t))


@functools.lru_cache(maxsize=4)
def accelerating(
    seconds: float,
    seed: int,
    force: Callable[[float], Vec3] = surge,
    law: RateLaw = sway,
    start: Quat = quaternion.IDENTITY,
    bias_b: Vec3 = (1.0 * DEG, -0.7 * DEG, 0.5 * DEG),
) -> Drive:
    """A vehicle that turns with `law` and accelerates by `force` (m/s^2, body); 100 Hz.

    Those who change it change a copy: many tests begin with the same one.
    """
    added = Disturbance(force=force)
    flight = fly(law, seconds, seed, disturbance=added, start=start, bias_b=bias_b)
    v: Vec3 = (0.0, 0.0, 0.0)
    velocities = []
    for i, q in enumerate(flight.q_nb):
        a = quaternion.rotate(q, force(i / 100.0))
        v = (v[0] + 0.01 * a[0], v[1] + 0.01 * a[1], v[2] + 0.01 * a[2])
        velocities.append(v)
    return Drive(flight, velocities)


def with_samples(drive: Drive, change: Callable[[int, ImuSample], ImuSample]) -> Drive:
    """The same flight, each sample changed by its number and itself."""
    samples = [change(i, sample) for i, sample in enumerate(drive.flight.samples)]
    return drive._replace(flight=drive.flight._replace(samples=samples))


def part(drive: Drive, first: int, after: int) -> Drive:
    """Some samples of a flight."""
    samples, q_nb, bias_b = drive.flight
    flight = Flight(samples[first:after], q_nb[first:after], bias_b)
    return Drive(flight, drive.v_n[first:after])


def without_samples(drive: Drive, first: int, after: int) -> Drive:
    """The same flight with samples that nobody got."""
    samples, q_nb, bias_b = drive.flight
    flight = Flight(samples[:first] + samples[after:], q_nb[:first] + q_nb[after:], bias_b)
    return Drive(flight, drive.v_n[:first] + drive.v_n[after:])


def with_noise(drive: Drive, sigma_m_s: float, seed: int) -> Drive:
    """The same flight with white noise on its velocities."""
    noise = np.random.default_rng(seed).normal(0.0, sigma_m_s, (len(drive.v_n), 3)).tolist()
    pairs = zip(drive.v_n, noise, strict=True)
    return drive._replace(v_n=[(v[0] + n[0], v[1] + n[1], v[2] + n[2]) for v, n in pairs])


def wandering(drive: Drive, size_m_s: float) -> Drive:
    """The same flight with a receiver whose velocity swings slowly, within its accuracy."""
    turns = [2.0 * math.pi * i / 2000.0 for i in range(len(drive.v_n))]
    v_n = [
        (v[0] + size_m_s * math.sin(a), v[1] + size_m_s * math.cos(a), v[2])
        for v, a in zip(drive.v_n, turns, strict=True)
    ]
    return drive._replace(v_n=v_n)


def with_iron(drive: Drive, iron: Vec3 = IRON) -> Drive:
    """The same flight with an offset in the field, in shares of its norm."""

    def change(_: int, sample: ImuSample) -> ImuSample:
        assert sample.m_b_ut is not None
        x, y, z = (m + FIELD.norm_ut * o for m, o in zip(sample.m_b_ut, iron, strict=True))
        return sample._replace(m_b_ut=(x, y, z))

    return with_samples(drive, change)


def with_turned_compass(drive: Drive, angle: float, first_s: float = 0.0) -> Drive:
    """The same flight with a compass that is turned in the vehicle from a time on, rad."""
    turn = quaternion.from_euler(0.0, 0.0, angle)

    def change(_: int, sample: ImuSample) -> ImuSample:
        if sample.t_us < first_s * 1e6 or sample.m_b_ut is None:
            return sample
        return sample._replace(m_b_ut=quaternion.rotate(turn, sample.m_b_ut))

    return with_samples(drive, change)


def with_turned_field(drive: Drive, angle: float, first_s: float, after_s: float) -> Drive:
    """The same flight in a field that is turned about the vertical for a while, rad."""
    turned = quaternion.rotate(quaternion.from_euler(0.0, 0.0, angle), FIELD_N)

    def change(i: int, sample: ImuSample) -> ImuSample:
        if not first_s * 1e6 <= sample.t_us < after_s * 1e6:
            return sample
        back = quaternion.conjugate(drive.flight.q_nb[i])
        return sample._replace(m_b_ut=quaternion.rotate(back, turned))

    return with_samples(drive, change)


def new_filter(knows_field: bool = False, **limits: float) -> VelocityAidedFilter:
    """A filter in flight, compiled where that is possible; limits of the kernel by name."""
    gains = GAINS._replace(kernel=replace(GAINS.kernel, **limits))
    filter_ = VelocityAidedFilter(gains, compiled_step(VELOCITY_AIDED))
    filter_.use_vehicle(FLYING)
    if knows_field:
        filter_.use_field(FIELD)
    return filter_


def new_integer_filter(knows_field: bool = False, **limits: float) -> IntegerVelocityAidedFilter:
    """The same in integers."""
    gains = GAINS._replace(kernel=replace(GAINS.kernel, **limits))
    step = compiled_step(VELOCITY_AIDED_INTEGER)
    filter_ = IntegerVelocityAidedFilter(gains, "made", step)
    filter_.use_vehicle(FLYING)
    if knows_field:
        filter_.use_field(FIELD)
    return filter_


def follow(
    filter_: VelocityAidedFilter | IntegerVelocityAidedFilter,
    drive: Drive,
    latency: int = 15,
    until: int | None = None,
    field: bool = True,
    removed: tuple[int, int] = (0, 0),
) -> list[AttitudeEstimate | None]:
    """Fixes of 0.1 s to 0.2 s age, as receivers give them, up to the sample `until`.

    Args:
        removed: samples of delay taken off the fixes' times, from the sample that comes second on.
    """
    filter_.use_vehicle(FLYING)
    found = []
    for i, sample in enumerate(drive.flight.samples):
        if i % PERIOD == 0 and i >= latency and (until is None or i < until):
            at = i - latency
            v_n = (drive.v_n[at][0], drive.v_n[at][1], math.nan)
            back = removed[0] if i >= removed[1] else 0
            t_us = drive.flight.samples[at].t_us - 10_000 * back
            filter_.use_velocity(VelocityFix(t_us, v_n, 0.1, removed_s=0.01 * back))
        found.append(filter_.update(sample if field else sample._replace(m_b_ut=None)))
    return found


def tilt_apart(a: Quat, b: Quat) -> float:
    """Distance of two directions of down in the body, rad while it is small."""
    return math.dist(*(quaternion.rotate(quaternion.conjugate(q), DOWN) for q in (a, b)))


def heading_apart(a: Quat, b: Quat) -> float:
    """By how much b is turned about the vertical against a, rad."""
    w, _, _, z = quaternion.multiply(b, quaternion.conjugate(a))
    return math.remainder(2.0 * math.atan2(z, w), 2.0 * math.pi)


def tilt_errors(drive: Drive, found: list[AttitudeEstimate | None], after: int) -> list[float]:
    errors = []
    for q, estimate in list(zip(drive.flight.q_nb, found, strict=True))[after:]:
        assert estimate is not None
        errors.append(tilt_apart(q, estimate.q_nb))
    return errors

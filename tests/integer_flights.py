"""Flights for the default filter in integers, and ways to drive it.

The filters run compiled where that is possible; that Python gives the same bits is shown in
unit/attitude/test_batch.py and test_native.py.
"""

import math
from collections.abc import Callable, Sequence

from needs import DEG

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
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains, velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.files import gain_files

FLYING = VehicleState(on_ground=False)
GROUND = VehicleState(on_ground=True)
MULTIROTOR = velocity_aided_gains(gain_files.load("multirotor_100hz"), "multirotor_100hz")
HANDHELD = velocity_aided_gains(gain_files.load("handheld_100hz"), "handheld_100hz")
FIXED_WING = velocity_aided_gains(gain_files.load("fixed-wing_100hz"), "fixed-wing_100hz")
BIAS = (1.0 * DEG, -1.0 * DEG, 1.0 * DEG)
NO_BIAS = (0.0, 0.0, 0.0)
Filter = VelocityAidedFilter | IntegerVelocityAidedFilter
Fixes = Callable[[ImuSample], VelocityFix]


def new_filter(
    vehicle: VehicleState = FLYING, gains: VelocityAidedGains = MULTIROTOR
) -> IntegerVelocityAidedFilter:
    step = compiled_step(VELOCITY_AIDED_INTEGER)
    filter_ = IntegerVelocityAidedFilter(gains, gains.name, step)
    filter_.use_vehicle(vehicle)
    return filter_


def new_float_filter(gains: VelocityAidedGains = MULTIROTOR) -> VelocityAidedFilter:
    return VelocityAidedFilter(gains, compiled_step(VELOCITY_AIDED))


def gentle(t: float) -> Vec3:
    """Some 10 deg of roll and pitch, 30 deg of yaw."""
    return (0.2 * math.cos(1.2 * t), 0.25 * math.cos(0.9 * t + 1.0), 0.15 * math.sin(0.3 * t))


def breeze(t: float) -> Vec3:
    """Accelerations of a vehicle whose velocity stays within a metre per second."""
    return (0.8 * math.sin(1.1 * t), 0.6 * math.cos(0.8 * t), 0.5 * math.sin(2.0 * t))


def standing(sample: ImuSample) -> VelocityFix:
    """What a receiver says 150 ms late of a vehicle that stays where it is."""
    return VelocityFix(sample.t_us - 150_000, (0.0, 0.0, math.nan), 0.2)


def drive(
    filter_: Filter, samples: Sequence[ImuSample], fixes: Fixes | None = None, first: int = 0
) -> list[AttitudeEstimate | None]:
    """One estimate per sample; a fix with every twentieth."""
    found = []
    for number, sample in enumerate(samples, first):
        if fixes is not None and number % 20 == 3:
            filter_.use_velocity(fixes(sample))
        found.append(filter_.update(sample))
    return found


def tilt_deg(q_nb: Quat) -> float:
    _, x, y, _ = q_nb
    return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y)))) / DEG

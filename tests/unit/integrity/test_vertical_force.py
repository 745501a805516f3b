"""The vertical force against the receiver's height."""

import math

import numpy as np
import pytest

from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Trust
from h2nav.integrity.findings import Kind, Sensor, SensorKind
from h2nav.integrity.strapdown import Strapdown
from h2nav.integrity.vertical_force import VerticalForce
from h2nav.integrity.watch import Watch
from h2nav.maths.units import GRAVITY_M_S2

IMU = Sensor(SensorKind.IMU, 1)
LEVEL = (1.0, 0.0, 0.0, 0.0)
STILL = (0.0, 0.0, 0.0)


def flown(scale: float, climb_m_s2, jump_m: float = 0.0, end_s: float = 30.0):
    """The alarm after a vertical flight; ``climb_m_s2`` by time, a jump of the height at 20 s."""
    watch = Watch()
    strapdown = Strapdown(watch)
    vertical = VerticalForce(strapdown)
    random = np.random.default_rng(3)
    height = climb = 0.0
    alarm, seen = None, []
    for i in range(round(100 * end_s)):
        t_us, up = 10_000 * i, climb_m_s2(0.01 * i)
        climb += 0.01 * up
        height += 0.01 * climb
        is_wrong = i > 1500
        force = (0.0, 0.0, -(GRAVITY_M_S2 + up) * (scale if is_wrong else 1.0))
        watch.check(ImuSample(t_us, STILL, force, None))
        estimate = AttitudeEstimate(
            t_us, LEVEL, STILL, STILL, STILL, 0.01, 0.05, Trust.ALIGNED | Trust.CONVERGED
        )
        strapdown.add(t_us, estimate)
        if i % 20 == 0:
            off = jump_m if i > 2000 else 0.0
            vertical.take(t_us, height + off + 0.3 * float(random.standard_normal()))
            alarm = vertical.alarm(IMU, t_us)
            seen.append(alarm is not None)
    return alarm, seen


def rising(t_s: float) -> float:
    """Climbs and sinks by 8 m/s within some seconds."""
    return 4.0 * math.sin(t_s)


@pytest.mark.parametrize("scale", [1.15, 0.85])
def test_a_wrong_scale_is_told_by_its_size(scale) -> None:
    alarm, _ = flown(scale, rising)
    assert alarm is not None
    assert alarm.kind is Kind.ACCELEROMETER_BIAS_STEP
    assert alarm.size == pytest.approx(0.15 * GRAVITY_M_S2, rel=0.3)
    assert ("much" if scale > 1.0 else "little") in alarm.evidence


def test_neither_climbs_nor_a_jump_of_the_height_accuse_anybody() -> None:
    assert not any(flown(1.0, rising)[1])
    assert not any(flown(1.0, rising, jump_m=40.0)[1])

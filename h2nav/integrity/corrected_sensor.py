"""A sensor proved wrong: what has been taken off its samples, and until when it is told."""

import math
from collections.abc import Collection
from typing import NamedTuple

from h2nav.attitude.samples import SensorCorrection, SensorErrors, Vec3
from h2nav.integrity.cause_alarms import cause_alarm
from h2nav.integrity.causes import Cause, Explained
from h2nav.integrity.findings import Alarm, Sensor
from h2nav.integrity.velocity_rows import VelocityRow, plus

# It is told to be wrong while it is by this share of what was found.
REMAINS = 0.5


class _Corrected(NamedTuple):
    cause: Cause
    shown: Explained  # by what
    before_b: Vec3  # its bias before, rad/s or m/s^2, body
    since_us: int  # when it began to contradict


class CorrectedSensor:
    """The latest sensor of an IMU to be corrected.

    Attributes:
        force_b: what has been taken off the accelerometer in all, m/s^2, body.
    """

    def __init__(self) -> None:
        self._latest: _Corrected | None = None
        self.force_b: Vec3 = (0.0, 0.0, 0.0)

    def take(
        self, cause: Cause, shown: Explained, off: SensorCorrection, first: VelocityRow, t_us: int
    ) -> None:
        """Takes a correction.

        Args:
            first: the row of the window in which its bias was still right.
            t_us: when it began to contradict.
        """
        before = self._latest
        before_b, since_us = _bias_of(cause, first.begun.moment.bias_b, first.errors), t_us
        if before is not None:
            since_us = before.since_us
            before_b = before.before_b if before.cause is cause else before_b
        self._latest = _Corrected(cause, shown, before_b, since_us)
        self.force_b = plus(self.force_b, 1.0, off.force_b)

    def review(self, errors: SensorErrors, rate_b: Vec3) -> None:
        """Forgets it when the filter has learnt back most of it, or the fault has ended.

        Args:
            rate_b: the gyro's bias, rad/s, body.
        """
        latest = self._latest
        if latest is None:
            return
        now_b = _bias_of(latest.cause, rate_b, errors)
        if math.dist(now_b, latest.before_b) < REMAINS * latest.shown.step:
            self._latest = None

    def alarms(self, imu: Sensor, t_us: int, cleared: Collection[Cause]) -> list[Alarm]:
        """What is told of it; nothing if that was not decided or another IMU shows the same."""
        latest = self._latest
        if latest is None or latest.shown.decided is None or latest.cause in cleared:
            return []
        since_s = (t_us - latest.since_us) * 1e-6
        return [cause_alarm(latest.shown, latest.cause, imu, since_s)]


def _bias_of(cause: Cause, rate_b: Vec3, errors: SensorErrors) -> Vec3:
    return rate_b if cause is Cause.GYRO else errors.force_bias_b

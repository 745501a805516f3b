"""Finds an IMU message that repeats what another one says: the same sensor under two names."""

from h2nav.attitude.samples import ImuSample, Vec3

SAME_TIME_US = 2_000
# Two messages of one sensor differ by the last digit of the shorter one at most.
GYRO_COUNT_RAD_S = 1.1e-3
FORCE_COUNT_M_S2 = 1.1e-2
# At rest, two sensors show the same digits for minutes; beyond this the values have changed.
CHANGE_COUNTS = 5.0
REPEATED = 100


class Twins:
    """Compares the samples of two streams.

    Attributes:
        are_one: both are one sensor.
    """

    def __init__(self) -> None:
        self._counted: ImuSample | None = None
        self._repeated = 0
        self.are_one = False

    def compare(self, one: ImuSample, other: ImuSample) -> None:
        """Takes the newest sample of each."""
        if abs(one.t_us - other.t_us) > SAME_TIME_US:
            return
        if _differ(one, other, 1.0):
            self._repeated = 0
            self.are_one = False
        elif self._counted is None or _differ(one, self._counted, CHANGE_COUNTS):
            self._counted = one
            self._repeated += 1
            self.are_one = self._repeated >= REPEATED


def _differ(one: ImuSample, other: ImuSample, counts: float) -> bool:
    return _apart(one.w_b, other.w_b, counts * GYRO_COUNT_RAD_S) or _apart(
        one.f_b, other.f_b, counts * FORCE_COUNT_M_S2
    )


def _apart(p: Vec3, q: Vec3, limit: float) -> bool:
    return abs(p[0] - q[0]) > limit or abs(p[1] - q[1]) > limit or abs(p[2] - q[2]) > limit

"""Compares the messages of two IMUs: whether they show the same sensor."""

from h2nav.attitude.samples import ImuSample
from h2nav.wire.imu import ImuReading

SAME_TIME_US = 2_000
# Two messages of one sensor differ at most by the last digit of the coarser one.
GYRO_COUNT_RAD_S = 1.1e-3
FORCE_COUNT_M_S2 = 1.1e-2
# At rest, two sensors repeat the same digits for minutes; beyond this the values have changed.
CHANGE_COUNTS = 5.0
REPEATED = 100


class Twins:
    """Compares the samples of two streams."""

    def __init__(self) -> None:
        self._counted: ImuSample | None = None
        self._repeated = 0

    def compare(self, one: ImuSample, other: ImuSample) -> bool:
        """Takes the newest sample of each; returns whether both prove to be one sensor."""
        if not -SAME_TIME_US <= one.t_us - other.t_us <= SAME_TIME_US:
            return False
        if are_apart(one, other):
            self._repeated = 0
        elif self._counted is None or are_apart(one, self._counted, CHANGE_COUNTS):
            self._counted = one
            self._repeated += 1
            return self._repeated >= REPEATED
        return False


def are_apart(
    one: ImuSample | ImuReading, other: ImuSample | ImuReading, counts: float = 1.0
) -> bool:
    """Whether rates or forces of two differ by more than so many digits of the coarsest message."""
    (p, q, r), (u, v, w) = one.w_b, other.w_b
    limit = counts * GYRO_COUNT_RAD_S
    if abs(p - u) > limit or abs(q - v) > limit or abs(r - w) > limit:
        return True
    (p, q, r), (u, v, w) = one.f_b, other.f_b
    limit = counts * FORCE_COUNT_M_S2
    return abs(p - u) > limit or abs(q - v) > limit or abs(r - w) > limit

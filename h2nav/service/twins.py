"""Compares two IMUs: whether they are the same sensor, and whether their readings agree."""

from h2nav.attitude.samples import ImuSample

SAME_TIME_US = 2_000
# Two messages of one sensor differ at most by the last digit of the coarser one.
GYRO_COUNT_RAD_S = 1.1e-3
FORCE_COUNT_M_S2 = 1.1e-2
# At rest, two sensors repeat the same digits for minutes; beyond this the values have changed.
CHANGE_COUNTS = 5.0
REPEATED = 100
# Means of about this many samples are compared, so that noise and vibration do not matter.
MEAN_OF = 100
# Autopilots calibrate gyros at boot and accelerometers before: the rest is far smaller.
RATE_APART_RAD_S = 0.025
FORCE_APART_M_S2 = 0.4


class Twins:
    """Compares the samples of two streams."""

    def __init__(self) -> None:
        self._counted: ImuSample | None = None
        self._repeated = 0
        self._apart = [0.0] * 6

    @property
    def rates_agree(self) -> bool:
        """Whether the gyros agree."""
        return max(map(abs, self._apart[:3])) < RATE_APART_RAD_S

    @property
    def forces_agree(self) -> bool:
        """Whether the accelerometers agree."""
        return max(map(abs, self._apart[3:])) < FORCE_APART_M_S2

    def compare(self, one: ImuSample, other: ImuSample) -> bool:
        """Takes the newest sample of each; returns whether both prove to be one sensor."""
        if abs(one.t_us - other.t_us) > SAME_TIME_US:
            return False
        pairs = zip((*one.w_b, *one.f_b), (*other.w_b, *other.f_b), strict=True)
        for i, (a, b) in enumerate(pairs):
            self._apart[i] += (a - b - self._apart[i]) / MEAN_OF
        if _differ(one, other, 1.0):
            self._repeated = 0
        elif self._counted is None or _differ(one, self._counted, CHANGE_COUNTS):
            self._counted = one
            self._repeated += 1
            return self._repeated >= REPEATED
        return False


def _differ(one: ImuSample, other: ImuSample, counts: float) -> bool:
    (p, q, r), (u, v, w) = one.w_b, other.w_b
    limit = counts * GYRO_COUNT_RAD_S
    if abs(p - u) > limit or abs(q - v) > limit or abs(r - w) > limit:
        return True
    (p, q, r), (u, v, w) = one.f_b, other.f_b
    limit = counts * FORCE_COUNT_M_S2
    return abs(p - u) > limit or abs(q - v) > limit or abs(r - w) > limit

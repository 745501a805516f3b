"""By how much measurements show an attitude to be off, or that it may be: its deviations open."""

import math
from collections.abc import Iterable

from h2nav.attitude.samples import AttitudeEstimate
from h2nav.integrity.kernel.windows import JUDGED_US
from h2nav.integrity.velocity_windows import LONG_S
from h2nav.maths.units import GRAVITY_M_S2

# Errors that are shown no more are kept for this long.
OPEN_S = 10.0
JUDGED_S = 1e-6 * JUDGED_US
KEPT_OPEN = math.exp(-JUDGED_S / OPEN_S)
LONG_US = 1e6 * LONG_S
# Two attitudes of one vehicle differ by more than this many deviations of their difference only if
# they do not know how wrong they are.
APART = 2.0


class OpenedErrors:
    """Keeps errors of tilt and heading beyond what the filter knows.

    Attributes:
        is_any: there are some.
    """

    def __init__(self) -> None:
        self._tilt_rad = self._heading_rad = 0.0
        # by which a false velocity would bend the attitude, if it may be one
        self._drift_tilt_rad, self._drift_us = 0.0, 0
        self.is_any = False

    def open(self, tilt_rad: float, heading_rad: float) -> None:
        """Takes what was missed at once."""
        self._set(max(self._tilt_rad, tilt_rad), max(self._heading_rad, heading_rad))

    def correct(self, tilt_rad: float, heading_rad: float | None = None) -> None:
        """Takes what a correction leaves; without a heading that stays."""
        self._set(tilt_rad, self._heading_rad if heading_rad is None else heading_rad)

    def judge(self, tilts_rad: Iterable[float], headings_rad: Iterable[float]) -> None:
        """Takes what measurements show now, at every judgement; earlier errors fade."""
        tilt_rad = max(KEPT_OPEN * self._tilt_rad, *tilts_rad, 0.0)
        heading_rad = max(KEPT_OPEN * self._heading_rad, *headings_rad, 0.0)
        self._set(min(tilt_rad, math.pi), min(heading_rad, math.pi))

    def suspect_drift(self, t_us: int, drift_m_s2: float, *, is_suspicious: bool) -> None:
        """Takes by how much the velocity drifts if it is the false one."""
        if is_suspicious:
            self._drift_us = t_us
        if t_us - self._drift_us < LONG_US:
            self._drift_tilt_rad = max(self._drift_tilt_rad, drift_m_s2 / GRAVITY_M_S2)
            self._set(self._tilt_rad, self._heading_rad)

    def bound_drift(self, speed_m_s: float) -> None:
        """A drift that went on would have left what the vehicle's velocity can be."""
        gone = JUDGED_S * GRAVITY_M_S2 / speed_m_s
        self._drift_tilt_rad /= 1.0 + gone * self._drift_tilt_rad

    def _set(self, tilt_rad: float, heading_rad: float) -> None:
        self._tilt_rad, self._heading_rad = tilt_rad, heading_rad
        self.is_any = tilt_rad > 0.0 or heading_rad > 0.0 or self._drift_tilt_rad > 0.0

    def of(self, estimate: AttitudeEstimate) -> AttitudeEstimate:
        """The estimate with deviations opened to them."""
        if not self.is_any:
            return estimate
        t_us, q_nb, w_b, bias_b, innovation_n, sigma_tilt_rad, trust, sigma_heading_rad = estimate
        tilt_rad = math.hypot(sigma_tilt_rad, max(self._tilt_rad, self._drift_tilt_rad))
        heading_rad = math.hypot(sigma_heading_rad, self._heading_rad)
        # `_replace` costs three times as much, for every sample after a doubt.
        return tuple.__new__(
            AttitudeEstimate,
            (t_us, q_nb, w_b, bias_b, innovation_n, tilt_rad, trust, heading_rad),
        )


def shown_by_difference(
    apart_rad: float, first_rad: float, second_rad: float
) -> tuple[float, float]:
    """What each of two attitudes is probably off by; zeros if their deviations explain it.

    Source: docs/integrity.md Eq. (14).

    Args:
        apart_rad: their difference.
        first_rad: deviation of one.
        second_rad: of the other.
    """
    both_rad = math.hypot(first_rad, second_rad)
    if not apart_rad > APART * both_rad > 0.0:
        return 0.0, 0.0
    return apart_rad * first_rad / both_rad, apart_rad * second_rad / both_rad

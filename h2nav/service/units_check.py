"""Checks the units at rest, where gravity and the earth field are known."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from h2nav.attitude.samples import ImuSample
from h2nav.maths.units import GRAVITY_M_S2

REST_RATE_RAD_S = 0.05
REST_SAMPLES = 50
FORCE_TOLERANCE = 0.1
FIELD_LOW_UT = 20.0
FIELD_HIGH_UT = 70.0


class Complaint(NamedTuple):
    """An implausible quantity."""

    quantity: str  # its name; identifies the complaint while the figures change
    text: str  # for people, with the likely cause


class UnitsCheck:
    """Averages |f| and |B| over quiet samples and compares them with the earth's.

    A window without a complaint ends the check; after one with complaints the next is evaluated,
    so that a temporary fault is not held against the sensors for ever.
    """

    def __init__(self) -> None:
        self.complaints: tuple[Complaint, ...] = ()  # of the latest window
        self.is_over = False  # the units were found to be right
        self._begin()

    def add(self, sample: ImuSample) -> bool:
        """Takes a sample; returns True if it completes a window."""
        if self.is_over or math.hypot(*sample.w_b) > REST_RATE_RAD_S or not any(sample.f_b):
            return False
        self._samples += 1
        self._force_sum += math.hypot(*sample.f_b)
        if sample.m_b_ut is not None:
            self._fields += 1
            self._field_sum_ut += math.hypot(*sample.m_b_ut)
        if self._samples < REST_SAMPLES:
            return False
        self.complaints = tuple(self._judge())
        self.is_over = not self.complaints
        self._begin()
        return True

    def _begin(self) -> None:
        self._samples = 0
        self._force_sum = 0.0
        self._fields = 0
        self._field_sum_ut = 0.0

    def _judge(self) -> Iterator[Complaint]:
        force = self._force_sum / self._samples
        if abs(force / GRAVITY_M_S2 - 1.0) > FORCE_TOLERANCE:
            likely = _likely(force / GRAVITY_M_S2)
            yield Complaint("acc", f"|acc| at rest {force:.3g} m/s2, not 9.8{likely}")
        if self._fields:
            field_ut = self._field_sum_ut / self._fields
            if not FIELD_LOW_UT <= field_ut <= FIELD_HIGH_UT:
                likely = _likely(field_ut / 45.0)
                yield Complaint("mag", f"|mag| at rest {field_ut:.3g} uT, not 20-70{likely}")


def _likely(ratio: float) -> str:
    """Names the mistake that explains a value `ratio` times the right one."""
    slips = (
        (1e-3, ": sent in units of 1/1000"),
        (1e3, ": sent as thousandths of the unit"),
        (1.0 / GRAVITY_M_S2, ": sent in g as if in m/s2"),
        (GRAVITY_M_S2, ": sent in m/s2 as if in g"),
        (1e-2, ": sent in gauss as if in uT"),
        (1e6, ": sent 10^6 too large"),
    )
    for factor, text in slips:
        if abs(math.log(max(ratio, 1e-12) / factor)) < math.log(1.6):
            return text
    return ""

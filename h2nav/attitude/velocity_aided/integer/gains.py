"""The gains of the velocity-aided filter as integers.

Source: docs/fixed-point.md Eq. (24), (25).
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple, NoReturn

from h2nav.attitude.integer.motion import MAX_DT_US
from h2nav.attitude.record import row
from h2nav.attitude.samples import EarthField
from h2nav.attitude.velocity_aided.gains import GainSets, VelocityAidedGains
from h2nav.attitude.velocity_aided.integer.memory import FRAME, SETS, Gains, Sample
from h2nav.attitude.velocity_aided.memory import Gains as FloatGains
from h2nav.attitude.velocity_aided.parameters import PARAMETERS, Timing
from h2nav.errors import BadInput
from h2nav.maths.units import GRAVITY_M_S2

PACK_BIAS = 8
# what the velocity along the nose can be
_FORWARD = row(Sample, "forward_speed")
FASTEST_M_S = (_FORWARD.range or (0, 0))[1] * 2.0**-_FORWARD.q * GRAVITY_M_S2
# a gain times the longest frame stays below one
LARGEST_GAIN = 1e6 / (FRAME * MAX_DT_US)
LARGEST_FIX_GAIN = 8.0
MIN_GAIN = 2.0**-22


class IntegerGains(NamedTuple):
    """The kernel's gains and their rounding error."""

    gains: Gains  # of the kernel
    rounding_error: float  # largest relative change of a gain


def packed(value: float) -> int:
    """A gain as mantissa of 15 digits and shift: value = m 2^-(15 + s), packed m * 32 + s + 8."""
    mantissa, exponent = math.frexp(value)
    m = min(round(mantissa * 2.0**15), 32767)
    return m * 32 + PACK_BIAS - exponent


def unpacked(pack: int) -> float:
    """The gain of a `packed` number."""
    return float((pack >> 5) * 2.0 ** -(15 + (pack & 31) - PACK_BIAS))


def integer_gains(gains: VelocityAidedGains, place: str) -> IntegerGains:
    """The integers of a gain file of kind velocity_aided.

    Args:
        gains: of the file.
        place: named in errors.

    Raises:
        BadInput: a parameter or a gain is outside its format.
    """
    image = _Image(Gains(), place)
    image.check_cruise_speed(gains.cruise_speed_m_s)
    _set_parameters(image, gains.kernel, _timing(gains.rate_hz))
    return IntegerGains(image.gains, _set_tables(image, gains.kernel))


def rounded_sets(g: Gains, exact: GainSets) -> GainSets:
    """The gain sets that the kernel's gains represent; bounds and periods as in `exact`."""

    def rows_of(packs: Sequence[int]) -> tuple[tuple[float, ...], ...]:
        return tuple(
            tuple(map(unpacked, packs[first : first + SETS]))
            for first in range(0, len(packs), SETS)
        )

    return exact._replace(
        k_tilt=tuple(map(unpacked, g.k_tilt)),
        k_velocity=tuple(map(unpacked, g.k_velocity)),
        k_fix_tilt=rows_of(g.k_fix_tilt),
        k_fix_velocity=rows_of(g.k_fix_velocity),
    )


def field_params(field: EarthField) -> tuple[int, int, int]:
    """Declination, its sine and its cosine, in the kernel's form."""
    angle = math.remainder(field.declination_rad, 2.0 * math.pi)
    return (
        round(angle * 2.0**28),
        round(math.sin(angle) * 2.0**14),
        round(math.cos(angle) * 2.0**14),
    )


class _Image:
    """Writes the kernel's gains, each inside its declared range."""

    def __init__(self, gains: Gains, place: str) -> None:
        self.gains = gains
        self._place = place

    def put(self, name: str, value: float, what: str) -> None:
        """Rounds a value; rejects one outside the format."""
        setattr(self.gains, name, self._rounded(name, value, what))

    def put_list(self, name: str, numbers: Iterable[float], what: str) -> None:
        """Rounds each number of a vector."""
        getattr(self.gains, name)[:] = [self._rounded(name, value, what) for value in numbers]

    def put_gains(self, name: str, gains: Sequence[float], most: float, what: str) -> float:
        """Packed gains; returns the largest relative error of their rounding."""
        for value in gains:
            if not MIN_GAIN <= value < most:
                self._refuse(what, f"{value:g} of {MIN_GAIN:.1g}..{most:g}")
        self.put_list(name, map(packed, gains), what)
        return max(abs(unpacked(packed(value)) / value - 1.0) for value in gains)

    def check_cruise_speed(self, speed_m_s: float) -> None:
        """Rejects a velocity along the nose outside the format of a sample."""
        if speed_m_s > FASTEST_M_S:
            self._refuse("cruise_speed_m_s", f"{speed_m_s:g} of 0..{FASTEST_M_S:.0f}")

    def _rounded(self, name: str, value: float, what: str) -> int:
        low, high = _range(name)
        number = round(value)
        if not low <= number <= high:
            self._refuse(what, f"{number} of {low}..{high}")
        return number

    def _refuse(self, what: str, found: str) -> NoReturn:
        raise BadInput(
            f"{self._place}: {what} is outside what the integer filter holds "
            f"({found}); expected a value nearer to the shipped ones"
        )


def _range(name: str) -> tuple[int, int]:
    limits = row(Gains, name).range
    assert limits is not None
    return limits


def _log(value: float) -> float:
    return 256.0 * math.log2(value)


def _timing(rate_hz: float) -> Timing:
    """The timing: a sample longer than a step is split."""
    parts = math.ceil(1e6 / (rate_hz * MAX_DT_US))
    return Timing(rate_hz * parts, FRAME)


def _set_parameters(image: _Image, g: FloatGains, timing: Timing) -> None:
    for parameter in PARAMETERS:
        if parameter.fixed is not None:
            value = getattr(g, parameter.field)
            for name, number in parameter.fixed.numbers(value, timing).items():
                image.put(name, number, parameter.key)


def _set_tables(image: _Image, g: FloatGains) -> float:
    """Gain sets; returns the largest relative rounding error of a gain."""
    image.put_list("log_set_bounds", map(_log, g.set_bounds), "set_bounds_s4")
    image.put_list("fix_periods_us", (period * 1e6 for period in g.fix_periods), "fix_periods_s")
    return max(
        image.put_gains(name, gains, most, key)
        for name, gains, most, key in (
            ("k_tilt", g.k_tilt, LARGEST_GAIN, "k_tilt_s2"),
            ("k_velocity", g.k_velocity, LARGEST_GAIN, "k_velocity_s"),
            ("k_fix_tilt", g.k_fix_tilt, LARGEST_FIX_GAIN, "k_fix_tilt_s"),
            ("k_fix_velocity", g.k_fix_velocity, LARGEST_FIX_GAIN, "k_fix_velocity"),
        )
    )

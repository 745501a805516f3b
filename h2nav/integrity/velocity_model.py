"""A window of velocity rows as a linear model, with what working sensors leave unknown.

Equations: docs/integrity.md, section 5.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from h2nav.attitude.samples import SensorErrors
from h2nav.integrity.likelihood import HypothesisFit, LinearModel
from h2nav.integrity.strapdown import Moment
from h2nav.integrity.velocity_rows import (
    LENGTH_S,
    Shift,
    VelocityColumns,
    VelocityRow,
    columns,
    felt_m_s2,
)
from h2nav.integrity.velocity_windows import RATE_SIGMA_RAD_S, SCALE_SIGMA, UNKNOWN, ReceiverErrors

# Windows of fewer rows are not looked at.
MIN_ROWS = 6
# Least noise of a receiver's velocity from row to row, m/s: the data sheet of a good one.
NOISE_M_S = 0.05
# Share of the stated accuracy (of the horizontal velocity) that an axis wanders by within 10 s.
WANDERS = math.sqrt(0.5)
# Of a force that turns with the vehicle, where the filter knows no better, m/s^2.
FORCE_SIGMA_M_S2 = 0.1
# Scale and axes of an accelerometer (MPU-6000: 2 % across), which are no unknowns, and for how long
# an acceleration lasts that they make a wrong force of.
FORCE_SCALE_SIGMA, MANOEUVRE_S = 0.02, 3.0
MIN_TILT_RAD = math.radians(0.2)
MIN_HEADING_RAD = math.radians(1.0)
# Unknowns, by their columns: tilt north and east, heading, gyro's bias and scale (three axes each),
# accelerometer (two axes), latency and half its square, the antenna's place (three axes).
TILT, HEADING, RATE, SCALE, FORCE, LAG, ANTENNA = 0, 2, 3, 6, 9, 11, 13


class Known(NamedTuple):
    """The knowledge at the end of a window."""

    errors: SensorErrors  # the filter's knowledge of its sensors
    moment: Moment  # of the last mark
    jitter_m_s: float  # noise of single velocities
    receiver: ReceiverErrors = UNKNOWN  # what is not known of delay and antenna
    force_density: float = math.inf  # the most that the velocities allow, squared, m^2/s^3
    lasting_share: float = 1.0  # of the force's scatter
    usual_m_s2: float = math.inf  # horizontal acceleration before the window, rms
    shifts: Sequence[Shift] = ()  # of the force, the latest ones
    period_s: float = 0.01  # of the samples
    is_denied: bool = False  # the velocity, by the places of the same receiver


class VelocityModel:
    """The differences between measured and felt velocity in a window of rows.

    Args:
        rows: of the window, in order.
        known: at its end.

    Attributes:
        columns: effects of the unknowns.
        sigmas: the deviations of the unknowns at the window's beginning if nothing is wrong.
        lengths_s: of the rows.
        force_density: of the noise of the force, squared, m^2/s^3.
        shaken_density: of what its single samples show, likewise.
        noise_m_s: of single velocities.
        hidden_share: of vibrations that do not show in single samples.
    """

    def __init__(self, rows: Sequence[VelocityRow], known: Known) -> None:
        first, last = rows[0].begun.moment, rows[-1].ended.moment
        length_s = 1e-6 * (last.t_us - first.t_us)
        turned = (last.turn_variance - first.turn_variance) / length_s
        gained = (last.gained_variance - first.gained_variance) / length_s
        # The noises, increased by what slow samples miss.
        rate_density = known.errors.rate_density + turned
        self.shaken_density = known.errors.force_density + gained
        self._most_density = min(self.shaken_density, known.force_density)
        moved_m_s2 = max(known.usual_m_s2, felt_m_s2(rows))
        self._least_density = 2.0 * MANOEUVRE_S * (FORCE_SCALE_SIGMA * moved_m_s2) ** 2
        self.force_density = self.force_density_of(known.lasting_share)
        self.lengths_s = [row.length_s for row in rows]
        stated = sum(row.ended.sigma_m_s**2 for row in rows) / len(rows)
        self._wander = WANDERS * WANDERS * stated / LENGTH_S
        self.noise_m_s = max(NOISE_M_S, known.jitter_m_s)
        # Vibration shows in the scatter of the samples unless its frequency is as near to a
        # multiple of their rate as a row can tell from a constant.
        self.hidden_share = min(2.0 * known.period_s * len(rows) / length_s, 1.0)
        self.columns: VelocityColumns = columns(rows)
        self.sigmas = _sigmas(rows[0], known.receiver, length_s, rate_density)

    @property
    def receiver_m_s(self) -> float:
        """The largest change of velocity that delay and antenna may explain, one sigma."""
        squares = [0.0] * len(self.columns.left)
        for place in (LAG, *range(ANTENNA, ANTENNA + 3)):
            size = self.sigmas[place]
            for i, effect in enumerate(self.columns.of[place]):
                squares[i] += (size * effect) ** 2
        return math.sqrt(max(squares))

    def force_density_of(self, share: float) -> float:
        """Of the noise of the force if a share of its scatter lasts, squared, m^2/s^3."""
        return min(max(share * self.shaken_density, self._least_density), self._most_density)

    def with_noise(self, force_density: float) -> LinearModel:
        """The model for a density of the force's noise, squared, m^2/s^3."""
        noise = (self.noise_m_s, force_density + self._wander)
        return LinearModel(self.lengths_s, self.columns.left, self.columns.of, noise)

    def fit_correlated(
        self,
        places: Sequence[int],
        root: Sequence[Sequence[float]],
        means: Sequence[float],
        scale: float,
    ) -> HypothesisFit:
        """Fits with some unknowns in axes in which they are independent and of unit deviation.

        Args:
            places: of these unknowns.
            root: of their covariance, a lower triangle: they are the means and the root times the
                fit's.
            means: of them.
            scale: of the deviations of all noises.
        """
        of, sigmas, left = list(self.columns.of), list(self.sigmas), self.columns.left
        for place, mean in zip(places, means, strict=True):
            left = [part - mean * effect for part, effect in zip(left, of[place], strict=True)]
        for i, place in enumerate(places):
            turned = [0.0] * len(left)
            for other, row in zip(places[i:], root[i:], strict=True):
                pairs = zip(turned, self.columns.of[other], strict=True)
                turned = [so_far + row[i] * effect for so_far, effect in pairs]
            of[place], sigmas[place] = turned, 1.0
        noise = (scale * self.noise_m_s, scale * scale * (self.force_density + self._wander))
        return LinearModel(self.lengths_s, left, of, noise).fit(sigmas)


def _sigmas(
    row: VelocityRow, receiver: ReceiverErrors, length_s: float, rate_density: float
) -> list[float]:
    """Deviations of the unknowns at the beginning of a window's first row if nothing is wrong."""
    first, errors = row.begun.moment, row.errors
    tilt = max(first.sigma_tilt_rad / math.sqrt(2.0), MIN_TILT_RAD)
    heading = min(max(first.sigma_heading_rad, MIN_HEADING_RAD), math.pi)
    # The rate noise turns an attitude like a bias of this size, as seen by the velocity.
    by_noise = 4.0 * rate_density / (3.0 * length_s)
    of_rate = by_noise + RATE_SIGMA_RAD_S**2
    rate = [math.sqrt(of_rate + variance) for variance in errors.gyro_variance]
    force = [math.sqrt(v) if v > 0.0 else FORCE_SIGMA_M_S2 for v in errors.force_variance]
    lag_s = receiver.delay_s
    return [
        tilt,
        tilt,
        heading,
        *rate,
        *[SCALE_SIGMA] * 3,
        *force,
        lag_s,
        lag_s**2 / 2.0,
        *receiver.antenna_b,
    ]

"""The heading of a filter, confirmed, contradicted or found by the velocities of fixes."""

import math
from abc import abstractmethod
from typing import NamedTuple

from h2nav.attitude.velocity_aided.doubted_sensors import DoubtedSensors
from h2nav.attitude.velocity_aided.heading_witness import (
    HIGH_PASS_S,
    INFLATION,
    KNOWN_RAD,
    Heading,
    VelocityNoise,
    velocity_walk,
)
from h2nav.attitude.velocity_aided.velocity_aiding import TimedFix
from h2nav.maths.units import DEG

# A heading that differs from that of the velocities by more deviations, and by more in total, is
# doubted: iron may have bent the field. Of the regression this many of its own deviations count.
DOUBT, MIN_DOUBT_RAD, SHOWN = 3.0, 4.0 * DEG, 2.0
# A field that is refused for longer is weighed against the filter as if for the first time,
HEARING_S = 10.0
# if its norm and dip are the earth's: relative, and rad.
WHOLE = 0.03


class RefusedField(NamedTuple):
    """A field with the earth's norm and dip whose heading is refused."""

    turn_rad: float  # from the filter's heading to that by the field
    refused_s: float  # time since a field was used
    has_jumped: bool = False  # it left the heading faster than a gyro is wrong

    def is_heard_by(self, seen: Heading) -> bool:
        """Whether it and velocities contradict the filter, and not each other.

        Iron that leaves norm and dip turns no heading as far, and velocities would show a compass
        that is turned. For one that has jumped they have to speak.
        """
        apart = math.remainder(self.turn_rad - seen.turn_rad, 2.0 * math.pi)
        is_far = abs(self.turn_rad) > KNOWN_RAD
        if self.has_jumped and not (seen.is_known and abs(apart) < abs(seen.turn_rad)):
            return False
        return self.refused_s > HEARING_S and is_far and abs(apart) < seen.limit_rad


class HeadingState(NamedTuple):
    """The state of a filter's heading."""

    age_s: float  # time since the tilt was found
    turned_rad: float  # sum of all corrections of the heading so far
    variance: float  # from the covariance, rad^2
    drift_rad_s: float  # deviation of the gyro's bias about the vertical


class VelocityHeading(DoubtedSensors):
    """The heading as velocities show it; an arithmetic gives how its kernel holds a heading."""

    def _ask_velocity(self, fix: TimedFix, is_in_air: bool) -> bool:
        """Adopts the heading from velocities, if it contradicts the filter's.

        Args:
            fix: used with the next sample.
            is_in_air: an attitude in the air is being found, and the heading with it.

        Returns:
            Whether the heading is another one now.
        """
        heading = self._heading()
        if is_in_air or heading.age_s < HIGH_PASS_S:
            return False
        walk = velocity_walk(*self._noise_densities)
        sigma_m_s = math.sqrt(fix.variance)
        noise = VelocityNoise(sigma_m_s, walk, heading.drift_rad_s)
        seen = self._witness.take(fix.v_n, fix.earlier, heading.turned_rad, fix.period_s, noise)
        # A witness that has become less certain still keeps a turned compass away.
        is_witnessed = seen is not None and (seen.is_known or self._is_witnessed)
        self._set_witnessed(is_witnessed, 0.0 if seen is None else seen.off_rad)
        if seen is None:
            return False
        if seen.is_known:
            self._compare(seen, heading.variance)
        if seen.contradicts:
            self._find_heading(seen.turn_rad, seen.sigma_rad)
            return True
        if seen.off_rad > 0.0 and self._heading_is_unknown:
            # It stays unknown, but from nearby the filter's linear model finds the rest.
            self._turn_heading(seen.turn_rad)
            self._witness.adopt(seen.turn_rad)
            return True
        refused = self._refused_field()
        if refused is None or not refused.is_heard_by(seen):
            return False
        self._find_heading(refused.turn_rad, seen.sigma_rad)
        return True

    def _find_heading(self, turn_rad: float, sigma_rad: float) -> None:
        """Turns to another heading, of this deviation."""
        self._turn_heading(turn_rad)
        self._witness.adopt(turn_rad)
        # Latency and tilt were estimated from velocities turned the wrong way.
        self._limit_heading(INFLATION * sigma_rad)

    def _compare(self, seen: Heading, variance: float) -> None:
        """Confirms the heading by velocities, or doubts the field that gave it."""
        off, sigma = abs(seen.turn_rad), SHOWN * seen.sigma_rad
        if off * off > DOUBT**2 * (variance + sigma**2) and off > MIN_DOUBT_RAD:
            self._doubt_field()
        elif not seen.contradicts:
            self._confirm(max(off, sigma))

    # --- what an arithmetic gives ---------------------------------------------------------------

    @abstractmethod
    def _heading(self) -> HeadingState:
        """The state of the heading."""

    @abstractmethod
    def _turn_heading(self, angle_rad: float) -> None:
        """Turns by an angle at once, and forgets the state of the heading."""

    @property
    @abstractmethod
    def _noise_densities(self) -> tuple[float, float]:
        """Of the rate, squared, rad^2/s, and of the force, squared, m^2/s^3."""

    @property
    @abstractmethod
    def _heading_is_unknown(self) -> bool:
        """Whether nothing has shown the heading."""

    @property
    @abstractmethod
    def _is_witnessed(self) -> bool:
        """Whether velocities show the heading."""

    @abstractmethod
    def _set_witnessed(self, is_witnessed: bool, off_rad: float) -> None:
        """Sets whether velocities show the heading now, and by how much it is probably off."""

    @abstractmethod
    def _confirm(self, shown_rad: float) -> None:
        """Notes that velocities have confirmed the heading to this accuracy."""

    @abstractmethod
    def _doubt_field(self) -> None:
        """Notes that velocities have contradicted the field's heading."""

    @abstractmethod
    def _refused_field(self) -> RefusedField | None:
        """The newest field, if its norm and dip are the earth's and its heading is refused."""

    @abstractmethod
    def _limit_heading(self, sigma_rad: float) -> None:
        """Sets the accuracy of a heading from velocities; nothing is known of the fixes."""

"""Heading from measured velocity: accelerations are seen by both force and receiver.

The filter's horizontal velocity gained from the force, with all heading corrections undone, and the
measured one differ by a rotation about the vertical: a complex regression. Both go through two
high-passes, which remove a tilt error and the unknown initial velocity.

Source: docs/filter.md Eq. (45) - (47).
"""

import cmath
import math
from collections.abc import Sequence
from typing import NamedTuple

from h2nav.maths.units import DEG, GRAVITY_M_S2

# The receiver's latency is unknown before the heading is: each of these is tried, s.
LATENCIES_S = (0.0, 0.1, 0.2, 0.3)
HIGH_PASS_S = 4.0
MEMORY_S = 90.0
# Floor of the regression's deviation: real receivers are worse than their scatter suggests.
INFLATION = 3.0
KNOWN_RAD = 12.0 * DEG
# Ratio of measured to felt velocity beyond which one of them is not this vehicle's velocity.
LEAST_RATIO, MOST_RATIO = 0.6, 1.6
# Between two fixes the velocity changes as felt, except for the noise of both and a tilt.
JUMP_SIGMAS, JUMP_M_S2 = 7.0, 5.0


class Heading(NamedTuple):
    """The result of the regression."""

    turn_rad: float  # from the filter's heading to the regression's
    sigma_rad: float  # its deviation

    @property
    def contradicts(self) -> bool:
        """Whether the filter's heading is certainly wrong."""
        return abs(self.turn_rad) > max(KNOWN_RAD, INFLATION * self.sigma_rad)


def velocity_walk(gyro_density: float, accel_density: float) -> float:
    """Variance of the felt velocity over the time of the high-passes, (m/s)^2.

    A constant tilt cancels, one that walks does not.

    Args:
        gyro_density: of the gyro's noise, squared, rad^2/s.
        accel_density: of the force's noise, squared, m^2/s^3.
    """
    tilt = (GRAVITY_M_S2 * HIGH_PASS_S) ** 2 * gyro_density
    return (tilt + accel_density) * HIGH_PASS_S


class _HighPass:
    """Two first-order high-passes in series, of increments."""

    def __init__(self) -> None:
        self.first = 0j
        self.second = 0j

    def load(self, first: complex, second: complex) -> None:
        """Continues from these values."""
        self.first, self.second = first, second

    def add(self, change: complex, keep: float) -> complex:
        before = self.first
        self.first = keep * (before + change)
        self.second = keep * (self.second + self.first - before)
        return self.second


class HeadingWitness:
    """Regression of measured on felt velocity, over `MEMORY_S`."""

    def __init__(self) -> None:
        self.clear()

    def clear(self, blind_s: float = 0.0) -> None:
        """Forgets everything, and uses no fix for a while: what is felt is known to be wrong."""
        self._blind_s = blind_s
        self._fixes = 0
        self._velocity = 0j
        self._gained = [0j] * len(LATENCIES_S)
        self._measured = _HighPass()
        self._felt = [_HighPass() for _ in LATENCIES_S]
        self._product = [0j] * len(LATENCIES_S)
        self._energy = [0.0] * len(LATENCIES_S)
        self._power = 0.0
        self._noise = 0.0
        self._weight = 0.0

    def interrupt(self) -> None:
        """The velocity gained starts again: the next fix is only where the following ones begin."""
        self._fixes = 0

    def take(
        self,
        v_n: Sequence[float],
        gained: Sequence[tuple[float, float]],
        turned_rad: float,
        period_s: float,
        sigma_m_s: float,
        walk_m2_s2: float,
    ) -> Heading | None:
        """Adds a fix; returns the heading known after it, None while that is uncertain.

        Args:
            v_n: velocity north and east, m/s.
            gained: velocity gained from the force until the fix's time, for each latency, s.
            turned_rad: sum of all corrections of the heading.
            period_s: time since the previous fix.
            sigma_m_s: deviation of the velocity.
            walk_m2_s2: variance of the felt velocity within the high-passes; `velocity_walk`.
        """
        if self._blind_s > 0.0:
            self._blind_s -= period_s
            return None
        velocity = complex(v_n[0], v_n[1])
        back = cmath.exp(-1j * turned_rad) * GRAVITY_M_S2
        felt = [complex(*part) for part in gained]
        self._fixes += 1
        if self._fixes > 1:
            keep = math.exp(-period_s / HIGH_PASS_S)
            forget = math.exp(-period_s / MEMORY_S)
            jump = abs(velocity - self._velocity) - abs(back * (felt[0] - self._gained[0]))
            if jump > JUMP_SIGMAS * sigma_m_s + JUMP_M_S2 * period_s:
                # No force moves a vehicle like this: the receiver jumped; earlier data are void.
                self.clear()
                return None
            v = self._measured.add(velocity - self._velocity, keep)
            for i, high_pass in enumerate(self._felt):
                c = high_pass.add(back * (felt[i] - self._gained[i]), keep)
                self._product[i] = forget * self._product[i] + c.conjugate() * v * period_s
                self._energy[i] = forget * self._energy[i] + abs(c) ** 2 * period_s
            self._power = forget * self._power + abs(v) ** 2 * period_s
            self._noise = forget * self._noise + (sigma_m_s**2 + walk_m2_s2) * period_s
            self._weight = forget * self._weight + period_s
        self._velocity, self._gained = velocity, felt
        return self._heading(turned_rad)

    def _heading(self, turned_rad: float) -> Heading | None:
        best = max(range(len(LATENCIES_S)), key=self._explained)
        energy = self._energy[best]
        if energy <= 0.0:
            return None
        size = abs(self._product[best])
        left = max(self._power - size * size / energy, 0.0) + self._noise
        sigma_rad = math.sqrt(left / (self._weight * energy))
        if not (sigma_rad < KNOWN_RAD and LEAST_RATIO < size / energy < MOST_RATIO):
            return None
        turn = math.remainder(cmath.phase(self._product[best]) - turned_rad, 2.0 * math.pi)
        return Heading(turn, sigma_rad)

    def _explained(self, i: int) -> float:
        energy = self._energy[i]
        return abs(self._product[i]) ** 2 / energy if energy > 0.0 else 0.0

    def values(self) -> tuple[float, ...]:
        """The complete state, as flat numbers of constant count."""
        complexes = [self._velocity, self._measured.first, self._measured.second]
        for i, high_pass in enumerate(self._felt):
            complexes += [self._gained[i], high_pass.first, high_pass.second, self._product[i]]
        flat = [part for number in complexes for part in (number.real, number.imag)]
        head = (self._blind_s, self._fixes, self._power, self._noise, self._weight)
        return (*head, *self._energy, *flat)

    def load(self, values: Sequence[float]) -> None:
        """Continues where `values` was taken."""
        count = len(LATENCIES_S)
        self._blind_s, self._fixes = values[0], int(values[1])
        self._power, self._noise, self._weight = values[2:5]
        self._energy = list(values[5 : 5 + count])
        flat = values[5 + count :]
        numbers = [complex(flat[i], flat[i + 1]) for i in range(0, len(flat), 2)]
        self._velocity = numbers[0]
        self._measured.load(*numbers[1:3])
        for i, high_pass in enumerate(self._felt):
            self._gained[i], first, second, self._product[i] = numbers[3 + 4 * i : 7 + 4 * i]
            high_pass.load(first, second)


# Number of values in `HeadingWitness.values`.
SIZE = len(HeadingWitness().values())

"""Heading from measured velocity: accelerations are seen by both force and receiver.

The filter's horizontal velocity gained from the force, with all heading corrections undone, and the
measured one differ by a rotation about the vertical: a complex regression. Both go through two
high-passes, which remove a tilt error and the unknown initial velocity. The gyro may have turned
meanwhile: as far as its bias is uncertain, or as the corrections say, if these were right.

Source: docs/filter.md Eq. (45) - (47), (75).
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
# A less certain regression shows nothing at all; a certain one opens the deviation of a heading
# that is further away than so many of its own.
SHOWN_RAD = 30.0 * DEG
OFF_SIGMAS = 2.0
# Ratio of measured to felt velocity beyond which one of them is not this vehicle's velocity.
MIN_RATIO, MAX_RATIO = 0.6, 1.6
# Of a MEMS gyro's bias: its instability, and a minute of the fastest warm-up.
MIN_DRIFT_RAD_S, MAX_DRIFT_RAD_S = 0.01 * DEG, 0.5 * DEG
# Between two fixes the velocity changes as felt, except for the noise of both and a tilt.
JUMP_SIGMAS, JUMP_M_S2 = 7.0, 5.0


class VelocityNoise(NamedTuple):
    """What may be wrong with a measured velocity, and with the felt one."""

    sigma_m_s: float  # deviation of the measured one
    walk_m2_s2: float  # variance of the felt one within the high-passes; `velocity_walk`
    drift_rad_s: float = 0.0  # deviation of the gyro's bias about the vertical


class Heading(NamedTuple):
    """The result of the regression."""

    turn_rad: float  # from the filter's heading to the regression's
    sigma_rad: float  # its deviation

    @property
    def is_known(self) -> bool:
        """Whether it is a witness: another heading has to agree with it."""
        return self.sigma_rad < KNOWN_RAD

    @property
    def limit_rad(self) -> float:
        """A heading further away is certainly wrong."""
        return max(KNOWN_RAD, INFLATION * self.sigma_rad)

    @property
    def contradicts(self) -> bool:
        """Whether the filter's heading is certainly wrong."""
        return self.is_known and abs(self.turn_rad) > self.limit_rad

    @property
    def off_rad(self) -> float:
        """By how much the filter's heading is probably off; 0: it may be right."""
        off = abs(self.turn_rad)
        return off if off > OFF_SIGMAS * self.sigma_rad else 0.0


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
        # moments of energy and product by their age, and the corrections of the heading since
        self._aged = [0.0] * len(LATENCIES_S)
        self._aged_twice = [0.0] * len(LATENCIES_S)
        self._aged_product = [0j] * len(LATENCIES_S)
        self._turned_since = [0.0] * len(LATENCIES_S)
        self._turned_rad = 0.0

    def interrupt(self) -> None:
        """The velocity gained starts again: the next fix is only where the following ones begin."""
        self._fixes = 0

    def adopt(self, turn_rad: float) -> None:
        """The heading turns by as much to what was found: that is no correction of a gyro."""
        self._turned_rad += turn_rad

    def take(
        self,
        v_n: Sequence[float],
        gained: Sequence[tuple[float, float]],
        turned_rad: float,
        period_s: float,
        noise: VelocityNoise,
    ) -> Heading | None:
        """Adds a fix; returns the heading shown after it, None while that is uncertain.

        Args:
            v_n: velocity north and east, m/s.
            gained: velocity gained from the force until the fix's time, for each latency, s.
            turned_rad: sum of all corrections of the heading.
            period_s: time since the previous fix.
            noise: of both velocities.
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
            if jump > JUMP_SIGMAS * noise.sigma_m_s + JUMP_M_S2 * period_s:
                # No force moves a vehicle like this: the receiver jumped; earlier data are void.
                self.clear()
                return None
            v = self._measured.add(velocity - self._velocity, keep)
            self._age(period_s, turned_rad - self._turned_rad, forget)
            product, energy, before = self._product, self._energy, self._gained
            for i, high_pass in enumerate(self._felt):
                c = high_pass.add(back * (felt[i] - before[i]), keep)
                product[i] = forget * product[i] + c.conjugate() * v * period_s
                energy[i] = forget * energy[i] + abs(c) ** 2 * period_s
            self._power = forget * self._power + abs(v) ** 2 * period_s
            variance = noise.sigma_m_s**2 + noise.walk_m2_s2
            self._noise = forget * self._noise + variance * period_s
            self._weight = forget * self._weight + period_s
        self._velocity, self._gained, self._turned_rad = velocity, felt, turned_rad
        return self._heading(turned_rad, noise.drift_rad_s)

    def _age(self, period_s: float, turned_rad: float, forget: float) -> None:
        """Lets all that was felt until now become older."""
        aged, twice, product = self._aged, self._aged_twice, self._aged_product
        since, felt = self._turned_since, zip(self._energy, self._product, strict=True)
        for i, (energy, each) in enumerate(felt):
            twice[i] = forget * (twice[i] + period_s * (2.0 * aged[i] + period_s * energy))
            aged[i] = forget * (aged[i] + period_s * energy)
            product[i] = forget * (product[i] + period_s * each)
            since[i] = forget * (since[i] + turned_rad * energy)

    def _heading(self, turned_rad: float, drift_rad_s: float) -> Heading | None:
        best = max(range(len(LATENCIES_S)), key=self._explained)
        energy = self._energy[best]
        if energy <= 0.0:
            return None
        product, aged = self._product[best], self._aged[best]
        size = abs(product)
        if not MIN_RATIO < size / energy < MAX_RATIO:
            return None
        left = max(self._power - size * size / energy, 0.0) + self._noise
        drift = drift_rad_s**2 + MIN_DRIFT_RAD_S**2
        if aged > 0.0:
            # The corrections of the heading were right if the gyro has turned by as much.
            drift += min(abs(self._turned_since[best]) / aged, MAX_DRIFT_RAD_S) ** 2
        # The felt velocity has turned evenly since: by so much for each second of age.
        own = self._aged_twice[best] + left / (self._weight * drift)
        shared = aged * aged / energy
        across = (self._aged_product[best] * product.conjugate()).imag / size
        rate = across * energy / (size * (own - shared))
        explained = rate * size / energy
        left -= explained * (2.0 * across - explained * (self._aged_twice[best] - shared))
        left = max(left, self._noise)
        sigma_rad = math.sqrt(left * own / (self._weight * energy * (own - shared)))
        if not sigma_rad < SHOWN_RAD:
            return None
        found_rad = cmath.phase(product) - rate * aged / energy
        return Heading(math.remainder(found_rad - turned_rad, 2.0 * math.pi), sigma_rad)

    def _explained(self, i: int) -> float:
        energy = self._energy[i]
        return abs(self._product[i]) ** 2 / energy if energy > 0.0 else 0.0

    def values(self) -> tuple[float, ...]:
        """The complete state, as flat numbers of constant count."""
        complexes = [self._velocity, self._measured.first, self._measured.second]
        for i, high_pass in enumerate(self._felt):
            complexes += [self._gained[i], high_pass.first, high_pass.second]
            complexes += [self._product[i], self._aged_product[i]]
        flat = [part for number in complexes for part in (number.real, number.imag)]
        head = (self._blind_s, self._fixes, self._power, self._noise, self._weight)
        moments = (*self._energy, *self._aged, *self._aged_twice, *self._turned_since)
        return (*head, self._turned_rad, *moments, *flat)

    def load(self, values: Sequence[float]) -> None:
        """Continues where `values` was taken."""
        count = len(LATENCIES_S)
        self._blind_s, self._fixes = values[0], int(values[1])
        self._power, self._noise, self._weight, self._turned_rad = values[2:6]
        moments = [list(values[6 + n * count : 6 + (n + 1) * count]) for n in range(4)]
        self._energy, self._aged, self._aged_twice, self._turned_since = moments
        flat = values[6 + 4 * count :]
        numbers = [complex(flat[i], flat[i + 1]) for i in range(0, len(flat), 2)]
        self._velocity = numbers[0]
        self._measured.load(*numbers[1:3])
        for i, high_pass in enumerate(self._felt):
            self._gained[i], first, second, self._product[i], aged = numbers[3 + 5 * i : 8 + 5 * i]
            self._aged_product[i] = aged
            high_pass.load(first, second)


# Number of values in `HeadingWitness.values`.
SIZE = len(HeadingWitness().values())

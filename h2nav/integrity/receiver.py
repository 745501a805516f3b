"""What a receiver does not say of its velocities: how noisy and how late they are, and of where.

A receiver measures the velocity of its antenna. That of the IMU differs by the turn of the vehicle,
which shows the antenna's place as acceleration shows the delay: both are linear unknowns of every
window of velocities (`velocity_model`), and are handed on from one full window to the next one.

Equations: docs/integrity.md, section 5.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

from h2nav.attitude.samples import Vec3, VelocityFix
from h2nav.integrity.likelihood import dot
from h2nav.integrity.strapdown import Moment
from h2nav.integrity.velocity_model import (
    ANTENNA,
    FORCE,
    FORCE_SIGMA_M_S2,
    LAG,
    Known,
    VelocityModel,
)
from h2nav.integrity.velocity_rows import LENGTH_S, VelocityRow
from h2nav.integrity.velocity_windows import (
    ANTENNA_SIGMA_M,
    DELAY_SIGMA_S,
    ReceiverErrors,
    swept,
)

MAX_DELAY_S = 0.6
# A delay varies by this much from fix to fix, and an antenna bends on its mast.
DELAY_JITTER_S = 0.02
ANTENNA_JITTER_M = 0.02
# Time after which nothing learnt counts: another receiver may have been chosen.
FORGOTTEN_S = 900.0
# A window is used from this share of its length on.
MIN_SHARE = 0.75
# The newest velocities teach nothing until this time has confirmed them: a fault that begins looks
# like a velocity that is late.
UNCONFIRMED_US = 1_500_000
# Windows that the unknowns do not explain count with larger noise, up to this many times.
MAX_NOISE = 3.0
# A place of the antenna counts beyond this many of its deviations.
SIGNIFICANT = 3.0
# A change of what is removed from the velocities that the windows would feel as their jump.
MATERIAL_S = 0.03
MATERIAL_M = 0.05
PLACES = (LAG, ANTENNA, ANTENNA + 1, ANTENNA + 2)
# Shares of a window's information that are tried.
SHARES = (0.1, 0.3, 0.5, 0.7, 0.9)
PRIOR = (DELAY_SIGMA_S, ANTENNA_SIGMA_M, ANTENNA_SIGMA_M, ANTENNA_SIGMA_M)

Matrix = list[list[float]]


class LearntReceiver:
    """Learns a receiver's noise, delay and antenna, and corrects its velocities.

    Attributes:
        delay_s: of its velocities beyond their stamps.
        noise_m_s: scatter of its velocities per axis; 0: not seen yet.
        antenna_b: place of the antenna from the IMU as far as it is significant, m, body.
        errors: deviations of delay and antenna.
    """

    def __init__(self) -> None:
        self.delay_s = 0.0
        self._found_b: Vec3 = (0.0, 0.0, 0.0)
        self.noise_m_s = 0.0
        # covariance of delay and antenna, s and m
        self._covariance = [[PRIOR[i] ** 2 if i == j else 0.0 for j in range(4)] for i in range(4)]
        self._learnt_us = 0  # end of the latest window that was used
        self._note()

    def _note(self) -> None:
        """Works out what is asked for at every velocity."""
        x, y, z = (
            place_m * max(1.0 - SIGNIFICANT**2 * self._covariance[i][i] / place_m**2, 0.0)
            if place_m != 0.0
            else 0.0
            for i, place_m in enumerate(self._found_b, 1)
        )
        # Most antennas are near the centre, and errors that nobody models look like a place.
        self.antenna_b: Vec3 = (x, y, z)
        delay_s = math.sqrt(self._covariance[0][0])
        x, y, z = (
            math.hypot(math.sqrt(self._covariance[i][i]), ANTENNA_JITTER_M) for i in (1, 2, 3)
        )
        self.errors = ReceiverErrors(math.hypot(delay_s, DELAY_JITTER_S), (x, y, z))

    def timely(self, fix: VelocityFix) -> VelocityFix:
        """The fix at the time at which it was true, with the deviation that it really has."""
        t_us = fix.t_us - round(1e6 * self.delay_s)
        return fix._replace(
            t_us=t_us,
            sigma_m_s=max(fix.sigma_m_s, self.noise_m_s),
            removed_s=self.delay_s,
            removed_sigma_s=self.errors.delay_s,
        )

    def centred(self, fix: VelocityFix, moment: Moment) -> VelocityFix:
        """The velocity of the IMU at the time of a fix, with the deviation by the antenna's place.

        Args:
            fix: of the antenna, timely.
            moment: of its time.
        """
        (north, east, down), antenna, errors = fix.v_n, self.antenna_b, self.errors
        variance = fix.sigma_m_s * fix.sigma_m_s
        for place_m, sigma_m, (n, e) in zip(antenna, errors.antenna_b, swept(moment), strict=True):
            north, east = north - place_m * n, east - place_m * e
            variance += 0.5 * sigma_m * sigma_m * (n * n + e * e)
        return fix._replace(v_n=(north, east, down), sigma_m_s=math.sqrt(variance))

    def learn(self, rows: Sequence[VelocityRow], known: Known) -> bool:
        """Learns from a window, if it is full and new; whether the velocities change by it.

        Source: docs/integrity.md Eq. (8).
        """
        self.noise_m_s = known.jitter_m_s
        if not rows or rows[0].begun.moment.t_us < self._learnt_us:
            return False
        newest_us = known.moment.t_us - UNCONFIRMED_US
        used = rows[: bisect_right(rows, newest_us, key=_ended_us)]
        length_s = 1e-6 * (used[-1].ended.moment.t_us - rows[0].begun.moment.t_us) if used else 0.0
        if length_s < MIN_SHARE * LENGTH_S or self._scale(_window(rows, known)) > MAX_NOISE:
            return False
        known = known._replace(moment=used[-1].ended.moment)
        self._learnt_us = known.moment.t_us
        share = length_s / FORGOTTEN_S
        _forget(self._covariance, share)
        self._note()
        return self._update(_window(used, known))

    def _update(self, window: VelocityModel) -> bool:
        scale = self._scale(window)
        if scale > MAX_NOISE:
            return False
        found = [self._with_share(window, scale, share) for share in SHARES]
        before, used_b = _Estimate([0.0] * 4, self._covariance), self.antenna_b
        best = min((before, *found), key=_size)
        self._covariance = best.covariance
        delay_s = min(max(self.delay_s + best.moved[0], 0.0), MAX_DELAY_S)
        is_material = abs(delay_s - self.delay_s) > MATERIAL_S
        self.delay_s = delay_s
        x, y, z = (a + b for a, b in zip(self._found_b, best.moved[1:], strict=True))
        self._found_b = (x, y, z)
        self._note()
        return is_material or math.dist(self.antenna_b, used_b) > MATERIAL_M

    def _scale(self, window: VelocityModel) -> float:
        """By how much the window's residuals exceed its noises; at least 1."""
        model = window.with_noise(window.force_density)
        sigmas = [*window.sigmas]
        for place, sigma in zip(PLACES, PRIOR, strict=True):
            sigmas[place] = sigma
        left = model.square - model.fit(sigmas).explained
        return math.sqrt(max(left / (2 * len(window.lengths_s)), 1.0))

    def _with_share(self, window: VelocityModel, scale: float, share: float) -> "_Estimate":
        """What is known with a share of the window's information, and the rest of what was known.

        Windows share the errors of the accelerometer's scale and of whatever else is not modelled:
        their information does not add up (covariance intersection).
        """
        root = _root([[part / (1.0 - share) for part in row] for row in self._covariance])
        pairs = zip(self._found_b, self.antenna_b, strict=True)
        left = (0.0, *(found_m - used_m for found_m, used_m in pairs))
        fit = window.fit_correlated(PLACES, root, left, scale / math.sqrt(share))
        found, spread = fit.unknowns(), fit.covariance(PLACES)
        moved = [sum(row[j] * found[place] for j, place in enumerate(PLACES)) for row in root]
        half = [[dot(row, line) for line in spread] for row in root]
        return _Estimate(moved, [[dot(line, row) for row in root] for line in half])


def _forget(covariance: Matrix, share: float) -> None:
    """Forgets a share of what was learnt, at most all of it.

    A variance that is cut to what was known at first takes its correlations along: the rest would
    be no covariance.
    """
    for i, prior in enumerate(PRIOR):
        grown = covariance[i][i] + share * prior**2
        kept = min(prior / math.sqrt(grown), 1.0)
        for row in covariance:
            row[i] *= kept
        covariance[i] = [kept * part for part in covariance[i]]
        covariance[i][i] = min(grown, prior**2)


def _ended_us(row: VelocityRow) -> int:
    return row.ended.moment.t_us


def _window(rows: Sequence[VelocityRow], known: Known) -> VelocityModel:
    window = VelocityModel(rows, known)
    for place in (FORCE, FORCE + 1):
        # The filter may have learnt it from velocities that were late or off the centre.
        window.sigmas[place] = max(window.sigmas[place], FORCE_SIGMA_M_S2)
    return window


class _Estimate(NamedTuple):
    """A change of delay and antenna, and the covariance after it."""

    moved: list[float]
    covariance: Matrix


def _size(estimate: _Estimate) -> float:
    """How much is unknown, in shares of what was at the beginning."""
    return sum(estimate.covariance[i][i] / PRIOR[i] ** 2 for i in range(4))


def _root(matrix: Matrix) -> Matrix:
    """Lower triangle whose square is a covariance."""
    root: Matrix = [[0.0] * len(matrix) for _ in matrix]
    for i, row in enumerate(root):
        for j in range(i + 1):
            rest = matrix[i][j] - sum(row[k] * root[j][k] for k in range(j))
            row[j] = math.sqrt(rest) if i == j else rest / root[j][j]
    return root

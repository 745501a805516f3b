"""Decides which of two attitudes the velocity of a GPS receiver supports.

The specific force, turned by our attitude and integrated, must give the change of velocity; turned
by the other attitude it gives another change. The share of the difference that the velocity demands
is 0 if ours is right and 1 if the other is: it is fitted, for heading and tilt separately, to
windows of the last half minute. The latency of the receiver is fitted along, because in a turn it
resembles a heading error.
"""

import math
from collections import deque
from enum import Enum
from operator import mul
from typing import NamedTuple

from h2nav.attitude.samples import ImuSample, VelocityFix
from h2nav.maths.quaternion import Quat, Vec3, rotate

WITNESS_WINDOW_US = 1_900_000
LONGEST_WINDOW_US = 4_000_000
WINDOWS = 15
# Attitudes and their errors change: older evidence says nothing about the present.
EVIDENCE_US = 30_000_000
MIN_WINDOWS = 2
LONGEST_STEP_US = 200_000
# An older difference says nothing about the present.
STALE_US = 500_000
# Smoothing of the acceleration that multiplies the latency.
SMOOTHING_S = 0.1
# Deviation of a change of velocity: a receiver is hardly better. If the residual of the fit exceeds
# the larger one, force and velocity contradict each other whatever the attitude.
MIN_SIGMA_M_S = 0.1
WORST_SIGMA_M_S = 1.0
FIRST_SIGMA_M_S = 0.3
FITS = 3
# Priors: neither attitude is preferred; receivers are late by 0 to 0.2 s.
EXPECTED = (0.5, 0.5, 0.1)
EXPECTED_SIGMA = (2.0, 2.0, 0.1)
# An accelerometer's bias that looks like a tilt.
FORCE_BIAS_M_S2 = 0.1
DECIDED = 3.0  # deviations
# A share further outside of 0 to 1 shows that neither attitude fits.
OUTSIDE = 0.5


class VelocityVerdict(Enum):
    """The attitude that the evidence supports."""

    H2NAV = "h2nav"
    AUTOPILOT = "autopilot"
    UNDECIDED = "undecided"


class Verdicts(NamedTuple):
    """One verdict per part of the attitude."""

    tilt: VelocityVerdict = VelocityVerdict.UNDECIDED
    heading: VelocityVerdict = VelocityVerdict.UNDECIDED


class _Window(NamedTuple):
    """Horizontal changes of velocity, m/s, (2,) each."""

    t_us: int  # its end
    missing: tuple[float, float]  # measured minus predicted with our attitude
    by_tilt: tuple[float, float]  # addition by the other attitude's tilt
    by_heading: tuple[float, float]  # addition by its heading
    by_latency: tuple[float, float]  # addition per second of the receiver's latency


class Integrated:
    """The specific force turned by our attitude, integrated from sample to sample."""

    def __init__(self) -> None:
        self.velocity_n: Vec3 = (0.0, 0.0, 0.0)  # since the beginning, m/s
        self.force_n: Vec3 = (0.0, 0.0, 0.0)  # smoothed, m/s^2
        self.t_us: int | None = None  # of the newest sample; None before the first
        self.breaks = 0  # number of interruptions of the integral

    def add(self, sample: ImuSample, q_nb: Quat) -> None:
        """Takes a sample and our attitude at its time."""
        step_us = 0 if self.t_us is None else sample.t_us - self.t_us
        self.t_us = sample.t_us
        force_n = rotate(q_nb, sample.f_b)
        if sample.clipped or not 0 < step_us <= LONGEST_STEP_US:
            self.force_n = force_n
            self.breaks += 1
            return
        step_s = step_us * 1e-6
        share = min(step_s / SMOOTHING_S, 1.0)
        v, f = self.velocity_n, self.force_n
        n, e, d = force_n
        self.velocity_n = (v[0] + n * step_s, v[1] + e * step_s, v[2] + d * step_s)
        self.force_n = (
            f[0] + share * (n - f[0]),
            f[1] + share * (e - f[1]),
            f[2] + share * (d - f[2]),
        )


class _Start(NamedTuple):
    """Of a window."""

    t_us: int
    breaks: int
    measured: Vec3
    velocity_n: Vec3
    force_n: Vec3


class VelocityWitness:
    """Judges one other attitude against ours."""

    def __init__(self, integrated: Integrated) -> None:
        self._integrated = integrated
        self._start: _Start | None = None
        self._settled_n = integrated.velocity_n
        self._turn: tuple[int, Quat, Quat] | None = None
        self._by_tilt = (0.0, 0.0)
        self._by_heading = (0.0, 0.0)
        self._windows: deque[_Window] = deque(maxlen=WINDOWS)
        self.verdicts = Verdicts()  # by the windows of the last `EVIDENCE_US`

    def differs(self, t_us: int, turn_n: Quat, heading_rad: float) -> None:
        """Takes the turn (NED) from our attitude to the other one, and its heading."""
        self._settle()
        about_down = (math.cos(0.5 * heading_rad), 0.0, 0.0, math.sin(0.5 * heading_rad))
        self._turn = (t_us, turn_n, about_down)
        self._age(t_us)

    def _age(self, t_us: int) -> None:
        """Drops evidence that is too old, and verdicts based on it."""
        before = len(self._windows)
        while self._windows and not 0 <= t_us - self._windows[0].t_us <= EVIDENCE_US:
            self._windows.popleft()
        if len(self._windows) < before:
            self.verdicts = _verdicts(self._windows)

    def fix(self, fix: VelocityFix) -> None:
        """Takes a velocity; closes a window that has become long enough."""
        now = self._integrated
        if now.t_us is None:
            return
        start = self._start
        is_fresh = self._turn is not None and now.t_us - self._turn[0] <= STALE_US
        if start is None or start.breaks != now.breaks or not is_fresh:
            self._begin(now.t_us, fix)
            return
        length_us = now.t_us - start.t_us
        if length_us < WITNESS_WINDOW_US:
            return
        self._settle()
        if length_us <= LONGEST_WINDOW_US:
            self._close(start, fix)
        self._begin(now.t_us, fix)

    def _begin(self, t_us: int, fix: VelocityFix) -> None:
        now = self._integrated
        self._start = _Start(t_us, now.breaks, fix.v_n, now.velocity_n, now.force_n)
        self._settled_n = now.velocity_n
        self._by_tilt = self._by_heading = (0.0, 0.0)

    def _settle(self) -> None:
        """Adds the force since the last time, as turned by the other attitude."""
        done, now = self._settled_n, self._integrated.velocity_n
        self._settled_n = now
        if self._turn is None:
            return
        ours = (now[0] - done[0], now[1] - done[1], now[2] - done[2])
        _, turn_n, about_down = self._turn
        whole, headed = rotate(turn_n, ours), rotate(about_down, ours)
        tilt, heading = self._by_tilt, self._by_heading
        self._by_tilt = (tilt[0] + whole[0] - headed[0], tilt[1] + whole[1] - headed[1])
        self._by_heading = (heading[0] + headed[0] - ours[0], heading[1] + headed[1] - ours[1])

    def _close(self, start: _Start, fix: VelocityFix) -> None:
        now = self._integrated
        missing = [
            fix.v_n[i] - start.measured[i] - now.velocity_n[i] + start.velocity_n[i] for i in (0, 1)
        ]
        by_latency = [start.force_n[i] - now.force_n[i] for i in (0, 1)]
        self._windows.append(
            _Window(
                now.t_us or 0,
                (missing[0], missing[1]),
                self._by_tilt,
                self._by_heading,
                (by_latency[0], by_latency[1]),
            )
        )
        self.verdicts = _verdicts(self._windows)


class _Fit(NamedTuple):
    """The result of the fit: shares of tilt and heading, and the latency, s."""

    found: Vec3  # the three
    variances: Vec3  # of them
    sigma_m_s: float  # of the residual of a change of velocity


def _verdicts(windows: deque[_Window]) -> Verdicts:
    if len(windows) < MIN_WINDOWS:
        return Verdicts()
    rows = [
        ((window.by_tilt[i], window.by_heading[i], window.by_latency[i]), window.missing[i])
        for window in windows
        for i in (0, 1)
    ]
    columns = list(zip(*(causes for causes, _ in rows), strict=True))
    missing = [each for _, each in rows]
    sums = [[sum(map(mul, one, other)) for other in (*columns, missing)] for one in columns]
    sigma_m_s = FIRST_SIGMA_M_S
    for _ in range(FITS):
        fit = _fit(rows, sums, sigma_m_s)
        sigma_m_s = fit.sigma_m_s
    if sigma_m_s > WORST_SIGMA_M_S:
        return Verdicts()
    tilt_m_s = math.sqrt(sum(causes[0] ** 2 for causes, _ in rows) / len(windows))
    bias_m_s = FORCE_BIAS_M_S2 * WITNESS_WINDOW_US * 1e-6
    by_bias = bias_m_s / tilt_m_s if tilt_m_s > 0.0 else math.inf
    return Verdicts(
        _verdict(fit.found[0], math.hypot(math.sqrt(fit.variances[0]), by_bias)),
        _verdict(fit.found[1], math.sqrt(fit.variances[1])),
    )


def _fit(rows: list[tuple[Vec3, float]], sums: list[list[float]], sigma_m_s: float) -> _Fit:
    """Fits the windows with the priors; least squares in three unknowns.

    Args:
        rows: effects of the three causes on a change of velocity, and what is missing in it.
        sums: over the rows, of the products of each cause with each other and with the missing.
        sigma_m_s: of the residuals.
    """
    weight = sigma_m_s**-2
    known = [sigma**-2 for sigma in EXPECTED_SIGMA]
    a, b, c = ([weight * each for each in line[:3]] for line in sums)
    a[0], b[1], c[2] = a[0] + known[0], b[1] + known[1], c[2] + known[2]
    right = [weight * sums[i][3] + known[i] * EXPECTED[i] for i in range(3)]
    # The inverse of a symmetric matrix of three: its cofactors over its determinant.
    xx, xy, xz = b[1] * c[2] - b[2] ** 2, a[2] * b[2] - a[1] * c[2], a[1] * b[2] - a[2] * b[1]
    yy, yz, zz = a[0] * c[2] - a[2] ** 2, a[1] * a[2] - a[0] * b[2], a[0] * b[1] - a[1] ** 2
    det = a[0] * xx + a[1] * xy + a[2] * xz
    x, y, z = (
        (p * right[0] + q * right[1] + r * right[2]) / det
        for p, q, r in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    )
    left = sum(
        (missing - x * causes[0] - y * causes[1] - z * causes[2]) ** 2 for causes, missing in rows
    )
    sigma_m_s = max(math.sqrt(left / len(rows)), MIN_SIGMA_M_S)
    return _Fit((x, y, z), (xx / det, yy / det, zz / det), sigma_m_s)


def _verdict(share: float, sigma: float) -> VelocityVerdict:
    """The verdict by the share of the difference that the velocity demands."""
    if not -OUTSIDE <= share <= 1.0 + OUTSIDE or abs(share - 0.5) < DECIDED * sigma:
        return VelocityVerdict.UNDECIDED
    return VelocityVerdict.H2NAV if share < 0.5 else VelocityVerdict.AUTOPILOT

"""Decides which of two attitudes the velocity of a GPS receiver supports.

The specific force, turned by our attitude and integrated, must give the change of velocity; turned
by the other attitude it gives another change. The share of the difference that the velocity demands
is 0 if ours is right and 1 if the other is: it is fitted, for heading and tilt separately, to
windows of the last half minute, each between the times at which its velocities were true by the
receiver's delay as it has been learnt. What is left of the delay is fitted along, because in a turn
it resembles a heading error, and so is the bias of our accelerometer, which resembles a tilt until
the vehicle turns: at rest and in a straight flight no velocity shows which of two tilts is right.

The heading that velocities show is that of the accelerometer, whose axes are turned in the body: of
two headings that are about as far from it nobody's is wrong. And evidence is of an attitude: one
that has been found anew begins without any, and while ours moves against the other nothing speaks
for it.

Where our attitude may be bent, by a velocity that is or was held to be false or by a wrong sensor,
velocities may speak for the other attitude, so that nothing hides our own error, but never for
ours: they may fit it because they have bent it. Nor do they speak for our tilt where the difference
is what they have tilted us by: a velocity that drifts so slowly that nothing shows it to be false
bends an attitude as well. Nor where our own IMUs differ by half as much: an accelerometer's bias
tilts an attitude, and velocities fit it; one within data sheets may be all of a difference that was
there, in the body, when our attitude was found.
"""

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from typing import NamedTuple

from h2nav.attitude.samples import ImuSample, VelocityFix
from h2nav.integrity.likelihood import LinearModel
from h2nav.integrity.tilt_corrections import TiltCorrections
from h2nav.integrity.velocity_windows import DELAY_SIGMA_S
from h2nav.maths.quaternion import Quat, Vec3, conjugate, rotate

WITNESS_WINDOW_US = 1_900_000
LONGEST_WINDOW_US = 4_000_000
WINDOWS = 15
# Attitudes and their errors change: older evidence says nothing about the present.
EVIDENCE_US = 30_000_000
MIN_WINDOWS = 2
LONGEST_STEP_US = 200_000
# An older difference says nothing about the present.
STALE_US = 500_000
# Receivers are late by less; what is kept of it, in such steps, is interpolated.
KEPT_US = 1_000_000
KEPT_STEP_US = 100_000
# Smoothing of the acceleration that multiplies the latency.
SMOOTHING_S = 0.1
# Deviation of a change of velocity: a receiver is hardly better. If the residual of the fit exceeds
# the larger one, or it needs another delay than is known, force and velocity contradict each other
# whatever the attitude.
MIN_SIGMA_M_S = 0.1
MAX_SIGMA_M_S = 1.0
FIRST_SIGMA_M_S = 0.3
FITS = 3
# Priors: neither attitude is preferred; an accelerometer's bias is known as well as to the filter
# before a flight: to 15 mg; in between the delay that is left, with what is known of it.
EXPECTED = (0.5, 0.5, 0.0, 0.0, 0.0)
SHARE_SIGMA, BIAS_SIGMA_M_S2 = 2.0, 0.15
TILT, HEADING, DELAY = 0, 1, 2
# A window in which the headings have moved by more against each other, and by more than half of
# what they differ by at its end, does not speak for ours.
MOVED_RAD = math.radians(3.0)
MOVED_SHARE = 0.5
DECIDED = 3.0  # deviations
# Cross-axis sensitivity of an accelerometer (MPU-6000: 2 %): its axes, and with them the heading
# that velocities show, may be turned about the vertical by as much.
AXES_RAD = 0.02
# Tilts of ours that differ by this share of the difference do not know which is right.
OWN_TILTS = 0.5
# A difference that has changed by less than this share is the one from the beginning.
CHANGED = 0.5
# What an accelerometer within its data sheet, 60 mg, tilts an attitude by.
BIAS_TILT_RAD = 0.06
# A share further outside of 0 to 1 shows that neither attitude fits.
OUTSIDE = 0.5

Level = tuple[float, float]  # north and east
Correction = Callable[[VelocityFix], VelocityFix]


class OwnDoubt(NamedTuple):
    """What may be wrong with our attitude.

    Attributes:
        may_be_bent: it may follow a false velocity or a wrong sensor.
        corrections: of its tilt; None = unknown.
        tilts_apart_rad: the largest difference to the tilt by another IMU.
    """

    may_be_bent: bool = False
    corrections: TiltCorrections | None = None
    tilts_apart_rad: float = 0.0


NO_DOUBT = OwnDoubt()


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
    by_bias: tuple[Level, Level]  # addition per m/s^2 of the accelerometer's bias, x and y
    heading_rad: float  # the other attitude's heading minus ours
    heading_moves: bool
    removed_s: float  # the receiver's delay, of which its times are free
    removed_sigma_s: float


class _Past:
    """Sums as they were at the times of the last second.

    Attributes:
        kept_us: time of the newest that are kept.
    """

    def __init__(self) -> None:
        self.kept_us = -KEPT_STEP_US
        self._kept: deque[tuple[int, tuple[float, ...]]] = deque()

    def clear(self) -> None:
        """Forgets all."""
        self._kept.clear()

    def keep(self, t_us: int, sums: tuple[float, ...]) -> None:
        """Takes the newest ones, a step behind those that are kept."""
        kept = self._kept
        if t_us < self.kept_us:
            kept.clear()  # another clock
        kept.append((t_us, sums))
        while t_us - kept[0][0] > KEPT_US:
            kept.popleft()
        self.kept_us = t_us

    def at(self, t_us: int, newest_us: int, newest: tuple[float, ...]) -> Sequence[float] | None:
        """Those of a time, the newest ones for a later one; None for one that is not kept."""
        if t_us >= newest_us:
            return newest
        later_us, later = newest_us, newest
        for kept_us, sums in reversed(self._kept):
            if kept_us <= t_us:
                share = (t_us - kept_us) / (later_us - kept_us)
                return [a + share * (b - a) for a, b in zip(sums, later, strict=True)]
            later_us, later = kept_us, sums
        return None


class Integrated:
    """The specific force turned by our attitude, integrated from sample to sample."""

    def __init__(self) -> None:
        self.velocity_n: Vec3 = (0.0, 0.0, 0.0)  # since the beginning, m/s
        self.force_n: Vec3 = (0.0, 0.0, 0.0)  # smoothed, m/s^2
        self.t_us: int | None = None  # of the newest sample; None before the first
        self.breaks = 0  # number of interruptions of the integral
        self._past = _Past()

    def interrupt(self) -> None:
        """Forgets an attitude that we no longer have."""
        self.breaks += 1
        self._past.clear()

    def add(self, sample: ImuSample, q_nb: Quat) -> None:
        """Takes a sample and our attitude at its time."""
        step_us = 0 if self.t_us is None else sample.t_us - self.t_us
        self.t_us = sample.t_us
        force_n = rotate(q_nb, sample.f_b)
        if sample.clipped or not 0 < step_us <= LONGEST_STEP_US:
            self.force_n = force_n
            self.interrupt()
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
        if not 0 <= sample.t_us - self._past.kept_us < KEPT_STEP_US:
            self._past.keep(sample.t_us, self._level)

    @property
    def _level(self) -> tuple[float, ...]:
        """Velocity and force, north and east."""
        return (*self.velocity_n[:2], *self.force_n[:2])

    def at(self, t_us: int) -> Sequence[float] | None:
        """Velocity and force, north and east, of a time; None of one that is not kept."""
        return None if self.t_us is None else self._past.at(t_us, self.t_us, self._level)


class _Moment(NamedTuple):
    """A velocity, and what was integrated until its time; horizontal, (2,) each."""

    t_us: int
    breaks: int
    fix: VelocityFix
    heading_rad: float  # the other attitude's minus ours
    velocity_n: Level
    force_n: Level
    by_tilt: Level
    by_heading: Level
    pushed_x: Level  # by a bias of the accelerometer
    pushed_y: Level


class VelocityWitness:
    """Judges one other attitude against ours."""

    def __init__(self, integrated: Integrated) -> None:
        self._integrated = integrated
        self._start: _Moment | None = None
        self._settled_n = integrated.velocity_n
        self._turn: tuple[int, Quat, Quat, Quat] | None = None
        self._heading_rad = 0.0
        self._by_tilt = (0.0, 0.0)
        self._by_heading = (0.0, 0.0)
        self._pushed = [0.0] * 4  # by a bias along x, north and east, and along y
        self._settled_us: int | None = None
        self._past = _Past()  # of these eight
        self._windows: deque[_Window] = deque(maxlen=WINDOWS)
        self._found = Verdicts()  # by the windows of the last `EVIDENCE_US`
        self._doubt, self._tilt_is_doubted = NO_DOUBT, False
        self._first_b: Vec3 | None = None  # the difference of the tilts that was there at first

    @property
    def verdicts(self) -> Verdicts:
        """By the velocities of the last `EVIDENCE_US`."""
        tilt, heading = self._found
        if self._doubt.may_be_bent:
            return Verdicts(_not_for_us(tilt), _not_for_us(heading))
        return Verdicts(_not_for_us(tilt), heading) if self._tilt_is_doubted else self._found

    def differs(self, t_us: int, q_nb: Quat, turn_n: Quat, heading_rad: float) -> None:
        """Takes our attitude, the turn (NED) from it to the other one, and the turn's heading."""
        self._settle()
        about_down = (math.cos(0.5 * heading_rad), 0.0, 0.0, math.sin(0.5 * heading_rad))
        self._turn, self._heading_rad = (t_us, q_nb, turn_n, about_down), heading_rad
        if self._first_b is None:
            self._first_b = _apart_b(q_nb, turn_n)
        self._age(t_us)

    def forget(self) -> None:
        """Forgets all of an attitude that we no longer have."""
        self._drop_evidence()
        self._first_b = None

    def _drop_evidence(self) -> None:
        self._windows.clear()
        self._past.clear()
        self._start, self._found = None, Verdicts()

    def _age(self, t_us: int) -> None:
        """Drops evidence that is too old, and verdicts based on it."""
        before = len(self._windows)
        while self._windows and not 0 <= t_us - self._windows[0].t_us <= EVIDENCE_US:
            self._windows.popleft()
        if len(self._windows) < before:
            self._judge()

    def fix(self, fix: VelocityFix, doubt: OwnDoubt, corrected: Correction) -> None:
        """Takes a velocity; closes a window that has become long enough.

        Args:
            fix: as the receiver sent it.
            doubt: of our attitude.
            corrected: gives that of the IMU, at the time at which it was true.
        """
        if self._doubt.may_be_bent and not doubt.may_be_bent:
            # Nothing from that time speaks for anybody after it.
            self._drop_evidence()
        self._doubt = doubt
        now, start = self._integrated, self._start
        if now.t_us is None or self._turn is None or now.t_us - self._turn[0] > STALE_US:
            self._start = None
            return
        if start is None or start.breaks != now.breaks:
            self._start = self._moment(corrected(fix))
            return
        if fix.t_us - start.t_us < WITNESS_WINDOW_US:
            return  # and it was true before that time
        fix = corrected(fix)
        if fix.t_us - start.t_us < WITNESS_WINDOW_US:
            return
        self._start = end = self._moment(fix)
        if end is not None and end.t_us - start.t_us <= LONGEST_WINDOW_US:
            self._close(start, end)

    def _moment(self, fix: VelocityFix) -> _Moment | None:
        """What is known of the time of a velocity; None where it is not kept."""
        self._settle()
        now, newest_us = self._integrated, self._integrated.t_us or 0
        level = now.at(fix.t_us)
        sums = self._past.at(fix.t_us, newest_us, self._sums)
        if level is None or sums is None or fix.t_us - newest_us > LONGEST_STEP_US:
            return None
        t_us = min(fix.t_us, newest_us)
        return _Moment(t_us, now.breaks, fix, self._heading_rad, *_pairs(level), *_pairs(sums))

    def _judge(self) -> None:
        self._found = _verdicts(self._windows)
        backs_us = self._found.tilt is VelocityVerdict.H2NAV
        self._tilt_is_doubted = backs_us and self._is_own_tilt()

    def _is_own_tilt(self) -> bool:
        """Whether the difference of the tilts may be ours alone."""
        if self._turn is None or self._first_b is None:
            return False
        _, q_nb, turn_n, _ = self._turn
        now_b = _apart_b(q_nb, turn_n)
        apart_rad = math.hypot(*now_b)
        if apart_rad < BIAS_TILT_RAD and math.dist(now_b, self._first_b) < CHANGED * apart_rad:
            return True
        doubt, (w, north, east, _) = self._doubt, turn_n
        double = math.copysign(2.0, w)
        apart_n = double * north, double * east
        if doubt.tilts_apart_rad > OWN_TILTS * math.hypot(*apart_n):
            return True
        return doubt.corrections is not None and doubt.corrections.make(apart_n)

    def _settle(self) -> None:
        """Adds the force since the last time, as turned by the other attitude."""
        done, now = self._settled_n, self._integrated.velocity_n
        self._settled_n = now
        if self._turn is None:
            self._settled_us = self._integrated.t_us
            return
        ours = (now[0] - done[0], now[1] - done[1], now[2] - done[2])
        _, q_nb, turn_n, about_down = self._turn
        self._push(q_nb)
        whole, headed = rotate(turn_n, ours), rotate(about_down, ours)
        tilt, heading = self._by_tilt, self._by_heading
        self._by_tilt = (tilt[0] + whole[0] - headed[0], tilt[1] + whole[1] - headed[1])
        self._by_heading = (heading[0] + headed[0] - ours[0], heading[1] + headed[1] - ours[1])
        t_us = self._integrated.t_us or 0
        if not 0 <= t_us - self._past.kept_us < KEPT_STEP_US:
            self._past.keep(t_us, self._sums)

    @property
    def _sums(self) -> tuple[float, ...]:
        return (*self._by_tilt, *self._by_heading, *self._pushed)

    def _push(self, q_nb: Quat) -> None:
        """Adds the time since then, along the axes of our attitude."""
        t_us, since_us = self._integrated.t_us or 0, self._settled_us
        self._settled_us = t_us
        if since_us is None:
            return
        dt_s = 1e-6 * (t_us - since_us)
        for i, axis in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))):
            north, east, _ = rotate(q_nb, axis)
            self._pushed[2 * i] -= dt_s * north
            self._pushed[2 * i + 1] -= dt_s * east

    def _close(self, start: _Moment, end: _Moment) -> None:
        moved_rad = abs(end.heading_rad - start.heading_rad)
        measured = _less(end.fix.v_n, start.fix.v_n)
        predicted = _less(end.velocity_n, start.velocity_n)
        self._windows.append(
            _Window(
                end.t_us,
                _less(measured, predicted),
                _less(end.by_tilt, start.by_tilt),
                _less(end.by_heading, start.by_heading),
                _less(start.force_n, end.force_n),
                (_less(end.pushed_x, start.pushed_x), _less(end.pushed_y, start.pushed_y)),
                end.heading_rad,
                moved_rad > max(MOVED_RAD, MOVED_SHARE * abs(end.heading_rad)),
                end.fix.removed_s,
                end.fix.removed_sigma_s or DELAY_SIGMA_S,
            )
        )
        self._judge()


def _less(one: Sequence[float], other: Sequence[float]) -> Level:
    return one[0] - other[0], one[1] - other[1]


def _pairs(values: Sequence[float]) -> Iterator[Level]:
    """North and east of each."""
    return zip(values[::2], values[1::2], strict=True)


def _apart_b(q_nb: Quat, turn_n: Quat) -> Vec3:
    """Down by the other attitude minus ours, in our body axes: no heading counts in it."""
    north, east, down = rotate(conjugate(turn_n), (0.0, 0.0, 1.0))
    return rotate(conjugate(q_nb), (north, east, down - 1.0))


def _verdicts(windows: Sequence[_Window]) -> Verdicts:
    found = _by(windows)
    steady = [window for window in windows if not window.heading_moves]
    if found.heading is not VelocityVerdict.H2NAV or len(steady) == len(windows):
        return found
    return Verdicts(found.tilt, _by(steady).heading)


def _by(windows: Sequence[_Window]) -> Verdicts:
    if len(windows) < MIN_WINDOWS:
        return Verdicts()
    effects = [(w.by_tilt, w.by_heading, w.by_latency, *w.by_bias) for w in windows]
    causes = [[of[n][i] for i in (0, 1) for of in effects] for n in range(len(EXPECTED))]
    removed_s, delay_sigma_s = windows[-1][-2:]
    left = [
        # Of the delay as it is known now, all windows' times are free.
        window.missing[i] - (removed_s - window.removed_s) * window.by_latency[i]
        for i in (0, 1)
        for window in windows
    ]
    for expected, column in zip(EXPECTED, causes, strict=True):
        left = [part - expected * effect for part, effect in zip(left, column, strict=True)]
    sigma_m_s = FIRST_SIGMA_M_S
    # Of a noise of 1: for another one the priors change in its place.
    model = LinearModel([1.0] * len(windows), left, causes, (0.0, 1.0))
    sigmas = (SHARE_SIGMA, SHARE_SIGMA, delay_sigma_s, BIAS_SIGMA_M_S2, BIAS_SIGMA_M_S2)
    for _ in range(FITS):
        noise = sigma_m_s
        fit = model.fit([sigma / noise for sigma in sigmas])
        found = fit.unknowns()
        rest = left
        for size, column in zip(found, causes, strict=True):
            rest = [part - size * effect for part, effect in zip(rest, column, strict=True)]
        sigma_m_s = max(math.sqrt(sum(part * part for part in rest) / len(rest)), MIN_SIGMA_M_S)
    if sigma_m_s > MAX_SIGMA_M_S or abs(found[DELAY]) > DECIDED * delay_sigma_s:
        return Verdicts()
    (tilt, _), (_, heading) = fit.covariance((TILT, HEADING))
    apart_rad = math.sqrt(sum(w.heading_rad * w.heading_rad for w in windows) / len(windows))
    share = found[HEADING] + EXPECTED[HEADING]
    if abs(share - 0.5) * apart_rad < AXES_RAD:
        by_heading = VelocityVerdict.UNDECIDED
    else:
        by_heading = _verdict(share, noise * math.sqrt(heading))
    return Verdicts(_verdict(found[TILT] + EXPECTED[TILT], noise * math.sqrt(tilt)), by_heading)


def _not_for_us(verdict: VelocityVerdict) -> VelocityVerdict:
    return VelocityVerdict.UNDECIDED if verdict is VelocityVerdict.H2NAV else verdict


def _verdict(share: float, sigma: float) -> VelocityVerdict:
    """The verdict by the share of the difference that the velocity demands."""
    if not -OUTSIDE <= share <= 1.0 + OUTSIDE or abs(share - 0.5) < DECIDED * sigma:
        return VelocityVerdict.UNDECIDED
    return VelocityVerdict.H2NAV if share < 0.5 else VelocityVerdict.AUTOPILOT

"""Dead reckoning of turn and force, which any attitude can be compared with afterwards.

The gyro carries a frame ``s`` that stands still in space, and the specific force is integrated in
it: gained = int R_sb f dt. Where an attitude q_nb was true at a time, R_ns = R_nb R_bs turns what
was gained from then on into north, east, down. So one integration, a few dozen operations per
sample, serves windows of every length and the attitude of every estimator.
"""

import math
from collections import deque
from typing import NamedTuple

from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Quat, Vec3
from h2nav.maths.quaternion import IDENTITY, conjugate, exp, multiply, normalize, rotate
from h2nav.maths.units import DEG

SPACING_US = 50_000
LENGTH_US = 12_000_000
# After a gap of more nobody knows what the sensors would have shown.
LONGEST_GAP_US = 300_000
# Autopilots filter rates and forces at 20 Hz and more before they record single values of them. Of
# slower streams than twice that, the sums know the motion between two samples no more.
SLOW_US = 25_000
# What the second difference of a white sequence has of its variance.
SECOND_DIFFERENCE = 6.0
# Of an attitude whose filter predicts no deviation.
ASSUMED_TILT_RAD = 2.0 * DEG
ASSUMED_HEADING_RAD = 5.0 * DEG


class Moment(NamedTuple):
    """Where dead reckoning was at a time.

    Attributes:
        t_us: time of the sample.
        q_sb: turn since the start.
        gained_s: integral of the specific force, m/s, in the axes of the start.
        q_ns: frame of the start in north, east, down, by the estimate of this time.
        sigma_tilt_rad: of that estimate; assumed where its filter predicts none.
        sigma_heading_rad: the same.
        path_rad: angle turned through, whatever its direction.
        turn_variance: of `q_sb`, rad^2, by what happened between slow samples.
        gained_variance: of `gained_s`, (m/s)^2, likewise.
    """

    t_us: int
    q_sb: Quat
    gained_s: Vec3
    q_ns: Quat
    sigma_tilt_rad: float
    sigma_heading_rad: float
    path_rad: float
    turn_variance: float
    gained_variance: float


class Strapdown:
    """Follows one IMU, with the gyro's bias as its filter knows it.

    Attributes:
        t_us: time of the latest sample; None before the first, and after a gap.
        q_sb: turn since the start.
        rate_b: the latest rate, bias removed.
    """

    def __init__(self) -> None:
        self.t_us: int | None = None
        self.q_sb: Quat = IDENTITY
        self.rate_b: Vec3 = (0.0, 0.0, 0.0)
        self._gained_s: Vec3 = (0.0, 0.0, 0.0)
        self._path_rad = 0.0
        self._turn_variance = self._gained_variance = 0.0
        self._slow: deque[tuple[Vec3, Vec3]] = deque(maxlen=3)
        self._estimate: AttitudeEstimate | None = None
        self._past: deque[Moment] = deque()
        self._kept_us = 0

    @property
    def newest(self) -> Moment | None:
        """The latest moment; None before the first, and after a gap."""
        if self.t_us is None or self._estimate is None:
            return None
        estimate, tilt_rad, heading_rad = self._estimate, *_sigmas(self._estimate)
        q_ns = multiply(estimate.q_nb, conjugate(self.q_sb))
        return Moment(
            self.t_us,
            self.q_sb,
            self._gained_s,
            q_ns,
            tilt_rad,
            heading_rad,
            self._path_rad,
            self._turn_variance,
            self._gained_variance,
        )

    def restart(self) -> None:
        """Begins anew: nothing of before may be compared with what comes."""
        self.t_us = None
        self._past.clear()
        self._slow.clear()
        self._turn_variance = self._gained_variance = 0.0

    def add(self, sample: ImuSample, estimate: AttitudeEstimate) -> bool:
        """Takes a sample and the estimate that it made; False where everything begins anew."""
        t_us, before_us = sample.t_us, self.t_us
        self._estimate = estimate
        if before_us is None or not 0 < t_us - before_us <= LONGEST_GAP_US:
            self.restart()
            self.t_us = t_us
            self.q_sb, self._gained_s, self._path_rad = IDENTITY, (0.0, 0.0, 0.0), 0.0
            self._keep()
            return False
        dt_s = (t_us - before_us) * 1e-6
        x, y, z = self.rate_b = estimate.w_b
        half_s = 0.5 * dt_s
        half = exp((half_s * x, half_s * y, half_s * z))
        middle = multiply(self.q_sb, half)
        f_x, f_y, f_z = rotate(middle, sample.f_b)
        g_x, g_y, g_z = self._gained_s
        self.t_us = t_us
        self.q_sb = normalize(multiply(middle, half))
        self._gained_s = (g_x + dt_s * f_x, g_y + dt_s * f_y, g_z + dt_s * f_z)
        self._path_rad += dt_s * (x * x + y * y + z * z) ** 0.5
        if t_us - before_us > SLOW_US:
            self._is_slow(dt_s, sample)
        if t_us - self._kept_us >= SPACING_US:
            self._keep()
            while self._past[0].t_us < t_us - LENGTH_US:
                self._past.popleft()
        return True

    def _is_slow(self, dt_s: float, sample: ImuSample) -> None:
        """A sample says little of its time: by how much samples jump, so much may be missing."""
        self._slow.append((self.rate_b, sample.f_b))
        if len(self._slow) < 3:
            return
        (rate_1, force_1), (rate_2, force_2), (rate_3, force_3) = self._slow
        scale = dt_s * dt_s / SECOND_DIFFERENCE
        self._turn_variance += scale * _bend(rate_1, rate_2, rate_3)
        self._gained_variance += scale * _bend(force_1, force_2, force_3)

    def _keep(self) -> None:
        """The moment of now goes into the past."""
        newest = self.newest
        assert newest is not None
        self._past.append(newest)
        self._kept_us = newest.t_us

    def at(self, t_us: int) -> Moment | None:
        """The moment of a time, what was gained interpolated; None where it is not remembered."""
        after = self.newest
        if after is None or t_us < self._past[0].t_us:
            return None
        for moment in reversed(self._past):
            if moment.t_us <= t_us:
                return _between(moment, after, t_us)
            after = moment
        return None


def _sigmas(estimate: AttitudeEstimate) -> tuple[float, float]:
    """Deviations of tilt and heading, rad."""
    tilt_rad, heading_rad = estimate.sigma_tilt_rad, estimate.sigma_heading_rad
    return (
        ASSUMED_TILT_RAD if math.isnan(tilt_rad) else tilt_rad,
        ASSUMED_HEADING_RAD if math.isnan(heading_rad) else heading_rad,
    )


def _bend(a: Vec3, b: Vec3, c: Vec3) -> float:
    """Square of a second difference."""
    x, y, z = a[0] - 2.0 * b[0] + c[0], a[1] - 2.0 * b[1] + c[1], a[2] - 2.0 * b[2] + c[2]
    return x * x + y * y + z * z


def _between(before: Moment, after: Moment, t_us: int) -> Moment:
    """`before`, at a later time up to that of `after`."""
    span_us = after.t_us - before.t_us
    share = min((t_us - before.t_us) / span_us, 1.0) if span_us > 0 else 0.0
    a, b = before.gained_s, after.gained_s
    gained: Vec3 = (
        a[0] + share * (b[0] - a[0]),
        a[1] + share * (b[1] - a[1]),
        a[2] + share * (b[2] - a[2]),
    )
    return before._replace(t_us=t_us, gained_s=gained)

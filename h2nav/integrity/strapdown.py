"""Dead reckoning of turn and force, comparable with any attitude afterwards.

The gyro carries a frame ``s`` that stands still in space, and the specific force is integrated in
it: gained = int R_sb f dt. If an attitude q_nb was true at a time, R_ns = R_nb R_bs turns the
integral from then on into north, east, down. So one integration, a few dozen operations per sample,
serves windows of every length and the attitude of every estimator.
"""

import math
from array import array
from bisect import bisect_left
from collections.abc import Iterable
from typing import NamedTuple

from h2nav.attitude.record import reader
from h2nav.attitude.samples import AttitudeEstimate, Quat, Vec3
from h2nav.integrity.kernel.memory import BEGUN, KEPT, Memory
from h2nav.integrity.watch import Watch
from h2nav.maths.quaternion import conjugate, log, multiply
from h2nav.maths.units import DEG

LENGTH_US = 12_000_000
# Nothing is known of a time this much later than the newest sample.
AHEAD_US = 300_000
# For an attitude without predicted deviations.
ASSUMED_TILT_RAD = 2.0 * DEG
ASSUMED_HEADING_RAD = 5.0 * DEG
NO_RATE: Vec3 = (0.0, 0.0, 0.0)
_GAINED = slice(4, 7)
_REMEMBERED = ("q_sb", "gained_s", "path_rad", "turn_variance", "gained_variance")


class Moment(NamedTuple):
    """The state of dead reckoning at a time."""

    t_us: int  # time of the sample
    gained_s: Vec3  # integral of the specific force, m/s, in the axes of the start
    q_ns: Quat  # frame of the start to north, east, down, by the estimate of this time
    sigma_tilt_rad: float  # of that estimate; assumed if not predicted
    sigma_heading_rad: float  # the same
    path_rad: float  # angle turned through, in any direction
    # of the turn since the start, rad^2, from motion missed between slow samples
    turn_variance: float
    gained_variance: float  # of `gained_s`, (m/s)^2, likewise
    q_sb: Quat = (1.0, 0.0, 0.0, 0.0)  # turn since the start, up to the last stored sample
    bias_b: Vec3 = (0.0, 0.0, 0.0)  # of the gyro, as known then, rad/s
    rate_b: Vec3 = (0.0, 0.0, 0.0)  # of the turn around the time, rad/s


class _Kept(NamedTuple):
    """The stored data of a moment."""

    t_us: int  # time of the sample
    # `_REMEMBERED` of that time, then q_nb, both deviations and the gyro's bias of its
    # estimate. There are 20 of them a second: objects would be four times as large.
    numbers: "array[float]"


class Strapdown:
    """Follows one IMU, with the gyro's bias as estimated by its filter.

    Args:
        watch: of the IMU.
    """

    def __init__(self, watch: Watch) -> None:
        self._watch = watch
        self._read = reader(watch.memory, Memory, _REMEMBERED)
        self._estimate: AttitudeEstimate | None = None
        self._past: list[_Kept] = []
        # the latest answer of `at` since the latest sample: a fix asks for its moment twice
        self._answer: tuple[int, Moment | None] | None = None
        # time of the latest sample; None before the first, and after a gap
        self.t_us: int | None = None

    @property
    def newest(self) -> Moment | None:
        """The latest moment; None before the first, and after a gap."""
        latest = self._latest
        return None if latest is None else _moment(latest, latest.t_us, latest.numbers[_GAINED])

    @property
    def _latest(self) -> _Kept | None:
        if self.t_us is None or self._estimate is None:
            return None
        return self._kept(self.t_us, self._estimate)

    def _kept(self, t_us: int, estimate: AttitudeEstimate) -> _Kept:
        deviations, bias_b = _sigmas(estimate), estimate.bias_b
        return _Kept(t_us, array("d", (*self._read(), *estimate.q_nb, *deviations, *bias_b)))

    def restart(self) -> None:
        """Restarts: nothing earlier may be compared with what follows."""
        self.t_us = None
        self._past.clear()
        self._answer = None
        self._watch.interrupt()

    def add(self, t_us: int, estimate: AttitudeEstimate) -> int:
        """Continues with the sample checked last, of this time, and its estimate.

        Returns:
            The bits of `Watch.follow`; with BEGUN everything has restarted.
        """
        self._estimate, self.t_us, self._answer = estimate, t_us, None
        bits = self._watch.follow(estimate.w_b)
        if bits & KEPT:
            past = self._past
            if bits & BEGUN:
                past.clear()
            past.append(self._kept(t_us, estimate))
            while past[0].t_us < t_us - LENGTH_US:
                del past[0]
        return bits

    def at(self, t_us: int) -> Moment | None:
        """The moment at a time, with interpolated integrals; None if it is not stored."""
        answer = self._answer
        if answer is None or answer[0] != t_us:
            answer = self._answer = t_us, self._interpolated(t_us)
        return answer[1]

    def _interpolated(self, t_us: int) -> Moment | None:
        past = self._past
        # A shorter tuple sorts before all that begin like it.
        index = bisect_left(past, (t_us + 1,))
        after = past[index] if index < len(past) else self._latest
        if index == 0 or after is None or t_us > after.t_us + AHEAD_US:
            return None
        before = past[index - 1]
        span_us = after.t_us - before.t_us
        share = min((t_us - before.t_us) / span_us, 1.0) if span_us > 0 else 0.0
        a, b = before.numbers[_GAINED], after.numbers[_GAINED]
        gained = tuple(x + share * (y - x) for x, y in zip(a, b, strict=True))
        return _moment(before, t_us, gained, _rate(before, after) if span_us > 0 else NO_RATE)


def _moment(kept: _Kept, t_us: int, gained: Iterable[float], rate_b: Vec3 = NO_RATE) -> Moment:
    """A stored moment, advanced to a time with the integral until then, turning at this rate."""
    w, x, y, z, _, _, _, path_rad, turn_variance, gained_variance = kept.numbers[:10]
    q_w, q_x, q_y, q_z, sigma_tilt_rad, sigma_heading_rad, *bias = kept.numbers[10:]
    (north, east, down), (p, q, r) = gained, bias
    return Moment(
        t_us,
        (north, east, down),
        multiply((q_w, q_x, q_y, q_z), (w, -x, -y, -z)),
        sigma_tilt_rad,
        sigma_heading_rad,
        path_rad,
        turn_variance,
        gained_variance,
        (w, x, y, z),
        (p, q, r),
        rate_b,
    )


def _rate(before: _Kept, after: _Kept) -> Vec3:
    """Mean rate between two stored moments, rad/s, body."""
    turned = log(multiply(conjugate(_turn(before)), _turn(after)))
    x, y, z = (part * 1e6 / (after.t_us - before.t_us) for part in turned)
    return x, y, z


def _turn(kept: _Kept) -> Quat:
    w, x, y, z = kept.numbers[:4]
    return w, x, y, z


def _sigmas(estimate: AttitudeEstimate) -> tuple[float, float]:
    """Deviations of tilt and heading, rad."""
    tilt_rad, heading_rad = estimate.sigma_tilt_rad, estimate.sigma_heading_rad
    return (
        ASSUMED_TILT_RAD if math.isnan(tilt_rad) else tilt_rad,
        ASSUMED_HEADING_RAD if math.isnan(heading_rad) else heading_rad,
    )

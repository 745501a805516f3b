"""Wheel odometry: counter readings in, planar pose with covariance out.

Plane of source 004: x ahead at the start, y left, heading counter-clockwise from above.
`odometry_records.of_wheels` turns an estimate into body FRD.
"""

import math
from collections import Counter
from enum import StrEnum
from typing import NamedTuple

from h2nav.maths import se2
from h2nav.maths.se2 import Matrix3, Planar
from h2nav.motion.odometry_noise import ZERO3, Slip, propagate
from h2nav.motion.samples import WheelSample
from h2nav.motion.settings import OdometrySettings

# This many consecutive readings that are not later mean that the autopilot's clock has restarted.
NEW_EPOCH_SAMPLES = 10
# A counter may jump by this much more than the speed limit allows (coarse time stamps), m.
JUMP_MARGIN_M = 0.05


class WheelEvent(StrEnum):
    """Counted events."""

    USED = "wheels_used"
    NOT_FINITE = "wheels_not_finite"  # or too few wheels
    NOT_LATER = "wheels_not_later"
    NEW_EPOCH = "wheels_new_epoch"
    JUMP = "wheels_jump"


class WheelEstimate(NamedTuple):
    """Planar pose and motion at the time of a reading."""

    t_us: int  # time of the reading
    pose: Planar  # (x, y, heading), m and rad, from the start
    twist: Planar  # (ahead, left, turn rate), m/s and rad/s, mean since the previous reading
    covariance: Matrix3  # (3, 3) of `pose`
    twist_covariance: Matrix3  # (3, 3) of `twist`
    reset_counter: int  # number of losses of motion (counter jump, new epoch); not wrapped


class WheelState(NamedTuple):
    """The complete state of the odometry between two readings."""

    last: WheelSample | None
    pose: Planar
    covariance: Matrix3
    stale_samples: int
    reset_counter: int
    counts: tuple[tuple[str, int], ...]


class WheelOdometry:
    """Dead reckoning by exact arcs with the covariance of slip.

    A damaged reading is rejected and counted, and the next sound one spans its interval: counters
    are cumulative, so no distance is lost. A jump of a counter loses the distance of one interval:
    the pose stays, and `reset_counter` increases.

    Raises:
        BadInput: a singular layout.
    """

    def __init__(self, settings: OdometrySettings | None = None) -> None:
        settings = settings or OdometrySettings()
        self._chassis = settings.chassis()
        self._scales = settings.scales
        self._slip = Slip(settings.slip_wheel_m_rtm, settings.slip_side_m_rtm)
        self._max_speed = settings.max_wheel_speed_m_s
        self._last: WheelSample | None = None
        self._pose = se2.IDENTITY
        self._covariance = ZERO3
        self._stale_samples = 0
        self._reset_counter = 0
        self.counts: Counter[str] = Counter()  # number of each `WheelEvent`

    def update(self, sample: WheelSample) -> WheelEstimate | None:
        """Processes one reading of all counters; ignores wheels beyond the layout's.

        Returns:
            The estimate; None for the first reading and for a rejected one (counted).
        """
        event = self._event(sample)
        self.counts[event] += 1
        if event in (WheelEvent.NOT_FINITE, WheelEvent.NOT_LATER):
            return None
        last, self._last = self._last, sample
        if event is not WheelEvent.USED:
            self._reset_counter += 1
            last = None
        if last is None:
            return None
        ways = self._ways(last, sample)
        motion = self._chassis.motion(ways)
        Q = self._slip.covariance(self._chassis, ways)
        after = se2.advance(self._pose, motion)
        self._covariance = propagate(self._covariance, self._pose, after, motion, Q)
        self._pose = after
        rate = 1e6 / (sample.t_us - last.t_us)
        a, b, c = ((rate * rate * row[0], rate * rate * row[1], rate * rate * row[2]) for row in Q)
        twist = (rate * motion[0], rate * motion[1], rate * motion[2])
        return WheelEstimate(
            sample.t_us, after, twist, self._covariance, (a, b, c), self._reset_counter
        )

    def restart(self) -> None:
        """Forgets the last reading (new epoch, long silence); pose and covariance stay."""
        if self._last is not None:
            self._reset_counter += 1
        self._last, self._stale_samples = None, 0

    def state(self) -> WheelState:
        """The complete state."""
        counts = tuple(self.counts.items())
        return WheelState(
            self._last,
            self._pose,
            self._covariance,
            self._stale_samples,
            self._reset_counter,
            counts,
        )

    def restore(self, state: WheelState) -> None:
        """Continues exactly where `state` was taken, under the same settings."""
        self._last, self._pose, self._covariance = state[:3]
        self._stale_samples, self._reset_counter = state[3:5]
        self.counts = Counter(dict(state.counts))

    def _event(self, sample: WheelSample) -> WheelEvent:
        used = sample.ways[: len(self._scales)]
        if len(used) < len(self._scales) or not all(map(math.isfinite, used)):
            return WheelEvent.NOT_FINITE
        last = self._last
        if last is None:
            return WheelEvent.USED
        if sample.t_us <= last.t_us:
            self._stale_samples += 1
            if self._stale_samples < NEW_EPOCH_SAMPLES:
                return WheelEvent.NOT_LATER
            self._stale_samples = 0
            return WheelEvent.NEW_EPOCH
        self._stale_samples = 0
        limit_m = self._max_speed * (sample.t_us - last.t_us) * 1e-6 + JUMP_MARGIN_M
        if any(abs(way) > limit_m for way in self._ways(last, sample)):
            return WheelEvent.JUMP
        return WheelEvent.USED

    def _ways(self, last: WheelSample, sample: WheelSample) -> tuple[float, ...]:
        """Distances, m, that the wheels have rolled between two readings."""
        return tuple(
            scale * (now - before)
            for scale, before, now in zip(self._scales, last.ways, sample.ways, strict=False)
        )

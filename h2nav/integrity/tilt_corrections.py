"""By how much a filter has tilted its attitude against the gyro, over two minutes."""

import math
from collections import deque

from h2nav.integrity.velocity_windows import Level
from h2nav.maths.quaternion import Quat, conjugate, log, multiply

SPAN_US = 2_000_000
# Over more, errors of a sound gyro turn the attitude by as much as differences are.
MAX_SPANS = 60
# Corrections make a difference of which no more is left without them.
MAX_SHARE_LEFT = 2.0 / 3.0


class TiltCorrections:
    """Follows the frame in which the gyro's attitude is measured: corrections alone turn it."""

    def __init__(self) -> None:
        self._spans: deque[tuple[Quat, Quat]] = deque(maxlen=MAX_SPANS)  # at beginning and end
        self._begun_us = 0

    def take(self, t_us: int, q_ns: Quat, *, is_anew: bool) -> None:
        """Takes the frame to north, east, down.

        Args:
            t_us: its time.
            q_ns: of a strapdown, as `Moment` has it.
            is_anew: it has begun anew, and is not comparable with earlier ones.
        """
        if is_anew or not self._spans:
            self._spans.append((q_ns, q_ns))
            self._begun_us = t_us
            return
        begun, ended = self._spans[-1]
        if t_us - self._begun_us < SPAN_US:
            self._spans[-1] = begun, q_ns
        else:
            self._spans.append((ended, q_ns))
            self._begun_us = t_us

    def make(self, apart_n: Level) -> bool:
        """Whether they are what makes the difference of another attitude.

        Args:
            apart_n: from ours to the other attitude, rad, north and east.
        """
        north, east = apart_n
        least_rad = MAX_SHARE_LEFT * math.hypot(north, east)
        for begun, ended in reversed(self._spans):
            moved_north, moved_east, _ = log(multiply(ended, conjugate(begun)))
            north, east = north + moved_north, east + moved_east
            if math.hypot(north, east) < least_rad:
                return True
        return False

"""Whether another heading has jumped away from ours, while our compass has stayed.

Both filters follow the same field, so that it does not show which of two headings is right. But a
heading that has agreed with ours for a while and leaves it from one report to the next, where no
gyro shows a turn, has been set; and a field whose dip and norm are the earth's shows how far off
ours can be. An autopilot that sets its heading to a better one sets it to that of the field, or by
velocities that decide before.
"""

import math
from typing import NamedTuple

from h2nav.integrity.spell import Spell
from h2nav.maths.quaternion import Quat, conjugate, multiply
from h2nav.maths.units import DEG

# Two headings that differ by less agree.
AGREED_RAD = 10.0 * DEG
AGREED_US = 10_000_000
# From one report to the next: more than late reports differ by in a turn.
MIN_JUMP_RAD = 15.0 * DEG
LONGEST_REPORT_US = 1_000_000
# Our attitude has turned by less than this share of the jump: it is the other one that has jumped.
OWN_SHARE = 0.5
# Ours is the better one of two while its largest error is below this share of their difference.
NEARER = 0.5
LASTING_US = 4_000_000


class _Report(NamedTuple):
    """One look at both headings."""

    t_us: int
    q_nb: Quat  # ours
    heading_rad: float  # the other one minus ours


class HeadingJump:
    """Watches one other heading.

    Attributes:
        compass_backs_us: it has jumped, and the compass has stayed with ours for `LASTING_US`.
    """

    def __init__(self) -> None:
        self._before: _Report | None = None
        self._agreed, self._backed = Spell(), Spell()
        self._has_jumped = False
        self.compass_backs_us = False

    def look(self, t_us: int, q_nb: Quat, heading_rad: float, by_compass_rad: float | None) -> None:
        """Takes our attitude, the other heading minus ours, and our largest error by the compass.

        Args:
            t_us: of both.
            q_nb: ours, body to NED.
            heading_rad: the difference.
            by_compass_rad: how far ours may be off; None = unknown.
        """
        before, now = self._before, _Report(t_us, q_nb, heading_rad)
        self._before = now
        size_rad = abs(heading_rad)
        agrees = size_rad < AGREED_RAD
        agreed_us = self._agreed.look(t_us, is_so=agrees) or 0
        if agrees:
            self._has_jumped = False
        elif before is not None and agreed_us >= AGREED_US:
            self._has_jumped |= _is_jump(before, now)
        is_near = by_compass_rad is not None and by_compass_rad < NEARER * size_rad
        backed_us = self._backed.look(t_us, is_so=self._has_jumped and is_near)
        self.compass_backs_us = self._has_jumped and (backed_us or 0) >= LASTING_US


def _is_jump(before: _Report, now: _Report) -> bool:
    jump_rad = abs(math.remainder(now.heading_rad - before.heading_rad, math.tau))
    if now.t_us - before.t_us > LONGEST_REPORT_US or jump_rad < MIN_JUMP_RAD:
        return False
    w, x, y, z = multiply(now.q_nb, conjugate(before.q_nb))
    own_rad = 2.0 * math.atan2(math.hypot(x, y, z), abs(w))
    return own_rad < OWN_SHARE * jump_rad

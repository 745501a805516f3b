"""Whether an attitude is lost: off by more than any correction of it could be linear in.

Causes of a contradiction are compared by small turns, and a filter corrects small errors. An
attitude that is off by far more, as after a gyro with values in other units, neither explains nor
heals itself: it has to be found anew. It is lost if, by it,

* the force is far from vertical although its angle to the field, which depends on no attitude, is
  the earth's, and the velocities agree that it is not that of an acceleration; or
* the force accelerates for longer than any vehicle can.

Deviations, however large, are no argument: they say that an attitude is not known, not that it
comes right.
"""

from h2nav.integrity.field_windows import FieldWindows
from h2nav.maths.units import DEG

# Beyond the turns that a correction takes as small, and the largest lean of a force.
LOST_RAD = 25.0 * DEG
# By so much velocities and force differ then: the vehicle's own acceleration may hide half of it.
APART_RAD = 0.5 * LOST_RAD
# For so long a contradiction is left to its causes: they decide within 2.5 s.
LASTING_US = 3_000_000


class LostAttitude:
    """Takes the evidence at every judgement.

    Attributes:
        is_suspected: it was shown, and not denied since.
        is_lost: that has lasted.
    """

    def __init__(self) -> None:
        self.is_suspected = self.is_lost = False
        self._since_us = 0

    def take(self, t_us: int, is_shown: bool | None) -> None:
        """Takes whether it is shown to be lost now; None if nothing shows whether it is."""
        if is_shown is None:
            return
        if is_shown and not self.is_suspected:
            self._since_us = t_us
        self.is_suspected = is_shown
        self.is_lost = is_shown and t_us - self._since_us >= LASTING_US


def shown_by_field(windows: FieldWindows, apart_rad: float) -> bool | None:
    """Whether field and force show an attitude to be lost; None where they show nothing.

    Args:
        apart_rad: the tilt that explains the difference of velocities and force; 0 if unknown.
    """
    if apart_rad < APART_RAD:
        return False
    lean_rad = windows.lean_rad
    return None if lean_rad is None else lean_rad > LOST_RAD

"""A drift of the velocity so slow that only a long window shows it.

Equations: docs/integrity.md, section 5.
"""

from collections import deque
from collections.abc import Collection

from h2nav.attitude.samples import SensorErrors
from h2nav.integrity.causes import MIN_OF_EITHER, NOTHING, Cause, Explained, explain
from h2nav.integrity.velocity_model import Known
from h2nav.integrity.velocity_rows import VelocityRows
from h2nav.integrity.velocity_windows import Mark
from h2nav.maths.units import DEG

# Its rows may be longer as well.
ROW_S, LENGTH_S = 1.1, 30.0
# A gyro must turn the attitude by no more unseen: beyond it, effects do not add up.
SMALL_RAD = 4.0 * DEG
# Scales and axes of accelerometers and gyros, 5 % together, turn as much of a manoeuvre into a
# drift; three deviations.
DRIFT_SHARE = 0.15


class SlowDrift:
    """Follows the marks, as the short window does.

    Attributes:
        rows: of the window.
        found: the explanation of the latest window, if a drift is its likeliest cause, and was that
            of one of the two before: a drift goes on, and what scales and axes make of a manoeuvre
            ends.
    """

    def __init__(self) -> None:
        self.rows = VelocityRows(ROW_S, LENGTH_S)
        self.found: Explained = NOTHING
        self._drifted = deque((False, False), maxlen=2)  # by the windows before

    def restart(self) -> None:
        """Restarts, as the strapdown does."""
        self.rows.restart()
        self.found = NOTHING
        self._drifted.extend((False, False))

    def forget(self) -> None:
        """Forgets the explanation until the next row."""
        self.found = NOTHING

    def take(self, mark: Mark, errors: SensorErrors) -> bool:
        """Takes a mark; whether it completes a row."""
        if not self.rows.take(mark, errors):
            return False
        self.found = NOTHING
        return True

    def search(self, known: Known, cleared: Collection[Cause]) -> None:
        """Compares the causes over the window.

        Args:
            known: at its end.
            cleared: sensors that show the same as those of other IMUs.
        """
        found = explain(self.rows.rows, known, cleared, SMALL_RAD, MIN_OF_EITHER)
        # Whatever is no drift has been in a short window before.
        least_m_s2 = DRIFT_SHARE * max(self.rows.felt_m_s2, self.rows.usual_m_s2)
        drifts = found.is_force_or_velocity and found.drift_m_s2 > least_m_s2
        if drifts and any(self._drifted):
            self.found = found
        self._drifted.append(drifts)

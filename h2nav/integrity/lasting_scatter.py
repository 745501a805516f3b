"""How much of a force's scatter lasts: the share of it that is white noise down to seconds.

The samples of a vibrating force scatter like white noise, whose integral wanders with the root of
time; that of a vibration comes back. Which of both it is shows in how well the velocities of
earlier windows agree with the force.

Equations: docs/integrity.md, section 5.
"""

from collections import deque
from collections.abc import Sequence

from h2nav.integrity.velocity_model import Known, VelocityModel
from h2nav.integrity.velocity_rows import LENGTH_S, VelocityRow

# Shares of the scatter that are compared.
LASTING_SHARES = (1.0, 0.25, 0.06, 0.015, 0.004)
# Windows that count; the latest one may contain a fault that has not shown itself yet.
MAX_LEARNT_WINDOWS, MIN_LEARNT_WINDOWS = 6, 3
MIN_WINDOW_S = 0.9 * LENGTH_S
# Of the shares that are as likely as the best one within three deviations the largest is taken.
LIKELIHOOD_MARGIN = 4.5


class LastingScatter:
    """Learns from the windows of an attitude.

    Attributes:
        share: of the scatter.
    """

    def __init__(self) -> None:
        self.share = 1.0
        self._windows: deque[list[float]] = deque(maxlen=MAX_LEARNT_WINDOWS + 1)
        self._learnt_us = 0

    def learn(self, rows: Sequence[VelocityRow], known: Known) -> None:
        """Learns from a window, if it is full and new."""
        if not rows or rows[0].begun.moment.t_us < self._learnt_us:
            return
        if known.moment.t_us - rows[0].begun.moment.t_us < 1e6 * MIN_WINDOW_S:
            return
        self._learnt_us = known.moment.t_us
        window = VelocityModel(rows, known)
        models = [window.with_noise(window.force_density_of(share)) for share in LASTING_SHARES]
        self._windows.append([one.level + one.fit(window.sigmas).likelihood for one in models])
        earlier = [*self._windows][:-1]
        if len(earlier) < MIN_LEARNT_WINDOWS:
            return
        totals = [sum(of_share) for of_share in zip(*earlier, strict=True)]
        least = max(totals) - LIKELIHOOD_MARGIN
        likely = zip(LASTING_SHARES, totals, strict=True)
        self.share = next(share for share, total in likely if total >= least)

"""Whether a velocity is refused: from when on, for what, and until when.

Equations: docs/integrity.md, section 5.
"""

from h2nav.integrity.causes import NOTHING, PROBABLY, Cause, Explained
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.velocity_windows import LONG_S, Window
from h2nav.maths.units import DEG

# One that was found false is used again when the force of 10 s has agreed with it within a harmless
# tilt for as long, or within the deviations for 30 s; or when its falsehood has
# become this improbable; at the latest it is heard as if for the first time after this.
HARMLESS_RAD = 1.5 * DEG
PROVED_US = 10_000_000
PASSED_US = 30_000_000
IMPROBABLE = 0.1
REFUSED_US = 120_000_000
# The shortest window that shows a small tilt.
SURE_S = 2.0
# A jump of the velocity may be its way back from a falsehood that it was suspected of in this time
# before.
FALSE_US = 300_000_000
# So far apart two windows may place one jump.
SAME_JUMP_US = 5_000_000
# The longest window still shows a jump.
SEEN_US = round(1.2e6 * LONG_S)


class VelocityRefusal:
    """What is held against the velocity of a receiver.

    Attributes:
        since_us: when it began to be refused; None while it is used.
        shown: the explanation that decided it to be false; None while that is only probable.
        begun: the explanation with which it began.
    """

    def __init__(self) -> None:
        self.since_us: int | None = None
        self.shown: Explained | None = None
        self.begun = NOTHING
        # when it last differed by more than is harmless, and by more than the deviations
        self._differed_us = self._failed_us = 0
        # when it was last suspected, now and in an earlier contradiction
        self._doubted_us: int | None = None
        self._was_doubted_us: int | None = None
        self._back_us: int | None = None  # when it jumped back from that, if it has

    def suspect(self, t_us: int) -> None:
        """Takes that it may be false: its way back is no second falsehood."""
        if self._back_us is None or t_us - self._back_us >= SEEN_US:
            self._doubted_us = t_us

    def forget_contradiction(self) -> None:
        """Takes that it agrees again, or that nothing is known any more."""
        if self._doubted_us is not None:
            self._was_doubted_us, self._doubted_us = self._doubted_us, None
            self._back_us = None

    def comes_back(self, t_us: int, found: Explained) -> bool:
        """Whether a jump may end an earlier falsehood: nobody is accused for it, and it is used."""
        if not found.share(Cause.VELOCITY) > PROBABLY or found.drift_m_s2 > 0.0:
            return False
        if self.since_us is not None and found.jumped_us <= self.since_us:
            return False  # it is the jump for which the velocity is refused
        if self._back_us is not None and found.jumped_us - self._back_us > SAME_JUMP_US:
            return False  # it has come back before
        if self._was_doubted_us is None or t_us - self._was_doubted_us >= FALSE_US:
            return False
        self._back_us = found.jumped_us
        self._end()
        return True

    def begin(self, t_us: int, begun: Explained, shown: Explained | None) -> None:
        """Refuses it from now on."""
        self.begun = begun
        self.since_us = self._differed_us = self._failed_us = t_us
        self.shown = shown

    def deny(self, t_us: int) -> None:
        """Takes that one that is refused still differs, by the receiver's own places."""
        self._differed_us = self._failed_us = t_us

    def hear(
        self,
        t_us: int,
        long: Window | None,
        ratios: InnovationRatios,
        found: Explained | None,
        shown: Explained | None,
    ) -> bool:
        """Hears one that is refused.

        Args:
            long: the longest window of velocities.
            found: a new explanation; None without one.
            shown: the latest explanation that decided it to be false.

        Returns:
            Whether it is used again.
        """
        if self.since_us is None:
            return False
        if self.shown is None:
            self.shown = shown
        if long is None or not ratios.velocity_10s < 1.0:
            self._failed_us = t_us
        if long is None or long.length_s < SURE_S or long.tilt_rad > HARMLESS_RAD:
            self._differed_us = t_us
        is_proved = t_us - self._differed_us > PROVED_US or t_us - self._failed_us > PASSED_US
        is_improbable = (
            found is not None
            and found.is_contradiction
            and found.share(Cause.VELOCITY) < IMPROBABLE
        )
        is_late = t_us - self.since_us > REFUSED_US
        if is_proved:
            self._doubted_us = self._was_doubted_us = None
        is_over = is_proved or is_improbable or is_late or not ratios.of_turn < 1.0
        if is_over:
            self._end()
        return is_over

    def _end(self) -> None:
        self.since_us = self.shown = None

"""What may have bent an attitude, or shaken it, and for how long that counts."""

from h2nav.integrity.causes import OWN_SENSORS, Cause

# An attitude bent by our own sensor judges no compass whose field has the earth's size, and no
# other sensor of ours, for this long after the last decision against the sensor; nor a velocity
# after one by vibration.
BENT_US = 60_000_000


class BentAttitude:
    """Keeps when a sensor of ours, or vibration, was last found to be the cause."""

    def __init__(self) -> None:
        self._decided_us: dict[Cause, int] = {}
        self._bent_us: int | None = None
        self._contradicted_us: int | None = None

    def decide(self, cause: Cause, t_us: int) -> None:
        """Takes a decision."""
        self._decided_us[cause] = t_us

    def bend(self, t_us: int) -> None:
        """Takes that a sensor is wrong, or fits the velocity by a correction, decided or not.

        It excuses no other sensor.
        """
        self._bent_us = t_us

    def contradict(self, t_us: int) -> None:
        """Takes that velocities contradict the attitude, whatever the cause."""
        self._contradicted_us = t_us

    def was_contradicted(self, t_us: int) -> bool:
        """Whether velocities have contradicted it lately: they do not speak for it."""
        return _is_recent(self._contradicted_us, t_us)

    def is_bent(self, t_us: int) -> bool:
        """Whether by a sensor of ours."""
        times_us = [self._decided_us.get(cause) for cause in OWN_SENSORS]
        return any(_is_recent(then_us, t_us) for then_us in (*times_us, self._bent_us))

    def is_shaken(self, t_us: int) -> bool:
        """Whether by vibration."""
        return _is_recent(self._decided_us.get(Cause.VIBRATION), t_us)

    def excuses(self, cause: Cause, begun_us: int) -> bool:
        """Whether what looks like a sensor's fault may be what the other sensor has bent.

        Args:
            begun_us: beginning of the window: its attitude is the filter's of that time.
        """
        if not self._decided_us or cause not in OWN_SENSORS:
            return False
        others = (self._decided_us.get(one) for one in OWN_SENSORS if one is not cause)
        return any(
            then_us is not None and then_us < begun_us and _is_recent(then_us, begun_us)
            for then_us in others
        )


def _is_recent(then_us: int | None, now_us: int) -> bool:
    return then_us is not None and now_us - then_us < BENT_US

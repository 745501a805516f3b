"""Reliability of a lane: rejected readings, a filter to restart, a resting stream."""

from collections.abc import Callable

from h2nav.maths.units import SECOND_NS
from h2nav.service.health import Objection
from h2nav.service.sample_clock import TimeVerdict

# Reasons for missing samples, by the results of the latest readings.
REFUSAL_TEXTS = {
    "non_finite": "IMU messages hold NaN or infinity",
    "frozen": "the gyro repeats its values: it is frozen",
    "zero_force": "the accelerometer reads exactly zero",
    "rate_out_of_range": "the gyro's values are beyond any gyro's range",
    "force_out_of_range": "the accelerometer's values are beyond any accelerometer's range",
    "time_out_of_range": "the time stamps of the IMU messages are no times",
    TimeVerdict.DUPLICATE.value: "the time stamps of the IMU messages stand still",
    TimeVerdict.LATE.value: "the time stamps of the IMU messages run backwards",
    TimeVerdict.STRAY.value: "the time stamps of the IMU messages jump",
}
RECENT_NS = SECOND_NS
# A filter fed with bad samples for this long has lost its attitude.
RESTART_AFTER_NS = SECOND_NS
# Its sensors have to be good again for this long before it gets another one.
GOOD_AGAIN_NS = SECOND_NS
# After this many consecutive rejections the stream is not a lane for a while.
REFUSALS = 100
REST_NS = 60 * SECOND_NS


class LaneTrust:
    """The state of trust in one lane.

    Args:
        count: counts a rejected reading, by reason.
    """

    def __init__(self, count: Callable[[str], object]) -> None:
        self._count = count
        self._refusal, self._refused_ns = "", 0
        self.refusals = 0  # readings rejected since the last one that was used
        self._rests_until_ns: int | None = None
        self._bad_ns: int | None = None
        self._good_ns: int | None = None
        self.sensor_is_bad = False  # a sensor is known to be faulty
        # the filter has to restart, if possible with the attitude of another lane
        self.needs_restart = False
        # why nothing of the stream was usable in the end; empty once a reading was used again
        self.lost = ""

    # --- readings that are refused ------------------------------------------------------------

    def refuse(self, t_ns: int, reason: str) -> None:
        """Counts a rejected reading."""
        self._count(reason)
        self._refusal, self._refused_ns = reason, t_ns
        self.refusals += 1
        if self.is_refused:
            self.lost = REFUSAL_TEXTS.get(reason, reason)

    def fault(self, reason: str) -> None:
        """Counts a fault of the filter, for which the stream is not to blame."""
        self._count(reason)

    def accept(self) -> None:
        """Notes a reading that was used."""
        self.refusals, self.lost = 0, ""

    @property
    def is_refused(self) -> bool:
        """Whether nothing of its stream is usable."""
        return self.refusals >= REFUSALS

    def why_no_samples(self, t_ns: int) -> Objection | None:
        """What is wrong with the latest readings; None if there were none."""
        if not self._refusal or t_ns - self._refused_ns > RECENT_NS:
            return None
        return Objection(self._refusal, REFUSAL_TEXTS.get(self._refusal, self._refusal))

    # --- a stream that rests ------------------------------------------------------------------

    @property
    def rests_until_ns(self) -> int | None:
        """Until when the stream is not a lane; None if it is."""
        return self._rests_until_ns

    def rest(self, t_ns: int) -> None:
        """Stops using the stream as a lane for a while: a duplicate, or nothing is usable."""
        self._rests_until_ns = t_ns + REST_NS

    def rests(self, t_ns: int) -> bool:
        """Whether the stream rests at present."""
        return self._rests_until_ns is not None and t_ns < self._rests_until_ns

    def wake(self, t_ns: int) -> None:
        """Ends a rest that is over: the filter has to restart."""
        if self._rests_until_ns is not None and t_ns >= self._rests_until_ns:
            self._rests_until_ns, self.refusals, self.needs_restart = None, 0, True

    # --- a filter that needs a restart ----------------------------------------------------------

    def judge(self, t_ns: int, *, sensor_is_bad: bool) -> None:
        """Tracks how long the sensors have been good or faulty."""
        self.sensor_is_bad = sensor_is_bad
        if sensor_is_bad:
            self._good_ns = None
            if self._bad_ns is None:
                self._bad_ns = t_ns
            self.needs_restart |= t_ns - self._bad_ns > RESTART_AFTER_NS
            return
        self._bad_ns = None
        if self._good_ns is None:
            self._good_ns = t_ns

    def require_restart(self) -> None:
        """Has the filter restarted: it holds an error that it does not lose by itself."""
        self.needs_restart = True

    def renew(self) -> None:
        """Notes that the filter has restarted."""
        self.needs_restart = False

    def is_good_again(self, t_ns: int) -> bool:
        """Whether the filter needs a restart, and its sensors have been good again for a while."""
        since_ns = self._good_ns
        return self.needs_restart and since_ns is not None and t_ns - since_ns >= GOOD_AGAIN_NS

"""The field of an IMU without a compass: that of another IMU's compass, which turns with it.

Most vehicles have one compass and two or three IMUs. Without a field the others' lanes would know
no heading when they are needed.
"""

from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.maths.units import SECOND_NS

# An IMU whose messages hold no field for this long has no compass; the slowest ones read at 2 Hz.
NO_COMPASS_NS = SECOND_NS
# A field waits for the next sample. An older one is that of another attitude.
STALE_NS = 50_000_000


class LentField:
    """Chooses the field of each sample of one IMU: its own, or the lent one if it never has any.

    Args:
        imu: number of the IMU.

    Attributes:
        of: number of the IMU whose compass is in use.
    """

    def __init__(self, imu: int) -> None:
        self._imu = self.of = imu
        self.restart()

    def restart(self) -> None:
        """Restarts with the samples' time."""
        self._own_ns: int | None = None  # of the newest own field, or of the first sample
        self._has_own = False
        self._waiting: tuple[int, Vec3] | None = None
        self.of = self._imu

    @property
    def is_lent(self) -> bool:
        """Whether another IMU's compass is in use."""
        return self.of != self._imu

    def is_wanted(self, t_ns: int) -> bool:
        """Whether the IMU has no compass of its own."""
        return self._own_ns is not None and t_ns - self._own_ns > NO_COMPASS_NS

    def may_be_lent(self, t_ns: int) -> bool:
        """Whether its own compass is there."""
        return self._has_own and not self.is_wanted(t_ns)

    def lend(self, t_ns: int, field: Vec3, of: int) -> None:
        """Takes the field of another IMU for the next sample."""
        self._waiting, self.of = (t_ns, field), of

    def choose(self, t_ns: int, sample: ImuSample) -> ImuSample:
        """The sample, with a lent field if it has none; each field counts once."""
        if sample.m_b_ut is not None:
            self._own_ns, self._has_own, self._waiting, self.of = t_ns, True, None, self._imu
            return sample
        if self._own_ns is None:
            self._own_ns = t_ns
        waiting, self._waiting = self._waiting, None
        if waiting is None or t_ns - waiting[0] > STALE_NS:
            return sample
        return sample._replace(m_b_ut=waiting[1])

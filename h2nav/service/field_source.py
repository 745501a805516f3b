"""Selects the magnetic field of a sample: its own message's, or a calibrated one beside it.

PX4's SCALED_IMU has the sensors' rates and forces, but its field is the raw sensor's: without
offsets, scale and the rotation of an external compass. The field of its HIGHRES_IMU is calibrated.
So a sample of the former takes the newest field of the latter, each field once. The sample is later
than the field's message by at most half a period of HIGHRES_IMU, which counts as part of the delay
of that field (`sensor_delays`).
"""

from h2nav.attitude.samples import Vec3
from h2nav.maths.units import SECOND_NS
from h2nav.wire.imu import IDS_BY_NAME, ImuMessage

CALIBRATED_ID = IDS_BY_NAME["HIGHRES_IMU"]
# A calibrated field may have to be requested: wait this long before a raw one counts.
WAIT_NS = 2 * SECOND_NS
# After one, no field for this long is better than a raw one, which is wrong by degrees at once:
# meanwhile the gyro alone drifts by tenths of a degree.
TRUSTED_NS = 5 * SECOND_NS
# After a longer silence filters align anew: not by the field of the attitude before it.
STALE_NS = SECOND_NS


class FieldSource:
    """Selects the field of every sample of one autopilot.

    Args:
        autopilot: MAV_AUTOPILOT of its heartbeat.
        lends: whether the field of another message may be used.

    Attributes:
        has_lent: a sample has used the field of another message.
        is_raw: the latest field used is the sensor's, not calibrated.
    """

    def __init__(self, autopilot: int, lends: bool) -> None:
        self._autopilot = autopilot
        self._lends = lends
        self._waiting: Vec3 | None = None
        self._heard_ns: int | None = None
        self._since_ns: int | None = None
        self.has_lent = False
        self.is_raw = False

    def restart(self) -> None:
        """Restarts with the autopilot's time, when streams have to be requested again."""
        self._waiting = self._heard_ns = self._since_ns = None

    def is_wanted(self, chosen: ImuMessage | None) -> bool:
        """Whether the field of `CALIBRATED_ID` is needed besides the chosen message."""
        return chosen is not None and self._may_borrow(chosen)

    def take_field(self, t_ns: int, field: Vec3 | None) -> None:
        """Takes the field of a needed message; None if it has no new one."""
        if field is not None:
            self._waiting, self._heard_ns = field, t_ns

    def choose(self, t_ns: int, message: ImuMessage, own: Vec3 | None) -> Vec3 | None:
        """The field of a sample, by the field of its own message."""
        is_raw = self._autopilot in message.raw_field_of
        if not (is_raw and self._lends):
            self.is_raw = is_raw
            if own is not None and message.message_id == CALIBRATED_ID:
                self._waiting, self._heard_ns = None, t_ns
            return own
        if self._since_ns is None:
            self._since_ns = t_ns
        field, self._waiting = self._waiting, None
        if field is not None and self._heard_ns is not None and t_ns - self._heard_ns <= STALE_NS:
            self.has_lent, self.is_raw = True, False
            return field
        if self._hopes(t_ns):
            return None
        self.is_raw = True
        return own

    def _may_borrow(self, message: ImuMessage) -> bool:
        return self._lends and self._autopilot in message.raw_field_of

    def _hopes(self, t_ns: int) -> bool:
        """Whether a calibrated field may still come."""
        if self._heard_ns is not None:
            return t_ns - self._heard_ns <= TRUSTED_NS
        assert self._since_ns is not None
        return t_ns - self._since_ns <= WAIT_NS

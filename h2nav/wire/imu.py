"""The IMU messages of MAVLink as autopilots really send them, in body SI units.

One table row per message; a new IMU message is a new row. The units differ (milli-g, mrad/s and
mgauss in integers; SI and gauss in HIGHRES_IMU), and HIGHRES_IMU of ArduPilot before 2026-02
reports the field 10^6 too large, which is detected and corrected.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.wire.refused import Refused, need_finite, need_time, need_within

MILLI_G = GRAVITY_M_S2 * 1e-3
INT16_END = 32_767
# No common gyro measures more. Autopilots cast to int16 without a limit, so 32.8 to 34.9 rad/s
# arrive as -32.8 to -30.6: such a value is ambiguous.
GYRO_RANGE_RAD_S = math.radians(2000.0)
AMBIGUOUS_MRAD_S = math.floor(2 * (INT16_END + 1) - GYRO_RANGE_RAD_S * 1e3)
# The end of the range after subtraction of a bias of 10 deg/s.
CLIPPED_RATE_RAD_S = GYRO_RANGE_RAD_S - math.radians(10.0)
# Of the usual 16 g; from here on ArduPilot also counts a sample as clipped.
CLIPPED_FORCE_MG = 15_500
CLIPPED_FORCE_M_S2 = 15.5 * GRAVITY_M_S2
UT_PER_MGAUSS = 0.1
UT_PER_GAUSS = 100.0
# Beyond any gyro (4,000 deg/s) and any accelerometer (200 g) in use.
LARGEST_RATE_RAD_S = 100.0
LARGEST_FORCE_M_S2 = 200.0 * GRAVITY_M_S2
# A field beyond this cannot come from the earth or from a magnet near the sensor's range.
ABSURD_FIELD_UT = 1e6
HIGHRES_FIELD_FAULT = 1e6
HIGHRES_MAG_BITS = 0x1C0
HIGHRES_MOTION_BITS = 0x3F
MAX_IMUS = 3
# For readings from an autopilot's own log; MAVLink's ids have 24 bits.
RECORDED_IMU = 1 << 24


class Ages(NamedTuple):
    """How old values are at the times that their messages claim, s; None = not known."""

    rates_s: float | None  # rates and forces
    field_s: float | None  # the field when it is new


class ImuReading(NamedTuple):
    """An IMU message in body SI units, before its time is unwrapped."""

    time: int  # the message's own time, in units of its row's `time_unit_us`
    w_b: Vec3  # angular rate, rad/s
    f_b: Vec3  # specific force, m/s^2; never exactly zero
    m_b_ut: Vec3 | None  # magnetic field, microtesla; None where the message carries no field
    clipped: bool  # a value is at the end of its message's or of any usual sensor's range
    # number of the IMU, from 0, if the message carries it; None if its name implies it
    imu: int | None = None
    # of the values, where the recording shows them; None where only their kind is known
    ages: Ages | None = None

    def at(self, t_us: int) -> ImuSample:
        """The sample at its unwrapped time."""
        return ImuSample(t_us, self.w_b, self.f_b, self.m_b_ut, self.clipped)


def _integers(time: int, m: Any) -> ImuReading:
    """RAW_IMU and SCALED_IMU*: milli-g, mrad/s, mgauss in int16."""
    p, q, r = m.xgyro, m.ygyro, m.zgyro
    x, y, z = m.xacc, m.yacc, m.zacc
    if x == 0 and y == 0 and z == 0:
        # SCALED_IMU3 of a vehicle with two IMUs and three compasses.
        raise Refused("zero_force")
    a, b, c = m.xmag, m.ymag, m.zmag
    no_field = a == 0 and b == 0 and c == 0
    return ImuReading(
        time,
        (p * 1e-3, q * 1e-3, r * 1e-3),
        (x * MILLI_G, y * MILLI_G, z * MILLI_G),
        None if no_field else (a * UT_PER_MGAUSS, b * UT_PER_MGAUSS, c * UT_PER_MGAUSS),
        not (_is_within(AMBIGUOUS_MRAD_S, p, q, r) and _is_within(CLIPPED_FORCE_MG, x, y, z)),
    )


def _is_within(limit: float, x: float, y: float, z: float) -> bool:
    """Whether all three are smaller than the limit; a NaN is not."""
    return -limit < x < limit and -limit < y < limit and -limit < z < limit


def _raw_imu(m: Any) -> ImuReading:
    return _integers(need_time("time_out_of_range", m.time_usec), m)


def _scaled_imu(m: Any) -> ImuReading:
    return _integers(m.time_boot_ms, m)


def _highres_imu(m: Any) -> ImuReading:
    """HIGHRES_IMU: SI and gauss; `fields_updated` says which values are new."""
    field: Vec3 | None = None
    if m.fields_updated & HIGHRES_MAG_BITS:
        gauss = UT_PER_GAUSS
        field = _highres_field((m.xmag * gauss, m.ymag * gauss, m.zmag * gauss))
    rate, force = (m.xgyro, m.ygyro, m.zgyro), (m.xacc, m.yacc, m.zacc)
    # An unclipped value is finite and within all other limits: only the rest is checked twice.
    clipped = not (_is_within(CLIPPED_RATE_RAD_S, *rate) and _is_within(CLIPPED_FORCE_M_S2, *force))
    if clipped:
        need_finite("non_finite", *rate, *force)
    if m.fields_updated & HIGHRES_MOTION_BITS != HIGHRES_MOTION_BITS or force == (0.0, 0.0, 0.0):
        raise Refused("zero_force")
    if clipped:
        need_within("rate_out_of_range", LARGEST_RATE_RAD_S, *rate)
        need_within("force_out_of_range", LARGEST_FORCE_M_S2, *force)
    time = need_time("time_out_of_range", m.time_usec)
    # MAVLink 1 has no number; an impossible number counts as none.
    imu = m.id if m.id < MAX_IMUS else 0
    return ImuReading(time, rate, force, field, clipped, imu)


def _highres_field(m_b_ut: Vec3) -> Vec3 | None:
    """The field without ArduPilot's factor; None where it is all zero or absurd."""
    norm_ut = math.hypot(*m_b_ut)
    need_finite("non_finite", norm_ut)
    if norm_ut > ABSURD_FIELD_UT:
        m_b_ut = (
            m_b_ut[0] / HIGHRES_FIELD_FAULT,
            m_b_ut[1] / HIGHRES_FIELD_FAULT,
            m_b_ut[2] / HIGHRES_FIELD_FAULT,
        )
        norm_ut /= HIGHRES_FIELD_FAULT
    return m_b_ut if 0.0 < norm_ut <= ABSURD_FIELD_UT else None


class ImuMessage(NamedTuple):
    """One row: how to read an IMU message."""

    name: str  # of the message
    message_id: int  # of the message
    time_unit_us: int  # microseconds per count of its time
    # fields to reading; raises `Refused`. None where an importer made the reading.
    read: Callable[[Any], ImuReading] | None
    # autopilots (MAV_AUTOPILOT) whose estimator has already removed the bias
    bias_removed_by: frozenset[int] = frozenset()
    # autopilots that send the sensor's uncalibrated field
    raw_field_of: frozenset[int] = frozenset()
    imu: int = 0  # number of its IMU, from 0; for HIGHRES_IMU the default, see `ImuReading.imu`


_PX4 = frozenset({mavlink.MAV_AUTOPILOT_PX4})

IMU_MESSAGES: dict[int, ImuMessage] = {
    row.message_id: row
    for row in (
        ImuMessage(
            "HIGHRES_IMU",
            mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,
            1,
            _highres_imu,
            bias_removed_by=_PX4,
        ),
        ImuMessage("recorded IMU", RECORDED_IMU, 1, None),
        ImuMessage("RAW_IMU", mavlink.MAVLINK_MSG_ID_RAW_IMU, 1, _raw_imu),
        *(
            ImuMessage(name, message_id, 1000, _scaled_imu, raw_field_of=_PX4, imu=imu)
            for imu, (name, message_id) in enumerate(
                (
                    ("SCALED_IMU", mavlink.MAVLINK_MSG_ID_SCALED_IMU),
                    ("SCALED_IMU2", mavlink.MAVLINK_MSG_ID_SCALED_IMU2),
                    ("SCALED_IMU3", mavlink.MAVLINK_MSG_ID_SCALED_IMU3),
                )
            )
        ),
    )
}
# They carry the number of their IMU.
NUMBERED_IDS = (mavlink.MAVLINK_MSG_ID_HIGHRES_IMU, RECORDED_IMU)
IDS_BY_NAME = {row.name: row.message_id for row in IMU_MESSAGES.values()}

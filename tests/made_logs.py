"""Logs as autopilots write them, of simulated flights with exact truth.

`made_flight` flies, `dataflash` and `ulog` write: with the names of today or with those of old, and
with what a test adds. Everything is made of arrays, so that long logs are made in seconds.
"""

import math
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.maths.units import DEG, EARTH_RADIUS_M
from h2nav.recordings.dataflash_tables import FIELDS, FMT_BYTES, FMT_TYPE, HEAD
from h2nav.recordings.ulog_tables import MAGIC, TYPES
from h2nav.sim.imu_model import MPU_9250, GyroSampling, ImuBatch, ImuModel, readings
from h2nav.sim.scenarios import scenario
from h2nav.sim.vehicle import HOME

Times = NDArray[np.int64]
Values = NDArray[np.float64]

START_US = 20_000_000
GPS_PERIOD_US = 200_000
GPS_WEEK, GPS_WEEK_MS = 2_400, 200_000_000
# As in `service.sensor_delays`: ArduPilot's low-pass at 20 Hz and mean of 100 ms.
ARDUPILOT_RATES_S, ARDUPILOT_FIELD_S = 0.01125, 0.05
PARAMETERS = {"INS_GYRO_FILTER": 20.0, "FRAME_CLASS": 1.0, "MOT_THST_HOVER": 0.35}
AXES = "XYZ"


class MadeFlight(NamedTuple):
    """A flight with what its sensors showed.

    Attributes:
        t_us: (N,) times of the samples, since boot.
        q_nb: (N, 4) true attitude.
        imus: one per IMU, its field from a compass of its own.
        fix_us: (M,) times of the fixes.
        place: (M, 3) latitude and longitude, deg, and altitude, m.
        v_n: (M, 3) true velocity, m/s.
        armed_us: when the motors were armed.
        airborne_us: when it left the ground.
    """

    t_us: Times
    q_nb: Values
    imus: tuple[ImuBatch, ...]
    fix_us: Times
    place: Values
    v_n: Values
    armed_us: int
    airborne_us: int

    def repeated(self, times: int) -> "MadeFlight":
        """The same flight again and again."""
        length_us = int(self.t_us[-1] - self.t_us[0]) + int(np.median(np.diff(self.t_us)))

        def later(t_us: Times) -> Times:
            shifts = np.arange(times, dtype=np.int64)[:, None] * length_us
            return (t_us + shifts).ravel()

        def again(values: Values) -> Values:
            return np.concatenate([values] * times)

        imus = tuple(
            ImuBatch(later(imu.t_us), *(again(values) for values in imu[1:])) for imu in self.imus
        )
        return self._replace(
            t_us=later(self.t_us),
            q_nb=again(self.q_nb),
            imus=imus,
            fix_us=later(self.fix_us),
            place=again(self.place),
            v_n=again(self.v_n),
        )


def made_flight(
    name: str = "flight",
    duration_s: float = 40.0,
    rate_hz: float = 100.0,
    imus: int = 2,
    *,
    rates_s: float = ARDUPILOT_RATES_S,
    field_s: float = ARDUPILOT_FIELD_S,
    sampling: GyroSampling = GyroSampling.INSTANT,
    bias_deg_s: float = 0.1,
) -> MadeFlight:
    """A scenario of `h2nav.sim`.

    Args:
        name: of the scenario.
        duration_s: of the log.
        rate_hz: of the IMUs.
        imus: how many.
        rates_s: age of rates and forces at their times.
        field_s: age of the fields.
        sampling: what a gyro sample is.
        bias_deg_s: of the gyros.
    """
    flown = scenario(name)
    since_us = np.round(np.arange(round(duration_s * rate_hz)) * 1e6 / rate_hz).astype(np.int64)
    ideal = readings(
        lambda t_s: flown.motion(t_s - rates_s), since_us.tolist(), HOME.field, sampling
    )
    fields = readings(
        lambda t_s: flown.motion(t_s - field_s), since_us.tolist(), HOME.field, sampling
    )
    truth = np.array([flown.motion(t * 1e-6).q_nb for t in since_us.tolist()])
    ideal = ideal._replace(m_b_ut=fields.m_b_ut, t_us=since_us + START_US)
    batches = []
    for number in range(imus):
        bias = tuple(bias_deg_s * math.cos(number + axis) for axis in range(3))
        sensor = MPU_9250._replace(gyro_bias_deg_s=bias, gyro_sampling=sampling)
        batches.append(ImuModel(sensor, HOME.field, number, rate_hz).batch(ideal))
    fix_us = np.arange(0, round(duration_s * 1e6), GPS_PERIOD_US, dtype=np.int64)
    motions = [flown.motion(t * 1e-6) for t in fix_us.tolist()]
    return MadeFlight(
        since_us + START_US,
        truth,
        tuple(batches),
        fix_us + START_US,
        np.array([_geographic(motion.p_n) for motion in motions]),
        np.array([motion.v_n for motion in motions]),
        START_US + round((flown.armed_s or 0.0) * 1e6),
        START_US + round((flown.airborne_s or 0.0) * 1e6),
    )


def _geographic(p_n: Sequence[float]) -> tuple[float, float, float]:
    parallel_m = EARTH_RADIUS_M * math.cos(HOME.latitude_deg * DEG)
    return (
        HOME.latitude_deg + p_n[0] / EARTH_RADIUS_M / DEG,
        HOME.longitude_deg + p_n[1] / parallel_m / DEG,
        HOME.altitude_m - p_n[2],
    )


def euler_deg(q: Values) -> Values:
    """(N, 3) roll, pitch and yaw from 0 to 360, deg."""
    w, x, y, z = q.T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.degrees(np.stack((roll, pitch, yaw % math.tau), axis=1))


class _Records:
    """Records of several kinds, which are put into the order of their times."""

    def __init__(self) -> None:
        self._parts: list[tuple[Times, NDArray[np.uint8]]] = []

    def add(self, t_us: Times, rows: NDArray[np.void]) -> None:
        records = np.frombuffer(rows.tobytes(), np.uint8).reshape(len(rows), -1)
        self._parts.append((np.asarray(t_us), records))

    def in_order(self) -> bytes:
        """All of them; of one time in the order in which they were added."""
        times = np.concatenate([t_us for t_us, _ in self._parts])
        lengths = np.concatenate([np.full(len(t), rows.shape[1]) for t, rows in self._parts])
        order = np.argsort(times, kind="stable")
        places = np.empty(len(times), np.int64)
        places[order] = np.cumsum(lengths[order]) - lengths[order]
        data = np.empty(int(lengths.sum()), np.uint8)
        first = 0
        for t_us, rows in self._parts:
            starts = places[first : first + len(t_us)]
            for column in range(rows.shape[1]):
                data[starts + column] = rows[:, column]
            first += len(t_us)
        return data.tobytes()


# --- ArduPilot --------------------------------------------------------------------------------


class DataflashWriter:
    """Messages by their names, letters and columns, as ArduPilot defines them."""

    def __init__(self) -> None:
        self._formats: list[bytes] = []
        self._numbers = {"FMT": FMT_TYPE}
        self._records = _Records()
        self._defines("FMT", FMT_TYPE, FMT_BYTES, "BBnNZ", "Type,Length,Name,Format,Columns")

    def add(self, name: str, letters: str, columns: str, t_us: Times, *values: object) -> None:
        """A message; where TimeUS or TimeMS is its first column, that is filled in.

        Args:
            name: of the message.
            letters: formats of the columns.
            columns: their names, separated by commas.
            t_us: (N,) times.
            values: of the (other) columns, (N,) each or one for all, in physical units.
        """
        number = self._numbers.setdefault(name, FMT_TYPE + len(self._numbers))
        names = columns.split(",")
        types = [(column, FIELDS[letter][0]) for column, letter in zip(names, letters, strict=True)]
        rows = np.zeros(len(t_us), [("head", "u1", 3), *types])
        rows["head"] = (*HEAD, number)
        if names[0].startswith("Time"):
            values = (t_us if names[0] == "TimeUS" else t_us // 1000, *values)
        for column, letter, value in zip(names, letters, values, strict=True):
            divisor = FIELDS[letter][1]
            rows[column] = value if divisor is None else np.round(np.asarray(value) * divisor)
        if len(self._formats) < len(self._numbers):
            self._defines(name, number, rows.dtype.itemsize, letters, columns)
        self._records.add(t_us, rows)

    def _defines(self, name: str, number: int, length: int, letters: str, columns: str) -> None:
        texts = (name.encode(), letters.encode(), columns.encode())
        self._formats.append(HEAD + struct.pack("<BBB4s16s64s", FMT_TYPE, number, length, *texts))

    def bytes(self) -> bytes:
        """The log."""
        return b"".join(self._formats) + self._records.in_order()


def dataflash(
    flight: MadeFlight, *, old: bool = False, extra: DataflashWriter | None = None
) -> bytes:
    """A log of ArduCopter: 4.5 with numbered instances, or ``old``: 3.3 with IMU2 and milliseconds.

    Args:
        flight: what happened.
        old: with the names of 2015.
        extra: holds further messages already.
    """
    writer = extra or DataflashWriter()
    start = np.array([START_US], np.int64)
    once = "TimeMS" if old else "TimeUS"
    q = "I" if old else "Q"
    version = "APM:Copter V3.3.3 (acf2e10c)" if old else "ArduCopter V4.5.7 (2a3dc4b7)"
    writer.add("MSG", f"{q}Z", f"{once},Message", start, np.array([version.encode()]))
    names = np.array([name.encode() for name in PARAMETERS])
    at_start = np.full(len(names), START_US)
    values = np.array(list(PARAMETERS.values()))
    writer.add("PARM", f"{q}Nf", f"{once},Name,Value", at_start, names, values)
    writer.add("MODE", f"{q}MBB", f"{once},Mode,ModeNum,Rsn", start, 5, 5, 1)
    events = np.array([flight.armed_us, flight.airborne_us])
    writer.add("EV", f"{q}B", f"{once},Id", events, [10, 28])
    for number, imu in enumerate(flight.imus):
        _add_imu(writer, number, imu, old=old)
    _add_attitudes(writer, flight, old=old)
    _add_gps(writer, flight, old=old)
    return writer.bytes()


def _add_imu(writer: DataflashWriter, number: int, imu: ImuBatch, *, old: bool) -> None:
    period_s = float(np.median(np.diff(imu.t_us))) * 1e-6
    every = max(1, round(0.1 / period_s))
    fields = np.round(imu.m_b_ut[::every].T * 10.0)
    motion = [*imu.w_b.T, *imu.f_b.T]
    axes, compass = "GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "MagX,MagY,MagZ,OfsX,OfsY,OfsZ,Health"
    if old:
        tag = f"{number + 1}" if number else ""
        writer.add(f"IMU{tag}", "Iffffff", f"TimeMS,{axes}", imu.t_us, *motion)
        writer.add(
            f"MAG{tag}", "IhhhhhhB", f"TimeMS,{compass}", imu.t_us[::every], *fields, 9, 9, 9, 1
        )
        return
    columns = f"TimeUS,I,{axes},EG,EA,T,GH,AH,GHz,AHz"
    others = (0, 0, 45.0, 1, 1, 1000, 1000)
    writer.add("IMU", "QBffffffIIfBBHH", columns, imu.t_us, number, *motion, *others)
    measured_us = imu.t_us[::every]
    writer.add(
        "MAG",
        "QBhhhhhhBI",
        f"TimeUS,I,{compass},S",
        measured_us,
        number,
        *fields,
        *(9, 9, 9, 1, measured_us),
    )


def _add_attitudes(writer: DataflashWriter, flight: MadeFlight, *, old: bool) -> None:
    """The truth, as every estimator of the autopilot: 25 times a second."""
    every = max(1, round(0.04e6 / float(np.median(np.diff(flight.t_us)))))
    t_us, q_nb = flight.t_us[::every], flight.q_nb[::every]
    angles = euler_deg(q_nb).T
    if old:
        columns = "TimeMS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw"
        desired = (0, angles[0], 0, angles[1], 0, angles[2], 0, 0)
        writer.add("ATT", "IccccCCCC", columns, t_us, *desired)
        writer.add("AHR2", "IccCfLL", "TimeMS,Roll,Pitch,Yaw,Alt,Lat,Lng", t_us, *angles, 0, 0, 0)
        writer.add("EKF1", "IccC", "TimeMS,Roll,Pitch,Yaw", t_us, *angles)
        return
    columns = "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,AEKF"
    desired = (0, angles[0], 0, angles[1], 0, angles[2], 3)
    writer.add("ATT", "QffffffB", columns, t_us, *desired)
    for core in range(len(flight.imus)):
        writer.add("XKQ", "QBffff", "TimeUS,C,Q1,Q2,Q3,Q4", t_us, core, *q_nb.T)
        writer.add("XKF4", "QBb", "TimeUS,C,PI", t_us, core, 0)
    writer.add("SIM", "Qffff", "TimeUS,Q1,Q2,Q3,Q4", t_us, *q_nb.T)


def _add_gps(writer: DataflashWriter, flight: MadeFlight, *, old: bool) -> None:
    """Fixes 5 times a second."""
    north, east, down = flight.v_n.T
    speed, course = np.hypot(north, east), np.degrees(np.arctan2(east, north)) % 360.0
    week_ms = GPS_WEEK_MS + (flight.fix_us - START_US) // 1000
    where = (*flight.place.T, speed, course, down)
    if old:
        columns = "Status,TimeMS,Week,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs,VZ,T"
        boot_ms = flight.fix_us // 1000
        latitude, longitude, altitude, *motion = where
        values = (GPS_WEEK, 12, 0.8, latitude, longitude, 0.0, altitude, *motion, boot_ms)
        writer.add("GPS", "BIHBcLLeeEefI", columns, flight.fix_us, 3, week_ms, *values)
        return
    columns = "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U"
    values = (0, 3, week_ms, GPS_WEEK, 14, 0.7, *where, 0.0, 1)
    writer.add("GPS", "QBBIHBcLLeffffB", columns, flight.fix_us, *values)
    columns = "TimeUS,I,VDop,HAcc,VAcc,SAcc,YAcc,VV,SMS,Delta"
    values = (0, 1.0, 0.5, 0.8, 0.2, 0.0, 1, flight.fix_us // 1000, 200)
    writer.add("GPA", "QBCCCCfBIH", columns, flight.fix_us, *values)


# --- PX4 --------------------------------------------------------------------------------------


class ULogWriter:
    """Topics by their names and fields, as PX4's logger defines them."""

    def __init__(self) -> None:
        self._head = [struct.pack("<7sBQ", MAGIC, 1, START_US)]
        self._head.append(_ulog_message("B", bytes(40)))
        self._subscriptions: list[bytes] = []
        self._formats: set[str] = set()
        self._records = _Records()

    def info(self, key: str, value: bytes) -> None:
        """An information, its key with the type in front."""
        self._head.append(_ulog_message("I", bytes((len(key),)) + key.encode() + value))

    def parameter(self, name: str, value: float) -> None:
        """A parameter from the start on."""
        key = f"float {name}"
        body = bytes((len(key),)) + key.encode() + struct.pack("<f", value)
        self._head.append(_ulog_message("P", body))

    def text(self, t_us: int, level: int, text: str) -> None:
        """A text of the autopilot."""
        body = struct.pack("<BQ", ord("0") + level, t_us) + text.encode()
        row = np.frombuffer(_ulog_message("L", body), np.uint8)
        self._records.add(np.array([t_us]), row.view([("", f"V{len(row)}")]))

    def define(self, topic: str, fields: str) -> None:
        """A format, whatever it says."""
        self._head.append(_ulog_message("F", f"{topic}:{fields};".encode()))

    def subscribe(self, topic: str, subscription: int, number: int = 0) -> None:
        """An instance of a topic gets a number, whether there is such a topic or not."""
        body = struct.pack("<BH", number, subscription) + topic.encode()
        self._subscriptions.append(_ulog_message("A", body))

    def add(self, topic: str, fields: str, t_us: Times, *values: object, number: int = 0) -> None:
        """A topic with its time in the first field.

        Args:
            topic: its name.
            fields: behind the time: ``type name`` or ``type[n] name``, separated by semicolons.
            t_us: (N,) times.
            values: (N,), (N, n) or one for all, of each field.
            number: of the instance.
        """
        if topic not in self._formats:
            self._formats.add(topic)
            self.define(topic, f"uint64_t timestamp;{fields}")
        subscription = len(self._subscriptions)
        self.subscribe(topic, subscription, number)
        row: list[tuple[str, object]] = [("size", "<u2"), ("type", "u1"), ("id", "<u2")]
        row.append(("timestamp", "<u8"))
        for field in fields.split(";"):
            kind, name = field.split(" ")
            if name.startswith("_padding"):
                break  # at the end, PX4 leaves it out
            kind, _, count = kind.rstrip("]").partition("[")
            row.append((name, f"({count},){TYPES[kind]}" if count else TYPES[kind]))
        rows = np.zeros(len(t_us), row)
        rows["size"], rows["type"], rows["id"] = rows.dtype.itemsize - 3, ord("D"), subscription
        rows["timestamp"] = t_us
        for (name, _), value in zip(row[4:], values, strict=False):
            rows[name] = value
        self._records.add(t_us, rows)

    def bytes(self) -> bytes:
        """The file."""
        return b"".join((*self._head, *self._subscriptions)) + self._records.in_order()


def _ulog_message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog(
    flight: MadeFlight,
    *,
    old: bool = False,
    extra: ULogWriter | None = None,
    has_velocity: Any = 1,
) -> bytes:
    """A log of PX4: 1.15 with a vehicle_imu per IMU, or ``old``: 1.6 with sensor_combined.

    Args:
        flight: what happened; its gyros shall give means, and nothing be late.
        old: with the topics of 2017, and the first IMU alone.
        extra: holds further topics already.
        has_velocity: of each fix, whether its receiver calls the velocity valid; 1: of all.
    """
    writer = extra or ULogWriter()
    writer.info("char[3] sys_name", b"PX4")
    writer.info("uint32_t ver_sw_release", struct.pack("<I", 0x010F02FF))
    writer.parameter("MAV_TYPE", 2.0)
    writer.text(START_US + 1_000_000, 6, "[logger] logging")
    status_us = np.arange(START_US, int(flight.t_us[-1]), 500_000)
    states = (np.where(status_us >= flight.armed_us, 2, 1), 2)
    writer.add("vehicle_status", "uint8_t arming_state;uint8_t nav_state", status_us, *states)
    landed = status_us < flight.airborne_us
    writer.add("vehicle_land_detected", "bool landed", status_us, landed)
    every = max(1, round(0.02e6 / float(np.median(np.diff(flight.t_us)))))
    t_us, q_nb = flight.t_us[::every], flight.q_nb[::every]
    writer.add("vehicle_attitude_groundtruth", "float[4] q", t_us, q_nb)
    if old:
        _add_old_topics(writer, flight, has_velocity)
        writer.add("vehicle_attitude", "float[4] q", t_us, q_nb)
        return writer.bytes()
    fields = "uint64_t timestamp_sample;float[4] q;uint8_t quat_reset_counter"
    writer.add("vehicle_attitude", fields, t_us + 3_000, t_us, q_nb, 0)
    for number, imu in enumerate(flight.imus):
        _add_vehicle_imu(writer, number, imu)
    _add_sensor_gps(writer, flight, has_velocity)
    return writer.bytes()


def _add_vehicle_imu(writer: ULogWriter, number: int, imu: ImuBatch) -> None:
    step_us = int(np.median(np.diff(imu.t_us)))
    fields = (
        "uint64_t timestamp_sample;float[3] delta_angle;float[3] delta_velocity;"
        "uint32_t delta_angle_dt;uint32_t delta_velocity_dt;uint8_t[4] _padding0"
    )
    turned, gained = imu.w_b * step_us * 1e-6, imu.f_b * step_us * 1e-6
    values = (imu.t_us, turned, gained, step_us, step_us)
    writer.add("vehicle_imu", fields, imu.t_us + 500, *values, number=number)
    every = max(1, round(0.066e6 / step_us))
    t_us, gauss = imu.t_us[::every], imu.m_b_ut[::every] * 0.01
    fields = "uint64_t timestamp_sample;float[3] magnetometer_ga"
    writer.add("vehicle_magnetometer", fields, t_us + 40_000, t_us, gauss, number=number)


def _add_sensor_gps(writer: ULogWriter, flight: MadeFlight, has_velocity: Any) -> None:
    fields = (
        "uint64_t timestamp_sample;uint64_t time_utc_usec;double latitude_deg;double longitude_deg;"
        "double altitude_msl_m;float s_variance_m_s;uint8_t fix_type;float vel_n_m_s;"
        "float vel_e_m_s;float vel_d_m_s;bool vel_ned_valid;uint8_t satellites_used"
    )
    unix_us = 1_780_000_000_000_000 + flight.fix_us
    values = (flight.fix_us, unix_us, *flight.place.T, 0.2, 3, *flight.v_n.T, has_velocity, 15)
    writer.add("sensor_gps", fields, flight.fix_us + 100_000, *values)


def _add_old_topics(writer: ULogWriter, flight: MadeFlight, has_velocity: Any) -> None:
    imu = flight.imus[0]
    step_us = int(np.median(np.diff(imu.t_us)))
    fields = (
        "float[3] gyro_rad;float gyro_integral_dt;int32_t accelerometer_timestamp_relative;"
        "float[3] accelerometer_m_s2;float accelerometer_integral_dt;"
        "int32_t magnetometer_timestamp_relative;float[3] magnetometer_ga"
    )
    every = max(1, round(0.02e6 / step_us))
    number = np.arange(len(imu.t_us))
    # A field stays until the next one comes; before the first there is none.
    since = np.where(number < every, 2**31 - 1, -step_us * (number % every))
    gauss = imu.m_b_ut[number - number % every] * 0.01
    step_s = step_us * 1e-6
    values = (imu.w_b, step_s, 0, imu.f_b, step_s, since, gauss)
    writer.add("sensor_combined", fields, imu.t_us, *values)
    fields = (
        "uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;float s_variance_m_s;"
        "uint8_t fix_type;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;bool vel_ned_valid;"
        "uint8_t satellites_used"
    )
    latitude, longitude, altitude = flight.place.T
    where = (np.round(latitude * 1e7), np.round(longitude * 1e7), np.round(altitude * 1e3))
    unix_us = 1_500_000_000_000_000 + flight.fix_us
    values = (unix_us, *where, 0.2, 3, *flight.v_n.T, has_velocity, 15)
    writer.add("vehicle_gps_position", fields, flight.fix_us, *values)

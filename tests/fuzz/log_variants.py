"""Logs made of other logs, whose right review follows from the other's: no dice, any format.

A log may begin or end in flight, lack a message, hold the first of several sensors alone, or half
of the IMU's samples; it may pause, lose blocks, be of an unknown vehicle, know no place, or be
written as text; a link may be slow, and carry another component's streams.
"""

import re
import struct
from collections.abc import Callable, Iterable, Iterator
from itertools import count

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fuzz.worn_logs import FMT_LENGTH, Log, Row, log_of, sealed, text_of

GPS = r"GP[SAB]2?|GPSB|UBX\d|GRA\w|sensor_gps|vehicle_gps_position|GPS_RAW_INT|GPS2_RAW"
PLACES = (
    r"|POS|ORGN|HOME|CMD|TERR|NTUN|AHR2|vehicle_global_position|home_position"
    r"|GLOBAL_POSITION_INT|GPS_GLOBAL_ORIGIN|HOME_POSITION|AHRS[23]|TERRAIN_REPORT"
)
# What is left out, by the names of messages and topics.
GROUPS = {
    "gps": GPS,
    "compass": r"MAG\d?|COMPASS|sensor_mag|vehicle_magnetometer",
    "barometer": r"BARO?\d?|sensor_baro|vehicle_air_data|SCALED_PRESSURE\d?",
    "attitude": r"ATT|vehicle_attitude(_setpoint)?|ATTITUDE\w*",
    "outputs": r"RCOU|RCO2|MOTB?|actuator_\w+|SERVO_OUTPUT_RAW",
    "esc": r"ESC\w?|esc_\w+|ESC_\w+",
    "vibration": r"VIBE|VIBRATION|vehicle_imu_status",
    "estimator": r"XK\w+|NK\w+|EKF\d|AHR2|POS|estimator_\w+|vehicle_(local|global)_position"
    r"|EKF_STATUS_REPORT|AHRS\d?",
    "parameters": r"PARM|P|PARAM_VALUE",
    "mode": r"MODE|vehicle_status",
    "events": r"EV|ERR|ARM|vehicle_land_detected|failure_detector_status",
    "battery": r"CURR|BAT\d?|BCL|POWR|battery_status|system_power|SYS_STATUS|BATTERY_STATUS",
    "texts": r"MSG|L|STATUSTEXT",
    "control": r"CTUN|NTUN|PSC\w|PM|RATE|VFR_HUD",
    "place": GPS + PLACES,
    "sticks": r"RCIN|RCI2|input_rc|manual_control_setpoint|RC_CHANNELS\w*",
}
IMU = r"IMU\d?|sensor_(combined|accel|gyro)|vehicle_imu|RAW_IMU|SCALED_IMU\d?|HIGHRES_IMU"
FURTHER = r"(IMU|MAG)[23]|SCALED_IMU[23]"
# Written at the beginning of every log, whenever that is.
OF_EVERY_LOG = r"PARM|FMTU|UNIT|MULT|VER|P|I|Q|M|A|PARAM_VALUE|HEARTBEAT"
# Who it is and how it is set.
IDENTITY = r"MSG|STATUSTEXT|VER|PARM|PARAM_VALUE|[PQIM]"
BEGINS, ENDS, SHORT = 0.4, 0.6, 0.1
# A logger that pauses for a fifth of the rows, and one that loses each tenth block.
PAUSES, BLOCK, LOST = (0.4, 0.6), 40, 10
# One of so many frames, but for what is sent seldom.
SLOW, SLOWEST, SELDOM = 4, 25, r"HEARTBEAT|PARAM_VALUE|STATUSTEXT"
# Of a heartbeat's payload; events of ArduPilot; of a row ARM, behind its head and its time.
BASE_MODE = 6
ARMED, DISARMED = 10, 11
ARM_STATE = 11
# Another component: a gimbal, which moves by itself, among every so many rows.
OTHER, AMONG = 154, 20


class Names:
    """The message or topic, and the instance, of each row of a log."""

    def __init__(self, log: Log) -> None:
        self._names: dict[str, str] = {}
        self._instances: dict[str, int] = {}
        self._numbered: set[str] = set()
        if log.ending == ".ulg":
            subscribed = b"".join([log.head[16:], *(r.data for r in log.rows if r.kind == "A")])
            for number, instance, name in _topics(subscribed):
                self._names[number], self._instances[number] = name, instance
        elif log.ending == ".tlog":
            self._names = {str(key): one.msgname for key, one in mavlink.mavlink_map.items()}
        elif log.ending == ".bin":
            for place in range(0, len(log.head), FMT_LENGTH):
                name, letters, columns = struct.unpack_from("<4s16s64s", log.head, place + 5)
                if columns.startswith(b"TimeUS,I,") and letters.startswith(b"QB"):
                    self._numbered.add(name.rstrip(b"\0").decode())

    def fits(self, row: Row, pattern: str) -> bool:
        """Whether the name of its message is one of these."""
        return re.fullmatch(pattern, self._names.get(row.kind, row.kind)) is not None

    def instance(self, row: Row) -> int:
        """Of its sensor, from 0."""
        return row.data[11] if row.kind in self._numbered else self._instances.get(row.kind, 0)


def _topics(data: bytes) -> Iterator[tuple[str, int, str]]:
    place = 0
    while place + 3 <= len(data):
        size, kind = struct.unpack_from("<Hc", data, place)
        if kind == b"A":
            instance, number = struct.unpack_from("<BH", data, place + 3)
            yield str(number), instance, data[place + 6 : place + 3 + size].decode()
        place += 3 + size


def variants(log: Log) -> Iterator[tuple[str, Log]]:
    """Each variant that differs, by its name; `begins` and `ends` are cut."""
    names = Names(log)
    for name, kept in _kept(log, names):
        rows = list(kept)
        if rows != log.rows:
            yield name, log._replace(rows=rows)
    if log.ending == ".bin":
        yield "as_text", log_of("a.log", text_of(log.bytes()))


def _kept(log: Log, names: Names) -> Iterator[tuple[str, Iterable[Row]]]:
    rows = log.rows
    begin, end = round(BEGINS * len(rows)), round(ENDS * len(rows))
    yield "begins", [*_of_every_log(rows[:begin], names), *rows[begin:]]
    yield "ends", [*rows[:end], *_of_every_log(rows[end:], names)]
    yield "short", rows[: round(SHORT * len(rows))]
    first, after = (round(share * len(rows)) for share in PAUSES)
    yield "paused", [*rows[:first], *_of_every_log(rows[first:after], names), *rows[after:]]
    yield "lossy", (row for place, row in enumerate(rows) if place // BLOCK % LOST != LOST - 1)
    yield "unknown", (row for row in rows if not names.fits(row, IDENTITY))
    bare = f"{IMU}|{GROUPS['attitude']}|{OF_EVERY_LOG}"
    yield "bare", (row for row in rows if names.fits(row, bare))
    yield "fifth_rate", _one_of(5, rows, lambda row: names.fits(row, IMU), names)
    yield "half_rate", _one_of(2, rows, lambda row: names.fits(row, IMU), names)
    several = f"{IMU}|{GROUPS['compass']}"
    yield (
        "first_only",
        (
            row
            for row in rows
            if not names.fits(row, FURTHER)
            and not (names.fits(row, several) and names.instance(row))
        ),
    )
    yield "disarmed", (_disarmed(row, names) for row in rows)
    for group, pattern in GROUPS.items():
        yield f"no_{group}", (row for row in rows if not names.fits(row, pattern))
    if log.ending == ".tlog":
        for name, many in (("slow", SLOW), ("slowest", SLOWEST)):
            yield name, _one_of(many, rows, lambda row: not names.fits(row, SELDOM), names)
        yield "other_component", _with_other(rows)


def _of_every_log(rows: list[Row], names: Names) -> Iterator[Row]:
    return (row for row in rows if names.fits(row, OF_EVERY_LOG))


def _one_of(
    many: int, rows: list[Row], concerns: Callable[[Row], bool], names: Names
) -> Iterator[Row]:
    """The first of so many rows of each message and instance that it concerns; all others."""
    counts: dict[tuple[str, int], count[int]] = {}
    for row in rows:
        key = row.kind, names.instance(row)
        if not concerns(row) or next(counts.setdefault(key, count())) % many == 0:
            yield row


def _disarmed(row: Row, names: Names) -> Row:
    """The row, if it tells that the motors were armed, as if they were not; not of ULog."""
    data = bytearray(row.data)
    if names.fits(row, "HEARTBEAT"):
        payload = 18 if data[8] == mavlink.PROTOCOL_MARKER_V2 else 14
        data[payload + BASE_MODE] &= 0xFF ^ mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    elif names.fits(row, "EV") and row.data[-1] == ARMED:
        data[-1] = DISARMED
    elif names.fits(row, "ARM"):
        data[ARM_STATE] = 0
    return sealed(row._replace(data=bytes(data)))


def _with_other(rows: list[Row]) -> Iterator[Row]:
    link = mavlink.MAVLink(None, 1, OTHER)
    for number, row in enumerate(rows):
        yield row
        if number % AMONG:
            continue
        for message in (
            mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GIMBAL, 8, 0, 0, 4, 3),
            mavlink.MAVLink_attitude_message(number, 0.5, -0.7, 1.0, 0.1, 0.2, 0.3),
            mavlink.MAVLink_raw_imu_message(1000 * number, 100, 200, 300, 10, 20, 30, 0, 0, 0),
        ):
            yield row._replace(
                kind=str(message.get_msgId()), data=row.data[:8] + message.pack(link)
            )

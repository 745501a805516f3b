"""Recordings with a fault in them: telemetry as a new file, an autopilot's own log in memory."""

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from fastcrc import crc16
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.rows import from_euler, select_rows, to_euler
from h2nav.maths.units import DEG, EARTH_RADIUS_M
from h2nav.recordings.autopilot_log import AutopilotLog, Recorded
from h2nav.recordings.context import AttitudeTrack, CompassTrack, GpsTrack, ImuTrack
from h2nav.recordings.frame_tables import FrameTable, tables
from h2nav.recordings.imu_series import Readings
from h2nav.recordings.link_recording import Recording
from h2nav.recordings.telemetry import MESSAGE_IDS
from h2nav.sim.autopilot import AutopilotOptions, FakeAutopilot
from h2nav.sim.personalities import ARDUPILOT
from h2nav.sim.scenarios import scenario
from h2nav.wire.codec import Encoder
from h2nav.wire.dialect import LAYOUTS
from h2nav.wire.imu import MILLI_G, UT_PER_GAUSS, UT_PER_MGAUSS
from h2nav.wire.readers import READERS
from sweep.faults import Array, Attitude, Case, Fault, Fixes, Samples

MARKER_2, HEADER_BYTES, ID_AT = 0xFD, 10, slice(7, 10)
CARRIED = MESSAGE_IDS | READERS.keys()
ATTITUDE, FIX = mavlink.MAVLINK_MSG_ID_ATTITUDE, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT
HIGHRES = mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
OF_FIRST = (mavlink.MAVLINK_MSG_ID_RAW_IMU, mavlink.MAVLINK_MSG_ID_SCALED_IMU, HIGHRES)
OF_OTHERS = {mavlink.MAVLINK_MSG_ID_SCALED_IMU2, mavlink.MAVLINK_MSG_ID_SCALED_IMU3}
UNIX_NS = 1_795_000_000_000_000_000
# What a fake autopilot is asked for, Hz.
REQUESTED_HZ = {
    mavlink.MAVLINK_MSG_ID_RAW_IMU: 100.0,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU2: 100.0,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU3: 100.0,
    ATTITUDE: 50.0,
    FIX: 5.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 10.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 5.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 2.0,
}


def simulated_tlog(path: Path, name: str, imus: int, seconds: float, seed: int) -> None:
    """Writes a flight of the fake autopilot.

    Args:
        path: of the file.
        name: of the scenario.
        imus: on board.
        seconds: that it lasts.
        seed: of its sensors.
    """
    autopilot = FakeAutopilot(AutopilotOptions(scenario(name), ARDUPILOT, seed, imus=imus))
    encoders: dict[tuple[int, int], Encoder] = {}
    autopilot.advance(UNIX_NS)
    for message_id, rate_hz in REQUESTED_HZ.items():
        interval_ns = round(1e9 / rate_hz)
        if autopilot.streams.stream(message_id) is not None:
            autopilot.streams.set_interval(UNIX_NS, message_id, interval_ns)
    with path.open("wb") as out:
        for t_ns in range(UNIX_NS, UNIX_NS + round(seconds * 1e9), 10_000_000):
            for sent_ns, *sender, message in autopilot.advance(t_ns):
                encoder = encoders.setdefault((sender[0], sender[1]), Encoder(*sender))
                out.write(struct.pack(">Q", sent_ns // 1000) + encoder.encode(message))


# --- telemetry ----------------------------------------------------------------------------------


def write_tlog(
    recording: Recording, path: Path, fault: Fault | None, case: Case, *, only_first: bool
) -> None:
    """Writes a recording with a fault, without unused messages.

    Args:
        recording: telemetry of MAVLink 2.
        path: of the new file.
        fault: None = none.
        case: when and how large.
        only_first: without the IMUs behind the first one.
    """
    changed = {} if fault is None else _changed(recording, fault, case)
    left_out = OF_OTHERS if only_first else frozenset()
    with path.open("wb") as out:
        for t_ns, frame in recording.received():
            number = int.from_bytes(frame[ID_AT], "little") if frame[0] == MARKER_2 else frame[5]
            if number not in CARRIED or number in left_out:
                continue
            if number in changed:
                payload = next(changed[number])
                written = b"" if payload is None else _framed(frame, number, payload)
            else:
                written = frame
            if written:
                out.write(struct.pack(">Q", (t_ns + recording.unix_offset_ns) // 1000) + written)


def _framed(frame: bytes, number: int, payload: bytes) -> bytes:
    """The frame with another payload, of full length."""
    assert frame[0] == MARKER_2
    head = bytes((MARKER_2, len(payload))) + frame[2:HEADER_BYTES]
    extra = bytes([LAYOUTS[number].crc_extra])
    return head + payload + struct.pack("<H", crc16.mcrf4xx(head[1:] + payload + extra))


def _changed(recording: Recording, fault: Fault, case: Case) -> dict[int, Iterator[bytes | None]]:
    """Message id -> its payloads one after the other; None where one is lost."""
    start_ns = next(recording.received())[0]
    ids = {
        *(OF_FIRST if fault.imu or fault.lost or fault.late_s else ()),
        *((FIX,) if fault.fixes else ()),
        *((ATTITUDE,) if fault.attitude else ()),
    }
    found = {}
    for number, table in tables(recording, ids).items():
        if not len(table.t_ns):
            continue
        t_s = (table.t_ns - start_ns) * 1e-9
        if number == FIX:
            _change_fixes(table, t_s, fault, case)
        elif number == ATTITUDE:
            _change_attitude(table, t_s, fault, case)
        else:
            _change_samples(number, table, t_s, fault, case)
        lost = fault.lost(t_s, case) if number in OF_FIRST and fault.lost else t_s < 0.0
        size = LAYOUTS[number].size
        payloads = table.fields.tobytes()
        found[number] = iter(
            [None if gone else payloads[i * size : (i + 1) * size] for i, gone in enumerate(lost)]
        )
    return found


def _change_samples(number: int, table: FrameTable, t_s: Array, fault: Fault, case: Case) -> None:
    rows = table.fields["id"] == 0 if number == HIGHRES else np.ones(len(t_s), np.bool_)
    fields = table.fields
    units = (1.0, 1.0, UT_PER_GAUSS) if number == HIGHRES else (1e-3, MILLI_G, UT_PER_MGAUSS)
    if fault.imu is not None:
        old = [
            np.stack([fields[f"{axis}{sensor}"] * unit for axis in "xyz"], axis=1)
            for sensor, unit in zip(("gyro", "acc", "mag"), units, strict=True)
        ]
        new = fault.imu(Samples(t_s, *old), case)
        for sensor, unit, values in zip(("gyro", "acc", "mag"), units, new[1:], strict=True):
            for column, axis in enumerate("xyz"):
                name = f"{axis}{sensor}"
                fields[name][rows] = _stored(values[rows, column] / unit, fields[name].dtype)
    if fault.late_s is not None:
        stamp = "time_usec" if "time_usec" in (fields.dtype.names or ()) else "time_boot_ms"
        per_s = 1e6 if stamp == "time_usec" else 1e3
        late = np.round(fault.late_s(t_s, case) * per_s).astype(fields[stamp].dtype)
        fields[stamp] += late


def _stored(values: Array, kind: "np.dtype[Any]") -> NDArray[Any]:
    if kind.kind == "f":
        return values.astype(kind)
    ends = np.iinfo(kind)
    return np.clip(np.round(values), ends.min, ends.max).astype(kind)


def _change_fixes(table: FrameTable, t_s: Array, fault: Fault, case: Case) -> None:
    assert fault.fixes is not None
    fields = table.fields
    speed, course = fields["vel"] * 1e-2, np.radians(fields["cog"] * 1e-2)
    old = np.stack((speed * np.cos(course), speed * np.sin(course), 0.0 * speed), axis=1)
    new = fault.fixes(Fixes(t_s, old, np.zeros((len(t_s), 2))), case)
    rows = (new.v_n != old).any(axis=1)
    fields["vel"][rows] = _stored(np.hypot(*new.v_n[rows, :2].T) * 1e2, fields["vel"].dtype)
    angle = np.degrees(np.arctan2(new.v_n[rows, 1], new.v_n[rows, 0])) % 360.0
    fields["cog"][rows] = _stored(angle * 1e2, fields["cog"].dtype)
    latitude_deg, longitude_deg = _moved(fields["lat"] * 1e-7, new.p_n)
    fields["lat"] += _stored(latitude_deg * 1e7, fields["lat"].dtype)
    fields["lon"] += _stored(longitude_deg * 1e7, fields["lon"].dtype)


def _moved(latitude_deg: Array, p_n: Array) -> tuple[Array, Array]:
    """What a way on the ground adds to latitude and longitude, deg."""
    parallel_m = EARTH_RADIUS_M * np.cos(latitude_deg * DEG)
    return p_n[:, 0] / EARTH_RADIUS_M / DEG, p_n[:, 1] / parallel_m / DEG


def _change_attitude(table: FrameTable, t_s: Array, fault: Fault, case: Case) -> None:
    assert fault.attitude is not None
    names = ("roll", "pitch", "yaw")
    old = np.stack([table.fields[name].astype(np.float64) for name in names], axis=1)
    angles = fault.attitude(Attitude(t_s, old), case).angles
    for column, name in enumerate(names):
        table.fields[name] = (angles[:, column] + math.pi) % math.tau - math.pi


# --- logs of the autopilots -----------------------------------------------------------------------


class FaultyLog(AutopilotLog):
    """A log with a fault in it.

    Args:
        log: as it was recorded.
        fault: None = none.
        case: when and how large.
    """

    def __init__(self, log: AutopilotLog, fault: Fault | None, case: Case) -> None:
        self.kind = log.kind
        self._source, self._fault, self._case = log, fault, case
        super().__init__(log.path)

    def _read(self) -> Recorded:
        recorded, fault = self._source._recorded, self._fault
        if fault is None:
            return recorded
        context = recorded.context
        context = context._replace(
            imus=tuple(self._track(track) for track in context.imus),
            compasses=tuple(self._compass(track) for track in context.compasses),
            gps=tuple(
                self._receiver(track) if track.receiver == recorded.receiver else track
                for track in context.gps
            ),
            attitudes=tuple(
                self._attitude(track) if i == 0 else track
                for i, track in enumerate(context.attitudes)
            ),
        )
        return recorded._replace(
            context=context,
            readings=tuple(self._readings(each, recorded.start_us) for each in recorded.readings),
            flown=None if recorded.flown is None else self._attitude(recorded.flown),
        )

    def _track(self, track: ImuTrack) -> ImuTrack:
        if track.imu != 0:
            return track
        fault, case = self._fault, self._case
        if fault is not None and fault.imu is not None:
            new = fault.imu(Samples(track.t_s, track.w_b, track.f_b, track.m_b_ut), case)
            track = track._replace(w_b=new.w_b, f_b=new.f_b, m_b_ut=new.m_b_ut)
        if fault is not None and fault.lost is not None:
            kept = ~fault.lost(track.t_s, case)
            track = select_rows(track, kept)
        return track

    def _compass(self, track: CompassTrack) -> CompassTrack:
        if track.compass != 0 or self._fault is None or self._fault.imu is None:
            return track
        nothing = np.zeros_like(track.m_b_ut)
        new = self._fault.imu(Samples(track.t_s, nothing, nothing, track.m_b_ut), self._case)
        return track._replace(m_b_ut=new.m_b_ut)

    def _readings(self, readings: Readings, start_us: int) -> Readings:
        if readings.imu != 0:
            return readings
        fault, case = self._fault, self._case
        t_s = (readings.t_us - start_us) * 1e-6
        if fault is not None and fault.imu is not None:
            new = fault.imu(Samples(t_s, readings.w_b, readings.f_b, readings.m_b_ut), case)
            readings = readings._replace(w_b=new.w_b, f_b=new.f_b, m_b_ut=new.m_b_ut)
        if fault is not None and fault.lost is not None:
            kept = ~fault.lost(t_s, case)
            readings = select_rows(readings, kept)
        return readings

    def _receiver(self, track: GpsTrack) -> GpsTrack:
        if self._fault is None or self._fault.fixes is None:
            return track
        fixes = Fixes(track.t_s, track.v_n, np.zeros((len(track.t_s), 2)))
        new = self._fault.fixes(fixes, self._case)
        north, east = _moved(track.latitude_deg, new.p_n)
        return track._replace(
            v_n=new.v_n,
            latitude_deg=track.latitude_deg + north,
            longitude_deg=track.longitude_deg + east,
        )

    def _attitude(self, track: AttitudeTrack) -> AttitudeTrack:
        if self._fault is None or self._fault.attitude is None:
            return track
        angles = self._fault.attitude(Attitude(track.t_s, to_euler(track.q_nb)), self._case).angles
        return track._replace(q_nb=from_euler(angles))

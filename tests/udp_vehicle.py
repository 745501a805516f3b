"""A vehicle at the end of a UDP socket, in real time: what an autopilot sends, as it sends it.

It shares no code with the daemon. Samples lie on an exact grid of the vehicle's own clock and
leave when that clock says so, as long as the machine lets them.
"""

import math
import random
import select
import socket
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

BOOT_US = 60_000_000
LONGEST_WAIT_S = 0.02
SO_TIMESTAMPNS = 35  # Linux; Python does not name it
ANCILLARY_BYTES = 128
RECEIVE_BUFFER_BYTES = 1 << 22
# Sleeping longer than this, the vehicle skips what it should have sent.
LONGEST_LAG_S = 0.5
SIGNING_EPOCH_UNIX_S = 1_420_070_400  # 2015
SIGNING_STAMPS_PER_S = 100_000

Triple = tuple[float, float, float]


class Reading(NamedTuple):
    """What the sensors read, in the integers of RAW_IMU.

    Attributes:
        gyro_mrad_s: body rates.
        force_mg: specific force.
        field_mgauss: magnetic field.
    """

    gyro_mrad_s: Triple = (0.0, 0.0, 0.0)
    force_mg: Triple = (0.0, 0.0, -1000.0)
    field_mgauss: Triple = (224.0, 80.0, -528.0)


class Arrival(NamedTuple):
    """A message that came back.

    Attributes:
        unix_ns: when the kernel received it.
        message: as pymavlink decodes it.
    """

    unix_ns: int
    message: Any

    @property
    def name(self) -> str:
        return str(self.message.get_type())


def at_rest(_t_s: float) -> Reading:
    """Level and still."""
    return Reading()


def turning(t_s: float) -> Reading:
    """Rolls, pitches and yaws by some degrees, so that every axis of gyro and force moves."""
    waves = tuple(math.sin(rate_rad_s * t_s) for rate_rad_s in (5.0, 4.0, 3.0))
    x, y, z = waves
    return Reading((400.0 * x, 400.0 * y, 400.0 * z), (90.0 * y, -90.0 * x, -1000.0 + 20.0 * z))


class UdpVehicle:
    """Sends its streams and answers what a companion asks.

    Args:
        port: on the loopback, where the daemon listens.
        imu: RAW_IMU, SCALED_IMU2 or HIGHRES_IMU.
        autopilot: MAV_AUTOPILOT of its heartbeat.
        position_deg: latitude and longitude.

    Attributes:
        rates_hz: how often each message leaves; rows may be changed at any time.
        makers: the message of each stream from the vehicle's time in us; rows may be changed.
        sense: seconds since the start to what the sensors read.
        is_noisy: white noise comes on top of it.
        speaks_mavlink_1: instead of MAVLink 2.
        stamp_shift_us: added to the time stamp of every IMU message.
        also_accepts: messages whose request is accepted although they do not come.
        sent_unix_ns: when the sample of each `time_boot_ms` left.
        sent: IMU messages that left so far, and when (host monotonic, s).
        arrivals: what came back.
        asked: SET_MESSAGE_INTERVAL that came: (message id, interval in us).
    """

    def __init__(
        self,
        port: int,
        *,
        imu: str = "RAW_IMU",
        autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        position_deg: tuple[float, float] = (47.3977, 8.5456),
    ) -> None:
        self._to = ("127.0.0.1", port)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self.socket.setblocking(False)
        self.identity = (1, 1)
        self.vehicle_type = mavlink.MAV_TYPE_QUADROTOR
        self.rates_hz = {
            "HEARTBEAT": 1.0,
            imu: 100.0,
            "GPS_RAW_INT": 5.0,
            "SYSTEM_TIME": 1.0,
            "EXTENDED_SYS_STATE": 1.0,
            "VFR_HUD": 4.0,
        }
        self.sense: Callable[[float], Reading] = at_rest
        self.is_noisy = True
        self.speaks_mavlink_1 = False
        self.stamp_shift_us = 0
        self.also_accepts: set[str] = set()
        self.makers: dict[str, Callable[[int], Any]] = {
            "HEARTBEAT": lambda _t_us: heartbeat(self.vehicle_type, autopilot),
            "RAW_IMU": self._raw_imu,
            "SCALED_IMU2": self._scaled_imu2,
            "HIGHRES_IMU": self._highres_imu,
            "GPS_RAW_INT": self._gps_raw_int,
            "SYSTEM_TIME": _system_time,
            "EXTENDED_SYS_STATE": _on_ground,
            "VFR_HUD": _standing,
        }
        self.sent_unix_ns: dict[int, int] = {}
        self.sent: list[float] = []
        self.arrivals: list[Arrival] = []
        self.asked: list[tuple[int, float]] = []
        self._position_e7 = tuple(round(angle * 1e7) for angle in position_deg)
        self._noise = random.Random(1)
        self._wire = mavlink.MAVLink(None, *self.identity)
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._start_s = time.monotonic()
        self._due_s: dict[str, float] = {}

    # --- sending --------------------------------------------------------------------------------

    def send(self, message: Any, sender: tuple[int, int] | None = None) -> None:
        """Sends a message, as somebody else where `sender` (system, component) says so."""
        self.send_bytes(self.packed(message, sender))

    def packed(self, message: Any, sender: tuple[int, int] | None = None) -> bytes:
        """The frame of a message."""
        self._wire.srcSystem, self._wire.srcComponent = sender or self.identity
        frame = bytes(message.pack(self._wire, force_mavlink1=self.speaks_mavlink_1))
        self._wire.seq = (self._wire.seq + 1) % 256
        return frame

    def sign(self, key: bytes | None) -> None:
        """Signs from now on with a key of 32 bytes; with None no longer."""
        signing = self._wire.signing
        signing.sign_outgoing = key is not None
        signing.secret_key = key
        signing.link_id = 1
        signing.timestamp = round((time.time() - SIGNING_EPOCH_UNIX_S) * SIGNING_STAMPS_PER_S)

    def send_bytes(self, data: bytes) -> None:
        """Sends a datagram as it stands; nobody has to listen."""
        try:
            self.socket.sendto(data, self._to)
        except OSError:
            return

    def fly(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Sends and listens for so long, or until something is so; whether it came to be so."""
        end_s = time.monotonic() + seconds
        while (now_s := time.monotonic()) < end_s:
            self._send_what_is_due(now_s)
            due_s = min(self._due_s.values(), default=end_s)
            wait_s = min(due_s - time.monotonic(), LONGEST_WAIT_S, end_s - now_s)
            select.select([self.socket], [], [], max(wait_s, 0.0))
            self.listen()
            if until():
                return True
        return False

    def pause(self, seconds: float) -> None:
        """Is silent for so long, answers nothing either; what comes meanwhile is kept."""
        end_s = time.monotonic() + seconds
        while (left_s := end_s - time.monotonic()) > 0.0:
            select.select([self.socket], [], [], min(left_s, LONGEST_WAIT_S))
            self.listen(answers=False)
        self._due_s.clear()

    def _send_what_is_due(self, now_s: float) -> None:
        for name in self._due_s.keys() - self.rates_hz.keys():
            del self._due_s[name]
        for name, rate_hz in self.rates_hz.items():
            period_s = 1.0 / rate_hz
            due_s = self._due_s.get(name, now_s)
            if due_s < now_s - LONGEST_LAG_S:
                due_s = now_s
            while due_s <= now_s:
                self._send_stream(name, due_s)
                due_s += period_s
            self._due_s[name] = due_s

    def _send_stream(self, name: str, due_s: float) -> None:
        t_us = self.clock_us(due_s)
        is_imu = name.endswith("_IMU") or name.startswith("SCALED_IMU")
        if is_imu:
            t_us += self.stamp_shift_us
        message = self.makers[name](t_us)
        if is_imu:
            self.sent_unix_ns[t_us // 1000] = time.time_ns()
            self.sent.append(time.monotonic())
        self.send(message)

    def clock_us(self, now_s: float | None = None) -> int:
        """The vehicle's clock at a host monotonic time, now by default."""
        now_s = time.monotonic() if now_s is None else now_s
        return BOOT_US + round((now_s - self._start_s) * 1e6)

    # --- receiving ------------------------------------------------------------------------------

    def listen(self, answers: bool = True) -> None:
        """Takes what has come, and answers it."""
        while True:
            try:
                data, ancillary, _, _ = self.socket.recvmsg(2048, ANCILLARY_BYTES)
            except BlockingIOError:
                return
            except ConnectionRefusedError:
                continue
            unix_ns = _kernel_time_ns(ancillary)
            for message in self._parser.parse_buffer(bytearray(data)) or ():
                self.arrivals.append(Arrival(unix_ns, message))
                if answers:
                    self._answer(message)

    def messages(self, name: str) -> list[Any]:
        """What came of this name, oldest first."""
        return [arrival.message for arrival in self.arrivals if arrival.name == name]

    def ages_s(self, since_unix_ns: int = 0) -> list[float]:
        """How old each ATTITUDE was at its arrival, counted from the sending of its sample."""
        return [
            (arrival.unix_ns - self.sent_unix_ns[arrival.message.time_boot_ms]) * 1e-9
            for arrival in self.arrivals
            if arrival.name == "ATTITUDE"
            and arrival.unix_ns >= since_unix_ns
            and arrival.message.time_boot_ms in self.sent_unix_ns
        ]

    def close(self) -> None:
        self.socket.close()

    def _answer(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "TIMESYNC" and message.tc1 == 0:
            self.send(mavlink.MAVLink_timesync_message(self.clock_us() * 1000, message.ts1))
        elif kind == "COMMAND_LONG" and message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.asked.append((int(message.param1), message.param2))
            name = mavlink.mavlink_map[int(message.param1)].msgname
            known = name in self.rates_hz or name in self.also_accepts
            result = mavlink.MAV_RESULT_ACCEPTED if known else mavlink.MAV_RESULT_FAILED
            self.send(mavlink.MAVLink_command_ack_message(message.command, result))

    # --- the streams ----------------------------------------------------------------------------

    def _integers(self, t_us: int) -> tuple[int, ...]:
        reading = self.sense((t_us - BOOT_US) * 1e-6)
        rows = ((reading.force_mg, 3.0), (reading.gyro_mrad_s, 1.5), (reading.field_mgauss, 2.0))
        noise = self._noise.gauss if self.is_noisy else lambda mean, _sigma: mean
        return tuple(round(noise(value, sigma)) for values, sigma in rows for value in values)

    def _raw_imu(self, t_us: int) -> Any:
        return mavlink.MAVLink_raw_imu_message(t_us, *self._integers(t_us), 0, 2500)

    def _scaled_imu2(self, t_us: int) -> Any:
        return mavlink.MAVLink_scaled_imu2_message(t_us // 1000, *self._integers(t_us), 2500)

    def _highres_imu(self, t_us: int) -> Any:
        values = [value * 1e-3 for value in self._integers(t_us)]
        force = (value * 9.80665 for value in values[:3])
        return mavlink.MAVLink_highres_imu_message(
            t_us, *force, *values[3:], 1013.25, 0.0, 0.0, 25.0, 0xFFF
        )

    def _gps_raw_int(self, t_us: int) -> Any:
        return mavlink.MAVLink_gps_raw_int_message(
            t_us, 3, *self._position_e7, 500_000, 100, 100, 0, 0, 12, 0, 1000, 1000, 100, 0
        )


def heartbeat(
    vehicle_type: int = mavlink.MAV_TYPE_QUADROTOR,
    autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
) -> Any:
    """HEARTBEAT of a disarmed vehicle."""
    mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    state = mavlink.MAV_STATE_STANDBY
    return mavlink.MAVLink_heartbeat_message(vehicle_type, autopilot, mode, 0, state, 3)


def global_position(latitude_deg: float, longitude_deg: float) -> Any:
    """GLOBAL_POSITION_INT at rest."""
    position_e7 = (round(latitude_deg * 1e7), round(longitude_deg * 1e7))
    return mavlink.MAVLink_global_position_int_message(0, *position_e7, 500_000, 0, 0, 0, 0, 0)


def command(command_id: int, *parameters: float, target: tuple[int, int] = (1, 191)) -> Any:
    """COMMAND_LONG; missing parameters are zero."""
    filled = (*parameters, *(0.0,) * (7 - len(parameters)))
    return mavlink.MAVLink_command_long_message(*target, command_id, 0, *filled)


def _system_time(t_us: int) -> Any:
    return mavlink.MAVLink_system_time_message(time.time_ns() // 1000, t_us // 1000)


def _on_ground(_t_us: int) -> Any:
    return mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_ON_GROUND)


def _standing(_t_us: int) -> Any:
    return mavlink.MAVLink_vfr_hud_message(0.0, 0.0, 0, 0, 500.0, 0.0)


def _kernel_time_ns(ancillary: list[tuple[int, int, bytes]]) -> int:
    """The kernel's receive time, so that a late turn of ours is not taken for a late message."""
    for level, kind, data in ancillary:
        if (level, kind) == (socket.SOL_SOCKET, SO_TIMESTAMPNS):
            seconds = int.from_bytes(data[:8], "little")
            return seconds * 1_000_000_000 + int.from_bytes(data[8:16], "little")
    return time.time_ns()

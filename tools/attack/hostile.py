"""Messages of no good autopilot: they end the daemon, or bind it to the wrong one."""

import contextlib
import itertools
import socket

from bench import Row, Scene, scene
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from udp_vehicle import Reading, at_rest, command, global_position, heartbeat

ATTITUDE = float(mavlink.MAVLINK_MSG_ID_ATTITUDE)
NS_PER_US = 1000
YELLOWKNIFE_DEG = (62.454, -114.372)
MCMURDO_DEG = (-77.85, 166.667)
FORGED = (77, 1)


def three_packets() -> Row:
    """HEARTBEAT, SYSTEM_TIME in ns instead of us, a position."""
    with scene() as at:
        at.vehicle.rates_hz.pop("SYSTEM_TIME")
        at.vehicle.rates_hz.pop("GPS_RAW_INT")
        at.until_active()
        at.vehicle.send(mavlink.MAVLink_system_time_message(1_770_000_000_000_000 * NS_PER_US, 0))
        at.vehicle.send(global_position(47.4, 8.5))
        at.vehicle.fly(6.0)
        return at.row("D1", "SYSTEM_TIME in ns, then a position")


def tiny_rate() -> Row:
    """An interval that does not fit into its field, by the configuration."""
    with scene("output: {attitude_rate_hz: 0.0001}") as at:
        at.until_active()
        at.vehicle.send(command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, ATTITUDE))
        at.vehicle.fly(4.0)
        return _with_interval(at, "D8-rate", "GET_MESSAGE_INTERVAL of an output at 0.0001 Hz")


def tiny_parameter() -> Row:
    """The same by a parameter."""
    with scene("output: {allow_remote_changes: true}") as at:
        at.until_active()
        kind = mavlink.MAV_PARAM_TYPE_REAL32
        at.vehicle.send(mavlink.MAVLink_param_set_message(1, 191, b"H2_ATT_HZ", 1e-30, kind))
        at.vehicle.fly(0.5)
        at.vehicle.send(command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, ATTITUDE))
        at.vehicle.fly(4.0)
        return _with_interval(at, "D8-parameter", "PARAM_SET of a rate to 1e-30, then GET")


def long_interval() -> Row:
    """The same by a command."""
    with scene("output: {allow_remote_changes: true}") as at:
        at.until_active()
        at.vehicle.send(command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, ATTITUDE, 3e9))
        at.vehicle.fly(0.5)
        at.vehicle.send(command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, ATTITUDE))
        at.vehicle.fly(4.0)
        return _with_interval(at, "D8-interval", "SET_MESSAGE_INTERVAL 3e9 us, then GET")


def _with_interval(at: Scene, name: str, done: str) -> Row:
    row = at.row(name, done)
    told = [message.interval_us for message in at.vehicle.messages("MESSAGE_INTERVAL")]
    row.figures.append(f"MESSAGE_INTERVAL answered: {told}")
    return row


def far_north() -> Row:
    """A field that the integer form has no gains for, at 50 Hz."""
    return _fixed_at("D6-yellowknife", YELLOWKNIFE_DEG, 50.0)


def far_south() -> Row:
    """The same at 100 Hz."""
    return _fixed_at("D6-mcmurdo", MCMURDO_DEG, 100.0)


def _fixed_at(name: str, place_deg: tuple[float, float], rate_hz: float) -> Row:
    sections = (
        "filter: {name: constant_gain, arithmetic: fixed}\n"
        f"autopilot: {{imu_rate_hz: {rate_hz}}}\noutput: {{attitude_rate_hz: {rate_hz}}}"
    )
    with scene(sections, position_deg=place_deg) as at:
        at.vehicle.rates_hz["RAW_IMU"] = rate_hz
        gps_hz = at.vehicle.rates_hz.pop("GPS_RAW_INT")
        at.until_active()
        at.vehicle.fly(2.0)
        at.vehicle.rates_hz["GPS_RAW_INT"] = gps_hz
        at.vehicle.fly(6.0)
        row = at.row(name, f"constant_gain at {rate_hz:.0f} Hz, first fix at {place_deg}")
        row.figures.append(f"longest silence of ATTITUDE {longest_silence_s(at):.2f} s")
        return row


def longest_silence_s(at: Scene, since_unix_ns: int = 0) -> float:
    """Between two ATTITUDE in succession, the later of which came after a time."""
    times = [arrival.unix_ns for arrival in at.vehicle.arrivals if arrival.name == "ATTITUDE"]
    pairs = itertools.pairwise(times)
    return max((b - a for a, b in pairs if b >= since_unix_ns), default=0) * 1e-9


def forged_first() -> Row:
    """Somebody is heard first who is no autopilot."""
    with scene() as at:
        at.vehicle.send(heartbeat(), FORGED)
        at.vehicle.fly(0.5, lambda: False)
        start_s = at.vehicle.sent[0]
        at.vehicle.fly(20.0, lambda: _bound_s(at, "1/1") is not None)
        at.vehicle.fly(3.0)
        row = at.row("D5", "one heartbeat of system 77, then the autopilot 1/1")
        row.figures += _binding(at, "1/1", start_s)
        return row


def successor() -> Row:
    """The autopilot is silent for good and another one takes its place."""
    with scene() as at:
        at.until_active()
        at.vehicle.fly(4.0)
        at.vehicle.identity = (2, 1)
        start_s = at.vehicle.sent[-1]
        at.vehicle.fly(20.0, lambda: _bound_s(at, "2/1") is not None)
        at.vehicle.fly(3.0)
        row = at.row("successor", "1/1 falls silent, 2/1 speaks")
        row.figures += _binding(at, "2/1", start_s)
        return row


def _bound_s(at: Scene, identity: str) -> float | None:
    for t_s, event in at.daemon.events:
        if f" {identity}" in event.get("text", "") and event["text"].startswith("bound"):
            return t_s
        if event.get("autopilot") == identity:
            return t_s
    return None


def _binding(at: Scene, identity: str, start_s: float) -> list[str]:
    bound_s = _bound_s(at, identity)
    active_s = at.daemon.state_since("active", start_s)
    return [
        f"bound to {identity} after {bound_s - start_s:.1f} s"
        if bound_s
        else f"never bound to {identity}",
        f"active after {active_s - start_s:.1f} s" if active_s else "not active again",
    ]


def twins() -> Row:
    """Two senders under one identity, with two clocks."""
    with scene() as at:
        at.until_active()
        at.vehicle.fly(3.0)
        own = at.vehicle.makers["RAW_IMU"]
        at.vehicle.makers["TWIN"] = lambda t_us: own(t_us + 1_000_000_000)
        at.vehicle.rates_hz["TWIN"] = 100.0
        at.vehicle.fly(10.0)
        row = at.row("twins", "RAW_IMU of two clocks under one identity")
        row.figures += [text for _, text in at.daemon.notices()][-5:]
        return row


def squatter() -> Row:
    """Another UDP port speaks while the vehicle is silent."""
    with (
        scene() as at,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
    ):
        other.setblocking(False)
        at.until_active()
        at.vehicle.fly(3.0)
        at.vehicle.pause(1.8)
        for _ in range(3):
            other.sendto(b"x", ("127.0.0.1", at.port))
            at.vehicle.pause(1.0)
        back = len(at.vehicle.sent)
        back_arrivals = len(at.vehicle.arrivals)
        for _ in range(8):
            other.sendto(b"x", ("127.0.0.1", at.port))
            at.vehicle.fly(1.0)
        caught = 0
        with contextlib.suppress(BlockingIOError):
            while other.recv(2048):
                caught += 1
        row = at.row("D7", "1.8 s of silence, then one byte/s from another port; vehicle is back")
    answered = at.vehicle.arrivals[back_arrivals:]
    row.figures += [
        f"squatter received {caught} datagrams",
        f"vehicle sent {len(at.vehicle.sent) - back} samples after its return and received "
        f"{sum(arrival.name == 'ATTITUDE' for arrival in answered)} ATTITUDE",
    ]
    return row


def wrong_units() -> Row:
    """Four seconds of an accelerometer in other units, then right ones."""
    with scene() as at:
        at.vehicle.sense = lambda _t_s: Reading(force_mg=(0.0, 0.0, -10_000.0))
        at.vehicle.fly(4.0)
        at.vehicle.sense = at_rest
        start_s = at.vehicle.sent[-1]
        at.vehicle.fly(18.0)
        row = at.row("D11-units", "4 s of an accelerometer ten times too large, then 18 s as it is")
        active_s = at.daemon.state_since("active", start_s)
        row.figures.append(f"active after {active_s - start_s:.1f} s" if active_s else "not active")
        return row


ROWS = {
    "D1": three_packets,
    "D8-rate": tiny_rate,
    "D8-parameter": tiny_parameter,
    "D8-interval": long_interval,
    "D6-yellowknife": far_north,
    "D6-mcmurdo": far_south,
    "D5": forged_first,
    "successor": successor,
    "twins": twins,
    "D7": squatter,
    "D11-units": wrong_units,
}

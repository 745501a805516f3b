"""What a link carries in both directions: questions, clocks, rates of streams, independence."""

import tempfile
from pathlib import Path

from bench import Row, scene
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from udp_vehicle import UdpVehicle, command, heartbeat

STATION = (255, 190)
KEY = bytes(range(32))
BROADCAST = ((1, 0), (0, 0))
OTHERS_RATES_HZ = {"VFR_HUD": 10.0, "EXTENDED_SYS_STATE": 5.0, "GPS_RAW_INT": 10.0}


def broadcast() -> Row:
    """What QGroundControl asks of every component."""
    with scene() as at:
        at.until_active()
        version = float(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        for target in BROADCAST:
            at.vehicle.send(mavlink.MAVLink_param_request_list_message(*target), STATION)
            request = command(mavlink.MAV_CMD_REQUEST_MESSAGE, version, target=target)
            at.vehicle.send(request, STATION)
        at.vehicle.fly(3.0)
        row = at.row(
            "broadcast", "PARAM_REQUEST_LIST and REQUEST_MESSAGE to components 1/0 and 0/0"
        )
        for name in ("PARAM_VALUE", "AUTOPILOT_VERSION", "COMMAND_ACK"):
            row.figures.append(f"{len(at.vehicle.messages(name))} {name} answered")
        return row


def clock_question() -> Row:
    """TIMESYNC asked by the autopilot and by a ground station."""
    with scene() as at:
        at.until_active()
        at.vehicle.fly(4.0)
        row = Row("timesync", "TIMESYNC asked by the autopilot and by a ground station")
        for asker in (at.vehicle.identity, STATION):
            stamp = 1_000 + asker[0]
            now_us = at.vehicle.clock_us()
            at.vehicle.send(mavlink.MAVLink_timesync_message(0, stamp), asker)
            at.vehicle.fly(1.0)
            answers = [m for m in at.vehicle.messages("TIMESYNC") if m.ts1 == stamp and m.tc1]
            off = [f"{m.tc1 * 1e-9 - now_us * 1e-6:+.3f} s" for m in answers]
            row.figures.append(
                f"{asker[0]}/{asker[1]}: {len(answers)} answers, off the autopilot's clock by {off}"
            )
        told = at.row(row.name, row.done)
        told.figures = row.figures
        return told


def lowered_streams() -> Row:
    """Streams that others have set higher than h2nav needs them."""
    with scene() as at:
        at.vehicle.rates_hz.update(OTHERS_RATES_HZ)
        at.vehicle.fly(12.0)
        row = at.row("lowered", "streams that come faster than h2nav needs them")
        for message_id, interval_us in at.vehicle.asked:
            name = mavlink.mavlink_map[message_id].msgname
            present_hz = at.vehicle.rates_hz.get(name)
            if present_hz and 1e6 / interval_us < present_hz:
                row.figures.append(f"{name}: {present_hz:.0f} -> {1e6 / interval_us:.0f} Hz asked")
        row.figures.append(f"{len(at.vehicle.asked)} requests in all")
        return row


def px4_bias() -> Row:
    """PX4's HIGHRES_IMU has its estimator's bias taken away already."""
    with scene(imu="HIGHRES_IMU", autopilot=mavlink.MAV_AUTOPILOT_PX4) as at:
        at.vehicle.fly(12.0)
        row = at.row("px4-bias", "PX4 that sends HIGHRES_IMU alone")
        last = at.daemon.statuses[-1][1]
        row.figures.append(f"in use {last['imu_message']}, independent: {last['independent']}")
        return row


def without_the_key() -> Row:
    """A signed link, and somebody on it who has not the key."""
    with tempfile.TemporaryDirectory() as folder:
        key_file = Path(folder) / "key"
        key_file.touch(mode=0o600)
        key_file.write_text(KEY.hex())
        sections = f"signing: {{key_file: {key_file}, state_file: {folder}/stamp}}"
        with scene(sections) as at:
            at.vehicle.sign(KEY)
            at.until_active()
            at.vehicle.fly(2.0)
            thief = UdpVehicle(at.port)
            thief_frames = _frames_without_the_key(thief)
            thief.close()
            recorded = at.vehicle.packed(heartbeat())
            at.vehicle.send_bytes(recorded)
            for _ in range(100):
                at.vehicle.fly(0.1)
                for frame in (*thief_frames, recorded):
                    at.vehicle.send_bytes(frame)
            row = at.row("signing", "signed link; forged, unsigned, MAVLink 1 and repeated frames")
            row.figures += [f"told: {text}" for _, text in at.daemon.notices()][-6:]
            signed = [arrival.message.get_msgbuf()[2] & 1 for arrival in at.vehicle.arrivals]
            row.figures.append(f"{sum(signed)} of {len(signed)} of our frames are signed")
    return row


def _frames_without_the_key(thief: UdpVehicle) -> list[bytes]:
    """The vehicle's own ids: unsigned, with a key of another, in MAVLink 1."""
    unsigned = thief.packed(heartbeat(mavlink.MAV_TYPE_FIXED_WING))
    thief.sign(bytes(32))
    forged = thief.packed(heartbeat(mavlink.MAV_TYPE_FIXED_WING))
    thief.sign(None)
    thief.speaks_mavlink_1 = True
    return [unsigned, forged, thief.packed(heartbeat(mavlink.MAV_TYPE_FIXED_WING))]


ROWS = {
    "broadcast": broadcast,
    "timesync": clock_question,
    "lowered": lowered_streams,
    "px4-bias": px4_bias,
    "signing": without_the_key,
}

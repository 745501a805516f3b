"""A message that is read"""

CHANGES = {
    "h2nav/wire/vehicle.py": (
        (
            "def heartbeat(m: Any)",
            '''\
class Pressure(NamedTuple):
    """SCALED_PRESSURE."""

    air_hpa: float


def pressure(m: Any) -> Pressure:
    """SCALED_PRESSURE."""
    return Pressure(m.press_abs)


def heartbeat(m: Any)''',
        ),
    ),
    "h2nav/wire/readers.py": (
        (
            "    mavlink.MAVLINK_MSG_ID_VIBRATION: vehicle.vibration,\n",
            """\
    mavlink.MAVLINK_MSG_ID_VIBRATION: vehicle.vibration,
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: vehicle.pressure,
""",
        ),
    ),
    "h2nav/service/service.py": (
        (
            """\
    ParameterValue,
    StatusText,
""",
            """\
    ParameterValue,
    Pressure,
    StatusText,
""",
        ),
        (
            "            case Vibration():\n",
            """\
            case Pressure():
                text = f'{message.air_hpa:.0f} hPa'
                return self._notices.report(t_ns, Severity.INFO, text, 'made')
            case Vibration():
""",
        ),
    ),
    "h2nav/service/wanted.py": (
        (
            "    optional += comparing.wanted_streams(",
            """\
    made = mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE
    optional.append(WantedStream(made, 2.0, is_optional=True))
    optional += comparing.wanted_streams(""",
        ),
    ),
}

if __name__ == "__main__":
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    from h2nav.apps.configuration import Configuration
    from h2nav.apps.filters import FilterFactory
    from h2nav.apps.pipeline import deliver
    from h2nav.files.earth_field import earth_field_at
    from h2nav.service.autopilot import Identity
    from h2nav.service.service import Service, Surroundings
    from h2nav.service.wanted import streams_wanted
    from h2nav.wire.codec import Encoder
    from h2nav.wire.deframer import Deframer

    chosen = Configuration()
    filters = FilterFactory.shipped(chosen.filter, chosen.autopilot.imu_rate_hz)
    service = Service(chosen.service, Surroundings(filters.filter_for, earth_field_at, 1.79e9))
    pilot, kind = Encoder(1, 1), (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_QUADROTOR)
    beat = pilot.encode(mavlink.MAVLink_heartbeat_message(*kind[::-1], 0, 0, 4, 3))
    air = pilot.encode(mavlink.MAVLink_scaled_pressure_message(1000, 1013.0, 0.0, 2500))
    (beat,), (air,) = Deframer().feed(beat), Deframer().feed(air)
    for second in range(5):
        deliver(service, beat, second * 10**9, second * 10**9)
    told = deliver(service, air, 5 * 10**9, 5 * 10**9)
    assert [one.text for one in told if hasattr(one, "text")] == ["1013 hPa"], told
    asked = streams_wanted(chosen.service, Identity(1, 1, *kind), ())
    assert any(one.message_id == air.msg_id for one in asked)

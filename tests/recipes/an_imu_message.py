"""An IMU message"""

CHANGES = {
    "h2nav/wire/imu.py": (
        (
            '        ImuMessage("recorded IMU", RECORDED_IMU, 1, None),\n',
            """\
        ImuMessage("recorded IMU", RECORDED_IMU, 1, None),
        ImuMessage("HIL_SENSOR", mavlink.MAVLINK_MSG_ID_HIL_SENSOR, 1, _highres_imu),
""",
        ),
    ),
    "h2nav/service/imu_choice.py": (
        (
            '_PREFERENCE_OTHERS = ("HIGHRES_IMU", "RAW_IMU",',
            '_PREFERENCE_OTHERS = ("HIGHRES_IMU", "RAW_IMU", "HIL_SENSOR",',
        ),
    ),
}

if __name__ == "__main__":
    import math

    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    from h2nav.apps.configuration import Configuration
    from h2nav.apps.filters import FilterFactory
    from h2nav.apps.pipeline import deliver
    from h2nav.files.earth_field import earth_field_at
    from h2nav.service.service import Service, Surroundings
    from h2nav.wire.codec import Encoder
    from h2nav.wire.deframer import Deframer

    chosen = Configuration()
    filters = FilterFactory.shipped(chosen.filter, chosen.autopilot.imu_rate_hz)
    service = Service(chosen.service, Surroundings(filters.filter_for, earth_field_at, 1.79e9))
    pilot = Encoder(1, 1)
    copter = (mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    for t_ms in range(1000, 9000, 10):
        x, y, z = (math.sin(k * t_ms) for k in (1.0, 2.0, 3.0))
        motion = (0.1 * x, 0.1 * y, 0.1 * z - 9.8, 0.01 * x, 0.01 * y, 0.01 * z)
        rest = (0.2, 0.0, 0.4, 0, 0, 0, 20, 0x1FFF, 0)
        sent = [mavlink.MAVLink_hil_sensor_message(t_ms * 1000, *motion, *rest)]
        if t_ms % 1000 == 0:
            sent.insert(0, mavlink.MAVLink_heartbeat_message(*copter, 0, 0, 4, 3))
        for frame in Deframer().feed(b"".join(map(pilot.encode, sent))):
            deliver(service, frame, t_ms * 10**6, t_ms * 10**6)
    assert service.health.imu_message == "HIL_SENSOR"
    assert service.health.samples_used > 500

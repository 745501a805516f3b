import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.wire.dialect import LAYOUTS, MISSING_EXTENSIONS

# Payload sizes without extensions, from the message definitions (common.xml, ardupilotmega.xml).
BASE_SIZES = {
    "HEARTBEAT": 9,
    "RAW_IMU": 26,
    "SCALED_IMU": 22,
    "HIGHRES_IMU": 62,
    "GPS_RAW_INT": 30,
    "COMMAND_ACK": 3,
    "STATUSTEXT": 51,
    "TIMESYNC": 16,
    "ATTITUDE": 28,
    "ATTITUDE_QUATERNION": 32,
    "ODOMETRY": 230,
}


def test_sizes_are_those_of_the_dialect() -> None:
    assert mavlink.mavlink_map.keys() <= LAYOUTS.keys()
    for msg_id, message in mavlink.mavlink_map.items():
        layout = LAYOUTS[msg_id]
        added = MISSING_EXTENSIONS.get(layout.name, ())
        assert layout.size == message.unpacker.size + sum(field.size for field in added)
        assert 0 < layout.base_size <= layout.size <= 255
        assert layout.field_names == (*message.fieldnames, *(field.name for field in added))


@pytest.mark.parametrize(("name", "size"), BASE_SIZES.items())
def test_base_sizes_leave_the_extensions_out(name: str, size: int) -> None:
    (layout,) = (layout for layout in LAYOUTS.values() if layout.name == name)
    assert layout.base_size == size


def test_messages_that_may_hold_whole_frames() -> None:
    carriers = {layout.name for layout in LAYOUTS.values() if layout.carries_bytes}
    assert {"FILE_TRANSFER_PROTOCOL", "TUNNEL", "SERIAL_CONTROL", "LOG_DATA"} <= carriers
    assert {"GPS_RTCM_DATA", "REMOTE_LOG_DATA_BLOCK", "ENCAPSULATED_DATA"} <= carriers
    streams = {"HEARTBEAT", "RAW_IMU", "HIGHRES_IMU", "ATTITUDE", "STATUSTEXT", "PARAM_VALUE"}
    assert not streams & carriers

"""A live channel that may carry a single record"""

CHANGES = {
    "h2nav/live/foxglove_server.py": (
        (
            '    "/imu": records.ImuRecord,\n',
            '    "/imu": records.ImuRecord,\n    "/lanes": records.LaneRecord,\n',
        ),
    ),
}

if __name__ == "__main__":
    from h2nav.live.foxglove_server import FoxgloveServer

    server = FoxgloveServer({})
    try:
        assert any(topic == "/lanes" for topic, _ in server._formats)
    finally:
        server.close()

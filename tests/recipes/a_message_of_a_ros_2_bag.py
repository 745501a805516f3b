"""A message of a ROS 2 bag"""

CHANGES = {
    "h2nav/log/ros_messages.py": (
        (
            '    "sensor_msgs/Imu": (\n',
            """\
    "geometry_msgs/Vector3Stamped": "std_msgs/Header header\\ngeometry_msgs/Vector3 vector",
    "sensor_msgs/Imu": (
""",
        ),
    ),
    "h2nav/log/rosbag2_export.py": (
        (
            '    "/tf": "tf2_msgs/TFMessage",\n',
            '    "/tf": "tf2_msgs/TFMessage",\n    "/made": "geometry_msgs/Vector3Stamped",\n',
        ),
        (
            '        self._bag.write("/tf", times,',
            """\
        bias = flu_from_frd(_vector(fields, "bias_?_rad_s"))
        self._bag.write("/made", times, (*times.head(BASE), *bias))
        self._bag.write("/tf", times,""",
        ),
    ),
}

if __name__ == "__main__":
    import tempfile
    from pathlib import Path

    from live_records import UNIX_NS, estimate

    from h2nav.log.file import LogFile
    from h2nav.log.rosbag2_export import export_rosbag2

    with tempfile.TemporaryDirectory() as place:
        log = LogFile(Path(place) / "log.mcap")
        log.add_record("/estimate", estimate(), UNIX_NS, UNIX_NS)
        found = export_rosbag2(log.close(), Path(place) / "bag")
        assert found.messages["/made"] == 1

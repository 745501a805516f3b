"""What users may choose: just enough and just too little of each limit."""

import pytest

from h2nav.apps import configuration
from h2nav.errors import BadInput
from h2nav.service.settings import MotionSettings

RATES = (
    "attitude_rate_hz",
    "attitude_quaternion_rate_hz",
    "attitude_covariance_rate_hz",
    "estimator_status_rate_hz",
    "difference_rate_hz",
)


def complaint(section, key, value):
    """What is said of a value; empty if it may be chosen."""
    try:
        configuration.build({section: {key: value}}, "h2nav.yaml")
    except BadInput as refused:
        (line,) = refused.lines
        return line
    return ""


@pytest.mark.parametrize(
    ("section", "key", "low", "high", "step"),
    [
        ("autopilot", "system_id", 0, 255, 1),
        ("autopilot", "component_id", 0, 255, 1),
        ("autopilot", "imu_rate_hz", 5.0, 1000.0, 0.1),
        ("autopilot", "compare_rate_hz", 0.0, 10.0, 0.1),
        ("autopilot", "gyro_delay_s", 0.0, 0.2, 0.001),
        ("autopilot", "field_delay_s", 0.0, 0.2, 0.001),
        ("output", "component_id", 1, 255, 1),
        *(("output", rate, 0.0, 1000.0, 0.1) for rate in RATES),
        ("north", "declination_deg", -180.0, 180.0, 0.1),
        ("motion", "pose_component_id", 0, 255, 1),
        ("motion", "odometry_rate_hz", 0.0, 1000.0, 0.1),
    ],
)
def test_a_number_has_limits_that_may_be_chosen(section, key, low, high, step):
    assert "expected" not in complaint(section, key, low)
    assert "expected" not in complaint(section, key, high)
    for value in (low - step, high + step):
        line = complaint(section, key, value)
        assert line.startswith(f"h2nav.yaml: {section}.{key}: expected ")
        assert f"a number from {low:g} to {high:g}" in line
        assert line.endswith(f"found {value!r}")


@pytest.mark.parametrize(
    ("section", "key", "words"),
    [
        ("autopilot", "lanes", ("auto", 1, 2, 3)),
        (
            "autopilot",
            "imu_message",
            ("auto", "HIGHRES_IMU", "RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3"),
        ),
        ("north", "declination", ("wmm", "fixed", "none")),
        ("motion", "estimator", ("none", "twist", "wheels")),
        (
            "motion",
            "pose_message",
            ("auto", "ODOMETRY", "VISION_POSITION_ESTIMATE", "ATT_POS_MOCAP"),
        ),
    ],
)
def test_a_choice_is_one_of_a_few(section, key, words):
    for word in words:
        assert "expected" not in complaint(section, key, word)
    said = f"h2nav.yaml: {section}.{key}: expected one of {', '.join(map(str, words))}, found "
    for word in ("Auto", *([0, 4] if 1 in words else [])):
        assert complaint(section, key, word) == f"{said}{word!r}"


@pytest.mark.parametrize("key", ["gyro_delay_s", "field_delay_s"])
def test_a_delay_may_follow_the_autopilot(key):
    assert complaint("autopilot", key, "auto") == ""
    assert "expected auto, or a number from 0 to 0.2" in complaint("autopilot", key, "none")


@pytest.mark.parametrize(("odometry_hz", "wheels_hz"), [(0.0, 20.0), (20.0, 20.0), (30.0, 30.0)])
def test_wheels_are_read_at_twenty_hertz_at_least(odometry_hz, wheels_hz):
    assert MotionSettings(odometry_rate_hz=odometry_hz).wheel_distance_rate_hz == wheels_hz


def test_every_default_may_be_written_down():
    defaults = configuration.Configuration()
    for section in ("autopilot", "output", "north", "aiding", "motion"):
        written = {section: defaults.as_mapping()[section]}
        assert configuration.build(written, "h2nav.yaml") == defaults

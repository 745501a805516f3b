"""What a configuration asks of its link, just enough and just too much; homes, ports and ids."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps import configuration
from h2nav.apps.configuration import (
    Configuration,
    FilterSettings,
    LiveSettings,
    build,
    contradictions,
    link_load,
    warnings,
)
from h2nav.apps.filters import FilterFactory, shipped_names
from h2nav.errors import BadInput
from h2nav.files import gain_files
from h2nav.service.autopilot import Identity

MAVLINK_2_BYTES = 12  # of a frame around its payload, without a signature
SILENT = {
    "attitude_rate_hz": 0, "attitude_quaternion_rate_hz": 0, "attitude_covariance_rate_hz": 0,
    "estimator_status_rate_hz": 0, "difference_rate_hz": 0,
}  # fmt: skip
SCALED = {"imu_message": "SCALED_IMU", "compare_rate_hz": 0}


def made(**sections):
    return build(sections, "file")


def complaints(**sections):
    with pytest.raises(BadInput) as caught:
        made(**sections)
    return caught.value.lines


@pytest.mark.parametrize(
    ("message", "size", "cut"),
    [
        # MAVLink 2 cuts zeros at the end: fields that are always zero are not sent.
        ("highres_imu", configuration.HIGHRES_IMU_FRAME_BYTES, 1),  # the id of the first
        ("raw_imu", configuration.IMU_FRAME_BYTES["RAW_IMU"], 0),
        ("scaled_imu", configuration.IMU_FRAME_BYTES["SCALED_IMU"], 0),
        ("scaled_imu2", configuration.IMU_FRAME_BYTES["SCALED_IMU2"], 0),
        ("scaled_imu3", configuration.IMU_FRAME_BYTES["SCALED_IMU3"], 0),
        ("attitude", configuration.ATTITUDE_FRAME_BYTES, 0),
        ("attitude_quaternion", configuration.ATTITUDE_QUATERNION_FRAME_BYTES, 16),  # an offset
        ("attitude_quaternion_cov", configuration.ATTITUDE_QUATERNION_COV_FRAME_BYTES, 0),
        ("estimator_status", configuration.ESTIMATOR_STATUS_FRAME_BYTES, 1),  # the high flags
        ("ahrs2", configuration.AHRS2_FRAME_BYTES, 0),
        ("odometry", configuration.ODOMETRY_FRAME_BYTES, 0),
        ("wheel_distance", configuration.WHEEL_DISTANCE_FRAME_BYTES, 0),
        ("named_value_float", configuration.DIFFERENCE_FRAMES_BYTES / 2, 0),
    ],
)
def test_sizes_of_frames_are_those_of_the_dialect(message, size, cut):
    payload = getattr(mavlink, f"MAVLink_{message}_message").unpacker.size
    assert size == MAVLINK_2_BYTES + payload - cut


@pytest.mark.parametrize(
    ("sections", "load"),
    [
        # 600 B/s of others, and of the autopilot's attitudes one whole and a half
        ({}, (74, 1180.0, 8580.0, 50 * 40 + 10 * 44 + 53)),
        ({"output": SILENT}, (74, 1180.0, 8580.0, 0.0)),
        ({"output": SILENT | {"attitude_rate_hz": 3}}, (74, 1180.0, 8580.0, 120.0)),
        ({"output": SILENT | {"attitude_quaternion_rate_hz": 3}}, (74, 1180.0, 8580.0, 132.0)),
        ({"output": SILENT | {"attitude_covariance_rate_hz": 3}}, (74, 1180.0, 8580.0, 252.0)),
        ({"output": SILENT | {"estimator_status_rate_hz": 3}}, (74, 1180.0, 8580.0, 159.0)),
        ({"output": SILENT | {"difference_rate_hz": 3}}, (74, 1180.0, 8580.0, 180.0)),
        ({"output": SILENT, "autopilot": {"compare_rate_hz": 0}}, (74, 600.0, 8000.0, 0.0)),
        ({"output": SILENT, "autopilot": {"imu_message": "RAW_IMU"}}, (41, 1180.0, 5280.0, 0.0)),
        ({"output": SILENT, "autopilot": SCALED | {"imu_rate_hz": 50}}, (36, 600.0, 2400.0, 0.0)),
        (
            {"output": SILENT, "motion": {"estimator": "twist", "odometry_rate_hz": 2}},
            (74, 1180.0, 8580.0, 490.0),
        ),
        (
            {"output": SILENT, "motion": {"estimator": "wheels", "odometry_rate_hz": 30}},
            (74, 1180.0 + 30 * 149, 8580.0 + 30 * 149, 30 * 245.0),
        ),
        ({"output": SILENT, "motion": {"odometry_rate_hz": 30}}, (74, 1180.0, 8580.0, 0.0)),
    ],
)
def test_the_load_is_the_sum_of_what_is_asked_for_and_of_what_is_sent(sections, load):
    assert link_load(made(**sections)) == pytest.approx(load)


@pytest.mark.parametrize(
    ("baud", "rate_hz", "said"),
    [
        (38_400, 90, None),  # 3840 B/s, all of it
        (38_400, 90.1, "90.1 Hz needs 3844 B/s, 38400 baud carries 3840; lower it to 90 or raise"),
        (7800, 5, None),
        (7800, 6, "6 Hz needs 816 B/s, 7800 baud carries 780; lower it to 5 or raise the"),
        (7790, 6, "6 Hz needs 816 B/s, 7790 baud carries 779; raise the baud rate in link.url"),
    ],
)
def test_a_serial_line_carries_a_tenth_of_its_baud_rate_in_bytes(baud, rate_hz, said):
    sections = {
        "link": {"url": f"serial:/dev/ttyS0:{baud}"},
        "autopilot": SCALED | {"imu_rate_hz": rate_hz},
        "output": SILENT,
    }
    if said is None:
        made(**sections)
        return
    (line,) = complaints(**sections)
    assert line.startswith(f"file: autopilot.imu_rate_hz: {said}")


@pytest.mark.parametrize("message", ["HIGHRES_IMU", "RAW_IMU", "SCALED_IMU"])
@pytest.mark.parametrize("baud", [19_200, 38_400, 57_600, 100_000])
def test_who_lowers_the_rate_as_is_told_is_not_refused_again(message, baud):
    def sections(rate_hz):
        return {
            "link": {"url": f"serial:/dev/ttyS0:{baud}"},
            "autopilot": {"imu_message": message, "imu_rate_hz": rate_hz},
            "output": SILENT,
        }

    (line,) = complaints(**sections(1000))
    told_hz = int(line.partition("lower it to ")[2].split()[0])
    made(**sections(told_hz))
    assert complaints(**sections(told_hz + 1))


@pytest.mark.parametrize(("rate_hz", "is_refused"), [(96, False), (97, True)])
def test_outputs_may_take_the_whole_line_and_no_more(rate_hz, is_refused):
    sections = {
        "link": {"url": "serial:/dev/ttyS0:38400"},
        "autopilot": SCALED | {"imu_rate_hz": 10},
        "output": SILENT | {"attitude_rate_hz": rate_hz},
    }
    if not is_refused:
        made(**sections)
        return
    assert complaints(**sections) == (
        "file: output.attitude_rate_hz: the outputs need 3880 B/s, 38400 baud carries 3840; lower "
        "their rates or raise the baud rate in link.url",
    )


@pytest.mark.parametrize(("rate_hz", "share"), [(24, None), (25, 51)])
def test_more_than_half_of_a_line_both_ways_is_warned_of(rate_hz, share):
    chosen = made(
        link={"url": "serial:/dev/ttyS0:38400"},
        autopilot=SCALED | {"imu_rate_hz": 10},
        output=SILENT | {"attitude_rate_hz": rate_hz},
    )
    found = warnings(chosen)
    assert len(found) == (share is not None)
    assert all(f"is {share} % of what 38400 baud carry" in line for line in found)


# --- ids, ports, paths ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("estimator", "pose_id", "is_refused"),
    [("twist", 191, True), ("twist", 190, False), ("wheels", 191, False), ("none", 191, False)],
)
def test_a_camera_that_is_ourselves_is_none(estimator, pose_id, is_refused):
    motion = {"estimator": estimator, "pose_component_id": pose_id}
    if not is_refused:
        made(motion=motion)
        return
    assert complaints(motion=motion) == (
        "file: motion.pose_component_id: 191 is our own component id; give that of the camera, or "
        "0 for the first one received",
    )


@pytest.mark.parametrize(
    ("address", "port", "said"),
    [
        ("127.0.0.1:8765", 8765, "live.foxglove_port: 8765 is also the port of live.address"),
        ("127.0.0.1:8764", 8765, None),
        ("127.0.0.1:0", 0, None),
        ("", 8765, None),
        ("8765", 8765, "live.address: '8765' is not HOST:PORT"),
    ],
)
def test_two_servers_need_two_ports(address, port, said):
    found = contradictions(Configuration(live=LiveSettings(address, port)))
    assert len(found) == (said is not None)
    assert all(line.startswith(said) for line in found)


@pytest.mark.parametrize(
    ("address", "is_warned"),
    [("127.0.0.1:1", False), ("localhost:1", False), ("0.0.0.0:1", True), ("", False)],
)
def test_a_page_that_others_can_reach_is_warned_of(address, is_warned):
    found = warnings(Configuration(live=LiveSettings(address)))
    assert [line.startswith(f"live.address: {address} shows") for line in found] == [
        True
    ] * is_warned


@pytest.mark.parametrize(
    ("fetches", "folder", "is_refused"),
    [(True, "", True), (True, "/logs", False), (False, "", False)],
)
def test_a_fetched_log_needs_a_folder(fetches, folder, is_refused):
    sections = {"flights": {"fetch_log": fetches}, "log": {"folder": folder}}
    if not is_refused:
        made(**sections)
        return
    (line,) = complaints(**sections)
    assert line == (
        "file: flights.fetch_log: there is no folder for it; set log.folder, or leave it out"
    )


def test_every_path_may_begin_with_the_home_folder_and_each_unknown_one_is_named(monkeypatch):
    monkeypatch.setenv("HOME", "/home/pilot")

    def sections(home):
        return {
            "log": {"folder": f"{home}/logs"},
            "filter": {"gains": f"{home}/gains.yaml"},
            "signing": {"key_file": f"{home}/key", "state_file": f"{home}/stamp"},
            "events": {"socket": f"{home}/events"},
            "flights": {"token_file": f"{home}/token"},
        }

    chosen = made(**sections("~"))
    expected = sections("/home/pilot")
    found = chosen.as_mapping()
    assert {name: {key: found[name][key] for key in keys} for name, keys in expected.items()} == (
        expected
    )
    lines = complaints(**sections("~nobody-of-that-name"))
    assert [line.split(": ")[1] for line in lines] == [
        "log.folder", "filter.gains", "signing.key_file", "signing.state_file", "events.socket",
        "flights.token_file",
    ]  # fmt: skip
    assert all(line.endswith(": no such home; write out the path") for line in lines)


def test_all_contradictions_are_listed_at_once():
    lines = complaints(
        link={"url": "nonsense"},
        output={"component_id": 1},
        filter={"name": "constant_gain"},
        signing={"key_file": "/key"},
        live={"address": "x"},
        events={"socket": "/" + "x" * 200},
        flights={"fetch_log": True},
    )
    assert [line.split(": ")[1] for line in lines] == [
        "link.url", "output.component_id", "filter.arithmetic", "signing.state_file",
        "live.address", "events.socket", "flights.fetch_log",
    ]  # fmt: skip


# --- the defaults that a flight is recorded and reviewed with ---------------------------------


def test_the_defaults_are_what_the_documents_promise():
    found = Configuration().as_mapping()
    assert found["link"] == {"url": "udpin:0.0.0.0:14550"}
    assert found["log"] == {
        "folder": "", "max_file_mb": 512, "max_file_minutes": 60, "max_files": 100,
        "max_run_mb": 0, "min_free_mb": 256, "decode_autopilot": False,
    }  # fmt: skip
    assert found["signing"] == {
        "key_file": "", "link_id": 0, "state_file": "",
        "accept_unsigned": ("RADIO_STATUS", "RADIO"),
    }  # fmt: skip
    assert found["live"] == {"address": "", "foxglove_port": 8765}
    assert found["flights"] == {
        "review": True, "review_memory_mb": 512, "review_minutes": 30, "review_priority": "idle",
        "fetch_log": False, "fetch_share": 0.5, "token_file": "", "upload_mb": 1024,
        "max_gb": 0.0, "max_days": 0,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("section", "key", "low", "high"),
    [
        ("log", "max_file_mb", 1, 100_000),
        ("log", "max_file_minutes", 1, 100_000),
        ("log", "max_files", 1, 100_000),
        ("log", "max_run_mb", 0, 100_000_000),
        ("log", "min_free_mb", 0, 1_000_000),
        ("signing", "link_id", 0, 255),
        ("live", "foxglove_port", 0, 65_535),
        ("flights", "review_memory_mb", 128, 65_536),
        ("flights", "review_minutes", 1, 1440),
        ("flights", "fetch_share", 0.01, 0.9),
        ("flights", "upload_mb", 0, 100_000),
        ("flights", "max_gb", 0.0, 1e6),
        ("flights", "max_days", 0, 36_500),
    ],
)
def test_numbers_of_the_daemon_have_their_limits(section, key, low, high):
    for value in (low, high):
        assert made(**{section: {key: value}}).as_mapping()[section][key] == value
    step = 0.001 if isinstance(low, float) else 1
    for value in (low - step, high + step):
        (line,) = complaints(**{section: {key: value}})
        assert f"{section}.{key}" in line


# --- which gain file ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "rate_hz", "expected"),
    [
        ({"vehicle_class": "rover"}, 100.0, {"rover": "rover_100hz"}),
        ({"vehicle_class": "rover"}, 51.0, {"rover": "rover_50hz"}),
        ({"vehicle_class": "rover", "gains": "mine"}, 100.0, {"rover": "mine"}),
        (
            {"name": "constant_gain", "arithmetic": "fixed", "vehicle_class": "rover"},
            100.0,
            {"rover": "mpu9250_100hz"},
        ),
        (
            {"name": "constant_gain", "sensor": "bmi088", "vehicle_class": "rover"},
            100.0,
            {"rover": "bmi088_100hz"},
        ),
    ],
)
def test_gains_are_of_class_or_sensor_and_the_nearest_rate(settings, rate_hz, expected):
    assert shipped_names(FilterSettings(**settings), rate_hz) == expected


def test_without_a_class_there_is_a_file_for_each():
    found = shipped_names(FilterSettings(), 100.0)
    assert found == {name: f"{name}_100hz" for name in configuration.VEHICLE_CLASSES}
    mine = shipped_names(FilterSettings(gains="mine"), 100.0)
    assert mine == dict.fromkeys(configuration.VEHICLE_CLASSES, "mine")


def test_a_file_is_read_once_for_check_and_flight_and_the_class_may_be_set():
    file, loaded = gain_files.load("multirotor_100hz"), []

    def load(name):
        loaded.append(name)
        return file

    names = {"multirotor": "a", "rover": "b", "handheld": "a"}
    factory = FilterFactory(FilterSettings(vehicle_class="rover"), names, load)
    factory.check()
    assert loaded == ["a", "b"]
    factory.filter_for(Identity(1, 1, 3, 2))
    assert loaded == ["a", "b"]
    assert list(factory.gain_texts()) == ["a", "b"]


def test_a_file_for_another_filter_is_refused_with_both_keys():
    factory = FilterFactory(FilterSettings(), {"rover": "mpu9250_100hz"}, gain_files.load)
    with pytest.raises(BadInput) as caught:
        factory.check()
    assert str(caught.value) == (
        "mpu9250_100hz: gains of kind two_stage, but filter.name default needs velocity_aided; "
        "choose another filter.gains or filter.name"
    )


def test_a_replay_uses_the_files_of_its_log_if_they_are_whole():
    settings = FilterSettings(vehicle_class="rover")
    text = gain_files.text_of(gain_files.load("rover_100hz")).encode()
    held = FilterFactory.recorded(settings, 100.0, {"rover_100hz": text})
    assert held.gain_texts() == {"rover_100hz": text.decode()}
    with pytest.raises(BadInput) as caught:
        FilterFactory.recorded(settings, 100.0, {}).check()
    assert str(caught.value) == (
        "rover_100hz: the log does not hold this gain file; replay with --config"
    )
    changed = {"rover_100hz": text.replace(b"rate_hz: 100", b"rate_hz: 101", 1)}
    with pytest.raises(BadInput, match="changed after they were certified"):
        FilterFactory.recorded(settings, 100.0, changed).gain_texts()

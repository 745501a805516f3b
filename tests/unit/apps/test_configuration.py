import re
import socket
from pathlib import Path

import pytest
from needs import REPOSITORY

from h2nav.apps import configuration
from h2nav.apps.configuration import Configuration, EventSettings
from h2nav.cli import main
from h2nav.errors import BadInput

# campaign.yaml is of `h2nav evaluate campaign`.
CONFIGS = sorted(
    path for path in (REPOSITORY / "configs").glob("*.yaml") if path.stem != "campaign"
)
QUOTED_DEFAULT = re.compile(r"`([a-z_]+)\.([a-z_]+)` \(([0-9.]+)\)")


def errors(text, tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text(text)
    with pytest.raises(BadInput) as caught:
        configuration.read(path)
    return caught.value.lines


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_every_shipped_configuration_is_valid(path):
    configuration.read(path)


def test_an_empty_file_means_the_defaults(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text("")
    assert configuration.read(path) == configuration.Configuration()


def test_defaults_that_documents_quote_are_the_defaults():
    defaults = configuration.Configuration().as_mapping()
    quoted = {
        (section, key): float(number)
        for path in (REPOSITORY / "docs").glob("*.md")
        for section, key, number in QUOTED_DEFAULT.findall(path.read_text())
        if section in defaults
    }
    sizes = {"max_file_mb", "max_file_minutes", "max_files", "min_free_mb"}
    assert {("log", key) for key in sizes} <= quoted.keys()
    assert quoted == {(section, key): defaults[section][key] for section, key in quoted}


def test_the_mapping_gives_the_configuration_back():
    chosen = configuration.read(REPOSITORY / "configs" / "sitl.yaml")
    assert configuration.build(chosen.as_mapping(), "again") == chosen


def test_an_imu_rate_beyond_the_baud_rate_names_the_rate_that_fits(tmp_path):
    text = "link: {url: 'serial:/dev/ttyAMA0:57600'}\nautopilot: {imu_rate_hz: 100}\n"
    (line,) = errors(text, tmp_path)
    assert "autopilot.imu_rate_hz" in line
    assert "lower it to 61" in line


def test_outputs_beyond_the_baud_rate_are_refused(tmp_path):
    text = (
        "link: {url: '/dev/ttyAMA0,57600'}\nautopilot: {imu_rate_hz: 50}\n"
        "output: {attitude_rate_hz: 200}\n"
    )
    (line,) = errors(text, tmp_path)
    assert "output.attitude_rate_hz" in line


def test_a_shorter_imu_message_may_come_more_often(tmp_path):
    text = (
        "link: {url: '/dev/ttyAMA0,57600'}\n"
        "autopilot: {imu_rate_hz: 200, imu_message: SCALED_IMU}\n"
    )
    (line,) = errors(text, tmp_path)
    assert "lower it to 127" in line


@pytest.mark.parametrize(("baud", "is_enough"), [(19_200, True), (9600, False)])
def test_a_rate_that_cannot_be_set_is_no_remedy(tmp_path, baud, is_enough):
    line, *_ = errors(f"link: {{url: 'serial:/dev/ttyAMA0:{baud}'}}\n", tmp_path)
    assert ("lower it to" in line) == is_enough
    assert "raise the baud rate in link.url" in line


@pytest.mark.parametrize(("length", "is_refused"), [(107, False), (108, True)])
def test_the_path_of_a_socket_has_a_longest_length(length, is_refused):
    """As the system binds it, so that no daemon is refused later what was called fine."""
    place = "/" + "x" * (length - 1)
    found = configuration.contradictions(Configuration(events=EventSettings(place)))
    assert [line.partition(":")[0] for line in found] == ["events.socket"] * is_refused
    said = "too long" if is_refused else "No such file"
    with socket.socket(socket.AF_UNIX) as end, pytest.raises(OSError, match=said):
        end.connect(place)


def test_a_path_with_a_zero_is_named_with_its_key(tmp_path):
    (line,) = errors('log: {folder: "/var/log\\0"}\n', tmp_path)
    assert "log.folder: '/var/log\\x00': no path" in line


def warned(**sections):
    return configuration.warnings(configuration.build(sections, "test"))


def test_more_than_half_of_a_serial_link_is_warned_of():
    slow = {"url": "serial:/dev/ttyUSB0:57600"}
    (line,) = warned(link=slow, autopilot={"imu_rate_hz": 50})
    assert "link.url" in line
    assert "telemetry-radio" in line
    assert warned(link={"url": "serial:/dev/ttyAMA0:921600"}) == []
    assert warned(link={"url": "udpin:0.0.0.0:14550"}) == []


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_no_shipped_configuration_is_warned_of(path):
    warned = configuration.warnings(configuration.read(path))
    # On BlueOS, whose users are told so there, the page is reached from other computers.
    of_live = [text for text in warned if text.startswith("live.address")]
    assert warned == (of_live if path.stem == "blueos" else [])


@pytest.mark.parametrize("url", ["carrier-pigeon:1", "udpin:nowhere", "serial:/dev/x", ""])
def test_a_bad_url_names_the_key_and_the_forms(tmp_path, url):
    (line,) = errors(f"link: {{url: '{url}'}}\n", tmp_path)
    assert "config.yaml: link.url" in line
    assert "udpin:HOST:PORT" in line


def test_a_misspelt_section_is_an_error(tmp_path):
    (line,) = errors("autopliot: {imu_rate_hz: 100}\n", tmp_path)
    assert "did you mean autopilot?" in line
    assert str(Path(tmp_path)) in line


@pytest.mark.parametrize(
    ("section", "key"),
    [
        ("{name: default, arithmetic: double}", "filter.arithmetic"),
        ("{gyro_sampling: instant}", "filter.gyro_sampling"),
        ("{arithmetic: fixed, gyro_sampling: instant}", "filter.gyro_sampling"),
        ("{name: two_stage}", "filter.name"),
    ],
)
def test_filters_that_do_not_exist_are_refused(tmp_path, section, key):
    (line,) = errors(f"filter: {section}\n", tmp_path)
    assert key in line


def test_signing_is_off_unless_a_key_is_named():
    assert configuration.Configuration().signing.key_file == ""


def test_a_key_needs_a_place_for_the_time_stamp(tmp_path):
    (line,) = errors("signing: {key_file: /etc/h2nav/key}\n", tmp_path)
    assert "signing.state_file" in line
    assert "/var/lib/h2nav" in line


def test_the_key_itself_is_not_read_so_that_a_replay_needs_none():
    signing = {"key_file": "/nowhere/key", "state_file": "/nowhere/stamp", "link_id": 7}
    chosen = configuration.build({"signing": signing}, "test")
    assert configuration.build(chosen.as_mapping(), "again") == chosen


@pytest.mark.parametrize(
    ("names", "says"),
    [
        ("[RADIO_STATS]", "signing.accept_unsigned: RADIO_STATS: no message"),
        ("[SETUP_SIGNING]", "SETUP_SIGNING is never obeyed"),
        ("RADIO_STATUS", "expected a list of texts"),
    ],
)
def test_the_list_of_unsigned_messages_is_checked(tmp_path, names, says):
    (line,) = errors(f"signing: {{accept_unsigned: {names}}}\n", tmp_path)
    assert says in line


def test_messages_without_a_signature_are_given_by_name():
    settings = configuration.SigningSettings(accept_unsigned=("HEARTBEAT", "RADIO_STATUS"))
    assert settings.unsigned_ids() == {0, 109}


def test_our_id_is_nobody_elses(tmp_path):
    (line,) = errors("output: {component_id: 1}\n", tmp_path)
    assert "output.component_id: 1 is the autopilot's" in line
    (line,) = errors("autopilot: {component_id: 50}\noutput: {component_id: 50}\n", tmp_path)
    assert "output.component_id: 50 is that of autopilot.component_id" in line


def test_the_home_folder_can_be_written_as_a_tilde(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", "/home/pilot")
    path = tmp_path / "config.yaml"
    path.write_text("log: {folder: ~/logs}\nfilter: {gains: ~/gains/mine.yaml}\n")
    chosen = configuration.read(path)
    assert chosen.log.folder == "/home/pilot/logs"
    assert chosen.filter.gains == "/home/pilot/gains/mine.yaml"


def test_an_unknown_home_is_named_with_its_key(tmp_path):
    (line,) = errors("log: {folder: ~nobody-of-that-name/logs}\n", tmp_path)
    assert "log.folder: ~nobody-of-that-name/logs: no such home" in line


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("filter: {gains: /nowhere/gains.yaml}", "filter.gains: /nowhere/gains.yaml: no such"),
        ("filter: {gains: mpu9250_100hz}", "gains of kind two_stage, but filter.name default"),
        ("filter: {gains: mpu6050_100hz}", "filter.gains: gain file mpu6050_100hz: not shipped"),
        ("link:\n  url: udpin:0.0.0.0:1\n  url: udpin:0.0.0.0:2", ":3: url occurs here and in"),
    ],
)
def test_check_config_refuses_what_the_daemon_would_refuse(tmp_path, capsys, text, says):
    path = tmp_path / "config.yaml"
    path.write_text(text)
    assert main(["check-config", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"h2nav: {path}:")
    assert says in line


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "empty: every default is in force, such as link.url udpin:"),
        ("# link: {url: udpin:0.0.0.0:14550}\n", "empty: "),
        ("link: {url: serial:/dev/absent:921600}", "link.url: /dev/absent: no such device now"),
    ],
)
def test_check_config_warns_of_what_is_unlikely_to_be_meant(tmp_path, capsys, text, says):
    path = tmp_path / "config.yaml"
    path.write_text(text)
    assert main(["check-config", str(path)]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"h2nav: {path}: {says}")


def test_a_gain_file_that_was_changed_is_refused_by_check_config(tmp_path, capsys):
    gains = tmp_path / "mine.yaml"
    shipped = (REPOSITORY / "gains" / "multirotor_100hz.yaml").read_text()
    gains.write_text(shipped.replace("rate_hz: 100", "rate_hz: 101", 1))
    path = tmp_path / "config.yaml"
    path.write_text(f"filter: {{gains: {gains}}}\n")
    assert main(["check-config", str(path)]) == 2
    assert "changed after they were certified" in capsys.readouterr().err

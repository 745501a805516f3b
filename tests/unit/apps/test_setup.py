"""From what was heard to a configuration that the daemon starts with."""

import json
import os
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps import check_config, configuration, setup
from h2nav.apps.setup import Choice, Flights, configuration_text
from h2nav.cli import BAD_INPUT, FAILED, SUCCESS, main
from h2nav.host.system_unit import unit_text
from h2nav.links import link_scan
from h2nav.links.link_scan import Hearing, LinkPlace, Speaker
from h2nav.wire.vehicle import Firmware, Heartbeat

ARDUPILOT = Heartbeat(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_QUADROTOR, False)
PX4 = Heartbeat(mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_TYPE_QUADROTOR, False)


def choice(url: str, heartbeat: Heartbeat = ARDUPILOT, system_id: int = 1) -> Choice:
    rates_hz = {mavlink.MAVLINK_MSG_ID_RAW_IMU: 50.0}
    speaker = Speaker((system_id, 1), heartbeat, Firmware("4.5.7", ""), rates_hz)
    hearing = Hearing(LinkPlace(url, (url,)), url, (speaker,), 100, 4000, "")
    return Choice(hearing, speaker)


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> list[Choice]:
    """What the scan finds."""
    choices: list[Choice] = []

    def found(places: list[LinkPlace], progress: object) -> list[Hearing]:
        empty = Hearing(
            LinkPlace("udpin:0.0.0.0:14550", ("udpin:0.0.0.0:14550",)), "", (), 0, 0, ""
        )
        return [each.hearing for each in choices] or [empty]

    monkeypatch.setattr(setup, "scan", found)
    return choices


@pytest.mark.parametrize(
    ("url", "heartbeat"),
    [
        ("serial:/dev/serial/by-id/usb-Cube:115200", ARDUPILOT),
        ("serial:/dev/ttyAMA0:921600", PX4),
        ("serial:/dev/ttyUSB0:57600", ARDUPILOT),
        ("udpin:0.0.0.0:14550", ARDUPILOT),
        ("udpin:0.0.0.0:14540", PX4),
    ],
)
def test_the_configuration_names_the_link_and_is_valid(
    url: str, heartbeat: Heartbeat, tmp_path: Path
) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(configuration_text(choice(url, heartbeat), False, Flights()))
    assert configuration.read(path).link.url == url


@pytest.mark.parametrize("heartbeat", [ARDUPILOT, PX4])
def test_one_of_several_autopilots_on_a_link_is_named_by_its_system(
    heartbeat: Heartbeat, tmp_path: Path
) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(
        configuration_text(choice("udpin:0.0.0.0:14550", heartbeat, 7), True, Flights())
    )
    assert configuration.read(path).autopilot.system_id == 7


def test_yes_writes_and_checks(heard: list[Choice], tmp_path: Path) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))
    path = tmp_path / "etc" / "config.yaml"
    assert main(["setup", "--yes", "-o", str(path), "--no-service"]) == SUCCESS
    assert configuration.read(path).link.url == "udpin:0.0.0.0:14550"


@pytest.mark.parametrize("is_service", [True, False])
def test_the_services_user_can_read_what_a_careful_root_writes(
    heard: list[Choice], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_service: bool
) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))
    path = tmp_path / "etc" / "config.yaml"
    monkeypatch.setattr(setup, "SERVICE_CONFIG", path if is_service else tmp_path)
    before = os.umask(0o077)
    try:
        assert main(["setup", "--yes", "-o", str(path), "--no-service"]) == SUCCESS
    finally:
        os.umask(before)
    modes = [place.stat().st_mode & 0o777 for place in (path.parent, path)]
    assert modes == ([0o755, 0o644] if is_service else [0o700, 0o600])


def test_a_file_that_is_there_stays(heard: list[Choice], tmp_path: Path) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))
    path = tmp_path / "config.yaml"
    path.write_text("mine")
    assert main(["setup", "--yes", "-o", str(path)]) == BAD_INPUT
    assert path.read_text() == "mine"
    assert main(["setup", "--yes", "--force", "-o", str(path), "--no-service"]) == SUCCESS
    assert configuration.read(path).link.url == "udpin:0.0.0.0:14550"


def test_an_unchanged_example_gives_way(heard: list[Choice], tmp_path: Path) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))
    path = tmp_path / "config.yaml"
    path.write_text(check_config.example("ardupilot-serial"))
    assert main(["setup", "--yes", "-o", str(path), "--no-service"]) == SUCCESS
    assert configuration.read(path).link.url == "udpin:0.0.0.0:14550"


def test_a_serial_line_comes_before_the_network(heard: list[Choice], tmp_path: Path) -> None:
    heard += [choice("udpin:0.0.0.0:14550"), choice("serial:/dev/ttyAMA0:921600")]
    path = tmp_path / "config.yaml"
    assert main(["setup", "--yes", "-o", str(path), "--no-service"]) == SUCCESS
    assert configuration.read(path).link.url == "serial:/dev/ttyAMA0:921600"


def test_several_autopilots_need_the_users_choice(
    heard: list[Choice], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heard += [choice("udpin:0.0.0.0:14550"), choice("serial:/dev/ttyAMA0:921600", PX4, 2)]
    assert main(["setup", "--yes", "-o", str(tmp_path / "config.yaml")]) == FAILED
    assert "several autopilots" in capsys.readouterr().err


def test_vehicles_of_different_kinds_are_several_though_all_say_system_1(
    heard: list[Choice], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heard += [choice("udpin:0.0.0.0:14550"), choice("serial:/dev/ttyAMA0:921600", PX4)]
    assert main(["setup", "--yes", "-o", str(tmp_path / "config.yaml")]) == FAILED
    assert "ArduPilot quadrotor 1/1 at udpin:0.0.0.0:14550" in capsys.readouterr().err


def test_nothing_heard_fails_with_a_remedy(
    heard: list[Choice], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["setup", "--yes", "--connect", "udpin:0.0.0.0:14550"]) == FAILED
    assert "SERIALn_PROTOCOL" in capsys.readouterr().err


def test_without_a_terminal_and_without_yes_nothing_is_written(
    heard: list[Choice], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))
    monkeypatch.chdir(tmp_path)
    assert main(["setup", "-o", "config.yaml"]) == SUCCESS
    assert not (tmp_path / "config.yaml").exists()


def test_bytes_without_frames_are_told_from_silence(
    heard: list[Choice], capsys: pytest.CaptureFixture[str]
) -> None:
    place = link_scan.serial_place("/dev/ttyAMA0")
    junk = Hearing(place, place.urls[-1], (), 0, 5000, "")
    heard.append(Choice(junk, choice("udpin:0.0.0.0:14550").speaker))
    assert main(["setup", "--connect", "/dev/ttyAMA0"]) == FAILED
    said = capsys.readouterr()
    assert "5000 bytes, but no MAVLink at 57600, 115200" in said.out
    assert "an unusual baud rate" in said.err


REPORT = """\
udpin:0.0.0.0:14550: MAVLink
    ArduPilot quadrotor 1/1, firmware 4.5.7
    streams: RAW_IMU 50 Hz
serial:/dev/ttyUSB0:57600: MAVLink at 57600 baud
    ArduPilot quadrotor 1/1, armed
    streams: ATTITUDE 60 Hz, SCALED_IMU 30 Hz, RAW_IMU 20 Hz, GPS_RAW_INT 5 Hz, VFR_HUD 4 Hz, \
GLOBAL_POSITION_INT 3 Hz and 2 more
    57600 baud carries few IMU samples: set SERIALn_BAUD (ArduPilot) or SER_*_BAUD (PX4) to 921600 \
unless this is a telemetry radio
tcp:10.0.0.1:5760: MAVLink, but no autopilot's heartbeat
/dev/ttyS0: 70 bytes, but no MAVLink at 115200, 921600 baud
/dev/ttyS1: held by another program"""


def test_every_place_is_told_with_what_is_there(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Other places of the network are silent, and only counted."""
    usual = choice("udpin:0.0.0.0:14550")
    slow = choice("serial:/dev/ttyUSB0:57600")
    rates_hz = {27: 20.0, 30: 60.0, 26: 30.0, 24: 5.0, 0: 1.0, 1: 0.4, 74: 4.0, 33: 3.0, 147: 0.5}
    heartbeat = ARDUPILOT._replace(is_armed=True)
    speaker = slow.speaker._replace(firmware=None, rates_hz=rates_hz, heartbeat=heartbeat)

    def at(name: str, *urls: str) -> LinkPlace:
        return LinkPlace(name, urls or (name,))

    hearings = [
        usual.hearing,
        slow.hearing._replace(speakers=(speaker,)),
        Hearing(at("tcp:10.0.0.1:5760"), "tcp:10.0.0.1:5760", (), 3, 100, ""),
        Hearing(
            at("/dev/ttyS0", "serial:/dev/ttyS0:115200", "serial:/dev/ttyS0:921600"),
            "",
            (),
            0,
            70,
            "",
        ),
        Hearing(
            at("/dev/ttyS1", "serial:/dev/ttyS1:115200"), "", (), 0, 0, "held by another program"
        ),
        Hearing(at("tcp:10.0.0.2:5760"), "", (), 0, 0, "connection refused"),
        Hearing(at("udpin:0.0.0.0:14540"), "", (), 0, 0, ""),
    ]
    monkeypatch.setattr(setup, "scan", lambda places, progress: hearings)
    monkeypatch.setattr(setup, "listed_ports", list)
    assert main(["setup"]) == SUCCESS
    assert capsys.readouterr().out == f"no serial ports\n{REPORT}\n"
    assert main(["setup", "--json"]) == SUCCESS
    document = json.loads(capsys.readouterr().out)
    assert len(document["places"]) == len(hearings)


def test_the_unit_starts_the_program_that_set_it_up() -> None:
    text = unit_text("/home/me/venv/bin/h2nav")
    assert "ExecStart=/home/me/venv/bin/h2nav run -c /etc/h2nav/config.yaml" in text


@pytest.mark.parametrize(
    ("answers", "reviews", "fetches"),
    [("", True, False), ("y", True, True), ("nn", False, False)],
)
def test_at_a_terminal_it_asks_about_flights(
    heard: list[Choice],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    answers: str,
    reviews: bool,
    fetches: bool,
) -> None:
    heard.append(choice("serial:/dev/ttyAMA0:921600"))
    asked: list[str] = []

    def answer(question: str) -> str:
        asked.append(question)
        if question.startswith("review"):
            return "n" if answers == "nn" else ""
        return answers[:1] if question.startswith("fetch") else ""

    monkeypatch.setattr("builtins.input", answer)
    monkeypatch.setattr(setup.sys.stdin, "isatty", lambda: True, raising=False)
    path = tmp_path / "config.yaml"
    assert main(["setup", "-o", str(path), "--no-service"]) == SUCCESS
    flights = configuration.read(path).flights
    assert (flights.review, flights.fetch_log) == (reviews, fetches)
    assert any(each.startswith("review every flight") for each in asked)


def test_the_help_says_what_is_sent_and_when_nothing_is_written(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit):
        main(["setup", "--help"])
    said = " ".join(capsys.readouterr().out.split())
    assert "Only version requests to detected autopilots are sent" in said
    assert "Without a terminal and without --yes nothing is written" in said

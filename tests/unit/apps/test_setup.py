"""From what was heard to a configuration that the daemon starts with."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps import check_config, configuration, setup
from h2nav.apps.setup import Choice, Flights, configuration_text
from h2nav.cli import BAD_INPUT, FAILED, SUCCESS, main
from h2nav.host import system_unit
from h2nav.host.system_unit import unit_text
from h2nav.links import link_scan
from h2nav.links.link_scan import Hearing, LinkPlace, Speaker
from h2nav.links.serial_ports import PortListing
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


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """Answers questions at a terminal by how they begin; what was asked."""
    asked: list[str] = []

    def answering(**answers: str) -> list[str]:
        def answer(question: str) -> str:
            asked.append(question)
            return next((text for word, text in answers.items() if question.startswith(word)), "")

        monkeypatch.setattr("builtins.input", answer)
        monkeypatch.setattr(setup.sys.stdin, "isatty", lambda: True, raising=False)
        return asked

    return answering


@pytest.mark.parametrize(
    ("answer", "url"),
    [
        ("", "serial:/dev/ttyAMA0:921600"),
        (" 3 ", "udpin:0.0.0.0:14550"),
        ("0", None),
        ("4", None),
        ("q", None),
    ],
)
def test_of_several_the_user_chooses_by_number(
    heard: list[Choice],
    terminal: Callable[..., list[str]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    answer: str,
    url: str | None,
) -> None:
    """Serial lines come first, then what has more messages a second."""
    fast = choice("tcp:127.0.0.1:5760", PX4, 2)
    fast.speaker.rates_hz[30] = 1.0
    heard += [choice("udpin:0.0.0.0:14550"), fast, choice("serial:/dev/ttyAMA0:921600", PX4, 3)]
    asked = terminal(which=answer)
    path = tmp_path / "config.yaml"
    assert main(["setup", "-o", str(path), "--no-service"]) == SUCCESS
    assert asked[0] == "which one? [1-3, Enter = 1, q = none] "
    said = capsys.readouterr().out
    assert (
        "1) PX4 quadrotor 3/1 at serial:/dev/ttyAMA0:921600\n"
        "2) PX4 quadrotor 2/1 at tcp:127.0.0.1:5760\n"
        "3) ArduPilot quadrotor 1/1 at udpin:0.0.0.0:14550\n"
    ) in said
    assert (configuration.read(path).link.url if path.exists() else None) == url
    assert len(asked) == (1 if url is None else 4)


def test_all_questions_in_their_order(
    heard: list[Choice],
    terminal: Callable[..., list[str]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))
    asked = terminal()
    path = tmp_path / "config.yaml"
    assert main(["setup", "-o", str(path), "--no-service"]) == SUCCESS
    assert asked == [
        "review every flight after landing, at idle priority? [Y/n] ",
        "fetch the autopilot's own log for it (while disarmed)? [y/N] ",
        f"write {path}? [Y/n] ",
    ]
    assert capsys.readouterr().out.splitlines()[-2:] == [
        f"{path}: written and checked",
        f"start it: h2nav run -c {path}",
    ]


@pytest.mark.parametrize(
    ("answer", "is_written"),
    [("YES", True), ("n", False), ("maybe", False)],
)
def test_nothing_is_written_against_the_users_word(
    heard: list[Choice],
    terminal: Callable[..., list[str]],
    tmp_path: Path,
    answer: str,
    is_written: bool,
) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))
    terminal(write=answer)
    path = tmp_path / "config.yaml"
    assert main(["setup", "-o", str(path), "--no-service"]) == SUCCESS
    assert path.exists() is is_written


@pytest.mark.parametrize(("answer", "is_replaced"), [("y", True), ("n", False)])
def test_a_usual_file_that_is_there_is_asked_about(
    heard: list[Choice],
    terminal: Callable[..., list[str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    answer: str,
    is_replaced: bool,
) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))
    path = tmp_path / "config.yaml"
    path.write_text("mine")
    monkeypatch.setattr(setup, "USER_CONFIG", path)
    monkeypatch.setattr(setup.os, "geteuid", lambda: 1000)
    asked = terminal(**{str(path): answer})
    assert main(["setup", "--no-service"]) == SUCCESS
    assert asked[-1] == f"{path} exists; replace it? [Y/n] "
    assert (path.read_text() != "mine") is is_replaced


def test_a_wanted_log_is_not_asked_about_again(
    heard: list[Choice], terminal: Callable[..., list[str]], tmp_path: Path
) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))
    asked = terminal()
    path = tmp_path / "config.yaml"
    assert main(["setup", "--fetch-log", "-o", str(path), "--no-service"]) == SUCCESS
    assert configuration.read(path).flights.fetch_log
    assert not any(each.startswith("fetch") for each in asked)


def test_the_end_of_the_input_writes_nothing(
    heard: list[Choice],
    terminal: Callable[..., list[str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))
    terminal()

    def ends(_: str) -> str:
        raise EOFError

    monkeypatch.setattr("builtins.input", ends)
    assert main(["setup", "-o", str(tmp_path / "config.yaml")]) == 130
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("system_id", "url"), [(1, "udpin:0.0.0.0:14550"), (2, "tcp:1.1.1.1:5")])
def test_a_system_id_says_which_one_is_meant(
    heard: list[Choice], tmp_path: Path, system_id: int, url: str
) -> None:
    heard += [choice("udpin:0.0.0.0:14550"), choice("tcp:1.1.1.1:5", PX4, 2)]
    path = tmp_path / "config.yaml"
    words = ["setup", "--yes", "--system-id", str(system_id), "-o", str(path), "--no-service"]
    assert main(words) == SUCCESS
    assert configuration.read(path).link.url == url


def test_a_system_that_was_not_heard_is_told_with_those_that_were(
    heard: list[Choice], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heard += [choice("udpin:0.0.0.0:14550", system_id=system_id) for system_id in (12, 3, 12)]
    path = tmp_path / "config.yaml"
    assert main(["setup", "--yes", "--system-id", "7", "-o", str(path)]) == FAILED
    said = capsys.readouterr().err
    assert said == "h2nav: no autopilot with system id 7 was heard, but 12, 3\n"


def test_several_are_told_with_links_and_remedy(
    heard: list[Choice], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heard += [choice("udpin:0.0.0.0:14550"), choice("serial:/dev/ttyAMA0:921600", PX4, 2)]
    assert main(["setup", "--yes", "-o", str(tmp_path / "config.yaml")]) == FAILED
    assert capsys.readouterr().err == (
        "h2nav: several autopilots: PX4 quadrotor 2/1 at serial:/dev/ttyAMA0:921600, "
        "ArduPilot quadrotor 1/1 at udpin:0.0.0.0:14550; name the link with --connect URL, or the "
        "vehicle with --system-id N\n"
    )


def test_of_several_on_one_link_the_chosen_is_named_and_of_two_links_not(
    heard: list[Choice], tmp_path: Path
) -> None:
    first, second = (choice("udpin:0.0.0.0:14550", system_id=number) for number in (1, 2))
    both = first.hearing._replace(speakers=(first.speaker, second.speaker))
    heard.append(first._replace(hearing=both))
    path = tmp_path / "config.yaml"
    words = ["setup", "--yes", "--force", "--system-id", "2", "-o", str(path), "--no-service"]
    assert main(words) == SUCCESS
    assert configuration.read(path).autopilot.system_id == 2
    heard[:] = [choice("udpin:0.0.0.0:14550"), choice("tcp:1.1.1.1:5", system_id=2)]
    assert main(words) == SUCCESS
    assert configuration.read(path).autopilot.system_id != 2


@pytest.mark.parametrize(
    ("connect", "ports", "urls"),
    [
        ((), ["listed"], list(setup.USUAL_URLS)),
        (("/dev/ttyS0",), ["/dev/ttyS0"], []),
        (("/dev/ttyS0", "udpin:0.0.0.0:1"), ["/dev/ttyS0"], ["udpin:0.0.0.0:1"]),
        (("/dev/ttyS0:57600",), [], ["/dev/ttyS0:57600"]),
        (("/dev/ttyS0,57600",), [], ["/dev/ttyS0,57600"]),
    ],
)
def test_it_looks_where_the_user_says_or_else_at_all_usual_places(
    monkeypatch: pytest.MonkeyPatch, connect: tuple[str, ...], ports: list[str], urls: list[str]
) -> None:
    scanned: list[LinkPlace] = []
    monkeypatch.setattr(setup, "scan", lambda places, progress: scanned.extend(places) or [])
    monkeypatch.setattr(setup, "listed_ports", lambda: [PortListing("listed", "listed", "", ())])
    words = [word for url in connect for word in ("--connect", url)]
    assert main(["setup", *words]) == FAILED
    assert [place.name for place in scanned] == [*ports, *urls]
    assert [place.urls for place in scanned[len(ports) :]] == [(url,) for url in urls]
    assert all(len(place.urls) == len(link_scan.BAUDS) for place in scanned[: len(ports)])


@pytest.mark.parametrize(
    ("hearings", "remedy"),
    [
        ([("", 0, 0)], "is the autopilot powered, is its port set to MAVLink"),
        ([("held by another program", 0, 0)], "some ports are held by other programs, see above"),
        ([("held by another program", 0, 0), ("", 0, 9)], "bytes came, but no MAVLink: an unusual"),
        ([("", 3, 90), ("", 0, 0)], "is the autopilot powered"),
    ],
)
def test_the_remedy_fits_what_was_heard(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    hearings: list[tuple[str, int, int]],
    remedy: str,
) -> None:
    place = LinkPlace("udpin:0.0.0.0:1", ("udpin:0.0.0.0:1",))
    found = [Hearing(place, place.urls[0], (), f, count, error) for error, f, count in hearings]
    monkeypatch.setattr(setup, "scan", lambda places, progress: found)
    assert main(["setup", "--connect", place.name]) == FAILED
    said = capsys.readouterr().err
    assert said.startswith(f"h2nav: no autopilot detected at {len(found)} places: {remedy}")


def test_a_port_is_told_with_its_names_and_obstacles(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ports = [
        PortListing("/dev/ttyS0", "/dev/ttyS0", "", ()),
        PortListing("/dev/by-id/cube", "/dev/ttyACM0", "Hex Cube", ("no right to it", "a modem")),
    ]
    quiet = [
        Hearing(LinkPlace(p.path, (f"serial:{p.path}:57600",)), "", (), 0, 0, "") for p in ports
    ]
    monkeypatch.setattr(setup, "scan", lambda places, progress: quiet)
    monkeypatch.setattr(setup, "listed_ports", lambda: ports)
    assert main(["setup"]) == FAILED
    assert capsys.readouterr().out.splitlines() == [
        "/dev/ttyS0: silent",
        "/dev/by-id/cube (/dev/ttyACM0) [Hex Cube]: silent",
        "    no right to it",
        "    a modem",
    ]
    assert main(["setup", "--json"]) == FAILED
    first, second = json.loads(capsys.readouterr().out)["places"]
    assert second == {
        "place": "/dev/by-id/cube",
        "url": None,
        "device": "/dev/ttyACM0",
        "description": "Hex Cube",
        "obstacles": ["no right to it", "a modem"],
        "bytes_in": 0,
        "frames": 0,
        "error": "",
        "autopilots": [],
    }
    assert first["obstacles"] == []


def test_an_autopilot_is_a_document(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    usual, url = choice("udpin:0.0.0.0:14550", PX4, 5), "udpin:0.0.0.0:14550"
    armed = PX4._replace(is_armed=True)
    other = Speaker((6, 1), armed, None, {30: 49.96, 27: 0.04})
    heard = usual.hearing._replace(speakers=(usual.speaker, other))
    monkeypatch.setattr(setup, "scan", lambda places, progress: [heard])
    assert main(["setup", "--json", "--connect", url]) == SUCCESS
    (place,) = json.loads(capsys.readouterr().out)["places"]
    assert {name: place[name] for name in ("place", "url", "device", "bytes_in", "frames")} == {
        "place": url, "url": url, "device": None, "bytes_in": 4000, "frames": 100,
    }  # fmt: skip
    assert place["autopilots"] == [
        {
            "system_id": 5, "component_id": 1, "description": "PX4 quadrotor 5/1",
            "firmware": "4.5.7", "is_armed": False, "rates_hz": {"RAW_IMU": 50.0},
        },
        {
            "system_id": 6, "component_id": 1, "description": "PX4 quadrotor 6/1",
            "firmware": None, "is_armed": True, "rates_hz": {"ATTITUDE": 50.0, "RAW_IMU": 0.0},
        },
    ]  # fmt: skip


@pytest.mark.parametrize(("baud", "is_advised"), [(115200, True), (230400, False)])
def test_a_slow_line_is_advised_against(
    heard: list[Choice], capsys: pytest.CaptureFixture[str], baud: int, is_advised: bool
) -> None:
    heard.append(choice(f"serial:/dev/ttyS0:{baud}"))
    assert main(["setup", "--connect", "/dev/ttyS0"]) == SUCCESS
    assert (
        f"    {baud} baud carries few IMU samples: set" in capsys.readouterr().out
    ) is is_advised


@pytest.mark.parametrize(
    ("baud", "heartbeat", "example"),
    [
        (57600, ARDUPILOT, "telemetry-radio"),
        (57600, PX4, "telemetry-radio"),
        (57601, ARDUPILOT, "ardupilot-serial"),
        (921600, PX4, "px4-serial"),
    ],
)
def test_the_example_is_that_of_the_kind_of_link(
    baud: int, heartbeat: Heartbeat, example: str
) -> None:
    url = f"serial:/dev/ttyS0:{baud}"
    text = configuration_text(choice(url, heartbeat), False, Flights())
    usual = check_config.example(example)
    changed = [(a, b) for a, b in zip(usual.splitlines(), text.splitlines(), strict=True) if a != b]
    assert (f"  url: {url}") in [after for _, after in changed]
    assert all(
        before.lstrip().startswith(("url:", "folder:", "token_file:")) for before, _ in changed
    )


@pytest.mark.parametrize("uid", [0, 1000])
def test_a_users_logs_are_at_home_and_the_services_in_the_system(
    monkeypatch: pytest.MonkeyPatch, uid: int
) -> None:
    monkeypatch.setattr(setup.os, "geteuid", lambda: uid)
    text = configuration_text(choice("udpin:0.0.0.0:14550"), False, Flights())
    assert ("/var/log/h2nav" in text) is (uid == 0)
    assert ("~/h2nav-logs" in text) is (uid != 0)


@pytest.mark.parametrize(
    ("url", "heartbeat"),
    [("udpin:0.0.0.0:14550", ARDUPILOT), ("serial:/dev/ttyS0:921600", PX4)],
)
@pytest.mark.parametrize("flights", [Flights(False), Flights(True, True)])
def test_what_becomes_of_flights_is_written(
    tmp_path: Path, url: str, heartbeat: Heartbeat, flights: Flights
) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(configuration_text(choice(url, heartbeat), True, flights))
    found = configuration.read(path).flights
    assert (found.review, found.fetch_log) == flights


@pytest.mark.parametrize(
    ("is_root", "is_systemd", "answer", "starts", "said"),
    [
        (True, True, "", 1, "h2nav.service runs; `h2nav status` shows its state"),
        (True, True, "n", 0, "CONFIG: written and checked"),
        (True, False, "", 0, "no systemd here; start it: h2nav run -c CONFIG"),
        (False, True, "", 0, "start it: h2nav run -c CONFIG"),
    ],
)
def test_root_is_offered_the_service(
    heard: list[Choice],
    terminal: Callable[..., list[str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    is_root: bool,
    is_systemd: bool,
    answer: str,
    starts: int,
    said: str,
) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))
    path, started = tmp_path / "etc" / "config.yaml", []
    monkeypatch.setattr(setup, "SERVICE_CONFIG", path)
    monkeypatch.setattr(setup, "USER_CONFIG", path)
    monkeypatch.setattr(setup.os, "geteuid", lambda: 0 if is_root else 1000)
    monkeypatch.setattr(system_unit, "is_booted", lambda: is_systemd)
    monkeypatch.setattr(system_unit, "install_and_start", lambda: started.append(True))
    asked = terminal(install=answer)
    before = os.umask(0o022)
    try:
        assert main(["setup"]) == SUCCESS
    finally:
        os.umask(before)
    assert len(started) == starts
    assert capsys.readouterr().out.splitlines()[-1].startswith(said.replace("CONFIG", str(path)))
    offered = "install and start the service h2nav? [Y/n] " in asked
    assert offered is (is_root and is_systemd)


def test_a_unit_that_cannot_be_written_is_named(
    heard: list[Choice],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))

    def refused() -> None:
        raise PermissionError(13, "Permission denied", "/etc/systemd/system/h2nav.service")

    monkeypatch.setattr(setup, "SERVICE_CONFIG", tmp_path / "config.yaml")
    monkeypatch.setattr(setup.os, "geteuid", lambda: 0)
    monkeypatch.setattr(system_unit, "is_booted", lambda: True)
    monkeypatch.setattr(system_unit, "install_and_start", refused)
    before = os.umask(0o022)
    try:
        assert main(["setup", "--yes"]) == FAILED
    finally:
        os.umask(before)
    error = capsys.readouterr().err.splitlines()[-1]
    assert error == "h2nav: /etc/systemd/system/h2nav.service: Permission denied"


def test_a_place_that_cannot_be_written_is_named(
    heard: list[Choice], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heard.append(choice("udpin:0.0.0.0:14550"))
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "config.yaml"
    assert main(["setup", "--yes", "-o", str(path)]) == BAD_INPUT
    said = capsys.readouterr().err
    assert said == f"h2nav: {path}: File exists; name another file with -o\n"

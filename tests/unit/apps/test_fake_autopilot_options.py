"""The fake autopilot's command line: the vehicle that it means, and how far each number may go."""

import json
import os
import socket
from types import SimpleNamespace

import pytest
from one_command import main

from h2nav.apps import fake_autopilot
from h2nav.cli import BAD_INPUT, INTERRUPTED, SUCCESS
from h2nav.files.signing_keys import write_signing_key
from h2nav.sim.calibrations import SOUND
from h2nav.sim.imu_model import MPU_9250
from h2nav.sim.personalities import PERSONALITIES
from h2nav.wire.deframer import Deframer

URL = ("--connect", "udpout:127.0.0.1:9")
MANY = """--seed 7 --scenario hover --autopilot px4 --imus 2 --fault gyro-zero@5+2/2 --baud 57600
    --boot-text --arm-authorization --no-ftp --gyro-bias-deg-s 1 2 3 --compass-offset 1 2 3
    --compass-turned 4 --compass-scale 0.5 2 1 --motor-field 5 6 7 --accelerometer-scale 1 0.5 2
    --accelerometer-offset 8 9 10 --gyro-offset 0.1 0.2 0.3 --board 1.5 2.5"""


@pytest.fixture(autouse=True)
def nobody_gives_orders(monkeypatch):
    with open(os.devnull, encoding="utf-8") as nothing:
        monkeypatch.setattr("sys.stdin", nothing)
        yield


@pytest.fixture
def vehicle(monkeypatch):
    """A function: the options of the vehicle that some words mean; None where they are refused."""
    made: list = []

    def switched_on(options):
        made.append(options)
        raise KeyboardInterrupt

    monkeypatch.setattr(fake_autopilot, "FakeAutopilot", switched_on)

    def of(*words):
        made.clear()
        status = main(["fake-autopilot", *URL, *words])
        assert status == (INTERRUPTED if made else BAD_INPUT)
        return made[0] if made else None

    return of


def test_without_words_it_is_a_sound_vehicle(vehicle):
    options = vehicle()
    assert options.scenario.name == "flight"
    assert options.personality == PERSONALITIES["ardupilot"]
    assert (options.seed, options.faults, options.imus) == (0, (), 1)
    assert options.sensor == MPU_9250
    assert options.wrong == SOUND
    assert (options.extra_streams, options.logs, options.parameters) == ((), (), {})
    assert options.line_bytes_per_s is None
    assert (options.boot_text, options.asks_to_arm, options.has_files) == (False, False, True)


def test_every_word_goes_where_it_belongs(vehicle, tmp_path):
    (tmp_path / "a.bin").write_bytes(b"first")
    (tmp_path / "b.bin").write_bytes(b"second")
    (tmp_path / "p.param").write_text("AHRS_TRIM_X,0.5\n")
    options = vehicle(
        *MANY.split(),
        *("--log", str(tmp_path / "a.bin"), "--log", str(tmp_path / "b.bin")),
        *("--parameters", str(tmp_path / "p.param")),
    )
    assert options.scenario.name == "hover"
    assert options.personality == PERSONALITIES["px4"]
    assert (options.seed, options.imus) == (7, 2)
    ((fault),) = options.faults
    assert (fault.name, fault.start_s, fault.length_s, fault.imu) == ("gyro-zero", 5.0, 2.0, 2)
    assert options.line_bytes_per_s == 5760.0  # ten bits a byte
    assert (options.boot_text, options.asks_to_arm, options.has_files) == (True, True, False)
    assert options.sensor.gyro_bias_deg_s == (1.0, 2.0, 3.0)
    assert options.wrong._asdict() == {
        "compass_offset_mg": (1.0, 2.0, 3.0),
        "compass_turned_deg": 4.0,
        "compass_scale": (0.5, 2.0, 1.0),
        "motor_field_mg": (5.0, 6.0, 7.0),
        "accelerometer_scale": (1.0, 0.5, 2.0),
        "accelerometer_offset_m_s2": (8.0, 9.0, 10.0),
        "gyro_offset_deg_s": (0.1, 0.2, 0.3),
        "board_deg": (1.5, 2.5),
    }
    assert options.logs == (b"first", b"second")
    assert options.parameters == {"AHRS_TRIM_X": 0.5}


def test_a_vision_is_a_stream_of_its_own(vehicle):
    options = vehicle("--vision", "vision_position_estimate", "--vision-rate-hz", "20")
    assert len(options.extra_streams) == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--seconds 0", ""),
        ("--seconds 1e9", ""),
        ("--seconds 1.001e9", "--seconds: expected a number from 0 to 1e+09"),
        ("--seconds nan", "--seconds: expected a number from 0 to 1e+09"),
        ("--baud 300", ""),
        ("--baud 12000000", ""),
        ("--vision odometry --vision-rate-hz 1000 --vision-delay-ms 10000 --vision-drop-out 1", ""),
        (
            "--vision odometry --vision-rate-hz 0",
            "--vision-rate-hz: expected a number from 0.1 to 1000",
        ),
        (
            "--vision odometry --vision-delay-ms 10001",
            "--vision-delay-ms: expected a number from 0 to 10000",
        ),
        (
            "--vision odometry --vision-drop-out 1.1",
            "--vision-drop-out: expected a number from 0 to 1",
        ),
        ("--baud 299", "--baud: expected a number from 300 to 12000000"),
        ("--baud 12000001", "--baud: expected a number from 300 to 12000000"),
        ("--gyro-bias-deg-s 100 -100 0", ""),
        ("--gyro-bias-deg-s 0 0 100.1", "--gyro-bias-deg-s: expected three numbers within +-100"),
        ("--gyro-bias-deg-s 0 nan 0", "--gyro-bias-deg-s: expected three numbers within +-100"),
        ("--compass-offset 5000 -5000 0", ""),
        ("--compass-offset 0 0 -5001", "a field: expected numbers within +-5000 mG"),
        ("--motor-field 0 5001 0", "a field: expected numbers within +-5000 mG"),
        ("--compass-scale 0.5 2 1", ""),
        ("--compass-scale 0.49 1 1", "a scale: expected numbers from 0.5 to 2"),
        ("--accelerometer-scale 1 1 2.01", "a scale: expected numbers from 0.5 to 2"),
        ("--gyro-offset 10 -10 0", ""),
        ("--gyro-offset 0 0 10.1", "an offset or an angle: expected numbers within +-10"),
        ("--accelerometer-offset -10.1 0 0", "an offset or an angle: expected numbers within +-10"),
        ("--board 10 -10", ""),
        ("--board 0 10.1", "an offset or an angle: expected numbers within +-10"),
        ("--compass-turned 360", ""),
        ("--compass-turned -360", ""),
        ("--compass-turned 361", "--compass-turned: expected a number within +-360"),
        ("--compass-turned nan", "--compass-turned: expected a number within +-360"),
        ("--fault gyro-zero@5/3 --imus 3", ""),
        ("--log nowhere.bin", "--log: nowhere.bin: No such file or directory"),
    ],
)
def test_each_number_has_its_limits(vehicle, capsys, words, said):
    assert (vehicle(*words.split()) is None) == bool(said)
    if said:
        assert capsys.readouterr().err == f"h2nav: {said}\n"


@pytest.fixture
def ground(monkeypatch):
    """Where the vehicle sends to; its orders end it after one turn."""
    reader, writer = os.pipe()
    os.write(writer, b"gps-lost\nnonsense\nquit\nwind\n")
    os.close(writer)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end, os.fdopen(reader) as orders:
        monkeypatch.setattr("sys.stdin", orders)
        end.bind(("127.0.0.1", 0))
        end.settimeout(10.0)
        yield end


def url_of(end):
    return f"udpout:127.0.0.1:{end.getsockname()[1]}"


def test_it_sends_frames_and_counts_them(ground, capsys):
    assert main(["fake-autopilot", "--connect", url_of(ground), "--json"]) == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert found["seconds"] > 0.0
    assert found["messages"]["HEARTBEAT"] == 1
    assert found["frames_heard"] == found["frames_refused"] == found["reboots"] == 0
    received = b"".join(ground.recv(1000) for _ in range(found["frames_sent"]))
    assert len(received) == found["bytes_sent"] > 0
    frames = Deframer().feed(received)
    assert len(frames) == found["frames_sent"] == sum(found["messages"].values())
    assert not any(frame.signed for frame in frames)


def test_people_get_the_counts_and_the_answers_to_orders_and_programs_nothing(ground, capsys):
    assert main(["fake-autopilot", "--connect", url_of(ground)]) == SUCCESS
    told = capsys.readouterr()
    assert told.out == ""
    lines = told.err.splitlines()
    assert "gps-lost" in lines[0]
    assert lines[1].startswith("h2nav: nonsense")
    counts = dict(line.split(maxsplit=1) for line in lines[2:])
    assert counts["reboots"] == "0"
    assert "HEARTBEAT" in counts["messages"]
    assert "wind" not in told.err  # behind quit


def test_with_a_key_every_frame_is_signed(ground, tmp_path):
    write_signing_key(tmp_path / "key", bytes(range(32)))
    words = ["--connect", url_of(ground), "--signing-key", str(tmp_path / "key")]
    assert main(["fake-autopilot", *words]) == SUCCESS
    frames = Deframer().feed(ground.recv(1000))
    assert frames
    assert all(frame.signed for frame in frames)


@pytest.mark.parametrize("is_interrupted", [False, True])
def test_it_waits_a_second_for_its_links_and_closes_them_whatever_happens(
    monkeypatch, capsys, is_interrupted
):
    waits_s, calls = [], []

    def link_of(url):
        return SimpleNamespace(
            url=url,
            is_up=url == "up",
            last_error="no such device",
            maintain=lambda t_ns: calls.append(f"open {url}"),
            close=lambda: calls.append(f"close {url}"),
        )

    def select(readers, _writers, _others, wait_s):
        waits_s.append(wait_s)
        return [], [], []

    def switched_on(options):
        raise KeyboardInterrupt

    monkeypatch.setattr(fake_autopilot, "open_server_link", link_of)
    monkeypatch.setattr(fake_autopilot.select, "select", select)
    if is_interrupted:
        monkeypatch.setattr(fake_autopilot, "FakeAutopilot", switched_on)
    words = ["--connect", "up", "--connect", "down", "--seconds", "0"]
    status = main(["fake-autopilot", *words])
    assert status == (INTERRUPTED if is_interrupted else SUCCESS)
    assert sum(waits_s) == pytest.approx(1.0)
    assert calls.count("open up") == calls.count("open down") == len(waits_s)
    assert calls[-2:] == ["close up", "close down"]
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "h2nav: down is not open yet: no such device"
    assert not any("up is not" in line for line in said)

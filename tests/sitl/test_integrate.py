"""The examples of docs/integrate.md, as they stand there, with the daemon and a fake autopilot."""

import json
import os
import re
import select
import socket
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import jsonschema
import pytest
from needs import REPOSITORY, need_package

from h2nav.cli import main

PATIENCE_S = 90.0
PAGE = (REPOSITORY / "docs" / "integrate.md").read_text(encoding="utf-8")
FLIGHT = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"
FAULT = ("--fault", "gyro-frozen@14")


def free_port():
    """A port that the kernel has just given away."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def example(name, folder):
    """The example's file, of the text in the document."""
    found = re.search(rf"`{name}`:\n\n```python\n(.*?)```", PAGE, re.DOTALL)
    path = folder / name
    path.write_text(found[1], encoding="utf-8")
    return path


@contextmanager
def running(*command, **options):
    """A process that ends with the block."""
    process = subprocess.Popen([sys.executable, *map(str, command)], **options)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def until(process, *texts):
    """What a process has said when all of the texts are in it."""
    seen, end = b"", time.monotonic() + PATIENCE_S
    while not all(text.encode() in seen for text in texts):
        assert time.monotonic() < end, seen.decode(errors="replace")
        if select.select([process.stdout], [], [], 0.2)[0]:
            data = os.read(process.stdout.fileno(), 65536)
            assert data, seen.decode(errors="replace")
            seen += data
    return seen.decode(errors="replace")


@contextmanager
def listening(folder):
    """The daemon, and the port and the socket that it serves."""
    companion, events = free_port(), folder / "events"
    configuration = folder / "h2nav.yaml"
    configuration.write_text(
        f"link: {{url: 'udpin:127.0.0.1:{companion}'}}\nevents: {{socket: '{events}'}}\n"
    )
    run = ("-m", "h2nav", "run", "-c", configuration, "--json")
    with running(*run, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as daemon:
        until(daemon, '"event": "notice"')
        yield daemon, companion, events


def flight(*ports):
    """A vehicle whose gyro freezes, heard at each of the ports."""
    links = [word for port in ports for word in ("--connect", f"udpout:127.0.0.1:{port}")]
    fly = ("-m", "h2nav", "fake-autopilot", *links, "--scenario", "flight", *FAULT)
    return running(*fly, stdout=subprocess.DEVNULL)


def wait_until_bound(port):
    """Until some process listens at a UDP port."""
    end = time.monotonic() + PATIENCE_S
    while f":{port:04X} " not in Path("/proc/net/udp").read_text():
        assert time.monotonic() < end, port
        time.sleep(0.1)


@pytest.mark.thorough
def test_programs_read_what_was_found(tmp_path):
    ground = free_port()
    with ExitStack() as stack:
        daemon, companion, events = stack.enter_context(listening(tmp_path))
        reader = stack.enter_context(
            running(example("events.py", tmp_path), events, stdout=subprocess.PIPE)
        )
        station = stack.enter_context(
            running(
                example("ground_station.py", tmp_path),
                f"udpin:127.0.0.1:{ground}",
                stdout=subprocess.PIPE,
            )
        )
        wait_until_bound(ground)
        stack.enter_context(flight(companion, ground))
        said = until(reader, "begin error gyro_frozen.imu1.1 gyro is frozen\n")
        assert "update" not in said
        until(station, "attitude trusted", "h2nav: degraded: ", "attitude not trusted")
        printed = until(daemon, '"phase": "begin"')
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as late:
            late.settimeout(PATIENCE_S)
            late.connect(os.fspath(events))
            events_of = map(json.loads, late.makefile(encoding="utf-8"))
            first = next(event for event in events_of if event["event"] == "finding")
    schema = json.loads((REPOSITORY / "docs" / "schema" / "event.json").read_text())
    check = jsonschema.Draft202012Validator(schema)
    lines = [json.loads(line) for line in printed.splitlines() if line.endswith("}")]
    assert len(lines) > 5
    for event in (*lines, first):
        check.validate(event)
    (begun,) = [event for event in lines if event["event"] == "finding"][:1]
    assert (begun["phase"], begun["kind"], begun["is_open"]) == ("begin", "gyro_frozen", True)
    assert (first["phase"], first["id"]) == ("update", begun["id"])


@pytest.mark.thorough
def test_mavsdk_receives_a_finding(tmp_path):
    need_package("mavsdk_grpc")
    ground = free_port()
    with ExitStack() as stack:
        _, companion, _ = stack.enter_context(listening(tmp_path))
        script = example("mavsdk_texts.py", tmp_path)
        client = stack.enter_context(
            running(script, f"udpin://127.0.0.1:{ground}", stdout=subprocess.PIPE)
        )
        wait_until_bound(ground)
        stack.enter_context(flight(companion, ground))
        until(client, "h2nav: degraded: IMU 1: gyro is frozen")


@pytest.mark.thorough
def test_a_bag_is_read_without_ros(tmp_path):
    need_package("rosbags.highlevel")
    bag = tmp_path / "bag"
    words = ["log", "export", str(FLIGHT), "--format", "rosbag2", "-o", str(bag)]
    assert main(words) == 0
    script = example("bag_findings.py", tmp_path)
    said = subprocess.run(
        [sys.executable, script, bag], check=True, capture_output=True, text=True
    ).stdout.splitlines()
    assert len([line for line in said if " roll " in line]) >= 40
    assert [line for line in said if line.endswith(" OK h2nav: attitude active")]


@pytest.mark.parametrize("name", re.findall(r"`(\S+)`:\n\n```python", PAGE))
def test_every_example_is_run_here(name):
    with open(__file__, encoding="utf-8") as own:
        assert f'"{name}"' in own.read()

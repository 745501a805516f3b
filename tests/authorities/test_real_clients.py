"""MAVSDK and MAVProxy, unchanged from their packages, see the fake autopilot and our component.

Both are clients that users have. The topology is that of a vehicle: the daemon on one link, the
client on another, the autopilot forwards between them.
"""

import asyncio
import json
import os
import select
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from needs import need_package
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.log.recorder import RECEIVED_TOPIC, REFUSED_TOPIC, SENT_TOPIC
from h2nav.recordings.recording import open_recording
from h2nav.wire.deframer import Deframer
from h2nav.wire.dialect import LAYOUTS

pytestmark = pytest.mark.thorough

PATIENCE_S = 60.0
OUR_COMPONENT = 191
PASSPHRASE = "correct-horse-battery-staple"
ASK_US = f"set param_ftp False; vehicle 1:{OUR_COMPONENT}; param fetch"
DAEMON_CONFIGURATION = """\
link:
  url: udpin:127.0.0.1:{port}
"""


def free_port(kind=socket.SOCK_DGRAM):
    """A port that the kernel has just given away."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def running(*command, **options):
    """A process that ends with the block."""
    process = subprocess.Popen([sys.executable, *command], **options)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def fake_autopilot(*ports, make="ardupilot", scenario="flight", more=()):
    """The vehicle, on a link to each port."""
    links = [word for port in ports for word in ("--connect", f"udpout:127.0.0.1:{port}")]
    words = ("--autopilot", make, "--scenario", scenario, *more)
    return running("-m", "h2nav", "fake-autopilot", *links, *words)


@contextmanager
def daemon(tmp_path, port):
    """`h2nav run` on the vehicle's other link."""
    configuration = tmp_path / "h2nav.yaml"
    configuration.write_text(DAEMON_CONFIGURATION.format(port=port))
    with running("-m", "h2nav", "run", "-c", str(configuration)) as process:
        yield process


@contextmanager
def signed_daemon(tmp_path, port):
    """`h2nav run` that speaks to a ground station alone, with the key of `PASSPHRASE`."""
    key, configuration = tmp_path / "key", tmp_path / "signed.yaml"
    make_key = [sys.executable, "-m", "h2nav", "signing-key", "-o", str(key)]
    subprocess.run(make_key, input=PASSPHRASE, text=True, check=True)
    configuration.write_text(
        f"link: {{url: 'udpout:127.0.0.1:{port}'}}\n"
        f"signing: {{key_file: '{key}', state_file: '{tmp_path / 'stamp'}'}}\n"
        f"log: {{folder: '{tmp_path / 'logs'}'}}\n"
    )
    with running("-m", "h2nav", "run", "-c", str(configuration)) as process:
        yield process


@contextmanager
def mavproxy(port, folder, commands="", output=None):
    """MAVProxy; the value reads its output until all texts have appeared."""
    need_package("MAVProxy")
    script = Path(sys.executable).with_name("mavproxy.py")
    command = [str(script), "--master", f"udp:127.0.0.1:{port}", "--non-interactive", "--no-state"]
    command += ["--cmd", commands]
    command += [] if output is None else ["--out", f"udp:127.0.0.1:{output}"]
    with running(
        "-u", *command,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, cwd=folder,
    ) as process:  # fmt: skip
        seen = bytearray()

        def until(*texts):
            end = time.monotonic() + PATIENCE_S
            while not all(text.encode() in seen for text in texts):
                assert time.monotonic() < end, seen.decode(errors="replace")
                if select.select([process.stdout], [], [], 0.2)[0]:
                    data = os.read(process.stdout.fileno(), 65536)
                    assert data, seen.decode(errors="replace")
                    seen.extend(data)
            return seen.decode(errors="replace")

        yield until


def with_mavsdk(port, look):
    """What the coroutine `look` makes of a MAVSDK system connected to `port`."""
    mavsdk = need_package("mavsdk_grpc")

    async def session():
        system = mavsdk.System(port=free_port(socket.SOCK_STREAM))
        await system.connect(system_address=f"udpin://127.0.0.1:{port}")
        try:
            return await look(system)
        finally:
            system._stop_mavsdk_server()

    async def in_time():
        return await asyncio.wait_for(session(), PATIENCE_S)

    return asyncio.run(in_time())


async def heartbeat_of(system, component):
    """The first HEARTBEAT of a component, as MAVSDK decodes it."""
    async for message in system.mavlink_direct.message("HEARTBEAT"):
        if message.component_id == component:
            return message.system_id, json.loads(message.fields_json)
    raise AssertionError("the stream of messages has ended")


@pytest.mark.parametrize("make", ["ardupilot", "px4"])
def test_mavsdk_sees_the_vehicle(make):
    async def look(system):
        async for state in system.core.connection_state():
            if state.is_connected:
                break
        version = await system.info.get_version()
        await system.telemetry.set_rate_attitude_euler(20.0)
        attitude = await anext(system.telemetry.attitude_euler())
        values = await system.param.get_all_params()
        return version, attitude, values

    port = free_port()
    with fake_autopilot(port, make=make, scenario="rest"):
        version, attitude, values = with_mavsdk(port, look)
    assert version.flight_sw_major == {"ardupilot": 4, "px4": 1}[make]
    # At rest heading 30 deg; the autopilot's own estimate errs by up to 0.8 deg.
    assert attitude.yaw_deg == pytest.approx(30.0, abs=1.0)
    assert attitude.roll_deg == pytest.approx(0.0, abs=0.5)
    assert len(values.float_params) > 3


def test_mavsdk_sees_our_component(tmp_path):
    async def look(system):
        return await heartbeat_of(system, OUR_COMPONENT)

    ground, companion = free_port(), free_port()
    with daemon(tmp_path, companion), fake_autopilot(ground, companion):
        system_id, heartbeat = with_mavsdk(ground, look)
    assert system_id == 1
    assert heartbeat["type"] == mavlink.MAV_TYPE_ONBOARD_CONTROLLER
    assert heartbeat["autopilot"] == mavlink.MAV_AUTOPILOT_INVALID


@pytest.mark.parametrize(
    ("wrong", "authorized"), [((), True), (("--fault", "accel-scale=1.1@0"), False)]
)
def test_mavsdk_may_arm_what_we_authorize(tmp_path, wrong, authorized):
    mavsdk = need_package("mavsdk_grpc")

    async def look(system):
        async for state in system.core.connection_state():
            if state.is_connected:
                break
        # The first request asks us; while our answer holds, another one is accepted.
        for _ in range(20):
            try:
                await system.action.arm()
            except mavsdk.action.ActionError:
                await asyncio.sleep(1.0)
            else:
                return True
        return False

    ground, companion = free_port(), free_port()
    configuration = tmp_path / "asked.yaml"
    configuration.write_text(
        DAEMON_CONFIGURATION.format(port=companion) + "output:\n  arming_opinion: true\n"
    )
    with (
        running("-m", "h2nav", "run", "-c", str(configuration)),
        fake_autopilot(
            ground, companion, make="px4", scenario="rest", more=("--arm-authorization", *wrong)
        ),
    ):
        assert with_mavsdk(ground, look) is authorized


def test_mavproxy_sees_the_vehicle(tmp_path):
    port = free_port()
    with fake_autopilot(port), mavproxy(port, tmp_path) as until:
        until("Detected vehicle 1:1 ", "online system 1", "AP: Arming motors")


def test_mavproxy_sees_our_component(tmp_path):
    ground, companion = free_port(), free_port()
    with (
        daemon(tmp_path, companion),
        fake_autopilot(ground, companion),
        mavproxy(ground, tmp_path) as until,
    ):
        until("Detected vehicle 1:1 ", f"Detected vehicle 1:{OUR_COMPONENT} ")


def frames_in_logs(folder, topic_begin):
    """Names of the messages in the logs that are being written or are closed."""
    deframer = Deframer()
    return {
        LAYOUTS[frame.msg_id].name
        for path in folder.glob("*.mcap*")
        for topic, stored in open_recording(path)._messages("mavlink")
        if topic.startswith(topic_begin)
        for frame in deframer.feed(stored.data)
    }


def test_setup_finds_the_vehicle_behind_mavproxy(tmp_path):
    port, output = free_port(), free_port()
    path = tmp_path / "config.yaml"
    words = ("--yes", "--no-service", "--connect", f"udpin:127.0.0.1:{output}", "-o", str(path))
    with fake_autopilot(port), mavproxy(port, tmp_path, output=output) as until:
        until("Detected vehicle 1:1")
        done = subprocess.run(
            [sys.executable, "-m", "h2nav", "setup", *words],
            capture_output=True, text=True, timeout=PATIENCE_S, check=False,
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "ArduPilot quadrotor 1/1, firmware 4.7.0" in done.stdout
    assert f"udpin:127.0.0.1:{output}" in path.read_text()


def test_mavproxy_and_we_believe_each_others_signatures(tmp_path):
    port = free_port()
    sign = f"set allow_unsigned False; signing key {PASSPHRASE}; "
    with (
        signed_daemon(tmp_path, port),
        mavproxy(port, tmp_path, sign + ASK_US) as until,
    ):
        until(f"Detected vehicle 1:{OUR_COMPONENT} ", "AP: h2nav: no_autopilot", "Received 5 param")


@pytest.mark.parametrize("sign", ["", "signing key another-passphrase; "])
def test_mavproxy_without_our_key_is_not_answered(tmp_path, sign):
    port, logs = free_port(), tmp_path / "logs"
    with signed_daemon(tmp_path, port) as process, mavproxy(port, tmp_path, sign + ASK_US) as until:
        until(f"Detected vehicle 1:{OUR_COMPONENT} ")
        end = time.monotonic() + PATIENCE_S
        while "PARAM_REQUEST_LIST" not in frames_in_logs(logs, REFUSED_TOPIC):
            assert time.monotonic() < end
            time.sleep(0.2)
        process.terminate()
        process.wait(timeout=10)
    assert "HEARTBEAT" in frames_in_logs(logs, SENT_TOPIC)
    assert "PARAM_VALUE" not in frames_in_logs(logs, SENT_TOPIC)
    assert not frames_in_logs(logs, RECEIVED_TOPIC)

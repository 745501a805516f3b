"""``h2nav run --live`` as processes: what a Foxglove client gets, and what a fault costs."""

import asyncio
import base64
import json
import os
import re
import signal
import socket
import time
from collections import defaultdict
from pathlib import Path

import pytest
from daemon_process import WAIT_S, daemon, fake_autopilot, free_udp_port, the_log
from mcap.reader import make_reader
from needs import need_package

from h2nav.recordings.recording import open_recording

need_package("foxglove")
from foxglove_client import FoxgloveClient  # noqa: E402

ADDRESS = re.compile(r"http://127\.0\.0\.1:(\d+)/, Foxglove at ws://127\.0\.0\.1:(\d+)")
# What a flight brings within seconds, beside what comes once.
BUSY = {
    "/imu", "/estimate", "/tf", "/pose", "/health", "/ratios", "/comparison", "/time_sync",
    "/link", "/deframer", "/recorder",
}  # fmt: skip
LIVE_ONLY = {"/status", "/feed"}


def free_tcp_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def configuration(folder, port, foxglove_port, address="127.0.0.1:0"):
    path = folder / "config.yaml"
    path.write_text(
        f"link: {{url: 'udpin:127.0.0.1:{port}'}}\n"
        f"log: {{folder: '{folder / 'logs'}'}}\n"
        # The viewer is its only child.
        "flights: {review: false}\n"
        f"live: {{address: '{address}', foxglove_port: {foxglove_port}}}\n"
    )
    return str(path)


@pytest.fixture
def flying(tmp_path):
    """A daemon with a live view and an autopilot; the daemon, and the Foxglove port."""
    port, foxglove_port = free_udp_port(), free_tcp_port()
    with (
        daemon("-c", configuration(tmp_path, port, foxglove_port)) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--scenario", "hover"),
    ):
        assert invited(running)[1] == foxglove_port
        yield running, foxglove_port


def invited(running):
    """Page and Foxglove ports that the daemon has told last."""
    event = running.wait_for(lambda event: "live view at" in event.get("text", ""))
    return tuple(int(port) for port in ADDRESS.search(event["text"]).groups())


def children(pid):
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_until_gone(pid):
    end = time.monotonic() + WAIT_S
    while is_running(pid):
        assert time.monotonic() < end, "it still runs"
        time.sleep(0.02)


def schemas_of(log):
    """Topic -> encoding, name and text of its schema, of all that a log holds decoded."""
    with log.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    return {
        channel.topic: (channel.message_encoding, schema.name, schema.data)
        for channel in summary.channels.values()
        if (schema := summary.schemas.get(channel.schema_id)) is not None
    }


def schema_bytes(channel):
    text = channel["schema"]
    return base64.b64decode(text + "==") if channel["encoding"] == "protobuf" else text.encode()


@pytest.mark.thorough
def test_a_client_gets_the_channels_of_the_log_as_they_are_made(flying, tmp_path):
    running, foxglove_port = flying

    async def listen():
        client = await FoxgloveClient.connected(
            foxglove_port, BUSY - {"/link", "/deframer", "/recorder"}
        )
        await client.subscribe(*client.channels)
        seen = defaultdict(list)
        while not seen.keys() >= BUSY | LIVE_ONLY or len(seen["/estimate"]) < 300:
            message = await client.message()
            seen[message.topic].append(message)
        client.close()
        return client.channels, seen

    channels, seen = asyncio.run(listen())
    assert running.stop() == 0
    log = the_log(tmp_path / "logs")
    assert (
        schemas_of(log).items()
        <= {
            topic: (channel["encoding"], channel["schemaName"], schema_bytes(channel))
            for topic, channel in channels.items()
        }.items()
    )
    recording = open_recording(log)
    logged = dict(recording.records("/estimate"))
    shown = {message.t_ns: json.loads(message.data) for message in seen["/estimate"]}
    assert len(shown) == len(seen["/estimate"])
    assert shown == {t_ns: logged[t_ns] for t_ns in shown}
    # Since somebody looks at every sample, none is missing.
    times = sorted(t_ns for t_ns in logged if min(shown) <= t_ns <= max(shown))
    assert len(times) - len(shown) < 0.2 * len(times)


@pytest.mark.thorough
def test_the_viewer_is_a_process_that_steps_back_and_ends_with_its_daemon(flying):
    running, _ = flying
    pid = running.process.pid
    (viewer,) = children(pid)
    loaded, in_viewer = (Path(f"/proc/{each}/maps").read_text() for each in (pid, viewer))
    assert "foxglove" in in_viewer
    assert "foxglove" not in loaded
    assert "numpy" not in loaded
    nice, viewers = (os.getpriority(os.PRIO_PROCESS, each) for each in (pid, viewer))
    assert viewers == min(nice + 10, 19)
    limits = Path(f"/proc/{viewer}/limits").read_text()
    assert re.search(r"Max open files +512 ", limits)
    assert re.search(r"Max data size +268435456 ", limits)
    assert Path(f"/proc/{viewer}/oom_score_adj").read_text() == "1000\n"
    assert running.stop() == 0
    assert not is_running(viewer)


@pytest.mark.thorough
def test_a_viewer_that_is_killed_comes_back_and_the_estimate_goes_on(flying):
    running, _ = flying
    (viewer,) = children(running.process.pid)
    before = running.wait_for_samples(100)["samples_used"]
    os.kill(viewer, signal.SIGKILL)
    lost = running.wait_for(lambda event: "live view lost" in event.get("text", ""))
    assert lost["severity"] == "warning"
    assert "it is started again" in lost["text"]
    running.wait_for_samples(before + 300)
    (another,) = children(running.process.pid)
    assert another != viewer


def test_a_killed_daemon_takes_its_viewer_along(flying):
    running, _ = flying
    (viewer,) = children(running.process.pid)
    running.stop(signal.SIGKILL)
    wait_until_gone(viewer)


@pytest.mark.thorough
@pytest.mark.parametrize("taken", ["page", "foxglove"])
def test_a_port_that_is_taken_costs_the_view_and_no_attitude(tmp_path, taken):
    port = free_udp_port()
    with socket.socket() as squatter:
        squatter.bind(("127.0.0.1", 0))
        squatter.listen()
        theirs = squatter.getsockname()[1]
        is_page = taken == "page"
        address = f"127.0.0.1:{theirs if is_page else 0}"
        file = configuration(tmp_path, port, free_tcp_port() if is_page else theirs, address)
        with (
            daemon("-c", file) as running,
            fake_autopilot(f"udpout:127.0.0.1:{port}", "--scenario", "rest"),
        ):
            lost = running.wait_for(lambda event: "live view lost" in event.get("text", ""))
            key = "live.address" if is_page else "live.foxglove_port"
            assert f"{key}: 127.0.0.1:{theirs}" in lost["text"]
            assert "choose another" in lost["text"]
            running.wait_for_samples(200)

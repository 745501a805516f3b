"""Foxglove's own client library (npm's @foxglove/ws-protocol) on a daemon that flies."""

import base64
import json
import socket
import subprocess
import time

import pytest
from daemon_process import daemon, fake_autopilot, free_udp_port
from needs import REPOSITORY, absent, need_package, need_program

from h2nav.log.foxglove_messages import flat_fields, protobuf_schemas
from h2nav.log.schema import record_format
from h2nav.service.records import EstimateRecord, HealthRecord, ImuRecord, StatusRecord

pytestmark = pytest.mark.thorough

CLIENT = REPOSITORY / "tests" / "authorities" / "foxglove_client.cjs"
RECORDS = {
    "/imu": ImuRecord,
    "/estimate": EstimateRecord,
    "/health": HealthRecord,
    "/status": StatusRecord,
}
ATTITUDES = ("/tf", "/pose")


@pytest.fixture
def node():
    need_package("foxglove")
    program = need_program("node")
    if not (REPOSITORY / "node_modules" / "@foxglove" / "ws-protocol").is_dir():
        absent("npm's @foxglove/ws-protocol and ws are not installed (.ci/run does it)")
    return program


def test_it_understands_every_channel_and_reads_the_configuration(tmp_path, node):
    port = free_udp_port()
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        foxglove_port = probe.getsockname()[1]
    config = tmp_path / "config.yaml"
    config.write_text(
        f"link: {{url: 'udpin:127.0.0.1:{port}'}}\n"
        f"live: {{address: '127.0.0.1:0', foxglove_port: {foxglove_port}}}\n"
    )
    with (
        daemon("-c", str(config)) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--scenario", "hover"),
    ):
        running.wait_for(lambda event: "live view at" in event.get("text", ""))
        done = subprocess.run(
            [node, str(CLIENT), str(foxglove_port), *RECORDS, *ATTITUDES],
            capture_output=True,
            text=True,
            check=False,
            timeout=60.0,
        )
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)
    assert seen["server"]["name"] == "h2nav"
    assert seen["parameters"]["link.url"] == f"udpin:127.0.0.1:{port}"
    assert seen["parameters"]["autopilot.imu_rate_hz"] == 100.0
    for topic, kind in RECORDS.items():
        got, form = seen["topics"][topic], record_format(kind)
        assert (got["encoding"], got["schemaName"]) == ("json", form.name)
        assert got["schema"].encode() == form.schema
        assert json.loads(base64.b64decode(got["data"])).keys() == set(kind._fields)
        assert abs(int(got["unixNs"]) - time.time_ns()) < 120e9
    for topic in ATTITUDES:
        got, (name, descriptors) = seen["topics"][topic], protobuf_schemas()[topic]
        assert got["schemaName"] == name
        assert base64.b64decode(got["schema"] + "==") == descriptors
        attitude = flat_fields(name, base64.b64decode(got["data"]))
        assert sum(part * part for part in attitude.values()) == pytest.approx(1.0)

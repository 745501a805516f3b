"""What a client of the Foxglove WebSocket gets: channels, schemas, messages, parameters."""

import asyncio
import base64
import socket

import orjson
import pytest
from live_records import finding
from needs import need_package

from h2nav.errors import BadInput
from h2nav.integrity.severity import Severity
from h2nav.links.live_feed import FeedLine
from h2nav.log.foxglove_messages import flat_fields, protobuf_schemas
from h2nav.log.schema import record_format
from h2nav.service.records import EstimateRecord, HealthRecord, ImuRecord

need_package("foxglove")
from foxglove_client import FoxgloveClient, until  # noqa: E402
from tornado.iostream import StreamClosedError  # noqa: E402

from h2nav.live.foxglove_server import FROM_THE_START, FoxgloveServer  # noqa: E402

CONFIGURATION = {
    "autopilot": {"imu_rate_hz": 100.0, "imu_message": "auto"},
    "signing": {"accept_unsigned": ("RADIO_STATUS", "RADIO")},
    "odometry": {"angles_deg": ()},
}
T_NS = 1_700_000_000_123_456_789
IMU = ImuRecord(7, 0.1, 0.2, 0.3, 0.0, 0.0, -9.8, None, None, None, False)
ESTIMATE = EstimateRecord(7, 0.5, -0.5, 0.5, -0.5, *[0.25] * 13, 3)


async def connected(server):
    """A client that knows all channels that are there from the start."""
    if not server.port:
        await server.listen("127.0.0.1", 0)
    return await FoxgloveClient.connected(server.port, {*FROM_THE_START, *protobuf_schemas()})


@pytest.fixture
def server():
    return FoxgloveServer(CONFIGURATION)


def run(server, check):
    """Runs a check, and closes the server in the loop of its connections, as the viewer does."""

    async def checked():
        try:
            await check()
        finally:
            server.close()

    asyncio.run(checked())


def test_every_channel_has_the_schema_of_the_log(server):
    async def check():
        client = await connected(server)
        for topic, kind in FROM_THE_START.items():
            form, channel = record_format(kind), client.channels[topic]
            assert channel["encoding"] == "json"
            assert channel["schemaName"] == form.name
            assert channel["schemaEncoding"] == "jsonschema"
            assert channel["schema"].encode() == form.schema
        for topic, (name, descriptors) in protobuf_schemas().items():
            channel = client.channels[topic]
            assert channel["encoding"] == channel["schemaEncoding"] == "protobuf"
            assert channel["schemaName"] == name
            assert base64.b64decode(channel["schema"] + "==") == descriptors
        client.close()

    run(server, check)


def test_records_lines_and_the_attitude_arrive_with_their_times(server):
    async def check():
        client = await connected(server)
        topics = ("/imu", "/estimate", "/tf", "/pose", "/log")
        await client.subscribe(*topics)
        await until(lambda: all(server._has_readers(topic) for topic in topics))
        server.show("/imu", T_NS, IMU)
        server.show("/estimate", T_NS + 1, ESTIMATE)
        server.show("/log", T_NS + 2, FeedLine(Severity.ERROR, "GPS lost"))
        got = {
            topic: (t_ns, data) for topic, t_ns, data in [await client.message() for _ in topics]
        }
        assert {topic: t_ns - T_NS for topic, (t_ns, _) in got.items()} == {
            "/imu": 0, "/estimate": 1, "/tf": 1, "/pose": 1, "/log": 2,
        }  # fmt: skip
        assert got["/imu"][1] == record_format(ImuRecord).encode(IMU)
        assert got["/estimate"][1] == record_format(EstimateRecord).encode(ESTIMATE)
        for topic, name in (("/tf", "FrameTransform"), ("/pose", "PoseInFrame")):
            attitude = flat_fields(f"foxglove.{name}", got[topic][1])
            assert tuple(attitude.values()) == (0.5, -0.5, 0.5, -0.5)
        said = flat_fields("foxglove.Log", got["/log"][1])
        assert said == {"level": "ERROR", "message": "GPS lost"}
        client.close()

    run(server, check)


def test_who_subscribes_late_gets_the_findings_that_go_on(server):
    async def check():
        client = await connected(server)
        over = finding(id="attitude_velocity.gps.1")
        open_one = finding(id="attitude_velocity.gps.2")
        for record in (over, over._replace(phase="end", is_open=False), open_one):
            server.show("/finding", T_NS, record)
        await client.subscribe("/finding")
        await until(lambda: server._has_readers("/finding"))
        server.show("/imu", T_NS + 1, IMU)  # the daemon goes on
        topic, t_ns, data = await client.message()
        assert (topic, t_ns) == ("/finding", T_NS)
        assert orjson.loads(data)["id"] == open_one.id
        client.close()

    run(server, check)


def test_a_topic_that_comes_later_is_a_channel_from_then_on(server):
    async def check():
        client = await connected(server)
        server.show(
            "/later", T_NS, HealthRecord("active", "", "1/1", "", 0.0, 0, 0, 0, False, True)
        )
        await client.learn(["/later"])
        assert client.channels["/later"]["schemaName"] == "h2nav.HealthRecord"
        client.close()

    run(server, check)


def test_it_knows_whether_somebody_looks_at_every_sample(server):
    async def check():
        assert not server.wants_all
        one, other = [await connected(server) for _ in range(2)]
        await one.subscribe("/health")
        await until(lambda: server._has_readers("/health"))
        assert not server.wants_all
        await one.subscribe("/imu")
        await other.subscribe("/tf")
        await until(lambda: server._has_readers("/tf") and server._has_readers("/imu"))
        assert server.wants_all
        one.close()
        await until(lambda: not server._has_readers("/imu"))
        assert server.wants_all
        other.close()
        await until(lambda: not server.wants_all)

    run(server, check)


def test_the_configuration_can_be_read_and_not_written(server):
    async def values(client, **words):
        await client.say(**words)
        answer = await client.received()
        assert answer["op"] == "parameterValues"
        return {each["name"]: each.get("value") for each in answer["parameters"]}

    async def check():
        client = await connected(server)
        whole = {
            "autopilot.imu_rate_hz": 100.0,
            "autopilot.imu_message": "auto",
            "signing.accept_unsigned": ["RADIO_STATUS", "RADIO"],
            "odometry.angles_deg": [],
        }
        asked = {"op": "getParameters", "parameterNames": [], "id": "a"}
        assert await values(client, **asked) == whole
        few = {**asked, "parameterNames": ["autopilot.imu_message", "no.such"]}
        assert await values(client, **few) == {"autopilot.imu_message": "auto"}
        other = [{"name": "autopilot.imu_message", "value": "RAW_IMU"}, {"name": "x", "value": 1}]
        assert await values(client, op="setParameters", parameters=other, id="b") == {
            "autopilot.imu_message": "auto"
        }
        assert await values(client, **asked) == whole
        client.close()

    run(server, check)


def test_clients_cannot_publish(server):
    async def check():
        client = await connected(server)
        assert client.info["capabilities"] == ["parameters", "parametersSubscribe"]
        client.close()

    run(server, check)


def test_a_port_that_is_taken_is_told_with_a_remedy(server):
    with socket.socket() as squatter:
        squatter.bind(("127.0.0.1", 0))
        squatter.listen()
        taken = squatter.getsockname()[1]

        async def check():
            told = rf"foxglove_port: 127.0.0.1:{taken}: .*in use; choose"
            with pytest.raises(BadInput, match=told):
                await server.listen("127.0.0.1", taken)

        run(server, check)


def test_a_server_that_has_ended_is_noticed(server):
    async def check():
        client = await connected(server)
        client.close()
        server._server.stop()
        with pytest.raises((StreamClosedError, ConnectionError)):
            await FoxgloveClient.connected(server.port)
        with pytest.raises(RuntimeError, match="has ended"):
            server.show("/imu", T_NS, IMU)

    run(server, check)


def test_a_server_that_is_closed_does_not_listen(server):
    async def check():
        client = await connected(server)
        client.close()
        server.close()
        with pytest.raises(ConnectionError):
            await asyncio.open_connection("127.0.0.1", server.port)

    run(server, check)


@pytest.mark.parametrize(("unix_ns", "is_shown"), [(-1, 0), (0, 1), (2**64 - 1, 1), (2**64, 0)])
def test_only_times_that_a_message_can_have_are_shown(server, monkeypatch, unix_ns, is_shown):
    shown = []
    monkeypatch.setattr(server, "_has_readers", lambda _topic: True)
    monkeypatch.setattr(server, "_log", lambda *message: shown.append(message))
    server.show("/imu", unix_ns, IMU)
    assert len(shown) == is_shown

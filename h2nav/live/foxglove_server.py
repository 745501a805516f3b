"""The Foxglove WebSocket: the log's channels live, and the configuration as parameters."""

from collections.abc import Mapping, Sequence
from typing import Any

import foxglove
from foxglove import Channel, Context, Parameter, Schema
from foxglove.websocket import Capability, ChannelView, ServerListener

from h2nav.integrity.ratios import InnovationRatios
from h2nav.links.live_feed import FAST_TOPICS, FeedLine
from h2nav.live.guard import Guard
from h2nav.log.foxglove_messages import AttitudeMessages, log_message, protobuf_schemas
from h2nav.log.schema import RecordFormat, record_format
from h2nav.service import records

# A client that reads too slowly loses the oldest beyond this many.
BACKLOG_MESSAGES = 1024
LONGEST_NS = 2**64 - 1
# Topics with perhaps one record per flight: their channels are announced in advance.
FROM_THE_START: dict[str, type[tuple[Any, ...]]] = {
    "/imu": records.ImuRecord,
    "/estimate": records.EstimateRecord,
    "/health": records.HealthRecord,
    "/status": records.StatusRecord,
    "/comparison": records.ComparisonRecord,
    "/ratios": InnovationRatios,
    records.FINDING_TOPIC: records.FindingRecord,
    "/aiding": records.AidingRecord,
    "/rejected": records.RejectionRecord,
    "/time_sync": records.TimeSyncRecord,
}


class FoxgloveServer:
    """Publishes records to subscribed clients; clients cannot change anything.

    The library's server is behind a `Guard`, on a port of the loopback that the kernel chooses.

    Args:
        configuration: of the daemon, section -> key -> value.
    """

    def __init__(self, configuration: Mapping[str, Mapping[str, Any]]) -> None:
        self._context = Context()
        self._listener = _Listener(configuration)
        self._server = foxglove.start_server(
            name="h2nav",
            host="127.0.0.1",
            port=0,
            capabilities=[Capability.Parameters],
            server_listener=self._listener,
            context=self._context,
            message_backlog_size=BACKLOG_MESSAGES,
        )
        self._guard = Guard(self._server.port)
        self._attitude = AttitudeMessages()
        self._open: dict[str, tuple[int, records.FindingRecord]] = {}
        self._channels: dict[str, Channel] = {}
        self._formats: dict[tuple[str, type], RecordFormat] = {}
        for topic, (name, descriptors) in protobuf_schemas().items():
            self._add(topic, "protobuf", Schema(name=name, encoding="protobuf", data=descriptors))
        for topic, kind in FROM_THE_START.items():
            self._form(topic, kind)

    @property
    def port(self) -> int:
        """The listening port; 0 before."""
        return self._guard.port

    async def listen(self, host: str, port: int) -> None:
        """Starts to listen; port 0 lets the kernel choose.

        Raises:
            BadInput: the address is not available.
        """
        await self._guard.listen(host, port)

    @property
    def wants_all(self) -> bool:
        """Whether a client subscribes to a topic with a record per sample."""
        fast = (*FAST_TOPICS, "/tf", "/pose")
        return any(self._has_readers(topic) for topic in fast)

    def show(self, topic: str, unix_ns: int, record: tuple[Any, ...]) -> None:
        """Publishes a record, and for an estimate its attitude, to the subscribers.

        Raises:
            RuntimeError: the library's server has ended.
        """
        if self._guard.is_alone:
            raise RuntimeError("the Foxglove server has ended")
        if not 0 <= unix_ns <= LONGEST_NS:
            return
        if isinstance(record, FeedLine):
            if self._has_readers(topic):
                self._log(topic, log_message(unix_ns, record.severity, record.text), unix_ns)
            return
        if self._listener.take_newcomer():
            form = self._form(records.FINDING_TOPIC, records.FindingRecord)
            for since_ns, finding in self._open.values():
                self._log(records.FINDING_TOPIC, form.encode(finding), since_ns)
        if isinstance(record, records.FindingRecord):
            self._open.pop(record.id, None)
            if record.is_open:
                self._open[record.id] = unix_ns, record
        form = self._form(topic, type(record))
        if self._has_readers(topic):
            self._log(topic, form.encode(record), unix_ns)
        if isinstance(record, records.EstimateRecord):
            self._show_attitude(unix_ns, record)

    def close(self) -> None:
        """Stops listening and disconnects all clients."""
        self._guard.close()
        self._server.stop()

    def _show_attitude(self, unix_ns: int, record: records.EstimateRecord) -> None:
        q_nb = (record.q_w, record.q_x, record.q_y, record.q_z)
        if self._has_readers("/tf"):
            self._log("/tf", self._attitude.transform(unix_ns, q_nb), unix_ns)
        if self._has_readers("/pose"):
            self._log("/pose", self._attitude.pose(unix_ns, q_nb), unix_ns)

    def _form(self, topic: str, kind: type[tuple[Any, ...]]) -> RecordFormat:
        known = self._formats.get((topic, kind))
        if known is None:
            known = self._formats[topic, kind] = record_format(kind)
            schema = Schema(name=known.name, encoding="jsonschema", data=known.schema)
            self._add(topic, "json", schema)
        return known

    def _add(self, topic: str, encoding: str, schema: Schema) -> None:
        self._channels[topic] = Channel(
            topic, message_encoding=encoding, schema=schema, context=self._context
        )

    def _has_readers(self, topic: str) -> bool:
        channel = self._channels.get(topic)
        return channel is not None and channel.has_sinks()

    def _log(self, topic: str, data: bytes, unix_ns: int) -> None:
        self._channels[topic].log(data, log_time=unix_ns)


class _Listener(ServerListener):
    """Serves the configuration, read-only, and notes new subscribers of findings."""

    def __init__(self, configuration: Mapping[str, Mapping[str, Any]]) -> None:
        self._values = {
            f"{section}.{key}": Parameter(f"{section}.{key}", value=_plain(value))
            for section, keys in configuration.items()
            for key, value in keys.items()
        }
        self._has_newcomer = False

    def take_newcomer(self) -> bool:
        """Whether a client has subscribed to findings since the last call."""
        has_one, self._has_newcomer = self._has_newcomer, False
        return has_one

    def on_subscribe(self, client: object, channel: ChannelView) -> None:
        self._has_newcomer |= channel.topic == records.FINDING_TOPIC

    def on_get_parameters(
        self, client: object, param_names: list[str], request_id: str | None = None
    ) -> list[Parameter]:
        return self._named(param_names) if param_names else list(self._values.values())

    def on_set_parameters(
        self, client: object, parameters: list[Parameter], request_id: str | None = None
    ) -> list[Parameter]:
        return self._named([parameter.name for parameter in parameters])

    def _named(self, names: Sequence[str]) -> list[Parameter]:
        return [self._values[name] for name in names if name in self._values]


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value

"""A client of the Foxglove WebSocket protocol, as far as tests need one."""

import asyncio
import json
import struct
from collections.abc import Callable, Collection
from typing import Any, NamedTuple, Self

from tornado.websocket import WebSocketClientConnection, websocket_connect

WAIT_S = 20.0
SUBPROTOCOL = "foxglove.sdk.v1"
_MESSAGE_DATA = 1


class Message(NamedTuple):
    """One message of a channel."""

    topic: str
    t_ns: int
    data: bytes


class FoxgloveClient:
    """One connection.

    Attributes:
        channels: by topic, as they were advertised so far.
        info: what the server says of itself.
    """

    def __init__(self, connection: WebSocketClientConnection) -> None:
        self._connection = connection
        self.channels: dict[str, dict[str, Any]] = {}
        self.info: dict[str, Any] = {}

    @classmethod
    async def connected(cls, port: int, topics: Collection[str] = ()) -> Self:
        """A client that knows its server, and these channels of it."""
        url = f"ws://127.0.0.1:{port}/"
        client = cls(await websocket_connect(url, subprotocols=[SUBPROTOCOL]))
        client.info = await client.received()
        assert client.info["op"] == "serverInfo"
        await client.learn(topics)
        return client

    async def received(self) -> Any:
        """The next message: a mapping, or bytes."""
        message = await asyncio.wait_for(self._connection.read_message(), WAIT_S)
        assert message is not None, "the server has closed the connection"
        return json.loads(message) if isinstance(message, str) else message

    async def learn(self, topics: Collection[str]) -> None:
        """Waits until these topics are channels; what else comes is lost."""
        while not self.channels.keys() >= set(topics):
            self._take(await self.received())

    async def say(self, **words: Any) -> None:
        """Sends a message of the protocol."""
        await self._connection.write_message(json.dumps(words))

    async def subscribe(self, *topics: str) -> None:
        """Asks for messages of channels that are known."""
        numbers = [self.channels[topic]["id"] for topic in topics]
        wanted = [{"id": number, "channelId": number} for number in numbers]
        await self.say(op="subscribe", subscriptions=wanted)

    async def message(self) -> Message:
        """The next message of a channel; every channel that is new is subscribed to as well."""
        while isinstance(came := await self.received(), dict):
            known = set(self.channels)
            self._take(came)
            await self.subscribe(*(self.channels.keys() - known))
        kind, number, t_ns = struct.unpack_from("<BIQ", came)
        assert kind == _MESSAGE_DATA
        topics = {channel["id"]: topic for topic, channel in self.channels.items()}
        return Message(topics[number], t_ns, came[13:])

    def close(self) -> None:
        """Goes away."""
        self._connection.close()

    def _take(self, came: Any) -> None:
        assert came["op"] == "advertise"
        self.channels |= {channel["topic"]: channel for channel in came["channels"]}


async def until(condition: Callable[[], bool]) -> None:
    """Waits until something is so."""

    async def wait() -> None:
        while not condition():
            await asyncio.sleep(0.01)

    await asyncio.wait_for(wait(), WAIT_S)

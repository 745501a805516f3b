"""What strangers may do before a server that trusts everybody."""

import asyncio
import contextlib
import socket
import struct

import pytest

from h2nav.live import guard
from h2nav.live.guard import MAX_CONNECTIONS, MAX_SAID_BYTES, Guard

WAIT_S = 20.0
MIB = 1 << 20


class Echo:
    """A server that takes everybody: it gives back what it gets; after ``more`` it never ends.

    Attributes:
        connected: connections so far.
        given: bytes after ``more``.
    """

    def __init__(self):
        self.connected = 0
        self.given = 0
        self._writers = set()

    async def start(self):
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        return self._server.sockets[0].getsockname()[1]

    async def _serve(self, reader, writer):
        self.connected += 1
        self._writers.add(writer)
        with contextlib.suppress(ConnectionError):
            while data := await reader.read(65536):
                writer.write(data)
                await writer.drain()
                while data == b"more":
                    writer.write(bytes(65536))
                    await writer.drain()
                    self.given += 65536
        writer.close()

    async def stop(self):
        self._server.close()
        for writer in self._writers:
            writer.transport.abort()
        await asyncio.sleep(0)


@contextlib.asynccontextmanager
async def guarded():
    echo = Echo()
    standing = Guard(await echo.start())
    await standing.listen("127.0.0.1", 0)
    try:
        yield echo, standing
    finally:
        standing.close()
        await echo.stop()


async def connect(standing):
    return await asyncio.open_connection("127.0.0.1", standing.port)


async def answered(connection, word=b"hello"):
    reader, writer = connection
    writer.write(word)
    return await asyncio.wait_for(reader.readexactly(len(word)), WAIT_S)


async def hung_up(connection):
    """Reads until the end of the connection."""
    reader, _ = connection
    with contextlib.suppress(ConnectionError):
        while await asyncio.wait_for(reader.read(65536), WAIT_S):
            pass


def test_what_is_said_passes_both_ways():
    async def check():
        async with guarded() as (_, standing):
            one, other = await connect(standing), await connect(standing)
            assert await answered(one, b"one") == b"one"
            assert await answered(other, b"x" * 100_000) == b"x" * 100_000
            one[1].close()
            assert await answered(other) == b"hello"

    asyncio.run(check())


def test_there_is_room_for_so_many_and_again_when_they_have_gone():
    async def check():
        async with guarded() as (echo, standing):
            held = [await connect(standing) for _ in range(MAX_CONNECTIONS)]
            for connection in held:
                assert await answered(connection) == b"hello"
            for _ in range(200):
                await hung_up(await connect(standing))
            assert echo.connected == MAX_CONNECTIONS
            assert await answered(held[0]) == b"hello"
            held[0][1].close()
            await hung_up(held[0])
            while True:  # until the guard has noticed
                another = await connect(standing)
                with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):
                    assert await answered(another) == b"hello"
                    break

    asyncio.run(check())


def test_who_gets_no_answer_in_time_is_hung_up_on(monkeypatch):
    monkeypatch.setattr(guard, "PATIENCE_S", 0.2)

    async def check():
        async with guarded() as (_, standing):
            silent, talking = await connect(standing), await connect(standing)
            assert await answered(talking) == b"hello"
            await hung_up(silent)
            assert await answered(talking) == b"hello"

    asyncio.run(check())


def test_who_says_too_much_is_hung_up_on():
    async def check():
        async with guarded() as (_, standing):
            flooding, other = await connect(standing), await connect(standing)
            assert await answered(flooding) == b"hello"
            with contextlib.suppress(ConnectionError):
                flooding[1].write(bytes(2 * MAX_SAID_BYTES))
                await flooding[1].drain()
            await hung_up(flooding)
            assert await answered(other) == b"hello"

    asyncio.run(check())


def test_a_little_at_a_time_may_go_on(monkeypatch):
    monkeypatch.setattr(guard, "PATIENCE_S", 0.01)
    monkeypatch.setattr(guard, "SAID_WITHIN_S", 0.01)
    monkeypatch.setattr(guard, "MAX_SAID_BYTES", 100)

    async def check():
        async with guarded() as (_, standing):
            connection = await connect(standing)
            for _ in range(10):
                assert await answered(connection, b"x" * 60) == b"x" * 60
                await asyncio.sleep(0.1)

    asyncio.run(check())


def test_who_does_not_read_holds_the_server_back_and_no_memory():
    async def check():
        async with guarded() as (echo, standing):
            deaf = socket.socket()
            deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            deaf.setblocking(False)
            await asyncio.get_running_loop().sock_connect(deaf, ("127.0.0.1", standing.port))
            deaf.send(b"more")
            before = -1
            while before != echo.given or not echo.given:
                before = echo.given
                assert before < 32 * MIB  # what buffers of the kernel hold
                await asyncio.sleep(0.3)
            assert await answered(await connect(standing)) == b"hello"
            deaf.close()

    asyncio.run(check())


def test_a_connection_that_is_torn_down_ends_behind_too():
    async def check():
        async with guarded() as (echo, standing):
            for _ in range(3 * MAX_CONNECTIONS):
                connection = await connect(standing)
                assert await answered(connection) == b"hello"
                raw = connection[1].get_extra_info("socket")
                raw.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                connection[1].transport.abort()
                await asyncio.sleep(0.01)
            assert echo.connected == 3 * MAX_CONNECTIONS

    asyncio.run(check())


def test_a_server_that_is_gone_is_noticed():
    async def check():
        async with guarded() as (echo, standing):
            connection = await connect(standing)
            assert await answered(connection) == b"hello"
            await echo.stop()
            await hung_up(connection)
            assert not standing.is_alone
            await hung_up(await connect(standing))
            assert standing.is_alone

    asyncio.run(check())


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_it_listens_where_it_is_told(host):
    async def check():
        async with guarded() as (echo, _):
            another = Guard(1)
            await another.listen(host, 0)
            assert another.port > 0
            another.close()
            assert echo.connected == 0

    asyncio.run(check())

"""Frames and payloads on the level of bytes: any value in any field, with a right checksum.

Made from the dialect's tables alone, without the codec: the values that matter most are those that
an encoder would refuse.
"""

import math
import random
import struct
from typing import NamedTuple

from fastcrc import crc16

from h2nav.wire.dialect import LAYOUTS, SIZES, MessageLayout

CODES = {
    "char": "B", "uint8_t": "B", "int8_t": "b", "uint16_t": "H", "int16_t": "h", "uint32_t": "I",
    "int32_t": "i", "uint64_t": "Q", "int64_t": "q", "float": "f", "double": "d",
}  # fmt: skip
FLOATS = (
    math.nan, math.inf, -math.inf, 0.0, -0.0, 1.0, -1.0, 3.4028234e38, -3.4028234e38, 1e-45, 1e-30,
    1e-3, 0.5, 9.80665, -9.80665, math.pi, 191.0, 255.0, 511.0, 1e3, 1e6, 2147483648.0, 1e10, 1e19,
    1e20, 1e38,
)  # fmt: skip


class Field(NamedTuple):
    """One number of a payload.

    Attributes:
        name: of its field; elements of an array share it.
        offset: its first byte.
        type_name: as in the dialect.
    """

    name: str
    offset: int
    type_name: str


class RawFrame(NamedTuple):
    """A frame before it is put together.

    Attributes:
        msg_id: message id, of the dialect.
        sysid: sender's system id.
        compid: sender's component id.
        payload: of any length up to 255.
    """

    msg_id: int
    sysid: int
    compid: int
    payload: bytes

    def packed(self, seq: int = 0, version: int = 2, *, signed: bool = False) -> bytes:
        """The frame with its checksum (and a signature of zeros)."""
        head = bytes((self.sysid, self.compid))
        if version == 1:
            body = bytes((len(self.payload), seq)) + head + bytes((self.msg_id,)) + self.payload
            return b"\xfe" + body + _checksum(body, self.msg_id)
        payload = self.payload.rstrip(b"\0") or self.payload[:1]
        body = bytes((len(payload), int(signed), 0, seq)) + head
        body += self.msg_id.to_bytes(3, "little") + payload
        return b"\xfd" + body + _checksum(body, self.msg_id) + bytes(13 * signed)

    def where(self, place: Field, value: float) -> "RawFrame":
        """The frame with another value in one place."""
        payload = bytearray(self.payload.ljust(LAYOUTS[self.msg_id].size, b"\0"))
        struct.pack_into("<" + CODES[place.type_name], payload, place.offset, value)
        return self._replace(payload=bytes(payload))


def _places(layout: MessageLayout) -> tuple[Field, ...]:
    places = []
    offset = 0
    for field in layout.wire_fields:
        for _ in range(max(field.length, 1)):
            places.append(Field(field.name, offset, field.type_name))
            offset += SIZES[field.type_name]
    return tuple(places)


FIELDS = {msg_id: _places(layout) for msg_id, layout in LAYOUTS.items()}


def place(msg_id: int, name: str) -> Field:
    """The first number of a field."""
    return next(field for field in FIELDS[msg_id] if field.name == name)


def extreme(rng: random.Random, type_name: str) -> float:
    """A value at or beyond an edge of its type, or of what it usually means."""
    if type_name == "float":
        return rng.choice(FLOATS) if rng.random() < 0.8 else _any_bits(rng, "f")
    if type_name == "double":
        return rng.choice(FLOATS) if rng.random() < 0.8 else _any_bits(rng, "d")
    bits = 8 * SIZES[type_name]
    signed = type_name.startswith("int")
    least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    edges = (least, least + 1, most, most - 1, 0, 1, 2, 3, 191, (least + most) // 2)
    if rng.random() < 0.3:
        return rng.randint(least, most)
    return min(rng.choice(edges), most)


def with_extremes(rng: random.Random, frame: RawFrame, share: float) -> RawFrame:
    """At least one number becomes extreme, each of the others with probability `share`."""
    fields = FIELDS[frame.msg_id]
    payload = bytearray(frame.payload.ljust(LAYOUTS[frame.msg_id].size, b"\0"))
    certain = rng.randrange(len(fields))
    for index, (_, offset, type_name) in enumerate(fields):
        if index == certain or rng.random() < share:
            value = extreme(rng, type_name)
            struct.pack_into("<" + CODES[type_name], payload, offset, value)
    return frame._replace(payload=bytes(payload))


def random_payload(rng: random.Random, msg_id: int) -> bytes:
    """Extreme or random in every number, sometimes of another length than the dialect's."""
    size = LAYOUTS[msg_id].size
    if rng.random() < 0.5:
        payload = rng.randbytes(size)
    else:
        payload = with_extremes(rng, RawFrame(msg_id, 0, 0, bytes(size)), 0.8).payload
    if rng.random() < 0.1:
        payload = payload[: rng.randint(1, size)]
    if rng.random() < 0.05:
        payload += rng.randbytes(rng.randint(0, 255 - size))
    return payload


def _any_bits(rng: random.Random, code: str) -> float:
    (value,) = struct.unpack("<" + code, rng.randbytes(struct.calcsize(code)))
    return float(value)


def _checksum(body: bytes, msg_id: int) -> bytes:
    checksum = crc16.mcrf4xx(bytes([LAYOUTS[msg_id].crc_extra]), crc16.mcrf4xx(body))
    return checksum.to_bytes(2, "little")

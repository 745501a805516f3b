"""Decodes frames to records and encodes messages to frames, from pymavlink's dialect tables.

Decoding returns an immutable record per message: ``RAW_IMU(time_usec=..., xacc=..., ...)``, fields
named and ordered as in the dialect. Encoding takes pymavlink's own message objects.
"""

import functools
from collections import namedtuple
from collections.abc import Callable
from operator import itemgetter
from struct import Struct
from struct import error as StructError  # noqa: N812
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega

from h2nav.wire.deframer import Frame
from h2nav.wire.dialect import LAYOUTS, MessageLayout
from h2nav.wire.signing import Signer

_CODES = {
    "char": "s",
    "uint8_t": "B",
    "int8_t": "b",
    "uint16_t": "H",
    "int16_t": "h",
    "uint32_t": "I",
    "int32_t": "i",
    "uint64_t": "Q",
    "int64_t": "q",
    "float": "f",
    "double": "d",
}


def decode(frame: Frame) -> Any:
    """Decodes the fields of a frame.

    Args:
        frame: from a `Deframer`, so its id is known.

    Returns:
        A NamedTuple named after the message (its type is `record_type(frame.msg_id)`): numbers as
        int and float in the units of the dialect, arrays as tuples, texts as str up to their first
        NUL. Zero bytes that MAVLink 2 truncated are restored; extension fields that were not sent
        are zero; surplus bytes of a newer dialect are dropped. Never raises; floats may be NaN or
        infinite.
    """
    return DECODERS[frame.msg_id](frame.payload)


@functools.cache
def record_type(msg_id: int) -> type[Any]:
    """The NamedTuple class of a message id; KeyError for an unknown id."""
    layout = LAYOUTS[msg_id]
    return namedtuple(layout.name, layout.field_names)


class _Sender(ardupilotmega.MAVLink):  # type: ignore[misc]
    """pymavlink's own state of a sender."""

    seq: int

    def count(self) -> None:
        """A frame was made."""
        self.seq = (self.seq + 1) % 256


class Encoder:
    """Encodes the frames of one component and numbers them.

    Args:
        sysid: system id of the sender, 1..255.
        compid: component id of the sender, 1..255.
        version: MAVLink version of the frames, 2 or 1.
        signer: signs the frames (MAVLink 2 only); None leaves them unsigned.
    """

    def __init__(
        self, sysid: int, compid: int, version: int = 2, signer: Signer | None = None
    ) -> None:
        self._sender = _Sender(None, srcSystem=sysid, srcComponent=compid)
        self._version_1 = version == 1
        self._signer = signer

    def encode(self, message: ardupilotmega.MAVLink_message) -> bytes:
        """Encodes one frame.

        Args:
            message: an object of pymavlink's dialect, such as ``MAVLink_heartbeat_message(...)``.

        Returns:
            The frame's bytes; the next frame has the next sequence number.

        Raises:
            ValueError: a field does not fit its type on the wire; nothing is wrapped or clipped.
        """
        try:
            frame: bytes = message.pack(self._sender, force_mavlink1=self._version_1)
        except (StructError, TypeError, OverflowError) as error:
            raise ValueError(f"{message.get_type()} cannot be encoded: {error}") from error
        self._sender.count()
        return frame if self._signer is None else self._signer.signed(frame)


def _decoder(layout: MessageLayout, record: type[Any]) -> Callable[[bytes], Any]:
    """Builds the decoder of one message: payload -> record."""
    codes = (f"{field.length or ''}{_CODES[field.type_name]}" for field in layout.wire_fields)
    unpack, size, make = Struct("<" + "".join(codes)).unpack_from, layout.size, tuple.__new__
    gather = _gatherer(layout)

    def decode_payload(payload: bytes) -> Any:
        if len(payload) < size:
            payload = payload.ljust(size, b"\0")
        return make(record, gather(unpack(payload)))

    return decode_payload


def _gatherer(layout: MessageLayout) -> Callable[[tuple[Any, ...]], tuple[Any, ...]]:
    """Builds the reordering of one message: values in wire order -> fields in dialect order."""
    places: dict[str, Any] = {}  # index, or slice of an array
    texts = set()
    position = 0
    for field in layout.wire_fields:
        is_text = field.type_name == "char"
        count = 1 if is_text else max(field.length, 1)
        is_array = field.length > 0 and not is_text
        places[field.name] = slice(position, position + count) if is_array else position
        texts |= {field.name} if is_text else set()
        position += count
    picks = [(places[name], name in texts) for name in layout.field_names]
    if [place for place, _ in picks] == list(range(len(picks))) and not texts:
        return tuple
    if not texts and len(picks) > 1:
        return itemgetter(*(place for place, _ in picks))
    return lambda values: tuple(
        _text(values[place]) if is_text else values[place] for place, is_text in picks
    )


def _text(value: bytes) -> str:
    """A char array up to its first NUL; bytes that are not UTF-8 become U+FFFD."""
    return value.split(b"\0", 1)[0].decode("utf-8", errors="replace")


class _Decoders(dict[int, Callable[[bytes], Any]]):
    """Made when they are first asked for: of 300 messages a program reads some dozens."""

    def __missing__(self, msg_id: int) -> Callable[[bytes], Any]:
        made = self[msg_id] = _decoder(LAYOUTS[msg_id], record_type(msg_id))
        return made


DECODERS = _Decoders()
"""Message id -> decoder of its payload."""

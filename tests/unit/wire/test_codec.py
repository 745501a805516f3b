import math
import random
import struct

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20 import development
from wire_frames import FrameMaker, raw_imu, with_checksum

from h2nav.wire.codec import Encoder, decode, record_type
from h2nav.wire.deframer import Deframer, Frame
from h2nav.wire.dialect import LAYOUTS, MISSING_EXTENSIONS, MessageLayout
from h2nav.wire.position import GnssState
from h2nav.wire.readers import READERS

EVERY_MESSAGE = [
    pytest.param(LAYOUTS[msg_id], id=LAYOUTS[msg_id].name) for msg_id in mavlink.mavlink_map
]


def random_payload(layout: MessageLayout, rng: random.Random) -> bytes:
    """Random bytes for each field, but texts of random length without NUL inside."""
    payload = b""
    for field in layout.wire_fields:
        if field.type_name == "char":
            text = bytes(rng.randrange(1, 128) for _ in range(rng.randint(0, field.length)))
            payload += text.ljust(field.size, b"\0")
        else:
            payload += rng.randbytes(field.size)
    return payload


def frame_of(layout: MessageLayout, payload: bytes) -> bytes:
    """A MAVLink 2 frame with the zero bytes at the payload's end cut off."""
    body = payload.rstrip(b"\0") or payload[:1]
    head = bytes([0xFD, len(body), 0, 0, 0, 1, 1]) + layout.msg_id.to_bytes(3, "little")
    return with_checksum(head + body, layout.crc_extra)


def same(ours: object, theirs: object) -> bool:
    if isinstance(ours, tuple):
        return len(ours) == len(theirs) and all(map(same, ours, theirs))
    if isinstance(ours, float) and math.isnan(ours):
        return math.isnan(theirs)
    return type(ours) is type(theirs) and ours == theirs


def assert_decodes_like_pymavlink(raw: bytes) -> None:
    (frame,) = Deframer().feed(raw)
    ours = decode(frame)
    theirs = mavlink.MAVLink(None).decode(bytearray(raw))
    assert type(ours).__name__ == theirs.get_type()
    added = [field.name for field in MISSING_EXTENSIONS.get(theirs.get_type(), ())]
    assert list(ours._fields) == theirs.get_fieldnames() + added
    for name, value in zip(theirs.get_fieldnames(), ours, strict=not added):
        expected = getattr(theirs, name)
        if isinstance(value, str):
            expected = theirs.format_attr(name)
        assert same(value, expected), name


@pytest.mark.parametrize("layout", EVERY_MESSAGE)
def test_every_message_decodes_like_pymavlink(layout: MessageLayout) -> None:
    rng = random.Random(layout.msg_id)
    for _ in range(4):
        assert_decodes_like_pymavlink(frame_of(layout, random_payload(layout, rng)))


@pytest.mark.parametrize("layout", EVERY_MESSAGE)
def test_every_message_truncated_anywhere_decodes_like_pymavlink(layout: MessageLayout) -> None:
    rng = random.Random(layout.msg_id)
    payload = random_payload(layout, rng)
    for kept in {1, layout.size // 2, layout.base_size, layout.size - 1}:
        assert_decodes_like_pymavlink(frame_of(layout, payload[:kept].ljust(layout.size, b"\0")))


@pytest.mark.parametrize("layout", EVERY_MESSAGE)
def test_every_message_survives_encoding_and_decoding(layout: MessageLayout) -> None:
    rng = random.Random(layout.msg_id)
    (frame,) = Deframer().feed(frame_of(layout, random_payload(layout, rng)))
    message = mavlink.MAVLink(None).decode(bytearray(frame.raw))
    (again,) = Deframer().feed(Encoder(1, 1).encode(message))
    known = len(message.get_fieldnames())  # without extensions that pymavlink lacks
    assert same(decode(again)[:known], decode(frame)[:known])


def test_a_message_that_the_dialect_does_not_have_yet_decodes_like_its_definition() -> None:
    """GNSS_INTEGRITY, an enumerator of the future included."""
    message = development.MAVLink_gnss_integrity_message(1, 8, 3, 2, 9, 1, 120, 250, 4, 5, 6, 7)
    packed = message.pack(development.MAVLink(None, srcSystem=1, srcComponent=1))
    (frame,) = Deframer().feed(bytes(packed))
    assert tuple(decode(frame)) == (1, 8, 3, 2, 9, 1, 120, 250, 4, 5, 6, 7)
    assert list(decode(frame)._fields) == message.fieldnames
    assert READERS[frame.msg_id](decode(frame)) == GnssState(1, 2, 9)


def test_record_is_named_and_ordered_as_the_dialect() -> None:
    (frame,) = Deframer().feed(FrameMaker().frame(raw_imu(7)))
    fields = decode(frame)
    assert repr(fields) == (
        "RAW_IMU(time_usec=7, xacc=1, yacc=-2, zacc=-1000, xgyro=4, ygyro=5, zgyro=-6, "
        "xmag=70, ymag=80, zmag=-90, id=0, temperature=2500)"
    )
    assert type(fields) is record_type(frame.msg_id)


def test_mavlink_1_frame_has_zero_extensions() -> None:
    full = FrameMaker().frame(raw_imu(7), version=1)
    base = with_checksum(bytes([0xFE, 26]) + full[2:6] + full[6:32], LAYOUTS[27].crc_extra)
    (frame,) = Deframer().feed(base)
    assert decode(frame)[:10] == (7, 1, -2, -1000, 4, 5, -6, 70, 80, -90)
    assert decode(frame)[10:] == (0, 0)


def test_text_ends_at_its_first_nul_and_may_be_no_text_at_all() -> None:
    def text_of(raw: bytes) -> str:
        return decode(Frame(253, 1, 1, 0, b"\6" + raw, 2, False, b"")).text

    assert text_of(b"Ready\0rubbish") == "Ready"
    assert text_of(b"x" * 50) == "x" * 50
    assert text_of(b"25 \xc2\xb0C") == "25 °C"
    assert text_of(b"\xff\xfe!") == "\ufffd\ufffd!"


def test_surplus_of_a_newer_dialect_is_dropped() -> None:
    payload = struct.pack("<Q9hBh", 7, *range(9), 0, 2500)
    fields = decode(Frame(27, 1, 1, 0, payload + b"new", 2, False, b""))
    assert fields.time_usec == 7
    assert fields.temperature == 2500


def test_encoder_counts_its_frames() -> None:
    encoder = Encoder(42, 191)
    numbers = []
    for number in range(258):
        (frame,) = Deframer().feed(encoder.encode(raw_imu(number)))
        assert (frame.sysid, frame.compid, frame.version) == (42, 191, 2)
        numbers.append(frame.seq)
    assert numbers == [*range(256), 0, 1]


def test_encoder_of_mavlink_1() -> None:
    (frame,) = Deframer().feed(Encoder(1, 1, version=1).encode(raw_imu(7)))
    assert frame.version == 1
    assert decode(frame).time_usec == 7


@pytest.mark.parametrize("value", [40000, 1.5, None])
def test_value_that_does_not_fit_is_refused_not_wrapped(value: object) -> None:
    message = raw_imu(7)
    message.xacc = value
    encoder = Encoder(1, 191)
    with pytest.raises(ValueError, match="RAW_IMU cannot be encoded"):
        encoder.encode(message)
    (frame,) = Deframer().feed(encoder.encode(raw_imu(7)))
    assert frame.seq == 0


def test_a_float_that_does_not_fit_is_refused_too() -> None:
    message = mavlink.MAVLink_named_value_float_message(0, b"large", 1e39)
    with pytest.raises(ValueError, match="NAMED_VALUE_FLOAT cannot be encoded"):
        Encoder(1, 191).encode(message)

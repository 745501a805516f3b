"""The MAVLink dialect as tables: the wire layout of each known message id.

The source is pymavlink's generated dialect; only extension fields that it documents but lacks in
its tables are added here.
"""

from typing import NamedTuple

from fastcrc import crc16
from pymavlink.dialects.v20 import ardupilotmega

SIZES = {
    "char": 1,
    "uint8_t": 1,
    "int8_t": 1,
    "uint16_t": 2,
    "int16_t": 2,
    "uint32_t": 4,
    "int32_t": 4,
    "uint64_t": 8,
    "int64_t": 8,
    "float": 4,
    "double": 8,
}
"""Bytes of one element of each field type."""

_SHORTEST_FRAME = 8  # a MAVLink 1 frame around an empty payload


class WireField(NamedTuple):
    """One field of a message."""

    name: str  # as in the dialect
    type_name: str  # element type, a key of `SIZES`
    length: int  # elements of an array (characters of a text); 0 for a scalar

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        return SIZES[self.type_name] * max(self.length, 1)


class MessageLayout(NamedTuple):
    """One message of the dialect."""

    msg_id: int  # message id
    name: str  # such as ``RAW_IMU``
    wire_fields: tuple[WireField, ...]  # fields in the order of the wire
    field_names: tuple[str, ...]  # fields in the order of the dialect's definition
    size: int  # payload bytes of all fields, extensions included
    base_size: int  # payload bytes without the MAVLink 2 extension fields (never too large)
    crc_extra: int  # the byte that ends every checksum of this message
    # the payload has room for foreign bytes (file transfer, tunnel, log data), so it may
    # legitimately contain whole MAVLink frames
    carries_bytes: bool


# Extension fields follow all others, and no checksum depends on them.
MISSING_EXTENSIONS: dict[str, tuple[WireField, ...]] = {
    "TIMESYNC": (
        WireField("target_system", "uint8_t", 0),
        WireField("target_component", "uint8_t", 0),
    )
}


def _layout(message: type[ardupilotmega.MAVLink_message]) -> MessageLayout:
    types = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    fields = tuple(
        WireField(name, types[name], length)
        for name, length in zip(message.ordered_fieldnames, message.array_lengths, strict=True)
    )
    known = {field.name for field in fields}
    missing = [f for f in MISSING_EXTENSIONS.get(message.msgname, ()) if f.name not in known]
    fields += tuple(missing)
    return MessageLayout(
        msg_id=message.id,
        name=message.msgname,
        wire_fields=fields,
        field_names=(*message.fieldnames, *(field.name for field in missing)),
        size=sum(field.size for field in fields),
        base_size=_base_size(message.msgname, fields, message.crc_extra),
        crc_extra=message.crc_extra,
        carries_bytes=any(
            field.type_name in ("uint8_t", "int8_t") and field.length >= _SHORTEST_FRAME
            for field in fields
        ),
    )


def _base_size(name: str, fields: tuple[WireField, ...], crc_extra: int) -> int:
    """Payload bytes without extension fields.

    The generated tables do not mark extensions, but CRC_EXTRA is a checksum over the definition of
    the base fields alone: the shortest prefix of the fields that reproduces it ends before the
    extensions. A chance match (3 of 301 messages) is shorter than the truth, so checks that use
    this size become more lenient, never stricter.
    """
    checksum = crc16.mcrf4xx(f"{name} ".encode())
    size = 0
    for field in fields:
        checksum = crc16.mcrf4xx(f"{field.type_name} {field.name} ".encode(), checksum)
        if field.length:
            checksum = crc16.mcrf4xx(bytes([field.length]), checksum)
        size += field.size
        if (checksum & 0xFF) ^ (checksum >> 8) == crc_extra:
            return size
    raise AssertionError(f"{name}: CRC_EXTRA {crc_extra} fits no prefix of its fields")


GNSS_INTEGRITY_ID = 441
# Messages of MAVLink's common definitions that the generated dialect does not have yet, with their
# fields in the order of the wire.
_NEWER = (
    MessageLayout(
        msg_id=GNSS_INTEGRITY_ID,
        name="GNSS_INTEGRITY",
        wire_fields=(
            WireField("system_errors", "uint32_t", 0),
            WireField("raim_hfom", "uint16_t", 0),
            WireField("raim_vfom", "uint16_t", 0),
            WireField("id", "uint8_t", 0),
            WireField("authentication_state", "uint8_t", 0),
            WireField("jamming_state", "uint8_t", 0),
            WireField("spoofing_state", "uint8_t", 0),
            WireField("raim_state", "uint8_t", 0),
            WireField("corrections_quality", "uint8_t", 0),
            WireField("system_status_summary", "uint8_t", 0),
            WireField("gnss_signal_quality", "uint8_t", 0),
            WireField("post_processing_quality", "uint8_t", 0),
        ),
        field_names=(
            "id",
            "system_errors",
            "authentication_state",
            "jamming_state",
            "spoofing_state",
            "raim_state",
            "raim_hfom",
            "raim_vfom",
            "corrections_quality",
            "system_status_summary",
            "gnss_signal_quality",
            "post_processing_quality",
        ),
        size=17,
        base_size=17,
        crc_extra=169,
        carries_bytes=False,
    ),
)

LAYOUTS: dict[int, MessageLayout] = {layout.msg_id: layout for layout in _NEWER} | {
    msg_id: _layout(message) for msg_id, message in ardupilotmega.mavlink_map.items()
}
"""Every message of the dialect, and of newer ones, by id."""

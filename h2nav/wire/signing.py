"""MAVLink 2 signing: which frames are admitted, and how ours are signed; no I/O and no clock.

A signature is the last 13 bytes of a frame: link id, time stamp (48 bits, 10 us since 2015-01-01
UTC), and the first 48 bits of SHA-256 over the key and all of the frame before them. A stream is
what one (system id, component id, link id) sends; its stamps only grow.

Source: https://mavlink.io/en/guide/message_signing.html
"""

import hashlib
import hmac
from collections.abc import Callable, Set
from enum import StrEnum
from struct import Struct

from fastcrc import crc16

from h2nav.wire.deframer import CHECKSUM_SIZE, SIGNATURE_SIZE, SIGNED_FLAG, Frame
from h2nav.wire.dialect import LAYOUTS

KEY_SIZE = 32
EPOCH_UNIX_NS = 1_420_070_400_000_000_000  # 2015-01-01 UTC
NS_PER_STAMP = 10_000
STAMPS_PER_S = 100_000
LARGEST_STAMP = 2**48 - 1
NEW_STREAM_BEHIND = 60 * STAMPS_PER_S
"""How far a new stream may be behind our own stamp: one minute."""
MOST_STREAMS = 256
SETUP_SIGNING_ID = 256

_MARKER_2 = 0xFD
_FLAGS_AT = 2
_SYSID_AT = 5
_ID_AT = slice(7, 10)
_STAMP_SIZE = 6
_HASH_SIZE = 6
_UNPACK_SIGNATURE = Struct("<BIH6s").unpack_from  # link id, stamp in two parts, hash

Stream = tuple[int, int, int]
"""System id, component id, link id."""


class Refusal(StrEnum):
    """Why a frame is refused while signing is on; also the names of its counters."""

    MAVLINK_1 = "mavlink_1"
    UNSIGNED = "unsigned"
    SETUP_SIGNING = "setup_signing"
    BAD_SIGNATURE = "bad_signature"
    REFLECTED = "reflected"
    REPLAYED = "replayed"
    OLD_STAMP = "old_stamp"
    TOO_MANY_STREAMS = "too_many_streams"


def stamp_at(unix_ns: int) -> int:
    """The time stamp of a UNIX time, 10 us since 2015-01-01 UTC; 0 for times before."""
    return min(max(unix_ns - EPOCH_UNIX_NS, 0) // NS_PER_STAMP, LARGEST_STAMP)


def without_signature(raw: bytes) -> bytes:
    """A whole frame of a known id as it would be unsigned, with the checksum that it then has.

    For recordings: whoever finds a signature in one can try passphrases on it.
    """
    if raw[0] != _MARKER_2 or not raw[_FLAGS_AT] & SIGNED_FLAG:
        return raw
    return _with_flags(raw[: -CHECKSUM_SIZE - SIGNATURE_SIZE], 0)


class LocalStamp:
    """Our own time stamp: never behind the clock, never behind what was used or heard.

    Args:
        unix_ns: reads the host's clock, which may be wrong and may be set while we run.
        at_least: stamps that are given out are greater than this one.
    """

    def __init__(self, unix_ns: Callable[[], int], at_least: int = 0) -> None:
        self._unix_ns = unix_ns
        self._latest = at_least

    @property
    def latest(self) -> int:
        """The greatest stamp given out or heard."""
        return self._latest

    @property
    def ahead_s(self) -> float:
        """By how much the stamps have run ahead of the host's clock; 0 while they follow it."""
        return (self.current() - stamp_at(self._unix_ns())) / STAMPS_PER_S

    def current(self) -> int:
        """What a stamp given out now would be at least."""
        return max(self._latest, stamp_at(self._unix_ns()))

    def next(self) -> int:
        """A stamp for one frame, greater than all before.

        At `LARGEST_STAMP`, which no clock reaches before 2104, it stays, and receivers refuse.
        """
        self._latest = min(max(self._latest + 1, stamp_at(self._unix_ns())), LARGEST_STAMP)
        return self._latest

    def follow(self, stamp: int) -> None:
        """Takes over the stamp of a frame that was signed with the key, if it is greater."""
        self._latest = max(self._latest, stamp)


class Signer:
    """Signs what one link sends.

    Attributes:
        streams: that it has signed for.

    Args:
        key: 32 bytes.
        link_id: 0..255; no other link with the same system and component id may have it.
        stamp: of this host.
    """

    def __init__(self, key: bytes, link_id: int, stamp: LocalStamp) -> None:
        self.streams: set[Stream] = set()
        self._keyed = hashlib.sha256(key)
        self._link_id = link_id
        self._stamp = stamp

    def signed(self, raw: bytes) -> bytes:
        """An unsigned MAVLink 2 frame of a known id with signature, stamped later than the last."""
        self.streams.add((raw[_SYSID_AT], raw[_SYSID_AT + 1], self._link_id))
        stamp = self._stamp.next().to_bytes(_STAMP_SIZE, "little")
        frame = _with_flags(raw[:-CHECKSUM_SIZE], SIGNED_FLAG) + bytes((self._link_id,)) + stamp
        return frame + _digest(self._keyed, frame)


class SignatureChecker:
    """Decides on each frame of a link whose traffic must be signed.

    The table of streams holds `MOST_STREAMS`; only a key holder gets into it. When it is full,
    streams more than a minute behind our stamp are forgotten (what they have sent would be refused
    as `OLD_STAMP`), and where there are none, new streams are refused; known ones go on.

    Args:
        key: 32 bytes.
        stamp: of this host; it follows the frames that are admitted.
        accept_unsigned: ids of the messages that are taken without a signature, of either MAVLink
            version (the firmware of SiK radios cannot sign its RADIO_STATUS).
        own_streams: ours; what comes back of them is refused.
    """

    def __init__(
        self,
        key: bytes,
        stamp: LocalStamp,
        accept_unsigned: frozenset[int] = frozenset(),
        own_streams: Set[Stream] = frozenset(),
    ) -> None:
        self._keyed = hashlib.sha256(key)
        self._stamp = stamp
        self._accept_unsigned = accept_unsigned
        self._own_streams = own_streams
        self._latest: dict[Stream, int] = {}

    @property
    def streams(self) -> int:
        """Streams that are known."""
        return len(self._latest)

    def would_admit(self, frame: Frame) -> bool:
        """Whether `admit` would take a frame; changes nothing."""
        return self.objection(frame) is None

    def would_answer(self, frame: Frame) -> bool:
        """Whether our frames should go to where a frame came from; changes nothing.

        Beside senders that are admitted it means those whose clock is behind, as that of an
        autopilot before its first GPS fix is: they are admitted after they have heard our stamp.
        """
        return frame.signed and self.objection(frame) in (None, Refusal.OLD_STAMP)

    def admit(self, frame: Frame) -> Refusal | None:
        """Takes a frame, which moves its stream and our own stamp on, or refuses it."""
        objection = self.objection(frame)
        if objection is None and frame.signed:
            stream, stamp, _ = _signature(frame)
            if stream not in self._latest:
                self._make_room()
            self._latest[stream] = stamp
            self._stamp.follow(stamp)
        return objection

    def objection(self, frame: Frame) -> Refusal | None:
        """Why `admit` would refuse a frame, None if it would not; changes nothing."""
        if frame.msg_id == SETUP_SIGNING_ID:
            return Refusal.SETUP_SIGNING
        if not frame.signed:
            if frame.msg_id in self._accept_unsigned:
                return None
            return Refusal.MAVLINK_1 if frame.version == 1 else Refusal.UNSIGNED
        stream, stamp, digest = _signature(frame)
        if not hmac.compare_digest(_digest(self._keyed, frame.raw[:-_HASH_SIZE]), digest):
            return Refusal.BAD_SIGNATURE
        return self._stamp_objection(stream, stamp)

    def _stamp_objection(self, stream: Stream, stamp: int) -> Refusal | None:
        """What is wrong with the stamp of a frame whose signature is right."""
        if stream in self._own_streams:
            return Refusal.REFLECTED
        latest = self._latest.get(stream)
        if latest is not None:
            return None if stamp > latest else Refusal.REPLAYED
        if stamp < self._oldest_new():
            return Refusal.OLD_STAMP
        if len(self._latest) < MOST_STREAMS or min(self._latest.values()) < self._oldest_new():
            return None
        return Refusal.TOO_MANY_STREAMS

    def _make_room(self) -> None:
        """Forgets streams that could not come back with anything that they have sent."""
        if len(self._latest) < MOST_STREAMS:
            return
        oldest = self._oldest_new()
        self._latest = {stream: at for stream, at in self._latest.items() if at >= oldest}

    def _oldest_new(self) -> int:
        """The oldest stamp that a new stream may begin with."""
        return self._stamp.current() - NEW_STREAM_BEHIND


def _signature(frame: Frame) -> tuple[Stream, int, bytes]:
    """Stream, stamp and hash that a signed frame claims to have."""
    raw = frame.raw
    link_id, low, high, digest = _UNPACK_SIGNATURE(raw, len(raw) - SIGNATURE_SIZE)
    return (frame.sysid, frame.compid, link_id), low | high << 32, digest


def _digest(keyed: "hashlib._Hash", content: bytes) -> bytes:
    """The hash of a signature, from one that has taken the key in already."""
    hashed = keyed.copy()
    hashed.update(content)
    return hashed.digest()[:_HASH_SIZE]


def _with_flags(body: bytes, flags: int) -> bytes:
    """Header and payload of a MAVLink 2 frame with other flags and the checksum that fits them."""
    crc_extra = LAYOUTS[int.from_bytes(body[_ID_AT], "little")].crc_extra
    body = body[:_FLAGS_AT] + bytes((flags,)) + body[_FLAGS_AT + 1 :]
    checksum = crc16.mcrf4xx(bytes((crc_extra,)), crc16.mcrf4xx(body[1:]))
    return body + checksum.to_bytes(CHECKSUM_SIZE, "little")

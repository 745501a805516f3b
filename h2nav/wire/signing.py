"""MAVLink 2 signing: admits signed frames and signs outgoing ones; no I/O and no clock.

A signature is the last 13 bytes of a frame: link id, time stamp (48 bits, 10 us since 2015-01-01
UTC), and the first 48 bits of SHA-256 over the key and the rest of the frame. A stream is the
traffic of one (system id, component id, link id); its stamps only increase.

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
"""The accepted lag of a new stream behind the local stamp: one minute."""
MAX_STREAMS = 256
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


class Denial(StrEnum):
    """Why a frame is rejected while signing is on; also the names of its counters."""

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
    """Removes the signature of a frame and updates its checksum.

    For recordings: a recorded signature would allow passphrases to be tried offline.
    """
    if raw[0] != _MARKER_2 or not raw[_FLAGS_AT] & SIGNED_FLAG:
        return raw
    return _with_flags(raw[: -CHECKSUM_SIZE - SIGNATURE_SIZE], 0)


class LocalStamp:
    """The local time stamp: never behind the clock, never behind a used or received stamp.

    Args:
        unix_ns: reads the host's clock, which may be wrong or set while running.
        at_least: issued stamps are greater than this one.
    """

    def __init__(self, unix_ns: Callable[[], int], at_least: int = 0) -> None:
        self._unix_ns = unix_ns
        self._latest = at_least

    @property
    def latest(self) -> int:
        """The greatest stamp issued or received."""
        return self._latest

    @property
    def ahead_s(self) -> float:
        """How far the stamps have run ahead of the host's clock; 0 while they follow it."""
        return (self.current() - stamp_at(self._unix_ns())) / STAMPS_PER_S

    def current(self) -> int:
        """The least value of the next stamp."""
        return max(self._latest, stamp_at(self._unix_ns()))

    def next(self) -> int:
        """Issues a stamp for one frame, greater than all before.

        It stops at `LARGEST_STAMP`, which no clock reaches before 2104; receivers then reject.
        """
        self._latest = min(max(self._latest + 1, stamp_at(self._unix_ns())), LARGEST_STAMP)
        return self._latest

    def follow(self, stamp: int) -> None:
        """Adopts the stamp of a frame that was signed with the key, if it is greater."""
        self._latest = max(self._latest, stamp)


class Signer:
    """Signs the outgoing frames of one link.

    Args:
        key: 32 bytes.
        link_id: 0..255; unique among links with the same system and component id.
    """

    def __init__(self, key: bytes, link_id: int, stamp: LocalStamp) -> None:
        self.streams: set[Stream] = set()  # for which it has signed
        self._keyed = hashlib.sha256(key)
        self._link_id = link_id
        self._stamp = stamp

    def signed(self, raw: bytes) -> bytes:
        """Signs an unsigned MAVLink 2 frame of a known id, stamped later than the last."""
        self.streams.add((raw[_SYSID_AT], raw[_SYSID_AT + 1], self._link_id))
        stamp = self._stamp.next().to_bytes(_STAMP_SIZE, "little")
        frame = _with_flags(raw[:-CHECKSUM_SIZE], SIGNED_FLAG) + bytes((self._link_id,)) + stamp
        return frame + _digest(self._keyed, frame)


class SignatureChecker:
    """Checks each frame of a link whose traffic must be signed.

    The table of streams holds `MAX_STREAMS`; only a key holder can add to it. When it is full,
    streams more than a minute behind the local stamp are forgotten (their old frames would be
    rejected as `OLD_STAMP`); if there are none, new streams are rejected and known ones continue.

    Args:
        key: 32 bytes.
        stamp: of this host; it follows the admitted frames.
        accept_unsigned: ids of messages accepted without a signature, of either MAVLink version
            (the firmware of SiK radios cannot sign its RADIO_STATUS).
        own_streams: of this host; frames that return on them are rejected.
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
        """Number of known streams."""
        return len(self._latest)

    def would_admit(self, frame: Frame) -> bool:
        """Whether `admit` would accept a frame; changes nothing."""
        return self.objection(frame) is None

    def would_answer(self, frame: Frame) -> bool:
        """Whether outgoing frames may go to the sender of a frame; changes nothing.

        Besides admitted senders this includes those with a slow clock, such as an autopilot before
        its first GPS fix: they are admitted once they have received the local stamp.
        """
        return frame.signed and self.objection(frame) in (None, Denial.OLD_STAMP)

    def admit(self, frame: Frame) -> Denial | None:
        """Admits a frame and advances its stream and the local stamp, or returns a refusal."""
        objection = self.objection(frame)
        if objection is None and frame.signed:
            stream, stamp, _ = _signature(frame)
            if stream not in self._latest:
                self._make_room()
            self._latest[stream] = stamp
            self._stamp.follow(stamp)
        return objection

    def objection(self, frame: Frame) -> Denial | None:
        """Why `admit` would reject a frame; None if it would not. Changes nothing."""
        if frame.msg_id == SETUP_SIGNING_ID:
            return Denial.SETUP_SIGNING
        if not frame.signed:
            if frame.msg_id in self._accept_unsigned:
                return None
            return Denial.MAVLINK_1 if frame.version == 1 else Denial.UNSIGNED
        stream, stamp, digest = _signature(frame)
        if not hmac.compare_digest(_digest(self._keyed, frame.raw[:-_HASH_SIZE]), digest):
            return Denial.BAD_SIGNATURE
        return self._stamp_objection(stream, stamp)

    def _stamp_objection(self, stream: Stream, stamp: int) -> Denial | None:
        """What is wrong with the stamp of a frame whose signature matches."""
        if stream in self._own_streams:
            return Denial.REFLECTED
        latest = self._latest.get(stream)
        if latest is not None:
            return None if stamp > latest else Denial.REPLAYED
        if stamp < self._oldest_new():
            return Denial.OLD_STAMP
        if len(self._latest) < MAX_STREAMS or min(self._latest.values()) < self._oldest_new():
            return None
        return Denial.TOO_MANY_STREAMS

    def _make_room(self) -> None:
        """Forgets streams whose old frames would be rejected anyway."""
        if len(self._latest) < MAX_STREAMS:
            return
        oldest = self._oldest_new()
        self._latest = {stream: at for stream, at in self._latest.items() if at >= oldest}

    def _oldest_new(self) -> int:
        """The oldest stamp with which a new stream may begin."""
        return self._stamp.current() - NEW_STREAM_BEHIND


def _signature(frame: Frame) -> tuple[Stream, int, bytes]:
    """The stream, stamp and hash that a signed frame claims."""
    raw = frame.raw
    link_id, low, high, digest = _UNPACK_SIGNATURE(raw, len(raw) - SIGNATURE_SIZE)
    return (frame.sysid, frame.compid, link_id), low | high << 32, digest


def _digest(keyed: "hashlib._Hash", content: bytes) -> bytes:
    """The hash of a signature; `keyed` already contains the key."""
    hashed = keyed.copy()
    hashed.update(content)
    return hashed.digest()[:_HASH_SIZE]


def _with_flags(body: bytes, flags: int) -> bytes:
    """Header and payload of a MAVLink 2 frame with other flags and the matching checksum."""
    crc_extra = LAYOUTS[int.from_bytes(body[_ID_AT], "little")].crc_extra
    body = body[:_FLAGS_AT] + bytes((flags,)) + body[_FLAGS_AT + 1 :]
    checksum = crc16.mcrf4xx(bytes((crc_extra,)), crc16.mcrf4xx(body[1:]))
    return body + checksum.to_bytes(CHECKSUM_SIZE, "little")

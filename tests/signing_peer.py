"""The other side of a signed link: pymavlink's own signer and verifier, and a clock by hand."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from wire_frames import raw_imu

from h2nav.wire.deframer import Deframer, Frame
from h2nav.wire.signing import EPOCH_UNIX_NS, NS_PER_STAMP

KEY = bytes(range(32))
NOW_STAMP = 37_000_000_000_000  # in 2026


class Clock:
    """The host's UNIX clock, set by the test in stamps of 10 us."""

    def __init__(self, stamp: int = NOW_STAMP) -> None:
        self.stamp = stamp

    def __call__(self) -> int:
        return EPOCH_UNIX_NS + self.stamp * NS_PER_STAMP


class Peer:
    """A component that signs with pymavlink, and verifies what it hears with pymavlink.

    Args:
        key: 32 bytes.
        stamp: of its first frame.
        link_id: of its signatures.
    """

    def __init__(
        self,
        key: bytes = KEY,
        stamp: int = NOW_STAMP,
        link_id: int = 3,
        ids: tuple[int, int] = (1, 1),
    ) -> None:
        self.mav = mavlink.MAVLink(None, srcSystem=ids[0], srcComponent=ids[1])
        self.mav.robust_parsing = True
        signing = self.mav.signing
        signing.secret_key, signing.link_id, signing.timestamp = key, link_id, stamp
        signing.sign_outgoing = True
        self._number = 0

    def raw(self, message=None, *, signed: bool = True, version: int = 2) -> bytes:
        """A frame; by default a RAW_IMU that no other number has."""
        self._number += 1
        self.mav.signing.sign_outgoing = signed
        message = message or raw_imu(self._number)
        return message.pack(self.mav, force_mavlink1=version == 1)

    def frame(self, message=None, **how) -> Frame:
        """The same as the deframer gives it out."""
        return frame_of(self.raw(message, **how))

    def believes(self, raw: bytes) -> bool:
        """Whether pymavlink takes a frame for signed with its key, and its stamp for new."""
        (message,) = self.mav.parse_buffer(raw)
        return message.get_type() != "BAD_DATA"


def frame_of(raw: bytes) -> Frame:
    """The one frame in `raw`."""
    deframer = Deframer()
    (frame,) = [*deframer.feed(raw), *deframer.flush()]
    return frame

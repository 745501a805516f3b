"""MAVLink frames and damaged streams for tests, made without the code under test."""

import random

from pymavlink.dialects.v20 import ardupilotmega as mavlink


class FrameMaker:
    """Makes frames with pymavlink itself.

    Args:
        sysid: sender's system id.
        compid: sender's component id.
    """

    def __init__(self, sysid: int = 1, compid: int = 1) -> None:
        self._sender = mavlink.MAVLink(None, srcSystem=sysid, srcComponent=compid)

    def frame(self, message, *, version: int = 2, signed: bool = False) -> bytes:
        signing = self._sender.signing
        signing.secret_key = b"k" * 32
        signing.sign_outgoing = signed
        raw = message.pack(self._sender, force_mavlink1=version == 1)
        self._sender.seq = (self._sender.seq + 1) % 256
        return raw

    def raw_imu(self, number: int, **how) -> bytes:
        return self.frame(raw_imu(number), **how)


def raw_imu(number: int):
    """A RAW_IMU message that no other number has."""
    return mavlink.MAVLink_raw_imu_message(number, 1, -2, -1000, 4, 5, -6, 70, 80, -90, 0, 2500)


def highres_imu(number: int):
    return mavlink.MAVLink_highres_imu_message(
        number, 0.1, 0.2, -9.8, 1e-3, -2e-3, 3e-3, 0.2, 0.0, 0.4, 1013.25, 0.0, 584.0, 35.0, 0xFFFF
    )


def with_checksum(head_and_payload: bytes, crc_extra: int) -> bytes:
    """Header and payload as they stand, completed by their right checksum."""
    checksum = mavlink.x25crc(head_and_payload[1:] + bytes([crc_extra])).crc
    return head_and_payload + checksum.to_bytes(2, "little")


def drop_bytes(frames: list[bytes], count: int, rng: random.Random) -> tuple[bytes, list[bytes]]:
    """The stream of `frames` without `count` random bytes, and the frames that stayed whole."""
    stream = b"".join(frames)
    gone = set(rng.sample(range(len(stream)), count))
    left = bytes(byte for place, byte in enumerate(stream) if place not in gone)
    return left, _untouched(frames, gone)


def flip_bits(frames: list[bytes], count: int, rng: random.Random) -> tuple[bytes, list[bytes]]:
    """The stream of `frames` with a random bit of `count` random bytes inverted, and as above."""
    stream = bytearray(b"".join(frames))
    hit = set(rng.sample(range(len(stream)), count))
    for place in hit:
        stream[place] ^= 1 << rng.randrange(8)
    return bytes(stream), _untouched(frames, hit)


def _untouched(frames: list[bytes], places: set[int]) -> list[bytes]:
    kept = []
    start = 0
    for frame in frames:
        stop = start + len(frame)
        if places.isdisjoint(range(start, stop)):
            kept.append(frame)
        start = stop
    return kept

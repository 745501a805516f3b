import itertools
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from signing_peer import Peer
from wire_frames import raw_imu

from h2nav.wire.deframer import Deframer
from h2nav.wire.key_blanker import KeyBlanker

SECRET = bytes(range(200, 232))


def setup(secret: bytes = SECRET):
    return mavlink.MAVLink_setup_signing_message(1, 1, list(secret), 37_000_000_000_000)


def blanked(stream: bytes, cuts: list[int]) -> bytes:
    blanker, places = KeyBlanker(), [0, *sorted(cuts), len(stream)]
    pieces = [stream[a:b] for a, b in itertools.pairwise(places)]
    given_out = [blanker.blanked(piece) for piece in pieces]
    assert [len(piece) for piece in given_out] == [len(piece) for piece in pieces]
    return b"".join(given_out)


@given(st.data(), st.booleans())
def test_a_key_is_blanked_however_the_stream_is_cut(data: st.DataObject, signed: bool) -> None:
    peer = Peer()
    before, secret, after = peer.raw(), peer.raw(setup(), signed=signed), peer.raw()
    stream = before + secret + after
    cuts = data.draw(st.lists(st.integers(0, len(stream))))
    out = blanked(stream, cuts)
    key_at = len(before) + 20
    assert out[key_at : key_at + 32] == bytes(32)
    assert out[:key_at] + SECRET + out[key_at + 32 :] == stream


@pytest.mark.parametrize("zeros", [1, 20, 31])
def test_a_key_whose_last_zeros_are_cut_off_is_blanked(zeros: int) -> None:
    secret = SECRET[:-zeros] + bytes(zeros)
    raw = Peer().raw(setup(secret))
    assert secret[: 32 - zeros] not in blanked(raw, [])


def test_a_key_in_a_damaged_frame_is_blanked() -> None:
    raw = bytearray(Peer().raw(setup()))
    raw[-15] ^= 1  # of the checksum
    assert SECRET not in blanked(bytes(raw), [])


def test_the_frames_around_it_are_read_as_before() -> None:
    peer = Peer()
    frames = [peer.raw(), peer.raw(setup()), peer.raw(), peer.raw(setup()), peer.raw()]
    found = Deframer().feed(blanked(b"".join(frames), list(range(0, 300, 7))))
    assert [frame.raw for frame in found] == frames[::2]


def test_everything_else_stays_as_it_is() -> None:
    rng, peer = random.Random(4), Peer()
    stream = b"".join(
        peer.raw(raw_imu(number)) + rng.randbytes(rng.randrange(40)) + b"\xfd" * rng.randrange(5)
        for number in range(2000)
    )
    assert blanked(stream, [rng.randrange(len(stream)) for _ in range(1000)]) == stream

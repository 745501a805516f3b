"""Signing against pymavlink's own signer and verifier."""

import hashlib
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from signing_peer import KEY, NOW_STAMP, Clock, Peer, frame_of
from wire_frames import raw_imu

from h2nav.wire.codec import Encoder
from h2nav.wire.deframer import Deframer
from h2nav.wire.signing import (
    EPOCH_UNIX_NS,
    LARGEST_STAMP,
    MAX_STREAMS,
    NEW_STREAM_BEHIND,
    Denial,
    LocalStamp,
    SignatureChecker,
    Signer,
    stamp_at,
    without_signature,
)

RADIO_STATUS = mavlink.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7)


def checker(stamp: LocalStamp | None = None, **options) -> SignatureChecker:
    return SignatureChecker(KEY, stamp or LocalStamp(Clock()), **options)


def signing_encoder(clock: Clock, link_id: int = 5) -> tuple[Encoder, Signer]:
    signer = Signer(KEY, link_id, LocalStamp(clock))
    return Encoder(1, 191, signer=signer), signer


# --- what comes in ------------------------------------------------------------------------------


def test_what_pymavlink_signs_is_admitted() -> None:
    ours, peer = checker(), Peer()
    assert [ours.admit(peer.frame()) for _ in range(100)] == [None] * 100
    assert ours.streams == 1


def test_another_key_is_a_bad_signature() -> None:
    assert checker().admit(Peer(key=b"x" * 32).frame()) is Denial.BAD_SIGNATURE


@given(st.data())
def test_no_single_bit_of_a_signed_frame_can_be_changed(data: st.DataObject) -> None:
    raw = bytearray(Peer().raw())
    bit = data.draw(st.integers(0, 8 * len(raw) - 1))
    raw[bit // 8] ^= 1 << bit % 8
    deframer, ours = Deframer(), checker()
    frames = [*deframer.feed(bytes(raw)), *deframer.flush()]
    assert not any(ours.would_admit(frame) for frame in frames)
    # The checksum does not cover the signature: there the deframer finds nothing wrong.
    signature_begins = 8 * (len(raw) - 13)
    assert len(frames) == (bit >= signature_begins)


def test_no_single_bit_can_be_changed_behind_the_back_of_the_checksum() -> None:
    """An attacker makes the checksum fit."""
    ours, good = checker(), Peer().frame()
    for bit in range(8 * len(good.raw)):
        raw = bytearray(good.raw)
        raw[bit // 8] ^= 1 << bit % 8
        assert ours.admit(good._replace(raw=bytes(raw))) is Denial.BAD_SIGNATURE


def test_the_fields_of_a_frame_and_its_signed_bytes_are_the_same() -> None:
    frame = Peer(ids=(9, 8), link_id=7).frame()
    assert (frame.sysid, frame.compid, frame.raw[-13]) == (9, 8, 7)


def test_a_replayed_or_reordered_frame_is_refused() -> None:
    ours, peer = checker(), Peer()
    first, second = peer.frame(), peer.frame()
    assert ours.admit(second) is None
    assert ours.admit(second) is Denial.REPLAYED
    assert ours.admit(first) is Denial.REPLAYED
    assert ours.admit(peer.frame()) is None


def test_each_link_and_each_component_has_stamps_of_its_own() -> None:
    ours = checker()
    peers = [Peer(ids=ids, link_id=link) for ids in ((1, 1), (1, 2), (2, 1)) for link in (0, 255)]
    for peer in peers:
        assert ours.admit(peer.frame()) is None
    assert ours.streams == len(peers)


def test_a_forged_stamp_does_not_move_the_stream() -> None:
    """Else one frame with the largest stamp would shut out its rightful sender."""
    stamp = LocalStamp(Clock())
    ours, peer = checker(stamp), Peer()
    assert ours.admit(peer.frame()) is None
    forger = Peer(key=b"x" * 32, stamp=LARGEST_STAMP)
    assert ours.admit(forger.frame()) is Denial.BAD_SIGNATURE
    assert stamp.latest < NOW_STAMP + 10
    assert ours.admit(peer.frame()) is None


def test_a_new_stream_may_be_a_minute_behind_and_no_more() -> None:
    just_fine = Peer(stamp=NOW_STAMP - NEW_STREAM_BEHIND)
    too_old = Peer(stamp=NOW_STAMP - NEW_STREAM_BEHIND - 1)
    assert checker().admit(just_fine.frame()) is None
    assert checker().admit(too_old.frame()) is Denial.OLD_STAMP


def test_a_peer_whose_clock_is_behind_gets_in_once_it_has_heard_us() -> None:
    clock = Clock()
    encoder, _ = signing_encoder(clock)
    ours, peer = checker(LocalStamp(clock)), Peer(stamp=1)
    assert ours.admit(peer.frame()) is Denial.OLD_STAMP
    assert peer.believes(encoder.encode(raw_imu(1)))
    assert ours.admit(peer.frame()) is None


@pytest.mark.parametrize(
    ("how", "refusal"),
    [({"signed": False}, Denial.UNSIGNED), ({"version": 1}, Denial.MAVLINK_1)],
)
def test_a_downgrade_is_refused(how, refusal) -> None:
    ours, peer = checker(), Peer()
    assert ours.admit(peer.frame()) is None
    assert ours.admit(peer.frame(**how)) is refusal


@pytest.mark.parametrize("how", [{"signed": False}, {"version": 1}])
def test_the_status_of_a_radio_is_taken_as_its_firmware_sends_it(how) -> None:
    ours = checker(accept_unsigned=frozenset({RADIO_STATUS.id}))
    assert ours.admit(Peer().frame(RADIO_STATUS, **how)) is None
    assert ours.admit(Peer(key=b"x" * 32).frame(RADIO_STATUS)) is Denial.BAD_SIGNATURE
    assert ours.streams == 0


def test_setup_signing_is_refused_even_from_who_has_the_key() -> None:
    message = mavlink.MAVLink_setup_signing_message(1, 191, list(b"y" * 32), NOW_STAMP)
    ours = checker(accept_unsigned=frozenset({message.id}))
    assert ours.admit(Peer().frame(message)) is Denial.SETUP_SIGNING
    assert ours.admit(Peer().frame(message, signed=False)) is Denial.SETUP_SIGNING


def test_our_own_frame_sent_back_to_us_is_refused() -> None:
    encoder, signer = signing_encoder(Clock())
    ours = checker(own_streams=signer.streams)
    assert ours.admit(frame_of(encoder.encode(raw_imu(1)))) is Denial.REFLECTED
    assert ours.admit(Peer(ids=(1, 191), link_id=6).frame()) is None


def test_asking_changes_nothing() -> None:
    ours, frame = checker(), Peer().frame()
    assert ours.would_admit(frame)
    assert ours.would_admit(frame)
    assert ours.streams == 0
    assert ours.admit(frame) is None
    assert not ours.would_admit(frame)


def test_who_lags_behind_is_answered_and_who_has_no_key_is_not() -> None:
    ours = checker(accept_unsigned=frozenset({RADIO_STATUS.id}))
    peer = Peer()
    fresh = peer.frame()
    assert ours.would_answer(fresh)
    assert ours.would_answer(Peer(stamp=1).frame())
    assert not ours.would_answer(peer.frame(signed=False))
    assert not ours.would_answer(peer.frame(RADIO_STATUS, signed=False))
    assert not ours.would_answer(Peer(key=b"x" * 32).frame())
    assert ours.admit(fresh) is None
    assert not ours.would_answer(fresh)


def filled_table(clock: Clock) -> SignatureChecker:
    ours = checker(LocalStamp(clock))
    for number in range(MAX_STREAMS):
        ids = (1 + number % 16, 1 + number // 16)
        assert ours.admit(Peer(ids=ids, link_id=0).frame()) is None
    return ours


def test_a_full_table_keeps_its_streams_and_takes_no_new_one() -> None:
    ours = filled_table(Clock())
    assert ours.admit(Peer(link_id=1).frame()) is Denial.TOO_MANY_STREAMS
    assert ours.admit(Peer(ids=(1, 1), link_id=0, stamp=NOW_STAMP + 1).frame()) is None
    assert ours.streams == MAX_STREAMS


def test_a_full_table_forgets_only_what_could_not_be_replayed() -> None:
    clock = Clock()
    ours = filled_table(clock)
    recorded = Peer(ids=(1, 1), link_id=0).frame()
    clock.stamp += NEW_STREAM_BEHIND + 1
    assert ours.admit(Peer(link_id=1, stamp=clock.stamp).frame()) is None
    assert ours.streams == 1
    assert ours.admit(recorded) is Denial.OLD_STAMP


def test_who_has_no_key_gets_nothing_into_the_table() -> None:
    ours, rng = checker(), random.Random(1)
    for _ in range(1000):
        ids = (rng.randrange(1, 256), rng.randrange(1, 256))
        peer = Peer(key=rng.randbytes(32), ids=ids, link_id=rng.randrange(256))
        assert ours.admit(peer.frame()) is Denial.BAD_SIGNATURE
    assert ours.streams == 0


@pytest.mark.parametrize("how", [{}, {"signed": False}, {"version": 1}])
def test_a_frame_without_its_signature_is_the_same_message(how) -> None:
    before = Peer().frame(**how)
    after = frame_of(without_signature(before.raw))
    assert after == before._replace(signed=False, raw=after.raw)
    assert len(after.raw) == len(before.raw) - 13 * before.signed


# --- what goes out ------------------------------------------------------------------------------


def test_pymavlink_believes_what_we_sign() -> None:
    encoder, _ = signing_encoder(Clock())
    peer = Peer(stamp=0)
    for number in range(300):
        assert peer.believes(encoder.encode(raw_imu(number)))
    assert not Peer(key=b"x" * 32).believes(encoder.encode(raw_imu(1)))


def test_a_signature_is_that_of_the_specification() -> None:
    encoder, _ = signing_encoder(Clock(), link_id=5)
    raw = encoder.encode(raw_imu(1))
    assert raw[2] == 1
    assert raw[-13:-6] == bytes([5]) + NOW_STAMP.to_bytes(6, "little")
    assert raw[-6:] == hashlib.sha256(KEY + raw[:-6]).digest()[:6]


def test_without_a_signer_nothing_is_signed() -> None:
    (frame,) = Deframer().feed(Encoder(1, 191).encode(raw_imu(1)))
    assert not frame.signed


@given(st.lists(st.integers(-(10**12), 10**12), min_size=1))
def test_our_stamps_grow_whatever_the_clock_does(steps: list[int]) -> None:
    clock = Clock()
    stamp = LocalStamp(clock)
    before = 0
    for step in steps:
        clock.stamp += step
        now = stamp.next()
        assert now > before
        assert now >= clock.stamp
        before = now


def test_our_stamp_follows_a_peer_that_is_ahead() -> None:
    stamp = LocalStamp(Clock())
    assert checker(stamp).admit(Peer(stamp=NOW_STAMP + 500_000).frame()) is None
    assert stamp.next() == NOW_STAMP + 500_001
    assert stamp.ahead_s == pytest.approx(5.0, abs=1e-3)


def test_stamps_count_from_2015_and_stay_within_their_48_bits() -> None:
    assert stamp_at(EPOCH_UNIX_NS) == 0
    assert stamp_at(EPOCH_UNIX_NS + 1_000_000_000) == 100_000
    assert stamp_at(0) == 0
    assert stamp_at(2**63) == LARGEST_STAMP
    last = LocalStamp(Clock(), at_least=LARGEST_STAMP)
    assert last.next() == LARGEST_STAMP

"""What is fuzzed on the side of the wire: deframer, codec, and the service in its pipeline.

``run`` repeats one input and raises where something is broken; ``explore`` makes the input of a
seed and runs it. An input is bytes: a stream for the deframer, frames for the codec, and for the
service a session as `attacks.Written` has it.
"""

import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fuzz.attacks import Attacker, Session, Written
from fuzz.clean_sessions import CONFIGURATIONS
from fuzz.raw_frames import RawFrame, random_payload
from fuzz.watched_pipeline import InvariantBrokenError, WatchedPipeline
from h2nav.wire import codec
from h2nav.wire.deframer import LONGEST_FRAME, Deframer, DeframerCounters, Frame
from h2nav.wire.dialect import LAYOUTS

TARGETS = ("deframer", "codec", "service")
SESSIONS_WITH_LOG = 5  # every fifth
SESSIONS_BEGUN_COLD = 3  # every third
LONG_EVERY, LONGER = 51, 10  # every so many, so many times as long: growth shows there
CODEC_FRAMES = 200
MARKERS = (b"\xfd", b"\xfe")


class FailureError(Exception):
    """An input on which something broke; the cause is its ``__cause__``.

    Attributes:
        data: the input, for `run`.
    """

    def __init__(self, data: bytes, cause: BaseException) -> None:
        super().__init__(f"{type(cause).__name__}: {cause}")
        self.data = data


class Explored(NamedTuple):
    """What one seed came to.

    Attributes:
        frames: fed.
        slowest_s: time of the slowest input.
        most_told: notices in the worst minute.
    """

    frames: int
    slowest_s: float = 0.0
    most_told: int = 0


def run(target: str, data: bytes, folder: Path) -> None:
    """Repeats an input.

    Args:
        target: one of `TARGETS`.
        data: the input.
        folder: for files that are written meanwhile.
    """
    if target == "deframer":
        check_deframer(data)
    elif target == "codec":
        check_codec(data)
    else:
        repeat_session(data)


def explore(target: str, seed: int, folder: Path, frames: int = 2000) -> Explored:
    """Makes the input of a seed and runs it.

    Args:
        target: one of `TARGETS`.
        seed: of the input.
        folder: for files that are written meanwhile.
        frames: length of an attack on the service.

    Raises:
        FailureError: something broke; it carries the input.
    """
    if target == "service":
        return _attack(seed, folder, frames)
    rng = random.Random(f"{target} {seed}")
    data = stream(rng) if target == "deframer" else _frames(rng)
    try:
        run(target, data, folder)
    except Exception as error:
        raise FailureError(data, error) from error
    return Explored(len(Deframer().feed(data)))


# --- service ----------------------------------------------------------------------------------


def _attack(seed: int, folder: Path, frames: int) -> Explored:
    """A session: mostly begun well, then attacked, then left to recover."""
    name = list(CONFIGURATIONS)[seed % len(CONFIGURATIONS)]
    log = folder / f"session-{seed}.mcap" if seed % SESSIONS_WITH_LOG == 0 else None
    is_active_first = seed % SESSIONS_BEGUN_COLD != 0
    session = begun(name, is_active_first, log)
    pipeline = session.pipeline
    try:
        is_long = seed % LONG_EVERY == LONG_EVERY - 1
        Attacker(session, seed).attack(frames * LONGER if is_long else frames)
        session.recover()
        pipeline.check_counts()
        pipeline.check_memory()
        pipeline.close()
        pipeline.check_counts()
    except Exception as error:
        note = f"seed {seed}: {type(error).__name__}: {error}"
        written = Written(name, is_active_first, session.events, note)
        raise FailureError(written.as_text(), error) from error
    finally:
        pipeline.close()
        for path in folder.glob("session-*"):
            path.unlink()
    return Explored(pipeline.frames, pipeline.slowest_s, pipeline.most_told)


def begun(configuration: str, is_active_first: bool, log: Path | None = None) -> Session:
    """A session whose events begin now."""
    pipeline = WatchedPipeline(configuration, log)
    session = Session(pipeline, Written(configuration, is_active_first, ()).estimator)
    if is_active_first:
        session.recover()
        pipeline.check_memory()
    session.events.clear()
    return session


def repeat_session(data: bytes) -> None:
    """Feeds the events of a session, then lets the honest autopilot go on until all is well."""
    written = Written.from_text(data)
    session = begun(written.configuration, written.is_active_first)
    for event in written.events:
        session.repeat(event)
    session.pipeline.check_counts()
    session.recover()
    session.pipeline.check_counts()


# --- deframer ---------------------------------------------------------------------------------


def stream(rng: random.Random) -> bytes:
    """Frames of all kinds, whole and damaged, among noise and false headers."""
    parts: list[Callable[[], bytes]] = [
        lambda: _frame(rng),
        lambda: _frame(rng),
        lambda: _frame(rng)[: rng.randint(1, 60)],
        lambda: _frame(rng)[-rng.randint(1, 60) :],
        lambda: _flipped(rng, _frame(rng)),
        lambda: rng.randbytes(rng.randint(0, 40)),
        lambda: rng.choice(MARKERS) * rng.randint(1, 80),
        lambda: rng.choice(MARKERS) + rng.randbytes(rng.randint(1, 12)),
        lambda: _carrier(rng),
    ]
    return b"".join(rng.choice(parts)() for _ in range(rng.randint(1, 60)))


def _frame(rng: random.Random) -> bytes:
    msg_id = rng.choice((0, 27, 27, 105, 253, 331, rng.choice(list(LAYOUTS))))
    frame = RawFrame(msg_id, rng.randrange(256), rng.randrange(256), random_payload(rng, msg_id))
    fits = len(frame.payload) == LAYOUTS[msg_id].size and msg_id < 256
    version = 1 if fits and rng.random() < 0.3 else 2
    return frame.packed(rng.randrange(256), version, signed=version == 2 and rng.random() < 0.2)


def _carrier(rng: random.Random) -> bytes:
    """A file transfer with frames inside."""
    inside = (_frame(rng) + _frame(rng))[:251].ljust(251, b"\1")
    whole = RawFrame(110, 1, 1, bytes(3) + inside).packed()
    return whole if rng.random() < 0.7 else whole[: rng.randint(1, len(whole))]


def _flipped(rng: random.Random, data: bytes) -> bytes:
    damaged = bytearray(data)
    damaged[rng.randrange(len(damaged))] ^= 1 << rng.randrange(8)
    return bytes(damaged)


def check_deframer(data: bytes) -> None:
    """The rules of `h2nav.wire.deframer`, against a search that tries every byte."""
    frames, counters = _deframed([data])
    rng = random.Random(len(data))
    places = sorted(rng.randrange(len(data) + 1) for _ in range(1 + len(data) // 40))
    pieces = [data[a:b] for a, b in zip([0, *places], [*places, len(data)], strict=True)]
    for cut in (pieces, [data[i : i + 1] for i in range(len(data))]):
        _must(_deframed(cut) == (frames, counters), "the outcome depends on how bytes are cut")
    good = list(_good_frames(data))
    given = _located(frames, good)
    covered = set().union(*(range(at, at + len(raw)) for at, raw in given))
    _must(counters.bytes_in == len(data), "bytes are lost count of")
    _must(counters.frames == len(frames), "frames are lost count of")
    _must(counters.skipped_bytes == len(data) - len(covered), "bytes are not accounted for")
    for at, raw in good:
        touched = not covered.isdisjoint(range(at, at + len(raw)))
        _must(touched, f"the intact frame at {at} is lost")


def _deframed(pieces: Sequence[bytes]) -> tuple[list[Frame], DeframerCounters]:
    deframer = Deframer()
    frames = []
    for piece in pieces:
        frames += deframer.feed(piece)
        _must(deframer.pending_bytes < LONGEST_FRAME, "too much is kept")
    return frames + deframer.flush(), deframer.counters


def _good_frames(data: bytes) -> list[tuple[int, bytes]]:
    """Every place where a frame of a known id with a right checksum stands, and its bytes."""
    good = []
    for at in range(len(data)):
        for size in _sizes(data, at):
            raw = data[at : at + size]
            known = len(raw) == size and _has_right_checksum(raw)
            if known:
                good.append((at, raw))
    return good


def _sizes(data: bytes, at: int) -> Sequence[int]:
    """The length of the frame that would begin here."""
    if data[at] == 0xFD and len(data) - at >= 12 and data[at + 2] <= 1:
        msg_id = int.from_bytes(data[at + 7 : at + 10], "little")
        return (12 + data[at + 1] + 13 * data[at + 2],) if msg_id in LAYOUTS else ()
    if data[at] == 0xFE and len(data) - at >= 8 and data[at + 5] in LAYOUTS:
        layout = LAYOUTS[data[at + 5]]
        return (8 + data[at + 1],) if layout.base_size <= data[at + 1] <= layout.size else ()
    return ()


def _has_right_checksum(raw: bytes) -> bool:
    is_v1 = raw[0] == 0xFE
    msg_id = raw[5] if is_v1 else int.from_bytes(raw[7:10], "little")
    stop = len(raw) - 2 - (0 if is_v1 or not raw[2] else 13)
    crc = mavlink.x25crc(raw[1:stop] + bytes([LAYOUTS[msg_id].crc_extra])).crc
    return int.from_bytes(raw[stop : stop + 2], "little") == crc


def _located(frames: Sequence[Frame], good: Sequence[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
    """The places of the frames that were given out, in their order among the good ones."""
    places = iter(good)
    located = []
    for frame in frames:
        found = next(((at, raw) for at, raw in places if raw == frame.raw), None)
        _must(found is not None, f"a frame was invented: {frame.raw.hex()}")
        assert found is not None
        located.append(found)
    return located


# --- codec ------------------------------------------------------------------------------------


def _frames(rng: random.Random) -> bytes:
    """Frames of random messages with random payloads."""
    ids = list(LAYOUTS)
    picked = [rng.choice(ids) for _ in range(CODEC_FRAMES)]
    return b"".join(RawFrame(i, 1, 1, random_payload(rng, i)).packed() for i in picked)


def check_codec(data: bytes) -> None:
    """Each frame decodes to a record, and what is encoded from that decodes to the same."""
    for frame in Deframer().feed(data):
        record = codec.decode(frame)
        _must(type(record) is codec.record_type(frame.msg_id), "the record has another type")
        texts = [value for value in record if isinstance(value, str)]
        if not all(text.isascii() for text in texts):
            continue  # bytes that were no text are not given back
        values = [v.encode() if isinstance(v, str) else v for v in record]
        kind = mavlink.mavlink_map.get(frame.msg_id)
        if kind is None:
            continue  # read only: pymavlink's dialect does not have it yet
        known = len(kind.fieldnames)  # without extensions that pymavlink lacks
        (again,) = Deframer().feed(codec.Encoder(1, 1).encode(kind(*values[:known])))
        _must(_same(codec.decode(again)[:known], record[:known]), f"{record} does not come back")


def _same(left: Any, right: Any) -> bool:
    """Equal, where a NaN equals a NaN."""
    if isinstance(left, tuple):
        return all(map(_same, left, right))
    return bool(left == right or (left != left and right != right))


def _must(holds: bool, otherwise: str) -> None:
    if not holds:
        raise InvariantBrokenError(otherwise)

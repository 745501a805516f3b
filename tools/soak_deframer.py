"""Damages random MAVLink streams for a while and counts what the deframer loses or invents.

All kinds of frames are mixed (MAVLink 1 and 2, signed, file transfers); bytes are dropped or bits
flipped. Each stream is fed whole and in random pieces; both must give the same frames and counters.
The last figures of docs/design/001-deframer.md come from here: ``python tools/soak_deframer.py``.
"""

import argparse
import random
import sys
import time
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.wire.deframer import Deframer, DeframerCounters

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from wire_frames import FrameMaker, drop_bytes, flip_bits, highres_imu, raw_imu

FRAMES_PER_STREAM = 500
DAMAGED_SHARES = (0.0005, 0.003, 0.01)


def mixed_frames(rng: random.Random, first: int) -> list[bytes]:
    make = FrameMaker()
    kinds = (
        lambda number: make.frame(raw_imu(number)),
        lambda number: make.frame(raw_imu(number), signed=True),
        lambda number: make.frame(raw_imu(number), version=1),
        lambda number: make.frame(highres_imu(number)),
    )
    frames = []
    for number in range(first, first + FRAMES_PER_STREAM):
        frames.append(rng.choice(kinds)(number))
        if rng.random() < 0.02:
            data = list(rng.randbytes(251))
            frames.append(make.frame(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, data)))
    return frames


def deframe(pieces: list[bytes]) -> tuple[list[bytes], DeframerCounters]:
    deframer = Deframer()
    frames = [frame for piece in pieces for frame in deframer.feed(piece)]
    frames += deframer.flush()
    return [frame.raw for frame in frames], deframer.counters


def random_pieces(stream: bytes, rng: random.Random) -> list[bytes]:
    pieces = []
    start = 0
    while start < len(stream):
        stop = start + rng.randint(1, 90)
        pieces.append(stream[start:stop])
        start = stop
    return pieces


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=75.0, metavar="S")
    end = time.monotonic() + parser.parse_args().seconds
    streams = size = whole = lost = bogus = cut_dependent = 0
    while time.monotonic() < end:
        streams += 1
        rng = random.Random(streams)
        frames = mixed_frames(rng, FRAMES_PER_STREAM * streams)
        damage = (drop_bytes, flip_bits)[streams % 2]
        hits = int(rng.choice(DAMAGED_SHARES) * sum(map(len, frames)))
        stream, intact = damage(frames, hits, rng)
        out, counters = deframe([stream])
        cut_dependent += (out, counters) != deframe(random_pieces(stream, rng))
        size += len(stream)
        whole += len(intact)
        lost += len(set(intact).difference(out))
        # A signed frame with a damaged signature comes out: checking it is not the deframer's work.
        bogus += sum(not (raw[0] == 0xFD and raw[2] & 1) for raw in set(out).difference(frames))
    print(
        f"{streams} streams, {size / 1e6:.0f} MB: {lost} of {whole} whole frames lost, "
        f"{bogus} bogus, {cut_dependent} streams depend on their cuts"
    )


if __name__ == "__main__":
    main()

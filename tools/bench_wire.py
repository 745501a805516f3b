"""Measures deframer and codec next to pymavlink's own parser, in one run on one core.

Speed on a clean stream, frames kept on damaged ones, and what a flood of noise costs.
The figures of docs/design/001-deframer.md come from here: ``python tools/bench_wire.py``.
"""

import argparse
import json
import random
import time
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer

PIECE = 4096  # bytes fed at once, about what one read of a busy link brings
FRAMES = 10_000
ROUNDS = 10
TARGET_FRAMES_PER_S = 300_000


def raw_imu(number: int) -> mavlink.MAVLink_message:
    return mavlink.MAVLink_raw_imu_message(
        2500 * number, 12, -7, -1000, 3, -2, 1, 240, -30, 410, 0, 4512
    )


def highres_imu(number: int) -> mavlink.MAVLink_message:
    return mavlink.MAVLink_highres_imu_message(
        2500 * number, 0.1, 0.2, -9.8, 1e-3, -2e-3, 3e-3, 0.2, 0.0, 0.4, 1013.25, 0.0, 584.0, 35, 63
    )  # fmt: skip


def frames_of(message: Callable[[int], mavlink.MAVLink_message], count: int) -> list[bytes]:
    encoder = Encoder(1, 1)
    return [encoder.encode(message(number)) for number in range(count)]


def pieces(stream: bytes) -> list[bytes]:
    return [stream[start : start + PIECE] for start in range(0, len(stream), PIECE)]


def ours(stream: list[bytes]) -> int:
    deframer = Deframer()
    count = 0
    for piece in stream:
        for frame in deframer.feed(piece):
            decode(frame)
            count += 1
    return count


def deframed(stream: list[bytes]) -> int:
    deframer = Deframer()
    return sum(len(deframer.feed(piece)) for piece in stream)


def pymavlinks(stream: list[bytes]) -> int:
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    return sum(len(parser.parse_buffer(piece) or ()) for piece in stream)


def speeds() -> list[dict[str, Any]]:
    """Frames per second of CPU time, best of some rounds in which all take their turn."""
    rows = []
    parsers = {"records_per_s": ours, "deframed_per_s": deframed, "pymavlink_per_s": pymavlinks}
    for name, message in (("RAW_IMU", raw_imu), ("HIGHRES_IMU", highres_imu)):
        stream = pieces(b"".join(frames_of(message, FRAMES)))
        row: dict[str, Any] = {"message": name} | dict.fromkeys(parsers, 0.0)
        for _ in range(ROUNDS):
            for figure, parse in parsers.items():
                start = time.process_time()
                assert parse(stream) == FRAMES
                row[figure] = max(row[figure], FRAMES / (time.process_time() - start))
        rows.append(row | {"ratio": row["records_per_s"] / row["pymavlink_per_s"]})
    return rows


def damaged_streams() -> dict[str, tuple[bytes, set[bytes]]]:
    """Streams by name, each with the frames that its damage left whole."""
    rng = random.Random(1)
    frames = frames_of(highres_imu, 4000)
    spaced = b"".join(frame + rng.randbytes(64) for frame in frames)
    streams = {"64 random bytes between frames": (spaced, set(frames))}
    clean = b"".join(frames)
    size = len(frames[0])
    for share in (0.001, 0.01):
        hit = set(rng.sample(range(len(clean)), round(share * len(clean))))
        whole = {
            frame
            for number, frame in enumerate(frames)
            if hit.isdisjoint(range(number * size, (number + 1) * size))
        }
        dropped = bytes(byte for place, byte in enumerate(clean) if place not in hit)
        flipped = bytes(
            byte ^ (1 << place % 8 if place in hit else 0) for place, byte in enumerate(clean)
        )
        streams[f"{share:.1%} of bytes dropped"] = dropped, whole
        streams[f"a bit flipped in {share:.1%} of bytes"] = bytes(flipped), whole
    return streams


def kept() -> list[dict[str, Any]]:
    rows = []
    for name, (stream, whole) in damaged_streams().items():
        deframer = Deframer()
        mine = [frame.raw for piece in pieces(stream) for frame in deframer.feed(piece)]
        parser = mavlink.MAVLink(None)
        parser.robust_parsing = True
        theirs = [
            bytes(message.get_msgbuf())
            for piece in pieces(stream)
            for message in parser.parse_buffer(piece) or ()
            if message.get_type() != "BAD_DATA"
        ]
        rows.append(
            {
                "stream": name,
                "whole": len(whole),
                "kept": len(whole.intersection(mine)),
                "bogus": len([raw for raw in mine if raw not in whole]),
                "pymavlink_kept": len(whole.intersection(theirs)),
                "pymavlink_bogus": len([raw for raw in theirs if raw not in whole]),
            }
        )
    return rows


def floods() -> list[dict[str, Any]]:
    size = 1_000_000
    plausible = bytes([0xFD, 255, 0, 0, 0, 1, 1, 27, 0, 0])  # asks for 255 bytes, never a frame
    units = {
        "random bytes": random.Random(2).randbytes(size),
        "all 0xFD": b"\xfd",
        "all 0xFE": b"\xfe",
        "all zero": b"\0",
        "MAVLink 2 headers without a frame": plausible,
    }
    rows = []
    for name, unit in units.items():
        stream = pieces((unit * (size // len(unit) + 1))[:size])
        start = time.process_time()
        deframed(stream)
        rows.append({"flood": name, "s_per_megabyte": time.process_time() - start})
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON document, nothing else")
    args = parser.parse_args()
    results = {"speed": speeds(), "damage": kept(), "floods": floods()}
    if args.json:
        print(json.dumps(results, indent=2))
        return
    print(
        f"frames per second of CPU time, fed in pieces of {PIECE} bytes, best of {ROUNDS} "
        f"(target {TARGET_FRAMES_PER_S:,})"
    )
    for row in results["speed"]:
        print(
            f"  {row['message']:12} to records {row['records_per_s']:9,.0f}   deframed only "
            f"{row['deframed_per_s']:9,.0f}   pymavlink parse_buffer {row['pymavlink_per_s']:9,.0f}"
            f"   {row['ratio']:.1f}x"
        )
    print("frames kept of those that the damage left whole (and bogus ones)")
    for row in results["damage"]:
        print(
            f"  {row['stream']:33} {row['kept']:5} of {row['whole']:5} ({row['bogus']})"
            f"   pymavlink {row['pymavlink_kept']:5} ({row['pymavlink_bogus']})"
        )
    print("CPU time for a megabyte of noise")
    for row in results["floods"]:
        print(f"  {row['flood']:33} {row['s_per_megabyte']:.3f} s")


if __name__ == "__main__":
    main()

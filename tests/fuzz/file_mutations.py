"""Damaged and hostile variants of a file: seeded, quick, any kind of content."""

import random
import struct
from collections.abc import Callable, Sequence

MAX_CHANGES = 6
LENGTHS = (0, 1, 0x7F, 0xFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 1 << 40, (1 << 63) - 1, (1 << 64) - 1)
_WIDTHS = {1: "B", 2: "H", 4: "I", 8: "Q"}


def mutated(dice: random.Random, seeds: Sequence[bytes], words: Sequence[bytes]) -> bytes:
    """One of the seeds with a few changes.

    Args:
        dice: the only source of chance.
        seeds: sound files of a kind.
        words: what means something in files of this kind.
    """
    data = bytearray(dice.choice(seeds))
    for _ in range(dice.randint(1, MAX_CHANGES)):
        if not data:
            data += dice.choice(seeds)
        dice.choice(_CHANGES)(dice, data, seeds, words)
    return bytes(data)


_Change = Callable[[random.Random, bytearray, Sequence[bytes], Sequence[bytes]], None]


def _flip_bit(dice: random.Random, data: bytearray, *_: Sequence[bytes]) -> None:
    data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)


def _set_byte(dice: random.Random, data: bytearray, *_: Sequence[bytes]) -> None:
    data[dice.randrange(len(data))] = dice.choice((0, 0x7F, 0x80, 0xFF, dice.randrange(256)))


def _cut_off(dice: random.Random, data: bytearray, *_: Sequence[bytes]) -> None:
    del data[dice.randrange(len(data)) :]


def _cut_out(dice: random.Random, data: bytearray, *_: Sequence[bytes]) -> None:
    start = dice.randrange(len(data))
    del data[start : start + dice.randint(1, 64)]


def _repeat(dice: random.Random, data: bytearray, *_: Sequence[bytes]) -> None:
    start = dice.randrange(len(data))
    piece = bytes(data[start : start + dice.randint(1, 64)])
    data[start:start] = piece * dice.choice((1, 2, 30))


def _splice(dice: random.Random, data: bytearray, seeds: Sequence[bytes], _: object) -> None:
    other = dice.choice(seeds)
    start = dice.randrange(len(other)) if other else 0
    at = dice.randrange(len(data))
    data[at : at + dice.choice((0, 16))] = other[start : start + dice.randint(1, 256)]


def _announce(dice: random.Random, data: bytearray, *_: Sequence[bytes]) -> None:
    """Overwrites what may be a length, in either byte order."""
    width = dice.choice(tuple(_WIDTHS))
    value = dice.choice(LENGTHS) & ((1 << 8 * width) - 1)
    at = dice.randrange(len(data))
    data[at : at + width] = struct.pack(dice.choice("<>") + _WIDTHS[width], value)


def _put_word(
    dice: random.Random, data: bytearray, _: Sequence[bytes], words: Sequence[bytes]
) -> None:
    if words:
        at = dice.randrange(len(data))
        data[at : at + dice.choice((0, 0, 1, 4))] = dice.choice(words)


def _replace_token(
    dice: random.Random, data: bytearray, _: Sequence[bytes], words: Sequence[bytes]
) -> None:
    """Puts a word where a value stands in a text: between a colon or comma and the next one."""
    starts = [at for at, byte in enumerate(data) if byte in b":,"]
    if starts and words:
        start = dice.choice(starts) + 1
        end = start
        while end < len(data) and data[end] not in b",\n}]":
            end += 1
        data[start:end] = b" " + dice.choice(words)


_CHANGES: tuple[_Change, ...] = (
    _flip_bit, _set_byte, _cut_off, _cut_out, _repeat, _splice, _announce, _put_word,
    _replace_token, _replace_token,
)  # fmt: skip

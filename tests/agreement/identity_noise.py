"""The numbers of ``identity_noise.h``, and the ranges that it takes them from."""

import functools
from collections.abc import Callable
from pathlib import Path

from h2nav.attitude.record import assign, rows


@functools.cache
def ranges_of(record_type: type) -> list[tuple[int, int]]:
    """Lowest and highest value of every number of a record, in its order."""
    return [found.range or (0, 0) for found in rows(record_type) for _ in range(found.length)]


def write_ranges(folder: Path, sample_type: type) -> None:
    """Writes ``identity_ranges.h``: the range of every number of a sample."""
    ranges = ", ".join(
        f"{{{low if low > -(1 << 31) else '-2147483647 - 1'}, {high}}}"
        for low, high in ranges_of(sample_type)
    )
    table = f"static const int32_t SAMPLE_RANGES[H2NAV_SAMPLE_SIZE][2] = {{{ranges}}};\n"
    (folder / "identity_ranges.h").write_text(table)


class Noise:
    """A generator that every machine can repeat."""

    def __init__(self) -> None:
        self._seed = 1

    def __call__(self, bits: int) -> int:
        """From -2^(bits-1) to 2^(bits-1) - 1."""
        self._seed = (self._seed * 1664525 + 1013904223) & 0xFFFFFFFF
        shift = 32 - bits if bits > 24 else 8
        return ((self._seed >> shift) & ((1 << bits) - 1)) - (1 << (bits - 1))

    def corners(self, sample: object, sample_type: type) -> None:
        """Every number of the sample at one end of its range."""
        self._fill(sample, sample_type, lambda low, high: low if self(4) < 0 else high)

    def anything(self, sample: object, sample_type: type) -> None:
        """Every number of the sample anywhere in its range."""
        self._fill(sample, sample_type, self._anywhere)

    def _fill(self, sample: object, sample_type: type, choose: Callable[[int, int], int]) -> None:
        assign(sample, sample_type, [choose(low, high) for low, high in ranges_of(sample_type)])

    def _anywhere(self, low: int, high: int) -> int:
        self._seed = (self._seed * 1664525 + 1013904223) & 0xFFFFFFFF
        return low + ((self._seed * (high - low + 1)) >> 32)

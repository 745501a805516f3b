"""How an MCAP file begins and ends; the MCAP library need not be loaded to see it."""

from pathlib import Path

MAGIC = b"\x89MCAP0\r\n"


def is_mcap(path: Path) -> bool:
    """Whether the file begins like an MCAP file; up to two bytes may be damaged."""
    with path.open("rb") as stream:
        start = stream.read(len(MAGIC))
    equal = sum(a == b for a, b in zip(start, MAGIC, strict=False))
    return equal >= len(MAGIC) - 2

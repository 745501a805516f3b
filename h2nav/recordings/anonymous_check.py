"""Whether an anonymous recording still holds what it should not."""

from collections.abc import Iterable
from pathlib import Path

from h2nav.recordings.anonymous import Coordinates, patterns_of

# Fixes that are searched for; fewer in a large file, so that the search ends within a minute.
MAX_FIXES, MIN_FIXES, SEARCHED_BYTES = 24, 4, 5_000_000_000
# Fewer different bytes occur by chance, as 0.0000 does.
MIN_DIFFERENT = 4
SHORTEST, LONGEST = 6, 128
BLOCK_BYTES = 1 << 21


def remains(path: Path, fixes: Iterable[Coordinates], names: Iterable[str]) -> list[str]:
    """What of the old places and names is still in a file's bytes, at any resolution.

    Args:
        path: the anonymous recording.
        fixes: of the old one.
        names: ids and names of the old one; short ones are left out.

    Returns:
        One phrase each; empty if nothing is.
    """
    chosen = list(dict.fromkeys(fixes))
    most = SEARCHED_BYTES // max(path.stat().st_size, 1)
    most = min(max(most, MIN_FIXES), MAX_FIXES)
    chosen = chosen[:: -(-len(chosen) // most) or 1]
    wanted = dict.fromkeys(patterns_of(chosen), "a coordinate")
    for name in names:
        plain = name.replace("-", " ")
        for text in {name, plain, plain.lower(), plain.upper()}:
            if len(text) >= SHORTEST:
                wanted[text.encode()] = f"the id {name}"
    wanted = {
        pattern: what
        for pattern, what in wanted.items()
        if len(set(pattern)) >= MIN_DIFFERENT and len(pattern) >= SHORTEST
    }
    found, start, before = [], 0, b""
    with path.open("rb") as stream:
        while block := stream.read(BLOCK_BYTES):
            data = before + block
            seen = [pattern for pattern in wanted if pattern in data]
            for pattern in seen:
                place = start - len(before) + data.index(pattern)
                found.append(f"{wanted.pop(pattern)} at byte {place}: {pattern!r}")
            start += len(block)
            before = data[-LONGEST:]
    return found

"""Whether an anonymous recording still holds what it should not."""

from collections.abc import Iterable
from mmap import ACCESS_READ, mmap
from pathlib import Path

from h2nav.recordings.anonymous import Coordinates, patterns_of

MOST_FIXES = 24
# Fewer different bytes occur by chance, as 0.0000 does.
LEAST_DIFFERENT = 4
SHORTEST = 6


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
    chosen = chosen[:: max(len(chosen) // MOST_FIXES, 1)]
    wanted = dict.fromkeys(patterns_of(chosen), "a coordinate")
    for name in names:
        plain = name.replace("-", " ")
        for text in {name, plain, plain.lower(), plain.upper()}:
            if len(text) >= SHORTEST:
                wanted[text.encode()] = f"the id {name}"
    found = []
    with path.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
        for pattern, what in wanted.items():
            if len(set(pattern)) >= LEAST_DIFFERENT and len(pattern) >= SHORTEST:
                place = data.find(pattern)
                if place >= 0:
                    found.append(f"{what} at byte {place}: {pattern!r}")
    return found

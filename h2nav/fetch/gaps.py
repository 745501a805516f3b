"""Which bytes of a file are still missing, whatever the order in which its parts arrive."""

from collections.abc import Iterable, Iterator

# What is asked for in order leaves few; of more, each part would cost a look at all of them.
MAX_GAPS = 1000


class Gaps:
    """The missing parts of a file.

    Args:
        size: of the whole file, bytes.
        gaps: what is missing, from and to; None = everything.
    """

    def __init__(self, size: int, gaps: Iterable[tuple[int, int]] | None = None) -> None:
        everything = [(0, size)] if size else []
        self._gaps: list[tuple[int, int]] = everything if gaps is None else sorted(gaps)

    @property
    def first(self) -> tuple[int, int] | None:
        """The first missing part, from and to; None if nothing is missing."""
        return self._gaps[0] if self._gaps else None

    def __iter__(self) -> Iterator[tuple[int, int]]:
        """The missing parts in order, from and to."""
        return iter(self._gaps)

    @property
    def missing(self) -> int:
        """Number of missing bytes."""
        return sum(end - start for start, end in self._gaps)

    def fill(self, start: int, end: int) -> bool:
        """Notes that a part has come; returns whether it is taken.

        It is not where nothing of it was missing, or where it would leave too many gaps.
        """
        left: list[tuple[int, int]] = []
        is_new = False
        for low, high in self._gaps:
            if end <= low or high <= start:
                left.append((low, high))
                continue
            is_new = True
            if low < start:
                left.append((low, start))
            if end < high:
                left.append((end, high))
        if len(left) > MAX_GAPS:
            return False
        self._gaps = left
        return is_new

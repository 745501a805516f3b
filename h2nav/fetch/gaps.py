"""Which bytes of a file are still missing, whatever the order in which its parts arrive."""


class Gaps:
    """The missing parts of a file.

    Args:
        size: of the whole file, bytes.
    """

    def __init__(self, size: int) -> None:
        self._gaps: list[tuple[int, int]] = [(0, size)] if size else []  # from, to; in order

    @property
    def first(self) -> tuple[int, int] | None:
        """The first missing part, from and to; None if nothing is missing."""
        return self._gaps[0] if self._gaps else None

    @property
    def missing(self) -> int:
        """Number of missing bytes."""
        return sum(end - start for start, end in self._gaps)

    def fill(self, start: int, end: int) -> bool:
        """Notes that a part has come; returns whether any of it was missing."""
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
        self._gaps = left
        return is_new

"""Progress of whatever reads a log."""

from collections.abc import Callable

Progress = Callable[[int, int], None]  # bytes done, bytes in all

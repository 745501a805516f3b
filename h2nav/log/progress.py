"""Progress of whatever takes a while."""

from collections.abc import Callable

Progress = Callable[[int, int], None]  # of what is done, and of the total

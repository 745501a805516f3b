"""Progress bars of slow commands; none where standard error is not a terminal."""

import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

from h2nav.log.progress import Progress


def byte_bar(what: str) -> AbstractContextManager[Progress]:
    """A bar of bytes on a terminal, silent in a pipe."""
    return _bar(what, "B", is_scaled=True)


def count_bar(what: str, unit: str) -> AbstractContextManager[Progress]:
    """The same for counted things."""
    return _bar(what, unit, is_scaled=False)


@contextmanager
def _bar(what: str, unit: str, *, is_scaled: bool) -> Iterator[Progress]:
    if not sys.stderr.isatty():
        yield lambda done, total: None
        return
    from tqdm import tqdm  # takes 30 ms to load

    with tqdm(desc=what, unit=unit, unit_scale=is_scaled, leave=False) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield progress

"""Ends a worker of the local cluster at Ctrl-C, which the terminal also sends to the worker.

Dask loads this module into each worker (`preload`). The next run repeats unfinished flights.
"""

import os
import signal

_INTERRUPTED = 130


def dask_setup(_: object) -> None:
    """Called by Dask in the worker's main thread."""
    signal.signal(signal.SIGINT, lambda *_: os._exit(_INTERRUPTED))

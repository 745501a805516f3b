"""What a worker of our own cluster does at Ctrl-C, which a terminal sends to it as well: it goes.

Dask loads this module into each worker (`preload`). What was under way is done by the next run.
"""

import os
import signal

_INTERRUPTED = 130


def dask_setup(_: object) -> None:
    """Is called by Dask in the worker's main thread."""
    signal.signal(signal.SIGINT, lambda *_: os._exit(_INTERRUPTED))

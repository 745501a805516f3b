"""Starts modules of h2nav as processes beside this one."""

import os
import subprocess
import sys
from collections.abc import Mapping
from typing import Any


def start_module(
    module: str, *words: str, env: Mapping[str, str] | None = None, **streams: Any
) -> "subprocess.Popen[bytes]":
    """Starts a module with the modules of this process, whatever lies in the working directory.

    Ctrl-C at the terminal is for this process alone, which ends the other one.

    Args:
        module: as after ``python -m``.
        words: its command line.
        env: changes of the environment.
        streams: ``stdin``, ``stdout`` and ``stderr`` of `subprocess.Popen`.

    Raises:
        OSError: it cannot be started.
    """
    modules = os.pathsep.join(path for path in sys.path if path)
    return subprocess.Popen(
        [sys.executable, "-P", "-m", module, *words],
        env={**os.environ, **(env or {}), "PYTHONPATH": modules},
        process_group=0,
        **streams,
    )

"""A process that yields to the estimate: less processor time, bounded resources, killed first.

A service manager may forbid some of these and set limits of its own.
"""

import contextlib
import ctypes
import os
import platform
import resource
from collections.abc import Mapping
from pathlib import Path

FIRST_VICTIM = "1000"
NICEST = 19
# ioprio_set has no function in the C library.
_IOPRIO_SET = {"x86_64": 251, "aarch64": 30, "armv7l": 314, "armv6l": 314}
_WHO_PROCESS = 1
_IDLE_CLASS = 3 << 13


def yield_to_others(nicer: int, limits: Mapping[int, int]) -> None:
    """Lowers this process's priority by `nicer`, and lets it be killed first.

    Args:
        limits: of resources, by their numbers in `resource`.
    """
    with contextlib.suppress(OSError):
        os.nice(nicer)
    for kind, most in limits.items():
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(kind, (most, most))
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(FIRST_VICTIM)


def run_when_idle() -> None:
    """Leaves processor and disk to everybody else."""
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    number = _IOPRIO_SET.get(platform.machine())
    if number is not None:
        ctypes.CDLL(None).syscall(number, _WHO_PROCESS, 0, _IDLE_CLASS)

"""The files of each compiled kernel, and a digest of all of them.

The build writes the digest into the extension, so that an extension from older kernels is detected.
"""

import hashlib
import sys
from collections.abc import Sequence
from typing import NamedTuple


class KernelFiles(NamedTuple):
    """The sources of one kernel."""

    name: str  # of the filter, with ``_integer`` where the filter has floats too; or of the watch
    paths: tuple[str, ...]  # inside the room, imported ones first
    entry: str  # the function that takes state, gains and a sample
    room: str = "attitude"  # the package inside ``h2nav``
    declared: tuple[str, ...] = ()  # other declarations of fields of its records, read by import

    @property
    def files(self) -> tuple[str, ...]:
        """All sources of the compiled kernel, relative to ``h2nav``."""
        return tuple(f"{self.room}/{path}" for path in (*self.declared, *self.paths))


_PARAMETERS = ("velocity_aided/parameters.py",)
_UNITS = "velocity_aided/units.py"
_SHARED = ("integer/triad.py", "integer/motion.py")


def _kernel(folder: str, *names: str) -> tuple[str, ...]:
    return (f"{folder}/memory.py", *(f"{folder}/kernel/{name}.py" for name in names))


VELOCITY_AIDED = KernelFiles(
    "velocity_aided",
    (
        _UNITS,
        *_kernel(
            "velocity_aided",
            *("field_offset", "prediction", "theta", "aiding", "tilt", "velocity", "heading"),
            *("rest", "estimate", "step"),
        ),
    ),
    "step",
    declared=_PARAMETERS,
)
VELOCITY_AIDED_INTEGER = KernelFiles(
    "velocity_aided_integer",
    (
        *_SHARED,
        *_kernel(
            "velocity_aided/integer",
            *(
                "functions",
                "derived",
                "theta",
                "aiding",
                "tilt",
                "velocity",
                "fixes",
                "heading",
                "start",
            ),
            *("frame", "step"),
        ),
    ),
    "update",
    declared=(*_PARAMETERS, _UNITS, "velocity_aided/integer/shared.py", "velocity_aided/memory.py"),
)
CONSTANT_GAIN = KernelFiles(
    "constant_gain", (*_SHARED, *_kernel("constant_gain", "step")), "update"
)
FILTERS = (VELOCITY_AIDED, VELOCITY_AIDED_INTEGER, CONSTANT_GAIN)


def _watch(name: str, entry: str, *names: str) -> KernelFiles:
    """One of the two kernels of the watch over an IMU, which share one state."""
    paths = tuple(f"kernel/{module}.py" for module in ("memory", *names))
    return KernelFiles(name, paths, entry, "integrity")


SENSOR_CHECKS = _watch("sensor_checks", "check", "repeats", "standstill", "turns", "checks")
SENSOR_WINDOWS = _watch("sensor_windows", "follow", "rotation", "windows")
# in the order of their numbers in the extension
COMPILED = (*FILTERS, SENSOR_CHECKS, SENSOR_WINDOWS)


def sources() -> list[str]:
    """All sources of the compiled kernels, relative to the repository."""
    return sorted({f"h2nav/{path}" for kernel in COMPILED for path in kernel.files})


def digest(texts: Sequence[str]) -> str:
    """The digest of these texts, those of `COMPILED` in order."""
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()


if __name__ == "__main__":
    sys.stdout.write(" ".join(sources()))  # for the Makefile

"""Which files make each compiled kernel, and the name of one version of them all.

The build writes that name into the extension, so that one made from older kernels is noticed.
"""

import hashlib
from collections.abc import Sequence
from typing import NamedTuple


class KernelFiles(NamedTuple):
    """The text of one kernel.

    Attributes:
        name: of the filter, with ``_integer`` where the filter has floats too.
        paths: inside ``h2nav/attitude``, imported ones first.
        entry: the function that takes memory, gains and a sample.
    """

    name: str
    paths: tuple[str, ...]
    entry: str


_SHARED = ("integer/triad.py", "integer/motion.py")


def _kernel(folder: str, *names: str) -> tuple[str, ...]:
    return (f"{folder}/memory.py", *(f"{folder}/kernel/{name}.py" for name in names))


VELOCITY_AIDED = KernelFiles(
    "velocity_aided",
    _kernel(
        "velocity_aided",
        *("prediction", "theta", "aiding", "tilt", "velocity", "heading", "rest", "estimate"),
        "step",
    ),
    "step",
)
VELOCITY_AIDED_INTEGER = KernelFiles(
    "velocity_aided_integer",
    (
        *_SHARED,
        *_kernel(
            "velocity_aided/integer",
            *("functions", "theta", "aiding", "tilt", "velocity", "fixes", "heading", "start"),
            *("frame", "step"),
        ),
    ),
    "update",
)
CONSTANT_GAIN = KernelFiles(
    "constant_gain", (*_SHARED, *_kernel("constant_gain", "step")), "update"
)
# in the order of their numbers in the extension
COMPILED = (VELOCITY_AIDED, VELOCITY_AIDED_INTEGER, CONSTANT_GAIN)


def digest(texts: Sequence[str]) -> str:
    """The name of the kernels with these texts, those of `COMPILED` in order."""
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()

"""The compiled kernels: whether they are there, whether they may be used, and one step of theirs.

The environment variable H2NAV_NATIVE says ``require`` (an error without the compiled kernels) or
``forbid`` (Python even where they exist). Both give the same bits.
"""

import functools
import importlib
import os
from array import array
from collections.abc import Callable, Iterable, Sequence
from importlib import resources
from types import ModuleType
from typing import TypeVar, cast

from h2nav.attitude.kernel_modules import COMPILED_MODULES, digest
from h2nav.errors import BadInput

SWITCH = "H2NAV_NATIVE"
# numbers that the compiled loop writes per sample; the last holds the step's bits
RESULT_COLUMNS = 8

Number = TypeVar("Number", float, int)


def native_kernels() -> ModuleType | None:
    """The compiled kernels; None when they are absent or forbidden.

    Raises:
        BadInput: H2NAV_NATIVE requires them and they are absent, or it says something unknown.
    """
    wish = os.environ.get(SWITCH, "")
    if wish not in ("", "require", "forbid"):
        raise BadInput(f"{SWITCH}: expected require or forbid, found {wish!r}; or leave it unset")
    if wish == "forbid":
        return None
    native = _current_build()
    if native is None and wish == "require":
        raise BadInput(
            f"{SWITCH}: the compiled kernels are absent or older than the Python ones; "
            "install h2nav again with a C compiler"
        )
    return native


@functools.cache
def _current_build() -> ModuleType | None:
    """The compiled kernels, if they were made from the kernels that Python runs."""
    try:
        native = importlib.import_module("h2nav.attitude._native")
    except ImportError:
        return None
    folder = resources.files("h2nav.attitude.kernels")
    texts = [folder.joinpath(name).read_text("utf-8") for name in COMPILED_MODULES]
    return native if native.kernel_digest == digest(texts) else None


def backend() -> str:
    """``native`` or ``python``: what the kernels run on."""
    return "python" if native_kernels() is None else "native"


class CompiledStep:
    """A compiled kernel's step, called like the one in Python but on `numbers`.

    Args:
        run: its loop over samples.
        code: ``d`` for doubles, ``i`` for 32-bit integers.
    """

    def __init__(self, run: Callable[..., None], code: str) -> None:
        self._run = run
        self._code = code
        self._out = array(code, [0] * RESULT_COLUMNS)

    def numbers(self, values: Iterable[Number]) -> list[Number]:
        """Numbers as C holds them; to the kernels in Python they are as good as a list."""
        return cast(list[Number], array(self._code, values))

    def __call__(
        self, memory: list[Number], gains: Sequence[Number], sample: Sequence[Number]
    ) -> int:
        """One sample; returns bits."""
        self._run(memory, gains, sample, len(sample), self._out)
        return int(self._out[RESULT_COLUMNS - 1])


def compiled_step(kernel: str) -> CompiledStep | None:
    """One kernel's step for one filter; None when there is none, or it may not be used.

    Args:
        kernel: ``shaped``, ``fixed_lean`` or ``fixed_flight``.

    Raises:
        BadInput: see `native_kernels`.
    """
    native = native_kernels()
    if native is None:
        return None
    return CompiledStep(getattr(native, f"run_{kernel}"), "d" if kernel == "shaped" else "i")

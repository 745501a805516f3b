"""The compiled kernels: whether they exist and may be used, and a call of one step.

The environment variable H2NAV_NATIVE says ``require`` (an error without the compiled kernels) or
``forbid`` (Python in any case). Both give the same bits.
"""

import functools
import importlib
import os
from array import array
from collections.abc import Callable, Sequence
from functools import partial
from importlib import resources
from types import ModuleType

from h2nav.attitude.kernel_files import COMPILED, KernelFiles, digest
from h2nav.attitude.record import place_of, writer
from h2nav.errors import BadInput

SWITCH = "H2NAV_NATIVE"
# numbers that the compiled loop writes per sample: attitude, bias, the step's bits, deviations,
# whether a velocity holds the attitude, and the velocity gained
RESULT_COLUMNS = 13
# what the extension has to offer: its functions and results; as in native/module.c
INTERFACE = 3


def native_kernels() -> ModuleType | None:
    """The compiled kernels; None when they are absent or forbidden.

    Raises:
        BadInput: H2NAV_NATIVE requires them and they are absent, or its value is unknown.
    """
    switch = os.environ.get(SWITCH, "")
    if switch not in ("", "require", "forbid"):
        raise BadInput(f"{SWITCH}: expected require or forbid, found {switch!r}; or leave it unset")
    if switch == "forbid":
        return None
    native = _current_build()
    if native is None and switch == "require":
        raise BadInput(
            f"{SWITCH}: the compiled kernels are absent or older than the Python ones; "
            "install h2nav again with a C compiler"
        )
    return native


@functools.cache
def _current_build() -> ModuleType | None:
    """The compiled kernels, if they were built from the present Python kernels."""
    try:
        native = importlib.import_module("h2nav.attitude._native")
    except ImportError:
        return None
    folder = resources.files("h2nav")
    texts = [
        folder.joinpath(path).read_text("utf-8") for kernel in COMPILED for path in kernel.files
    ]
    fits = getattr(native, "interface", 0) == INTERFACE
    return native if fits and native.kernel_digest == digest(texts) else None


def compiled_or(functions: ModuleType) -> ModuleType:
    """The compiled functions, or those of the same names in Python where they are absent."""
    native = native_kernels()
    return functions if native is None else native


def backend() -> str:
    """The backend of the kernels: ``native`` or ``python``."""
    return "python" if native_kernels() is None else "native"


class CompiledStep:
    """A compiled kernel, called like its Python step, on records made by `record.in_c`.

    Args:
        native: the extension.
        kernel: which of its kernels.
        code: ``d`` for doubles, ``i`` for 32-bit integers.
    """

    def __init__(self, native: ModuleType, kernel: KernelFiles, code: str) -> None:
        self._run = native.run
        self._bind: Callable[..., Callable[..., int]] = native.bind
        self._number = COMPILED.index(kernel)
        self._result = array(code, [0] * RESULT_COLUMNS)

    def bound(self, *records: object) -> Callable[[], int]:
        """A function that processes the sample in a record and returns bits; the records stay.

        Args:
            records: arguments of the step in Python, in order.
        """
        return partial(self._run, self._number, *_in_full(records), self._result)

    def taking(self, records: Sequence[object], place: tuple[int, int]) -> Callable[..., int]:
        """A function that writes numbers into the sample, processes it and returns bits.

        Args:
            records: arguments of the step in Python, in order; the sample is the last.
            place: of the first of the numbers in the sample, and how many they are.
        """
        return self._bind(self._number, *_in_full(records), *place)

    def run(self, records: Sequence[object], samples: object, results: object) -> None:
        """Processes many samples.

        Args:
            records: arguments of the step in Python before a sample; the first is changed.
            samples: buffer of contiguous samples.
            results: buffer of `RESULT_COLUMNS` numbers per sample, written.
        """
        self._run(self._number, *_in_full((*records, samples)), results)


def _in_full(records: Sequence[object]) -> tuple[object, ...]:
    """State, workspace, gains and samples of a step; the workspace is empty if it has none."""
    state, *workspace, gains, samples = records
    return (state, *(workspace or [bytearray()]), gains, samples)


def compiled_step(kernel: KernelFiles) -> CompiledStep | None:
    """A kernel's step for one filter; None if there is none, or it may not be used.

    Raises:
        BadInput: see `native_kernels`.
    """
    native = native_kernels()
    if native is None:
        return None
    return CompiledStep(native, kernel, native.number_codes[COMPILED.index(kernel)])


def stepping(
    step: Callable[..., int],
    compiled: CompiledStep | None,
    records: Sequence[object],
    sample_type: type,
    fields: tuple[str, str],
) -> Callable[..., int]:
    """A function of the numbers for some adjacent fields of a sample: writes, steps, returns bits.

    Args:
        step: of a kernel of doubles, in Python.
        compiled: the same; None for the one in Python.
        records: the step's arguments; the sample is the last.
        sample_type: its type.
        fields: the first and the last of the fields.
    """
    if compiled is not None:
        return compiled.taking(records, place_of(sample_type, *fields))
    write, run = writer(records[-1], sample_type, *fields), partial(step, *records)

    def written(*numbers: float) -> int:
        write(*numbers)
        return run()

    return written

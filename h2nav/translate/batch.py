"""The C file of a kernel for batches: its step, and a loop over the rows of a table of samples."""

from collections.abc import Sequence
from typing import NamedTuple

from h2nav.attitude.kernel_modules import FLIGHT_MODULES, LEAN_MODULES, SHAPED_MODULES
from h2nav.translate.c99 import translate
from h2nav.translate.source import Source


class BatchKernel(NamedTuple):
    """A kernel that is compiled for batches.

    Attributes:
        name: of the C function ``run_<name>``.
        modules: file names in ``attitude/kernels``, imported ones first.
        entry: the step function: (memory, gains, sample) -> bits.
        number: C type of all numbers.
    """

    name: str
    modules: tuple[str, ...]
    entry: str
    number: str


BATCH_KERNELS = (
    BatchKernel("shaped", SHAPED_MODULES, "step", "double"),
    BatchKernel("fixed_lean", LEAN_MODULES, "update", "int32_t"),
    BatchKernel("fixed_flight", FLIGHT_MODULES, "update", "int32_t"),
)
# Columns of a result row: the first words of the memory (attitude, bias), then the bits.
KEPT = 7


def batch_c(kernel: BatchKernel, sources: Sequence[Source]) -> str:
    """The C text; rows of the result hold the first `KEPT` words of the memory and the bits."""
    translation = translate(sources, [kernel.entry])
    number = kernel.number
    return f"""\
/* Generated from {", ".join(kernel.modules)}; do not edit. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>

{translation.code}
void run_{kernel.name}({number} *memory, const {number} *gains, const {number} *samples,
    size_t rows, size_t columns, {number} *results);

void run_{kernel.name}({number} *memory, const {number} *gains, const {number} *samples,
    size_t rows, size_t columns, {number} *results)
{{
    for (size_t row = 0; row < rows; row++) {{
        const int32_t bits = {kernel.entry}(memory, gains, samples + row * columns);
        for (size_t i = 0; i < {KEPT}; i++) {{
            results[row * {KEPT + 1} + i] = memory[i];
        }}
        results[row * {KEPT + 1} + {KEPT}] = ({number})bits;
    }}
}}
"""

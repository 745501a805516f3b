"""The C of the kernels for the native extension: each step, and a loop over samples around it."""

import ast
from collections.abc import Sequence

from h2nav.attitude.kernel_files import KernelFiles
from h2nav.translate.c99 import translate
from h2nav.translate.c_expressions import DOUBLE, INT32
from h2nav.translate.source import Kernel, KernelSource, RecordSource
from h2nav.translate.structs import struct_text

# What a row of results holds, and from which column on: of the state, and of the workspace, where
# they have it.
_OF_STATE = (("q_nb", 0), ("gyro_bias", 4), ("aided", 10), ("gained_n", 11), ("gained_e", 12))
_OF_WORKSPACE = (("sigma_tilt", 8), ("sigma_heading", 9))
COLUMNS = 13


def batch_c(kernel: KernelFiles, sources: Sequence[KernelSource]) -> str:
    """The C file of one kernel; a row of its results holds attitude and bias, if any, and bits."""
    translation = translate(sources, [kernel.entry])
    records = _records(translation.kernel, kernel.entry)
    state, *workspace, gains, sample = (found.name for found in records)
    scratch = workspace[0] if workspace else ""
    structs = "\n".join(struct_text(found.about, found.rows, found.name) for found in records)
    number = DOUBLE if records[0].rows[0].range is None else INT32
    results = "".join(
        f"        memcpy(result + {column}, &s->{name}, sizeof s->{name});\n"
        for name, column in _OF_STATE
        if name in [row.name for row in records[0].rows]
    )
    if scratch:
        results += "".join(
            f"        result[{column}] = w->{name};\n"
            for name, column in _OF_WORKSPACE
            if name in [row.name for row in records[1].rows]
        )
    return f"""\
/* Generated from {", ".join(kernel.paths)}; do not edit. */
#include <math.h>
#include <string.h>

#include "kernels.h"

{structs}
{translation.code}
static int32_t run(void *state, void *workspace, const void *gains, const void *samples,
                   size_t rows, void *results)
{{
    {state} *s = state;
    const {sample} *sample = samples;
    {number} *result = results;
    int32_t bits = 0;
    {f"const {scratch} *w = workspace;" if scratch else "(void)workspace;"}
    {"(void)w;" if scratch else ""}
    for (size_t row = 0; row < rows; row++) {{
        bits = {kernel.entry}(s, {"workspace, " if scratch else ""}gains, sample + row);
{results}        result[7] = ({number})bits;
        result += {COLUMNS};
    }}
    return bits;
}}

const struct kernel {kernel.name} = {{
    run, sizeof({state}), {f"sizeof({scratch})" if scratch else 0}, sizeof({gains}),
    sizeof({sample}), sizeof({number}),
}};
"""


def _records(kernel: Kernel, entry: str) -> list[RecordSource]:
    """The records that a step takes, in its order: state, workspace if any, gains, sample."""
    arguments = kernel.functions[entry].node.args.args
    annotations = [argument.annotation for argument in arguments]
    return [kernel.records[name.id] for name in annotations if isinstance(name, ast.Name)]


def kernels_h(kernels: Sequence[KernelFiles]) -> str:
    """The header that tells the extension of its kernels."""
    names = [kernel.name for kernel in kernels]
    externs = "\n".join(f"extern const struct kernel {name};" for name in names)
    return f"""\
/* Generated; do not edit. */
#include "kernel.h"

{externs}

#define KERNELS_IN_ORDER {", ".join(f"&{name}" for name in names)}
"""

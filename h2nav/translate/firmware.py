"""The files of an exported integer filter: C source, header, example, test vectors.

`firmware_velocity_aided` and `firmware_constant_gain` hold what differs between the filters.
"""

from collections.abc import Sequence
from typing import NamedTuple

from h2nav.attitude.kernel_files import KernelFiles
from h2nav.attitude.record import Number
from h2nav.translate.c99 import CALLED, translate
from h2nav.translate.layout import broken
from h2nav.translate.source import KernelSource, RecordSource, read_kernel
from h2nav.translate.structs import constant_text, struct_text

# (name without prefix, value, comment)
Row = tuple[str, int, str]
STRUCT_NAMES = {"State": "h2nav_filter", "Gains": "h2nav_gains", "Sample": "h2nav_sample"}


_CALLED = f"""\
/* Copied into its callers it would cost code, or registers that they need. */
#if defined(__GNUC__)
#define {CALLED} __attribute__((noinline))
#else
#define {CALLED}
#endif

"""


class IntegerForm(NamedTuple):
    """The C form of one integer filter."""

    kernel: KernelFiles  # its files; the entry is called from outside
    more_entries: tuple[str, ...]  # other kernel functions that the interface calls
    bits: tuple[Row, ...]  # of a step's result
    about: str  # paragraphs of the header's first comment
    prototypes: str  # of the interface with comments, and what they need
    interface: str  # its functions; the gains are the constant ``GAINS``
    example: str  # a program around them
    called: tuple[str, ...] = ()  # kernel functions that no compiler is to copy into their callers

    @property
    def name(self) -> str:
        """Name of the filter, shared with its floating-point form."""
        return self.kernel.name.removesuffix("_integer")


class ExportedFirmware(NamedTuple):
    """Identity of one exported filter."""

    version: str  # of h2nav
    gains: str  # name of the gain file
    gain_hash: str  # SHA-256 of the gain file's contents
    numbers: Sequence[Number]  # the kernel's gains, in the order of the record
    constants: tuple[Row, ...] = ()  # more numbers that the interface takes from the gain file


def header(form: IntegerForm, firmware: ExportedFirmware, kernels: Sequence[KernelSource]) -> str:
    """Text of ``h2nav_filter.h``."""
    about = "\n".join(f" * {line}".rstrip() for line in form.about.splitlines())
    records = read_kernel(kernels).records
    structs = "\n".join(_struct(records[name]) for name in ("State", "Sample"))
    constants = enumeration("Of the gain file.", firmware.constants)
    return f"""\
/* Attitude filter in 32-bit integers. Made by h2nav {firmware.version} from {firmware.gains}.
 *
{about}
 */
#ifndef H2NAV_FILTER_H
#define H2NAV_FILTER_H

#include <stdint.h>

#define H2NAV_VERSION "{firmware.version}"
#define H2NAV_FORM "{form.name}"
#define H2NAV_GAINS "{firmware.gains}"
#define H2NAV_GAIN_HASH "{firmware.gain_hash}"

/* How many numbers the structs hold, all of them int32_t. */
#define H2NAV_STATE_SIZE {_size(records["State"])}
#define H2NAV_SAMPLE_SIZE {_size(records["Sample"])}

{structs}
{enumeration("Bits of the result.", form.bits)}{constants}{form.prototypes}
#endif
"""


def _struct(record: RecordSource) -> str:
    return struct_text(record.about, record.rows, STRUCT_NAMES[record.name])


def _size(record: RecordSource) -> int:
    return sum(row.length for row in record.rows)


def enumeration(comment: str, rows: Sequence[Row]) -> str:
    """C text of an enum with a comment behind each value; nothing without rows."""
    if not rows:
        return ""
    last = len(rows) - 1
    entries = [
        f"    H2NAV_{name} = {value}{',' if i < last else ''}"
        for i, (name, value, _) in enumerate(rows)
    ]
    width = max(map(len, entries))
    lines = [
        f"{entry:{width}} /* {text} */" if text else entry
        for entry, (_, _, text) in zip(entries, rows, strict=True)
    ]
    return "\n".join([f"/* {comment} */", "enum {", *lines, "};", "", ""])


def source(form: IntegerForm, firmware: ExportedFirmware, kernels: Sequence[KernelSource]) -> str:
    """Text of ``h2nav_filter.c``.

    Raises:
        Untranslatable: the kernel cannot be translated, or its ranges cannot be proved.
    """
    entries = (form.kernel.entry, *form.more_entries)
    translation = translate(kernels, entries, ["reset"], STRUCT_NAMES, form.called)
    gains = translation.kernel.records["Gains"]
    return f"""\
/* Made by h2nav {firmware.version} from {firmware.gains}; see h2nav_filter.h. */
#include "h2nav_filter.h"

{_CALLED if form.called else ""}{_struct(gains)}
{translation.code}
/* Gains {firmware.gain_hash} */
{constant_text(gains.rows, firmware.numbers, "static const h2nav_gains GAINS")}
static void clear(h2nav_filter *filter)
{{
    int32_t *numbers = (int32_t *)filter;
    for (int32_t i = 0; i < H2NAV_STATE_SIZE; i++) {{
        numbers[i] = 0;
    }}
}}

{form.interface}"""


CHECK = """\
/* Runs the test vectors: returns 0 when this build gives the same bits as every other. */
#include "h2nav_filter.h"
#include "h2nav_vectors.h"

int main(void)
{
    h2nav_filter filter;
    h2nav_sample sample;
    int32_t *numbers = (int32_t *)&sample;
    h2nav_init(&filter);
    for (int32_t row = 0; row < H2NAV_VECTORS; row++) {
        for (int32_t i = 0; i < H2NAV_SAMPLE_SIZE; i++) {
            numbers[i] = h2nav_samples[row][i];
        }
        if (h2nav_step(&filter, &sample) != h2nav_bits[row]) {
            return 1;
        }
    }
    numbers = (int32_t *)&filter;
    for (int32_t i = 0; i < H2NAV_STATE_SIZE; i++) {
        if (numbers[i] != h2nav_final[i]) {
            return 1;
        }
    }
    return 0;
}
"""


def vectors(samples: Sequence[Sequence[int]], bits: Sequence[int], final: Sequence[int]) -> str:
    """Text of ``h2nav_vectors.h``: samples, the bits of each step, the memory at the end."""
    rows = "\n".join(f"    {{{', '.join(map(_literal, row))}}}," for row in samples)
    flags = "\n".join(broken(f"    {', '.join(map(str, bits))}"))
    words = ",\n    ".join(map(_literal, final))
    return f"""\
/* Test vectors of h2nav_filter.c, made by the same filter in Python. */
#ifndef H2NAV_VECTORS_H
#define H2NAV_VECTORS_H

#include <stdint.h>

#define H2NAV_VECTORS {len(samples)}

/* An AVR has no memory for the tables: compile with -std=gnu99, and they stay in its flash. */
#ifdef __FLASH
#define H2NAV_TABLE const __flash
#else
#define H2NAV_TABLE const
#endif

static H2NAV_TABLE int32_t h2nav_samples[H2NAV_VECTORS][H2NAV_SAMPLE_SIZE] = {{
{rows}
}};

static H2NAV_TABLE int32_t h2nav_bits[H2NAV_VECTORS] = {{
{flags}
}};

static H2NAV_TABLE int32_t h2nav_final[H2NAV_STATE_SIZE] = {{
    {words}
}};

#endif
"""


def _literal(value: int) -> str:
    return str(value) if value > -(1 << 31) else "(-2147483647 - 1)"

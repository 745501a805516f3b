"""The files of an exported integer filter: C source, header, example, test vectors.

What differs between the forms of the filter stands in `firmware_lean` and `firmware_flight`.
"""

from collections.abc import Sequence
from types import ModuleType
from typing import NamedTuple

from h2nav.translate.c99 import translate
from h2nav.translate.layout import broken
from h2nav.translate.source import Source

# (name without prefix, value, comment)
Row = tuple[str, int, str]


class IntegerForm(NamedTuple):
    """One form of the integer filter, as C needs to know it.

    Attributes:
        name: on the command line and in the header.
        layout: the kernel module that names memory, parameters and sample, and has their ranges.
        modules: file names in ``attitude/kernels``, imported ones first.
        entries: kernel functions that the interface calls.
        words: words of the memory that a program reads.
        sample_words: words of a sample that a program writes itself.
        bits: of a step's result.
        about: paragraphs of the header's first comment.
        prototypes: of the interface with comments, and what they need.
        interface: its functions; the parameters are the table ``PARAMS``.
        example: a program around them.
    """

    name: str
    layout: ModuleType
    modules: tuple[str, ...]
    entries: tuple[str, ...]
    words: tuple[Row, ...]
    sample_words: tuple[Row, ...]
    bits: tuple[Row, ...]
    about: str
    prototypes: str
    interface: str
    example: str


class Firmware(NamedTuple):
    """What distinguishes one exported filter from another of its form.

    Attributes:
        version: of h2nav.
        gains: name of the gain file.
        gain_hash: SHA-256 of the gain file's contents.
        params: the kernel's parameters.
        constants: more numbers that the interface takes from the gain file.
    """

    version: str
    gains: str
    gain_hash: str
    params: Sequence[int]
    constants: tuple[Row, ...] = ()


def header(form: IntegerForm, firmware: Firmware) -> str:
    """Text of ``h2nav_filter.h``."""
    about = "\n".join(f" * {line}".rstrip() for line in form.about.splitlines())
    sample_words = enumeration("Words of a sample.", form.sample_words)
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

#define H2NAV_STATE_SIZE {form.layout.STATE_SIZE}
#define H2NAV_SAMPLE_SIZE {form.layout.SAMPLE_SIZE}

/* The filter's whole memory. */
typedef struct {{
    int32_t words[H2NAV_STATE_SIZE];
}} h2nav_filter;

{enumeration("Words of the memory.", form.words)}/* One sample. */
typedef struct {{
    int32_t words[H2NAV_SAMPLE_SIZE];
}} h2nav_sample;

{sample_words}{enumeration("Bits of the result.", form.bits)}{constants}{form.prototypes}
#endif
"""


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


def source(form: IntegerForm, firmware: Firmware, kernels: Sequence[Source]) -> str:
    """Text of ``h2nav_filter.c``.

    Args:
        form: of the filter.
        firmware: which one.
        kernels: the modules of the form.

    Raises:
        Refused: the kernel cannot be translated, or its ranges cannot be proved.
    """
    code = translate(kernels, form.entries, ["reset"]).code
    return f"""\
/* Made by h2nav {firmware.version} from {firmware.gains}; see h2nav_filter.h. */
#include "h2nav_filter.h"

{code}
/* Gains {firmware.gain_hash} */
static const int32_t PARAMS[{len(firmware.params)}] = {{
{_numbers(form.layout, firmware.params)}
}};

{form.interface}"""


def parameter_names(layout: ModuleType) -> list[str]:
    """Names of the kernel's parameters in their order; one with several numbers repeats its name.

    The first number of each stands in the layout between STATE_SIZE and PARAMS_SIZE, in rising
    order; what does not rise counts something.
    """
    size: int = layout.PARAMS_SIZE
    names = list(vars(layout))
    starts: list[tuple[int, str]] = []
    for name in names[names.index("STATE_SIZE") + 1 : names.index("PARAMS_SIZE")]:
        if getattr(layout, name) > (starts[-1][0] if starts else -1):
            starts.append((getattr(layout, name), name))
    ends = [start for start, _ in starts[1:]] + [size]
    return [
        name for (start, name), end in zip(starts, ends, strict=True) for _ in range(start, end)
    ]


def _numbers(layout: ModuleType, params: Sequence[int]) -> str:
    """The parameters as the inside of a C table, each with its name."""
    lines: list[str] = []
    names = parameter_names(layout)
    first = 0
    while first < len(params):
        count = names.count(names[first])
        values = ", ".join(map(str, params[first : first + count]))
        if count > 1:
            lines.append(f"    /* {names[first]}, {count} numbers */")
        lines.extend(broken(f"    {values}," + (f" /* {names[first]} */" if count == 1 else "")))
        first += count
    return "\n".join(lines)


CHECK = """\
/* Runs the test vectors: returns 0 when this build gives the same bits as every other. */
#include "h2nav_filter.h"
#include "h2nav_vectors.h"

int main(void)
{
    h2nav_filter filter;
    h2nav_sample sample;
    h2nav_init(&filter);
    for (int32_t row = 0; row < H2NAV_VECTORS; row++) {
        for (int32_t i = 0; i < H2NAV_SAMPLE_SIZE; i++) {
            sample.words[i] = h2nav_samples[row][i];
        }
        if (h2nav_step(&filter, &sample) != h2nav_bits[row]) {
            return 1;
        }
    }
    for (int32_t i = 0; i < H2NAV_STATE_SIZE; i++) {
        if (filter.words[i] != h2nav_final[i]) {
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

"""Random states, gains and samples at the ends of their declared ranges: nothing wraps in C.

`H2NAV_RANGE_FUZZ=10000000` draws as many samples as a release does.
"""

import functools
import os
import subprocess
from pathlib import Path

import needs
import pytest

from h2nav.apps.export_c import kernel_sources
from h2nav.attitude.kernel_files import VELOCITY_AIDED_INTEGER
from h2nav.attitude.record import rows
from h2nav.attitude.velocity_aided.integer.memory import Gains, Sample, State
from h2nav.translate.c99 import translate
from h2nav.translate.structs import struct_text

pytestmark = pytest.mark.thorough

HERE = Path(__file__).resolve().parent
STEPS = int(os.environ.get("H2NAV_RANGE_FUZZ", "150000"))


def ranges(name: str, record_type: type) -> str:
    """A table of the lowest and highest value of each number."""
    ends = [found.range or (0, 0) for found in rows(record_type) for _ in range(found.length)]
    # the lowest integer has no literal
    pairs = ", ".join(f"{{{low + 1} - 1, {high}}}" for low, high in ends)
    size = f"#define {name.upper()}_SIZE {len(ends)}\n"
    return f"{size}static const int32_t {name}_ranges[{len(ends)}][2] = {{{pairs}}};\n"


@functools.cache
def program() -> str:
    """The kernel, its tables and the loop over it."""
    translation = translate(kernel_sources(VELOCITY_AIDED_INTEGER), [VELOCITY_AIDED_INTEGER.entry])
    records = {"state": State, "gains": Gains, "sample": Sample}
    return "".join(
        (
            "#include <stdint.h>\n",
            *(struct_text(name, rows(record), record.__name__) for name, record in records.items()),
            translation.code,
            *(ranges(name, record) for name, record in records.items()),
            (HERE / "range_fuzz.c").read_text(encoding="utf-8"),
        )
    )


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_nothing_leaves_its_range_and_nothing_overflows(tmp_path: Path, compiler: str) -> None:
    source, linked = tmp_path / "fuzz.c", tmp_path / "fuzz"
    source.write_text(program(), encoding="utf-8")
    flags = {
        "gcc": ("-fsanitize=undefined", "-fno-sanitize-recover=all"),
        "clang": ("-fsanitize=undefined", "-fsanitize-trap=all"),
    }[compiler]
    command = (needs.need_program(compiler), "-std=c99", "-O1", *flags, source, "-lm", "-o", linked)
    subprocess.run(command, check=True)
    done = subprocess.run(
        [linked, str(STEPS)], capture_output=True, text=True, check=False, timeout=900
    )
    assert done.returncode == 0, done.stdout + done.stderr

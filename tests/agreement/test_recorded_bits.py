"""The same bits over a recording: what the service gives to the filters, by Python and by C."""

import importlib
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import needs
import pytest

TAKEOFF = needs.REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"
SAMPLES = 1000  # samples: alignment, the field of the place, the first fields


@pytest.fixture(scope="module")
def tool() -> Iterator[Any]:
    """tools/same_bits.py, which imports others beside it."""
    needs.need_program("gcc")
    place = str(needs.REPOSITORY / "tools")
    sys.path.insert(0, place)
    yield importlib.import_module("same_bits")
    sys.path.remove(place)


@pytest.fixture(scope="module")
def tape(tool: Any) -> Any:
    return next(iter(tool.tapes_of(TAKEOFF, SAMPLES)))


@pytest.mark.thorough
def test_python_compilers_and_a_core_agree_over_a_recording(
    tool: Any, tape: Any, tmp_path: Path
) -> None:
    boards = ["Cortex-M0"] if shutil.which("qemu-system-arm") else []
    found = tool.Builds(tmp_path, boards).run(tape)
    assert {f"gcc {level}" for level in tool.LEVELS} | set(boards) <= set(found)
    assert set(found.values()) == {tool.by_python(tape)}
    assert found["gcc -O0"].endswith(f"{SAMPLES:08x}")


def test_one_bit_of_a_sample_is_noticed(tool: Any, tape: Any) -> None:
    """Of a rate, two samples before the end; states that are written from outside are taped."""
    entries = list(tool.entries(tape))
    written = [number for number, (is_state, _) in enumerate(entries) if is_state]
    assert 0 in written
    assert 1 < len(written) < SAMPLES // 10
    (_, sample), *_ = entries[-3:]
    changed = tool.Tape(None, tape.gains, SAMPLES)
    changed.words = bytearray(tape.words)
    changed.words[-3 * 4 * (1 + len(sample)) + 4 + 2] ^= 1
    assert tool.by_python(changed) != tool.by_python(tape)

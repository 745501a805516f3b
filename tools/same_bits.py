"""The same bits over recordings: the filter in integers by Python, by C compilers, on Cortex-M.

Each recording goes through the service with the filters in integers. What the kernel of every
filter is given is taped: its samples, and its state wherever something else has written it (the
field of the place, a heading or attitude by velocities, a restart). The tape is then run by the
kernel in Python, by the exported C of every compiler and level, and with --boards on an emulated
core. Result and attitude of every sample, and all of the state with every sixteenth and before it
is written over, enter a checksum.

    python tools/same_bits.py DIR|FILE ... [--most N] [--boards CORE ...] [--json]
"""

import argparse
import contextlib
import io
import json
import shutil
import sys
import tempfile
from array import array
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, cast

from arithmetics_table import recordings
from bench_mcu import BOARDS, HERE, called
from false_alarms import Watcher

from h2nav.apps.filters import shipped_names
from h2nav.apps.playback import Playback, PlaybackOptions, inputs_for, pipeline_for
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.kernel_files import VELOCITY_AIDED_INTEGER
from h2nav.attitude.native import CompiledStep, compiled_step
from h2nav.attitude.record import assign, size_of, values
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.attitude.velocity_aided.integer.gains import integer_gains
from h2nav.attitude.velocity_aided.integer.kernel.start import reset
from h2nav.attitude.velocity_aided.integer.kernel.step import update
from h2nav.attitude.velocity_aided.integer.memory import Sample, State
from h2nav.cli import main as h2nav
from h2nav.files import gain_files
from h2nav.recordings.opening import open_flight
from h2nav.service.autopilot import Identity

SAMPLE, STATE = array("i", [0]).tobytes(), array("i", [1]).tobytes()
LEVELS = ("-O0", "-O1", "-O2", "-O3")
COMPILERS = ("gcc", "clang")
BEGIN, PRIME, WORD = 2166136261, 16777619, 0xFFFFFFFF
STATE_EVERY = 16  # samples


class Tape:
    """The compiled step of a filter, which notes everything that the kernel is given.

    Args:
        compiled: the step.
        gains: name of the gain file.
        most: samples; later ones are not noted.
    """

    def __init__(self, compiled: CompiledStep, gains: str, most: int) -> None:
        self._compiled, self._left = compiled, most
        self.gains, self.words, self.samples = gains, bytearray(), 0

    def bound(self, *records: Any) -> Callable[[], int]:
        """A function that notes state and sample, processes the sample and returns bits."""
        state, _, sample = records
        step = self._compiled.bound(*records)
        last = b""

        def taken() -> int:
            nonlocal last
            if self.samples == self._left:
                return step()
            before = bytes(state)
            if before != last:
                self.words += STATE + before
            self.words += SAMPLE + bytes(sample)
            self.samples += 1
            bits = step()
            last = bytes(state)
            return bits

        return taken


class Result(NamedTuple):
    """Checksums of one filter of a recording."""

    recording: str
    gains: str  # its gain file
    samples: int
    python: str  # checksum by Python
    differ: list[str]  # which of the others are not equal to it
    equal: list[str]  # which are


def tapes_of(path: Path, most: int) -> list[Tape]:
    """What the filters of a recording are given.

    Raises:
        SystemExit: the kernels are not compiled.
    """
    recording = open_flight(path)
    inputs = inputs_for(recording, PlaybackOptions())
    configuration = inputs.configuration
    settings = replace(configuration.filter, arithmetic="fixed")
    names = shipped_names(settings, configuration.autopilot.imu_rate_hz)
    tapes: list[Tape] = []

    def made(identity: Identity) -> AttitudeFilter:
        compiled = compiled_step(VELOCITY_AIDED_INTEGER)
        if compiled is None:
            raise SystemExit("the kernels are not compiled: pip install -e . with a C compiler")
        wanted = settings.vehicle_class
        name = names[identity.vehicle_class if wanted == "auto" else wanted]
        tapes.append(Tape(compiled, name, most))
        gains = velocity_aided_gains(gain_files.load(name), name)
        return IntegerVelocityAidedFilter(gains, name, cast("CompiledStep", tapes[-1]))

    pipeline = pipeline_for(recording, inputs, None, Watcher(), made)
    for _ in Playback(recording, whole_frames=inputs.whole_frames).through(pipeline):
        pass
    return [tape for tape in tapes if tape.samples]


def entries(tape: Tape) -> Iterator[tuple[bool, list[int]]]:
    """Whether it is a state, and the numbers; of each entry of a tape."""
    sizes = (size_of(Sample), size_of(State))
    words = array("i", bytes(tape.words))
    place = 0
    while place < len(words):
        end = place + 1 + sizes[words[place]]
        yield bool(words[place]), words[place + 1 : end].tolist()
        place = end


def by_python(tape: Tape) -> str:
    """Checksum of a tape by the kernel in Python."""
    gains = integer_gains(
        velocity_aided_gains(gain_files.load(tape.gains), tape.gains), tape.gains
    ).gains
    state, sample = State(), Sample()
    reset(state, gains)
    found, samples = BEGIN, 0

    def add(numbers: Any) -> None:
        nonlocal found
        for number in numbers:
            found = ((found ^ (number & WORD)) * PRIME) & WORD

    for is_state, numbers in entries(tape):
        if is_state:
            add(map(int, values(state, State)))
            assign(state, State, numbers)
            continue
        assign(sample, Sample, numbers)
        add((update(state, gains, sample), *state.q_nb))
        samples += 1
        if samples % STATE_EVERY == 0:
            add(map(int, values(state, State)))
    add(map(int, values(state, State)))
    return f"{found:08x} {samples:08x}"


class Builds:
    """The programs that run a tape, built once for each gain file.

    Args:
        folder: for their files.
        boards: emulated cores, of `bench_mcu.BOARDS`.
    """

    def __init__(self, folder: Path, boards: list[str]) -> None:
        self._folder, self._boards = folder, boards
        self._built: dict[str, dict[str, list[str | Path]]] = {}

    def run(self, tape: Tape) -> dict[str, str]:
        """Checksum of a tape by every program."""
        (self._folder / "tape").write_bytes(tape.words)
        commands = self._built.setdefault(tape.gains, {}) or self._build(tape.gains)
        return {
            name: " ".join((done := called(*command)).stdout.split() + done.stderr.split())
            for name, command in commands.items()
        }

    def _build(self, gains: str) -> dict[str, list[str | Path]]:
        exported = self._folder / gains
        with contextlib.redirect_stdout(io.StringIO()):
            h2nav(["export", "c", gains, "--form", "velocity_aided", "-o", str(exported)])
        tape = f'-DTAPE="{self._folder / "tape"}"'
        main_file, kernel = HERE / "same_bits.c", exported / "h2nav_filter.c"
        sources: list[str | Path] = [tape, f"-I{exported}", main_file, kernel]
        commands = self._built[gains]
        for compiler in filter(shutil.which, COMPILERS):
            for level in LEVELS:
                program = exported / f"{compiler}{level}"
                called(compiler, "-std=c99", level, *sources, "-o", program)
                commands[f"{compiler} {level}"] = [program]
        for core in self._boards:
            board, program = BOARDS[core], exported / f"{core}.elf"
            called(
                "arm-none-eabi-gcc", "-std=gnu99", "-O2", "-mthumb", *board.flags, "-nostartfiles",
                "-DBARE_METAL", f"-I{HERE}", f"-T{HERE / 'cortex_m.ld'}", HERE / "startup.c",
                *sources, "-o", program,
            )  # fmt: skip
            commands[core] = [
                "qemu-system-arm", "-M", board.machine, "-nographic", "-monitor", "none",
                "-serial", "none", "-semihosting-config", "enable=on,target=native",
                "-kernel", program,
            ]  # fmt: skip
        return commands


def compared(path: Path, builds: Builds, most: int) -> Iterator[Result]:
    """The checksums of a recording's filters."""
    for tape in tapes_of(path, most):
        python, others = by_python(tape), builds.run(tape)
        equal = [name for name, found in others.items() if found == python]
        differ = [name for name in others if name not in equal]
        yield Result(path.name, tape.gains, tape.samples, python, differ, equal)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("places", nargs="+", type=Path, help="recordings, and folders of them")
    parser.add_argument("--most", type=int, default=-1, help="samples of each filter")
    parser.add_argument("--boards", nargs="*", default=[], choices=BOARDS, help="emulated cores")
    parser.add_argument("--json", action="store_true", help="machine-readable result")
    args = parser.parse_args()
    found: list[Result] = []
    with tempfile.TemporaryDirectory() as name:
        builds = Builds(Path(name), args.boards)
        for path in recordings(args.places):
            for result in compared(path, builds, args.most):
                found.append(result)
                if not args.json:
                    said = f"DIFFER: {', '.join(result.differ)}" if result.differ else "equal"
                    print(f"{result.recording}: {result.samples} samples, {said}", flush=True)
    if args.json:
        print(json.dumps([result._asdict() for result in found]))
    else:
        total = sum(result.samples for result in found)
        names = ", ".join(found[0].equal + found[0].differ) if found else ""
        print(f"{len(found)} filters, {total} samples, by Python and {names}")
    return int(not found or any(result.differ for result in found))


if __name__ == "__main__":
    sys.exit(main())

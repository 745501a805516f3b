"""Cost of the exported filter on microcontrollers, next to float filters: time, flash, RAM, stack.

Every program is built by gcc for the emulated board, run bare-metal under QEMU, and its
instructions between two marks are counted one by one by a plugin: the counts are exact and the
same on every machine. On this computer valgrind counts in the same way. On an AVR under simavr the
program counts its own cycles with two timers; without avr-gcc or simavr this part is left out.

    python tools/bench_mcu.py [--json] [--steps N]
"""

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from programs import need

from h2nav.cli import main as h2nav

HERE = Path(__file__).resolve().parent / "mcu"


class Program(NamedTuple):
    """One filter of the bench.

    Attributes:
        title: for people.
        source: C file in ``tools/mcu``.
        form: of the exported filter that it needs; empty for a float filter.
        state: the variables that it remembers between two steps.
        flags: for the compiler.
        null: flags that give the harness without a filter the same samples.
        rounds: how many times as many samples it takes.
    """

    title: str
    source: str
    form: str
    state: frozenset[str]
    flags: tuple[str, ...] = ()
    null: tuple[str, ...] = ()
    rounds: int = 1


_MEMORY = frozenset({"filter"})
_TURNING = ("-DTURNING",)
FILTERS = {
    "velocity_aided": Program(
        "h2nav, velocity-aided, integers",
        "bench_velocity_aided.c",
        "velocity_aided",
        _MEMORY,
        (),
        _TURNING,
        3,
    ),
    "velocity_aided_fixes": Program(
        "  with velocity fixes at 5 Hz",
        "bench_velocity_aided.c",
        "velocity_aided",
        _MEMORY,
        ("-DWITH_FIXES",),
        _TURNING,
        3,
    ),
    "constant_gain": Program(
        "h2nav, constant gain, integers", "bench_constant_gain.c", "constant_gain", _MEMORY
    ),
    "mahony": Program("Mahony, float", "bench_mahony.c", "", frozenset({"q", "bias"})),
    "madgwick": Program("Madgwick, float", "bench_madgwick.c", "", frozenset({"q"})),
    "mekf": Program("6-state MEKF, float", "bench_mekf.c", "", frozenset({"q", "bias", "p"})),
}


def harness(program: Program) -> Program:
    """What a filter's program costs without the filter."""
    flags, rounds = program.null, program.rounds
    return Program("harness", "bench_null.c", "", frozenset(), flags, rounds=rounds)


class Board(NamedTuple):
    """An emulated core: QEMU's name of a board that has it, and gcc's flags."""

    machine: str
    flags: tuple[str, ...]


BOARDS = {
    "Cortex-M0": Board("microbit", ("-mcpu=cortex-m0",)),
    "Cortex-M3": Board("mps2-an385", ("-mcpu=cortex-m3",)),
    "Cortex-M4F": Board("mps2-an386", ("-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")),
}


AVR = "ATmega1284P"
AVR_PROGRAMS = ("avr-gcc", "avr-size", "avr-nm", "simavr")


class Cost(NamedTuple):
    """Cost of one filter on one core; on an AVR the counts are cycles, not instructions."""

    instructions_min: int
    instructions_max: int
    instructions_mean: float
    flash_bytes: int
    state_bytes: int
    stack_bytes: int


def called(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """Output of a program that must succeed."""
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{words[0]} failed:\n{done.stdout}{done.stderr}")
    return done


def flash_size(program: Path, tools: str = "arm-none-eabi") -> int:
    """Bytes of code and constants of a linked program."""
    fields = called(f"{tools}-size", program).stdout.splitlines()[1].split()
    return int(fields[0]) + int(fields[1])


def state_size(program: Path, names: frozenset[str], tools: str = "arm-none-eabi") -> int:
    """Bytes of the variables that a filter remembers."""
    lines = called(f"{tools}-nm", "-S", program).stdout.splitlines()
    fields = [line.split() for line in lines]
    return sum(int(f[1], 16) for f in fields if len(f) == 4 and f[3] in names)


def sources(folder: Path, program: Program) -> list[str | Path]:
    """Source files, macros and folders of a filter's program but for `main`."""
    form = folder / program.form
    exported = [form / "h2nav_filter.c"] if program.form else []
    return [*program.flags, f"-I{form}", f"-I{HERE}", HERE / program.source, *exported]


def build(folder: Path, program: Program, board: Board, steps: int) -> Path:
    """The linked benchmark of one filter."""
    linked = folder / "bench.elf"
    called(
        "arm-none-eabi-gcc", "-std=gnu99", "-O2", "-mthumb", *board.flags, "-fno-math-errno",
        "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections", "-nostartfiles",
        f"-DSTEPS={steps * program.rounds}", f"-T{HERE / 'cortex_m.ld'}",
        HERE / "startup.c", HERE / "bench_main.c", *sources(folder, program), "-lm", "-o", linked,
    )  # fmt: skip
    return linked


def run(program: Path, board: Board, plugin: Path) -> tuple[list[int], int]:
    """(min, max, total) instructions between the marks, and the deepest stack."""
    symbols = called("arm-none-eabi-nm", program).stdout
    begin, end = (
        re.search(rf"^([0-9a-f]+) T {mark}$", symbols, re.MULTILINE)[1]  # type: ignore[index]
        for mark in ("step_begins", "step_ends")
    )
    done = called(
        "qemu-system-arm", "-M", board.machine, "-nographic", "-monitor", "none", "-serial",
        "none", "-semihosting-config", "enable=on,target=native", "-plugin",
        f"{plugin},begin=0x{begin},end=0x{end}", "-kernel", program,
    )  # fmt: skip
    text = done.stdout + done.stderr
    counts = re.search(r"min (\d+) max (\d+) total (\d+)", text)
    assert counts is not None, text
    return [int(n) for n in counts.groups()], int(text.split()[0], 16)


def measure(folder: Path, plugin: Path, steps: int) -> dict[str, dict[str, Cost]]:
    """Costs by core and filter; what the harness itself costs is taken off."""
    table: dict[str, dict[str, Cost]] = {}
    for core, board in BOARDS.items():
        table[core] = {}
        for name, program in FILTERS.items():
            null = build(folder, harness(program), board, steps)
            (null_min, _, _), null_stack = run(null, board, plugin)
            null_flash = flash_size(null)
            linked = build(folder, program, board, steps)
            (least, most, total), stack = run(linked, board, plugin)
            table[core][name] = Cost(
                least - null_min,
                most - null_min,
                total / (steps * program.rounds) - null_min,
                flash_size(linked) - null_flash,
                state_size(linked, program.state),
                stack - null_stack,
            )
    return table


def run_avr(folder: Path, program: Program, steps: int) -> tuple[Path, list[int]]:
    """The benchmark of one filter for the AVR; its stack and least, most and total cycles."""
    linked = folder / "bench_avr.elf"
    called(
        "avr-gcc", "-std=gnu99", "-O2", f"-mmcu={AVR.lower()}", "-fno-math-errno",
        "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections",
        f"-DSTEPS={steps * program.rounds}", HERE / "startup_avr.c", HERE / "bench_main.c",
        *sources(folder, program), "-lm", "-o", linked,
    )  # fmt: skip
    output = called("simavr", "-m", AVR.lower(), "-f", "16000000", linked).stderr
    words = re.findall(r"([0-9a-f]{8})\.", output)
    assert len(words) == 6, output
    stack, _, least, most, total, _ = (int(word, 16) for word in words)
    return linked, [stack, least, most, total]


def on_avr(folder: Path, steps: int) -> dict[str, Cost] | None:
    """Costs in cycles on an AVR, by filter; None without its programs."""
    missing = [program for program in AVR_PROGRAMS if shutil.which(program) is None]
    if missing:
        print(f"{AVR} left out: {', '.join(missing)} not installed", file=sys.stderr)
        return None
    found = {}
    for name, program in FILTERS.items():
        null, (null_stack, null_cycles, _, _) = run_avr(folder, harness(program), steps)
        null_flash = flash_size(null, "avr")
        linked, (stack, least, most, total) = run_avr(folder, program, steps)
        found[name] = Cost(
            least - null_cycles,
            most - null_cycles,
            total / (steps * program.rounds) - null_cycles,
            flash_size(linked, "avr") - null_flash,
            state_size(linked, program.state, "avr"),
            stack - null_stack,
        )
    return found


def on_this_computer(folder: Path) -> dict[str, float] | None:
    """Instructions per step by valgrind's callgrind; None without valgrind."""
    if shutil.which("valgrind") is None or shutil.which("gcc") is None:
        return None
    found = {}
    for name, program in FILTERS.items():
        linked, steps = folder / "bench_host", 2000 * program.rounds
        called(
            "gcc", "-std=gnu99", "-O2", "-fno-math-errno", f"-DSTEPS={steps}",
            HERE / "bench_host.c", *sources(folder, program), "-lm", "-o", linked,
        )  # fmt: skip
        output = called(
            "valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null",
            "--toggle-collect=bench_step", linked,
        )  # fmt: skip
        counted = re.search(r"Collected : (\d+)", output.stderr)
        assert counted is not None
        found[name] = int(counted[1]) / (steps + 1)
    return found


def text_of(
    table: dict[str, dict[str, Cost]], avr: dict[str, Cost] | None, host: dict[str, float] | None
) -> str:
    """The table for people."""
    lines = []
    rows = [*table.items(), *([] if avr is None else [(AVR, avr)])]
    for core, row in rows:
        unit = "cycles/step      " if core == AVR else "instructions/step"
        lines.append(f"\n{core:32}  {unit}        flash  state  stack  ratio")
        lines.append(f"{'':32}    min     max    mean     bytes  bytes  bytes")
        least = row["constant_gain"].instructions_mean
        for name, cost in row.items():
            lines.append(
                f"{FILTERS[name].title:32}{cost.instructions_min:7}{cost.instructions_max:8}"
                f"{cost.instructions_mean:9.1f}{cost.flash_bytes:9}{cost.state_bytes:7}"
                f"{cost.stack_bytes:7}{cost.instructions_mean / least:7.1f}"
            )
    if host is not None:
        lines.append("\nthis computer (callgrind)         instructions/step, mean")
        lines.extend(f"{FILTERS[name].title:32}{count:9.1f}" for name, count in host.items())
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", action="store_true", help="machine-readable result")
    parser.add_argument(
        "--velocity-aided-gains", default="handheld_100hz", help="gain file of that filter"
    )
    parser.add_argument(
        "--constant-gain-gains", default="mpu9250_100hz", help="gain file of that filter"
    )
    parser.add_argument(
        "--steps",
        type=int,
        default=2000,
        help="samples per filter; the velocity-aided filter takes three times as many",
    )
    args = parser.parse_args()
    need("arm-none-eabi-gcc", "qemu-system-arm", "gcc")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        stdout, sys.stdout = sys.stdout, sys.stderr
        for form, gains in (
            ("velocity_aided", args.velocity_aided_gains),
            ("constant_gain", args.constant_gain_gains),
        ):
            h2nav(["export", "c", gains, "--form", form, "-o", str(folder / form)])
        sys.stdout = stdout
        plugin = folder / "count.so"
        called("gcc", "-shared", "-fPIC", "-O2", "-o", plugin, HERE / "count_plugin.c")
        table = measure(folder, plugin, args.steps)
        avr = on_avr(folder, args.steps)
        host = on_this_computer(folder)
    if args.json:
        costs = {core: {n: c._asdict() for n, c in row.items()} for core, row in table.items()}
        cycles = (
            None
            if avr is None
            else {
                name: {
                    key.replace("instructions", "cycles"): n for key, n in cost._asdict().items()
                }
                for name, cost in avr.items()
            }
        )
        print(json.dumps({"cores": costs, "avr": cycles, "host_instructions": host}))
    else:
        print(text_of(table, avr, host), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())

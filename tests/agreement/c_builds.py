"""Exported filters compiled for this computer and for others, and run."""

import re
import subprocess
from pathlib import Path

import needs
from agreement.identity import Identity
from agreement.identity_noise import write_ranges

from h2nav.cli import main

HERE = Path(__file__).resolve().parent
MCU = needs.REPOSITORY / "tools" / "mcu"
STRICT = ("-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic", "-std=c99")
BOARDS = {
    "cortex-m0": "microbit",
    "cortex-m3": "mps2-an385",
    "cortex-m4": "mps2-an386",
}
# Both have a hardware multiplier; the second has return addresses of three bytes.
AVRS = ("atmega1284p", "atmega2560")
__all__ = [
    "AVRS",
    "BOARDS",
    "STRICT",
    "build_and_run",
    "build_avr",
    "build_bare_metal",
    "export",
    "run_avr",
    "run_board",
]


def export(folder: Path, identity: Identity) -> Path:
    """The exported C files, and what the identity program includes beside them."""
    gains, form = identity.gains, identity.name
    assert main(["export", "c", gains, "--form", form, "-o", str(folder), "--json"]) == 0
    write_ranges(folder, identity.sample_type)
    return folder


def _identity_flags(folder: Path, identity: Identity, steps: int) -> list[str]:
    samples = f'-DSAMPLES="identity_{identity.name}.h"'
    return [samples, f"-DSTEPS={steps}u", f"-I{folder}", f"-I{HERE}"]


def _called(*words: str | Path) -> str:
    done = subprocess.run(
        [str(word) for word in words], capture_output=True, text=True, timeout=240, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def build_and_run(
    folder: Path,
    identity: Identity,
    compiler: str,
    flags: tuple[str, ...],
    steps: int,
    runner: tuple[str, ...] = (),
) -> list[str]:
    """Words that the identity program prints when built by `compiler`."""
    program = folder / f"identity_{compiler}_{'_'.join(flags).replace('-', '')}"
    _called(
        needs.need_program(compiler), *STRICT, *flags, *_identity_flags(folder, identity, steps),
        HERE / "identity_main.c", folder / "h2nav_filter.c", "-o", program,
    )  # fmt: skip
    return _called(*runner, program).split()


def build_bare_metal(folder: Path, identity: Identity, core: str, steps: int) -> Path:
    """The identity program for a Cortex-M."""
    program = folder / f"identity_{core}.elf"
    _called(
        needs.need_program("arm-none-eabi-gcc"), "-std=gnu99", "-O2", "-mthumb", f"-mcpu={core}",
        "-ffreestanding", "-nostdlib", "-nostartfiles", "-DBARE_METAL",
        *_identity_flags(folder, identity, steps), f"-I{MCU}", f"-T{MCU / 'cortex_m.ld'}",
        MCU / "startup.c",
        HERE / "identity_main.c", folder / "h2nav_filter.c", "-lgcc", "-o", program,
    )  # fmt: skip
    return program


def run_board(program: Path, core: str) -> list[str]:
    """What a program prints through semihosting on the emulated board of `core`."""
    done = subprocess.run(
        [
            needs.need_program("qemu-system-arm"), "-M", BOARDS[core], "-nographic",
            "-monitor", "none", "-serial", "none",
            "-semihosting-config", "enable=on,target=native", "-kernel", str(program),
        ],
        capture_output=True, text=True, timeout=240, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return (done.stdout + done.stderr).split()


def build_avr(folder: Path, identity: Identity, mcu: str, main_file: Path, steps: int = 0) -> Path:
    """A program around the filter for an AVR, where an int has 16 bits.

    Its old compiler warns where it builds on signed numbers that do not overflow: they are proved.
    """
    program = folder / f"{main_file.stem}_{mcu}.elf"
    warnings = [flag for flag in STRICT if flag != "-pedantic" and not flag.startswith("-std")]
    compiler = (
        needs.need_program("avr-gcc"), *warnings, "-Wno-strict-overflow", "-std=gnu99", "-O2",
        f"-mmcu={mcu}",
    )  # fmt: skip
    kernel = folder / f"h2nav_filter_{mcu}.o"
    if not kernel.exists():  # of all programs the same
        _called(*compiler, "-c", folder / "h2nav_filter.c", "-o", kernel)
    _called(
        *compiler, "-DBARE_METAL", *_identity_flags(folder, identity, steps), f"-I{MCU}",
        MCU / "startup_avr.c", main_file, kernel, "-o", program,
    )  # fmt: skip
    return program


def run_avr(program: Path, mcu: str) -> list[str]:
    """What a program prints through the serial port; its last word is the result of `main`."""
    done = subprocess.run(
        [needs.need_program("simavr"), "-m", mcu, "-f", "16000000", str(program)],
        capture_output=True, text=True, timeout=240, check=False,
    )  # fmt: skip
    words = re.findall(r"([0-9a-f]{8})\.", done.stderr)
    assert len(words) >= 4, done.stderr[-2000:]
    return [*words[:-4], words[-1]]  # the three before count cycles

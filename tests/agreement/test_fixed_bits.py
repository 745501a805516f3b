"""One filter, the same bits: Python integers, C by several compilers, microcontrollers."""

import subprocess
from pathlib import Path

import needs
import pytest
from agreement import c_builds
from agreement.identity_samples import samples

from h2nav.attitude.fixed_gains import fixed_image
from h2nav.attitude.kernels import fixed_lean as kernel
from h2nav.io import gain_files

STEPS = 1_000_000
AVR_STEPS = 20_000  # four rounds of everything; a simulated AVR is slow


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return c_builds.export(tmp_path_factory.mktemp("exported"))


@pytest.fixture(scope="module")
def python_words() -> list[str]:
    words, state = identity(STEPS)
    assert state[kernel.SATURATIONS] > 1000  # the limits have been met
    return words


def identity(steps: int) -> tuple[list[str], list[int]]:
    """What the identity program prints, from Python integers, and the memory at its end."""
    image = fixed_image(gain_files.load("mpu9250_100hz"), "mpu9250_100hz")
    params, state = list(image.params), [0] * kernel.STATE_SIZE
    kernel.reset(state)
    update, mix = kernel.update, 0
    for sample in samples(steps):
        bits = update(state, params, sample)
        q_w, q_x, q_y, q_z = state[:4]
        mix = (mix * 16777619 + q_w + 3 * q_x + 5 * q_y + 7 * q_z + bits) & 0xFFFFFFFF
    return [f"{word & 0xFFFFFFFF:08x}" for word in (mix, *state)], state


@pytest.mark.parametrize(
    ("compiler", "flags"),
    [("gcc", ("-O0",)), ("gcc", ("-O2",)), ("gcc", ("-Os",)), ("clang", ("-O2",))],
)
def test_this_computer(
    exported: Path, python_words: list[str], compiler: str, flags: tuple[str, ...]
) -> None:
    assert c_builds.build_and_run(exported, compiler, flags, STEPS) == python_words


def test_aarch64(exported: Path, python_words: list[str]) -> None:
    runner = (needs.need_program("qemu-aarch64"),)
    words = c_builds.build_and_run(
        exported, "aarch64-linux-gnu-gcc", ("-O2", "-static"), STEPS, runner
    )
    assert words == python_words


@pytest.mark.parametrize("core", c_builds.BOARDS)
def test_microcontroller(exported: Path, python_words: list[str], core: str) -> None:
    program = c_builds.build_bare_metal(exported, core, STEPS)
    assert c_builds.run_board(program, core) == python_words


@pytest.mark.parametrize("mcu", c_builds.AVRS)
def test_avr_where_an_int_has_16_bits(exported: Path, mcu: str) -> None:
    main_file = c_builds.HERE / "identity_main.c"
    program = c_builds.build_avr(exported, mcu, main_file, AVR_STEPS)
    words, state = identity(AVR_STEPS)
    assert state[kernel.SATURATIONS] > 1000
    assert c_builds.run_avr(program, mcu) == [*words, "00000000"]


@pytest.mark.parametrize("mcu", c_builds.AVRS)
def test_avr_accepts_the_exported_vectors(exported: Path, mcu: str) -> None:
    def result() -> list[str]:
        program = c_builds.build_avr(exported, mcu, exported / "check_vectors.c")
        return c_builds.run_avr(program, mcu)

    assert result() == ["00000000"]
    source = exported / "h2nav_vectors.h"
    text = source.read_text()
    head, last = text.rsplit(",\n    ", 1)
    try:  # one wrong bit in the last word of the memory is noticed
        source.write_text(f"{head},\n    1 ^ {last}")
        assert result() == ["00000001"]
    finally:
        source.write_text(text)


@pytest.mark.parametrize(
    ("compiler", "checks"),
    [
        ("gcc", ("undefined",)),
        # Also what is defined but loses bits: conversions that change a value. The filter has no
        # unsigned number; the generator of the samples wraps one on purpose.
        ("clang", ("undefined", "integer", "implicit-conversion", "local-bounds")),
    ],
)
def test_undefined_behaviour_sanitizer_has_nothing_to_report(
    exported: Path, compiler: str, checks: tuple[str, ...]
) -> None:
    # clang's report needs a library that is not always installed with it; a trap needs none
    after = {
        "gcc": ("-fno-sanitize-recover=all",),
        "clang": ("-fsanitize-trap=all", "-fno-sanitize=unsigned-integer-overflow"),
    }[compiler]
    flags = ("-O1", f"-fsanitize={','.join(checks)}", *after)
    words = c_builds.build_and_run(exported, compiler, flags, 3 * STEPS)
    assert len(words) == 1 + kernel.STATE_SIZE


@pytest.mark.parametrize("compiler", ["gcc", "clang", "arm-none-eabi-gcc"])
def test_freestanding_without_any_undefined_symbol(exported: Path, compiler: str) -> None:
    extra = ("-mthumb", "-mcpu=cortex-m0") if compiler.startswith("arm") else ()
    target = exported / f"{compiler}.o"
    command = (needs.need_program(compiler), *c_builds.STRICT, *extra, "-O2", "-ffreestanding")
    subprocess.run(
        [*command, "-nostdlib", "-c", exported / "h2nav_filter.c", "-o", target], check=True
    )
    nm = needs.need_program("arm-none-eabi-nm" if extra else "nm")
    assert subprocess.run([nm, "-u", target], capture_output=True, check=True).stdout == b""


def test_the_exported_programs_accept_their_own_build(exported: Path) -> None:
    compiler = needs.need_program("gcc")
    for name in ("check_vectors", "example"):
        program = exported / name
        sources = [exported / f"{name}.c", exported / "h2nav_filter.c"]
        subprocess.run([compiler, *c_builds.STRICT, *sources, "-o", program], check=True)
        assert subprocess.run([program], check=False).returncode == 0


def test_no_float_no_division_in_the_exported_source(exported: Path) -> None:
    text = (exported / "h2nav_filter.c").read_text()
    code = "".join(part.split("*/", 1)[-1] for part in text.split("/*"))
    for word in ("float", "double", " / ", " % ", "#include <"):
        assert word not in code

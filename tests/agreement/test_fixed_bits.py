"""One filter, the same bits: Python integers, C by several compilers, microcontrollers."""

import subprocess
from pathlib import Path

import needs
import pytest
from agreement import c_builds
from agreement.identity import IDENTITIES, Identity, Run, run

from h2nav.attitude.record import size_of

pytestmark = pytest.mark.thorough

STEPS = 1 << 17  # both halves of the samples: phases of some kinds, and of all
AVR_STEPS = 8192  # three rounds and more, and two places; a simulated AVR is slow


@pytest.fixture(scope="module", params=sorted(IDENTITIES))
def identity(request: pytest.FixtureRequest) -> Identity:
    return IDENTITIES[request.param]


@pytest.fixture(scope="module")
def exported(identity: Identity, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return c_builds.export(tmp_path_factory.mktemp("exported"), identity)


@pytest.fixture(scope="module")
def python(identity: Identity) -> Run:
    return run(identity, STEPS)


def test_the_samples_reach_everything(identity: Identity, python: Run) -> None:
    """Limits are met, every bit of the result is set and cleared."""
    assert python.memory.saturations > 1000
    for name, bit, _ in identity.form.text.bits:
        assert 1 < python.bits[bit] < STEPS - 1, name


@pytest.mark.parametrize(
    ("compiler", "flags"),
    [
        *(("gcc", (level,)) for level in ("-O0", "-O1", "-O2", "-O3", "-Os")),
        *(("clang", (level,)) for level in ("-O0", "-O2", "-O3")),
    ],
)
def test_this_computer(
    exported: Path, identity: Identity, python: Run, compiler: str, flags: tuple[str, ...]
) -> None:
    assert c_builds.build_and_run(exported, identity, compiler, flags, STEPS) == python.words


def test_aarch64(exported: Path, identity: Identity, python: Run) -> None:
    runner = (needs.need_program("qemu-aarch64"),)
    words = c_builds.build_and_run(
        exported, identity, "aarch64-linux-gnu-gcc", ("-O2", "-static"), STEPS, runner
    )
    assert words == python.words


@pytest.mark.parametrize("core", c_builds.BOARDS)
def test_microcontroller(exported: Path, identity: Identity, python: Run, core: str) -> None:
    program = c_builds.build_bare_metal(exported, identity, core, STEPS)
    assert c_builds.run_board(program, core) == python.words


def test_avr_where_an_int_has_16_bits(exported: Path, identity: Identity) -> None:
    # The second core has longer return addresses alone, which the vectors below go through.
    mcu, main_file = c_builds.AVRS[0], c_builds.HERE / "identity_main.c"
    program = c_builds.build_avr(exported, identity, mcu, main_file, AVR_STEPS)
    assert c_builds.run_avr(program, mcu) == [*run(identity, AVR_STEPS).words, "00000000"]


@pytest.mark.parametrize("mcu", c_builds.AVRS)
def test_avr_accepts_the_exported_vectors(exported: Path, identity: Identity, mcu: str) -> None:
    def result() -> list[str]:
        program = c_builds.build_avr(exported, identity, mcu, exported / "check_vectors.c")
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
    exported: Path, identity: Identity, compiler: str, checks: tuple[str, ...]
) -> None:
    # clang's report needs a library that is not always installed with it; a trap needs none
    after = {
        "gcc": ("-fno-sanitize-recover=all",),
        "clang": ("-fsanitize-trap=all", "-fno-sanitize=unsigned-integer-overflow"),
    }[compiler]
    flags = ("-O1", f"-fsanitize={','.join(checks)}", *after)
    words = c_builds.build_and_run(exported, identity, compiler, flags, 6 * STEPS)
    assert len(words) == 1 + size_of(identity.memory_type)


# Without optimisation a compiler copies records by calls, with all of it loops become calls.
@pytest.mark.parametrize("level", ["-O0", "-O3"])
@pytest.mark.parametrize("compiler", ["gcc", "clang", "arm-none-eabi-gcc"])
def test_freestanding_without_any_undefined_symbol(
    exported: Path, compiler: str, level: str
) -> None:
    extra = ("-mthumb", "-mcpu=cortex-m0") if compiler.startswith("arm") else ()
    target = exported / f"{compiler}.o"
    command = (needs.need_program(compiler), *c_builds.STRICT, *extra, level, "-ffreestanding")
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
    for word in ("float", "double", " / ", " % ", "int64_t", "#include <"):
        assert word not in code

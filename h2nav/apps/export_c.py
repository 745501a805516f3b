"""`h2nav export c`: writes the integer filter of a gain file as freestanding C99."""

import argparse
import json
import random
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from h2nav.errors import BadInput

if TYPE_CHECKING:
    from h2nav.translate.source import Source

VECTOR_ROWS = 400


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument("gains", metavar="GAINS.yaml", help="gain file, or name of a shipped one")
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="DIR", help="folder for the C files"
    )
    parser.add_argument("--json", action="store_true", help="machine-readable result")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    from h2nav import __version__
    from h2nav.attitude.fixed_gains import fixed_image
    from h2nav.attitude.gain_seal import seal
    from h2nav.attitude.kernels import fixed_lean as kernel
    from h2nav.io import gain_files
    from h2nav.translate import firmware

    path = gain_files.find(args.gains)
    file = gain_files.load(path)
    image = fixed_image(file, str(path))
    facts = firmware.Firmware(__version__, file.name, seal(file), image.params, _parameter_names())
    samples = vector_samples()
    state = [0] * kernel.STATE_SIZE
    kernel.reset(state)
    params = list(image.params)
    bits = [kernel.update(state, params, sample) for sample in samples]
    texts = {
        "h2nav_filter.h": firmware.header(facts),
        "h2nav_filter.c": firmware.source(facts, kernel_sources()),
        "example.c": firmware.EXAMPLE,
        "check_vectors.c": firmware.CHECK,
        "h2nav_vectors.h": firmware.vectors(samples, bits, state),
    }
    _write(args.output, texts)
    _report(args, file.name, facts.gain_hash, image.rounding_error, texts)
    return 0


def kernel_sources() -> list["Source"]:
    """The modules of the lean kernel as text, imported ones first."""
    from h2nav.attitude import kernels
    from h2nav.translate.source import Source

    folder = Path(kernels.__file__).parent
    names = ("fixed_triad.py", "fixed_motion.py", "fixed_lean.py")
    return [Source(f"kernels/{name}", (folder / name).read_text("utf-8")) for name in names]


def vector_samples(rows: int = VECTOR_ROWS, seed: int = 1) -> list[list[int]]:
    """Samples for a test vector: ordinary motion first, then whatever the formats hold."""
    from h2nav.attitude.kernels import fixed_lean as kernel

    rng = random.Random(seed)
    samples = []
    for row in range(rows):
        wild = row >= rows // 2
        if wild:
            sample = [rng.randint(lo, hi) for lo, hi in kernel.SAMPLE_RANGES]
        else:
            rates = [rng.randint(-1100000, 1100000) for _ in range(3)]
            noise = [rng.randint(-300, 300) for _ in range(6)]
            vectors = [0, 0, 16384, 8192, 0, 14189]
            vectors = [a + b for a, b in zip(vectors, noise, strict=True)]
            sample = [*rates, *vectors, -(row & 1), 10000]
        samples.append(sample)
    return samples


def _parameter_names() -> list[str]:
    """Names of the kernel's parameters, in their order."""
    from h2nav.attitude.kernels import fixed_lean as kernel

    first, last = "FIELD_X", "BOOST_SHIFT"
    names = list(vars(kernel))
    return names[names.index(first) : names.index(last) + 1]


def _write(folder: Path, texts: dict[str, str]) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{folder}: cannot be written ({error.strerror}); name a folder") from error


def _report(
    args: argparse.Namespace,
    name: str,
    gain_hash: str,
    rounding_error: float,
    texts: dict[str, str],
) -> None:
    sizes = {file: len(text.encode()) for file, text in texts.items()}
    if args.json:
        result: dict[str, object] = {
            "ok": True,
            "gains": name,
            "gain_hash": gain_hash,
            "rounding_error": rounding_error,
            "directory": str(args.output),
            "files": {file: {"bytes": size} for file, size in sizes.items()},
        }
        json.dump(result, sys.stdout)
        sys.stdout.write("\n")
        return
    for file, size in sizes.items():
        sys.stdout.write(f"{args.output / file}  {size} bytes\n")

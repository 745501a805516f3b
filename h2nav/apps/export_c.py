"""`h2nav export c`: writes the integer filter of a gain file as freestanding C99."""

import argparse
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput

if TYPE_CHECKING:
    from h2nav.apps.export_forms import ExportedForm
    from h2nav.attitude.kernel_files import KernelFiles
    from h2nav.translate.firmware import ExportedFirmware
    from h2nav.translate.source import KernelSource

_NOT_IN_C = r'["\\]|\*/|\?\?'  # what ends a string or a comment, or is read as another character


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument("gains", metavar="GAINS.yaml", help="gain file, or name of a shipped one")
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="DIR", help="folder for the C files"
    )
    parser.add_argument(
        "--form",
        choices=("velocity_aided", "constant_gain", "flight", "lean"),
        help="velocity_aided (formerly flight): the kernel that the daemon runs with"
        " filter.arithmetic fixed, usual for gain files of that kind; what the floats have besides"
        " is in docs/fixed-point.md; constant_gain (formerly lean): for the smallest"
        " microcontrollers, the only one for files of kind two_stage",
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    from h2nav import __version__
    from h2nav.attitude.gains.seal import seal
    from h2nav.attitude.record import values
    from h2nav.files import gain_files
    from h2nav.translate import firmware

    path = gain_files.find(args.gains)
    file = gain_files.load(path)
    if re.search(_NOT_IN_C, file.name) or not file.name.isprintable():
        raise BadInput(
            f'{path}: name: {file.name!r} cannot stand in C; expected one line without " \\ */ and '
            "??: name the model so, and make the file again with h2nav synthesize"
        )
    form = _form(args.form, file.filter_name, str(path))
    image = form.image(file, str(path))
    numbers = values(image.gains, type(image.gains))
    facts = firmware.ExportedFirmware(__version__, file.name, seal(file), numbers, image.constants)
    sources = kernel_sources(form.text.kernel)
    texts = {
        "h2nav_filter.h": firmware.header(form.text, facts, sources),
        "h2nav_filter.c": firmware.source(form.text, facts, sources),
        "example.c": form.text.example,
        "check_vectors.c": firmware.CHECK,
        "h2nav_vectors.h": firmware.vectors(*form.vectors(image.gains)),
    }
    _write(args.output, texts)
    _report(args, facts, form.text.name, image.rounding_error, texts)
    return 0


def _form(name: str | None, kind: str, place: str) -> "ExportedForm":
    """The form of this name, else the usual one of the kind of gain file."""
    from h2nav.apps.export_forms import FORMS

    possible = [form for form in FORMS if kind in form.kinds]
    for form in possible:
        if name in (None, form.text.name, form.former_name):
            return form
    names = " or ".join(form.text.name for form in possible)
    raise BadInput(f"{place}: --form {name} cannot be made of a file of kind {kind}; give {names}")


def kernel_sources(kernel: "KernelFiles") -> list["KernelSource"]:
    """The modules of a kernel as text, imported ones first."""
    from h2nav import attitude
    from h2nav.translate.source import KernelSource

    folder = Path(attitude.__path__[0])
    return [KernelSource(path, (folder / path).read_text("utf-8")) for path in kernel.paths]


def _write(folder: Path, texts: dict[str, str]) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{folder}: cannot be written ({error.strerror}); name a folder") from error


def _report(
    args: argparse.Namespace,
    facts: "ExportedFirmware",
    form: str,
    rounding_error: float,
    texts: dict[str, str],
) -> None:
    sizes = {file: len(text.encode()) for file, text in texts.items()}
    if args.json:
        result: dict[str, object] = {
            "ok": True,
            "gains": facts.gains,
            "form": form,
            "gain_hash": facts.gain_hash,
            "rounding_error": rounding_error,
            "directory": str(args.output),
            "files": {file: {"bytes": size} for file, size in sizes.items()},
        }
        print_json(result)
        return
    for file, size in sizes.items():
        sys.stdout.write(f"{args.output / file}  {size} bytes\n")

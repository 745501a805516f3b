"""`h2nav export c`: writes the integer filter of a gain file as freestanding C99."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput

if TYPE_CHECKING:
    from h2nav.apps.export_forms import ExportedForm
    from h2nav.translate.firmware import Firmware, IntegerForm
    from h2nav.translate.source import Source


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument("gains", metavar="GAINS.yaml", help="gain file, or name of a shipped one")
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="DIR", help="folder for the C files"
    )
    parser.add_argument(
        "--form",
        choices=("flight", "lean"),
        help="flight: the whole default filter, usual for gain files of kind shaped; lean: the"
        " constant-gain filter, the only one for kind two_stage",
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    from h2nav import __version__
    from h2nav.attitude.gain_seal import seal
    from h2nav.io import gain_files
    from h2nav.translate import firmware

    path = gain_files.find(args.gains)
    file = gain_files.load(path)
    form = _form(args.form, file.kind, str(path))
    image = form.image(file, str(path))
    facts = firmware.Firmware(__version__, file.name, seal(file), image.params, image.constants)
    samples = form.samples()
    params, state = list(image.params), form.start(image.params)
    bits = [form.step(state, params, sample) for sample in samples]
    texts = {
        "h2nav_filter.h": firmware.header(form.text, facts),
        "h2nav_filter.c": firmware.source(form.text, facts, kernel_sources(form.text)),
        "example.c": form.text.example,
        "check_vectors.c": firmware.CHECK,
        "h2nav_vectors.h": firmware.vectors(samples, bits, state),
    }
    _write(args.output, texts)
    _report(args, facts, form.text.name, image.rounding_error, texts)
    return 0


def _form(name: str | None, kind: str, place: str) -> "ExportedForm":
    """The form of this name, else the usual one of the kind of gain file."""
    from h2nav.apps.export_forms import FORMS

    possible = [form for form in FORMS if kind in form.kinds]
    for form in possible:
        if name in (None, form.text.name):
            return form
    names = " or ".join(form.text.name for form in possible)
    raise BadInput(f"{place}: --form {name} cannot be made of a file of kind {kind}; give {names}")


def kernel_sources(form: "IntegerForm") -> list["Source"]:
    """The modules of a form's kernel as text, imported ones first."""
    from h2nav.attitude import kernels
    from h2nav.translate.source import Source

    folder = Path(kernels.__file__).parent
    return [Source(f"kernels/{name}", (folder / name).read_text("utf-8")) for name in form.modules]


def _write(folder: Path, texts: dict[str, str]) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{folder}: cannot be written ({error.strerror}); name a folder") from error


def _report(
    args: argparse.Namespace,
    facts: "Firmware",
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

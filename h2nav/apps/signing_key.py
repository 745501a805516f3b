"""``h2nav signing-key``: writes the key of a passphrase, as ground stations derive it."""

import argparse
import getpass
import sys
from pathlib import Path

from h2nav.errors import BadInput
from h2nav.files.signing_keys import key_of_passphrase, write_signing_key


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FILE", help="new file, mode 0600"
    )
    parser.epilog = (
        "The passphrase is prompted for, or read from the first line of standard input: all users "
        "of the computer could read it on a command line."
    )


def run(args: argparse.Namespace) -> int:
    """Writes the key file; returns 0."""
    try:
        key = key_of_passphrase(_passphrase())
    except UnicodeError:
        raise BadInput("signing-key: the passphrase is no text; nothing was written") from None
    except EOFError:  # Ctrl-D
        raise KeyboardInterrupt from None
    write_signing_key(args.output, key)
    print(f"{args.output}: written", file=sys.stderr)
    return 0


def _passphrase() -> str:
    if sys.stdin.isatty():
        passphrase = getpass.getpass("Passphrase: ")
        if getpass.getpass("Again: ") != passphrase:
            raise BadInput("signing-key: the two passphrases differ; nothing was written")
    else:
        passphrase = sys.stdin.readline().rstrip("\r\n")
    if not passphrase:
        raise BadInput("signing-key: the passphrase is empty; nothing was written")
    return passphrase

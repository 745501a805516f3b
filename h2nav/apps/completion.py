"""``h2nav completion``: prints a shell script that completes commands, options and values."""

import argparse
import importlib
import sys
from collections.abc import Mapping

from h2nav.apps.command_words import CommandWords, Value, WordKind, command_words
from h2nav.apps.completion_scripts import SCRIPTS

NOWHERE = CommandWords("", "", (), Value(WordKind.NOTHING))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = (
        "where it is found by itself:\n"
        "  h2nav completion bash > ~/.local/share/bash-completion/completions/h2nav\n"
        "  h2nav completion zsh  > _h2nav     # in a folder of $fpath\n"
        "  h2nav completion fish > ~/.config/fish/completions/h2nav.fish"
    )
    parser.add_argument("shell", choices=SCRIPTS, help="the shell that it is for")


def run(args: argparse.Namespace) -> int:
    """Prints the script; `args.listed` holds every command."""
    sys.stdout.write(SCRIPTS[args.shell](_lines(args.listed)))
    return 0


def _lines(listed: Mapping[tuple[str, ...], tuple[str, str, str]]) -> list[CommandWords]:
    """Every command and group of commands, as its own parser declares it."""
    top = argparse.ArgumentParser(prog="h2nav")
    top.add_argument("--version", action="store_true", help="version and backend, then exit")
    lines = [command_words("", "", top)]
    groups = {words[0] for words in listed if len(words) > 1}
    for group in sorted(groups):
        lines.append(NOWHERE._replace(command=group, summary=f"commands of {group}"))
    for words, (module_name, summary, _) in listed.items():
        parser = argparse.ArgumentParser(prog=" ".join(words))
        importlib.import_module(f"h2nav.apps.{module_name}").add_arguments(parser)
        lines.append(command_words(" ".join(words), summary, parser))
    return lines

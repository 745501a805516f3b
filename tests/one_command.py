"""The command line with one command: to declare all the others takes most of the time of a test."""

from collections.abc import Sequence

import pytest

from h2nav import cli


def main(words: Sequence[str]) -> int:
    """As `h2nav.cli.main`, of the command that the words begin with."""
    (line,) = (line for line in cli.COMMANDS if tuple(words[: len(line)]) == line)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cli, "COMMANDS", {line: cli.COMMANDS[line]})
        patch.setattr(cli, "GROUPS", {name: cli.GROUPS[name] for name in line[:1] if len(line) > 1})
        return cli.main(list(words))

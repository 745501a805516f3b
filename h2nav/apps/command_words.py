"""The words accepted after each command, from its parser: options, their values, arguments."""

import argparse
from collections.abc import Iterable
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from h2nav.sim.faults import FAULT_KINDS
from h2nav.sim.personalities import PERSONALITIES
from h2nav.sim.scenarios import SCENARIOS


class WordKind(Enum):
    """The kind of a value."""

    NOTHING = "nothing"  # no completion is possible, for example of a number
    FILES = "files"
    FOLDERS = "folders"
    WORDS = "words"


class Value(NamedTuple):
    """The value of an option or argument."""

    kind: WordKind
    words: tuple[str, ...] = ()  # to choose from


class Option(NamedTuple):
    """An option of a command."""

    names: tuple[str, ...]  # such as ``-c`` and ``--config``
    value: Value | None  # of the option; None = it takes none
    summary: str  # one line of help


class CommandWords(NamedTuple):
    """A command line."""

    command: str  # its words, such as ``log info``; empty = before any command
    summary: str  # one line of help
    options: tuple[Option, ...]
    argument: Value  # words without an option


# Values that the parser leaves open, because the command itself checks them or accepts more.
OPEN_VALUES: dict[tuple[str, str], Iterable[str]] = {
    ("fake-autopilot", "--scenario"): SCENARIOS,
    ("fake-autopilot", "--autopilot"): PERSONALITIES,
    ("fake-autopilot", "--fault"): [f"{name}@" for name in FAULT_KINDS],
}


def command_words(command: str, summary: str, parser: argparse.ArgumentParser) -> CommandWords:
    """Extracts the words accepted after a command.

    Args:
        parser: with all its arguments declared.
    """
    options, argument = [], Value(WordKind.NOTHING)
    for action in parser._actions:  # argparse has no public access
        if not action.option_strings:
            argument = _value(command, action)
            continue
        takes_none = action.nargs == 0
        value = None if takes_none else _value(command, action)
        options.append(Option(tuple(action.option_strings), value, action.help or ""))
    return CommandWords(command, summary, tuple(options), argument)


def _value(command: str, action: argparse.Action) -> Value:
    for name in action.option_strings:
        if (command, name) in OPEN_VALUES:
            return Value(WordKind.WORDS, tuple(OPEN_VALUES[command, name]))
    if action.choices is not None:
        return Value(WordKind.WORDS, tuple(map(str, action.choices)))
    if "DIR" in str(action.metavar):
        return Value(WordKind.FOLDERS)
    is_file = action.type is Path or not action.option_strings
    return Value(WordKind.FILES if is_file else WordKind.NOTHING)

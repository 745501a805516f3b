"""What may be typed after each command, as its parser says: options, their values, arguments."""

import argparse
from collections.abc import Iterable
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from h2nav.sim.faults import FAULT_KINDS
from h2nav.sim.personalities import PERSONALITIES
from h2nav.sim.scenarios import SCENARIOS


class Kind(Enum):
    """What a value is."""

    NOTHING = "nothing"  # that could be proposed, such as a number
    FILES = "files"
    FOLDERS = "folders"
    WORDS = "words"


class Value(NamedTuple):
    """What stands behind an option, or in the place of an argument.

    Attributes:
        kind: of it.
        words: to choose from.
    """

    kind: Kind
    words: tuple[str, ...] = ()


class Option(NamedTuple):
    """An option of a command.

    Attributes:
        names: such as ``-c`` and ``--config``.
        value: that it takes; None = it takes none.
        summary: one line of help.
    """

    names: tuple[str, ...]
    value: Value | None
    summary: str


class CommandWords(NamedTuple):
    """A command line.

    Attributes:
        command: its words, such as ``log info``; empty = before any command.
        summary: one line of help.
        options: of it.
        argument: what stands without an option.
    """

    command: str
    summary: str
    options: tuple[Option, ...]
    argument: Value


# Values that a parser leaves open, because their error is ours or because something may follow.
OPEN_VALUES: dict[tuple[str, str], Iterable[str]] = {
    ("fake-autopilot", "--scenario"): SCENARIOS,
    ("fake-autopilot", "--autopilot"): PERSONALITIES,
    ("fake-autopilot", "--fault"): [f"{name}@" for name in FAULT_KINDS],
}


def command_words(command: str, summary: str, parser: argparse.ArgumentParser) -> CommandWords:
    """What may be typed after a command.

    Args:
        command: its words.
        summary: one line of help.
        parser: with all its arguments declared.
    """
    options, argument = [], Value(Kind.NOTHING)
    for action in parser._actions:  # argparse shows them nowhere else
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
            return Value(Kind.WORDS, tuple(OPEN_VALUES[command, name]))
    if action.choices is not None:
        return Value(Kind.WORDS, tuple(map(str, action.choices)))
    if "DIR" in str(action.metavar):
        return Value(Kind.FOLDERS)
    is_file = action.type is Path or not action.option_strings
    return Value(Kind.FILES if is_file else Kind.NOTHING)

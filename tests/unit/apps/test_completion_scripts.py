"""What may follow each command, and the lines of the scripts that propose it."""

import argparse
from pathlib import Path

import pytest

from h2nav.apps.command_words import CommandWords, Option, Value, WordKind, command_words
from h2nav.apps.completion_scripts import bash_script, fish_script, zsh_script
from h2nav.sim.faults import FAULT_KINDS
from h2nav.sim.scenarios import SCENARIOS


def words_of(command, *arguments):
    """Of a command with one argument after the help option."""
    parser = argparse.ArgumentParser()
    for names, how in arguments:
        parser.add_argument(*names.split(), **how)
    return command_words(command, "does it", parser)


@pytest.mark.parametrize(
    ("command", "names", "how", "value"),
    [
        ("x", "--json", {"action": "store_true"}, None),
        ("x", "--many", {"type": int}, Value(WordKind.NOTHING)),
        ("x", "--many", {"type": int, "choices": (1, 2)}, Value(WordKind.WORDS, ("1", "2"))),
        ("x", "--file", {"type": Path}, Value(WordKind.FILES)),
        ("x", "--out", {"type": Path, "metavar": "DIR"}, Value(WordKind.FOLDERS)),
        ("x", "--out", {"metavar": "DIR"}, Value(WordKind.FOLDERS)),
        ("x", "--scenario", {}, Value(WordKind.NOTHING)),
        ("fake-autopilot", "--scenario", {}, Value(WordKind.WORDS, tuple(SCENARIOS))),
        (
            "fake-autopilot",
            "--fault",
            {},
            Value(WordKind.WORDS, tuple(f"{name}@" for name in FAULT_KINDS)),
        ),
    ],
)
def test_the_value_of_an_option(command, names, how, value):
    found = words_of(command, (names, {"help": "a word", **how}))
    assert found.options[0].names == ("-h", "--help")
    assert found.options[0].value is None
    assert found.options[1] == Option((names,), value, "a word")
    assert found.argument == Value(WordKind.NOTHING)
    assert (found.command, found.summary) == (command, "does it")


@pytest.mark.parametrize(
    ("how", "value"),
    [
        ({}, Value(WordKind.FILES)),
        ({"metavar": "DIR"}, Value(WordKind.FOLDERS)),
        ({"choices": ("bash", "zsh")}, Value(WordKind.WORDS, ("bash", "zsh"))),
    ],
)
def test_the_value_of_an_argument(how, value):
    found = words_of("x", ("place", how))
    assert found.argument == value
    assert len(found.options) == 1


def test_an_option_without_help_has_an_empty_one_and_all_its_names():
    found = words_of("x", ("-c --config", {"type": Path}))
    assert found.options[1] == Option(("-c", "--config"), Value(WordKind.FILES), "")


NOTHING = Value(WordKind.NOTHING)
LINES = (
    CommandWords("", "", (Option(("--version",), None, "which"),), NOTHING),
    CommandWords("log", "of logs", (), NOTHING),
    CommandWords(
        "run",
        "runs it",
        (
            Option(("-c", "--config"), Value(WordKind.FILES), "the user's"),
            Option(("--dir",), Value(WordKind.FOLDERS), ""),
            Option(("--kind",), Value(WordKind.WORDS, ("a", "b c")), ""),
            Option(("--count",), NOTHING, ""),
        ),
        NOTHING,
    ),
    CommandWords("log info", "of one", (Option(("--json",), None, ""),), Value(WordKind.FILES)),
)


@pytest.mark.parametrize("make", [bash_script, zsh_script])
def test_bash_and_zsh_have_the_same_cases(make):
    lines = [line.strip() for line in make(LINES).splitlines()]
    steps = next(line for line in lines if line.endswith('$word" ;;'))
    assert steps.startswith("' log'|' run'|'log info') command=")
    for line in (
        "'run|-c'|'run|--config') _h2nav_files; return ;;",
        "'run|--dir') _h2nav_folders; return ;;",
        "'run|--kind') _h2nav_words a 'b c'; return ;;",
        "'run|--count') _h2nav_nothing; return ;;",
        "'|-'*) _h2nav_words --version ;;",
        "'|'*) _h2nav_words log run ;;",
        "'log|'*) _h2nav_words info ;;",
        "'run|-'*) _h2nav_words -c --config --dir --kind --count ;;",
        "'run|'*) _h2nav_nothing ;;",
        "'log info|-'*) _h2nav_words --json ;;",
        "'log info|'*) _h2nav_files ;;",
    ):
        assert line in lines
    assert not any("--version'" in line or "--json'" in line for line in lines)


def test_fish_has_a_line_for_each_word():
    lines = fish_script(LINES).splitlines()
    assert "            case ' log' ' run' 'log info'" in lines
    at_run = "complete -c h2nav -n \"__h2nav_at 'run'\""
    for line in (
        "complete -c h2nav -n \"__h2nav_at ''\" -a log -d 'of logs'",
        "complete -c h2nav -n \"__h2nav_at ''\" -a run -d 'runs it'",
        "complete -c h2nav -n \"__h2nav_at ''\" -l version -d 'which'",
        "complete -c h2nav -n \"__h2nav_at 'log'\" -a info -d 'of one'",
        "complete -c h2nav -n \"__h2nav_at 'log info'\" -F",
        f"{at_run} -s c -l config -r -F -d 'the user\\'s'",
        f"{at_run} -l dir -r -f -a '(__fish_complete_directories)' -d ''",
        f"{at_run} -l kind -r -f -a 'a b c' -d ''",
        f"{at_run} -l count -r -f -d ''",
    ):
        assert line in lines
    assert len([line for line in lines if line.startswith("complete ")]) == 11

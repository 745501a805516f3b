"""The command line: imports only the requested command; errors become exit statuses."""

import argparse
import contextlib
import gc
import importlib
import io
import os
import platform
import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TextIO, TypeAlias

from h2nav import __version__
from h2nav.errors import BadInput, TaskFailed

SUCCESS, FAILED, BAD_INPUT = 0, 1, 2
# As a shell reports programs that these signals end: 128 + SIGINT, 128 + SIGPIPE.
INTERRUPTED, READER_GONE = 130, 141

# The collector of cycles looks at new objects when there are so many, 700 by default: more than
# two blocks of a recording become.
NEW_OBJECTS = 500_000
# Our matrices are small: further threads of linear algebra wait for each other and cost a review a
# quarter more, in processor time and by the clock; and how many there are shows in the last digits.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")

LISTING_WIDTH = 20
# A command and the typed words further apart than this are unrelated.
ALIKE = 0.6
CLOSING = """\
`h2nav COMMAND --help` shows a command's options and an example.
Exit status: 0 success, 1 the thing asked for failed, 2 bad input."""

_Level: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


class CommandEntry(NamedTuple):
    """One command."""

    module: str  # in `h2nav.apps`; offers add_arguments(parser) -> None and run(args) -> int
    summary: str  # one line of help
    example: str  # a typical call, without the program's name


# heading -> command words -> command, as `h2nav --help` lists them
SECTIONS: dict[str, dict[tuple[str, ...], CommandEntry]] = {
    "first look": {
        ("demo",): CommandEntry(
            "demo", "fly the fake autopilot and the daemon on loopback, print the errors", "demo"
        ),
        ("completion",): CommandEntry(
            "completion", "completion of commands and options in your shell", "completion bash"
        ),
    },
    "in flight": {
        ("setup",): CommandEntry(
            "setup", "find the autopilot, write the configuration, start the service", "setup"
        ),
        ("run",): CommandEntry(
            "run",
            "the daemon: estimate attitude from an autopilot's IMU stream",
            "run --connect udpin:0.0.0.0:14550 --log-dir logs",
        ),
        ("status",): CommandEntry("status", "state of the running daemon, in words", "status"),
        ("check",): CommandEntry(
            "check",
            "a second opinion before arming: sensors on the ground, with an exit status",
            "check --connect udpin:0.0.0.0:14550 --seconds 30",
        ),
        ("check-config",): CommandEntry(
            "check_config", "validate a configuration file", "check-config /etc/h2nav/config.yaml"
        ),
        ("signing-key",): CommandEntry(
            "signing_key",
            "make a key file for MAVLink signing from a passphrase",
            "signing-key -o /etc/h2nav/signing-key",
        ),
        ("fake-autopilot",): CommandEntry(
            "fake_autopilot",
            "a SITL-style autopilot for tests",
            "fake-autopilot --connect udpout:127.0.0.1:14550 --fault reboot@20",
        ),
    },
    "recordings": {
        ("replay",): CommandEntry(
            "replay", "run a recording through the same service", "replay flight.tlog --json"
        ),
        ("calibrate",): CommandEntry(
            "calibrate",
            "parameters out of flights: compasses and their motors, as a file to load",
            "calibrate flight.bin -o fix.param",
        ),
        ("review",): CommandEntry(
            "review",
            "what went wrong in a flight: findings and pictures, one page per flight",
            "review flight.bin --open",
        ),
        ("compare",): CommandEntry(
            "compare",
            "two flights side by side: parameters, figures, verdicts",
            "compare good.bin bad.bin",
        ),
        ("odometer",): CommandEntry(
            "odometer",
            "flights, hours and landings of airframes and their components",
            "odometer reviews --components components.yaml",
        ),
        ("fleet",): CommandEntry(
            "fleet",
            "the reviews of thousands of flights, and a table of them",
            "fleet recordings -o reviews --workers 8",
        ),
        ("serve",): CommandEntry(
            "serve",
            "a folder of flights in the browser: list, reviews, downloads",
            "serve flights --open",
        ),
        ("log", "info"): CommandEntry("log_info", "what a log holds", "log info flight.mcap"),
        ("log", "recover"): CommandEntry(
            "log_recover",
            "repair a log that was cut off",
            "log recover flight.mcap.active -o flight.mcap",
        ),
        ("log", "export"): CommandEntry(
            "log_export",
            "a log as CSV, Parquet, trajectory, tlog, bag of ROS 2 or MCAP",
            "log export flight.mcap -o csv",
        ),
        ("log", "anonymise"): CommandEntry(
            "log_anonymise",
            "a log that may be shown to others, elsewhere, with its physics kept",
            "log anonymise flight.bin -o shown.bin",
        ),
        ("log", "decode"): CommandEntry(
            "log_decode",
            "add the autopilot's messages as channels that viewers plot",
            "log decode flight.mcap -o decoded.mcap",
        ),
    },
    "gains": {
        ("synthesize",): CommandEntry(
            "synthesize",
            "compute a gain file by H2 synthesis",
            "synthesize model.yaml --rate 200 -o gains.yaml",
        ),
        ("certify",): CommandEntry(
            "certify", "check gain files without the solver", "certify gains.yaml"
        ),
        ("export", "c"): CommandEntry(
            "export_c",
            "write the filter as freestanding C99",
            "export c handheld_100hz -o firmware",
        ),
    },
    "accuracy": {
        ("evaluate", "paper"): CommandEntry(
            "evaluate_paper", "the source paper's tables, next to ours", "evaluate paper --seeds 20"
        ),
        ("evaluate", "dataset"): CommandEntry(
            "evaluate_dataset", "accuracy on recordings with truth", "evaluate dataset trials"
        ),
        ("evaluate", "flights"): CommandEntry(
            "evaluate_flights",
            "the service on recorded flights, next to the autopilot's estimators",
            "evaluate flights recordings --plots pictures",
        ),
        ("evaluate", "campaign"): CommandEntry(
            "evaluate_campaign",
            "the service on a thousand simulated flights drawn from a distribution",
            "evaluate campaign --flights 1000 -o campaign --plots pictures",
        ),
        ("evaluate", "observer"): CommandEntry(
            "evaluate_observer", "convergence of the twist observer", "evaluate observer --json"
        ),
        ("odometry", "calibrate"): CommandEntry(
            "odometry_calibrate", "wheel-odometry calibration", "odometry calibrate drive.csv"
        ),
    },
}
COMMANDS = {words: command for section in SECTIONS.values() for words, command in section.items()}
GROUPS = {
    "evaluate": "accuracy against truth",
    "export": "the filter in another language",
    "log": "look at, repair, convert logs",
    "odometry": "wheel odometry",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command.

    Args:
        argv: the words after the program's name; the process's own by default.

    Returns:
        0 success, 1 the task failed, 2 bad input or configuration; 130 interrupted, 141 the reader
        of our output is gone.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # closed by what started us
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115 - until the end
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # File names may hold bytes that are not text, and terminals may lack characters.
            stream.reconfigure(errors="backslashreplace")
    try:
        status = _run(list(sys.argv[1:] if argv is None else argv))
        sys.stdout.flush()
    except BadInput as error:
        return _complain(BAD_INPUT, *error.lines)
    except TaskFailed as error:
        return _complain(FAILED, str(error))
    except KeyboardInterrupt:
        return _complain(INTERRUPTED, "interrupted")
    except BrokenPipeError:
        # The reader, such as head or less, has all that it wants.
        _discard(sys.stdout)
        return READER_GONE
    except OSError as error:
        _discard_if_broken(sys.stdout)
        place = error.filename or "output"
        return _complain(FAILED, f"{place}: {error.strerror or error}")
    return status


def _complain(status: int, *lines: str) -> int:
    """Says what was wrong, if anybody can be told; returns the status."""
    with contextlib.suppress(OSError):
        for line in lines:
            print(f"h2nav: {line}", file=sys.stderr)
    _discard_if_broken(sys.stderr)
    return status


def _discard_if_broken(stream: TextIO) -> None:
    """Discards output that a full disk did not take, and that would fail again at exit."""
    try:
        stream.flush()
    except OSError:
        _discard(stream)


def _discard(stream: TextIO) -> None:
    importlib.import_module("h2nav.apps.voice").discard(stream)


def _run(words: list[str]) -> int:
    # Nearly all of our objects live until the end or die at once, without cycles: at its usual
    # pace the collector takes a tenth of a replay and a fifth of a start, and finds nothing.
    gc.set_threshold(NEW_OBJECTS)
    for name in THREADS:  # read when numpy is loaded
        os.environ.setdefault(name, "1")
    _refuse_unknown(words)
    args, unknown = _parser(words).parse_known_args(words)
    if unknown:  # with the usage of the command, not of all commands
        args.parser.error(f"unrecognized arguments: {' '.join(unknown)}")
    module = importlib.import_module(f"h2nav.apps.{COMMANDS[args.command].module}")
    return int(module.run(args))


def _refuse_unknown(words: Sequence[str]) -> None:
    """Names the most similar command; raises BadInput if the words are not a command."""
    group = words[:1] if words and words[0] in GROUPS else []
    typed = words[len(group) : len(group) + 1]
    known = {line[len(group)] for line in COMMANDS if list(line[: len(group)]) == group}
    if not typed or typed[0].startswith("-") or typed[0] in known:
        return
    import difflib  # for a mistake only

    said = " ".join((*group, *typed))
    names = {" ".join(line): " ".join(line) for line in COMMANDS}
    names |= {line[-1]: " ".join(line) for line in COMMANDS if len(line) > 1}
    likeness = {
        name: max(
            difflib.SequenceMatcher(None, name, written).ratio()
            for written in (said, " ".join(words[: len(group) + 2]))
        )
        for name in names
    }
    nearest = max(likeness, key=lambda name: likeness[name])
    meant = f"did you mean `h2nav {names[nearest]}`?"
    if likeness[nearest] < ALIKE:
        meant = "`h2nav --help` lists them all"
    raise BadInput(f"{said}: no such command; {meant}")


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """The parser, complete for the command in `words` and by name for all others."""
    parser = argparse.ArgumentParser(
        prog="h2nav", description="Independent attitude and motion estimation over MAVLink."
    )
    parser.set_defaults(parser=parser)
    parser.add_argument("--version", action=_Version, help="version and backend, then exit")
    levels: dict[tuple[str, ...], _Level] = {(): _add_level(parser, "h2nav", _overview())}
    for group, summary in GROUPS.items():
        sub = levels[()].add_parser(group, description=_sentence(summary))
        listed = {line: command for line, command in COMMANDS.items() if line[0] == group}
        levels[(group,)] = _add_level(sub, f"h2nav {group}", f"commands:\n{_listing(listed)}")
    for line, (module_name, summary, example) in COMMANDS.items():
        sub = levels[line[:-1]].add_parser(line[-1], description=_sentence(summary))
        if tuple(words[: len(line)]) == line:
            sub.set_defaults(command=line, listed=COMMANDS, parser=sub)
            importlib.import_module(f"h2nav.apps.{module_name}").add_arguments(sub)
            _add_example(sub, example)
    return parser


def _add_level(parser: argparse.ArgumentParser, name: str, overview: str) -> _Level:
    """Turns a parser into a group of commands, whose help ends with their overview."""
    options = " [--version]" if name == "h2nav" else ""
    parser.usage = f"{name} [-h]{options} COMMAND ..."
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = overview
    return parser.add_subparsers(
        metavar="COMMAND", required=True, prog=name, help=argparse.SUPPRESS
    )


def _add_example(parser: argparse.ArgumentParser, example: str) -> None:
    """Puts the example before the closing text of the command's help."""
    closing = parser.epilog or ""
    if parser.formatter_class is argparse.HelpFormatter:
        closing = textwrap.fill(closing, shutil.get_terminal_size().columns - 2)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = f"example:\n  h2nav {example}\n\n{closing}".rstrip()


def _overview() -> str:
    sections = [f"{heading}:\n{_listing(commands)}" for heading, commands in SECTIONS.items()]
    return "\n\n".join([*sections, CLOSING])


def _listing(commands: Mapping[tuple[str, ...], CommandEntry]) -> str:
    lines = [
        f"  {' '.join(words):{LISTING_WIDTH}}{command.summary}"
        for words, command in commands.items()
    ]
    return "\n".join(lines)


def _sentence(text: str) -> str:
    """With a capital and a full stop; names such as SITL stay as they are."""
    return f"{text[0].upper()}{text[1:]}."


class _Version(argparse.Action):
    """Prints the version and the backend of the kernels."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str | None = None) -> None:  # noqa: A002
        super().__init__(option_strings, dest, nargs=0, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        native = importlib.import_module("h2nav.attitude.native")
        python = platform.python_version()
        print(f"h2nav {__version__} ({native.backend()} kernels, Python {python})")
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())

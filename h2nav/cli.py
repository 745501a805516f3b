"""The command line: imports only the command that is asked for; errors become exit statuses."""

import argparse
import importlib
import sys
from collections.abc import Sequence

from h2nav import __version__
from h2nav.errors import BadInput, TaskFailed

# command words -> (module, one line of help). Each module offers
# add_arguments(parser) -> None and run(args) -> int.
COMMANDS: dict[tuple[str, ...], tuple[str, str]] = {
    ("demo",): ("demo", "fly the fake autopilot and the daemon on loopback, print the errors"),
    ("run",): ("run", "the daemon: estimate attitude from an autopilot's IMU stream"),
    ("check-config",): ("check_config", "validate a configuration file"),
    ("fake-autopilot",): ("fake_autopilot", "a SITL-style autopilot for tests"),
    ("replay",): ("replay", "run a recording through the same service"),
    ("synthesize",): ("synthesize", "compute a gain file by H2 synthesis"),
    ("certify",): ("certify", "check gain files without the solver"),
    ("evaluate", "paper"): ("evaluate_paper", "the source paper's tables, next to ours"),
    ("evaluate", "dataset"): ("evaluate_dataset", "accuracy on recordings with truth"),
    ("evaluate", "observer"): ("evaluate_observer", "convergence of the twist observer"),
    ("export", "c"): ("export_c", "write the filter as freestanding C99"),
    ("log", "info"): ("log_info", "what a log holds"),
    ("log", "recover"): ("log_recover", "repair a log that was cut off"),
    ("log", "export"): ("log_export", "convert a log's channels to CSV"),
    ("odometry", "calibrate"): ("odometry_calibrate", "wheel-odometry calibration"),
}
GROUP_HELP = {
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
        0 success, 1 the thing asked for failed, 2 bad input or configuration.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    args = _parser(words).parse_args(words)
    module = importlib.import_module(f"h2nav.apps.{COMMANDS[args.command][0]}")
    try:
        return int(module.run(args))
    except BadInput as error:
        for line in error.lines:
            print(f"h2nav: {line}", file=sys.stderr)
        return 2
    except TaskFailed as error:
        print(f"h2nav: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        # The reader of our output (head, less) has gone; nothing is left to say to it.
        sys.stderr.close()
        return 1


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """The parser, complete for the command in `words` and by name and help for all others."""
    parser = argparse.ArgumentParser(
        prog="h2nav", description="Independent attitude and motion estimation over MAVLink."
    )
    parser.add_argument("--version", action=_Version, help="version and backend, then exit")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    groups: dict[str, argparse._SubParsersAction[argparse.ArgumentParser]] = {}
    for command, (module_name, help_line) in COMMANDS.items():
        level = commands
        if len(command) == 2:
            if command[0] not in groups:
                group = commands.add_parser(command[0], help=GROUP_HELP[command[0]])
                groups[command[0]] = group.add_subparsers(metavar="COMMAND", required=True)
            level = groups[command[0]]
        sub = level.add_parser(
            command[-1], help=help_line, description=f"{help_line}.".capitalize()
        )
        if tuple(words[: len(command)]) == command:
            sub.set_defaults(command=command)
            importlib.import_module(f"h2nav.apps.{module_name}").add_arguments(sub)
    return parser


class _Version(argparse.Action):
    """Prints the version and which backend batches run on."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str | None = None) -> None:  # noqa: A002
        super().__init__(option_strings, dest, nargs=0, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"h2nav {__version__}")
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())

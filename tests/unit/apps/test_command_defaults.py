"""What a command does where an option is not given, and what its help tells besides."""

import argparse
from pathlib import Path
from types import ModuleType

import pytest

from h2nav.apps import (
    log_anonymise,
    log_decode,
    log_export,
    log_info,
    log_recover,
    odometer,
    odometry_calibrate,
    replay,
    review,
    run,
    serve,
    setup,
    signing_key,
    status,
    synthesize,
)

PLAYED = {"config": None, "filter": None, "vehicle_class": None}
IN, OUT = Path("in"), Path("out")

USUAL = [
    (
        log_anonymise, "in -o out",
        {"log": IN, "output": OUT, "to": None, "far": False, "keep_date": False,
         "no_check": False, "json": False},
    ),
    (log_decode, "in -o out", {"log": IN, "output": OUT, "json": False}),
    (
        log_export, "in -o out",
        {"log": IN, "output": OUT, "to": "csv", "topic": [], "json": False},
    ),
    (log_info, "in out", {"logs": [IN, OUT], "json": False}),
    (log_recover, "in", {"log": IN, "output": None, "json": False}),
    (odometer, "in out", {"folders": [IN, OUT], "components": None, "json": False}),
    (
        odometry_calibrate, "in",
        {"data": IN, "model": None, "solver": "qr", "wheel_angles_deg": "0,120,240",
         "autopilot_radius_m": 1.0, "json": False, "plots": None},
    ),
    (
        replay, "in",
        {"log": IN, "output": None, "no_log": False, "no_gps": False, "smooth": False,
         "json": False, **PLAYED},
    ),
    (
        review, "",
        {"flights": [], "output": Path("reviews"), "open": False, "no_smooth": False,
         "earlier": [], "fail_on": "error", "schema": False, "json": False, **PLAYED},
    ),
    (
        run, "",
        {"config": None, "connect": None, "log_dir": None, "live": None, "json": False,
         "schema": False},
    ),
    (
        serve, "in",
        {"folder": IN, "reviews": None, "address": "127.0.0.1:8080", "no_review": False,
         "read_only": False, "upload_mb": 1024, "open": False, "memory_mb": 1024, "minutes": 60,
         "review_priority": "idle"},
    ),
    (
        setup, "",
        {"connect": [], "system_id": None, "output": None, "fetch_log": False, "yes": False,
         "force": False, "no_service": False, "json": False},
    ),
    (signing_key, "-o out", {"output": OUT}),
    (status, "", {"socket": None, "config": None, "json": False}),
    (
        synthesize, "in --rate 100 -o out",
        {"model": IN, "rate": 100.0, "output": OUT, "json": False},
    ),
]  # fmt: skip


def parser_of(command: ModuleType) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return parser


@pytest.mark.parametrize(("command", "words", "expected"), USUAL)
def test_nothing_is_done_that_was_not_asked_for(
    command: ModuleType, words: str, expected: dict[str, object]
) -> None:
    assert vars(parser_of(command).parse_args(words.split())) == expected


@pytest.mark.parametrize(("command", "words", "expected"), USUAL)
def test_every_option_is_taken(
    command: ModuleType, words: str, expected: dict[str, object]
) -> None:
    """By its long name; what takes a value gets one that differs from the usual one."""
    parser = parser_of(command)
    for action in parser._actions[1:]:
        if not action.option_strings:
            continue
        values = [] if action.nargs == 0 else ["7"]
        if action.choices:
            values = [str([each for each in action.choices if each != action.default][-1])]
        given = vars(parser.parse_args([*words.split(), action.option_strings[-1], *values]))
        if not action.required:
            assert given[action.dest] != expected[action.dest]


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (log_anonymise, "in"), (log_anonymise, "-o out"), (log_decode, "in"), (log_export, "in"),
        (log_export, "in -o out --to xml"), (log_info, ""), (odometer, ""),
        (odometry_calibrate, "in --solver lu"), (review, "--fail-on notice"),
        (serve, "in --minutes 1.5"), (serve, "in --review-priority high"),
        (setup, "--system-id x"), (signing_key, ""), (status, "--socket a -c b"),
        (synthesize, "in -o out"), (synthesize, "in --rate 100"),
    ],
)  # fmt: skip
def test_what_is_missing_or_unknown_ends_with_the_usage(
    command: ModuleType, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        parser_of(command).parse_args(words.split())
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("usage: ")


@pytest.mark.parametrize("command", [log_anonymise, odometer, review, serve, setup])
def test_a_closing_text_keeps_its_lines(command: ModuleType) -> None:
    assert parser_of(command).format_help().endswith(f"\n\n{command._CLOSING.rstrip()}\n")


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (log_decode, "OUT.mcap holds all of LOG unchanged"),
        (log_export, "csv and parquet: one file per topic, with the units of its columns"),
        (log_info, "A file that is not a log is named and skipped; the exit status is then 2."),
        (log_recover, "Exit status: 0 nothing was lost, 3 something was lost, 1 nothing could be"),
        (signing_key, "all users of the computer could read it on a command line"),
        (status, "Exit status: 0 when the attitude is estimated and sent (state active), 1 when"),
    ],
)
def test_the_help_says_what_the_options_do_not(command: ModuleType, said: str) -> None:
    assert said in " ".join(parser_of(command).format_help().split())

"""What each command takes besides its words, and what it does when a word is missing.

Scripts of users are made of these names and defaults, and the help tells of them.
"""

import argparse
from pathlib import Path

import pytest

from h2nav.apps import (
    calibrate,
    certify,
    check,
    check_config,
    compare,
    completion,
    demo,
    evaluate_campaign,
    evaluate_dataset,
    evaluate_flights,
    evaluate_observer,
    evaluate_paper,
    export_c,
    fake_autopilot,
    fleet,
)

PLAYED = {"config": None, "filter": None, "vehicle_class": None}
NONE_OF_THREE, ONES = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
FAKE = {
    "connect": ["udpout:127.0.0.1:9"],
    "scenario": "flight",
    "seed": 0,
    "seconds": None,
    "autopilot": "ardupilot",
    "fault": [],
    "imus": 1,
    "baud": None,
    "boot_text": False,
    "gyro_bias_deg_s": NONE_OF_THREE,
    "compass_offset": NONE_OF_THREE,
    "motor_field": NONE_OF_THREE,
    "accelerometer_offset": NONE_OF_THREE,
    "gyro_offset": NONE_OF_THREE,
    "compass_scale": ONES,
    "accelerometer_scale": ONES,
    "compass_turned": 0.0,
    "board": (0.0, 0.0),
    "parameters": None,
    "log": [],
    "no_ftp": False,
    "arm_authorization": False,
    "signing_key": None,
    "vision": None,
    "vision_rate_hz": 30.0,
    "vision_delay_ms": 0.0,
    "vision_drop_out": 0.0,
    "json": False,
}
FLEET = {
    "sources": ["logs", "more"],
    "output": "out",
    "scheduler": None,
    "workers": None,
    "memory_mb": 600,
    "longest_s": 1800.0,
    "components": None,
    **PLAYED,
    "json": False,
}
CASES = [
    (
        calibrate,
        "a.bin b.bin",
        {
            "flights": [Path("a.bin"), Path("b.bin")],
            "output": None,
            "format": None,
            "parameters": None,
            **PLAYED,
            "json": False,
        },
    ),
    (certify, "a b", {"files": ["a", "b"], "json": False}),
    (check, "--connect u", {"connect": "u", "seconds": 30.0, "json": False}),
    (
        check_config,
        "a.yaml",
        {"config": Path("a.yaml"), "example": None, "schema": False, "json": False},
    ),
    (
        compare,
        "a.bin b.json --earlier one --earlier two",
        {
            "first": Path("a.bin"),
            "second": Path("b.json"),
            "earlier": [Path("one"), Path("two")],
            **PLAYED,
            "json": False,
        },
    ),
    (completion, "fish", {"shell": "fish"}),
    (
        demo,
        "",
        {
            "seconds": None,
            "log_dir": None,
            "scenario": "flight",
            "seed": 1,
            "live": None,
            "open": False,
            "json": False,
        },
    ),
    (
        evaluate_campaign,
        "",
        {
            "flights": 1000,
            "seed": None,
            "draw": None,
            "first": 0,
            "distribution": None,
            "output": None,
            "workers": None,
            "scheduler": None,
            "plots": None,
            "shrink": False,
            "json": False,
        },
    ),
    (
        evaluate_dataset,
        "trials --filter vqf --filter default",
        {
            "places": [Path("trials")],
            "vehicle_class": "handheld",
            "filters": ["vqf", "default"],
            "smooth": False,
            "gps": False,
            "declination_deg": 0.0,
            "cruise_speed_m_s": None,
            "plots": None,
            "json": False,
        },
    ),
    (
        evaluate_flights,
        "one two",
        {
            "places": [Path("one"), Path("two")],
            **PLAYED,
            "phases": None,
            "plots": None,
            "json": False,
        },
    ),
    (evaluate_observer, "", {"json": False, "plots": None}),
    (
        evaluate_paper,
        "",
        {"seeds": 20, "json": False, "plots": None, "run_in_s": 150.0, "dip_deg": 42.0},
    ),
    (
        export_c,
        "mine -o out",
        {"gains": "mine", "output": Path("out"), "form": None, "json": False},
    ),
    (fake_autopilot, "--connect udpout:127.0.0.1:9", FAKE),
    (fleet, "logs more -o out", FLEET),
]


def parser_of(module):
    parser = argparse.ArgumentParser()
    module.add_arguments(parser)
    return parser


@pytest.mark.parametrize(
    ("module", "words", "expected"), CASES, ids=lambda case: getattr(case, "__name__", "")
)
def test_what_is_not_said_has_the_default_that_the_help_tells(module, words, expected):
    assert vars(parser_of(module).parse_args(words.split())) == expected


@pytest.mark.parametrize(
    ("module", "words", "expected"),
    [
        (calibrate, "a --json --format px4 -o f -c my.yaml --filter constant_gain"
         " --class fixed-wing",
         {"json": True, "format": "px4", "output": Path("f"), "config": Path("my.yaml"),
          "filter": "constant_gain", "vehicle_class": "fixed-wing"}),
        (check, "--connect u --seconds 1.5", {"seconds": 1.5}),
        (demo, "--seconds 3 --seed 4 --log-dir d --open --json",
         {"seconds": 3.0, "seed": 4, "log_dir": Path("d"), "open": True, "json": True}),
        (evaluate_campaign, "--seed 3 --first 4 --workers 2 --shrink --plots p -o o",
         {"seed": 3, "first": 4, "workers": 2, "shrink": True, "plots": Path("p"),
          "output": Path("o"), "flights": 1000}),
        (evaluate_dataset, "d --gps --smooth --declination-deg -3.5 --cruise-speed-m-s 22",
         {"gps": True, "smooth": True, "declination_deg": -3.5, "cruise_speed_m_s": 22.0}),
        (evaluate_paper, "--seeds 3 --run-in-s 1.5 --dip-deg -60",
         {"seeds": 3, "run_in_s": 1.5, "dip_deg": -60.0}),
        (fake_autopilot, "--connect a --connect b --fault x@1 --fault y@2 --imus 3 --log l --no-ftp"
         " --compass-offset 1 2 3 --board 4 5 --gyro-bias-deg-s 6 7 8 --boot-text",
         {"connect": ["a", "b"], "fault": ["x@1", "y@2"], "imus": 3, "log": [Path("l")],
          "no_ftp": True, "compass_offset": [1.0, 2.0, 3.0], "board": [4.0, 5.0],
          "gyro_bias_deg_s": [6.0, 7.0, 8.0], "boot_text": True}),
        (fleet, "x -o o --workers 3 --memory-mb 700 --longest-s 9.5",
         {"workers": 3, "memory_mb": 700, "longest_s": 9.5}),
    ],
    ids=lambda case: getattr(case, "__name__", ""),
)  # fmt: skip
def test_what_is_said_is_taken_as_a_number_a_path_or_a_switch(module, words, expected):
    found = vars(parser_of(module).parse_args(words.split()))
    assert {name: found[name] for name in expected} == expected


@pytest.mark.parametrize(
    ("module", "words", "said"),
    [
        (calibrate, "", "required: FLIGHT"),
        (calibrate, "a --format dos", "argument --format: invalid choice"),
        (certify, "", "required: GAINS.yaml"),
        (check, "", "required: --connect"),
        (check_config, "", "one of the arguments CONFIG.yaml --example --schema is required"),
        (check_config, "a.yaml --schema", "argument --schema: not allowed with argument"),
        (check_config, "--example none", "argument --example: invalid choice"),
        (compare, "a", "required: B"),
        (completion, "ksh", "argument shell: invalid choice"),
        (demo, "--scenario none", "argument --scenario: invalid choice"),
        (evaluate_campaign, "--seed 1 --draw a", "argument --draw: not allowed with argument"),
        (evaluate_campaign, "--seed 1 --flights 2", "argument --flights: not allowed with"),
        (evaluate_dataset, "d --class boat-plane", "argument --class: invalid choice"),
        (export_c, "mine", "required: -o/--output"),
        (export_c, "mine -o a --form small", "argument --form: invalid choice"),
        (fake_autopilot, "", "required: --connect"),
        (fake_autopilot, "--connect a --board 1", "argument --board: expected 2 arguments"),
        (fake_autopilot, "--connect a --gyro-offset 1 2", "--gyro-offset: expected 3 arguments"),
        (fake_autopilot, "--connect a --vision none", "argument --vision: invalid choice"),
        (fleet, "logs", "required: -o/--output"),
    ],
    ids=lambda case: getattr(case, "__name__", ""),
)
def test_a_word_that_is_missing_or_wrong_is_named(module, words, said, capsys):
    with pytest.raises(SystemExit) as ended:
        parser_of(module).parse_args(words.split())
    assert ended.value.code == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("module", "lines"),
    [
        (calibrate, ["Nothing is ever sent to a vehicle: check the values, load them, and fly"]),
        (check, ["2 bad input. The vehicle must stand still, disarmed."]),
        (compare, ["flights of one deviation differ by up to 2 of them in 95 cases of 100."]),
        (completion, ["  h2nav completion zsh  > _h2nav     # in a folder of $fpath"]),
        (demo, []),
        (evaluate_campaign, ["more examples:", "  h2nav evaluate campaign --draw small.yaml"]),
        (evaluate_dataset, ["more examples:", "  h2nav evaluate dataset trials/ --filter all"]),
        (evaluate_flights, ["spans: whole begins with an estimator's first estimate, settled 60"]),
        (
            fake_autopilot,
            [
                "orders on standard input while it flies:",
                "  quit                                         the program ends",
            ],
        ),
        (fleet, ["DIR gets index.html, reviews/"]),
    ],
)
def test_the_help_ends_with_what_the_command_does_line_by_line(module, lines):
    found = parser_of(module).format_help().splitlines()
    for line in lines:
        assert any(one.startswith(line) for one in found), line

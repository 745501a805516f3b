"""Wrong words on the command line of the fake autopilot: one line that says what to do instead."""

import pytest

from h2nav.cli import main

URL = ("--connect", "udpout:127.0.0.1:9")


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--fault", "gyro-zero"), "expected NAME[=ARGUMENT]@START[+DURATION][/IMU]"),
        (("--fault", "gyro-melted@5"), "gyro-melted is not known; one of drop"),
        (("--fault", "gyro-scale=big@5"), "expected a number from 0 to 100"),
        (("--fault", "gps-lost@5/2"), "leave out /2"),
        (("--fault", "gyro-zero@5/2"), "there is no IMU 2; use --imus 2"),
        (("--fault", "gyro-zero@5/3", "--imus", "2"), "there is no IMU 3; use --imus 3"),
    ],
)
def test_a_wrong_fault_is_one_line_with_a_remedy(words, complaint, capsys):
    assert main(["fake-autopilot", *URL, *words]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert complaint in said


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--seconds", "inf"), "--seconds: expected a number from 0 to 1e+09"),
        (("--seconds", "-1"), "--seconds: expected a number from 0 to 1e+09"),
        (("--seed", "-1"), "--seed: expected 0 or more"),
    ],
)
def test_a_number_that_is_none_is_one_line(words, complaint, capsys):
    assert main(["fake-autopilot", *URL, *words]) == 2
    assert capsys.readouterr().err == f"h2nav: {complaint}\n"


def test_there_are_at_most_three_imus(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["fake-autopilot", *URL, "--imus", "4"])
    assert caught.value.code == 2
    assert "choose from 1, 2, 3" in capsys.readouterr().err

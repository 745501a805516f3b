"""`h2nav calibrate`: what is told of what was found, and when a file is written."""

import json
import math

import pytest
from one_command import main

from h2nav.apps import reviewing
from h2nav.calibration import vehicle
from h2nav.calibration.outcome import Calibration, Outcome, ParameterChange
from h2nav.cli import FAILED, SUCCESS
from h2nav.recordings import opening

TURNED = ParameterChange("AHRS_TRIM_X", math.nan, 0.0123456, 0.000125)
OFFSET = ParameterChange("COMPASS_OFS_X", 12.3456789, -7.0)
FOUND = Calibration(
    "ardupilot",
    "4.5",
    ("a.bin",),
    (
        Outcome("board", changes=(TURNED,), notes=("look twice",), shown="from 3 to 1 deg"),
        Outcome("compass 1", "97539", changes=(OFFSET,), left=("scale: no turns",)),
        Outcome("compass 2", changes=(OFFSET,)),
    ),
)
NOTHING = FOUND._replace(outcomes=(Outcome("board", left=("no rest",)),))


@pytest.fixture
def calibrated(monkeypatch, tmp_path):
    """A function: the status of a calibration that finds what is given."""
    monkeypatch.chdir(tmp_path)
    seen: list = []

    def run(found, *words):
        def calibrate(evidence):
            seen[:] = evidence
            return found

        monkeypatch.setattr(vehicle, "calibrate", calibrate)
        monkeypatch.setattr(opening, "open_flight", lambda path: path.name)
        monkeypatch.setattr(reviewing, "evidence_of", lambda *played, progress: played)
        return main(["calibrate", *words])

    run.seen = seen
    return run


def test_people_see_each_sensor_with_its_changes_and_reasons(calibrated, capsys):
    assert calibrated(FOUND, "a.bin") == SUCCESS
    assert capsys.readouterr().out.splitlines() == [
        "board",
        "  AHRS_TRIM_X                   -> 0.012346 ± 0.000125",
        "  look twice",
        "  from 3 to 1 deg",
        "compass 1 (device 97539)",
        "  COMPASS_OFS_X          12.346 -> -7",
        "  nothing to set: scale: no turns",
        "compass 2",
        "  COMPASS_OFS_X          12.346 -> -7",
    ]


@pytest.mark.parametrize(
    ("words", "name", "begins"),
    [
        ([], "new.param", "AHRS_TRIM_X,0.0123456"),
        (["--format", "qgroundcontrol"], "new.param", "1\t1\tAHRS_TRIM_X\t0.0123456"),
        (["--format", "px4"], "new.params", "param set AHRS_TRIM_X 0.0123456"),
        ([], "new.params", "1\t1\tAHRS_TRIM_X\t0.0123456"),
    ],
)
def test_the_file_has_the_format_that_was_asked_for_else_that_of_its_name(
    calibrated, capsys, tmp_path, words, name, begins
):
    assert calibrated(FOUND, "a.bin", "-o", name, *words) == SUCCESS
    lines = (tmp_path / name).read_text().splitlines()
    values = [line for line in lines if not line.startswith("#")]
    assert values[0].startswith(begins)
    # Both compasses share a parameter: it is one line, and counted once.
    assert len(values) == 2
    assert capsys.readouterr().out.endswith(f"\n{name}: 2 parameters\n")


def test_without_an_improvement_no_file_is_written(calibrated, capsys, tmp_path):
    assert calibrated(NOTHING, "a.bin", "-o", "new.param") == SUCCESS
    assert not (tmp_path / "new.param").exists()
    assert capsys.readouterr().out.splitlines() == [
        "board",
        "  nothing to set: no rest",
        "new.param not written: no parameter",
    ]


def test_the_document_is_written_instead_of_the_text(calibrated, capsys):
    assert calibrated(FOUND, "a.bin", "--json") == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert found["sensors"][0]["changes"] == [
        {"name": "AHRS_TRIM_X", "old": None, "new": 0.0123456, "sigma": 0.000125}
    ]


def test_a_file_that_cannot_be_written_is_the_failure(calibrated, capsys):
    assert calibrated(FOUND, "a.bin", "-o", "none/new.param") == FAILED
    assert capsys.readouterr().err == "h2nav: none/new.param: No such file or directory\n"


def test_every_flight_is_played_with_the_options_and_the_parameters_that_were_named(
    calibrated, tmp_path
):
    (tmp_path / "saved.param").write_text("AHRS_TRIM_X,0.5\n")
    words = ["--filter", "constant_gain", "--parameters", "saved.param"]
    assert calibrated(FOUND, "a.bin", "b.bin", *words) == SUCCESS
    assert [source for source, _, _ in calibrated.seen] == ["a.bin", "b.bin"]
    assert {options.filter_name for _, options, _ in calibrated.seen} == {"constant_gain"}
    assert [given for _, _, given in calibrated.seen] == [{"AHRS_TRIM_X": 0.5}] * 2
    assert calibrated(FOUND, "a.bin") == SUCCESS
    assert calibrated.seen[0][2] == {}

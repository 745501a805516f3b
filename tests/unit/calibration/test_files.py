"""Parameter files that ground stations load, and those that they save."""

import pytest

from h2nav.apps.parameter_files import parameters_of
from h2nav.calibration.files import ParameterFormat, format_of, written
from h2nav.calibration.outcome import Calibration, Outcome, ParameterChange
from h2nav.errors import BadInput

CHANGES = (
    ParameterChange("COMPASS_OFS_X", 5.0, 50.26216, 1.7),
    ParameterChange("COMPASS_ORIENT", 0.0, 2.0),
)
FOUND = Calibration("ArduPilot", "", ("a\nb.tlog",), (Outcome("compass 1", changes=CHANGES),))


@pytest.mark.parametrize("form", ParameterFormat)
def test_every_form_can_be_read_back(form):
    text = written(FOUND, form)
    assert parameters_of(text.splitlines(), "x") == {"COMPASS_OFS_X": 50.26216, "COMPASS_ORIENT": 2}


def test_ardupilot_has_a_name_and_a_value_a_line():
    assert "COMPASS_OFS_X,50.26216\nCOMPASS_ORIENT,2\n" in written(FOUND, ParameterFormat.ARDUPILOT)


def test_qgroundcontrol_has_five_columns_with_types():
    lines = written(FOUND, ParameterFormat.QGROUNDCONTROL).splitlines()
    assert lines[-2:] == ["1\t1\tCOMPASS_OFS_X\t50.26216\t9", "1\t1\tCOMPASS_ORIENT\t2\t2"]


def test_px4_integers_are_integers():
    change = ParameterChange("CAL_MAG0_ROT", 0.0, 6.0)
    found = FOUND._replace(autopilot="PX4", outcomes=(Outcome("compass 1", changes=(change,)),))
    assert (
        written(found, ParameterFormat.QGROUNDCONTROL)
        .splitlines()[-1]
        .endswith("\tCAL_MAG0_ROT\t6\t6")
    )
    assert "param set CAL_MAG0_ROT 6\n" in written(found, ParameterFormat.PX4_SHELL)


def test_a_recording_cannot_add_a_line():
    assert all(
        line[0] == "#" for line in written(FOUND, ParameterFormat.ARDUPILOT).splitlines()[:2]
    )


def test_the_ending_says_the_form():
    assert format_of("fix.params", "PX4") is ParameterFormat.QGROUNDCONTROL
    assert format_of("fix.param", "PX4") is ParameterFormat.ARDUPILOT
    assert format_of("fix.txt", "PX4") is ParameterFormat.PX4_SHELL
    assert format_of("fix.txt", "ArduPilot") is ParameterFormat.ARDUPILOT


def test_one_without_a_number_is_not_set():
    assert parameters_of(["A,nan", "B,1"], "x") == {"B": 1.0}


@pytest.mark.parametrize("line", ["hello", "A,b", "\x00\x01", "A,-inf", "A 1e39"])
def test_what_is_no_parameter_is_named(line):
    with pytest.raises(BadInput, match=r"x:2: .*is not a parameter"):
        parameters_of(["COMPASS_OFS_X 5", line], "x")

"""Parameters as three kinds of ground stations write them, and what is none."""

import pytest

from h2nav.apps import parameter_files
from h2nav.apps.parameter_files import parameters_of, read_parameters
from h2nav.errors import BadInput

REMEDY = "is not a parameter; expected NAME,VALUE or QGroundControl's five columns"


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("COMPASS_OFS_X,1.5", {"COMPASS_OFS_X": 1.5}),
        ("COMPASS_OFS_X 1.5", {"COMPASS_OFS_X": 1.5}),
        ("COMPASS_OFS_X\t-2", {"COMPASS_OFS_X": -2.0}),
        ("A,1 # why", {"A": 1.0}),
        ("# A,1", {}),
        ("  ", {}),
        ("1\t1\tCAL_MAG0_XOFF\t0.25\t9", {"CAL_MAG0_XOFF": 0.25}),
        ("param set CAL_MAG0_XOFF 0.25", {"CAL_MAG0_XOFF": 0.25}),
        ("A 1 2 3", {"A": 1.0}),
        ("A,nan", {}),
        ("A,3.39e38", {"A": 3.39e38}),
        ("A,-3.39e38", {"A": -3.39e38}),
    ],
)
def test_a_line_of_any_ground_station_is_read(line, expected):
    assert parameters_of([line], "x") == expected


@pytest.mark.parametrize(
    "line", ["A", "A,b", "A,inf", "A,3.4e38", "A,-3.4e38", "1 1 A b 9", "param set A", "param"]
)
def test_anything_else_is_told_with_its_line(line):
    with pytest.raises(BadInput) as caught:
        parameters_of(["B,1", "", line], "file.param")
    assert str(caught.value) == f"file.param:3: {line!r} {REMEDY}"


def test_of_a_long_line_the_beginning_is_told():
    with pytest.raises(BadInput) as caught:
        parameters_of(["  " + "x" * 100], "f")
    assert str(caught.value) == f"f:1: {'x' * 60!r} {REMEDY}"


@pytest.mark.parametrize(("lines", "is_read"), [(20_000, True), (20_001, False)])
def test_a_file_has_at_most_20000_lines(lines, is_read):
    text = ["# a comment"] * (lines - 1) + ["A,1"]
    if is_read:
        assert parameters_of(text, "f") == {"A": 1.0}
        return
    with pytest.raises(BadInput) as caught:
        parameters_of(text, "f")
    said = "f: more than 20000 lines; this is not a parameter file"
    assert str(caught.value) == said


def test_a_file_is_read_by_its_name(tmp_path):
    path = tmp_path / "a.param"
    path.write_bytes(b"A,1\nB,2\xff\nA,3\n".replace(b"\xff", b""))
    assert read_parameters(path) == {"A": 3.0, "B": 2.0}
    with pytest.raises(BadInput) as caught:
        read_parameters(tmp_path / "none")
    said = f"{tmp_path / 'none'}: No such file or directory; name a parameter file"
    assert str(caught.value) == said
    assert parameter_files.MAX_LINES == 20_000

"""`h2nav export c`: what it writes and what it says."""

import json
import re
from pathlib import Path
from types import ModuleType

import pytest

from h2nav import __version__
from h2nav.attitude.gains.seal import seal
from h2nav.attitude.kernels import fixed_flight_layout, fixed_lean
from h2nav.cli import main
from h2nav.io import gain_files
from h2nav.translate.firmware import IntegerForm, parameter_names
from h2nav.translate.firmware_flight import FLIGHT
from h2nav.translate.firmware_lean import LEAN

FILES = {"h2nav_filter.c", "h2nav_filter.h", "example.c", "check_vectors.c", "h2nav_vectors.h"}


def test_json_names_every_file_with_its_size(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", "c", "multirotor_200hz", "-o", str(tmp_path / "new"), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["ok"] is True
    assert result["form"] == "flight"
    assert set(result["files"]) == FILES
    for name, entry in result["files"].items():
        assert (tmp_path / "new" / name).stat().st_size == entry["bytes"]
    assert result["gain_hash"] == seal(gain_files.load("multirotor_200hz"))
    assert result["rounding_error"] < 1e-3


@pytest.mark.parametrize(
    ("gains", "form", "parameters"),
    [
        ("mpu9250_100hz", "lean", [r"    \d+, /\* P_SHIFT \*/", r"    \d+, /\* BOOST_SHIFT \*/"]),
        (
            "rover_100hz",
            "flight",
            [r"    \d+, /\* LP_SHIFT \*/", r"    /\* K_TILT, 12 numbers \*/"],
        ),
    ],
)
def test_header_and_source_carry_version_form_and_gains(
    tmp_path: Path, gains: str, form: str, parameters: list[str]
) -> None:
    assert main(["export", "c", gains, "-o", str(tmp_path)]) == 0
    header = (tmp_path / "h2nav_filter.h").read_text()
    assert f'#define H2NAV_VERSION "{__version__}"' in header
    assert f'#define H2NAV_FORM "{form}"' in header
    assert f'#define H2NAV_GAINS "{gains}"' in header
    assert max(map(len, header.splitlines())) <= 100
    source = (tmp_path / "h2nav_filter.c").read_text()
    for line in parameters:
        assert re.search(f"^{line}$", source, re.MULTILINE)
    assert max(map(len, source.splitlines())) <= 120


@pytest.mark.parametrize(("layout", "image"), [(fixed_lean, LEAN), (fixed_flight_layout, FLIGHT)])
def test_every_parameter_has_its_name(layout: ModuleType, image: IntegerForm) -> None:
    assert image.layout is layout
    names = parameter_names(layout)
    assert len(names) == layout.PARAMS_SIZE
    for index, name in enumerate(names):
        assert getattr(layout, name) == names.index(name)
        assert index - names.index(name) < names.count(name)


@pytest.mark.parametrize("gains", ["mpu9250_100hz", "handheld_100hz"])
def test_the_lean_form_is_made_of_either_kind(tmp_path: Path, gains: str) -> None:
    assert main(["export", "c", gains, "--form", "lean", "-o", str(tmp_path)]) == 0
    assert '#define H2NAV_FORM "lean"' in (tmp_path / "h2nav_filter.h").read_text()


def test_the_flight_form_needs_a_shaped_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", "c", "mpu9250_100hz", "--form", "flight", "-o", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert "--form flight" in said
    assert "give lean" in said


def test_what_a_silent_vehicle_is_follows_from_its_class(tmp_path: Path) -> None:
    expected = {"handheld_100hz": (1, 0), "multirotor_100hz": (0, 0), "fixed-wing_100hz": (0, None)}
    for gains, (rest, nose) in expected.items():
        main(["export", "c", gains, "-o", str(tmp_path / gains)])
        header = (tmp_path / gains / "h2nav_filter.h").read_text()
        assert f"H2NAV_REST_UNTOLD = {rest}," in header
        found = re.search(r"H2NAV_NOSE_UNTOLD = (\d+)", header)
        assert found is not None
        assert int(found[1]) == nose if nose is not None else int(found[1]) > 1000


@pytest.mark.parametrize("gains", ["mpu9250_100hz", "rover_400hz"])
def test_same_gains_same_files(tmp_path: Path, gains: str) -> None:
    for folder in ("a", "b"):
        main(["export", "c", gains, "-o", str(tmp_path / folder)])
    for name in FILES:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_unknown_gains_and_unwritable_folder_are_bad_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", "c", "no_such_gains", "-o", str(tmp_path)]) == 2
    (tmp_path / "file").write_text("")
    assert main(["export", "c", "mpu9250_100hz", "-o", str(tmp_path / "file")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert "no_such_gains" in lines[0]
    assert "name a folder" in lines[1]

"""`h2nav export c`: what it writes and what it says."""

import json
import re
from pathlib import Path

import pytest

from h2nav import __version__
from h2nav.attitude.gain_seal import seal
from h2nav.cli import main
from h2nav.io import gain_files

FILES = {"h2nav_filter.c", "h2nav_filter.h", "example.c", "check_vectors.c", "h2nav_vectors.h"}


def test_json_names_every_file_with_its_size(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", "c", "multirotor_200hz", "-o", str(tmp_path / "new"), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["ok"] is True
    assert set(result["files"]) == FILES
    for name, entry in result["files"].items():
        assert (tmp_path / "new" / name).stat().st_size == entry["bytes"]
    assert result["gain_hash"] == seal(gain_files.load("multirotor_200hz"))
    assert result["rounding_error"] < 1e-3


def test_header_and_source_carry_version_and_gains(tmp_path: Path) -> None:
    assert main(["export", "c", "mpu9250_100hz", "-o", str(tmp_path)]) == 0
    header = (tmp_path / "h2nav_filter.h").read_text()
    assert f'#define H2NAV_VERSION "{__version__}"' in header
    assert '#define H2NAV_GAINS "mpu9250_100hz"' in header
    source = (tmp_path / "h2nav_filter.c").read_text()
    assert re.search(r"^    \d+, /\* P_SHIFT \*/$", source, re.MULTILINE)
    assert max(map(len, source.splitlines())) <= 120


def test_same_gains_same_files(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        main(["export", "c", "mpu9250_100hz", "-o", str(tmp_path / folder)])
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

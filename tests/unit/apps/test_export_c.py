"""`h2nav export c`: what it writes and what it says."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from h2nav import __version__
from h2nav.attitude.constant_gain import memory as constant_gain
from h2nav.attitude.gains.seal import seal
from h2nav.attitude.record import rows
from h2nav.attitude.velocity_aided.integer import memory as velocity_aided
from h2nav.cli import main
from h2nav.files import gain_files
from h2nav.translate import firmware

FILES = {"h2nav_filter.c", "h2nav_filter.h", "example.c", "check_vectors.c", "h2nav_vectors.h"}


@pytest.fixture(scope="module", autouse=True)
def translations() -> Iterator[dict[object, object]]:
    """Most of the time goes into a kernel's C, which is the same for all gains: it is made once."""
    made: dict[object, object] = {}
    translate = firmware.translate

    def once(kernels, entries, *others):
        key = (entries, *kernels)
        if key not in made:
            made[key] = translate(kernels, entries, *others)
        return made[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(firmware, "translate", once)
        yield made


def test_json_names_every_file_with_its_size(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", "c", "multirotor_200hz", "-o", str(tmp_path / "new"), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["ok"] is True
    assert result["form"] == "velocity_aided"
    assert set(result["files"]) == FILES
    for name, entry in result["files"].items():
        assert (tmp_path / "new" / name).stat().st_size == entry["bytes"]
    assert result["gain_hash"] == seal(gain_files.load("multirotor_200hz"))
    assert result["rounding_error"] < 1e-3


@pytest.mark.parametrize(
    ("gains", "form", "members"),
    [
        ("mpu9250_100hz", "constant_gain", [r"    \.bias_shift = .+,", r"    \.boost_shift = .+,"]),
        (
            "rover_100hz",
            "velocity_aided",
            [r"    \.rest_lowpass_shift = .+,", r"    \.k_tilt = {.*"],
        ),
    ],
)
def test_header_and_source_carry_version_form_and_gains(
    tmp_path: Path, gains: str, form: str, members: list[str]
) -> None:
    assert main(["export", "c", gains, "-o", str(tmp_path)]) == 0
    header = (tmp_path / "h2nav_filter.h").read_text()
    assert f'#define H2NAV_VERSION "{__version__}"' in header
    assert f'#define H2NAV_FORM "{form}"' in header
    assert f'#define H2NAV_GAINS "{gains}"' in header
    assert max(map(len, header.splitlines())) <= 100
    source = (tmp_path / "h2nav_filter.c").read_text()
    for line in members:
        assert re.search(f"^{line}$", source, re.MULTILINE)
    assert max(map(len, source.splitlines())) <= 120


@pytest.mark.parametrize(
    ("gains", "memory"), [("mpu9250_100hz", constant_gain), ("rover_100hz", velocity_aided)]
)
def test_every_field_is_a_member_with_its_meaning(
    tmp_path: Path, gains: str, memory: ModuleType
) -> None:
    assert main(["export", "c", gains, "-o", str(tmp_path)]) == 0
    text = "".join((tmp_path / f"h2nav_filter.{end}").read_text() for end in "hc")
    structs = {"filter": memory.State, "sample": memory.Sample, "gains": memory.Gains}
    for name, record_type in structs.items():
        found = re.search(rf"typedef struct {{\n([^}}]*)}} h2nav_{name};", text)
        assert found is not None
        members = re.findall(r"^    int32_t (\w+)(?:\[(\d+)\])?;", found[1], re.MULTILINE)
        expected = [(row.name, str(row.size or "")) for row in rows(record_type)]
        assert members == expected
        assert all(row.about in found[1] for row in rows(record_type))


@pytest.mark.parametrize("gains", ["mpu9250_100hz", "handheld_100hz"])
def test_the_constant_gain_form_is_made_of_either_kind(tmp_path: Path, gains: str) -> None:
    assert main(["export", "c", gains, "--form", "constant_gain", "-o", str(tmp_path)]) == 0
    assert '#define H2NAV_FORM "constant_gain"' in (tmp_path / "h2nav_filter.h").read_text()


@pytest.mark.parametrize(
    ("former", "now"), [("flight", "velocity_aided"), ("lean", "constant_gain")]
)
def test_former_names_of_the_forms_still_work(tmp_path: Path, former: str, now: str) -> None:
    for form in (former, now):
        folder = str(tmp_path / form)
        assert main(["export", "c", "handheld_100hz", "--form", form, "-o", folder]) == 0
    for name in FILES:
        assert (tmp_path / former / name).read_bytes() == (tmp_path / now / name).read_bytes()


@pytest.mark.parametrize("form", ["velocity_aided", "flight"])
def test_the_velocity_aided_form_needs_a_file_of_its_kind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], form: str
) -> None:
    assert main(["export", "c", "mpu9250_100hz", "--form", form, "-o", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert f"--form {form}" in said
    assert "give constant_gain" in said


def test_what_a_silent_vehicle_is_follows_from_its_class(tmp_path: Path) -> None:
    expected = {"handheld_100hz": (1, 0), "multirotor_100hz": (0, 0), "fixed-wing_100hz": (0, None)}
    for gains, (rest, speed) in expected.items():
        main(["export", "c", gains, "-o", str(tmp_path / gains)])
        header = (tmp_path / gains / "h2nav_filter.h").read_text()
        assert f"H2NAV_REST_UNKNOWN = {rest}," in header
        found = re.search(r"H2NAV_SPEED_UNKNOWN = (\d+)", header)
        assert found is not None
        assert int(found[1]) == speed if speed is not None else int(found[1]) > 1000


@pytest.mark.parametrize("gains", ["mpu9250_100hz", "rover_400hz"])
def test_same_gains_same_files(
    tmp_path: Path, gains: str, translations: dict[object, object]
) -> None:
    for folder in ("a", "b"):
        translations.clear()
        main(["export", "c", gains, "-o", str(tmp_path / folder)])
    for name in FILES:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


@pytest.mark.parametrize(
    ("name", "can_stand"),
    [
        ("Übung (left) * / 2.5 µT?", True),
        ('a "best" one', False),
        ("a\\b", False),
        ("a */ b", False),
        ("a\nb", False),
        ("what??", False),
    ],
)
def test_a_name_that_cannot_stand_in_c_is_bad_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, can_stand: bool
) -> None:
    file = replace(gain_files.load("mpu9250_100hz"), name=name)
    file = replace(file, certificate={**file.certificate, "sha256": seal(file)})
    gain_files.write(tmp_path / "named.yaml", file)
    status = main(["export", "c", str(tmp_path / "named.yaml"), "-o", str(tmp_path)])
    assert status == (0 if can_stand else 2)
    said = capsys.readouterr().err
    assert (f"named.yaml: name: {name!r} cannot stand in C" in said) is not can_stand


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

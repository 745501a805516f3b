"""Gain files on disk: what is refused, what survives, what is found."""

import dataclasses
from pathlib import Path

import pytest
import yaml

from h2nav.attitude.constant_gain.sensor_gains import sensor_gains
from h2nav.attitude.gains.envelope import FORMAT, GainFile
from h2nav.attitude.gains.seal import seal
from h2nav.errors import BadInput
from h2nav.files import gain_files

NAME = "mpu9250_100hz"


@pytest.fixture
def shipped_text() -> str:
    return gain_files.find(NAME).read_text(encoding="utf-8")


def refusal(path: Path) -> str:
    with pytest.raises(BadInput) as caught:
        gain_files.load(path)
    (line,) = caught.value.lines
    assert line.startswith(f"{path}: ")
    return line


def test_every_shipped_file_loads_by_name() -> None:
    names = gain_files.shipped()
    assert NAME in names
    for name in names:
        file = gain_files.load(name)
        assert file.name == name
        assert name == f"{file.model['name']}_{file.rate_hz:g}hz"


def test_shipped_two_stage_files_are_complete() -> None:
    expected = {
        f"{sensor}_{rate}hz"
        for sensor in ("mpu9250", "icm42688", "bmi088")
        for rate in (50, 100, 200, 400)
    }
    assert expected <= set(gain_files.shipped())
    for name in expected:
        file = gain_files.load(name)
        assert "rev." in str(file.model["source"]) or "DS001" in str(file.model["source"])
        sensor_gains(file, name)


def test_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(BadInput, match=r"one of .*mpu9250_100hz"):
        gain_files.load("mpu6050_100hz")


def test_missing_path_is_refused(tmp_path: Path) -> None:
    assert "no such gain file" in refusal(tmp_path / "absent.yaml")


@pytest.mark.parametrize("name", [NAME, "multirotor_100hz"])
def test_writing_and_reading_changes_nothing(tmp_path: Path, name: str) -> None:
    file = gain_files.load(name)
    path = tmp_path / "copy.yaml"
    gain_files.write(path, file)
    again = gain_files.load(path)
    assert repr(again) == repr(file)  # the order of keys and the sign of zeros as well
    assert seal(again) == file.certificate["sha256"]
    assert path.read_text(encoding="utf-8") == gain_files.find(name).read_text(encoding="utf-8")
    assert [entry.name for entry in tmp_path.iterdir()] == ["copy.yaml"]


def test_the_layout_of_a_file_plays_no_part_in_its_seal(tmp_path: Path) -> None:
    file = gain_files.load(NAME)
    path = tmp_path / "blocks.yaml"
    document = {"format": FORMAT, **dataclasses.asdict(file)}
    path.write_text(yaml.safe_dump(document, default_flow_style=False), encoding="utf-8")
    assert gain_files.load(path) == file


def test_shipped_files_are_short() -> None:
    for path in gain_files.shipped().values():
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 200


def test_unwritable_place_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="cannot be written"):
        gain_files.write(tmp_path / "no_folder" / "g.yaml", gain_files.load(NAME))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("  k_ee_rad2: [2.", "  k_ee_rad2: [3."),
        ("    dip_deg: 60.0", "    dip_deg: 61.0"),
        ("rate_hz: 100.0\nmodel", "rate_hz: 50.0\nmodel"),
        ("name: mpu9250_100hz", "name: other"),
    ],
)
def test_changed_file_is_refused(tmp_path: Path, shipped_text: str, old: str, new: str) -> None:
    assert shipped_text.count(old) == 1
    path = tmp_path / "g.yaml"
    path.write_text(shipped_text.replace(old, new), encoding="utf-8")
    assert "changed after they were certified" in refusal(path)


def certificate_changed(file: GainFile, **changes: object) -> GainFile:
    return dataclasses.replace(file, certificate={**file.certificate, **changes})


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({"loops": {}}, "it has no certificate"),
        ({"loops": None}, "it has no certificate"),
        ({"sha256": "0" * 64}, "changed after they were certified"),
        ({"loops": {"a": 1}}, "expected a mapping"),
        ({"loops": {"a": {"spectral_abscissa_per_s": 0.1, "lmi_margin": 1e-8}}}, "not stable"),
        ({"loops": {"a": {"spectral_abscissa_per_s": None, "lmi_margin": 1e-8}}}, "not stable"),
        ({"loops": {"a": {"spectral_abscissa_per_s": -0.1, "lmi_margin": -1e-8}}}, "not proved"),
        ({"loops": {"a": {"spectral_abscissa_per_s": -0.1}}}, "not proved"),
    ],
)
def test_file_without_a_sound_certificate_is_refused(
    tmp_path: Path, changes: dict[str, object], cause: str
) -> None:
    path = tmp_path / "g.yaml"
    gain_files.write(path, certificate_changed(gain_files.load(NAME), **changes))
    assert cause in refusal(path)


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("", "format: expected h2nav-gains/1"),
        ("format: h2nav-gains/9\n", "format: expected h2nav-gains/1"),
        ("- 1\n- 2\n", "expected keys and values"),
        ("a: [1\n", "not YAML"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, text: str, cause: str) -> None:
    path = tmp_path / "g.yaml"
    path.write_text(text, encoding="utf-8")
    assert cause in refusal(path)


def test_values_that_cannot_be_hashed_are_refused(tmp_path: Path, shipped_text: str) -> None:
    path = tmp_path / "g.yaml"
    path.write_text(shipped_text.replace("dip_deg: 60.0\n", "dip_deg: .nan\n", 1))
    assert "cannot be hashed" in refusal(path)


@pytest.mark.parametrize(
    ("rate_hz", "shipped_hz"),
    [(1.0, 50), (70.7, 50), (70.8, 100), (141.4, 100), (141.5, 200), (282.8, 200), (282.9, 400),
     (4000.0, 400)],
)  # fmt: skip
def test_the_nearest_rate_is_that_of_the_smallest_ratio(rate_hz: float, shipped_hz: int) -> None:
    """They change at the geometric means."""
    assert gain_files.shipped_rate(rate_hz) == shipped_hz


@pytest.mark.parametrize(("length", "lines"), [(600, 1), (601, 3)])
def test_a_row_of_a_certificate_has_one_line_of_at_most_600_characters(
    length: int, lines: int
) -> None:
    row = {"a": 1, "b": ""}
    row["b"] = "x" * (length - len('{"a": 1, "b": ""}'))
    text = gain_files.text_of(dataclasses.replace(gain_files.load(NAME), certificate=row))
    after = text.partition("certificate:")[2].partition("fixed_point:")[0]
    assert len(after.splitlines()) == lines


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("absent.yaml", "absent.yaml: no such gain file"),
        ("a/b", "a/b: no such gain file"),
        ("absent", "gain file absent: not shipped; expected a path ending in .yaml or one of "),
    ],
)
def test_what_is_not_found_is_named_as_it_was_given(name: str, said: str) -> None:
    with pytest.raises(BadInput) as caught:
        gain_files.find(name)
    assert str(caught.value).startswith(said)


def test_a_file_is_found_by_its_path_whatever_its_suffix(tmp_path: Path, shipped_text: str) -> None:
    path = tmp_path / "gains.txt"
    path.write_text(shipped_text, encoding="utf-8")
    assert gain_files.find(path) == gain_files.find(str(path)) == path
    assert gain_files.read(path) == gain_files.load(NAME)


def test_an_envelope_is_read_without_its_certificate(tmp_path: Path, shipped_text: str) -> None:
    path = tmp_path / "g.yaml"
    path.write_text(shipped_text.replace("name: mpu9250_100hz", "name: other"), encoding="utf-8")
    assert gain_files.read(path).name == "other"


def test_a_failed_write_leaves_the_file_of_before(tmp_path: Path) -> None:
    path = tmp_path / "g.yaml"
    path.mkdir()
    with pytest.raises(BadInput, match=r"g\.yaml: cannot be written: .*Is a directory"):
        gain_files.write(path, gain_files.load(NAME))
    assert list(tmp_path.iterdir()) == [path]

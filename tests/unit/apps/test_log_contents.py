"""What a log says of the run that made it."""

import os
import platform
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from log_limits import limits

from h2nav import __version__
from h2nav.apps import log_contents
from h2nav.apps.configuration import Configuration, FilterSettings, LogSettings
from h2nav.apps.filters import FilterFactory
from h2nav.attitude import native
from h2nav.errors import BadInput
from h2nav.integrity.severity import Severity
from h2nav.log.recorder import Recorder
from h2nav.recordings.recording import open_recording


@pytest.mark.parametrize("switch", ["forbid", ""])
def test_the_log_names_the_kernels_that_ran(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, switch: str
) -> None:
    monkeypatch.setenv(native.SWITCH, switch)
    chosen = Configuration()
    factory = FilterFactory.shipped(chosen.filter, 100.0)
    with Recorder(tmp_path, limits(), 0) as recorder:
        log_contents.attach_inputs(recorder, chosen, factory, 5.0)
    (path,) = tmp_path.glob("*.mcap")
    recording = open_recording(path)
    assert list(recording.received()) == []
    assert recording.metadata[log_contents.RUN_METADATA]["kernels"] == native.backend()
    inputs = log_contents.inputs_of(recording)
    assert inputs is not None
    assert inputs.unix_s == 5.0


def test_a_folder_whose_name_is_no_text_is_recorded_and_read_back(tmp_path):
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/lo\xffg"))
    chosen = Configuration(log=LogSettings(folder=os.fspath(folder)))
    factory = FilterFactory.shipped(chosen.filter, 100.0)
    with Recorder(folder, limits(), 0) as recorder:
        log_contents.attach_inputs(recorder, chosen, factory, 5.0)
        recorder.text(1, Severity.NOTICE, f"log in {folder}")
    assert recorder.statistics().rejected == 0
    (path,) = folder.glob("*.mcap")
    inputs = log_contents.inputs_of(open_recording(path))
    assert inputs is not None
    assert inputs.configuration.log.folder == f"{tmp_path}/lo?g"


def test_the_daemon_starts_without_what_looks_at_whole_recordings():
    program = "import sys, h2nav.apps.session; sys.exit('numpy' in sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True)


def recording(configuration: bytes | None = b"link: {}", **metadata: str) -> SimpleNamespace:
    """A log of h2nav; or of another program."""
    files = {} if configuration is None else {"configuration.yaml": configuration}
    files |= {"gains/a": b"1", "other/b": b"2"}
    return SimpleNamespace(
        path=Path("log.mcap"),
        attachments={name: SimpleNamespace(data=data) for name, data in files.items()},
        metadata={"h2nav": metadata} if metadata else {},
    )


def test_what_is_attached_is_read_back_and_nothing_else() -> None:
    log = recording(b"filter: {vehicle_class: rover}", unix_s="5.25", version="1.2")
    found = log_contents.inputs_of(log)
    assert found is not None
    assert found.configuration.filter.vehicle_class == "rover"
    assert found[1:] == ({"a": b"1"}, 5.25, "")
    assert log_contents.version_of(log) == "1.2"
    assert log_contents.inputs_of(recording(None)) is None
    assert log_contents.version_of(recording(None)) == ""


@pytest.mark.parametrize(
    ("unix_s", "is_taken"),
    [
        ("0", True),
        ("4102444800.0", True),  # the year 2100
        ("4102444801", False),
        ("-1", False),
        ("nan", False),
        ("soon", False),
    ],
)
def test_a_date_of_a_run_is_before_2100(unix_s: str, is_taken: bool) -> None:
    log = recording(unix_s=unix_s)
    if is_taken:
        assert log_contents.inputs_of(log).unix_s == float(unix_s)
        return
    with pytest.raises(BadInput) as caught:
        log_contents.inputs_of(log)
    assert str(caught.value) == (
        f"log.mcap: metadata h2nav: unix_s: expected UNIX seconds, found {unix_s}; replay with "
        "--config"
    )


def test_a_log_without_a_date_has_none() -> None:
    assert log_contents.inputs_of(recording()).unix_s == 0.0


@pytest.mark.parametrize(
    ("section", "expected", "has_remark"),
    [
        ("{}", {}, False),
        ("{gyro_sampling: instant}", {}, False),
        ("{name: constant_gain, arithmetic: fixed}",
         {"name": "constant_gain", "arithmetic": "fixed"}, False),
        ("{name: two_stage, arithmetic: fixed, sensor: bmi088}",
         {"name": "constant_gain", "arithmetic": "fixed", "sensor": "bmi088"}, False),
        ("{name: two_stage, sensor: bmi088, vehicle_class: rover}",
         {"vehicle_class": "rover"}, True),
        ("{name: two_stage, arithmetic: float, gyro_sampling: instant}", {}, True),
    ],
)  # fmt: skip
def test_a_filter_of_a_former_version_is_todays(
    section: str, expected: dict[str, str], has_remark: bool
) -> None:
    found = log_contents.inputs_of(recording(f"filter: {section}".encode()))
    assert found.configuration.filter == FilterSettings(**expected)
    remark = "recorded with the filter two_stage, which no longer exists; played with the default"
    assert found.remark == (remark if has_remark else "")


def test_a_log_says_by_what_it_was_made() -> None:
    told = []
    recorder = SimpleNamespace(
        attach=lambda name, kind, data: told.append((name, kind, data)),
        metadata=lambda name, texts: told.append((name, texts)),
    )
    filters = SimpleNamespace(gain_texts=lambda: {"a": "1", "b": "ä"})
    chosen = Configuration()
    log_contents.attach_inputs(recorder, chosen, filters, 5.1)
    (first, *gains, (name, texts)) = told
    assert first[:2] == ("configuration.yaml", "application/yaml")
    assert yaml.safe_load(first[2])["log"]["max_files"] == chosen.log.max_files
    assert list(yaml.safe_load(first[2])) == list(chosen.as_mapping())
    assert gains == [
        ("gains/a", "application/yaml", b"1"), ("gains/b", "application/yaml", "ä".encode()),
    ]  # fmt: skip
    assert (name, texts) == (
        "h2nav",
        {
            "version": __version__,
            "python": platform.python_version(),
            "machine": platform.machine(),
            "kernels": native.backend(),
            "unix_s": "5.1",
        },
    )


def test_limits_of_a_log_are_in_bytes_and_seconds() -> None:
    settings = LogSettings(
        max_file_mb=2, max_file_minutes=3, max_files=4, max_run_mb=5, min_free_mb=6
    )
    found = log_contents.log_limits(settings)
    assert (found.file_bytes, found.file_age_s, found.files) == (2 << 20, 180.0, 4)
    assert (found.run_bytes, found.free_bytes) == (5 << 20, 6 << 20)
    assert log_contents.open_recorder(LogSettings(), 0) is None

"""What a log says of the run that made it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from log_limits import limits

from h2nav.apps import log_contents
from h2nav.apps.configuration import Configuration, LogSettings
from h2nav.apps.filters import FilterFactory
from h2nav.attitude import native
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

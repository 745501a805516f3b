"""What a log says of the run that made it."""

import subprocess
import sys
from pathlib import Path

import pytest
from log_limits import limits

from h2nav.apps import log_contents
from h2nav.apps.configuration import Configuration
from h2nav.apps.filters import FilterFactory
from h2nav.attitude import native
from h2nav.io.recorder import Recorder
from h2nav.io.recordings import open_recording


@pytest.mark.parametrize("wish", ["forbid", ""])
def test_the_log_names_the_kernels_that_ran(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wish: str
) -> None:
    monkeypatch.setenv(native.SWITCH, wish)
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


def test_the_daemon_starts_without_what_looks_at_whole_recordings():
    program = "import sys, h2nav.apps.session; sys.exit('numpy' in sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True)

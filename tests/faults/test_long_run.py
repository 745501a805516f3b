"""26: simulated hours at many times real time, over a wrap of the 32-bit clock.

``make soak`` flies 24 hours of it.
"""

import json
import subprocess
import sys

import pytest
from needs import REPOSITORY

pytestmark = pytest.mark.thorough

HOURS = 0.25  # at 20 Hz more samples than the blocks that may remain: one a sample would show
SOAK = [sys.executable, str(REPOSITORY / "tools" / "soak.py"), "--rate-hz", "20", "--json"]


def test_memory_and_descriptors_are_flat_and_no_sample_is_lost():
    done = subprocess.run(
        [*SOAK, "--hours", str(HOURS)], capture_output=True, text=True, check=False
    )
    assert done.stdout, done.stderr
    found = json.loads(done.stdout)
    assert found["complaints"] == []
    assert found["state"] == "active"
    assert found["samples_sent"] == HOURS * 3600 * 20
    assert not {"reboot", "stray_time", "late"} & found["rejected"].keys()

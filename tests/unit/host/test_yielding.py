"""What a process gives up for the estimate."""

import resource
import subprocess
import sys

PROGRAM = """
import os, resource
from h2nav.host.yielding import run_when_idle, yield_to_others
before = os.nice(0)
yield_to_others(3, {resource.RLIMIT_CORE: 0, resource.RLIMIT_NOFILE: 99, 12345: 1})
run_when_idle()
print(os.nice(0) - before, *resource.getrlimit(resource.RLIMIT_NOFILE))
print(open("/proc/self/oom_score_adj").read().strip(), os.sched_getscheduler(0) == os.SCHED_IDLE)
"""


def test_it_is_nicer_bounded_idle_and_killed_first():
    assert resource.getrlimit(resource.RLIMIT_NOFILE)[1] >= 99
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.split() == ["3", "99", "99", "1000", "True"]

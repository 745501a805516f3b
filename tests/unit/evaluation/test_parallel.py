"""Tasks: each once, in order, and none of none; no worker outlives the one that started it."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from h2nav.evaluation.parallel import finished, results

PROGRAM = """
import time
from h2nav.evaluation.parallel import finished

def wait(seconds):
    time.sleep(seconds)
    return seconds

if __name__ == "__main__":
    for seconds in finished(wait, [0, 0, 600], 2):
        print(seconds, flush=True)
"""


@pytest.mark.parametrize("tasks", [(), (3,), (3, 1, 2)])
def test_each_task_has_its_result_in_order(tasks, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    expected = [str(task) for task in tasks]
    assert list(results(str, tasks)) == expected
    assert list(finished(str, tasks, 1)) == expected


def test_nothing_is_left_of_the_workers_behind_the_last_result():
    before = set(threading.enumerate())
    assert sorted(finished(str, [3, 1, 2], 2)) == ["1", "2", "3"]
    assert set(threading.enumerate()) == before


def test_workers_end_with_the_process_that_started_them(tmp_path: Path) -> None:
    """Of a campaign that was terminated two workers of 150 MB waited for ever."""
    (tmp_path / "program.py").write_text(PROGRAM)
    with subprocess.Popen(
        [sys.executable, "program.py"], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert [process.stdout.readline() for _ in range(2)] == ["0\n", "0\n"]
        process.kill()
        # The workers write there as well: it ends with the last of them.
        rest, _ = process.communicate(timeout=60)
    assert rest == ""

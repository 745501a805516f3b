"""Tasks in this process: each once, in order, and none of none."""

import os

import pytest

from h2nav.evaluation.parallel import finished, results


@pytest.mark.parametrize("tasks", [(), (3,), (3, 1, 2)])
def test_each_task_has_its_result_in_order(tasks, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    expected = [str(task) for task in tasks]
    assert list(results(str, tasks)) == expected
    assert list(finished(str, tasks, 1)) == expected

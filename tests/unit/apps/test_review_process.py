"""The process that reviews, seen from its parent: what its words and its end mean."""

import json
import os
import select
import subprocess

import pytest

from h2nav.apps import review_process
from h2nav.apps.review_process import MAX_SAID_BYTES, ReviewOutcome, ReviewProcess
from h2nav.apps.reviewer import ReviewJob
from h2nav.flights.folder import FlightFolder

BEGAN = '{"began": "id-1", "name": "a.tlog"}'
DONE = {
    "id": "id-1", "name": "a.tlog", "error": "", "severity": "warning", "text": "flight: bad",
    "summary": {"errors": 0},
}  # fmt: skip


class Bench:
    """Takes the place of the process: a shell that runs a script."""

    def __init__(self, root, monkeypatch):
        self.root, self.script, self.jobs = root, "true", []
        self.process = ReviewProcess(ReviewJob(str(root), str(root / "reviews"), 200, 5))
        monkeypatch.setattr(review_process, "start_module", self._start)

    def ended(self, script):
        self.script = script
        self.process.start()
        assert self.process.is_running
        self.process._process.wait(30.0)
        outcome = self.process.outcome()
        assert not self.process.is_running
        assert self.process.outcome() is None
        return outcome

    def _start(self, module, job, *, env, **streams):
        assert module == "h2nav.apps.reviewer"
        assert env == {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        self.jobs.append(json.loads(job))
        return subprocess.Popen(["/bin/sh", "-c", self.script], **streams)


@pytest.fixture
def bench(tmp_path, monkeypatch):
    return Bench(tmp_path, monkeypatch)


def says(*lines):
    return "cat <<'X'\n" + "\n".join(lines) + "\nX\n"


@pytest.mark.parametrize(
    ("script", "outcome"),
    [
        (
            says(BEGAN, json.dumps(DONE)),
            ReviewOutcome("id-1", "a.tlog", "", "warning", "flight: bad", {"errors": 0}),
        ),
        (
            says(BEGAN, '{"id": "id-1", "name": "a.tlog", "error": "no recording"}'),
            ReviewOutcome("id-1", "a.tlog", "no recording"),
        ),
        (says('{"nothing": true}'), ReviewOutcome()),
        (says('{"busy": true}'), ReviewOutcome(is_busy=True)),
        (says(BEGAN, '{"trouble": "disk full"}') + "exit 1", ReviewOutcome(trouble="disk full")),
        # other lines are a library's
        (says("[1]", "{", '{"nothing": true}', "noise", "3"), ReviewOutcome()),
        ("exit 0", ReviewOutcome(trouble="the review ended with status 0")),
        ("exit 3", ReviewOutcome(trouble="the review ended with status 3")),
        ("kill -9 $$", ReviewOutcome(trouble="the review ended with signal 9")),
        (
            says(BEGAN) + "kill -11 $$",
            ReviewOutcome(trouble="the review of a.tlog ended with signal 11"),
        ),
        (
            "printf 'first\\nlast \\001 words \\n\\n' >&2; exit 1",
            ReviewOutcome(trouble="the review ended with status 1: last _ words"),
        ),
    ],
)
def test_what_a_process_said_last_is_its_outcome(bench, script, outcome):
    assert bench.ended(script) == outcome


def test_last_words_are_short(bench):
    said = bench.ended(f"printf '{'x' * 300}' >&2; exit 1").trouble
    assert said == f"the review ended with status 1: {'x' * 200}"


@pytest.mark.parametrize(
    ("outcome", "did_nothing"),
    [
        (ReviewOutcome(), True),
        (ReviewOutcome(is_busy=True), True),
        (ReviewOutcome("id-1"), False),
        (ReviewOutcome(trouble="disk full"), False),
    ],
)
def test_whether_anything_was_done(outcome, did_nothing):
    assert outcome.did_nothing is did_nothing


def test_the_next_one_is_told_which_flight_ended_it(bench):
    bench.ended(says(BEGAN) + "kill -9 $$")
    bench.ended(says('{"nothing": true}'))
    bench.ended("true")
    assert [job["ended"] for job in bench.jobs] == [
        ["", ""],
        ["id-1", "signal 9"],
        ["id-1", "signal 9"],
    ]


def test_a_former_process_says_nothing_for_the_next_one(bench):
    bench.ended(says(BEGAN, json.dumps(DONE)))
    assert bench.ended("exit 4").trouble == "the review ended with status 4"


def test_a_flood_of_words_keeps_the_last_ones(bench):
    flood = f"head -c {MAX_SAID_BYTES + 70_000} /dev/zero | tr '\\0' x; echo; "
    bench.script = flood + says('{"nothing": true}')
    bench.process.start()
    while (outcome := bench.process.outcome()) is None:
        assert len(bench.process._said) <= MAX_SAID_BYTES
    assert outcome == ReviewOutcome()


def test_stopped_it_leaves_no_attempt_of_what_it_said_last(bench):
    folder = FlightFolder(bench.root)
    folder.attempt("id-1")
    folder.attempt("id-2")
    bench.script = says(BEGAN) + "exec sleep 60"
    bench.process.start()
    child = bench.process._process
    assert select.select([child.stdout], [], [], 30.0)[0]
    bench.process.stop()
    assert child.returncode == -9
    assert not bench.process.is_running
    assert sorted(path.name for path in folder.reviews.iterdir()) == ["id-2.started"]
    bench.process.stop()  # again is nothing


def test_stopped_before_it_began_anything_it_leaves_the_marks_of_others(bench):
    folder = FlightFolder(bench.root)
    folder.attempt("id-2")
    bench.script = "exec sleep 60"
    bench.process.start()
    assert bench.process.outcome() is None
    bench.process.stop()
    assert [path.name for path in folder.reviews.iterdir()] == ["id-2.started"]


def test_descriptors_are_closed(bench):
    before = len(os.listdir("/proc/self/fd"))
    bench.ended("true")
    assert len(os.listdir("/proc/self/fd")) == before

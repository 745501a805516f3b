"""A fixed share of the file fuzzing; `file_targets.run` takes any number of further cases."""

import pytest

from fuzz.file_targets import TARGETS, case, run

CASES = 25
REPLAY_CASES = 8  # a replay costs as much as ten other files


@pytest.mark.parametrize("target", TARGETS)
def test_no_file_gets_more_than_an_answer_out_of_a_reader(target, tmp_path):
    for number in range(REPLAY_CASES if target.startswith("replay") else CASES):
        run(target, case(target, number), tmp_path)


@pytest.mark.parametrize(
    ("target", "number"), [("replay into a log", 56), ("odometry table as text", 9508)]
)
def test_what_was_found_once_stays_mended(target, number, tmp_path):
    run(target, case(target, number), tmp_path)

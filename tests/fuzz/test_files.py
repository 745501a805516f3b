"""A fixed share of the file fuzzing; `make fuzz` goes on from there."""

import pytest
from fuzz.file_targets import TARGETS, case, run

CASES = 25


@pytest.mark.parametrize("target", TARGETS)
def test_no_file_gets_more_than_an_answer_out_of_a_reader(target, tmp_path):
    for number in range(CASES):
        run(target, case(target, number), tmp_path)

"""A fixed share of the worn logs; `tools/fuzz_reviews.py` takes any number, and real ones."""

import pytest

from fuzz.review_target import case, reviewed, seeds

pytestmark = pytest.mark.thorough

CASES = 5
NAMES = ("new.bin", "old.bin", "old.log", "new.ulg", "old.ulg", "one.tlog")


@pytest.mark.parametrize(
    "name", ["new.bin", "old.bin", "old.log", "new.ulg", "old.ulg", "one.tlog"]
)
def test_a_worn_log_is_reviewed_or_refused_in_words(name, tmp_path):
    log = seeds()[name]
    for number in range(CASES):
        data, _ = case(log, number)
        reviewed(data, log.ending, tmp_path)


@pytest.mark.parametrize("name", NAMES)
def test_a_log_taken_apart_and_put_together_is_the_same(name, tmp_path):
    log = seeds()[name]
    assert reviewed(log.bytes(), log.ending, tmp_path)["duration_s"] > 10.0

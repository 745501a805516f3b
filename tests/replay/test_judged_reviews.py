"""Real logs whose events are known and whose findings people judged: reviewed as they were judged.

The shares of docs/benchmark.md are of more logs. Here no log may fail, miss what happened, or
accuse of an error that nobody found true.
"""

import pytest
from needs import shared_data, tool

import h2nav

pytestmark = pytest.mark.thorough

PORTIONS = 12


@pytest.mark.parametrize("portion", range(PORTIONS))
def test_errors_are_those_that_were_judged_true_and_no_event_is_missed(portion):
    score = tool("benchmark/score")
    logs = score.logs([shared_data("real")])
    assert len(logs) > PORTIONS
    reviews = {score.digest(log): h2nav.review(log) for log in logs[portion::PORTIONS]}
    _, _, missed = score.recall(reviews)
    assert missed == []
    # Warnings of new kinds come with new checks, and are for people to judge.
    errors = {
        sha256: {**document, "findings": [one for one in document["findings"] if is_error(one)]}
        for sha256, document in reviews.items()
    }
    _, _, not_judged, wrong = score.judged(errors)
    assert (not_judged, wrong) == (0, [])


def is_error(finding):
    return finding["severity"] in ("error", "critical")

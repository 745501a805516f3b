"""Spans of equal names, and silences: just long enough, and just too short."""

import numpy as np
import pytest

from h2nav.recordings.context import Span
from h2nav.recordings.spans import SILENT, silences, spans, without


@pytest.mark.parametrize(
    ("names", "found"),
    [
        ("aaab", [(0.0, 3.0, "a"), (3.0, 9.0, "b")]),
        ("a--a", [(0.0, 1.0, "a"), (3.0, 9.0, "a")]),
        ("-ab-", [(1.0, 2.0, "a"), (2.0, 3.0, "b")]),
        ("----", []),
    ],
)
def test_a_name_lasts_until_another_or_none_begins(names, found):
    texts = (name.strip("-") for name in names)
    assert list(spans([0.0, 1.0, 2.0, 3.0], texts, 9.0)) == found


@pytest.mark.parametrize(
    ("usual_s", "pause_s", "is_silence"),
    [
        (0.01, 0.249, False),
        (0.01, 0.251, True),
        (0.2, 0.599, False),
        (0.2, 0.601, True),
        (1.0, 2.999, False),
        (1.0, 3.001, True),
        (5.1, 5.1, True),  # no usual pause of any log
    ],
)
def test_a_silence_is_longer_than_a_quarter_of_a_second_and_than_three_usual_pauses(
    usual_s, pause_s, is_silence
):
    steps_s = np.full(40, usual_s)
    steps_s[20] = pause_s
    t_s = np.cumsum(steps_s)
    expected = Span(float(t_s[19]), float(t_s[20]), SILENT)
    assert (expected in silences(t_s)) is is_silence


def test_bursts_once_a_second_are_as_usual():
    """Ten messages at once: of all pauses most are short, but the time passes in the long ones."""
    t_s = (np.arange(20.0)[:, None] + 0.001 * np.arange(10)).ravel()
    assert silences(t_s) == ()
    assert len(silences(np.delete(t_s, slice(100, 120)))) == 1


@pytest.mark.parametrize("t_s", [[], [1.0], [1.0, 1.0]])
def test_few_times_show_no_silence(t_s):
    assert silences(np.array(t_s)) == ()


@pytest.mark.parametrize(
    ("cuts", "rest"),
    [
        ([], [(10.0, 20.0)]),
        ([(0.0, 10.0), (20.0, 30.0)], [(10.0, 20.0)]),
        ([(0.0, 12.0)], [(12.0, 20.0)]),
        ([(18.0, 30.0)], [(10.0, 18.0)]),
        ([(12.0, 14.0), (16.0, 17.0)], [(10.0, 12.0), (14.0, 16.0), (17.0, 20.0)]),
        ([(10.0, 20.0)], []),
        ([(0.0, 30.0)], []),
    ],
)
def test_a_span_without_others_is_what_is_left_of_it(cuts, rest):
    found = without([Span(10.0, 20.0, "a")], [Span(*cut, "b") for cut in cuts])
    assert [(one.from_s, one.to_s) for one in found] == rest
    assert {one.name for one in found} <= {"a"}

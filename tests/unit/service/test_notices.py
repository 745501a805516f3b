import pytest

from h2nav.integrity.findings import Severity
from h2nav.maths.units import SECOND_NS
from h2nav.service.notices import MAX_CAUSES, MAX_REMINDERS, NOTICES_AT_ONCE, Notices
from h2nav.wire.outbound import STATUS_TEXT_CHUNKS, STATUS_TEXT_SIZE


def texts_sent(notices, start_s, end_s):
    """What the ground station reads, asked ten times a second."""
    times = range(round(10 * start_s), round(10 * end_s))
    sent = [notices.status_texts(i * SECOND_NS // 10) for i in times]
    return ["".join(chunk.text for chunk in chunks) for chunks in sent if chunks]


def test_a_cause_speaks_once_a_minute_whatever_its_figures():
    notices = Notices(as_status_text=False)
    said = [
        notices.report(t_s * SECOND_NS, Severity.WARNING, f"rate {t_s} Hz", "rate")
        for t_s in range(130)
    ]
    assert [t_s for t_s, effects in enumerate(said) if effects] == [0, 60, 120]


def test_however_many_causes_there_are_the_lines_are_bounded():
    notices = Notices(as_status_text=False)
    told = [
        effect
        for i in range(100_000)
        for effect in notices.report(i * SECOND_NS // 1000, Severity.INFO, f"cause {i}")
    ]
    assert len(told) <= NOTICES_AT_ONCE + 0.3 * 100 + 1
    assert len(notices._reported) <= MAX_CAUSES


def test_one_status_text_a_second_and_none_twice():
    notices = Notices(as_status_text=True)
    for _ in range(5):
        notices.report(0, Severity.WARNING, "IMU lost")
        notices.report(0, Severity.INFO, "active")
    assert texts_sent(notices, 0.0, 0.9) == ["h2nav: IMU lost"]
    assert texts_sent(notices, 0.9, 4.0) == ["h2nav: active"]


def test_length_and_queue_of_status_texts_are_bounded():
    notices = Notices(as_status_text=True)
    for i in range(1000):
        notices.report(0, Severity.INFO, f"{i} " + "x" * 100)
    sent = texts_sent(notices, 0.0, 100.0)
    assert 0 < len(sent) <= 8
    assert all(len(text) <= STATUS_TEXT_CHUNKS * STATUS_TEXT_SIZE for text in sent)


def test_who_comes_late_reads_the_worst_again():
    notices = Notices(as_status_text=True)
    notices.report(0, Severity.WARNING, "degraded")
    assert texts_sent(notices, 0.0, 3.0) == ["h2nav: degraded"]
    notices.remind([(Severity.WARNING, f"text {number}") for number in range(9)])
    assert texts_sent(notices, 3.0, 20.0) == [f"h2nav: text {k}" for k in range(MAX_REMINDERS)]


W, N = Severity.WARNING, Severity.NOTICE


@pytest.mark.parametrize(
    ("first", "second", "later_s", "is_told"),
    [
        (N, N, 59.999, False),
        (N, N, 60.0, True),
        (N, W, 0.0, True),  # it is worse
        (W, N, 59.999, False),
        (W, N, 60.0, True),
    ],
)
def test_a_cause_is_told_again_after_a_minute_or_where_it_is_worse(first, second, later_s, is_told):
    notices = Notices(as_status_text=True)
    (told,) = notices.report(0, first, "rate 9 Hz", "rate")
    assert told == (first, "rate 9 Hz", "")
    t_ns = round(later_s * SECOND_NS)
    assert notices.may_report(t_ns, "rate", second) is is_told
    assert bool(notices.report(t_ns, second, "rate 8 Hz", "rate")) is is_told
    assert notices.may_report(0, "another")
    assert notices.report(t_ns, N, "rate 7 Hz")  # without a cause, the text is one


def test_a_cause_that_is_forgotten_is_told_at_once():
    notices = Notices(as_status_text=False)
    notices.report(0, W, "x")
    notices.forget("y")
    assert notices.report(1, W, "x") == []
    notices.forget("x")
    assert notices.report(1, W, "x")


def test_fifteen_at_once_and_three_in_ten_seconds():
    notices = Notices(as_status_text=False)
    told = [bool(notices.report(0, W, f"{number}")) for number in range(17)]
    assert told == [True] * 15 + [False] * 2
    due_ns = round(SECOND_NS / 0.3)
    assert notices.report(due_ns - 1, W, "16") == []
    assert notices.report(due_ns, W, "16")


def test_sixty_four_causes_are_remembered():
    notices = Notices(as_status_text=False)
    t_ns = 0
    for number in range(65):
        t_ns += 10 * SECOND_NS
        notices.report(t_ns, W, "x", f"{number}")
    assert [notices.may_report(0, f"{number}") for number in (0, 1, 64)] == [True, False, False]


def test_a_text_is_sent_with_its_severity_and_a_number_of_its_own():
    notices = Notices(as_status_text=True)
    for text in ("a" * 60, "b" * 60, "c"):
        notices.report(0, W, text)
    first, second = (notices.status_texts(k * SECOND_NS) for k in (1, 2))
    assert [chunk.severity for chunk in first] == [4, 4]
    assert {chunk.id for chunk in first} == {1}
    assert {chunk.id for chunk in second} == {2}
    assert notices.status_texts(3 * SECOND_NS - 1) == []
    (third,) = notices.status_texts(3 * SECOND_NS)
    assert third.text == "h2nav: c"
    assert notices.status_texts(9 * SECOND_NS) == []


def test_of_too_many_texts_the_eight_newest_wait():
    notices = Notices(as_status_text=True)
    for number in range(10):
        notices.report(0, W, f"{number}")
    assert texts_sent(notices, 0.0, 20.0) == [f"h2nav: {number}" for number in range(2, 10)]


def test_four_reminders_and_none_where_texts_are_not_wanted():
    notices = Notices(as_status_text=True)
    notices.remind((W, f"{number}") for number in range(6))
    assert texts_sent(notices, 0.0, 20.0) == [f"h2nav: {number}" for number in range(4)]
    silent = Notices(as_status_text=False)
    silent.remind([(W, "x")])
    silent.report(0, W, "y")
    assert texts_sent(silent, 0.0, 20.0) == []

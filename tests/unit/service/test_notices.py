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

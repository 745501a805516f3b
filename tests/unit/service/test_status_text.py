from h2nav.service.effects import Severity
from h2nav.service.status_text import LIMIT, StatusText

SECOND_NS = 1_000_000_000


def test_one_text_a_second_and_none_twice():
    texts = StatusText()
    for _ in range(5):
        texts.say(0, Severity.WARNING, "IMU lost")
        texts.say(0, Severity.INFO, "active")
    sent = [texts.due(i * SECOND_NS // 10) for i in range(40)]
    assert [message.text for message in sent if message] == ["h2nav: IMU lost", "h2nav: active"]


def test_the_same_text_may_return_after_half_a_minute():
    texts = StatusText()
    texts.say(0, Severity.INFO, "active")
    assert texts.due(0)
    texts.say(31 * SECOND_NS, Severity.INFO, "active")
    assert texts.due(31 * SECOND_NS)


def test_length_and_queue_are_bounded():
    texts = StatusText()
    for i in range(1000):
        texts.say(0, Severity.INFO, f"{i} " + "x" * 100)
    sent = [texts.due(i * SECOND_NS) for i in range(100)]
    sent = [message for message in sent if message]
    assert len(sent) <= 8
    assert all(len(message.text) <= LIMIT for message in sent)

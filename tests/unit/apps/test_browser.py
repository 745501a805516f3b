"""A browser of text runs until it is left: nobody waits for it, not even the end of the program."""

import threading

from h2nav.apps import browser


def test_a_page_is_opened_while_the_program_goes_on(monkeypatch):
    is_left, opened = threading.Event(), []

    def browse(url):
        opened.append((url, threading.current_thread()))
        is_left.wait(10.0)

    monkeypatch.setattr(browser.webbrowser, "open", browse)
    browser.open_page("http://127.0.0.1:1/")
    is_left.set()
    while not opened:
        pass
    ((url, thread),) = opened
    thread.join(10.0)
    assert url == "http://127.0.0.1:1/"
    assert thread.daemon
    assert thread is not threading.current_thread()

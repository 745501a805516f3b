"""A browser without a window, which reaches this computer and nothing else."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from needs import need_package, need_program

PATIENCE_S = 60


@contextmanager
def headless_browser() -> Iterator[Any]:
    """Chromium by Selenium; it ends with the block."""
    chromium, driver = need_program("chromium"), need_program("chromedriver")
    selenium = need_package("selenium.webdriver")
    service = need_package("selenium.webdriver.chrome.service").Service(driver)
    options = selenium.ChromeOptions()
    options.binary_location = chromium
    for argument in (
        "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1400,1000",
        "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
    ):  # fmt: skip
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    running = selenium.Chrome(options=options, service=service)
    running.set_script_timeout(PATIENCE_S)
    try:
        yield running
    finally:
        running.quit()


def wait_until(browser: Any, script: str, *arguments: object) -> None:
    """Waits until a script returns something true."""
    wait = need_package("selenium.webdriver.support.ui").WebDriverWait
    wait(browser, PATIENCE_S, 0.02).until(lambda _: browser.execute_script(script, *arguments))


def says(browser: Any, selector: str, words: str) -> None:
    """Waits until an element's text holds some words."""
    text = "document.querySelector(arguments[0]).innerText"
    wait_until(browser, f"return {text}.includes(arguments[1])", selector, words)

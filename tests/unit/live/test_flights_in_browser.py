"""The list of flights in a real browser, at a desk's width and a phone's, by keyboard alone."""

import pytest
from browsers import headless_browser, says, wait_until
from flight_folders import add_flights, summary
from live_records import served

from h2nav.live.flights_site import SiteRights

pytestmark = pytest.mark.thorough

COUNT = 500
TOKEN = "0123456789abcdefTOKEN"
WIDTHS = {"desk": 1280, "phone": 390}
VIBRATING = sum("vibration" in summary(number)["kinds"] for number in range(COUNT))
ROWS = "document.querySelectorAll('#list tbody tr').length"
FIRST = "return document.querySelector('#list tbody tr').innerText"
TOO_WIDE = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"


@pytest.fixture(scope="module")
def browser():
    with headless_browser() as running:
        yield running


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = add_flights(tmp_path_factory.mktemp("flights"), COUNT)
    (folder.root / "broken.bin").write_bytes(b"not a log")
    flight = next(each for each in folder.flights().values() if each.best.name == "broken.bin")
    folder.commit(flight, {}, error="<b>not</b> a recording")
    with served(None, flights=folder, rights=SiteRights(TOKEN, 1 << 20)) as running:
        yield running


@pytest.fixture(params=WIDTHS)
def width(request, browser, page):
    look = {"width": WIDTHS[request.param], "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", look)
    browser.get_log("browser")
    browser.get(f"http://127.0.0.1:{page.port}/flights")
    wait_until(browser, f"return {ROWS} === 100")
    yield request.param
    browser.get("about:blank")
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def press(browser, *keys):
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    for key in keys:
        ActionChains(browser).send_keys(getattr(Keys, key, key)).perform()


def reach(browser, script, *, back=False):
    """Tabs until the focused element is the one that a script returns."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    for _ in range(60):
        if browser.execute_script(f"return document.activeElement === ({script})"):
            return
        if back:
            ActionChains(browser).key_down(Keys.SHIFT).send_keys(Keys.TAB).key_up(
                Keys.SHIFT
            ).perform()
        else:
            press(browser, "TAB")
    raise AssertionError(f"not reached by the tabulator: {script}")


def choose(browser, box, value):
    """Chooses an option by the arrow keys."""
    reach(browser, f"document.getElementById('{box}')")
    options = browser.execute_script(
        "return [...document.getElementById(arguments[0]).options].map((each) => each.value)", box
    )
    press(browser, "HOME", *["ARROW_DOWN"] * options.index(value))


def test_it_lists_the_newest_first_and_pages(browser, width):
    says(browser, "#count", f"{COUNT + 1} flights")
    dates = browser.execute_script(
        "return [...document.querySelectorAll('#list time')].map((each) => each.dateTime)"
    )
    assert len(dates) >= 99
    assert dates == sorted(dates, reverse=True)
    reach(browser, "document.getElementById('search')")
    assert browser.execute_script("return document.getElementById('before').disabled")
    browser.execute_script("document.getElementById('after').focus()")
    press(browser, "ENTER")
    says(browser, "#place", f"101 to 200 of {COUNT + 1}")
    assert browser.execute_script(f"return {ROWS}") == 100
    assert not [each for each in browser.get_log("browser") if each["level"] == "SEVERE"]


def test_it_sorts_by_keyboard(browser, width):
    if width == "desk":
        reach(browser, "document.querySelector('[data-sort=verdict]')")
        press(browser, "ENTER")
        wait_until(
            browser,
            "return document.querySelector('[data-sort=verdict]').parentNode"
            ".getAttribute('aria-sort') === 'ascending'",
        )
    else:
        choose(browser, "sort", "verdict")
    says(browser, "#list tbody tr", "crashed at 8 m/s")
    other = "[data-sort=verdict]" if width == "desk" else "#reverse"
    reach(browser, f"document.querySelector('{other}')")
    press(browser, "ENTER")
    says(browser, "#list tbody tr", "Nothing was found wrong")


def test_it_searches_and_filters(browser, width):
    reach(browser, "document.getElementById('search')")
    press(browser, *"crash plane")
    wait_until(browser, f"return {ROWS} > 0 && {ROWS} < 100")
    texts = browser.execute_script(
        "return [...document.querySelectorAll('#list tbody tr')].map((row) => row.innerText)"
    )
    assert all("crash" in text and "ArduPlane" in text for text in texts)
    says(browser, "#count", f"{len(texts)} of {COUNT + 1} flights")
    press(browser, *["BACKSPACE"] * len("crash plane"))
    choose(browser, "kind", "vibration")
    says(browser, "#count", f"{VIBRATING} of {COUNT + 1} flights")
    says(browser, "#list tbody tr", "vibrat")


def test_text_of_a_recording_stays_text_and_says_why_there_is_no_review(browser, width):
    choose(browser, "reviewed", "failed")
    wait_until(browser, f"return {ROWS} === 1")
    assert browser.execute_script("return !document.getElementById('pages').checkVisibility()")
    says(browser, "#list tbody", "<b>not</b> a recording")


def test_a_review_opens_by_keyboard_and_can_ask_the_server_for_nothing(browser, width, page):
    reach(browser, "document.querySelector('#list td.name a')")
    press(browser, "ENTER")
    wait_until(browser, "return location.pathname.startsWith('/flights/')")
    assert browser.title.isdecimal()
    assert browser.execute_script("return self.origin") == "null"


def test_uploads_and_deletions_by_keyboard_once_unlocked(browser, width, tmp_path, page):
    assert browser.execute_script("return document.getElementById('drop').hidden")
    reach(browser, "document.getElementById('token')")
    press(browser, *"wrong", "ENTER")
    says(browser, "#trouble", "not the token")
    browser.execute_script("document.getElementById('token').value = ''")
    reach(browser, "document.getElementById('token')")
    press(browser, *TOKEN, "ENTER")
    wait_until(browser, "return !document.getElementById('drop').hidden")
    (tmp_path / f"{width}.ulg").write_bytes(b"ULog\x01\x12\x35\x01" + bytes(2000))
    (tmp_path / f"{width}.txt").write_bytes(b"no log")
    box = browser.find_element("id", "upload")
    box.send_keys(f"{tmp_path}/{width}.txt")
    says(browser, "#uploads", "not a recording")
    box.send_keys(f"{tmp_path}/{width}.ulg")
    says(browser, "#uploads", f"{width}.ulg: uploaded")
    assert browser.execute_script("return !document.getElementById('lock').checkVisibility()")
    assert browser.execute_script(TOO_WIDE) <= 0
    reach(browser, "document.getElementById('search')", back=True)
    press(browser, *f"{width}.ulg")
    wait_until(browser, f"return {ROWS} === 1")
    says(browser, "#list tbody", "waiting")
    reach(browser, "document.querySelector('#list [aria-label^=Delete]')")
    press(browser, "ENTER")
    wait_until(browser, "return document.getElementById('sure').open")
    reach(browser, "document.querySelector('#sure [value=yes]')")
    press(browser, "ENTER")
    says(browser, "#none", "No flight matches")
    browser.execute_script("sessionStorage.clear()")


def test_every_control_has_a_name_and_nothing_is_wider_than_the_page(browser, width):
    nameless = browser.execute_script(
        "return [...document.querySelectorAll('a, button, input, select')].filter((each) => "
        "!(each.getAttribute('aria-label') || each.innerText || each.labels?.length))"
        ".map((each) => each.outerHTML)"
    )
    assert nameless == []
    assert browser.execute_script(TOO_WIDE) <= 0

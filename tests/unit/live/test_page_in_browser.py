"""The page in a real browser: it shows what comes and says what does not; no complaint."""

import math
import re

import pytest
from browsers import headless_browser, says, wait_until
from live_records import (
    HELD,
    UNIX_NS,
    Clock,
    estimate,
    finding,
    flying_state,
    health,
    served,
    status,
)

from h2nav.attitude.samples import Trust
from h2nav.integrity.findings import Severity
from h2nav.live.state import LiveState

pytestmark = pytest.mark.thorough

BALL = "return document.querySelector('#%s .ball').getAttribute('transform')"
PHONE = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
UNITS_PER_DEG = 2.2


@pytest.fixture(scope="module")
def browser():
    with headless_browser() as running:
        yield running


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def page(browser, clock):
    with served(flying_state(clock)) as running:
        opened(browser, running)
        yield running
        browser.get("about:blank")


def opened(browser, page):
    browser.get_log("browser")  # what was before
    browser.get(f"http://127.0.0.1:{page.port}/")
    wait_until(
        browser, "return document.title !== 'h2nav' && !document.title.startsWith('Waiting')"
    )


def text_of(browser, selector):
    return browser.find_element("css selector", selector).text


def horizon(browser, which):
    """Roll and pitch that a horizon shows, deg."""
    moved = browser.execute_script(BALL % which)
    roll, pitch = re.fullmatch(r"rotate\((.*)\) translate\(0 (.*)\)", moved).groups()
    return -float(roll), float(pitch) / UNITS_PER_DEG


def test_it_shows_both_attitudes_as_they_come(browser, page, clock):
    wait_until(browser, BALL % "ours")
    assert horizon(browser, "ours") == pytest.approx((10.4, -5.2))
    assert horizon(browser, "theirs") == pytest.approx((10.0, -5.0))
    assert " ".join(text_of(browser, "#ours .angles").split()) == (
        "roll +10.4° ± 0.3° pitch −5.2° ± 0.3° heading 81.0° ± 1.5°"
    )
    clock.pass_s(0.1)
    page.take("/estimate", estimate(-60.0, 70.0, -90.0))
    says(browser, "#ours .angles", "270.0°")
    assert horizon(browser, "ours") == pytest.approx((-60.0, 70.0))
    assert horizon(browser, "theirs") == pytest.approx((-60.0, 70.0), abs=2.0)  # turned with us
    assert browser.get_log("browser") == []


def test_it_asks_nobody_else(browser, page):
    says(browser, "#word", "Active")
    asked = browser.execute_script(
        "return performance.getEntriesByType('resource').map((entry) => entry.name)"
    )
    assert asked
    assert all(url.startswith(f"http://127.0.0.1:{page.port}/") for url in asked)


def test_it_says_what_is_wrong(browser, page):
    words = "attitude contradicts velocity"
    alarms = {"alarms": f"{words}\ncompass off", "open_findings": finding().id}
    page.take("/status", status(state="degraded", reason=words, **alarms))
    page.take("/finding", finding())
    page.run(page.state.text, UNIX_NS, Severity.WARNING, f"degraded: {words}")
    says(browser, "#sentence", f"cannot be trusted. Cause: {words}.")
    says(browser, "#alarms", "compass off")
    assert words not in text_of(browser, "#alarms")  # said once is enough
    says(browser, "#findings", "differ by 5.0 m/s")
    assert text_of(browser, "#findings .open small") == "now; began 1 s ago"
    says(browser, "#lines", f"degraded: {words}")
    assert browser.title.startswith("Degraded")

    page.take("/finding", finding(phase="end", is_open=False, to_s=52.0))
    page.take("/status", status())
    says(browser, "#word", "Active")
    says(browser, "#findings", "lasted 12 s")
    assert not browser.find_elements("css selector", "#findings .open")


@pytest.mark.parametrize(
    ("state", "word"),
    [("no_link", "No link"), ("no_autopilot", "No autopilot"), ("no_imu", "No samples"),
     ("aligning", "Aligning")],
)  # fmt: skip
def test_every_state_has_its_words(browser, page, state, word):
    page.take("/status", status(state=state, reason="a reason"))
    says(browser, "#word", word)
    assert text_of(browser, "#sentence").endswith("(a reason)")


def test_the_difference_is_judged_by_its_deviation(browser, page):
    says(browser, "#tilt p", "one deviation is 0.6°: within what is expected")
    page.take("/status", status(tilt_deg=2.0, heading_deg=-5.0, heading_verdict="h2nav"))
    says(browser, "#tilt p", "beyond what is expected")
    assert text_of(browser, "#tilt output") == "2.0°"
    says(browser, "#heading p", "within what is expected; GPS supports h2nav")
    wait_until(
        browser, "return document.querySelector('#tilt .curve').getAttribute('d').includes('L')"
    )
    page.take("/status", status(tilt_deg=None, heading_deg=None))
    says(browser, "#tilt p", "no attitude to compare with")


def test_nothing_is_drawn_where_nothing_was_heard(browser, page):
    begun = "return document.querySelector('#tilt .curve').getAttribute('d').split('M').length - 1"
    wait_until(browser, f"{begun} === 1")
    page.close_server()
    says(browser, "#sentence", "not answered for 3 s")
    page.open_server()
    wait_until(browser, f"{begun} === 2")
    band = browser.execute_script("return document.querySelector('#tilt .band').getAttribute('d')")
    assert band.count("Z") == 2


def test_figures_of_samples_recording_and_link(browser, page):
    figures = text_of(browser, "#figures")
    for words in (
        "RAW_IMU 100 Hz, newest 4 ms old", "3 samples (duplicate 3)", "gravity, compass, velocity",
        "1.3 MB", "61.0 MB of memory", "ArduPilot multirotor 1/1, armed",
    ):  # fmt: skip
        assert words in figures
    later_ns = UNIX_NS + 1_000_000_000
    page.take("/health", health(estimates_sent=1050, independent=False), later_ns)
    says(browser, "#figures", "50 per s, 1050 so far")
    says(browser, "#figures", "not independent")
    assert "1 (sent)" in text_of(browser, "#lanes")


def test_what_was_not_told_is_not_shown(browser, page):
    page.take("/status", status(autopilot_q_w=None, force_ratio=math.nan))
    wait_until(browser, "return document.querySelector('#theirs').classList.contains('absent')")
    ratios = text_of(browser, "#ratios").split("\n")
    assert ratios[ratios.index("gravity") + 1] == "–"


def test_a_velocity_that_is_missed_is_told(browser, page, clock):
    says(browser, "#figures", "comes from the GPS receiver")
    clock.pass_s(12.0)
    page.take("/status", status())
    page.take("/estimate", estimate(trust=HELD & ~Trust.VELOCITY_USED))
    says(browser, "#figures", "none for 12 s")
    says(browser, "#figures", "gravity, compass")


def test_a_daemon_that_says_nothing_any_more_is_missed(browser, page, clock):
    clock.pass_s(75.0)
    says(browser, "#word", "Silent")
    says(browser, "#sentence", "h2nav has said nothing for 1 min 15 s; what is shown is old.")
    wait_until(browser, "return document.body.classList.contains('old')")
    wait_until(browser, "return document.querySelector('#ours').classList.contains('absent')")
    page.take("/status", status())
    page.take("/estimate", estimate())
    says(browser, "#word", "Active")
    wait_until(browser, "return !document.querySelector('.old, .absent')")


def test_it_says_that_the_daemon_is_away_and_finds_it_again(browser):
    with served(flying_state()) as page:
        opened(browser, page)
        page.close_server()
        says(browser, "#word", "No connection")
        assert "what is shown is old" in text_of(browser, "#sentence")
        page.open_server()
        page.take("/status", status())
        says(browser, "#word", "Active")
    browser.get("about:blank")


def test_nothing_at_all_is_known_at_first(browser):
    with served(LiveState(Clock())) as page:
        browser.get_log("browser")  # what was before
        browser.get(f"http://127.0.0.1:{page.port}/")
        says(browser, "#figures", "no log")
        says(browser, "#word", "Waiting")
        assert browser.get_log("browser") == []
        browser.get("about:blank")


def test_hostile_texts_run_nothing(browser, page):
    hostile = "<img src=x onerror=\"document.title='run'\"><script>document.title='run'</script>"
    page.take("/finding", finding(text=hostile, evidence=hostile, severity="warning"))
    page.take("/status", status(state="degraded", reason=hostile, vehicle=hostile))
    page.run(page.state.text, UNIX_NS, Severity.INFO, hostile)
    for place in ("#findings", "#sentence", "#lines", "#figures"):
        says(browser, place, hostile)
    assert not browser.find_elements("css selector", "img")
    assert browser.title == "Degraded · h2nav"
    assert browser.get_log("browser") == []


def test_on_a_phone_nothing_is_wider_than_the_screen(browser, page):
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    try:
        browser.refresh()
        says(browser, "#word", "Active")
        assert browser.execute_script("return document.documentElement.scrollWidth") == 390
        places = [
            browser.find_element("css selector", f"#{which} svg").rect
            for which in ("ours", "theirs")
        ]
        assert all(place["width"] > 150 for place in places)
        assert max(place["y"] + place["height"] for place in places) < 844  # seen at once
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})

"""The page in a real browser without a network: no complaint, no request, zoom and findings."""

import json

import pytest
from browsers import headless_browser, wait_until
from made_flight import FINDINGS, MAGNET_S, made_analysis, made_crash, made_flight, page_of
from needs import need_package

from h2nav.integrity.findings import Severity
from h2nav.recordings.context import Said, Span

pytestmark = pytest.mark.thorough

SHOWN = "return [window.review.shown.from, window.review.shown.to]"
AXES = "return window.review.timed.map((plot) => [plot.scales.x.min, plot.scales.x.max])"


@pytest.fixture(scope="module")
def browser():
    with headless_browser() as running:
        yield running


@pytest.fixture(scope="module")
def made():
    flight = made_flight()
    return flight, made_analysis(flight)


def opened(browser, tmp_path, html):
    """Opens a page and waits until all of its pictures are drawn."""
    path = tmp_path / "page.html"
    path.write_text(html, encoding="utf-8")
    for kind in ("browser", "performance"):
        browser.get_log(kind)  # what was before
    browser.get(path.as_uri())
    wait_until(browser, "return document.documentElement.dataset.drawn")
    return path


def axes_follow(browser):
    """Every picture over time shows what is said to be shown."""
    wait_until(
        browser,
        "const {from, to} = window.review.shown;"
        "return window.review.timed.every((plot) => Math.abs(plot.scales.x.min - from) < 1e-6 "
        "&& Math.abs(plot.scales.x.max - to) < 1e-6)",
    )
    return browser.execute_script(SHOWN)


def requests(browser):
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    return [
        event["params"]["request"]["url"]
        for event in events
        if event["method"] == "Network.requestWillBeSent"
    ]


def test_it_opens_without_a_complaint_and_asks_nobody(browser, made, tmp_path):
    path = opened(browser, tmp_path, page_of(*made))
    assert browser.get_log("browser") == []
    assert [url for url in requests(browser) if not url.startswith("data:")] == [path.as_uri()]
    assert len(browser.execute_script(AXES)) > 15


def test_every_picture_has_ink(browser, made, tmp_path):
    opened(browser, tmp_path, page_of(*made))
    empty = browser.execute_script(
        "return [...document.querySelectorAll('.plot.drawn canvas')].filter((canvas) => {"
        "const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;"
        "return !data.some((value) => value !== 0); }).length"
    )
    assert empty == 0


def test_findings_are_seen_at_once(browser, made, tmp_path):
    opened(browser, tmp_path, page_of(*made))
    items = browser.find_elements("css selector", ".finding")
    assert len(items) == len(FINDINGS) + 1
    assert items[0].is_displayed()
    assert items[0].location["y"] < 400
    assert "compass disturbed" in items[0].text


def test_a_click_on_a_finding_shows_its_time_in_all_pictures(browser, made, tmp_path):
    opened(browser, tmp_path, page_of(*made))
    browser.find_element("css selector", ".finding button").click()
    from_s, to_s = axes_follow(browser)
    assert 180.0 < from_s < MAGNET_S[0]
    assert MAGNET_S[1] < to_s < 420.0
    classes = browser.find_element("css selector", ".finding").get_attribute("class")
    assert "shown" in classes.split()
    dimmed = browser.find_elements("css selector", "[data-track].out")
    assert dimmed


def test_zooming_one_picture_zooms_all_of_them(browser, made, tmp_path):
    opened(browser, tmp_path, page_of(*made))
    chains = need_package("selenium.webdriver.common.action_chains").ActionChains
    place = browser.find_element("css selector", "#attitude .u-over")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", place)
    chains(browser).move_to_element_with_offset(place, -200, 0).click_and_hold().move_by_offset(
        200, 0
    ).release().perform()
    wait_until(browser, "return window.review.shown.to < 500")
    from_s, to_s = axes_follow(browser)
    width = place.size["width"]
    assert to_s - from_s == pytest.approx(600.0 * 200.0 / width, rel=0.05)
    assert to_s == pytest.approx(300.0, abs=5.0)

    chains(browser).double_click(place).perform()
    wait_until(browser, "return window.review.shown.to === 600")
    assert axes_follow(browser) == [0, 600]


def test_the_buttons_move_the_axis_of_time(browser, made, tmp_path):
    opened(browser, tmp_path, page_of(*made))
    for move, shown in (
        ("closer", [150, 450]),
        ("on", [300, 600]),
        ("back", [150, 450]),
        ("wider", [0, 600]),
        ("closer", [150, 450]),
        ("whole", [0, 600]),
    ):
        browser.find_element("css selector", f"[data-move={move}]").click()
        assert axes_follow(browser) == shown


def touch(browser, kind, *points):
    told = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
    browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": told})


def test_two_fingers_stretch_the_axis_of_time_and_one_moves_it(browser, made, tmp_path):
    opened(browser, tmp_path, page_of(*made))
    place = browser.find_element("css selector", "#attitude .u-over")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", place)
    box = "const box = arguments[0].getBoundingClientRect();"
    left, top, width = browser.execute_script(box + "return [box.left, box.top, box.width]", place)
    y = top + 50.0

    def at(share):
        return left + share * width, y

    # What was at 0.4 and 0.6 of 600 s comes to 0.2 and 0.8.
    touch(browser, "touchStart", at(0.4), at(0.6))
    for step in (0.05, 0.1, 0.15, 0.2):
        touch(browser, "touchMove", at(0.4 - step), at(0.6 + step))
    wait_until(browser, "return window.review.shown.to < 410")
    touch(browser, "touchEnd")
    assert axes_follow(browser) == pytest.approx([200.0, 400.0], abs=2.0)

    touch(browser, "touchStart", at(0.25))
    for share in (0.4, 0.6, 0.75):
        touch(browser, "touchMove", at(share))
    wait_until(browser, "return window.review.shown.to < 310")
    touch(browser, "touchEnd")
    assert axes_follow(browser) == pytest.approx([100.0, 300.0], abs=2.0)


def test_parameters_are_found_by_the_words_of_a_search(browser, made, tmp_path):
    flight, analysis = made
    own = {"COMPASS_OFS_X": 12.5, "COMPASS_USE": 1.0, "WPNAV_SPEED": 500.0, "INS_OFS2_X": 0.1}
    context = flight.context._replace(parameters=own)
    opened(browser, tmp_path, page_of(flight._replace(context=context), analysis))
    folded = browser.find_element("css selector", "#parameters details")
    search = folded.find_element("css selector", "input")
    assert not search.is_displayed()
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", folded)
    folded.find_element("css selector", "summary").click()

    def shown(words):
        search.clear()
        search.send_keys(words)
        return [
            row.text.split()[0]
            for row in folded.find_elements("css selector", "tbody tr")
            if row.is_displayed()
        ]

    assert shown("compass ofs") == ["COMPASS_OFS_X"]
    assert shown("OFS") == ["COMPASS_OFS_X", "INS_OFS2_X"]
    assert shown("nothing of the kind") == []
    assert len(shown(" ")) == len(own)


def test_pointing_tells_values_in_every_picture(browser, made, tmp_path):
    opened(browser, tmp_path, page_of(*made))
    chains = need_package("selenium.webdriver.common.action_chains").ActionChains
    place = browser.find_element("css selector", "#attitude .u-over")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", place)
    chains(browser).move_to_element(place).perform()
    wait_until(
        browser,
        "return [...document.querySelectorAll('#difference .u-legend .u-value')]"
        ".some((cell) => / deg$/.test(cell.textContent))",
    )
    told = browser.find_element("css selector", "#timeline .u-legend").get_attribute("textContent")
    assert "AUTO" in told


def test_a_click_in_the_legend_hides_a_line(browser, made, tmp_path):
    opened(browser, tmp_path, page_of(*made))
    label = browser.find_elements("css selector", "#attitude .u-legend .u-series th")[1]
    browser.execute_script("arguments[0].click()", label)
    wait_until(browser, "return window.review.timed.some((plot) => plot.series[1].show === false)")


def test_the_picture_of_a_crash_keeps_its_seconds(browser, tmp_path):
    opened(browser, tmp_path, page_of(*made_crash()))
    assert browser.get_log("browser") == []
    lanes = browser.find_elements("css selector", "#event .stack .plot.drawn canvas")
    assert len(lanes) == 8
    chart = browser.find_element("css selector", "#event")
    assert chart.location["y"] < 600, "below the verdict, on the first screen"
    timed = browser.execute_script(AXES)
    browser.find_element("css selector", "[data-move=closer]").click()
    axes_follow(browser)
    assert len(browser.execute_script(AXES)) == len(timed)
    # A legend names its lines, and has values only where something is pointed at.
    legend = browser.find_element("css selector", "#event .u-legend")
    assert "–" not in legend.text
    assert "demand" in legend.text


def test_the_track_is_coloured_by_time_or_by_flight_mode(browser, tmp_path):
    opened(browser, tmp_path, page_of(*made_crash()))
    part = "getComputedStyle(document.querySelector('polyline[data-mode]')).stroke"
    by_time = browser.execute_script(f"return {part}")
    choice = browser.find_element("css selector", "[data-colours][value=mode]")
    browser.execute_script("arguments[0].click()", choice)
    assert browser.execute_script(f"return {part}") != by_time
    assert browser.find_element("css selector", "[data-key=mode]").is_displayed()
    choice = browser.find_element("css selector", "[data-colours][value=time]")
    browser.execute_script("arguments[0].click()", choice)
    assert browser.execute_script(f"return {part}") == by_time


def test_hostile_texts_run_nothing(browser, made, tmp_path):
    hostile = "<img src=x onerror=\"document.title='run'\"><script>document.title='run'</script>"
    flight, analysis = made
    context = flight.context._replace(
        modes=(Span(0.0, 600.0, hostile),),
        attitudes=tuple(track._replace(name=hostile) for track in flight.context.attitudes),
        said=(Said(3.0, Severity.INFO, hostile),),
    )
    finding = FINDINGS[0]._replace(text=hostile, evidence=hostile)
    opened(
        browser,
        tmp_path,
        page_of(flight._replace(context=context, findings=(finding,), name=hostile), analysis),
    )
    assert browser.title.startswith("Flight review: <img")
    assert browser.get_log("browser") == []
    assert not browser.find_elements("css selector", "img")
    assert hostile in browser.find_element("css selector", ".finding").text
    label = browser.find_elements("css selector", "#attitude .u-legend .u-label")[1]
    assert label.get_attribute("textContent") == hostile


@pytest.mark.parametrize("crashed", [False, True])
def test_on_a_phone_nothing_is_wider_than_the_screen(browser, made, tmp_path, crashed):
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True},
    )
    try:
        opened(browser, tmp_path, page_of(*(made_crash() if crashed else made)))
        assert browser.execute_script("return document.documentElement.scrollWidth") == 390
        wider = (
            "return [...document.querySelectorAll('#sure .wide')]"
            ".filter((box) => box.scrollWidth > box.clientWidth).length"
        )
        assert browser.execute_script(wider) == 0, "a column of a table is cut"
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_a_dark_page_is_drawn_in_dark_colours_and_printed_in_light_ones(browser, made, tmp_path):
    corner = (
        "const canvas = document.querySelector('#attitude canvas');"
        "const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;"
        "const sums = []; for (let k = 0; k < data.length; k += 4) if (data[k + 3] === 255)"
        " sums.push(data[k] + data[k + 1] + data[k + 2]);"
        "return sums.sort((a, b) => a - b)[sums.length >> 1];"
    )
    scheme = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", scheme)
    try:
        opened(browser, tmp_path, page_of(*made))
        assert browser.get_log("browser") == []
        paper = "return getComputedStyle(document.body).backgroundColor"
        assert browser.execute_script(paper) == "rgb(20, 23, 28)"
        track = "return getComputedStyle(document.querySelector('[data-track]')).stroke"
        dark, late = browser.execute_script(corner), browser.execute_script(track)
        assert dark < 300
        browser.execute_script("window.dispatchEvent(new Event('beforeprint'))")
        wait_until(browser, f"{corner.replace('return', 'return 450 <')}")
        assert browser.execute_script(track) != late
        browser.execute_script("window.dispatchEvent(new Event('afterprint'))")
        wait_until(browser, f"{corner.replace('return', 'return 300 >')}")
        assert browser.execute_script(track) == late
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_a_line_is_hidden_and_the_time_moved_by_the_keyboard_alone(browser, made, tmp_path):
    keys = need_package("selenium.webdriver.common.keys").Keys
    opened(browser, tmp_path, page_of(*made))
    browser.find_element("css selector", "body").send_keys(keys.TAB)
    assert browser.switch_to.active_element.get_attribute("class") == "skip"
    name = browser.find_elements("css selector", "#attitude .u-legend th[role=button]")[1]
    assert name.get_attribute("aria-pressed") == "true"
    name.send_keys(keys.ENTER)
    wait_until(browser, "return window.review.timed.some((plot) => plot.series[2].show === false)")
    assert name.get_attribute("aria-pressed") == "false"
    browser.find_element("css selector", "[data-move=closer]").send_keys(keys.SPACE)
    assert axes_follow(browser) == [150, 450]


def test_it_prints_with_its_pictures_on_the_paper(browser, made, tmp_path):
    opened(browser, tmp_path, page_of(*made))
    printed = browser.execute_cdp_cmd("Page.printToPDF", {})["data"]
    assert len(printed) > 100_000
    widths = browser.execute_script("return window.review.timed.map((plot) => plot.width)")
    assert min(widths) > 700  # afterwards as before

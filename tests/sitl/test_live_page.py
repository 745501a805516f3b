"""The page of a running daemon in a real browser, while somebody breaks the simulated vehicle."""

import re
import subprocess
import time
import urllib.request

import pytest
from browsers import headless_browser, says, wait_until
from daemon_process import H2NAV, WAIT_S, daemon, free_udp_port

CONFIG = """
link: {{url: "udpin:127.0.0.1:{port}"}}
live: {{address: "127.0.0.1:0", foxglove_port: 0}}
log: {{folder: "{folder}"}}
"""
# Slow, so that what the page shows late is not far from what is.
SCENARIO = "case1"
ANGLES = """
const degrees = (which) => [...document.querySelectorAll(`#${which} .angles dd`)].map(
  (cell) => Number(cell.firstChild.textContent.replace("−", "-").replace("°", "")));
return [degrees("ours"), degrees("theirs")];
"""


@pytest.fixture(scope="module")
def browser():
    with headless_browser() as running:
        yield running


@pytest.fixture
def flying(tmp_path):
    """A daemon that has shown where its page is, and a vehicle that takes orders."""
    port = free_udp_port()
    config = tmp_path / "live.yaml"
    config.write_text(CONFIG.format(port=port, folder=tmp_path / "logs"))
    vehicle = [*H2NAV, "fake-autopilot", "--connect", f"udpout:127.0.0.1:{port}"]
    with (
        daemon("-c", str(config)) as running,
        subprocess.Popen(
            [*vehicle, "--scenario", SCENARIO],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        ) as autopilot,
    ):
        try:
            yield running, autopilot, page_url(running)
        finally:
            autopilot.terminate()


def page_url(running):
    told = running.wait_for(lambda event: "live view at" in event.get("text", ""))
    return re.search(r"http://\S+/", told["text"])[0]


def order(autopilot, line):
    autopilot.stdin.write(f"{line}\n".encode())
    autopilot.stdin.flush()


@pytest.mark.thorough
def test_it_follows_the_vehicle_and_says_what_goes_wrong(browser, flying):
    running, autopilot, url = flying
    browser.get_log("browser")  # what was before
    browser.get(url)
    says(browser, "#word", "Active")
    wait_until(browser, f"{ANGLES.replace('return', 'const [ours, theirs] =')} "
               "return Math.abs(ours[0]) > 10 && !document.querySelector('.absent')")  # fmt: skip
    ours, theirs = browser.execute_script(ANGLES)
    assert ours[:2] == pytest.approx(theirs[:2], abs=8.0)

    order(autopilot, "gps-step on")
    running.wait_for(lambda event: "attitude contradicts velocity" in event.get("text", ""))
    says(browser, "#sentence", "Cause: attitude contradicts velocity.")
    says(browser, "#findings", "GPS: attitude contradicts velocity")
    says(browser, "#lines", "degraded: attitude contradicts velocity")
    order(autopilot, "clear")
    says(browser, "#word", "Active")

    order(autopilot, "gps-lost on")
    says(browser, "#alarms", "no GPS velocity")
    says(browser, "#lines", "no GPS velocity")
    assert browser.get_log("browser") == []


@pytest.mark.thorough
def test_the_page_says_that_the_daemon_has_ended(browser, flying):
    running, _, url = flying
    browser.get(url)
    says(browser, "#word", "Active")
    assert b"h2nav_samples_used_total" in urllib.request.urlopen(f"{url}metrics").read()
    assert running.stop() == 0
    says(browser, "#word", "No connection")


@pytest.mark.thorough
def test_the_demo_opens_its_page(tmp_path):
    opened = tmp_path / "opened"
    program = tmp_path / "browser"
    program.write_text(f'#!/bin/sh\necho "$1" > {opened}.part\nmv {opened}.part {opened}\n')
    program.chmod(0o755)
    words = ["demo", "--live", "127.0.0.1:0", "--open", "--log-dir", str(tmp_path / "logs")]
    with subprocess.Popen(
        ["env", f"BROWSER={program} %s", *H2NAV, *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            told = next(line for line in process.stderr if "live view at" in line)
            url = re.search(r"http://\S+/", told)[0]
            assert b"<title>h2nav</title>" in urllib.request.urlopen(url, timeout=WAIT_S).read()
            end = time.monotonic() + WAIT_S
            while not opened.exists():
                assert time.monotonic() < end
                time.sleep(0.02)
        finally:
            process.terminate()
            process.communicate(timeout=WAIT_S)
    assert opened.read_text().strip() == url


@pytest.mark.thorough
def test_there_is_no_page_to_open_without_live():
    done = subprocess.run([*H2NAV, "demo", "--open"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("h2nav: --open: without --live there is no page")

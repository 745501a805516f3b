"""Takes the documents' pictures of the live page, and how late it shows what the daemon says.

The daemon and the fake autopilot run as processes; the receiver's velocity is broken. A delay is
that between the time in the daemon's event and the words in the browser.

Run: python tools/live_pictures.py DIR [--faults N]   (needs chromium and its driver)
"""

import argparse
import base64
import io
import json
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.ui import WebDriverWait

H2NAV = [sys.executable, "-m", "h2nav"]
DESKTOP = {"width": 1120, "height": 1130, "deviceScaleFactor": 1, "mobile": False}
PHONE = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
COLOURS = 96  # the page has few; the files are a third of their size
FLOWN_S = 30.0
SETTLED_S = 10.0
PATIENCE_S = 60.0
WORDS = "attitude contradicts velocity"
CONFIG = """
link: {{url: "udpin:127.0.0.1:{port}"}}
live: {{address: "127.0.0.1:0", foxglove_port: 0}}
log: {{folder: "{folder}"}}
"""
WATCH = """
window.shownAt = null;
new MutationObserver(() => {
  if (window.shownAt === null && document.querySelector("#sentence").textContent.includes("%s"))
    window.shownAt = Date.now();
}).observe(document.querySelector("#state"), {subtree: true, childList: true, characterData: true});
"""


def browser() -> webdriver.Chrome:
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--hide-scrollbars"):
        options.add_argument(argument)
    return webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))


def save(view: webdriver.Chrome, metrics: dict[str, Any], path: Path) -> None:
    view.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    time.sleep(1.0)
    shot = view.execute_cdp_cmd("Page.captureScreenshot", {"format": "png"})["data"]
    picture = Image.open(io.BytesIO(base64.b64decode(shot))).convert("RGB")
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


def until(view: webdriver.Chrome, script: str) -> Any:
    return WebDriverWait(view, PATIENCE_S, 0.02).until(lambda _: view.execute_script(script))


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Bench:
    """A daemon whose page is known, and a vehicle that takes orders."""

    def __init__(self, daemon: "subprocess.Popen[str]", vehicle: "subprocess.Popen[str]") -> None:
        self._daemon = daemon
        self._vehicle = vehicle
        self.page = re.findall(r"http://\S+/", self.wait_for("live view at")["text"])[0]

    def wait_for(self, words: str) -> dict[str, Any]:
        """The next event with these words."""
        assert self._daemon.stdout is not None
        for line in self._daemon.stdout:
            event = json.loads(line)
            if words in event.get("text", ""):
                return event
        raise SystemExit("the daemon has ended")

    def order(self, line: str) -> None:
        """Tells the vehicle something."""
        assert self._vehicle.stdin is not None
        self._vehicle.stdin.write(f"{line}\n")
        self._vehicle.stdin.flush()


@contextmanager
def bench(folder: str) -> Iterator[Bench]:
    port = free_port()
    config = Path(folder) / "live.yaml"
    config.write_text(CONFIG.format(port=port, folder=folder))
    pipes = {"stderr": subprocess.DEVNULL, "text": True}
    daemon = subprocess.Popen(
        [*H2NAV, "run", "--json", "-c", str(config)], stdout=subprocess.PIPE, **pipes
    )
    vehicle = subprocess.Popen(
        [*H2NAV, "fake-autopilot", "--connect", f"udpout:127.0.0.1:{port}", "--imus", "2"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        **pipes,
    )
    try:
        yield Bench(daemon, vehicle)
    finally:
        for process in (vehicle, daemon):
            process.terminate()
            process.wait()


def opened(view: webdriver.Chrome, running: Bench) -> None:
    """The page of a daemon that has found an attitude."""
    view.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", DESKTOP)
    view.get(running.page)
    view.execute_script(WATCH % WORDS)
    until(view, "return document.querySelector('#word').textContent === 'Active'")


def delay_s(view: webdriver.Chrome, running: Bench) -> float:
    """Breaks the velocity; how long the page takes to say what the daemon has said."""
    running.order("gps-step on")
    said_s = running.wait_for(WORDS)["unix_s"]
    shown_s = until(view, "return window.shownAt") / 1000.0
    return float(shown_s - said_s)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--faults", type=int, default=5)
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    delays_s = []
    view = browser()
    try:
        for number in range(args.faults):
            with tempfile.TemporaryDirectory() as folder, bench(folder) as running:
                opened(view, running)
                time.sleep(FLOWN_S if number == 0 else SETTLED_S)
                if number == 0:
                    save(view, DESKTOP, args.folder / "live.png")
                delays_s.append(delay_s(view, running))
                if number == 0:
                    save(view, PHONE, args.folder / "live_phone.png")
    finally:
        view.quit()
    print(f"words on the page after the daemon's notice, {len(delays_s)} faults: ", end="")
    print(f"median {np.median(delays_s):.2f}, longest {max(delays_s):.2f} s")


if __name__ == "__main__":
    main()

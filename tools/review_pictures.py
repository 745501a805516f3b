"""Takes the documents' pictures of a review: the top of a page, on a phone too, and one finding.

Run: python tools/review_pictures.py DIR   (needs chromium and its driver)

The flights are made, not flown: `made_crash` and `made_flight` of the tests.
"""

import argparse
import base64
import io
import shutil
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

REPOSITORY = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(REPOSITORY / "tests"))

from made_flight import made_analysis, made_crash, made_flight, page_of  # noqa: E402

DESK, TALL, PHONE = (1280, 1000), (1280, 1480), (390, 844)
COLOURS = 64  # a page has few; the files are a third of their size


def browser() -> webdriver.Chrome:
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--hide-scrollbars"):
        options.add_argument(argument)
    return webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))


def opened(view: webdriver.Chrome, page: Path, size: tuple[int, int]) -> None:
    width, height = size
    view.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": size == PHONE},
    )
    view.get(page.as_uri())
    while not view.execute_script("return document.documentElement.dataset.drawn"):
        time.sleep(0.05)


def save(view: webdriver.Chrome, path: Path) -> None:
    shot = view.execute_cdp_cmd("Page.captureScreenshot", {"format": "png"})["data"]
    picture = Image.open(io.BytesIO(base64.b64decode(shot))).convert("RGB")
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


def taken(view: webdriver.Chrome, pages: Path, folder: Path) -> None:
    crash, flight = pages / "crash.html", pages / "flight.html"
    crash.write_text(page_of(*made_crash()), encoding="utf-8")
    made = made_flight()
    flight.write_text(page_of(made, made_analysis(made)), encoding="utf-8")
    opened(view, crash, TALL)  # with the card and the first lanes of the picture
    save(view, folder / "review.png")
    opened(view, crash, PHONE)
    save(view, folder / "review_phone.png")
    # The first finding; then its pictures without the movement to them.
    opened(view, flight, DESK)
    view.execute_script(
        "document.documentElement.style.scrollBehavior = 'auto';"
        "document.querySelector('.finding button').click();"
    )
    time.sleep(2.0)
    save(view, folder / "review_finding.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    args = parser.parse_args()
    view = browser()
    try:
        with tempfile.TemporaryDirectory() as pages:
            taken(view, Path(pages), args.folder)
    finally:
        view.quit()


if __name__ == "__main__":
    main()

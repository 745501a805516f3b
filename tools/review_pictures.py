"""Takes the documents' pictures of a review: the top of a page, and one finding looked at closely.

Run: python tools/review_pictures.py REVIEW.html DIR   (needs chromium and its driver)
"""

import argparse
import base64
import io
import shutil
import time
from pathlib import Path

from PIL import Image
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

WIDTH, HEIGHT = 1280, 1000
COLOURS = 64  # a page has few; the files are a third of their size


def browser() -> webdriver.Chrome:
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--hide-scrollbars"):
        options.add_argument(argument)
    options.add_argument(f"--window-size={WIDTH},{HEIGHT}")
    return webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))


def save(view: webdriver.Chrome, path: Path) -> None:
    shot = view.execute_cdp_cmd("Page.captureScreenshot", {"format": "png"})["data"]
    picture = Image.open(io.BytesIO(base64.b64decode(shot))).convert("RGB")
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", type=Path)
    parser.add_argument("folder", type=Path)
    wished = parser.parse_args()
    view = browser()
    try:
        view.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False},
        )
        view.get(wished.page.resolve().as_uri())
        while not view.execute_script("return document.documentElement.dataset.drawn"):
            time.sleep(0.05)
        save(view, wished.folder / "review.png")
        # The first finding; then its pictures without the movement to them.
        view.execute_script(
            "document.documentElement.style.scrollBehavior = 'auto';"
            "document.querySelector('.finding button').click();"
        )
        time.sleep(2.0)
        save(view, wished.folder / "review_finding.png")
    finally:
        view.quit()


if __name__ == "__main__":
    main()

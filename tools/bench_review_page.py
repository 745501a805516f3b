"""Measures how large a review's page is and how fast it opens, next to other picture libraries.

``python tools/bench_review_page.py`` opens the page of 30 minutes with three IMUs at 400 Hz in
headless chromium. ``--plotly FILE.js`` (each of plotly's bundles) and ``--bokeh`` (the package)
draw 60 traces of 8000 points in 15 pictures with these libraries, and with ours beside them. The
figures of docs/design/004-pictures.md come from here.
"""

import argparse
import base64
import json
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

REPOSITORY = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(REPOSITORY / "tests"))

from made_flight import made_analysis, made_flight, page_of  # noqa: E402

from h2nav.reviews.html import asset  # noqa: E402

PICTURES, TRACES, POINTS, END_S = 15, 4, 8000, 1800.0
OPENINGS = 3
COLOURS = ["#0072b2", "#d55e00", "#009e73", "#000000"]
# Two frames later everything that was asked for has been painted.
DRAWN = "requestAnimationFrame(() => requestAnimationFrame(() => { window.opened = 1; }));"


def text_of(values: np.ndarray) -> str:
    return base64.b64encode(values.tobytes()).decode()


def series() -> tuple[np.ndarray, list[list[np.ndarray]]]:
    rng = np.random.default_rng(1)
    t_s = np.linspace(0.0, END_S, POINTS, dtype=np.float32)
    return t_s, [
        [np.cumsum(rng.normal(size=POINTS)).astype(np.float32) for _ in range(TRACES)]
        for _ in range(PICTURES)
    ]


def html(head: str, body: str) -> str:
    return f'<!doctype html><meta charset="utf-8">{head}<body>{body}'


def of_uplot() -> str:
    t_s, pictures = series()
    data = json.dumps([[text_of(t_s), *map(text_of, traces)] for traces in pictures])
    run = f"""const decoded = (s) =>
      new Float32Array(Uint8Array.from(atob(s), (c) => c.charCodeAt(0)).buffer);
    const colours = {json.dumps(COLOURS)};
    for (const traces of {data})
      new uPlot({{width: 1360, height: 260, scales: {{x: {{time: false}}}}, series: [{{}},
        ...colours.map((stroke, k) => ({{stroke, label: "trace " + k}}))]}},
        traces.map(decoded), document.body);
    {DRAWN}"""
    head = f"<style>{asset('uplot.css')}</style><script>{asset('uplot.js')}</script>"
    return html(head, f"<script>{run}</script>")


def of_bokeh() -> str:
    from bokeh.embed import components
    from bokeh.models import ColumnDataSource, HoverTool, Range1d
    from bokeh.plotting import figure
    from bokeh.resources import Resources

    t_s, pictures = series()
    shared = Range1d(0.0, END_S)
    figures = []
    for traces in pictures:
        source = ColumnDataSource({"t": t_s, **{f"y{k}": y for k, y in enumerate(traces)}})
        drawn = figure(height=260, sizing_mode="stretch_width", x_range=shared)
        for k, colour in enumerate(COLOURS):
            drawn.line("t", f"y{k}", source=source, legend_label=f"trace {k}", color=colour)
        drawn.add_tools(HoverTool(mode="vline"))
        figures.append(drawn)
    script, places = components(figures)
    waits = f"""<script>(function wait() {{ const made = window.Bokeh && Bokeh.documents[0];
      if (made && made.is_idle) {{ {DRAWN} }} else setTimeout(wait, 5); }})();</script>"""
    code = "".join(
        f"<script>{js}</script>" for js in Resources(mode="inline", components=["bokeh"]).js_raw
    )
    return html(code, "".join(places) + script + waits)


def of_plotly(bundle: Path) -> str:
    t_s, pictures = series()
    traces = [
        [
            {
                "x": {"dtype": "f4", "bdata": text_of(t_s)},
                "y": {"dtype": "f4", "bdata": text_of(y)},
                "mode": "lines",
                "name": f"trace {k}",
            }
            for k, y in enumerate(picture)
        ]
        for picture in pictures
    ]
    places = "".join(f'<div id="p{k}" style="height: 260px"></div>' for k in range(PICTURES))
    run = f"""Promise.all({json.dumps(traces)}.map((traces, k) => Plotly.newPlot("p" + k, traces)))
      .then(() => {{ {DRAWN} }});"""
    code = bundle.read_text(encoding="utf-8")
    return html(f"<script>{code}</script>", f"{places}<script>{run}</script>")


def of_review() -> str:
    flight = made_flight(END_S, 400.0, imus=3)
    return page_of(flight, made_analysis(flight))


def opened(path: Path, drawn: str) -> tuple[float, float, float]:
    """Seconds until text is seen, until all is drawn, and of the main thread's work."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--window-size=1400,1000"):
        options.add_argument(argument)
    browser = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    try:
        browser.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})
        begun = time.monotonic()
        browser.get(path.as_uri())
        while not browser.execute_script(f"return {drawn}"):
            time.sleep(0.01)
        took = time.monotonic() - begun
        seen = browser.execute_script(
            "return performance.getEntriesByName('first-contentful-paint')[0]?.startTime"
        )
        found: dict[str, Any] = browser.execute_cdp_cmd("Performance.getMetrics", {})
        work = {one["name"]: one["value"] for one in found["metrics"]}["TaskDuration"]
        return (took if seen is None else seen * 1e-3), took, work
    finally:
        browser.quit()


def row(name: str, make: Callable[[], str], drawn: str, folder: Path) -> str:
    path = folder / f"{name}.html"
    path.write_text(make(), encoding="utf-8")
    runs = [opened(path, drawn) for _ in range(OPENINGS)]
    seen, took, work = (statistics.median(column) for column in zip(*runs, strict=True))
    size = path.stat().st_size / 1e6
    return f"| {name} | {size:.1f} MB | {seen:.2f} s | {took:.1f} s | {work:.2f} s |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plotly", type=Path, action="append", default=[], metavar="FILE.js")
    parser.add_argument("--bokeh", action="store_true")
    args = parser.parse_args()
    makers: dict[str, Callable[[], str]] = {}
    if args.bokeh or args.plotly:
        makers["uPlot"] = of_uplot
    if args.bokeh:
        makers["Bokeh"] = of_bokeh
    for bundle in args.plotly:
        makers[bundle.stem] = lambda bundle=bundle: of_plotly(bundle)
    print("| | file | text is seen after | all is drawn after | work of the main thread |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        for what, make in makers.items():
            print(row(what, make, "window.opened", Path(name)), flush=True)
        drawn = "document.documentElement.dataset.drawn"
        print(row("the review's page", of_review, drawn, Path(name)))


if __name__ == "__main__":
    main()

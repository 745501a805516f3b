"""The page that lists the flights."""

import re

from h2nav.fleet.index import MAX_LISTED, page
from h2nav.fleet.tables import FLIGHT_COLUMNS, TableRow


def row(
    source: str, severity: str = "", count: int = 0, error: str = "", **more: object
) -> TableRow:
    values = dict.fromkeys(FLIGHT_COLUMNS)
    values |= {"source": source, "worst_severity": severity, "finding_count": count}
    values |= {"error": error, "review": "" if error else f"reviews/{source[-4:]}.html", **more}
    return TableRow(values, ("IMU 1: <i>magnet</i>",) * count)


def order(text: str) -> list[str]:
    return re.findall(r"<td class=\"path\">(?:<a [^>]*>)?([^<]+)", text)[::2]


def test_verdict_crash_and_the_folder_that_tells_names_apart() -> None:
    text = page(
        [row("/f/2024/1.BIN", "critical", 1, verdict="Crashed at 149 s.", crash_s=149.2),
         row("/f/2025/1.BIN", verdict="Nothing was found wrong.")]
    )  # fmt: skip
    assert '<span class="below">2024/</span>1.BIN' in text
    assert '<span class="below">2025/</span>1.BIN' in text
    assert "Crashed at 149 s.<details>" in text
    assert text.count("at 149 s</td>") == 1
    assert "<h1>1 flight</h1>" in page([row("/f/a")])


def test_the_worst_come_first_and_the_broken_last() -> None:
    text = page(
        [row("/f/good"), row("/f/info", "info", 1), row("/f/fail", error="no recording"),
         row("/f/few_", "error", 1), row("/f/many", "error", 6)]
    )  # fmt: skip
    assert order(text) == ["many", "few_", "info", "good", "fail"]
    assert "<b>2</b> error, <b>1</b> info, <b>1</b> nothing found, <b>1</b> not reviewed" in text
    assert "and 2 more" in text
    assert "no recording" in text


def test_what_comes_from_files_is_text() -> None:
    evil = '"><script>alert(1)</script>'
    rows = [row(f"/f/{evil}", "error", 1, vehicle=evil, firmware=evil, kind=evil),
            row("/f/x", error=evil)]  # fmt: skip
    rows[0].values["review"] = "reviews/a b%.html"
    text = page(rows)
    assert text.count("<script>") == 1  # our own
    assert "<i>magnet" not in text
    assert 'href="reviews/a%20b%25.html"' in text
    assert not re.search(r"(src|href)=\"(https?:)?//", text)


def test_no_number_breaks_the_page() -> None:
    text = page([row("/f/a", duration_s=float("nan"), largest_tilt_deg=float("inf"))])
    assert "nan" not in text.lower().partition("<tbody>")[2].partition("</tbody>")[0]


def test_a_page_has_an_end() -> None:
    text = page([row(f"/f/{number:05}") for number in range(MAX_LISTED + 5)])
    assert text.count("<tr class=") == MAX_LISTED
    assert f"<h1>{MAX_LISTED + 5} flights</h1>" in text
    assert "flights.parquet has all" in text

"""The page that lists the flights."""

import re
from datetime import UTC, datetime
from pathlib import Path

import pytest

from h2nav.fleet.index import MAX_LISTED, page, write_index
from h2nav.fleet.store import Store
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


def cells(text: str) -> list[list[tuple[str, str, str]]]:
    """Of each row its cells: key, look and content."""
    rows = text.partition("<tbody>")[2].partition("</tbody>")[0].strip().split("\n")
    cell = r'<td(?: data-key="([^"]*)")?(?: class="([^"]*)")?>(.*?)</td>'
    return [re.findall(cell, each) for each in rows]


def test_every_figure_of_a_flight_has_its_place() -> None:
    start = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
    full = row(
        "/f/a/1.BIN", "warning", 5, verdict="Shaken.", crash_s=149.6, start=start, duration_s=90.0,
        vehicle="copter", firmware="4.5", kind="dataflash", largest_tilt_deg=1.25,
        largest_heading_deg=12.34, active_share=0.876,
    )  # fmt: skip
    found = cells(page([full, row("/f/b/2.BIN", no_estimate="too few samples")]))
    told = "<br>".join(["IMU 1: &lt;i&gt;magnet&lt;/i&gt;"] * 4)
    assert found[0] == [
        ("2.0", "", "warning"),
        ("", "path", '<a href="reviews/.BIN.html"><span class="below">a/</span>1.BIN</a>'),
        ("149.6", "crash", "at 150 s"),
        ("", "told", f"Shaken.<details><summary>findings</summary>{told}<br>and 1 more</details>"),
        (repr(start.timestamp()), "", "2026-01-02 03:04"),
        ("90.0", "number", "1.5"),
        ("", "", "copter"),
        ("", "", "4.5"),
        ("", "", "dataflash"),
        ("5.0", "number", "5"),
        ("1.25", "number", "1.2"),
        ("12.34", "number", "12.3"),
        ("0.876", "number", "88"),
        ("", "path", "/f/a"),
    ]
    unknown = ("-1e+300", "number", "")
    assert found[1] == [
        ("5.0", "", "nothing found"),
        ("", "path", '<a href="reviews/.BIN.html"><span class="below">b/</span>2.BIN</a>'),
        ("-1.0", "", ""),
        ("", "told", "too few samples"),
        ("0.0", "", ""),
        unknown,
        *[("", "", "")] * 3,
        ("0.0", "number", "0"),
        *[unknown] * 3,
        ("", "path", "/f/b"),
    ]


@pytest.mark.parametrize(
    ("severity", "error", "key"),
    [("critical", "", 0.0), ("error", "", 1.0), ("info", "", 4.0), ("", "", 5.0),
     ("", "broken", 105.0)],
)  # fmt: skip
def test_rows_are_sorted_by_their_worst_finding(severity: str, error: str, key: float) -> None:
    assert cells(page([row("/f/1", severity, 0, error)]))[0][0][0] == repr(key)


@pytest.mark.parametrize(("error", "look"), [("", "good"), ("broken", "failed")])
def test_a_row_without_a_finding_is_good_unless_it_was_not_reviewed(error: str, look: str) -> None:
    assert f'<tr class="{look}">' in page([row("/f/1", error=error)])


@pytest.mark.parametrize(("count", "is_said"), [(4, False), (5, True)])
def test_of_more_than_four_findings_the_rest_are_counted(count: int, is_said: bool) -> None:
    assert ("and 1 more" in page([row("/f/1", "error", count)])) is is_said


IN_ARCHIVE = ["zip://d/1::file:///x.zip", "zip://e/2::file:///x.zip"]


@pytest.mark.parametrize(
    ("sources", "below", "folders"),
    [
        (["/f/a/1", "/f/a/2"], ["", ""], ["/f/a", "/f/a"]),
        (["/f/a/1", "/f/ab/2"], ["a/", "ab/"], ["/f/a", "/f/ab"]),
        (["/f/1", "/f/a/2"], ["", "a/"], ["/f", "/f/a"]),
        (IN_ARCHIVE, ["d/", "e/"], ["zip://d", "zip://e"]),
    ],
)
def test_a_name_is_told_with_the_folders_below_the_common_one(
    sources: list[str], below: list[str], folders: list[str]
) -> None:
    found = cells(page([row(source) for source in sources]))
    shown = [re.search(r'<span class="below">([^<]*)</span>', each[1][2]) for each in found]
    assert ["" if each is None else each[1] for each in shown] == below
    assert [each[-1][2] for each in found] == folders


def test_the_page_goes_into_the_store(tmp_path: Path) -> None:
    rows = [row("/f/ä")]
    write_index(rows, Store(str(tmp_path)))
    assert (tmp_path / "index.html").read_text(encoding="utf-8") == page(rows)


def test_what_is_listed_whole_says_nothing_of_more() -> None:
    text = page([row("/f/1"), row("/f/2")])
    assert "worst flights are listed" not in text
    assert "<h1>2 flights</h1>" in text

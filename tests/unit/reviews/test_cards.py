"""Findings as cards: which are shown, which are folded, and under what."""

import re

import pytest

from h2nav.integrity.findings import Kind
from h2nav.reviews.cards import cards, counted, is_wrong


def entry(name, severity="warning", kind=Kind.GPS_LOST, cause=None, from_s=1.0, to_s=None, **more):
    """In the form of the document."""
    return {
        "id": name, "kind": kind, "sensor": {"kind": "gps"}, "severity": severity,
        "from_s": from_s, "to_s": from_s if to_s is None else to_s, "size": 0.0, "unit": "",
        "source": "GPS", "text": name, "evidence": "", "means": "", "check": "",
        "consequence_of": cause, **more,
    }  # fmt: skip


def lines(html: str) -> list[str]:
    """The words of the cards and of the titles of what is folded, with an indent for each level."""
    found, level = [], 0
    for opened, closed, title, card in re.findall(
        r"(<details(?: open)?>)|(</details>)|<summary>(.*?)</summary>|</span>([^<]*?) <span class=",
        html,
    ):
        level += bool(opened) - bool(closed)
        if title or card:
            found.append("  " * level + (f"[{title}]" if title else card))
    return found


@pytest.mark.parametrize(
    ("severity", "wrong"),
    [("error", True), ("warning", True), ("notice", False), ("info", False), ("unheard", False)],
)
def test_what_is_more_than_a_note(severity, wrong):
    assert is_wrong(entry("a", severity)) == wrong


def test_numbers_of_things():
    assert [counted(number, "note") for number in (0, 1, 2)] == ["0 notes", "1 note", "2 notes"]


def test_consequences_are_folded_under_their_first_cause():
    html = cards(
        [
            entry("worst", kind=Kind.CRASH, cause="motor", from_s=9.0),
            entry("other", kind=Kind.GPS_JUMP),
            entry("motor", kind=Kind.MOTOR_FAILED, from_s=5.0),
            entry("later", kind=Kind.GPS_LAG, cause="motor", from_s=12.0),
            entry("orphan", kind=Kind.BARO, cause="elsewhere"),
            entry("of another", kind=Kind.BATTERY, cause="later"),
            entry("itself", kind=Kind.BATTERY, cause="itself"),
        ]
    )
    # A cause ranks with the worst of what it led to, and what leads to itself to nothing.
    assert lines(html) == [
        "5.0 s: GPS: motor", "  [it led to: impact at 9.0 s, 1 other finding]",
        "  9.0 s: GPS: worst", "  12.0 s: GPS: later", "1.0 s: GPS: other", "1.0 s: GPS: orphan",
        "1.0 s: GPS: of another", "  [1 more finding of this kind]", "  1.0 s: GPS: itself",
    ]  # fmt: skip
    assert "Times are seconds after the beginning of the recording." in html
    assert cards([]) == ""


def test_six_causes_are_shown_and_notes_are_folded():
    kinds = [Kind.GPS_LOST, Kind.GPS_JUMP, Kind.GPS_LAG, Kind.BARO, Kind.BATTERY, Kind.IMU_GAPS,
             Kind.IMU_TWICE, Kind.IMU_SLOW]  # fmt: skip
    wrong = [entry(f"w{n}", kind=kind) for n, kind in enumerate(kinds)]
    notes = [entry("n0", "notice"), entry("n1", "info", kind=Kind.GPS_JUMP)]
    assert lines(cards([*wrong, *notes])) == [
        *(f"1.0 s: GPS: w{n}" for n in range(6)),
        "  [2 further warnings]", "  1.0 s: GPS: w6", "  1.0 s: GPS: w7",
        "  [2 notes]", "  1.0 s: GPS: n0", "  1.0 s: GPS: n1",
    ]  # fmt: skip
    assert "[1 further warning]" in "".join(lines(cards(wrong[:7])))
    assert "further" not in "".join(lines(cards(wrong[:6])))


def test_what_repeats_is_folded_but_no_moment_is():
    again = [entry(f"r{n}", from_s=float(n)) for n in range(3)]
    other = entry("x", sensor={"kind": "imu"})
    assert lines(cards([*again, other])) == [
        "0.0 s: GPS: r0", "  [2 more findings of this kind]", "  1.0 s: GPS: r1",
        "  2.0 s: GPS: r2", "1.0 s: GPS: x",
    ]  # fmt: skip
    crashes = [entry(f"c{n}", kind=Kind.CRASH) for n in range(2)]
    assert lines(cards(crashes)) == ["1.0 s: GPS: c0", "1.0 s: GPS: c1"]
    led = [again[0], again[1], entry("y", kind=Kind.BARO, cause="r1")]
    assert lines(cards(led)) == [
        "0.0 s: GPS: r0", "1.0 s: GPS: r1", "  [it led to: 1 finding]", "  1.0 s: GPS: y",
    ]  # fmt: skip
    many = [entry("m", kind=Kind.MOTOR_FAILED)]
    many += [entry(f"k{n}", kind=Kind.HARD_LANDING, cause="m", from_s=2.0 + n) for n in range(5)]
    named = ", ".join(f"hard landing at {t_s:.1f} s" for t_s in (2.0, 3.0, 4.0))
    assert f"it led to: {named}, 2 other findings" in cards(many)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"from_s": 1.04, "to_s": 1.04}, "1.0 s: GPS: a"),
        ({"from_s": 1.0, "to_s": 10.94}, "1.0 to 10.9 s: GPS: a"),
        ({"from_s": 1.0, "to_s": 11.1}, "1 to 11 s: GPS: a"),
        ({"text": "the gps jumped"}, "1.0 s: the gps jumped"),
        ({"sensor": {"kind": "vehicle"}, "source": "vehicle"}, "1.0 s: a"),
        ({"text": "<b>"}, "1.0 s: GPS: &lt;b&gt;"),
    ],
)
def test_when_and_of_what_a_finding_is(changes, text):
    assert lines(cards([entry("a", **changes)])) == [text]


@pytest.mark.parametrize(
    ("size", "unit", "shown"),
    [
        (0.0, "m", ""),
        (3.0, "", ""),
        (3.456, "m/s^2", "3.5 m/s²"),
        (99.4, "m/s2", "99 m/s²"),
        (100.4, "mG", "100 mG"),
        (-1234.5, "ppm", "-1234 ppm"),
    ],
)
def test_a_size_has_two_digits_and_its_unit(size, unit, shown):
    html = cards([entry("a", size=size, unit=unit)])
    assert f'<span class="size">{shown}</span>' in html


def test_why_is_told_and_open_on_the_first_card_alone():
    both = [
        entry("a", means="it is <so>", evidence="seen", check="look"),
        entry("b", kind=Kind.BARO, evidence="felt"),
    ]
    html = cards(both)
    assert html.count("<details open>") == 1
    assert html.index("<details open>") < html.index("felt")
    assert '<span class="line"><i>means:</i> it is &lt;so&gt;</span>' in html
    assert '<i>shown by:</i> seen</span><span class="line"><i>check:</i> look</span>' in html
    assert html.count("<i>means:</i>") == 1
    assert "<details open>" not in cards(both, opens_first=False)
    assert 'data-from="1.000" data-to="1.000" data-place="gps"' in html

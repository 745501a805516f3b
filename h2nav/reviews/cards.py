"""The findings of a review as HTML: causes as cards, with their consequences folded beneath."""

from collections.abc import Iterable, Sequence
from typing import Any

from h2nav.integrity.findings import SensorKind, Severity
from h2nav.reviews.html import escape
from h2nav.reviews.pictures.timeline import MOMENTS
from h2nav.reviews.subjects import SECTIONS

# In the form of `h2nav.reviews.document`.
Entry = dict[str, Any]
# Causes shown at once; the first one unfolded.
MAX_SHOWN, MAX_LISTED, MAX_MOMENTS = 6, 200, 3


def cards(findings: Sequence[Entry], *, opens_first: bool = True) -> str:
    """Causes in the given order, with notes folded below them.

    Args:
        findings: worst first; one with a first cause among them goes beneath it.
        opens_first: unfold the first one.
    """
    followers = _followers(findings)
    followed = {one["id"] for some in followers.values() for one in some}
    # A cause ranks with the worst of its consequences.
    place_of = {one["id"]: number for number, one in reversed(list(enumerate(findings)))}
    causes = sorted(
        (one for one in findings if one["id"] not in followed),
        key=lambda one: min(place_of[each["id"]] for each in (one, *followers.get(one["id"], ()))),
    )
    wrong = _grouped((one for one in causes if is_wrong(one)), followers)
    notes = _grouped((one for one in causes if not is_wrong(one)), followers)
    about = (
        '<p class="about">A click on a finding shows its time in all pictures. Times are seconds '
        "after the beginning of the recording.</p>"
    )
    shown = _list(wrong[:MAX_SHOWN], followers, opens_first=opens_first)
    parts = [shown]
    for some, what in ((wrong[MAX_SHOWN:], "further warning"), (notes, "note")):
        if some:
            number = sum(map(len, some))
            parts.append(_folded(counted(number, what), _list(some[:MAX_LISTED], followers)))
    return "".join((*parts, about if findings else ""))


def is_wrong(finding: Entry) -> bool:
    """Whether it is more than a note."""
    return _severity(finding) <= Severity.WARNING


def counted(number: int, what: str) -> str:
    """``1 note`` or ``2 notes``."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def _followers(findings: Sequence[Entry]) -> dict[str, list[Entry]]:
    """Id of a first cause -> its consequences, in order of time."""
    first = {one["id"]: one["consequence_of"] for one in findings}
    followers: dict[str, list[Entry]] = {}
    for one in sorted(findings, key=lambda one: float(one["from_s"])):
        cause = first[one["id"]]
        if cause in first and cause != one["id"] and first[cause] is None:
            followers.setdefault(cause, []).append(one)
    return followers


def _grouped(causes: Iterable[Entry], followers: dict[str, list[Entry]]) -> list[list[Entry]]:
    """Groups repeated findings without consequences under the first of their kind."""
    groups: list[list[Entry]] = []
    repeated: dict[tuple[str, str], list[Entry]] = {}
    for one in causes:
        group = repeated.get((one["kind"], one["sensor"]["kind"]))
        if one["id"] in followers or one["kind"] in MOMENTS:
            groups.append([one])
        elif group is not None:
            group.append(one)
        else:
            groups.append([one])
            repeated[one["kind"], one["sensor"]["kind"]] = groups[-1]
    return groups


def _list(
    groups: Iterable[Sequence[Entry]],
    followers: dict[str, list[Entry]],
    *,
    opens_first: bool = False,
) -> str:
    """Cards, each for the first of a group, with the others folded inside."""
    items = [
        _card(first, more, followers.get(first["id"], ()), is_open=opens_first and number == 0)
        for number, (first, *more) in enumerate(groups)
    ]
    return f'<ol class="findings">{"".join(items)}</ol>' if items else ""


def _card(
    finding: Entry,
    more: Sequence[Entry],
    followers: Sequence[Entry],
    *,
    is_open: bool,
) -> str:
    severity, source, text = _severity(finding), finding["source"], finding["text"]
    is_named = finding["sensor"]["kind"] == SensorKind.VEHICLE or source.lower() in text.lower()
    if not is_named:
        text = f"{source}: {text}"
    # A size without a unit repeats a number in the text.
    unit = finding["unit"].replace("m/s^2", "m/s²").replace("m/s2", "m/s²")
    size = f"{_figure(finding['size'])} {unit}" if unit and finding["size"] else ""
    folded = [_why(finding, is_open=is_open)]
    if more:
        title = f"{counted(len(more), 'more finding')} of this kind"
        folded.append(_folded(title, _list(([one] for one in more[:MAX_LISTED]), {})))
    if followers:
        folded.append(_folded(_led_to(followers), _list(([one] for one in followers), {})))
    return (
        f'<li class="finding {severity.look}"><button type="button" '
        f'data-from="{finding["from_s"]:.3f}" data-to="{finding["to_s"]:.3f}" '
        f'data-place="{SECTIONS[finding["kind"]]}">'
        f'<span class="what"><span class="tag">{severity.tag}</span>'
        f'{escape(_span(finding))}: {escape(text)} <span class="size">{escape(size)}</span></span>'
        f"</button>{''.join(folded)}</li>"
    )


def _led_to(followers: Sequence[Entry]) -> str:
    """Names the moments among them and counts the others."""
    moments = [one for one in followers if one["kind"] in MOMENTS][:MAX_MOMENTS]
    named = [f"{MOMENTS[one['kind']]} at {one['from_s']:.1f} s" for one in moments]
    rest = len(followers) - len(moments)
    if rest:
        named.append(counted(rest, f"{'other ' if named else ''}finding"))
    return f"it led to: {', '.join(named)}"


def _severity(finding: Entry) -> Severity:
    return Severity.of(finding["severity"]) or Severity.INFO


def _why(finding: Entry, *, is_open: bool) -> str:
    """Meaning, evidence, and what to check."""
    lines = (("means", "means"), ("shown by", "evidence"), ("check", "check"))
    shown = "".join(
        f'<span class="line"><i>{name}:</i> {escape(finding[key])}</span>'
        for name, key in lines
        if finding[key]
    )
    return _folded("why, and what to check", shown, is_open=is_open) if shown else ""


def _folded(title: str, html: str, *, is_open: bool = False) -> str:
    return (
        f"<details{' open' if is_open else ''}><summary>{escape(title)}</summary>{html}</details>"
    )


def _span(finding: Entry) -> str:
    from_s, to_s = finding["from_s"], finding["to_s"]
    digits = 1 if to_s - from_s < 10.0 else 0
    begin, end = f"{from_s:.{digits}f}", f"{to_s:.{digits}f}"
    return f"{begin} s" if begin == end else f"{begin} to {end} s"


def _figure(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.2g}"

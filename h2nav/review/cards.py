"""The findings of a review as HTML: a cause as a card, what follows from it folded beneath."""

from collections.abc import Iterable, Sequence

from h2nav.integrity.findings import Finding, Severity
from h2nav.integrity.kinds import MEANINGS
from h2nav.review.advice import place
from h2nav.review.causes import first_causes
from h2nav.review.html import escape

# Causes that are seen at once; the first one with all that is said of it.
MOST_SHOWN, MOST_LISTED = 6, 200


def cards(findings: Sequence[Finding]) -> str:
    """Causes in the order that is given, notes folded below them.

    Args:
        findings: the worst first; what has a `cause` among them stands beneath it.
    """
    followers = _followers(findings)
    followed = {one.id for some in followers.values() for one in some}
    causes = [one for one in findings if one.id not in followed]
    wrong = [one for one in causes if one.severity <= Severity.WARNING]
    notes = [one for one in causes if one.severity > Severity.WARNING]
    about = (
        '<p class="about">A click on a finding shows its time in all pictures. Times are seconds '
        "after the beginning of the recording.</p>"
    )
    parts = [about if findings else "", _list(wrong[:MOST_SHOWN], followers, opens_first=True)]
    further = wrong[MOST_SHOWN:]
    for some, what in ((further, "further warning"), (notes, "note")):
        if some:
            parts.append(_folded(counted(len(some), what), _list(some[:MOST_LISTED], followers)))
    return "".join(parts)


def counted(number: int, what: str) -> str:
    """``1 note`` or ``2 notes``."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def _followers(findings: Sequence[Finding]) -> dict[str, list[Finding]]:
    """Id of a first cause -> what follows from it, in order of time."""
    first = first_causes(findings)
    ids = {one.id for one in findings}
    followers: dict[str, list[Finding]] = {}
    for one in sorted(findings, key=lambda one: one.from_s):
        cause = first[one.id]
        if cause in ids and cause != one.id and first[cause] is None:
            followers.setdefault(cause, []).append(one)
    return followers


def _list(
    findings: Iterable[Finding], followers: dict[str, list[Finding]], *, opens_first: bool = False
) -> str:
    items = [
        _card(one, followers.get(one.id, ()), is_open=opens_first and number == 0)
        for number, one in enumerate(findings)
    ]
    return f'<ol class="findings">{"".join(items)}</ol>' if items else ""


def _card(finding: Finding, followers: Sequence[Finding], *, is_open: bool) -> str:
    severity, source = finding.severity, finding.source
    text = finding.text if source.lower() in finding.text.lower() else f"{source}: {finding.text}"
    # A size without a unit counts what the text counts too.
    size = f"{_figure(finding.size)} {finding.unit}" if finding.unit else ""
    follows = ""
    if followers:
        many = f"{counted(len(followers), 'finding')} that {_follow(len(followers))} from it"
        follows = _folded(many, _list(followers, {}))
    return (
        f'<li class="finding {severity.look}"><button type="button" '
        f'data-from="{finding.from_s:.3f}" data-to="{finding.to_s:.3f}" '
        f'data-place="{place(finding.kind)}">'
        f'<span class="what"><span class="tag">{severity.tag}</span>'
        f'{escape(_span(finding))}: {escape(text)} <span class="size">{escape(size)}</span></span>'
        f"</button>{_why(finding, is_open=is_open)}{follows}</li>"
    )


def _follow(number: int) -> str:
    return "follows" if number == 1 else "follow"


def _why(finding: Finding, *, is_open: bool) -> str:
    """What it means, what shows it, what to check."""
    of_kind = MEANINGS[finding.kind]
    lines = (("means", of_kind.means), ("shown by", finding.evidence), ("check", of_kind.check))
    shown = "".join(
        f'<span class="line"><i>{name}:</i> {escape(line)}</span>' for name, line in lines if line
    )
    return _folded("why, and what to check", shown, is_open=is_open) if shown else ""


def _folded(title: str, html: str, *, is_open: bool = False) -> str:
    return (
        f"<details{' open' if is_open else ''}><summary>{escape(title)}</summary>{html}</details>"
    )


def _span(finding: Finding) -> str:
    digits = 1 if finding.to_s - finding.from_s < 10.0 else 0
    begin, end = f"{finding.from_s:.{digits}f}", f"{finding.to_s:.{digits}f}"
    return f"{begin} s" if begin == end else f"{begin} to {end} s"


def _figure(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.2g}"

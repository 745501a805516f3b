"""The one sentence at the top of a review: what a pilot would say of the flight."""

from collections.abc import Sequence

from h2nav.integrity.findings import Finding, Severity


def verdict(findings: Sequence[Finding], why_no_estimate: str = "") -> str:
    """What page, JSON, terminal and fleet list say first.

    Args:
        findings: all, in the order in which they are shown, with their causes.
        why_no_estimate: why there is no attitude of our own; empty where there is one.
    """
    wrong = [one for one in findings if one.severity <= Severity.WARNING]
    causes = [one for one in wrong if one.cause is None]
    if not causes:
        place = " in what could be looked at" if why_no_estimate else ""
        return f"Nothing was found wrong{place}."
    first, others = causes[0], len(wrong) - 1
    name = "" if first.source.lower() in first.text.lower() else f"{first.source}: "
    said = f"At {first.from_s:.0f} s: {name}{first.text}"
    if others:
        said += f"; {others} more thing{'s were' if others > 1 else ' was'} found wrong"
    return f"{said}."

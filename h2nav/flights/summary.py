"""A flight in a row of the list, from the document of its review."""

from collections import Counter
from collections.abc import Mapping
from typing import Any

from h2nav.integrity.severity import Severity

# Of these severities the row has a count each.
COUNTED = {
    "errors": (Severity.CRITICAL, Severity.ERROR),
    "warnings": (Severity.WARNING,),
    "notices": (Severity.NOTICE, Severity.INFO),
}
LONGEST_TEXT = 240


def summary_of(document: Mapping[str, Any]) -> dict[str, Any]:
    """The row of a reviewed flight.

    Args:
        document: of the review, as in docs/schema/review.json.

    Returns:
        ``date`` (UTC, ISO 8601, or None), ``vehicle``, ``airframe``, ``firmware``, ``kind`` of the
        recording, ``duration_s`` (armed; of the recording if it never was), ``distance_m`` (or
        None), ``verdict`` (its first sentence), ``worst`` (a word of severity; empty without a
        finding), ``worst_kind``, ``worst_text``, a count for each of `COUNTED`, and ``kinds``: the
        worst severity of each kind of finding.
    """
    findings = [(_severity(each), each) for each in document["findings"]]
    ranked = sorted(findings, key=lambda pair: pair[0])  # stable: causes come first
    worst, first = ranked[0] if ranked else (None, {})
    counts = Counter(severity for severity, _ in findings)
    kinds: dict[str, str] = {}
    for severity, each in ranked:
        kinds.setdefault(each["kind"], severity.word)
    airframe = document["airframe"]
    described = document["autopilot"] or document["vehicle"]
    armed_s = sum(span["to_s"] - span["from_s"] for span in document["spans"]["armed"])
    return {
        "date": document["start_utc"],
        "vehicle": document["vehicle"],
        "airframe": airframe["id"] if airframe["uid"] else described,
        "firmware": document["firmware"],
        "kind": document["kind"],
        "duration_s": armed_s or document["duration_s"],
        "distance_m": document["flown"]["distance_m"] if document["receivers"] else None,
        "verdict": document["headline"][:LONGEST_TEXT],
        "worst": "" if worst is None else worst.word,
        "worst_kind": first.get("kind", ""),
        "worst_text": first.get("text", "")[:LONGEST_TEXT],
        **{name: sum(counts[each] for each in severities) for name, severities in COUNTED.items()},
        "kinds": kinds,
        **_unjudged(document["why_no_estimate"], has_findings=bool(ranked)),
    }


def _unjudged(reason: str | None, *, has_findings: bool) -> dict[str, str]:
    """What a recording that shows nothing is called in place of sound."""
    if not reason or has_findings:
        return {}
    return {
        "verdict": f"Not judged: {reason}."[:LONGEST_TEXT],
        "worst": Severity.NOTICE.word,
        "worst_text": reason[:LONGEST_TEXT],
    }


def sentence_of(summary: Mapping[str, Any]) -> tuple[Severity, str]:
    """What a ground station is told of a reviewed flight, in one line.

    Returns:
        How severe it is, and the text: whether it was sound, or else the verdict.
    """
    if summary["errors"] or summary["warnings"]:
        worst = Severity.of(summary["worst"]) or Severity.WARNING
        return worst, f"flight: {summary['verdict']}"
    if summary["worst"] and not summary["kinds"]:
        return Severity.NOTICE, f"flight not judged: {summary['worst_text']}"
    notices = summary["notices"]
    rest = f", {notices} notice{'s' if notices != 1 else ''}" if notices else ""
    return Severity.INFO, f"flight sound{rest}"


def _severity(finding: Mapping[str, Any]) -> Severity:
    return Severity.of(finding["severity"]) or Severity.NOTICE

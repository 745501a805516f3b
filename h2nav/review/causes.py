"""Which finding follows from which."""

from collections.abc import Iterable, Mapping, Sequence

from h2nav.integrity.findings import Finding, Kind

# What begins so soon after an impact is what the impact did.
AFTER_IMPACT_S = 10.0


def with_causes(findings: Iterable[Finding]) -> list[Finding]:
    """The same findings; each that follows from another one names it.

    Args:
        findings: all of them, with ids.
    """
    some = list(findings)
    impacts = [one for one in some if one.kind is Kind.CRASH]
    return [_after_impact(one, impacts) for one in some]


def first_causes(findings: Sequence[Finding]) -> Mapping[str, str | None]:
    """Id -> id of the finding at the beginning of its chain; None for one without a cause."""
    causes = {one.id: one.cause for one in findings}
    found: dict[str, str | None] = {}
    for one in findings:
        first, seen = one.cause, {one.id}
        while first is not None and (cause := causes.get(first)) is not None and first not in seen:
            seen.add(first)
            first = cause
        found[one.id] = first
    return found


def _after_impact(one: Finding, impacts: Sequence[Finding]) -> Finding:
    if one.cause is not None or one.kind is Kind.CRASH:
        return one
    before = [hit for hit in impacts if 0.0 <= one.from_s - hit.from_s <= AFTER_IMPACT_S]
    return one._replace(cause=before[-1].id) if before else one

"""Chains of causes between findings."""

from collections.abc import Mapping, Sequence

from h2nav.integrity.findings import Finding


def first_causes(findings: Sequence[Finding]) -> Mapping[str, str | None]:
    """Id -> id of the first cause in its chain; None for a finding without a cause."""
    causes = {one.id: one.cause for one in findings}
    found: dict[str, str | None] = {}
    for one in findings:
        first, seen = one.cause, {one.id}
        while first is not None and (cause := causes.get(first)) is not None and first not in seen:
            seen.add(first)
            first = cause
        found[one.id] = first
    return found

"""Spans of time during which a value stays the same."""

from collections.abc import Iterable, Sequence

from h2nav.recordings.context import Span


def spans(t_s: Sequence[float], names: Iterable[str], end_s: float) -> tuple[Span, ...]:
    """One span per stretch of equal names, up to the beginning of the next one.

    Args:
        t_s: (N,) times, in order.
        names: (N,) the name from each time on; an empty name makes no span.
        end_s: end of the last one.
    """
    found: list[Span] = []
    before = ""
    for at_s, name in zip(t_s, names, strict=True):
        if name == before:
            continue
        if before:
            found[-1] = found[-1]._replace(to_s=at_s)
        if name:
            found.append(Span(at_s, end_s, name))
        before = name
    return tuple(found)


def without(found: Iterable[Span], others: Iterable[Span]) -> tuple[Span, ...]:
    """The spans minus others, which are sorted and do not overlap."""
    rest = []
    cuts = tuple(others)
    for span in found:
        from_s = span.from_s
        for cut in cuts:
            if cut.to_s > from_s and cut.from_s < span.to_s:
                if cut.from_s > from_s:
                    rest.append(span._replace(from_s=from_s, to_s=cut.from_s))
                from_s = cut.to_s
        if from_s < span.to_s:
            rest.append(span._replace(from_s=from_s))
    return tuple(rest)

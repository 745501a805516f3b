"""Spans of time during which a value stays the same."""

from collections.abc import Iterable, Sequence

import numpy as np

from h2nav.recordings.context import Array, Span

# The shortest pause of all messages that counts, in seconds and in usual pauses.
MIN_SILENCE_S, SILENT_PERIODS = 0.25, 3.0
# Longer ones are no usual pauses of any log.
MAX_PAUSE_S = 5.0
SILENT = "nothing recorded"


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


def silences(t_s: Array) -> tuple[Span, ...]:
    """The pauses between times of messages of all kinds, in order: nothing came at all."""
    steps_s = np.diff(t_s)
    longest_s = max(MIN_SILENCE_S, SILENT_PERIODS * _usual_pause_s(steps_s))
    places = np.flatnonzero(steps_s > longest_s)
    pairs = zip(t_s[places].tolist(), t_s[places + 1].tolist(), strict=True)
    return tuple(Span(*pair, SILENT) for pair in pairs)


def _usual_pause_s(steps_s: Array) -> float:
    """Half of the time passes in longer ones: messages come in bursts, as slow as once a second."""
    steps_s = np.sort(steps_s[steps_s < MAX_PAUSE_S])
    if not len(steps_s):
        return 0.0
    passed_s = np.cumsum(steps_s)
    return float(steps_s[min(np.searchsorted(passed_s, 0.5 * passed_s[-1]), len(steps_s) - 1)])


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

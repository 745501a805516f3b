"""Uncertainty of our attitude, and the tests that it underwent."""

import numpy as np

from h2nav.recordings.context import Array, Span
from h2nav.reviews.flight import Flight, Ratios

# Comparison made by a group of test ratios (`h2nav.integrity.ratios`), by name prefix.
GROUPS = {
    "velocity": "attitude by GPS velocity",
    "force": "attitude by gravity",
    "field": "compass by attitude",
    "turn": "gyro by compass",
}
# Ratios come once a second, fixes as often or more; a longer interval is a gap.
LONGEST_STEP_S = 2.5


def ratio_of(ratios: Ratios, group: str) -> Array:
    """(N,) the worst ratio of a group, NaN without any."""
    columns = [k for k, name in enumerate(ratios.names) if name.startswith(group)]
    if not columns or len(ratios.t_s) == 0:
        return np.full(len(ratios.t_s), np.nan)
    values = np.where(np.isnan(ratios.values[:, columns]), -np.inf, ratios.values[:, columns])
    worst = values.max(axis=1)
    return np.where(np.isinf(worst), np.nan, worst)


def aids(flight: Flight) -> dict[str, tuple[Span, ...]]:
    """Spans during which our attitude was tested, by group of `GROUPS`."""
    ratios = flight.ratios
    return {
        group: stretches(ratios.t_s[~np.isnan(ratio_of(ratios, group))], "tested")
        for group in GROUPS
    }


def stretches(t_s: Array, name: str) -> tuple[Span, ...]:
    """Spans of this name over closely spaced times."""
    if len(t_s) == 0:
        return ()
    breaks = np.flatnonzero(np.diff(t_s) > LONGEST_STEP_S)
    starts, ends = np.append(0, breaks + 1), np.append(breaks, len(t_s) - 1)
    return tuple(
        Span(float(t_s[start]), float(t_s[end]), name)
        for start, end in zip(starts, ends, strict=True)
    )


def covered_s(spans: tuple[Span, ...]) -> float:
    """Total length of spans."""
    return sum(span.to_s - span.from_s for span in spans)

"""Makes a bad flight small: fewer faults, shorter, nominal, while it stays as bad.

Delta debugging, one step at a time: a change is kept if the flight still goes wrong in the same
way. Every trial is a flight, so that the order counts: what makes flights shorter comes first.
"""

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

from h2nav.errors import BadInput
from h2nav.evaluation.campaign.draw import SECTIONS, Draw, not_nominal
from h2nav.evaluation.campaign.summary import badness

# A smaller flight is kept if at least this share of the badness stays.
KEPT_SHARE = 0.5
MIN_LENGTH_MIN = 1.0
SHORTER = (0.25, 0.5, 0.7)


def shrink(
    draw: Draw,
    fly: Callable[[Draw], dict[str, Any]],
    on_trial: Callable[[Draw, float], object],
    trials: int,
) -> Draw:
    """The smallest flight found that is still bad.

    Args:
        fly: flies a draw and scores it.
        on_trial: called with each trial and its badness.
        trials: flights to spend.
    """
    wanted = KEPT_SHARE * badness(fly(draw))
    if wanted == 0.0:
        return draw
    left = trials
    before = None
    while draw != before:
        before = draw
        for smaller_of in (_shorter, _fewer_faults, _fewer_imus, _plainer, _nearer):
            candidates = smaller_of(draw)
            while left and (smaller := next(candidates, None)) is not None:
                left -= 1
                found = badness(fly(smaller))
                on_trial(smaller, found)
                if found >= wanted:
                    draw, candidates = smaller, smaller_of(smaller)
    return draw


def _shorter(draw: Draw) -> Iterator[Draw]:
    length_min = draw.flight.length_min
    for share in SHORTER:
        shorter = max(round(length_min * share, 1), MIN_LENGTH_MIN)
        if shorter < length_min:
            yield _with(draw, "flight", length_min=shorter)


def _fewer_faults(draw: Draw) -> Iterator[Draw]:
    for place in range(len(draw.faults)):
        rest = (*draw.faults[:place], *draw.faults[place + 1 :])
        yield dataclasses.replace(draw, faults=rest)


def _fewer_imus(draw: Draw) -> Iterator[Draw]:
    """Those with a fault stay."""
    lowest = max((fault.imu for fault in draw.scheduled), default=1)
    for count in range(lowest, draw.imu.count):
        yield _with(draw, "imu", count=count)


def _plainer(draw: Draw) -> Iterator[Draw]:
    """A whole section nominal."""
    for name, values in not_nominal(draw).items():
        if smaller := _nominal(draw, name, tuple(values)):
            yield smaller


def _nearer(draw: Draw) -> Iterator[Draw]:
    """One key nominal."""
    for name, values in not_nominal(draw).items():
        for key in values:
            if smaller := _nominal(draw, name, (key,)):
                yield smaller


def _nominal(draw: Draw, name: str, keys: tuple[str, ...]) -> Draw | None:
    """With these keys as in the nominal flight; length and IMUs have steps of their own."""
    nominal, stay = SECTIONS[name](), {"flight": "length_min", "imu": "count"}.get(name)
    changes = {key: getattr(nominal, key) for key in keys if key != stay}
    try:
        return _with(draw, name, **changes) if changes else None
    except BadInput:  # the compass of a fault would be gone
        return None


def _with(draw: Draw, name: str, **changes: Any) -> Draw:
    section = dataclasses.replace(getattr(draw, name), **changes)
    return dataclasses.replace(draw, **{name: section})

"""The clock of an autopilot's log: decides which rows have plausible times.

Rows are stored roughly in the order of their times. So a time that does not fit between those of
its neighbours in the file is damage, not a moment hours away.
"""

import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.int64]
Mask = NDArray[np.bool_]

# Loggers buffer, and low-priority tasks write late: rows overtake each other by less than this.
SLACK_US = 5_000_000
NEIGHBOURS = 2
# Times of rows without any are taken between rows this far apart.
ANCHOR_US = 1_000_000
MAX_AT_ONCE = 10
LONGEST_PAUSE_US = 3_600_000_000
# A week.
LONGEST_US = 168 * LONGEST_PAUSE_US
# 2^53 us, 285 years, so that differences stay exact as floats.
LATEST_US = 1 << 53


class LogClock:
    """Times by place in the file.

    Args:
        places: (N,) of rows in the file, in order.
        t_us: (N,) their times, for the most frequent kind of row.
    """

    def __init__(self, places: Times, t_us: Times) -> None:
        good = _undamaged(t_us)
        self._places, self._t_us = places[good], t_us[good]
        # first plausible time; 0 without any
        self.start_us = int(self._t_us[0]) if len(self._t_us) else 0
        self.end_us = int(self._t_us[-1]) if len(self._t_us) else 0  # the last one

    @property
    def longest_pause_s(self) -> float:
        """The longest time from one row to the next; 0 without two."""
        return 1e-6 * float(np.diff(self._t_us).max(initial=0))

    def believes(self, places: Times, t_us: Times) -> Mask:
        """(N,) whether the times of rows agree with those of their neighbours in the file."""
        if not len(self._t_us):
            return np.zeros(len(places), np.bool_)
        following = np.searchsorted(self._places, places)
        before, after = following - 1, np.minimum(following, len(self._places) - 1)
        earliest = np.where(before < 0, 0, self._t_us[before] - SLACK_US)
        believed: Mask = (t_us >= earliest) & (t_us <= self._t_us[after] + SLACK_US)
        return believed

    def at(self, places: Times) -> Times:
        """(N,) the times at places in the file: those of the rows before them."""
        if not len(self._t_us):
            return np.zeros(len(places), np.int64)
        before = np.maximum(np.searchsorted(self._places, places) - 1, 0)
        times: Times = self._t_us[before]
        return times

    def after(self, places: Times) -> Times:
        """(N,) those of the rows after them."""
        if not len(self._t_us):
            return np.zeros(len(places), np.int64)
        following = np.searchsorted(self._places, places).clip(max=len(self._t_us) - 1)
        times: Times = self._t_us[following]
        return times

    def between(self, places: Times) -> Times:
        """(N,) times of rows without any, by their places between those of rows that have one."""
        if not len(self._t_us):
            return np.zeros(len(places), np.int64)
        anchors = _anchors(self._t_us)
        times = np.interp(places, self._places[anchors], self._t_us[anchors] - self.start_us)
        return np.asarray(self.start_us + np.round(times).astype(np.int64))

    def extended(self, first: int, last: int) -> "LogClock":
        """The clock of a file in which most rows have no time, from its first row to its last.

        Before the first time and after the last one, the file grows as fast as in between.
        """
        bytes_per_us = (self._places[-1] - self._places[0]) / (self.end_us - self.start_us)
        before_us = min((self._places[0] - first) / bytes_per_us, self.start_us, LONGEST_US)
        after_us = min((last - self._places[-1]) / bytes_per_us, LONGEST_US)
        # A time alone, far from all others, would count as damage.
        before = np.arange(-int(before_us // ANCHOR_US), 0) * ANCHOR_US
        after = np.append(np.arange(ANCHOR_US, after_us, ANCHOR_US), after_us)
        places = (
            self._places[0] + before * bytes_per_us,
            self._places,
            self._places[-1] + after * bytes_per_us,
        )
        t_us = (self.start_us + before, self._t_us, self.end_us + after)
        return LogClock(*(np.concatenate(each).astype(np.int64) for each in (places, t_us)))


def _anchors(t_us: Times) -> NDArray[np.intp]:
    """Rows a second apart, and both ends of a pause: in between, bytes flow evenly.

    Between more of them, the moments at which rows happened to be written would show as jitter.
    """
    kept = np.diff(t_us // ANCHOR_US, prepend=-1) > 0
    pauses = np.flatnonzero(np.diff(t_us) > ANCHOR_US)
    kept[pauses] = kept[pauses + 1] = kept[-1] = True
    return np.flatnonzero(kept)


def is_running(t_us: Times) -> bool:
    """Whether the times advance at all: some are never set, some repeat over several rows."""
    return bool(np.count_nonzero(np.diff(t_us)) * MAX_AT_ONCE >= len(t_us) - 1)


def in_order(t_us: Times) -> Mask:
    """(N,) which rows to keep so that times never decrease.

    Of two neighbours out of order, the one farther from the times around both is wrong, so that one
    wrong time costs one row, not every row up to that time.
    """
    back = np.flatnonzero(np.diff(t_us) < 0)
    kept = np.ones(len(t_us), np.bool_)
    if not len(back):
        return kept
    away_us = np.abs(t_us - _usual(t_us))
    kept[np.where(away_us[back] >= away_us[back + 1], back, back + 1)] = False
    kept[kept] = t_us[kept] >= np.maximum.accumulate(t_us[kept])
    return kept


def _usual(t_us: Times) -> NDArray[np.float64]:
    """(N,) the median of each time and its neighbours."""
    # Reflected, so that the first and the last time do not confirm themselves.
    if len(t_us) <= NEIGHBOURS:
        return np.full(len(t_us), np.median(t_us))
    padded = np.pad(t_us, NEIGHBOURS, mode="reflect")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1)
    usual: NDArray[np.float64] = np.median(around, axis=1)
    return usual


def _undamaged(t_us: Times) -> Mask:
    """(N,) whether a time agrees with its neighbours', and no earlier time is later."""
    good = (t_us >= 0) & (t_us < LATEST_US)
    good[good] = np.abs(t_us[good] - _usual(t_us[good])) <= SLACK_US if good.any() else False
    good[good] = in_order(t_us[good])
    kept = np.flatnonzero(good)
    # Of parts that lie hours apart, the longest one is the flight.
    edges = [0, *(np.flatnonzero(np.diff(t_us[kept]) > LONGEST_PAUSE_US) + 1), len(kept)]
    part = int(np.argmax(np.diff(edges)))
    good[:] = False
    good[kept[edges[part] : edges[part + 1]]] = True
    good[good] = t_us[good] - t_us[good][:1] <= LONGEST_US
    return good

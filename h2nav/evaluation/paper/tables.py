"""The slides' tables, ours, and a comparison."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from h2nav.evaluation import parallel
from h2nav.evaluation.paper.trials import (
    CASES,
    Assumptions,
    Case,
    errors_deg,
    make_trials,
    runners,
)
from h2nav.synthesis.plant import Matrix

SEEDS_PER_TASK = 25
WITHIN = 1.5


class SlidesRow(NamedTuple):
    """One row of the slides' tables, degrees: roll, pitch, yaw."""

    rms_deg: tuple[float, float, float]
    min_max_deg: tuple[tuple[float, float], tuple[float, float], tuple[float, float]]


# Case -> our filter -> the slides' figures. The lower pitch bound of the EKF in case II is printed
# as "[-1.84000.692]"; it is read as -1.8400, 0.692.
SLIDES: dict[str, dict[str, SlidesRow]] = {
    "case_1": {
        "eh2_paper": SlidesRow(
            (0.0331, 0.0538, 0.1107), ((-0.152, 0.125), (-0.284, 0.240), (-0.423, 0.402))
        ),
        "ekf_unit": SlidesRow(
            (0.0533, 0.0988, 0.2298), ((-0.257, 0.249), (-0.523, 0.444), (-1.087, 0.937))
        ),
    },
    "case_2": {
        "eh2_paper": SlidesRow(
            (0.3045, 0.3260, 0.3121), ((-0.592, 0.730), (-0.897, 0.602), (-0.857, 0.664))
        ),
        "ekf_unit": SlidesRow(
            (0.3073, 0.2656, 0.5275), ((-2.212, 1.404), (-1.840, 0.692), (-2.227, 3.097))
        ),
    },
}


class PaperRow(NamedTuple):
    """One row of our tables, degrees: roll, pitch, yaw."""

    rms_deg: list[float]  # over all runs
    rms_second_half_deg: list[float]  # the same without the first half of the case
    min_max_deg: list[list[float]]  # extremes of a typical run: the mean of the runs' extremes


Tables = dict[str, dict[str, PaperRow]]  # case -> filter -> figures


class Sums(NamedTuple):
    """Errors of one filter on some runs, ready to be added to those of other runs.

    Attributes:
        square, square_late: (3,) sums of squares over the whole case and its second half.
        samples, samples_late: how many samples these are.
        lowest, highest: (S, 3) extremes of every run.
    """

    square: Matrix
    square_late: Matrix
    samples: int
    samples_late: int
    lowest: Matrix
    highest: Matrix


def tables(assumptions: Assumptions, seeds: int) -> Tables:
    """Computes our tables, on all processors."""
    tasks = [
        (case, assumptions, range(start, min(start + SEEDS_PER_TASK, seeds)))
        for case in CASES
        for start in range(0, seeds, SEEDS_PER_TASK)
    ]
    gathered: dict[str, dict[str, list[Sums]]] = {case.key: {} for case in CASES}
    for (case, _, _), sums in zip(tasks, parallel.results(_run_task, tasks), strict=True):
        for name, item in sums.items():
            gathered[case.key].setdefault(name, []).append(item)
    return {
        key: {name: _row(parts) for name, parts in filters.items()}
        for key, filters in gathered.items()
    }


def _run_task(task: tuple[Case, Assumptions, range]) -> dict[str, Sums]:
    """Every filter on some seeds of one case."""
    case, assumptions, seeds = task
    trials = make_trials(case, assumptions, seeds)
    return {
        name: _summed(errors_deg(trials, estimates))
        for runner in runners(case).values()
        for name, estimates in runner(trials).items()
    }


def _summed(errors: Matrix) -> Sums:
    """(S, M, 3) errors; NaN where a filter had no estimate yet."""
    late = errors[:, errors.shape[1] // 2 :]
    return Sums(
        square=np.nansum(errors**2, axis=(0, 1)),
        square_late=np.nansum(late**2, axis=(0, 1)),
        samples=int(np.sum(~np.isnan(errors[..., 0]))),
        samples_late=int(np.sum(~np.isnan(late[..., 0]))),
        lowest=np.nanmin(errors, axis=1),
        highest=np.nanmax(errors, axis=1),
    )


def _row(parts: Sequence[Sums]) -> PaperRow:
    square, square_late, samples, samples_late, lowest, highest = zip(*parts, strict=True)
    extremes = [np.mean(np.concatenate(values), axis=0) for values in (lowest, highest)]
    return PaperRow(
        np.sqrt(np.sum(square, axis=0) / sum(samples)).tolist(),
        np.sqrt(np.sum(square_late, axis=0) / sum(samples_late)).tolist(),
        np.stack(extremes, axis=1).tolist(),
    )


class PaperComparison(NamedTuple):
    """One figure of the slides beside ours."""

    what: str
    slides: float
    ours: float

    @property
    def is_within(self) -> bool:
        """Same sign and within the factor `WITHIN`."""
        return self.slides * self.ours > 0 and 1 / WITHIN <= self.ours / self.slides <= WITHIN


def comparisons(found: Tables, figure: str) -> Iterator[PaperComparison]:
    """Pairs the slides' RMS ("rms_deg") or extremes ("min_max_deg") with ours."""
    for case, rows in SLIDES.items():
        for name, row in rows.items():
            theirs = np.ravel(getattr(row, figure)).tolist()
            ours = np.ravel(getattr(found[case][name], figure)).tolist()
            for number, (a, b) in enumerate(zip(theirs, ours, strict=True)):
                axis = ("roll", "pitch", "yaw")[number * 3 // len(theirs)]
                yield PaperComparison(f"{case} {name} {axis}", a, b)

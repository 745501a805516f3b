"""`h2nav evaluate paper`: the source paper's two cases, the slides' tables next to ours."""

import argparse
import multiprocessing
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from h2nav.apps import extras
from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput

if TYPE_CHECKING:
    from h2nav.apps.paper_trials import Assumptions, Case
    from h2nav.attitude.plant import Matrix

MAX_SEEDS = 10_000
SEEDS_PER_TASK = 25
WITHIN = 1.5


class SlidesRow(NamedTuple):
    """One row of the slides' tables, degrees: roll, pitch, yaw."""

    rms_deg: tuple[float, float, float]
    min_max_deg: tuple[tuple[float, float], tuple[float, float], tuple[float, float]]


# Case -> our filter -> what the slides say. The lower pitch bound of the EKF in case II is printed
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
TITLES = {
    "case_1": "Case I: 25/20/28 deg sin(pi/50 t), 50 s",
    "case_2": "Case II: 45/40/50 deg sin(pi/3 t), 10 s, adjacent gyro samples averaged",
    "case_2_held": "Case II with held gyro samples",
}


class Sums(NamedTuple):
    """Errors of one filter on some runs, ready to be added to those of other runs.

    Attributes:
        square, square_late: (3,) sums of squares over the whole case and its second half.
        samples, samples_late: how many samples these are.
        lowest, highest: (S, 3) extremes of every run.
    """

    square: "Matrix"
    square_late: "Matrix"
    samples: int
    samples_late: int
    lowest: "Matrix"
    highest: "Matrix"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument("--seeds", type=int, default=20, metavar="N", help="runs per case (20)")
    parser.add_argument("--json", action="store_true", help="machine-readable result")
    parser.add_argument("--plots", type=Path, metavar="DIR", help="draw the slides' figures here")
    parser.add_argument(
        "--run-in-s",
        type=float,
        default=150.0,
        metavar="S",
        help="unscored motion before each case, in which the filters settle (150)",
    )
    parser.add_argument(
        "--dip-deg", type=float, default=42.0, metavar="DEG", help="dip of the 50 uT field (42)"
    )


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    extras.require("synthesis", "evaluate paper", "scipy.linalg")
    if args.plots is not None:
        extras.require("plots", "--plots", "matplotlib.pyplot")
    from h2nav.apps.paper_trials import Assumptions

    if not 1 <= args.seeds <= MAX_SEEDS:
        raise BadInput(f"--seeds {args.seeds}: expected a number from 1 to {MAX_SEEDS}")
    if not 0.0 <= args.run_in_s <= 3600.0:
        raise BadInput(f"--run-in-s {args.run_in_s:g}: expected a number from 0 to 3600")
    if not abs(args.dip_deg) <= 85.0:
        raise BadInput(f"--dip-deg {args.dip_deg:g}: expected a number from -85 to 85")
    assumptions = Assumptions(dip_deg=args.dip_deg, run_in_s=args.run_in_s)
    tables = _evaluate(assumptions, args.seeds)
    if args.plots is not None:
        from h2nav.apps.paper_plots import draw_cases

        draw_cases(assumptions, args.plots)
        sys.stderr.write(f"{args.plots}: pictures written\n")
    if args.json:
        print_json(_document(tables, assumptions, args.seeds))
    else:
        sys.stdout.write("\n".join(_report(tables, assumptions, args.seeds)) + "\n")
    return 0


def _evaluate(assumptions: "Assumptions", seeds: int) -> dict[str, dict[str, dict[str, object]]]:
    """Case -> filter -> figures, worked out on all processors."""
    from tqdm import tqdm

    from h2nav.apps.paper_trials import CASES

    starts = range(0, seeds, SEEDS_PER_TASK)
    tasks = [
        (case, assumptions, range(start, min(start + SEEDS_PER_TASK, seeds)))
        for case in CASES
        for start in starts
    ]
    gathered: dict[str, dict[str, list[Sums]]] = {case.key: {} for case in CASES}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(mp_context=context) as pool:
        results = pool.map(_run_task, tasks)
        shown = tqdm(results, total=len(tasks), desc="runs", disable=not sys.stderr.isatty())
        for (case, _, _), sums in zip(tasks, shown, strict=True):
            for name, item in sums.items():
                gathered[case.key].setdefault(name, []).append(item)
    return {
        key: {name: _figures(parts) for name, parts in filters.items()}
        for key, filters in gathered.items()
    }


def _run_task(task: "tuple[Case, Assumptions, range]") -> dict[str, Sums]:
    """Every filter on some seeds of one case."""
    from h2nav.apps.paper_trials import errors_deg, make_trials, runners

    case, assumptions, seeds = task
    trials = make_trials(case, assumptions, seeds)
    return {
        name: _summed(errors_deg(trials, estimates))
        for runner in runners(case).values()
        for name, estimates in runner(trials).items()
    }


def _summed(errors: "Matrix") -> Sums:
    """(S, M, 3) errors; NaN where a filter had no estimate yet."""
    import numpy as np

    late = errors[:, errors.shape[1] // 2 :]
    return Sums(
        square=np.nansum(errors**2, axis=(0, 1)),
        square_late=np.nansum(late**2, axis=(0, 1)),
        samples=int(np.sum(~np.isnan(errors[..., 0]))),
        samples_late=int(np.sum(~np.isnan(late[..., 0]))),
        lowest=np.nanmin(errors, axis=1),
        highest=np.nanmax(errors, axis=1),
    )


def _figures(parts: list[Sums]) -> dict[str, object]:
    """RMS over all runs, and the extremes of a typical run: the mean of the runs' extremes."""
    import numpy as np

    def rms(squares: "list[Matrix]", counts: list[int]) -> list[float]:
        total: list[float] = np.sqrt(np.sum(squares, axis=0) / sum(counts)).tolist()
        return total

    lowest = np.mean(np.concatenate([part.lowest for part in parts]), axis=0)
    highest = np.mean(np.concatenate([part.highest for part in parts]), axis=0)
    return {
        "rms_deg": rms([part.square for part in parts], [part.samples for part in parts]),
        "rms_second_half_deg": rms(
            [part.square_late for part in parts], [part.samples_late for part in parts]
        ),
        "min_max_deg": np.stack((lowest, highest), axis=1).tolist(),
    }


class Comparison(NamedTuple):
    """One figure of the slides next to ours."""

    what: str
    slides: float
    ours: float

    @property
    def is_within(self) -> bool:
        """Same sign and within the factor `WITHIN`."""
        return self.slides * self.ours > 0 and 1 / WITHIN <= self.ours / self.slides <= WITHIN


def _comparisons(
    tables: dict[str, dict[str, dict[str, object]]], figure: str
) -> Iterator[Comparison]:
    """The slides' RMS ("rms_deg") or extremes ("min_max_deg") next to ours, number by number."""
    for case, rows in SLIDES.items():
        for name, row in rows.items():
            theirs, ours = _flat(getattr(row, figure)), _flat(tables[case][name][figure])
            for number, (a, b) in enumerate(zip(theirs, ours, strict=True)):
                axis = ("roll", "pitch", "yaw")[number * 3 // len(theirs)]
                yield Comparison(f"{case} {name} {axis}", a, b)


def _flat(figures: object) -> list[float]:
    if isinstance(figures, list | tuple):
        return [number for item in figures for number in _flat(item)]
    return [float(str(figures))]


def _document(
    tables: dict[str, dict[str, dict[str, object]]], assumptions: "Assumptions", seeds: int
) -> dict[str, object]:
    """The JSON result."""
    slides = {
        case: {name: row._asdict() for name, row in rows.items()} for case, rows in SLIDES.items()
    }
    return {
        **tables,
        "slides": slides,
        "slides_rms_outside_factor": _outside(tables, "rms_deg"),
        "slides_min_max_outside_factor": _outside(tables, "min_max_deg"),
        "seeds": seeds,
        "assumptions": {
            "field_norm_ut": assumptions.norm_ut,
            "field_dip_deg": assumptions.dip_deg,
            "run_in_s": assumptions.run_in_s,
            "rate_hz": 100,
            "sensor": assumptions.sensor.name,
            "gyro_noise_deg_s_rthz": assumptions.sensor.gyro_noise_deg_s_rthz,
            "accelerometer_noise_ug_rthz": assumptions.sensor.accel_noise_ug_rthz,
            "magnetometer_noise_ut": assumptions.sensor.mag_noise_ut,
        },
    }


def _outside(tables: dict[str, dict[str, dict[str, object]]], figure: str) -> list[str]:
    return [
        f"{item.what}: slides {item.slides:g}, here {item.ours:.4g}"
        for item in _comparisons(tables, figure)
        if not item.is_within
    ]


def _report(
    tables: dict[str, dict[str, dict[str, object]]], assumptions: "Assumptions", seeds: int
) -> Iterator[str]:
    """The tables for people."""
    sensor = assumptions.sensor
    yield f"Assumed, because the slides do not say ({seeds} seeds):"
    yield f"  100 Hz; {sensor.name}: gyro {sensor.gyro_noise_deg_s_rthz:g} deg/s/rtHz, sampled at"
    yield f"  an instant, steady bias; accelerometer {sensor.accel_noise_ug_rthz:g} ug/rtHz;"
    yield f"  magnetometer {sensor.mag_noise_ut:g} uT rms; field {assumptions.norm_ut:g} uT, dip"
    yield f"  {assumptions.dip_deg:g} deg; {assumptions.run_in_s:g} s of the same motion before the"
    yield "  case begins. eh2_paper, ekf_unit: unit weights, held gyro, and the estimate after a"
    yield "  step compared with the truth before it (..._prompt: with the truth of its own time)."
    for case, rows in tables.items():
        yield ""
        yield TITLES[case]
        yield f"{'':18} {'RMS roll/pitch/yaw, deg':25} {'second half':25} min max (a typical run)"
        for name, row in SLIDES.get(case, {}).items():
            yield _row(f"slides {name.split('_')[0]}", row.rms_deg, None, row.min_max_deg)
        for name, figures in rows.items():
            yield _row(
                name, figures["rms_deg"], figures["rms_second_half_deg"], figures["min_max_deg"]
            )
    for figure, word in (("rms_deg", "RMS"), ("min_max_deg", "min-max")):
        total = len(list(_comparisons(tables, figure)))
        outside = _outside(tables, figure)
        inside = total - len(outside)
        yield ""
        yield f"{inside} of the slides' {total} {word} figures within a factor {WITHIN}"
        yield from (f"  {line}" for line in outside)


def _row(name: str, rms: object, late: object, extremes: object) -> str:
    columns = [" / ".join(f"{x:.4f}" for x in _flat(rms))]
    columns.append("" if late is None else " / ".join(f"{x:.4f}" for x in _flat(late)))
    bounds = _flat(extremes)
    pairs = zip(bounds[::2], bounds[1::2], strict=True)
    columns.append(" ".join(f"[{low:.3f} {high:.3f}]" for low, high in pairs))
    return f"{name:18} {columns[0]:25} {columns[1]:25} {columns[2]}"

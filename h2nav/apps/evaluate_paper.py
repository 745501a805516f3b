"""`h2nav evaluate paper`: the source paper's two cases beside the slides' tables."""

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from h2nav.apps import extras
from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput

if TYPE_CHECKING:
    from h2nav.evaluation.paper.tables import PaperComparison, PaperRow, SlidesRow, Tables
    from h2nav.evaluation.paper.trials import Assumptions

MAX_SEEDS = 10_000
TITLES = {
    "case_1": "Case I: 25/20/28 deg sin(pi/50 t), 50 s",
    "case_2": "Case II: 45/40/50 deg sin(pi/3 t), 10 s, adjacent gyro samples averaged",
    "case_2_held": "Case II with held gyro samples",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument("--seeds", type=int, default=20, metavar="N", help="runs per case (20)")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument(
        "--plots", type=Path, metavar="DIR", help="draw the slides' figures into DIR"
    )
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
    from h2nav.evaluation.paper.tables import tables
    from h2nav.evaluation.paper.trials import Assumptions

    if not 1 <= args.seeds <= MAX_SEEDS:
        raise BadInput(f"--seeds {args.seeds}: expected a number from 1 to {MAX_SEEDS}")
    if not 0.0 <= args.run_in_s <= 3600.0:
        raise BadInput(f"--run-in-s {args.run_in_s:g}: expected a number from 0 to 3600")
    if not abs(args.dip_deg) <= 85.0:
        raise BadInput(f"--dip-deg {args.dip_deg:g}: expected a number from -85 to 85")
    assumptions = Assumptions(dip_deg=args.dip_deg, run_in_s=args.run_in_s)
    found = tables(assumptions, args.seeds)
    if args.plots is not None:
        from h2nav.evaluation.paper.pictures import draw_cases

        draw_cases(assumptions, args.plots)
        sys.stderr.write(f"{args.plots}: pictures written\n")
    if args.json:
        print_json(_document(found, assumptions, args.seeds))
    else:
        sys.stdout.write("\n".join(_report(found, assumptions, args.seeds)) + "\n")
    return 0


def _document(found: "Tables", assumptions: "Assumptions", seeds: int) -> dict[str, object]:
    """The JSON result."""
    from h2nav.evaluation.paper.tables import SLIDES, comparisons

    return {
        **_by_name(found),
        "slides": _by_name(SLIDES),
        "slides_rms_outside_factor": _outside(comparisons(found, "rms_deg")),
        "slides_min_max_outside_factor": _outside(comparisons(found, "min_max_deg")),
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


def _by_name(rows: "Mapping[str, Mapping[str, PaperRow | SlidesRow]]") -> dict[str, object]:
    return {case: {name: row._asdict() for name, row in of.items()} for case, of in rows.items()}


def _outside(compared: "Iterable[PaperComparison]") -> list[str]:
    return [
        f"{item.what}: slides {item.slides:g}, here {item.ours:.4g}"
        for item in compared
        if not item.is_within
    ]


def _report(found: "Tables", assumptions: "Assumptions", seeds: int) -> Iterator[str]:
    """The tables for people."""
    from h2nav.evaluation.paper.tables import SLIDES, WITHIN, comparisons

    sensor = assumptions.sensor
    yield f"Assumed, because the slides do not say ({seeds} seeds):"
    yield f"  100 Hz; {sensor.name}: gyro {sensor.gyro_noise_deg_s_rthz:g} deg/s/rtHz, sampled at"
    yield f"  an instant, steady bias; accelerometer {sensor.accel_noise_ug_rthz:g} ug/rtHz;"
    yield f"  magnetometer {sensor.mag_noise_ut:g} uT rms; field {assumptions.norm_ut:g} uT, dip"
    yield f"  {assumptions.dip_deg:g} deg; {assumptions.run_in_s:g} s of the same motion before the"
    yield "  case begins. eh2_paper, ekf_unit: unit weights, held gyro, and the estimate after a"
    yield "  step compared with the truth before it (..._prompt: with the truth of its own time)."
    for case, rows in found.items():
        yield ""
        yield TITLES[case]
        yield f"{'':18} {'RMS roll/pitch/yaw, deg':25} {'second half':25} min max (a typical run)"
        for name, slide in SLIDES.get(case, {}).items():
            yield _line(f"slides {name.split('_')[0]}", slide.rms_deg, (), slide.min_max_deg)
        for name, row in rows.items():
            yield _line(name, *row)
    for figure, word in (("rms_deg", "RMS"), ("min_max_deg", "min-max")):
        compared = list(comparisons(found, figure))
        outside = _outside(compared)
        yield ""
        yield (
            f"{len(compared) - len(outside)} of the slides' {len(compared)} {word} figures within "
            f"a factor {WITHIN}"
        )
        yield from (f"  {line}" for line in outside)


def _line(
    name: str,
    rms: Iterable[float],
    late: Iterable[float],
    extremes: Iterable[Iterable[float]],
) -> str:
    columns = [" / ".join(f"{x:.4f}" for x in figures) for figures in (rms, late)]
    columns.append(" ".join(f"[{low:.3f} {high:.3f}]" for low, high in extremes))
    return f"{name:18} {columns[0]:25} {columns[1]:25} {columns[2]}"

"""``h2nav evaluate observer``: convergence and noise of the twist observer, by exponent."""

import argparse
import math
import sys
from pathlib import Path
from typing import Any

from h2nav.apps import extras
from h2nav.apps.json_output import print_json
from h2nav.evaluation.observer import figures


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command's arguments."""
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument("--plots", type=Path, metavar="DIR", help="write pictures into DIR")


def run(args: argparse.Namespace) -> int:
    """Runs the trials and prints their figures."""
    if args.plots is not None:
        extras.require("plots", "--plots", "matplotlib.pyplot")
    courses = figures.convergence()
    document = figures.document(courses)
    if args.json:
        print_json(document, indent=1)
    else:
        _print_text(document)
    if args.plots is not None:
        from h2nav.evaluation.observer.pictures import draw

        print(f"wrote {draw(args.plots, courses)}", file=sys.stderr)
    return 0


def _print_text(document: dict[str, Any]) -> None:
    conditions = document["conditions"]
    print(f"convergence: {conditions['convergence']}")
    print(f"noise: {conditions['noise']}")
    print("   a1   time to bias error 1e-2 / 1e-4 / 1e-6 s   bias rms rad/s, m/s")
    for a1, row in document["a1"].items():
        times = [row[f"time_to_1e-{digit}_s"] for digit in (2, 4, 6)]
        shown = " / ".join(f"{t:5.2f}" if math.isfinite(t) else "never" for t in times)
        noise = f"{row['bias_rms_noisy_rad_s']:.5f}, {row['bias_rms_noisy_m_s']:.5f}"
        print(f"  {a1:>4}   {shown:>30}               {noise}")
    print(f"vision: {conditions['vision']}; rms per axis")
    print("   a1   bias rad/s, m/s     attitude rad, position m   (without noise: bias)")
    for a1, row in document["vision"].items():
        print(
            f"  {a1:>4}   {row['noisy_bias_rms_rad_s']:.5f}, {row['noisy_bias_rms_m_s']:.5f}   "
            f"{row['noisy_attitude_rms_rad']:.5f}, {row['noisy_position_rms_m']:.5f}           "
            f"{row['noise_free_bias_rms_rad_s']:.1e}, {row['noise_free_bias_rms_m_s']:.1e}"
        )

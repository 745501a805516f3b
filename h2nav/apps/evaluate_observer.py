"""``h2nav evaluate observer``: convergence and noise of the twist observer, by exponent."""

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from h2nav.apps import extras
from h2nav.apps.json_output import print_json

if TYPE_CHECKING:
    from h2nav.motion.observer_trials import Course

EXPONENTS = (1.0, 0.9, 0.8, 0.75, 0.6)
VISION_EXPONENTS = (1.0, 0.9, 0.85, 0.75)
NOISE_SETTLED_S = 30.0
VISION_SETTLED_S = 20.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command's arguments."""
    parser.add_argument("--json", action="store_true", help="one JSON document on standard output")
    parser.add_argument("--plots", type=Path, metavar="DIR", help="write pictures into DIR")


def run(args: argparse.Namespace) -> int:
    """Runs the trials and prints their figures."""
    if args.plots is not None:
        extras.require("plots", "--plots", "matplotlib.pyplot")
    courses = {a1: _convergence(a1) for a1 in EXPONENTS}
    document = {
        "conditions": CONDITIONS,
        "a1": {str(a1): {**_times(courses[a1]), **_noise(a1)} for a1 in EXPONENTS},
        "vision": {str(a1): _vision(a1) for a1 in VISION_EXPONENTS},
    }
    if args.json:
        print_json(document, indent=1)
    else:
        _print_text(document)
    if args.plots is not None:
        print(f"wrote {_plot(args.plots, courses)}", file=sys.stderr)
    return 0


CONDITIONS = {
    "convergence": "start 170 deg and 3 m off, k = 4, 4, a pose with each sample, 500 Hz, no noise",
    "noise": "pose noise 2 mrad and 5 mm per axis at 200 Hz, k = 2, 1; rms per axis after 30 s",
    "vision": "30 Hz, 50 ms late, 10 % lost, 2 mrad and 5 mm, IMU at 300 Hz, k = 3, 3, from the "
    "first pose; after 20 s",
}


def _convergence(a1: float) -> "Course":
    from h2nav.motion.finite_time import FiniteTimeGains
    from h2nav.motion.observer_trials import Trial, run

    return run(Trial(FiniteTimeGains(4.0, 4.0, a1), 18.0, imu_hz=500.0))


def _times(course: "Course") -> dict[str, float | None]:
    from h2nav.motion.observer_trials import time_to

    keys = {"time_to_1e-2_s": 1e-2, "time_to_1e-4_s": 1e-4, "time_to_1e-6_s": 1e-6}
    times = {key: time_to(course, threshold) for key, threshold in keys.items()}
    return {key: t_s if math.isfinite(t_s) else None for key, t_s in times.items()}


def _noise(a1: float) -> dict[str, float]:
    from h2nav.motion.finite_time import FiniteTimeGains
    from h2nav.motion.observer_trials import Trial, rms_after, run

    gains = FiniteTimeGains(2.0, 1.0, a1)
    trial = Trial(
        gains, 60.0, imu_hz=200.0, sigma_r_rad=2e-3, sigma_p_m=5e-3, starts_off=False, seed=1
    )
    course = run(trial)
    return {
        "bias_rms_noisy": rms_after(course.bias, course.t_s, NOISE_SETTLED_S) / math.sqrt(6.0),
        "bias_rms_noisy_rad_s": rms_after(course.bias_w, course.t_s, NOISE_SETTLED_S)
        / math.sqrt(3.0),
        "bias_rms_noisy_m_s": rms_after(course.bias_v, course.t_s, NOISE_SETTLED_S)
        / math.sqrt(3.0),
    }


def _vision(a1: float) -> dict[str, float | None]:
    from h2nav.motion.finite_time import FiniteTimeGains
    from h2nav.motion.observer_trials import Trial, rms_after, run, time_to

    figures: dict[str, float | None] = {}
    for name, noise in (("noisy", 1.0), ("noise_free", 0.0)):
        trial = Trial(
            FiniteTimeGains(3.0, 3.0, a1),
            40.0,
            imu_hz=300.0,
            imu_per_pose=10,
            delay_samples=15,
            drop_share=0.1,
            sigma_r_rad=2e-3 * noise,
            sigma_p_m=5e-3 * noise,
            starts_off=False,
            seed=2,
        )
        course = run(trial)
        for key, values in (
            ("bias_rms_rad_s", course.bias_w),
            ("bias_rms_m_s", course.bias_v),
            ("attitude_rms_rad", course.attitude),
            ("position_rms_m", course.position),
        ):
            rms = rms_after(values, course.t_s, VISION_SETTLED_S) / math.sqrt(3.0)
            figures[f"{name}_{key}"] = rms
        t_s = time_to(course, 0.02)
        figures[f"{name}_time_to_2e-2_s"] = t_s if math.isfinite(t_s) else None
    return figures


def _print_text(document: dict[str, Any]) -> None:
    print(f"convergence: {CONDITIONS['convergence']}")
    print(f"noise: {CONDITIONS['noise']}")
    print("   a1   time to bias error 1e-2 / 1e-4 / 1e-6 s   bias rms rad/s, m/s")
    for a1, row in document["a1"].items():
        times = [row[f"time_to_1e-{digit}_s"] for digit in (2, 4, 6)]
        shown = " / ".join("never" if t is None else f"{t:5.2f}" for t in times)
        noise = f"{row['bias_rms_noisy_rad_s']:.5f}, {row['bias_rms_noisy_m_s']:.5f}"
        print(f"  {a1:>4}   {shown:>30}               {noise}")
    print(f"vision: {CONDITIONS['vision']}; rms per axis")
    print("   a1   bias rad/s, m/s     attitude rad, position m   (without noise: bias)")
    for a1, row in document["vision"].items():
        print(
            f"  {a1:>4}   {row['noisy_bias_rms_rad_s']:.5f}, {row['noisy_bias_rms_m_s']:.5f}   "
            f"{row['noisy_attitude_rms_rad']:.5f}, {row['noisy_position_rms_m']:.5f}           "
            f"{row['noise_free_bias_rms_rad_s']:.1e}, {row['noise_free_bias_rms_m_s']:.1e}"
        )


def _plot(folder: Path, courses: "dict[float, Course]") -> Path:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    folder.mkdir(parents=True, exist_ok=True)
    figure, ax = pyplot.subplots(figsize=(8, 5), layout="constrained")
    for a1, course in courses.items():
        label = f"a1 = {a1:g}" + (" (linear)" if a1 == 1.0 else "")
        ax.semilogy(course.t_s, course.bias, label=label)
    ax.set_xlim(0.0, 16.0)
    ax.set_ylim(1e-10, 30.0)
    ax.set_xlabel("time [s]")
    ax.set_ylabel("bias error [rad/s and m/s, six axes]")
    ax.set_title("Twist observer: start 170 deg and 3 m off, k = 4, 4")
    ax.grid(alpha=0.3)
    ax.legend()
    path = folder / "observer_convergence.png"
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
    return path

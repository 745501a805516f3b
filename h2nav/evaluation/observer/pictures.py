"""The picture of `h2nav evaluate observer --plots`."""

from pathlib import Path

from h2nav.calibration import pictures
from h2nav.evaluation.observer.trials import Course


def draw(folder: Path, courses: dict[float, Course]) -> Path:
    """Writes the bias errors of `figures.convergence` over time."""
    folder.mkdir(parents=True, exist_ok=True)
    figure, ax = pictures.pyplot().subplots(figsize=(8, 5), layout="constrained")
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
    pictures.save(figure, path)
    return path

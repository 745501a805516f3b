"""One picture per run of `h2nav evaluate dataset --plots`: errors, bias, gain set, gate."""

from pathlib import Path
from typing import Any

import numpy as np

from h2nav.calibration import pictures
from h2nav.evaluation.dataset.filters import FilterTrack
from h2nav.maths.attitude_errors import AttitudeErrors
from h2nav.recordings.trials import Trial


def draw(trial: Trial, track: FilterTrack, found: AttitudeErrors, path: Path) -> None:
    """Writes the picture of one filter on one trial."""
    t_s = trial.t_us * 1e-6
    figure, axes = pictures.pyplot().subplots(
        4, 1, sharex=True, figsize=(10, 10), layout="constrained"
    )
    for label, values in (("heading", found.heading), ("inclination", found.inclination)):
        axes[0].plot(t_s, np.where(trial.mask, values, np.nan), label=label, linewidth=0.8)
    axes[0].set_ylabel("error, deg")
    axes[0].legend(loc="upper right")
    if track.bias is not None:
        axes[1].plot(t_s, np.degrees(track.bias), linewidth=0.8)
        axes[1].legend(["x", "y", "z"], loc="upper right")
    axes[1].set_ylabel("gyro bias, deg/s")
    if track.gain_set is not None:
        axes[2].plot(t_s, track.gain_set, linewidth=0.8)
    axes[2].set_ylabel("gain set")
    if track.field_used is not None and trial.m_s is not None:
        _gate(axes[3], t_s, trial, track)
    axes[3].set_ylabel("field believed")
    axes[3].set_xlabel("s")
    axes[0].set_title(f"{trial.name}: {path.stem.removeprefix(trial.name + '.')}")
    pictures.save(figure, path)


def _gate(axis: Any, t_s: Any, trial: Trial, track: FilterTrack) -> None:
    """Share of the field's samples that passed the gate, over one second."""
    assert track.field_used is not None
    width = max(1, round(trial.rate_hz))
    share = np.convolve(track.field_used, np.ones(width) / width, mode="same")
    axis.plot(t_s, share, linewidth=0.8)
    axis.set_ylim(-0.05, 1.05)

"""Trials from the inputs of the service's filter in a recording.

Message, times, checks, velocities, vehicle state and earth field are those of the daemon. The truth
is SIMSTATE or otherwise ATTITUDE, which is only another estimate; both from true north.
"""

from pathlib import Path

import numpy as np

from h2nav.attitude.filter import LastingInput
from h2nav.attitude.samples import EarthField
from h2nav.errors import BadInput
from h2nav.maths.rows import enu_from_ned, from_euler
from h2nav.recordings.listener import Listener, Stretch
from h2nav.recordings.reference import Pairs, Reference
from h2nav.recordings.trials import FilterInput, Trial, usual_rate_hz

MIN_SAMPLES = 2


def trial_of(path: Path, listener: Listener, reference: Reference) -> Trial:
    """The longest recorded stretch as a trial.

    Args:
        path: the recording, for names and messages.

    Raises:
        BadInput: the service passed no samples.
    """
    stretch = max(listener.stretches, key=len)
    samples = stretch.samples
    if len(stretch) < MIN_SAMPLES:
        raise BadInput(f"{path}: no IMU samples of a known autopilot in it")
    boot_us = samples.t_us
    start_us = int(boot_us[0])
    pairs = reference.pairs(stretch.arrived_us, boot_us)
    fields = samples.mag
    q_es = np.full((len(stretch), 4), np.nan)
    q_es[pairs.rows] = enu_from_ned(from_euler(pairs.angles))
    known = [given.what for given in stretch.inputs if isinstance(given.what, EarthField)]
    return Trial(
        name=path.stem,
        rate_hz=usual_rate_hz(boot_us),
        t_us=boot_us - start_us,
        w_s=samples.gyr,
        f_s=samples.acc,
        m_s=None if np.isnan(fields).all() else fields,
        q_es=q_es if len(pairs.rows) else None,
        mask=np.isfinite(q_es[:, 0]),
        heading_fixed=True,
        gps=None,
        clipped=samples.clipped if samples.clipped.any() else None,
        inputs=tuple(_on_clock_of_trial(given, start_us) for given in stretch.inputs),
        declination_rad=known[-1].declination_rad if known else 0.0,
        notes=tuple(_notes(listener, stretch, pairs)),
    )


def _on_clock_of_trial(given: FilterInput, start_us: int) -> FilterInput:
    if isinstance(given.what, LastingInput):
        return given
    return given._replace(what=given.what._replace(t_us=given.what.t_us - start_us))


def _notes(listener: Listener, stretch: Stretch, pairs: Pairs) -> list[str]:
    """Limits on the meaning of the trial's errors."""
    notes = [f"against {pairs.reference}"] if pairs.reference else []
    if pairs.reference == "ATTITUDE":
        notes = ["against ATTITUDE, the autopilot's own estimate: no truth"]
    if not any(isinstance(given.what, EarthField) for given in stretch.inputs):
        notes.append("no position, so no declination: our headings are against magnetic north")
    used = [len(found) for found in listener.stretches if len(found)]
    if len(used) > 1:
        notes.append(
            f"the autopilot's clock began anew {len(used) - 1} times; the longest stretch, "
            f"{len(stretch)} of {sum(used)} samples, is scored"
        )
    return notes

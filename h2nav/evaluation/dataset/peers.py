"""Third-party filters on the same samples, each only where its package is installed.

All use the sample times if they can (vqf takes one rate) and hold the last field, as designed;
their headings are rotated to true north where the trial has a declination. Note that ahrs' Kalman
filter wants the opposite of the accelerometer.
"""

import importlib
import importlib.util
import time
from collections.abc import Callable

import numpy as np

from h2nav.attitude import alignment
from h2nav.errors import TaskFailed
from h2nav.evaluation import imufusion
from h2nav.evaluation.dataset import filters as ours
from h2nav.evaluation.dataset.filters import Conditions, FilterTrack, held
from h2nav.maths.rows import Array, enu_from_ned, ned_from_nwu
from h2nav.recordings.trials import Trial

# The names of the velocity-aided filter among all, which readers of results know.
RECOMMENDED = {"default": "velocity_aided", "default_fixed": "velocity_aided_integer"}
# Filter -> its smoother.
SMOOTHED = {
    "default": "default_smoothed",
    "default_fixed": "default_fixed_smoothed",
    "velocity_aided": "velocity_aided_smoothed",
    "velocity_aided_integer": "velocity_aided_integer_smoothed",
    "vqf": "vqf_offline",
}
Runner = Callable[[Trial, Conditions], FilterTrack]
# Filter -> extra and module that it needs beyond the base.
NEEDS = {
    "paper": ("synthesis", "scipy.linalg"),
    "vqf": ("peers", "vqf"),
    "vqf_offline": ("peers", "vqf"),
    "imufusion": ("peers", "imufusion"),
    "ahrs.madgwick": ("peers", "ahrs"),
    "ahrs.ekf": ("peers", "ahrs"),
}


def installed() -> dict[str, Runner]:
    """Name -> filter, those of h2nav first; without those whose package is missing."""
    peers = {
        "vqf": _vqf, "imufusion": _imufusion, "ahrs.madgwick": _madgwick, "ahrs.ekf": _ekf,
        "vqf_offline": _vqf_offline,
    }  # fmt: skip
    runners: dict[str, Runner] = {
        "velocity_aided": ours.run_velocity_aided,
        "velocity_aided_integer": ours.run_velocity_aided_integer,
        "paper": ours.run_paper,
        "velocity_aided_smoothed": ours.smooth_velocity_aided,
        "velocity_aided_integer_smoothed": ours.smooth_velocity_aided_integer,
        **{name: _guarded(name, runner) for name, runner in peers.items()},
    }
    named = {name: runners[filter_name] for name, filter_name in RECOMMENDED.items()}
    named |= {
        SMOOTHED[name]: runners[SMOOTHED[filter_name]] for name, filter_name in RECOMMENDED.items()
    }
    return {name: run for name, run in (named | runners).items() if _is_installed(name)}


def _is_installed(name: str) -> bool:
    if name not in NEEDS:
        return True
    package = NEEDS[name][1].partition(".")[0]
    return importlib.util.find_spec(package) is not None


def _guarded(name: str, runner: Runner) -> Runner:
    """Makes an exception of a third-party filter fail one trial only."""

    def run(trial: Trial, conditions: Conditions) -> FilterTrack:
        try:
            track = runner(trial, conditions)
        except (ValueError, TypeError, ArithmeticError) as error:
            raise TaskFailed(f"{name} failed: {error}") from error
        return track._replace(q_es=ours.to_true_north(track.q_es, trial.declination_rad))

    return run


def _vqf(trial: Trial, _: Conditions) -> FilterTrack:
    vqf = importlib.import_module("vqf")
    return _run_vqf(trial, vqf.VQF(1.0 / trial.rate_hz).updateBatch)


def _vqf_offline(trial: Trial, _: Conditions) -> FilterTrack:
    vqf = importlib.import_module("vqf")

    def run(rates: Array, forces: Array, fields: Array | None = None) -> dict[str, Array]:
        found: dict[str, Array] = vqf.offlineVQF(rates, forces, fields, 1.0 / trial.rate_hz)
        return found

    return _run_vqf(trial, run)


def _run_vqf(trial: Trial, run: Callable[..., dict[str, Array]]) -> FilterTrack:
    """One of its variants, which take the whole recording."""
    arrays = [np.ascontiguousarray(trial.w_s), np.ascontiguousarray(trial.f_s)]
    if trial.m_s is not None:
        arrays.append(np.ascontiguousarray(held(trial.m_s)))
    started = time.process_time()
    out = run(*arrays)
    us_per_sample = (time.process_time() - started) * 1e6 / len(trial.w_s)
    q_es = out["quat9D" if trial.m_s is not None else "quat6D"]
    return FilterTrack(q_es, us_per_sample, "native", np.asarray(out["bias"]))


def _imufusion(trial: Trial, _: Conditions) -> FilterTrack:
    fields = None if trial.m_s is None else held(trial.m_s)
    started = time.process_time()
    # By default it starts level, and needs 20 s to turn sensor axes that point down.
    q_ns = imufusion.attitudes(trial.w_s, trial.f_s, fields, _steps_s(trial), _start_nwu(trial))
    us_per_sample = (time.process_time() - started) * 1e6 / len(q_ns)
    return FilterTrack(enu_from_ned(q_ns), us_per_sample, "native, called per sample")


def _madgwick(trial: Trial, _: Conditions) -> FilterTrack:
    filters = importlib.import_module("ahrs.filters")
    q_nwu = np.empty((len(trial.w_s), 4))
    q_nwu[0] = _start_nwu(trial)
    steps_s = _steps_s(trial)
    fields = None if trial.m_s is None else held(trial.m_s)
    chosen = filters.Madgwick(frequency=trial.rate_hz, gain=0.033 if fields is None else 0.041)
    started = time.process_time()
    for k in range(1, len(q_nwu)):
        sample = {"gyr": trial.w_s[k], "acc": trial.f_s[k], "dt": steps_s[k]}
        if fields is None:
            q_nwu[k] = chosen.updateIMU(q_nwu[k - 1], **sample)
        else:
            q_nwu[k] = chosen.updateMARG(q_nwu[k - 1], mag=fields[k], **sample)
    us_per_sample = (time.process_time() - started) * 1e6 / len(q_nwu)
    return FilterTrack(enu_from_ned(ned_from_nwu(q_nwu)), us_per_sample, "python")


def _ekf(trial: Trial, _: Conditions) -> FilterTrack:
    filters = importlib.import_module("ahrs.filters")
    if trial.m_s is None:
        raise TaskFailed(f"{trial.name}: ahrs.ekf is run with a magnetometer only")
    fields = held(trial.m_s)
    # It corrects towards the reference of the given dip; the first sample's dip is used.
    down = -trial.f_s[0] / np.linalg.norm(trial.f_s[0])
    dip_deg = float(np.degrees(np.arcsin(np.dot(down, fields[0]) / np.linalg.norm(fields[0]))))
    chosen = filters.EKF(frequency=trial.rate_hz, frame="NED", magnetic_ref=dip_deg)
    # Its own `h` requires this when it is fed sample by sample.
    chosen.mag = fields
    q_ns = np.empty((len(fields), 4))
    steps_s = _steps_s(trial)
    q_ns[0] = alignment.triad(tuple(trial.f_s[0]), tuple(fields[0]))
    started = time.process_time()
    for k in range(1, len(q_ns)):
        q_ns[k] = chosen.update(q_ns[k - 1], trial.w_s[k], -trial.f_s[k], fields[k], steps_s[k])
    us_per_sample = (time.process_time() - started) * 1e6 / len(q_ns)
    return FilterTrack(enu_from_ned(q_ns), us_per_sample, "python")


def _steps_s(trial: Trial) -> list[float]:
    """The time before each sample, s; before the first one a usual step."""
    first_us = trial.t_us[0] - 1e6 / trial.rate_hz
    steps: list[float] = (np.diff(trial.t_us, prepend=first_us) * 1e-6).tolist()
    return steps


def _start_nwu(trial: Trial) -> Array:
    """The first samples' attitude against north-west-up."""
    field = None if trial.m_s is None else tuple(held(trial.m_s)[0])
    first = int(np.argmax(np.abs(trial.f_s).sum(axis=1) > 0.0))
    start: Array = ned_from_nwu(np.array([alignment.triad(tuple(trial.f_s[first]), field)]))[0]
    return start

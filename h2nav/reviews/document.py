"""The review as one JSON document with every figure in the page's text."""

import math
from datetime import UTC, datetime
from typing import Any

import numpy as np

from h2nav.airframes.trend import Departure
from h2nav.integrity.findings import Finding, as_mapping
from h2nav.maths.units import DEG
from h2nav.recordings.context import Array, Span
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.causes import first_causes
from h2nav.reviews.certainty import GROUPS, aids, covered_s
from h2nav.reviews.chain import chain
from h2nav.reviews.comparison import Difference, differences
from h2nav.reviews.flight import Estimates, Flight
from h2nav.reviews.last_seconds import BeforeCrash, Crash, last_seconds
from h2nav.reviews.parameters import in_order
from h2nav.reviews.subjects import KINDS
from h2nav.reviews.tracks import CompassFit, Receiver, Spectrum, TimingTrack
from h2nav.reviews.verdict import verdict

FORMAT = 1
# Of docs/schema/review.json: increases with new keys; keys are never renamed or removed.
SCHEMA = 2
DIGITS = 6  # significant ones; a file may hold more than any sensor provides
MAX_TEXTS = 500


def document(flight: Flight, analysis: Analysis) -> dict[str, Any]:
    """Everything that the page says in words, for programs.

    Returns:
        A JSON document; unknown figures are null.
    """
    context = flight.context
    start = context.start_unix_s
    apart = differences(flight)
    links = chain(flight, analysis)
    first = first_causes(links.findings)
    summed_up = verdict(flight, analysis, links)
    found = {
        "format": FORMAT,
        "schema": SCHEMA,
        "verdict": summed_up.text,
        "headline": summed_up.headline,
        "name": flight.name,
        "file": flight.file,
        "kind": flight.kind,
        "vehicle": context.vehicle,
        "firmware": context.firmware,
        "autopilot": flight.autopilot,
        "start_utc": None if start is None else _date(start),
        "duration_s": context.duration_s,
        "findings": [
            _finding(one, first[one.id], is_own=one.id in links.own) for one in links.findings
        ],
        "crashes": [_crash(one) for one in last_seconds(flight, links.findings, analysis.impacts)],
        "looked_at": list(summed_up.looked_at),
        "not_looked_at": list(summed_up.missing),
        "checked": _checked(flight, analysis, apart),
        "missing": list(context.missing),
        "why_no_estimate": flight.why_no_estimate or None,
        "certainty": _certainty(flight),
        "differences": [_difference(one) for one in apart],
        "spans": {
            "modes": _spans(context.modes),
            "armed": _spans(context.armed),
            "autopilot_estimators": _spans(context.primary),
            "states": _spans(flight.states),
            "lanes": _spans(flight.lanes),
            "held_by": _spans(flight.held),
        },
        "imu_message": flight.imu_message or None,
        "imus": _imus(analysis),
        "spectra": [_spectrum(one) for one in analysis.spectra],
        "compasses": [_compass(one) for one in analysis.compasses],
        "receivers": [_receiver(one) for one in analysis.receivers],
        "airframe": {
            "id": analysis.row.airframe or None,
            "uid": context.uid or None,
            "board": context.board or None,
            "system_id": context.system_id or None,
        },
        "flown": {
            "flown_s": analysis.row.flown_s,
            "distance_m": analysis.row.distance_m,
            "landings": analysis.row.landings,
            "hard_landings": analysis.row.hard_landings,
        },
        "features": dict(analysis.row.features),
        "trends": [_trend(one) for one in analysis.trends],
        "notices": [
            {"t_s": t_s, "severity": severity, "text": text}
            for t_s, severity, text in flight.notices[:MAX_TEXTS]
        ],
        "said": [
            {"t_s": said.t_s, "severity": said.severity.word, "text": said.text}
            for said in context.said[:MAX_TEXTS]
        ],
        "rejected": dict(flight.rejected),
        "damaged": dict(context.notes),
    }
    plain: dict[str, Any] = _plain(found)
    # The digits of these are bounded already.
    plain["parameters"] = in_order(context.parameters)
    return plain


def _finding(finding: Finding, first_cause: str | None, *, is_own: bool) -> dict[str, object]:
    of_kind = KINDS[finding.kind].meaning
    return {
        **as_mapping(finding),
        "consequence_of": first_cause,
        "about": "h2nav" if is_own else "vehicle",
        "means": of_kind.means,
        "check": of_kind.check,
    }


def _crash(crash: Crash) -> dict[str, object]:
    return {
        **{key: value for key, value in crash._asdict().items() if key != "sticks"},
        "sticks_percent": {axis: 100.0 * share for axis, share in crash.sticks.items()},
        "before": [_moment(one) for one in crash.before],
    }


def _moment(one: BeforeCrash) -> dict[str, object]:
    return {
        "before_s": one.before_s,
        "height_m": one.height_m,
        "climb_m_s": one.climb_m_s,
        "ground_speed_m_s": one.ground_speed_m_s,
        "roll_deg": one.roll_rad / DEG,
        "pitch_deg": one.pitch_rad / DEG,
        "demanded_roll_deg": one.demanded_roll_rad / DEG,
        "demanded_pitch_deg": one.demanded_pitch_rad / DEG,
        "motors_percent": [100.0 * share for share in one.motors],
    }


def _date(unix_s: float) -> str | None:
    try:
        return datetime.fromtimestamp(unix_s, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (OverflowError, ValueError, OSError):
        return None


def _checked(
    flight: Flight, analysis: Analysis, apart: tuple[Difference, ...]
) -> list[dict[str, object]]:
    """The examined subjects and their durations; None for the whole recording."""
    texts = {
        "velocity": "our attitude against the GPS velocity",
        "force": "our attitude against gravity",
        "field": "the compass against the earth's field",
        "turn": "the gyro against the compass",
    }
    checked: list[dict[str, object]] = [
        {"what": texts[group], "for_s": covered_s(spans)}
        for group, spans in aids(flight).items()
        if spans
    ]
    names = [one.name for one in apart if not one.is_truth]
    if names:
        checked.append({"what": f"attitude of {', '.join(names)} against ours", "for_s": None})
    for what, tracks in (
        ("vibration and clipping of the accelerometers", analysis.vibrations),
        ("vibration by frequency", analysis.spectra),
        ("gyro and accelerometer bias", analysis.biases),
        ("rates and gaps of the samples", analysis.timings),
        ("calibration of the compasses", analysis.compasses),
        ("GPS against inertial motion", analysis.receivers),
    ):
        if tracks:
            checked.append({"what": what, "for_s": None})
    return checked


def _certainty(flight: Flight) -> dict[str, object]:
    duration_s = flight.context.duration_s or math.nan
    in_state: dict[str, float] = {}
    for span in flight.states:
        in_state[span.name] = in_state.get(span.name, 0.0) + span.to_s - span.from_s
    return {
        "h2nav": _deviations(flight.estimates, flight),
        "smoothed": _deviations(flight.smoothed, flight),
        "tested": {
            GROUPS[group]: {
                "share_percent": 100.0 * covered_s(spans) / duration_s,
                "spans": _spans(spans),
            }
            for group, spans in aids(flight).items()
        },
        "states_s": in_state,
    }


def _deviations(ours: Estimates | None, flight: Flight) -> dict[str, object] | None:
    """One standard deviation while armed, or over the recording if it never was."""
    if ours is None or len(ours.t_s) == 0:
        return None
    is_counted = np.ones(len(ours.t_s), bool)
    if flight.context.armed:
        is_counted = np.zeros(len(ours.t_s), bool)
        for span in flight.context.armed:
            is_counted |= (ours.t_s >= span.from_s) & (ours.t_s <= span.to_s)
    return {
        part: {
            "median_deg": _median(sigma[is_counted]) / DEG,
            "largest_deg": _largest(sigma[is_counted]) / DEG,
            "last_deg": float((sigma[is_counted] if is_counted.any() else sigma)[-1]) / DEG,
        }
        for part, sigma in (("tilt", ours.sigma_tilt_rad), ("heading", ours.sigma_heading_rad))
    }


def _difference(one: Difference) -> dict[str, object]:
    return {
        "name": one.name,
        "is_truth": one.is_truth,
        "tilt": _apart(one.tilt_rad, one.tilt_limit_rad),
        "heading": _apart(np.abs(one.heading_rad), one.heading_limit_rad),
    }


def _apart(size_rad: Array, limit_rad: Array) -> dict[str, float]:
    is_tested = np.isfinite(size_rad) & np.isfinite(limit_rad)
    beyond = np.count_nonzero(size_rad[is_tested] > limit_rad[is_tested])
    return {
        "median_deg": _median(size_rad) / DEG,
        "p95_deg": _percentile(size_rad, 95.0) / DEG,
        "largest_deg": _largest(size_rad) / DEG,
        "beyond_limit_percent": 100.0 * beyond / np.count_nonzero(is_tested)
        if is_tested.any()
        else math.nan,
    }


def _imus(analysis: Analysis) -> list[dict[str, object]]:
    timings = {one.imu: one for one in analysis.timings}
    vibrations = {one.imu: one for one in analysis.vibrations}
    biases = {one.imu: one for one in analysis.biases}
    found = []
    for imu in sorted({*timings, *vibrations, *biases}):
        row: dict[str, object] = {"imu": imu + 1}
        if imu in timings:
            row |= _timing(timings[imu])
        if imu in vibrations:
            vibration = vibrations[imu]
            row["vibration_largest_m_s2"] = _largest(vibration.level)
            row["vibration_limit_m_s2"] = vibration.limit
            row["clipped_samples"] = vibration.clipped
        if imu in biases:
            bias = biases[imu]
            norm = np.linalg.norm(bias.gyro_b, axis=1)
            row["gyro_bias_median_deg_s"] = [_median(axis) / DEG for axis in bias.gyro_b.T]
            row["gyro_bias_largest_deg_s"] = _largest(norm) / DEG
            row["gyro_bias_limit_deg_s"] = bias.gyro_limit / DEG
            row["force_at_rest_m_s2"] = _median(bias.force_norm)
        found.append(row)
    return found


def _timing(one: TimingTrack) -> dict[str, object]:
    return {
        "message": one.source,
        "rate_hz": _median(one.rate_hz),
        "longest_gap_s": _largest(one.longest_s),
        "latest_s": _largest(one.lateness_s),
    }


def _spectrum(one: Spectrum) -> dict[str, object]:
    return {
        "imu": one.imu + 1,
        "sensor": one.sensor,
        "unit": one.unit,
        "rate_hz": one.rate_hz,
        "is_burst": one.is_burst,
        "peaks": [peak._asdict() for peak in one.peaks],
    }


def _compass(one: CompassFit) -> dict[str, object]:
    return {
        "compass": one.compass + 1,
        "heading_deg": one.heading_rad / DEG,
        "residual_ut": one.residual_ut,
        "fitted_ut": one.fitted_ut,
        "heading_error_deg": one.heading_error_rad / DEG,
        "offset_b_ut": one.offset_b_ut,
        "scale": one.scale,
        "throttle_percent": 100.0 * one.throttle,
        "motor_ut": one.motor_ut,
        "motor_b_ut": one.motor_b_ut,
    }


def _receiver(one: Receiver) -> dict[str, object]:
    norm = np.linalg.norm(one.difference_n, axis=1)
    return {
        "receiver": one.receiver + 1,
        "velocity_difference_median_m_s": _median(norm),
        "velocity_difference_largest_m_s": _largest(norm),
        "position_difference_largest_m": _largest(one.position_m),
        "accuracy_median_m_s": _median(one.sigma_m_s),
        "fewest_satellites": -_largest(-one.satellites),
        "lag_s": one.lag_s,
    }


def _trend(one: Departure) -> dict[str, object]:
    found = one._asdict()
    return {"kind": "drift" if found.pop("is_drift") else "step", **found}


def _spans(spans: tuple[Span, ...]) -> list[dict[str, object]]:
    return [span._asdict() for span in spans]


def _percentile(values: Array, share: float) -> float:
    known = values[np.isfinite(values)]
    return float(np.percentile(known, share)) if known.size else math.nan


def _median(values: Array) -> float:
    return _percentile(values, 50.0)


def _largest(values: Array) -> float:
    return _percentile(values, 100.0)


def _plain(value: Any) -> Any:
    """Converts to JSON's own types, with a bounded number of digits and null for NaN."""
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    if isinstance(value, np.integer | np.bool_):
        return value.item()
    return value

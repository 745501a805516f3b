"""Calibrates a compass: offset, matrix, motors, rotation; and whether the flights show them.

A model with more parameters is used only if the data demand it: its parameters are significant,
also by the information criterion, and explain a relevant part of data that they were not fitted
to, every second block of 20 s. What a flight does not show stays as it is.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.calibration import rotations
from h2nav.calibration.evidence import PX4, Evidence
from h2nav.calibration.field_fit import (
    COUNT,
    MATRIX,
    MOTOR,
    NONE,
    OFFSET,
    SCALE,
    SOFT,
    FieldCorrection,
    FieldFit,
    FieldRows,
    Mask,
    correction,
    fitted,
    headed,
    weighted_rms,
)
from h2nav.calibration.field_rows import (
    ROW_S,
    field_rows,
    headings_flown,
    lever_of,
    widest_gap_deg,
)
from h2nav.calibration.outcome import Outcome, ParameterChange
from h2nav.calibration.regression import Array, part_of, together
from h2nav.calibration.settings import (
    CompassSettings,
    Lever,
    Parameters,
    ardupilot_compass,
    ardupilot_values,
    px4_compass,
    px4_values,
)
from h2nav.maths.units import DEG, MG_PER_UT

MIN_ROWS = 50
# Of a scale with soft iron, which firmwares limit to some tens of percent.
MAX_CONDITION = 100.0
# More than an offset requires 15 s of each half of the blocks.
MIN_RICH_ROWS = 75
# Half a circle of headings determines its centre.
WIDEST_GAP_DEG = 180.0
# A working compass follows the turns: this share of the change of the earth's field in the body.
MOVES_UT, FOLLOWS = 5.0, 0.3
# Below the resolution of the finest compass (RM3100, 0.013 uT).
STILL_UT = 0.01
# Significant: this many deviations, all parameters of a kind together; relevant: this share of the
# earth's field, 10 mG or one degree of heading; better: this much smaller residuals elsewhere, by
# more than what half a degree of tilt does.
SURE, RELEVANT, BETTER, EXPLAINS = 5.0, 0.02, 0.95, 0.01
# A flight shows scale or soft iron of an axis if it leaves less than this share of the prior
# deviation.
LEARNT = 0.9
# An axis of an offset is written beside significant ones if it has so many deviations.
AXIS_SURE = 3.0
# A calibration leaves 7 % and 3 deg (integrity.field_windows); rows with more do not fit, and with
# too many of them, or if most leave twice as much, there is no calibration.
LEFT, ROW_LEFT, UNFIT = 0.15, 0.10, 0.4
# A compass with such residuals may be mounted otherwise; another rotation must be this much better,
# and this much better than the next one that is not nearly the same.
TURNED, MUCH_BETTER, CLEARLY, ALIKE_RAD = 0.2, 0.4, 1.5, 20.0 * DEG
SEARCH_ROWS = 300
BLOCK_S = 20.0
# Change of throttle that reveals the motors, between the 5th and the 95th percentile; of current.
THROTTLE_SPREAD, CURRENT_SPREAD_A, KNOWN = 0.15, 2.0, 0.8
TYPICAL = 0.7
SHOWN_BY = (
    "residual {residual_before_mg:.0f} -> {residual_after_mg:.0f} mG rms, "
    "heading {heading_before_deg:.1f} -> {heading_after_deg:.1f} deg rms"
)
FAR_SIGMA_RAD = 20.0 * DEG


class Model(NamedTuple):
    """The parameters to fit."""

    has_matrix: bool = False  # scale and soft iron
    lever: Lever = Lever.NONE  # of the motors

    @property
    def free(self) -> Mask:
        """(12,) the parameters."""
        free = np.zeros(COUNT, dtype=bool)
        free[OFFSET] = True
        free[MATRIX] = self.has_matrix
        free[MOTOR] = self.lever is not Lever.NONE
        return free


class Subject(NamedTuple):
    """A compass to calibrate."""

    name: str  # such as ``compass 1``
    rows: FieldRows  # of all flights
    settings: CompassSettings  # in use; those of a raw one if unknown
    parameters: Parameters  # of the autopilot; empty if unknown
    # converts settings to parameters
    values: Callable[[CompassSettings, Parameters], dict[str, float]]


def calibrate_compass(
    flights: Sequence[Evidence], compass: int, levers: tuple[Lever, ...]
) -> Outcome:
    """Calibrates one compass.

    Args:
        compass: its number, from 0.
    """
    name = f"compass {compass + 1}"
    subject = _subject(flights, compass)
    if isinstance(subject, str):
        return Outcome(name, left=(subject,))
    device = f"{subject.settings.device_id}" if subject.settings.device_id else ""
    reason = _unusable(subject.rows)
    if reason:
        return Outcome(name, device, left=(reason,))
    return _outcome(subject, levers)._replace(device=device)


def _subject(flights: Sequence[Evidence], compass: int) -> Subject | str:
    """The compass in all flights, or why there is none.

    A field whose calibration is unknown counts as raw, unless that of another flight is known: raw
    and calibrated ones have no offset in common.
    """
    found, own = [], flights[-1]
    for number, evidence in enumerate(flights):
        for track in evidence.compasses():
            if track.compass == compass:
                settings = _settings(evidence, compass, track.device_id)
                if settings is not None and _hides(settings.correction.matrix):
                    return "scale and soft iron in use hide a direction of its field: reset them"
                rows = field_rows(evidence, track, settings, number)
                found += [] if rows is None else [(settings, rows)]
    if not found:
        return "no field in flight with a certain tilt and a field model"
    known = [(settings, rows) for settings, rows in found if settings is not None]
    settings = known[-1][0] if known else None
    return Subject(
        f"compass {compass + 1}",
        together([rows for _, rows in known or found]),
        settings or CompassSettings(compass, 0, can_shape=False),
        own.parameters if known else {},
        px4_values if own.autopilot == PX4 else ardupilot_values,
    )


def _hides(matrix: Array) -> bool:
    return bool(np.linalg.cond(matrix) > MAX_CONDITION)


def _settings(evidence: Evidence, compass: int, device_id: int) -> CompassSettings | None:
    if evidence.autopilot == PX4:
        return px4_compass(evidence.parameters, compass, device_id)
    return ardupilot_compass(evidence.parameters, compass)


def _unusable(rows: FieldRows) -> str:
    """Why nothing can be fitted; empty if it can."""
    if len(rows.t_s) < MIN_ROWS:
        return f"only {len(rows.t_s) * ROW_S:.0f} s of usable flight"
    moved, measured = _spread(rows.earth_ut), _spread(rows.raw_ut)
    gap = widest_gap_deg(headings_flown(rows))
    if moved > MOVES_UT and measured < FOLLOWS * moved:
        return "its field does not follow the turns: it is dead, or far too weak"
    if _least_spread(rows.raw_ut) < STILL_UT:
        return "along one direction its field always stays the same: an axis is dead"
    if gap > WIDEST_GAP_DEG:
        return (
            f"no turns: {gap:.0f} deg of heading were not flown, at most {WIDEST_GAP_DEG:.0f} may"
        )
    return ""


def _spread(values: Array) -> float:
    return float(np.linalg.norm(np.std(values, axis=0)))


def _least_spread(values: Array) -> float:
    """The deviation along the direction in which it is least."""
    apart = values - values.mean(axis=0)
    return float(np.linalg.svd(apart, compute_uv=False)[-1]) / math.sqrt(len(values))


# --- which model ------------------------------------------------------------------------------


def _outcome(subject: Subject, levers: tuple[Lever, ...]) -> Outcome:
    rows, settings = subject.rows, subject.settings
    norm = float(np.median(np.linalg.norm(rows.earth_ut, axis=1)))
    before = _with_heading(rows, settings.correction, settings.lever, strays=False)
    original, rotation = rows, _rotation(subject, norm)
    notes: list[str] = []
    if rotation is not None:
        rows, settings, note = _turned(subject, rotation)
        subject = subject._replace(rows=rows, settings=settings)
        notes.append(note)
    model = _chosen(subject, levers, norm)
    fit = _fitted(subject, model)
    # A field that came or went must not be explained by an earth's field and a lean made for it.
    plain = _fitted(subject, model, strays=False)
    left = _left(fit, plain, norm)
    figures = _figures(rows, original, before, fit)
    shown = SHOWN_BY.format(**figures)
    outcome = Outcome(subject.name, notes=tuple(notes), shown=shown, figures=figures)
    return (
        outcome._replace(left=(left,), notes=())
        if left
        else _with_changes(subject, model, fit, outcome)
    )


def _fitted(subject: Subject, model: Model, *, strays: bool = True) -> FieldFit:
    """Fits the model, with the values in use as prior."""
    return _fit_of(subject.rows, subject.settings, model, strays=strays)


def _fit_of(
    rows: FieldRows,
    settings: CompassSettings,
    model: Model,
    free: Mask | None = None,
    *,
    strays: bool = True,
) -> FieldFit:
    lever = model.lever if model.lever is not Lever.NONE else settings.lever
    free = model.free if free is None else free
    return fitted(rows, settings.correction, free, lever_of(rows, lever), strays=strays)


def _with_heading(
    rows: FieldRows, own: FieldCorrection, lever: Lever, *, strays: bool = True
) -> FieldFit:
    """A correction unchanged, with the heading error that fits it best."""
    return fitted(rows, own, np.zeros(COUNT, dtype=bool), lever_of(rows, lever), strays=strays)


def _typical_ut(fit: FieldFit) -> float:
    """The residual that most rows stay below."""
    return float(np.quantile(np.linalg.norm(fit.residual_ut, axis=1), TYPICAL))


def _chosen(subject: Subject, levers: tuple[Lever, ...], norm: float) -> Model:
    """The simplest sufficient model."""
    best = Model()
    if float(np.median(subject.rows.sigma_rad)) > FAR_SIGMA_RAD:
        return best  # errors of such an attitude would become the compass's
    left = _unseen_ut(subject, best)
    candidates: list[Callable[[Model], Model]] = []
    if subject.settings.can_shape:
        candidates.append(lambda model: model._replace(has_matrix=True))
    for lever in levers:
        if subject.parameters and _shows(subject.rows, lever):
            candidates.append(lambda model, lever=lever: model._replace(lever=lever))  # type: ignore[misc]
    for _ in range(2):
        tried = {change(best) for change in candidates} - {best}
        ranked = sorted((_unseen_ut(subject, model), model) for model in tried)
        better = next(
            (
                (unseen, model)
                for unseen, model in ranked
                if unseen < BETTER * left
                and left**2 - unseen**2 > (EXPLAINS * norm) ** 2
                and _matters(subject, best, model, norm)
            ),
            None,
        )
        if better is None:
            break
        left, best = better
    return best


def _shows(rows: FieldRows, lever: Lever) -> bool:
    """Whether the motors' throttle or current changed enough to show its effect."""
    values = rows.throttle if lever is Lever.THROTTLE else rows.current_a
    known = values[np.isfinite(values)]
    if len(known) < KNOWN * len(values):
        return False
    low, high = np.quantile(known, (0.05, 0.95))
    return bool(high - low > (THROTTLE_SPREAD if lever is Lever.THROTTLE else CURRENT_SPREAD_A))


def _unseen_ut(subject: Subject, model: Model) -> float:
    """Residual of rows that the model was not fitted to."""
    rows, settings = subject.rows, subject.settings
    block = _half(rows)
    lever = model.lever if model.lever is not Lever.NONE else settings.lever
    found = []
    for half in (0, 1):
        seen, unseen = part_of(rows, block == half), part_of(rows, block != half)
        least = MIN_ROWS // 2 if model == Model() else MIN_RICH_ROWS
        if min(len(seen.t_s), len(unseen.t_s)) < least:
            return math.inf
        fit = _fit_of(seen, settings, model)
        found.append(_typical_ut(_with_heading(unseen, fit.correction, lever)))
    return max(found)


def _half(rows: FieldRows) -> NDArray[np.intp]:
    """(N,) 0 and 1 in turn, a block each."""
    half: NDArray[np.intp] = np.floor(rows.t_s / BLOCK_S).astype(np.intp) % 2
    return half


def _matters(subject: Subject, simpler: Model, model: Model, norm: float) -> bool:
    """Whether the additional parameters of a model are significant and relevant."""
    fit = _fitted(subject, model)
    change = fit.correction.values - subject.settings.correction.values
    if model.has_matrix and not simpler.has_matrix:
        size = float(np.abs(change[MATRIX]).max())
        return size > RELEVANT and _is_demanded(change, fit, MATRIX)
    lever = lever_of(subject.rows, model.lever)
    size = float(np.linalg.norm(change[MOTOR])) * float(np.ptp(np.quantile(lever, (0.05, 0.95))))
    return size > RELEVANT * norm and _is_demanded(change, fit, MOTOR)


def _is_sure(change: Array, covariance: Array, part: slice, sure: float = SURE) -> bool:
    places = np.arange(COUNT)[part]
    places = places[np.diag(covariance)[places] > 0.0]  # what was fitted
    value = change[places]
    return float(value @ np.linalg.solve(covariance[np.ix_(places, places)], value)) > sure**2


def _is_demanded(change: Array, fit: FieldFit, part: slice) -> bool:
    """Whether parameters are worth their number, by the Bayesian information criterion, too."""
    price = math.sqrt(len(change[part]) * math.log(len(fit.weight)))
    return _is_sure(change, fit.covariance, part, max(SURE, price))


# --- rotation ---------------------------------------------------------------------------------


def _rotation(subject: Subject, norm: float) -> int | None:
    """Number of the rotation that explains what the one in use does not."""
    rows, settings = subject.rows, subject.settings
    plain = Model()
    if _typical_ut(_fit_of(rows, settings, plain)) < TURNED * norm:
        return None
    if float(np.median(rows.sigma_rad)) > FAR_SIGMA_RAD:
        return None  # a turn about the vertical would be part of the heading error
    rows = part_of(rows, np.arange(0, len(rows.t_s), max(1, len(rows.t_s) // SEARCH_ROWS)))
    back = rotations.matrix(settings.rotation or 0).T if settings.can_turn else np.eye(3)
    raw = CompassSettings(settings.slot, 0)
    left = {}
    for number in range(len(rotations.ANGLES_DEG)):
        turned = rows._replace(raw_ut=rows.raw_ut @ (rotations.matrix(number) @ back).T)
        left[number] = _typical_ut(_fit_of(turned, raw, plain))
    best = min(left, key=lambda number: left[number])
    others = [left[n] for n in left if _apart_rad(n, best) > ALIKE_RAD]
    now = min(left[n] for n in left if _apart_rad(n, _in_use(settings)) < ALIKE_RAD)
    is_clear = left[best] < MUCH_BETTER * now and min(others) > CLEARLY * left[best]
    return best if is_clear and _apart_rad(best, _in_use(settings)) > ALIKE_RAD else None


def _in_use(settings: CompassSettings) -> int:
    return settings.rotation or 0 if settings.can_turn else 0


def _apart_rad(one: int, other: int) -> float:
    turn = rotations.matrix(one).T @ rotations.matrix(other)
    return math.acos(min(max((float(np.trace(turn)) - 1.0) / 2.0, -1.0), 1.0))


def _turned(subject: Subject, rotation: int) -> tuple[FieldRows, CompassSettings, str]:
    """Rows and settings as with that rotation, and a note on it."""
    settings, rows = subject.settings, subject.rows
    old = _in_use(settings)
    turn = rotations.matrix(rotation) @ rotations.matrix(old).T
    rows = rows._replace(raw_ut=rows.raw_ut @ turn.T)
    note = f"it lies turned: {rotations.name_of(rotation)}, and not {rotations.name_of(old)}"
    if not subject.parameters:
        note = f"it lies turned against what its rotation says: {rotations.name_of(rotation)}"
    elif not settings.can_turn:
        note += "; an internal compass has no rotation of its own, unless it is called external"
    new = settings._replace(correction=NONE, rotation=rotation if settings.can_turn else old)
    return rows, new, note


# --- words ------------------------------------------------------------------------------------


def _left(fit: FieldFit, plain: FieldFit, norm: float) -> str:
    """Why the best fit is no calibration; empty if it is.

    Args:
        plain: the fit of the same model with earth's field and lean as assumed.
    """
    after = _typical_ut(fit)
    unfit = float((np.linalg.norm(plain.residual_ut, axis=1) > ROW_LEFT * norm).mean())
    if after > LEFT * norm:
        return (
            f"no calibration explains it: {after * MG_PER_UT:.0f} of {norm * MG_PER_UT:.0f} mG "
            "are left"
        )
    if unfit > UNFIT:
        return f"{unfit:.0%} of the flight fit no single calibration: a magnet came or went"
    return ""


def _figures(
    rows: FieldRows, original: FieldRows, before: FieldFit, fit: FieldFit
) -> dict[str, float]:
    weight = fit.weight
    used = weight > 0.5
    low, high = _quantiles(rows.throttle)
    return {
        "residual_before_mg": weighted_rms(before.residual_ut, weight) * MG_PER_UT,
        "residual_after_mg": fit.rms_ut() * MG_PER_UT,
        "heading_before_deg": _heading_rms(original, before, used) / DEG,
        "heading_after_deg": _heading_rms(rows, fit, used) / DEG,
        "field_mg": float(np.median(np.linalg.norm(rows.earth_ut, axis=1))) * MG_PER_UT,
        "used_s": float(used.sum()) * ROW_S,
        "used_share": float(used.mean()),
        "heading_gap_deg": widest_gap_deg(headings_flown(rows)),
        "attitude_heading_sigma_deg": float(np.median(rows.sigma_rad)) / DEG,
        "throttle_low": low,
        "throttle_high": high,
    }


def _quantiles(values: Array) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if not len(known):
        return math.nan, math.nan
    low, high = np.quantile(known, (0.05, 0.95))
    return float(low), float(high)


def _heading_rms(rows: FieldRows, fit: FieldFit, used: Mask) -> float:
    """RMS of the compass's heading against the attitude's own, rad."""
    expected = headed(rows, fit.heading_error_rad)
    field = expected + fit.residual_ut
    across = (np.cross(expected, field) * rows.down).sum(axis=1)
    level = (field * expected).sum(axis=1)
    level -= (field * rows.down).sum(axis=1) * (expected * rows.down).sum(axis=1)
    error = np.arctan2(across, level)[used]
    return math.sqrt(float(np.mean(error**2))) if len(error) else math.nan


def _with_changes(subject: Subject, model: Model, fit: FieldFit, outcome: Outcome) -> Outcome:
    """The significant improvements, as parameters.

    Args:
        outcome: known so far: figures, and a rotation.
    """
    old = subject.settings
    norm = outcome.figures["field_mg"] / MG_PER_UT
    covariance = _with_shape(subject, model, fit)
    if not outcome.notes and subject.parameters:
        change = fit.correction.values - old.correction.values
        hidden = model.free & ~_shown(model, change, covariance, norm)
        fit = _fit_of(subject.rows, old, model, model.free & ~hidden)
        outcome = outcome._replace(left=_hidden(hidden, covariance))
        covariance[hidden, :] = covariance[:, hidden] = 0.0
    change = fit.correction.values - old.correction.values
    size = float(np.linalg.norm(change[OFFSET]))
    is_better = size > RELEVANT * norm and _is_sure(change, covariance, OFFSET)
    if model == Model() and not outcome.notes and not is_better:
        why = f"no change: {size * MG_PER_UT:.0f} mG are insignificant"
        return outcome._replace(left=(why, *outcome.left))
    if not subject.parameters:
        return _to_add(change, covariance, outcome)
    new = old._replace(correction=fit.correction, lever=model.lever or old.lever)
    return outcome._replace(changes=_changes(subject, new, covariance))


def _shown(model: Model, change: Array, covariance: Array, norm: float) -> Mask:
    """(12,) what the flight shows; offsets always with a matrix, which would make up for them."""
    sigma = np.sqrt(np.diag(covariance))
    known = np.full(COUNT, math.inf)
    if model.has_matrix:
        known[MATRIX] = LEARNT * np.repeat((SCALE, SOFT), 3)
    else:
        known[OFFSET] = RELEVANT * norm
    shown: Mask = (sigma < known) | (np.abs(change) > AXIS_SURE * sigma)
    return shown


def _hidden(hidden: Mask, covariance: Array) -> tuple[str, ...]:
    """What stays as it is, and how well it is known."""
    sigma = np.sqrt(np.diag(covariance))
    kinds = (
        ("offset", OFFSET, MG_PER_UT, "mG", ("x", "y", "z")),
        ("scale and soft iron", MATRIX, 100.0, "%", ("x", "y", "z", "xy", "xz", "yz")),
    )
    return tuple(
        f"{what} of {', '.join(names[i] for i in places)}: known to ± "
        f"{sigma[part][places].max() * unit:.2g} {called} from this flight"
        for what, part, unit, called, names in kinds
        if len(places := np.flatnonzero(hidden[part]))
    )


def _to_add(change: Array, covariance: Array, outcome: Outcome) -> Outcome:
    """The offset in words, where the parameters in use are unknown."""
    x, y, z = change[OFFSET] * MG_PER_UT
    a, b, c = np.sqrt(np.diag(covariance))[OFFSET] * MG_PER_UT
    note = (
        f"add ({x:+.0f} ± {a:.0f}, {y:+.0f} ± {b:.0f}, {z:+.0f} ± {c:.0f}) mG to its offset; "
        "the parameters in use are not in the recording (--parameters)"
    )
    added = {"add_x_mg": float(x), "add_y_mg": float(y), "add_z_mg": float(z)}
    return outcome._replace(notes=(*outcome.notes, note), figures={**outcome.figures, **added})


def _with_shape(subject: Subject, model: Model, fit: FieldFit) -> Array:
    """The covariance including the effect of an unfitted matrix on the offset."""
    if model.has_matrix:
        return fit.covariance.copy()
    wider = _fitted(subject, model._replace(has_matrix=True))
    covariance = wider.covariance.copy()
    if (
        subject.settings.can_shape
        and np.bincount(_half(subject.rows), minlength=2).min() < MIN_RICH_ROWS
    ):
        # It was too short to try a matrix: there may be one.
        apart = (wider.correction.values - fit.correction.values)[OFFSET]
        covariance[OFFSET, OFFSET] += np.outer(apart, apart)
    covariance[MATRIX, :] = covariance[:, MATRIX] = 0.0
    return covariance


def _changes(
    subject: Subject, new: CompassSettings, covariance: Array
) -> tuple[ParameterChange, ...]:
    """Parameters that differ from those in use, with their deviations."""
    own = subject.parameters
    unchanged = subject.values(subject.settings, own)
    values = subject.values(new, own)
    slopes = {name: np.zeros(COUNT) for name in values}
    for place in range(COUNT):
        moved = new.correction.values
        moved[place] += 1e-4
        near = subject.values(new._replace(correction=correction(moved)), own)
        for name, value in near.items():
            slopes[name][place] = (value - values[name]) / 1e-4
    # Firmwares take a diagonal of zeros for ones: a matrix is written as a whole.
    is_shaped = not np.array_equal(new.correction.matrix, subject.settings.correction.matrix)
    changes = []
    for name, value in values.items():
        J = slopes[name]
        sigma = math.sqrt(max(float(J @ covariance @ J), 0.0))
        old = own[name]
        if abs(value - unchanged[name]) > 1e-6 * max(1.0, abs(value)) or (
            abs(value - old) > 1e-6 and (is_shaped or not J.any())
        ):
            changes.append(ParameterChange(name, old, value, sigma or math.nan))
    return tuple(changes)

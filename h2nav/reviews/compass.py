"""Compasses against the World Magnetic Model: hard iron, scale, motors, changing magnets.

Two views of the same field. With the best attitude the earth's field in the body is known, and the
rest is the vehicle's own: its steps show magnets, its rms per heading the residuals. A hard iron
present from the start may have turned that attitude's heading, though; so offset, scale and motors
are fitted without any heading: by the field's strength, and by its component along the vertical,
which gravity shows.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.rows import select_rows
from h2nav.maths.units import DEG, MG_PER_UT
from h2nav.recordings.context import Array, Context, ImuTrack, Series
from h2nav.reviews.compass_motors import Strength, strength_by_throttle
from h2nav.reviews.flight import EarthFields
from h2nav.reviews.inertial import Attitudes, Mask, conjugate, means, rotate, thinned, within
from h2nav.reviews.tracks import CompassFit, FieldTrack

MAX_POINTS = 2000
MAX_ROWS = 4000
SECTORS = 16
# Headings that a fit needs: a third of a circle, each for this long.
MIN_SECTORS, MIN_SHARE = 5, 0.005
ROW_S = 0.2
MIN_ROWS = 50
# In a quick turn a field that is 20 ms late is 2 deg off.
FASTEST_RAD_S = 90.0 * DEG
SURE_TILT_RAD = 6.0 * DEG
# A calibrated compass: 7 % of the norm and 3 deg, which is 5 % (integrity.field_windows).
USUAL_SHARE = 0.07
# Reported from here on: 10 deg of heading at worst, by the horizontal field; EKF3 and EKF2 begin to
# reject the field there.
HEADING_TOLD_RAD = 10.0 * DEG
# Arming requires 185 to 875 mG (ArduPilot); a scale error of 15 % is beyond calibration (0.7 to 1.3
# are COMPASS_SCALE's ends, 1.1 the usual one for soft iron).
SCALE_TOLD = 0.15
# Offset and scale of a calibrated compass.
CALIBRATED = np.array([0.0, 0.0, 0.0, 1.0])
# A parameter must be this many deviations from zero, and reduce the residuals by this much.
SURE = 5.0
BETTER = 0.7
ROUNDS = 12
MIN_NOISE_SHARE = 0.015
COMES_AND_GOES = "no setting mends a field that changes in flight"
# Usual sizes: offsets of a vehicle's own parts, a compass's soft iron.
OFFSET_UT = 60.0
SOFT = 0.1
# Motors: compassmot calls up to 30 % of the earth's field at full throttle good, above 60 % bad.
MOTOR_SHARE, MOTOR_BAD_SHARE = 0.3, 0.6
# Required change of throttle in flight, between the 5th and the 95th percentile.
THROTTLE_SPREAD = 0.15
THROTTLE_BINS = 8
# A magnet that comes or goes: this share of the earth's field, with 6 s of rows on both sides, most
# of the change within 2 s.
STEP_SHARE = 0.12
STEP_ROWS = 30
SUDDEN_ROWS, SUDDEN_SHARE = 5, 0.5
MAX_STEPS = 8
# A field turned by more than so many deviations of our heading has turned itself.
SURE_TURNED = 3.0
# Least length of the part that represents the flight.
USUAL_S = 15.0
# A step this soon after arming may be the take-off, as one with the throttle.
AROUND_S = 12.0


class SentFields(NamedTuple):
    """Means of the field over short times, with the expected field."""

    t_s: Array  # (N,)
    m_b_ut: Array  # (N, 3) measured, body frame
    earth_b_ut: Array  # (N, 3) of the model by the attitude, body frame
    down_b: Array  # (N, 3) direction of gravity, body frame
    heading_rad: Array  # (N,) of the vehicle, 0 to 2 pi
    error_rad: Array  # (N,) of the measured direction about the vertical, positive clockwise
    norm_ut: Array  # (N,) of the model
    dip_rad: Array  # (N,) of the model
    throttle: Array  # (N,) NaN if unknown
    sigma_rad: Array  # (N,) predicted deviation of the attitude's heading
    flying: Mask  # (N,) whether the motors may turn

    def part(self, places: Mask | NDArray[np.intp]) -> "SentFields":
        """A selection of the rows."""
        return select_rows(self, places)


class Fit(NamedTuple):
    """The field besides the earth's, see `fitted`."""

    # (9,) offset, scale, soft iron (a, b), motor: microtesla in the body frame, per full
    # throttle or ampere
    x: Array
    covariance: Array  # (9, 9) of them
    has_motor: bool  # the throttle changed enough to observe the motors
    before_ut: float  # weighted rms of the heading-free residuals without the fit
    after_ut: float  # the same with it

    def is_sure(self, first: int, after: int, around: Array | float = 0.0) -> bool:
        """Whether some of the parameters differ significantly from their usual values."""
        value = self.x[first:after] - around
        C = self.covariance[first:after, first:after]
        return float(value @ np.linalg.solve(C, value)) > SURE**2

    def undone(self, rows: SentFields) -> Array:
        """(N, 3) the field without the fitted disturbance."""
        a, b = self.x[4:6]
        mixed = np.array([[1.0 + a, b, 0.0], [b, 1.0 - a, 0.0], [0.0, 0.0, 1.0]])
        motor = np.nan_to_num(rows.throttle)[:, None] * self.x[6:] if self.has_motor else 0.0
        free: Array = (rows.m_b_ut - self.x[:3] - motor) @ mixed / self.x[3]
        return free


def detect_compass(
    track: ImuTrack, best: Attitudes | None, earth: EarthFields, context: Context, *, is_raw: bool
) -> tuple[FieldTrack | None, CompassFit | None, list[Finding]]:
    """Analyses one compass.

    Args:
        track: of the IMU whose samples carry it.
        context: throttle, armed state, parameters.
        is_raw: the message carries the field without the autopilot's calibration.
    """
    if best is None or not len(earth.t_s):
        return None, None, []
    rows = _rows(track, best, earth, context)
    if rows is None:
        return None, None, []
    shown = _shown(track.imu, rows)
    pieces = _pieces(rows)
    usual = min(pieces, key=_strangeness)
    fit = best_fit(usual)
    found = _steps(track.imu, rows, pieces, usual)
    by_motors = strength_by_throttle(track, context)
    if fit is not None and by_motors and _is_of_motors(by_motors, usual):
        found += _by_current(track.imu, usual, fit, by_motors)
    elif fit is not None:
        came_and_went = any(one.severity <= Severity.WARNING for one in found)
        change = (
            COMES_AND_GOES if came_and_went else _change(track.imu, fit, context, is_raw=is_raw)
        )
        found += _constant(track.imu, usual, fit, change, is_raw=is_raw)
    if fit is not None:
        found += _motors(track.imu, usual, fit, context)
    return shown, _sectors(track.imu, usual, fit), found


def _is_of_motors(strength: Strength, rows: SentFields) -> bool:
    """Whether the motors' current, and no iron, makes the strength differ from the earth's."""
    norm = float(np.median(rows.norm_ut))
    idle, loaded = abs(strength.idle_ut - norm), abs(strength.loaded_ut - norm)
    return loaded > USUAL_SHARE * norm and idle < 0.5 * loaded


def _strangeness(piece: SentFields) -> tuple[bool, float]:
    """How far the field of a part is from the earth's; short parts do not count."""
    own = np.linalg.norm(piece.m_b_ut - piece.earth_b_ut, axis=1)
    return bool(piece.t_s[-1] - piece.t_s[0] < USUAL_S), float(np.median(own))


def strangeness(field: FieldTrack, one: Finding) -> float:
    """How far strength and dip were from the earth's while a finding lasted, as a share of it."""
    inside = (field.t_s >= one.from_s) & (field.t_s <= one.to_s)
    if not inside.any():
        inside = np.ones(len(field.t_s), dtype=bool)
    norm = field.norm_ut[inside] / np.maximum(field.model_norm_ut[inside], 1e-9) - 1.0
    dip = field.dip_rad[inside] - field.model_dip_rad[inside]
    return float(np.median(np.hypot(norm, dip)))


def _in_flight(rows: SentFields, t_s: float) -> bool:
    """Whether the motors turned throughout the time around `t_s`, and as hard before as after."""
    if not rows.flying[np.abs(rows.t_s - t_s) < AROUND_S].all():
        return False
    known = rows.part(np.isfinite(rows.throttle))
    before = known.throttle[known.t_s < t_s][-STEP_ROWS:]
    after = known.throttle[known.t_s >= t_s][:STEP_ROWS]
    if not len(before) or not len(after):
        return True
    change = abs(float(np.median(after)) - float(np.median(before)))
    return change <= _least_spread(known.throttle)


def _least_spread(throttle: Array) -> float:
    """The change of throttle, or current, that shows what the motors do to the field."""
    return THROTTLE_SPREAD * max(1.0, float(np.abs(throttle).max()))


def _rows(
    track: ImuTrack, best: Attitudes, earth: EarthFields, context: Context
) -> SentFields | None:
    """Means of 0.2 s, without quick turns, where the vertical is known."""
    good = np.isfinite(track.m_b_ut).all(axis=1) & np.isfinite(track.w_b).all(axis=1)
    if good.sum() < MIN_ROWS:
        return None
    t_s = track.t_s[good]
    row_s = max(ROW_S, (t_s[-1] - t_s[0]) / MAX_ROWS)
    edges = np.arange(t_s[0], t_s[-1] + row_s, row_s)
    values = np.hstack((track.m_b_ut[good], np.abs(track.w_b[good])), dtype=float)
    mean = means(t_s, values, edges)
    at_s = 0.5 * (edges[1:] + edges[:-1])
    q = best.at(at_s)
    tilt = best.near(best.sigma_tilt_rad, at_s)
    keep = np.isfinite(mean).all(axis=1) & np.isfinite(q).all(axis=1)
    keep &= (mean[:, 3:].max(axis=1, initial=0.0) < FASTEST_RAD_S) & (tilt < SURE_TILT_RAD)
    if keep.sum() < MIN_ROWS:
        return None
    at_s, q, m_b = at_s[keep], q[keep], mean[keep, :3]
    place = np.clip(np.searchsorted(earth.t_s, at_s, side="right") - 1, 0, len(earth.t_s) - 1)
    norm, dip = earth.norm_ut[place], earth.dip_rad[place]
    declination = earth.declination_rad[place]
    level = norm * np.cos(dip)
    earth_n = np.stack(
        (level * np.cos(declination), level * np.sin(declination), norm * np.sin(dip)), axis=1
    )
    back = conjugate(q)
    measured_n = rotate(q, m_b)
    error = np.arctan2(measured_n[:, 1], measured_n[:, 0]) - declination
    nose = rotate(q, np.tile([1.0, 0.0, 0.0], (len(q), 1)))
    throttle = context.throttle or context.current_a
    return SentFields(
        at_s,
        m_b,
        rotate(back, earth_n),
        rotate(back, np.tile([0.0, 0.0, 1.0], (len(q), 1))),
        np.arctan2(nose[:, 1], nose[:, 0]) % (2.0 * np.pi),
        (error + np.pi) % (2.0 * np.pi) - np.pi,
        norm,
        dip,
        np.full(len(at_s), np.nan) if throttle is None else _interpolated(throttle, at_s),
        best.near(best.sigma_heading_rad, at_s),
        within(at_s, context.armed),
    )


def _interpolated(series: Series, at_s: Array) -> Array:
    good = np.isfinite(series.values)
    if good.sum() < 2:
        return np.full(len(at_s), np.nan)
    values: Array = np.interp(
        at_s, series.t_s[good], series.values[good], left=np.nan, right=np.nan
    )
    return values


def _shown(compass: int, rows: SentFields) -> FieldTrack:
    place = thinned(len(rows.t_s), MAX_POINTS)
    norm = np.linalg.norm(rows.m_b_ut, axis=1)
    vertical = (rows.m_b_ut * rows.down_b).sum(axis=1)
    dip = np.arcsin(np.clip(vertical / np.maximum(norm, 1e-9), -1.0, 1.0))
    return FieldTrack(
        compass,
        rows.t_s[place],
        norm[place],
        dip[place],
        rows.error_rad[place],
        rows.norm_ut[place],
        rows.dip_rad[place],
    )


# --- magnets that come and go -----------------------------------------------------------------


def _pieces(rows: SentFields) -> list[SentFields]:
    """Parts between steps of the body's own field."""
    own = rows.m_b_ut - rows.earth_b_ut
    size = _step_sizes(own)
    least = STEP_SHARE * float(np.median(rows.norm_ut))
    cuts = [0, len(own)]
    while len(cuts) - 2 < MAX_STEPS and size.max(initial=0.0) > least:
        place = int(np.argmax(size))
        if _is_step(rows, own, place):
            cuts.append(place)
        size[max(place - STEP_ROWS, 0) : place + STEP_ROWS] = 0.0
    return [rows.part(np.arange(first, after)) for first, after in pairwise(sorted(cuts))]


def _step_sizes(own: Array) -> Array:
    """(N,) difference of the means before and after each row; 0 near the ends."""
    sums = np.vstack((np.zeros(3), np.cumsum(own, axis=0)))
    size = np.zeros(len(own))
    if len(own) < 2 * STEP_ROWS:
        return size
    inner = np.arange(STEP_ROWS, len(own) - STEP_ROWS + 1)
    twice = sums[inner + STEP_ROWS] - 2.0 * sums[inner] + sums[inner - STEP_ROWS]
    size[inner] = np.linalg.norm(twice, axis=1) / STEP_ROWS
    return size


def _is_step(rows: SentFields, own: Array, place: int) -> bool:
    """Whether it is a step rather than a slope, well above the noise on both sides.

    In a turn, a wrong heading of the attitude makes a step of the earth's own field: that must be
    less than half of this step.
    """
    before, after = own[place - STEP_ROWS : place], own[place : place + STEP_ROWS]
    step = np.median(after, axis=0) - np.median(before, axis=0)
    size = float(np.linalg.norm(step))
    if size < 3.0 * max(_spread(before), _spread(after)):
        return False
    sudden = after[:SUDDEN_ROWS].mean(axis=0) - before[-SUDDEN_ROWS:].mean(axis=0)
    near = slice(place - SUDDEN_ROWS, place + SUDDEN_ROWS)
    turned = min(float(np.ptp(np.unwrap(rows.heading_rad[near]))), math.pi)
    off = min(3.0 * float(rows.sigma_rad[place - 1]), 0.5 * math.pi)
    level = float(rows.norm_ut[place] * math.cos(rows.dip_rad[place]))
    false = 2.0 * level * math.sin(0.5 * turned) * math.sin(off)
    return float(sudden @ step) > SUDDEN_SHARE * size**2 and size > 2.0 * false


def _spread(values: Array) -> float:
    """Robust deviation over all axes."""
    apart = np.abs(values - np.median(values, axis=0))
    return 1.4826 * float(np.linalg.norm(np.median(apart, axis=0)))


def _steps(
    compass: int, rows: SentFields, pieces: list[SentFields], usual: SentFields
) -> list[Finding]:
    """The change in each part against the usual one."""
    own = np.median(usual.m_b_ut - usual.earth_b_ut, axis=0)
    least = STEP_SHARE * float(np.median(usual.norm_ut))
    # Between two parts there may be unused rows, in quick turns.
    cuts = [0.5 * (one.t_s[-1] + other.t_s[0]) for one, other in pairwise(pieces)]
    begins = [pieces[0].t_s[0], *cuts]
    ends = [*cuts, pieces[-1].t_s[-1]]
    found = []
    for piece, from_s, to_s in zip(pieces, begins, ends, strict=True):
        change = np.median(piece.m_b_ut - piece.earth_b_ut, axis=0) - own
        size = float(np.linalg.norm(change))
        if piece is usual or size < least:
            continue
        x, y, z = change * MG_PER_UT
        # What came in flight is no ground's, wherever it ended.
        came_s = from_s if from_s in cuts else to_s
        flew = _in_flight(rows, came_s)
        why = "a magnet, a motor or a wire" if flew else "the ground that it stood on, or motors"
        is_shown = _is_shown(piece, usual, least)
        doubt = "" if is_shown else ", or our heading: strength and dip stayed"
        found.append(
            Finding(
                Kind.COMPASS_STEP,
                Sensor(SensorKind.COMPASS, compass + 1),
                Severity.WARNING if flew and is_shown else Severity.NOTICE,
                float(from_s),
                float(to_s),
                size * MG_PER_UT,
                "mG",
                f"field of the vehicle itself changed by {size * MG_PER_UT:.0f} mG",
                f"({x:+.0f}, {y:+.0f}, {z:+.0f}) mG forward, right, down, fixed to the body: {why} "
                f"near the compass{doubt}",
            )
        )
    return found


def _is_shown(piece: SentFields, usual: SentFields, least_ut: float) -> bool:
    """Whether two parts differ, whatever the heading was, or by more than its error may be.

    What a scale error leaves of the earth's field turns with the vehicle.
    """
    (norm, down, error, sigma), before = _about_vertical(piece), _about_vertical(usual)
    turned = abs((error - before[2] + math.pi) % math.tau - math.pi)
    changed = math.hypot(norm - before[0], down - before[1])
    return changed >= least_ut or turned > SURE_TURNED * math.hypot(sigma, before[3])


def _about_vertical(rows: SentFields) -> tuple[float, float, float, float]:
    """Medians of strength, vertical part, direction about it, and our heading's deviation."""
    return (
        float(np.median(np.linalg.norm(rows.m_b_ut, axis=1))),
        float(np.median((rows.m_b_ut * rows.down_b).sum(axis=1))),
        float(np.median(rows.error_rad)),
        float(np.median(rows.sigma_rad)),
    )


# --- what was there all the time --------------------------------------------------------------


def best_fit(rows: SentFields) -> Fit | None:
    """The fit with motors if only they explain the residuals, otherwise without them."""
    if rows.flying.sum() >= MIN_ROWS:
        rows = rows.part(rows.flying)
    if len(rows.t_s) < MIN_ROWS:
        return None
    plain = fitted(rows, None)
    lever = _lever(rows)
    if lever is None:
        return plain
    full = fitted(rows, lever)
    return full if full.is_sure(6, 9) and full.after_ut < BETTER * plain.after_ut else plain


def fitted(rows: SentFields, lever: Array | None) -> Fit:
    """Offset, scale, soft iron and motors without a heading.

    With u = m - offset - throttle * motor and E = [[a, b, 0], [b, -a, 0], [0, 0, 0]], two residuals
    of each row: |(I + E) u| - scale * B, and the vertical part of (I + E) u - scale * earth.
    Gauss-Newton; every sector of heading has the same weight.

    Args:
        lever: (N,) throttle or current; None = without the motors.
    """
    norm = float(np.median(rows.norm_ut))
    weights = np.tile(_balanced(rows.heading_rad), 2)
    expected = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    prior = 1.0 / np.array([OFFSET_UT] * 3 + [USUAL_SHARE] + [SOFT] * 2 + [OFFSET_UT] * 3) ** 2
    if lever is None:
        prior[6:] = np.inf
    free = np.isfinite(prior)
    x = expected.copy()
    noise_ut = USUAL_SHARE * norm
    before_ut = _rms(_residuals(rows, x, lever)[0], weights)
    for _ in range(ROUNDS):
        r, J = _residuals(rows, x, lever)
        J = J[:, free] * (weights / noise_ut**2)[:, None]
        A = J.T @ _residuals(rows, x, lever)[1][:, free] + np.diag(prior[free])
        x[free] -= np.linalg.solve(A, J.T @ r + prior[free] * (x - expected)[free])
        noise_ut = max(_rms(r, weights), MIN_NOISE_SHARE * norm)
    covariance = np.zeros((9, 9))
    covariance[np.ix_(free, free)] = np.linalg.inv(A)
    after_ut = _rms(_residuals(rows, x, lever)[0], weights)
    return Fit(x, covariance, lever is not None, before_ut, after_ut)


def _residuals(rows: SentFields, x: Array, lever: Array | None) -> tuple[Array, Array]:
    """(2 N,) residuals, microtesla, and their (2 N, 9) derivatives."""
    throttle = np.zeros((len(rows.t_s), 1)) if lever is None else lever[:, None]
    mixed = np.array([[1.0 + x[4], x[5], 0.0], [x[5], 1.0 - x[4], 0.0], [0.0, 0.0, 1.0]])
    u = rows.m_b_ut - x[:3] - throttle * x[6:]
    true = u @ mixed
    length = np.maximum(np.linalg.norm(true, axis=1), 1e-6)
    vertical = rows.norm_ut * np.sin(rows.dip_rad)
    r = np.concatenate(
        (length - x[3] * rows.norm_ut, (true * rows.down_b).sum(axis=1) - x[3] * vertical)
    )
    along = np.vstack((true / length[:, None], rows.down_b))
    u2, throttle2 = np.vstack((u, u)), np.vstack((throttle, throttle))
    offset = -along @ mixed
    J = np.hstack(
        (
            offset,
            -np.concatenate((rows.norm_ut, vertical))[:, None],
            (along[:, 0] * u2[:, 0] - along[:, 1] * u2[:, 1])[:, None],
            (along[:, 0] * u2[:, 1] + along[:, 1] * u2[:, 0])[:, None],
            offset * throttle2,
        )
    )
    return r, J


def _rms(r: Array, weights: Array) -> float:
    return math.sqrt(float((weights * r**2).sum() / weights.sum()))


def _sector(heading_rad: Array) -> NDArray[np.intp]:
    return (heading_rad / (2.0 * np.pi) * SECTORS).astype(np.intp) % SECTORS


def _balanced(heading_rad: Array) -> Array:
    """Weights that add up to one in each flown sector of heading."""
    sector = _sector(heading_rad)
    weights: Array = 1.0 / np.bincount(sector, minlength=SECTORS)[sector]
    return weights


def _lever(rows: SentFields) -> Array | None:
    """Throttle of each row, if it changed enough in flight."""
    known = np.isfinite(rows.throttle)
    if not known.all() or not rows.flying.all():
        return None
    low, high = np.quantile(rows.throttle, (0.05, 0.95))
    return rows.throttle if high - low > _least_spread(rows.throttle) else None


def _constant(
    compass: int, rows: SentFields, fit: Fit, change: str, *, is_raw: bool
) -> list[Finding]:
    """Hard iron, soft iron and scale throughout a part of the flight; see `_change`."""
    if fit.after_ut > BETTER * fit.before_ut or not _has_turned(rows):
        return []
    norm = float(np.median(rows.norm_ut))
    level = max(norm * math.cos(float(np.median(rows.dip_rad))), 1.0)
    severity = Severity.INFO if is_raw else Severity.WARNING
    found = []

    def report(kind: Kind, size: float, unit: str, text: str, evidence: str) -> None:
        times = float(rows.t_s[0]), float(rows.t_s[-1])
        left = f"; the rest falls from {fit.before_ut * MG_PER_UT:.0f} to "
        evidence += f"{left}{fit.after_ut * MG_PER_UT:.0f} mG rms of {norm * MG_PER_UT:.0f}"
        sensor = Sensor(SensorKind.COMPASS, compass + 1)
        found.append(Finding(kind, sensor, severity, *times, size, unit, text, evidence))

    offset = fit.x[:3]
    turned = math.asin(min(float(np.hypot(*offset[:2])) / level, 1.0))
    if _is_large(fit, rows):
        x, y, z = offset * MG_PER_UT
        size = float(np.linalg.norm(offset)) * MG_PER_UT
        text = f"hard iron of {size:.0f} mG"
        evidence = (
            f"({x:+.0f}, {y:+.0f}, {z:+.0f}) mG forward, right, down: up to {turned / DEG:.0f} deg "
            f"of heading; {change}; by strength and dip alone, whatever the heading was"
        )
        report(Kind.COMPASS_HARD_IRON, size, "mG", text, evidence)
    soft = float(np.hypot(*fit.x[4:6]))
    if soft > math.tan(HEADING_TOLD_RAD) and fit.is_sure(4, 6):
        text = f"soft iron: {2.0 * soft:.0%} stronger one way than across"
        evidence = f"up to {soft / DEG:.0f} deg of heading, twice in a full turn"
        report(Kind.COMPASS_SOFT_IRON, 200.0 * soft, "%", text, evidence)
    scale = float(fit.x[3]) - 1.0
    if abs(scale) > SCALE_TOLD and fit.is_sure(3, 4, around=1.0):
        text = f"field is {scale:+.0%} against the earth's"
        report(Kind.COMPASS_SCALE, 100.0 * abs(scale), "%", text, "the same in all headings")
    strength = float(np.median(np.linalg.norm(rows.m_b_ut, axis=1) / rows.norm_ut)) - 1.0
    if not found and abs(strength) > SCALE_TOLD and fit.is_sure(0, 4, around=CALIBRATED):
        text = f"field is {strength:+.0%} against the earth's"
        evidence = "by its scale, or by iron: the attitudes that were flown do not tell them apart"
        report(Kind.COMPASS_SCALE, 100.0 * abs(strength), "%", text, evidence)
    return found


def _is_large(fit: Fit, rows: SentFields) -> bool:
    """Whether the offset turns the heading by more than a calibrated compass's, for certain."""
    norm, offset = float(np.median(rows.norm_ut)), fit.x[:3]
    level = max(norm * math.cos(float(np.median(rows.dip_rad))), 1.0)
    turned = math.asin(min(float(np.hypot(*offset[:2])) / level, 1.0))
    most = max(turned, math.atan2(abs(offset[2]), norm))
    return most > HEADING_TOLD_RAD and fit.is_sure(0, 3)


def _by_current(compass: int, rows: SentFields, fit: Fit, strength: Strength) -> list[Finding]:
    """An offset in flight alone: no parameter for iron mends what the motors' current makes."""
    if not _is_large(fit, rows):
        return []
    x, y, z = fit.x[:3] * MG_PER_UT
    size = float(np.linalg.norm(fit.x[:3])) * MG_PER_UT
    return [
        Finding(
            Kind.COMPASS_MOTORS,
            Sensor(SensorKind.COMPASS, compass + 1),
            Severity.WARNING,
            float(rows.t_s[0]),
            float(rows.t_s[-1]),
            size,
            "mG",
            f"motors change the field by {size:.0f} mG in flight",
            f"({x:+.0f}, {y:+.0f}, {z:+.0f}) mG forward, right, down by strength and dip; its "
            f"strength is {strength.idle_ut * MG_PER_UT:.0f} mG without load and "
            f"{strength.loaded_ut * MG_PER_UT:.0f} mG in flight, the earth's "
            f"{float(np.median(rows.norm_ut)) * MG_PER_UT:.0f} mG",
        )
    ]


def _has_turned(rows: SentFields) -> bool:
    """Whether enough headings were flown to separate fields fixed to the body."""
    counts = np.bincount(_sector(rows.heading_rad), minlength=SECTORS)
    return bool(np.count_nonzero(counts > MIN_SHARE * counts.sum()) >= MIN_SECTORS)


def _change(compass: int, fit: Fit, context: Context, *, is_raw: bool) -> str:
    """The setting to change, in the autopilot's own parameters if they are known."""
    if is_raw:
        return "the message shows the field without the autopilot's calibration"
    own, x, y, z = context.parameters, *(fit.x[:3] * MG_PER_UT)
    number = "" if compass == 0 else str(compass + 1)
    ardupilot = [f"COMPASS_OFS{number}_{axis}" for axis in "XYZ"]
    if all(name in own for name in ardupilot):
        values = (
            f"{name} {own[name] - change:.0f}"
            for name, change in zip(ardupilot, (x, y, z), strict=True)
        )
        return f"set {', '.join(values)}"
    px4 = [f"CAL_MAG{compass}_{axis}OFF" for axis in "XYZ"]
    if all(name in own for name in px4) and not own.get(f"CAL_MAG{compass}_ROT", 0.0) > 0.0:
        values = (
            f"{name} {own[name] + change * 1e-3:.3f}"
            for name, change in zip(px4, (x, y, z), strict=True)
        )
        return f"set {', '.join(values)}"
    return f"add ({-x:+.0f}, {-y:+.0f}, {-z:+.0f}) to ArduPilot's COMPASS_OFS, or calibrate anew"


def compensation(compass: int, motor_ut: Array, context: Context) -> str:
    """ArduPilot's setting against a field of the motors, which adds to what it compensates.

    Args:
        motor_ut: (3,) per full throttle, or per ampere where no throttle was recorded.
    """
    own, lever = context.parameters, 2.0 if context.throttle is None else 1.0
    in_use = own.get("COMPASS_MOTCT", 0.0)
    if in_use not in (0.0, lever):
        return f"ArduPilot compensates by COMPASS_MOTCT {in_use:.0f}: run compassmot anew"
    name = f"COMPASS_MOT{compass + 1 if compass else ''}"
    values = (
        (own.get(f"{name}_{axis}", 0.0) if in_use else 0.0) - change
        for axis, change in zip("XYZ", motor_ut * MG_PER_UT, strict=True)
    )
    shown = ", ".join(f"{value:+.1f}" for value in values)
    return f"ArduPilot: COMPASS_MOTCT {lever:.0f}, {name} ({shown})"


def _motors(compass: int, rows: SentFields, fit: Fit, context: Context) -> list[Finding]:
    """The effect of throttle, or current, on the field."""
    if not fit.has_motor or not fit.is_sure(6, 9):
        return []
    norm = float(np.median(rows.norm_ut))
    motor, is_current = fit.x[6:], context.throttle is None
    most = float(np.nanmax(rows.throttle)) if is_current else 1.0
    share = float(np.linalg.norm(motor)) * most / norm
    if share < MOTOR_SHARE:
        return []
    size = float(np.linalg.norm(motor)) * most * MG_PER_UT
    where = "the largest current" if is_current else "full throttle"
    return [
        Finding(
            Kind.COMPASS_MOTORS,
            Sensor(SensorKind.COMPASS, compass + 1),
            Severity.WARNING if share > MOTOR_BAD_SHARE else Severity.NOTICE,
            float(rows.t_s[0]),
            float(rows.t_s[-1]),
            size,
            "mG",
            f"motors change the field by {size:.0f} mG",
            f"{share:.0%} of the earth's field at {where}; "
            f"{compensation(compass, motor, context)}; {MOTOR_SHARE:.0%} are usual, "
            f"{MOTOR_BAD_SHARE:.0%} too much",
        )
    ]


def _sectors(compass: int, rows: SentFields, fit: Fit | None) -> CompassFit:
    """Residuals per heading and per throttle, for pictures."""
    own = rows.m_b_ut - rows.earth_b_ut
    rest = own if fit is None else fit.undone(rows) - rows.earth_b_ut
    sector = _sector(rows.heading_rad)
    centres = (np.arange(SECTORS) + 0.5) * 2.0 * np.pi / SECTORS
    nothing = np.full(3, np.nan)
    edges = np.linspace(0.0, 1.0, THROTTLE_BINS + 1)
    known = rows.part(np.isfinite(rows.throttle) & (rows.throttle <= 1.0))
    bins = np.clip(np.digitize(known.throttle, edges) - 1, 0, THROTTLE_BINS - 1)
    change = known.m_b_ut - known.earth_b_ut - np.median(own, axis=0)
    return CompassFit(
        compass,
        centres,
        np.sqrt(_mean_by(sector, (own**2).sum(axis=1), SECTORS)),
        np.sqrt(_mean_by(sector, (rest**2).sum(axis=1), SECTORS)),
        _mean_by(sector, rows.error_rad, SECTORS),
        nothing if fit is None else fit.x[:3],
        math.nan if fit is None else float(fit.x[3]),
        0.5 * (edges[1:] + edges[:-1]) if len(known.t_s) else np.zeros(0),
        np.sqrt(_mean_by(bins, (change**2).sum(axis=1), THROTTLE_BINS))
        if len(known.t_s)
        else np.zeros(0),
        fit.x[6:] if fit is not None and fit.has_motor else nothing,
    )


def _mean_by(place: NDArray[np.intp], values: Array, count: int) -> Array:
    """Mean of the values of each place; NaN where there are none."""
    sums = np.bincount(place, values, minlength=count)
    counts = np.bincount(place, minlength=count)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(counts > 0, sums / counts, np.nan)

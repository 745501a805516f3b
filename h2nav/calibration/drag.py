"""Drag of a multirotor, and the wind that it flew in."""

import math
from collections.abc import Sequence

import numpy as np

from h2nav.calibration.drag_fit import (
    BODY,
    ROTORS,
    DragFit,
    DragRows,
    excited,
    fitted_drag,
)
from h2nav.calibration.evidence import PX4, Evidence, with_velocity
from h2nav.calibration.outcome import Outcome, ParameterChange
from h2nav.calibration.regression import Array, halves_of, part_of, together
from h2nav.maths.air import standard_density_kg_m3
from h2nav.maths.units import DEG
from h2nav.recordings.context import ImuTrack, Series
from h2nav.recordings.motor_outputs import MULTIROTORS
from h2nav.reviews.inertial import conjugate, interpolated, means, rotate, slowed, within
from h2nav.reviews.sensor_bias import measuring

DRAG_WINDOW_S = 0.5
MAX_ROWS = 4000
# Fixes arrive so much later than they were true, roughly; the speed changes little within it.
LAG_S = 0.15
LONGEST_FIX_GAP_S = 0.6
# In a turn the accelerometer feels its own lever.
FASTEST_RAD_S = 60.0 * DEG
# Less lift is a vehicle that falls or stands on something.
MIN_LIFT_M_S2, MAX_LIFT_M_S2 = 6.0, 16.0
SURE_TILT_RAD, SURE_HEADING_RAD = 3.0 * DEG, 12.0 * DEG
MIN_ROWS = 200
# Speeds along both axes, and a share of windows that fit.
MIN_RANGE_M_S, UNFIT = 8.0, 0.3
# A better parameter: known to this share, halves alike within that, and so far from the one in use.
SURE_SHARE, ALIKE_SHARE, RELEVANT_SHARE, SURE = 0.15, 0.4, 0.2, 4.0
# Two terms are a model of a vehicle: gusts within a window and rotors at other speeds differ.
MODEL_SHARE = 0.08
NAMES = {
    PX4: ("EKF2_BCOEF_X", "EKF2_BCOEF_Y", "EKF2_MCOEF"),
    "": ("EK3_DRAG_BCOEF_X", "EK3_DRAG_BCOEF_Y", "EK3_DRAG_MCOEF"),
}
# Limits of the firmware: BCOEF kg/m^2, MCOEF 1/s.
LIMITS = {PX4: (200.0, 200.0, 1.0), "": (1000.0, 1000.0, 1.0)}
AS_SET = "as set"
NOTE = "drag is used for the wind as soon as these are set: fly carefully afterwards"


def calibrate_drag(flights: Sequence[Evidence]) -> Outcome:
    """Ballistic and momentum drag, by flights with steps of speed; with the wind of the last one.

    Args:
        flights: of one vehicle, in order.
    """
    own, last = Outcome("drag"), flights[-1]
    if last.context.vehicle_type not in MULTIROTORS:
        return own._replace(left=("only rotors push along one axis",))
    found = [rows for n, each in enumerate(flights) if (rows := rows_of(each, n)) is not None]
    rows = together(found) if found else None
    if rows is None or len(rows.t_s) < MIN_ROWS:
        return own._replace(left=("too little flight with velocity, heading and forces",))
    is_px4 = last.autopilot == PX4
    fit = fitted_drag(rows, is_whole_speed=is_px4)
    range_x, range_y = excited(fit)
    figures = _figures(fit) | {"speed_range_x_m_s": range_x, "speed_range_y_m_s": range_y}
    own = own._replace(figures=figures)
    if (fit.weight < 0.5).mean() > UNFIT:
        return own._replace(left=("forces and speeds contradict each other",))
    own = own._replace(wind_n_m_s=_wind(rows, fit, len(flights) - 1))
    if min(range_x, range_y) < MIN_RANGE_M_S:
        why = f"speeds over {range_x:.0f} m/s along x and {range_y:.0f} along y show no drag"
        return own._replace(left=(f"{why}: fly steps of speed ahead and aside",))
    halves = [fitted_drag(half, is_whole_speed=is_px4) for half in halves_of(rows)]
    changes, left = [], []
    for place in range(3):
        change = _change(place, last, fit, halves)
        changes += [change] if isinstance(change, ParameterChange) else []
        left += [change] if isinstance(change, str) else []
    if not all(reason.endswith(AS_SET) for reason in left):
        # Half of the model would make the other half wrong.
        left += [f"{change.name}: only together with the others" for change in changes]
        changes = []
    shown = f"forces in {len(rows.t_s)} windows of {DRAG_WINDOW_S:g} s" if changes else ""
    notes = (NOTE,) if any(not change.old > 0.0 for change in changes) else ()
    return own._replace(changes=tuple(changes), left=tuple(left), notes=notes, shown=shown)


def rows_of(evidence: Evidence, number: int) -> DragRows | None:
    """The windows of one flight by its first IMU; None without any.

    Args:
        number: of the flight.
    """
    context = evidence.context
    gps = evidence.gps
    tracks = [measuring(slowed(one), evidence.flight.findings) for one in context.imus]
    track: ImuTrack | None = next((one for one in tracks if len(one.t_s) > 1), None)
    if gps is None or track is None:
        return None
    edges = np.arange(track.t_s[0], track.t_s[-1], DRAG_WINDOW_S)
    if len(edges) < 2:
        return None
    t_s = 0.5 * (edges[:-1] + edges[1:])
    mean = means(track.t_s, np.hstack((track.f_b, track.w_b)), edges)
    attitude = evidence.attitude_of_tracks()
    q_nb = attitude.at(t_s)
    fixed = with_velocity(gps)
    velocity = np.nan_to_num(gps.v_n[fixed])
    columns = np.column_stack((velocity, gps.altitude_m[fixed]))
    at_fix = interpolated(t_s + LAG_S, gps.t_s[fixed], columns)
    good = np.isfinite(mean).all(axis=1) & np.isfinite(q_nb).all(axis=1)
    good &= np.isfinite(at_fix).all(axis=1) & (_nearest_s(gps.t_s[fixed], t_s) < LONGEST_FIX_GAP_S)
    good &= within(t_s, context.armed) & (np.linalg.norm(mean[:, 3:], axis=1) < FASTEST_RAD_S)
    good &= (-mean[:, 2] > MIN_LIFT_M_S2) & (-mean[:, 2] < MAX_LIFT_M_S2)
    good &= attitude.near(attitude.sigma_tilt_rad, t_s) < SURE_TILT_RAD
    good &= attitude.near(attitude.sigma_heading_rad, t_s) < SURE_HEADING_RAD
    if not good.any():
        return None
    chosen = np.flatnonzero(good)
    chosen = chosen[:: len(chosen) // MAX_ROWS + 1]
    inverse = conjugate(q_nb[chosen])
    axes = [rotate(inverse, np.tile(axis, (len(chosen), 1))) for axis in np.eye(3)]
    density = [standard_density_kg_m3(altitude) for altitude in at_fix[chosen, 3].tolist()]
    rows = DragRows(
        np.full(len(chosen), number),
        t_s[chosen],
        mean[chosen, :2],
        -mean[chosen, 2],
        np.stack(axes, axis=2),
        at_fix[chosen, :3],
        np.array(density),
    )
    return part_of(rows, np.ones(len(chosen), np.bool_))


def _nearest_s(of_s: Array, t_s: Array) -> Array:
    """(N,) how far the next one of some times is."""
    after = np.searchsorted(of_s, t_s).clip(1, len(of_s) - 1)
    found: Array = np.minimum(np.abs(of_s[after] - t_s), np.abs(of_s[after - 1] - t_s))
    return found


def _figures(fit: DragFit) -> dict[str, float]:
    values, sigma = fit.values, fit.sigma
    named = dict(zip(("x", "y"), zip(values[BODY], sigma[BODY], strict=True), strict=True))
    found = {
        f"inverse_bcoef_{axis}_m2_kg{tail}": float(pair[place])
        for axis, pair in named.items()
        for place, tail in enumerate(("", "_sigma"))
    }
    return found | {
        "mcoef_1_s": float(values[ROTORS][0]),
        "mcoef_1_s_sigma": float(sigma[ROTORS][0]),
        "residual_m_s2": float(np.median(np.linalg.norm(fit.residual, axis=1))),
    }


def _wind(rows: DragRows, fit: DragFit, number: int) -> Series | None:
    """The wind over the last flight, where it is known better than by a third of its prior."""
    own = (rows.flight == number) & (fit.sigma_wind < 2.5)
    return Series(rows.t_s[own], fit.wind_n[own]) if own.any() else None


def _change(
    place: int, last: Evidence, fit: DragFit, halves: list[DragFit]
) -> ParameterChange | str:
    """A better parameter, or why there is none.

    Args:
        place: 0 and 1 = BCOEF of x and y, 2 = MCOEF.
    """
    make = PX4 if last.autopilot == PX4 else ""
    name, most = NAMES[make][place], LIMITS[make][place]
    value = float(fit.values[place])
    sigma = math.hypot(float(fit.sigma[place]), MODEL_SHARE * value)
    one, other = (float(half.values[place]) for half in halves)
    if not value > 0.0 or sigma > SURE_SHARE * value:
        shown = "1/" if place < 2 else ""
        return f"{name}: {shown}{value:.3g} ± {sigma:.2g} is too uncertain"
    if abs(one - other) > ALIKE_SHARE * value:
        return f"{name}: the halves of the flight disagree"
    if place < 2:
        value, sigma = 1.0 / value, sigma / value**2
    words = f"{name} {value:.3g} ± {sigma:.2g}"
    if name not in last.parameters:
        return f"{words}: its parameter is not in the recording (--parameters)"
    old = last.parameters[name]
    if old > 0.0 and abs(value - old) < max(RELEVANT_SHARE * old, SURE * sigma):
        return f"{words}: {AS_SET}"
    if value > most:
        return f"{words}: beyond the firmware's limit"
    return ParameterChange(name, old, value, sigma)

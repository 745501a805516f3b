"""The raw field of a compass over a flight, and the earth's field by an attitude."""

import numpy as np

from h2nav.calibration import rotations
from h2nav.calibration.evidence import ARDUPILOT, Evidence, series_at
from h2nav.calibration.field_fit import FieldRows
from h2nav.calibration.regression import Array
from h2nav.calibration.settings import CompassSettings, Lever
from h2nav.maths.units import DEG
from h2nav.recordings.context import CompassTrack
from h2nav.reviews.flight import EarthFields
from h2nav.reviews.inertial import Mask, conjugate, means, rotate, thinned
from h2nav.wire.imu import UT_PER_MGAUSS

ROW_S = 0.2
MAX_ROWS = 1500
# In a quick turn a field that is 20 ms late is 1 deg off.
FASTEST_RAD_S = 60.0 * DEG
SLOPE_S = 0.05
SURE_TILT_RAD = 4.0 * DEG
MIN_FIELD_ROWS = 2
SECTORS = 16
SECTOR_ROWS = 5


def field_rows(
    evidence: Evidence, track: CompassTrack, settings: CompassSettings | None, flight: int
) -> FieldRows | None:
    """Means of 0.2 s in flight, without quick turns and where the vertical is known.

    Args:
        settings: in use; None if unknown: the field counts as raw.
        flight: its number, for the rows.
    """
    if len(track.t_s) < MIN_FIELD_ROWS or not len(evidence.flight.earth.t_s):
        return None
    edges = np.arange(track.t_s[0], track.t_s[-1] + ROW_S, ROW_S)
    raw = means(track.t_s, _raw(evidence, track, settings), edges)
    at_s = 0.5 * (edges[1:] + edges[:-1])
    attitude = evidence.attitude()
    q = attitude.at(at_s)
    speed = _speed(evidence, edges)
    keep = np.isfinite(raw.sum(axis=1) + q.sum(axis=1)) & (speed < FASTEST_RAD_S)
    keep &= attitude.near(attitude.sigma_tilt_rad, at_s) < SURE_TILT_RAD
    keep &= evidence.flying(at_s)
    places = np.flatnonzero(keep)
    places = places[thinned(len(places), MAX_ROWS)]
    if len(places) < MIN_FIELD_ROWS:
        return None
    at_s, q = at_s[places], q[places]
    back = conjugate(q)
    earth_n = _earth_of(evidence, at_s)
    before, after = (
        rotate(conjugate(attitude.at(at_s + step)), earth_n) for step in (-SLOPE_S, SLOPE_S)
    )
    nose = rotate(q, np.tile([1.0, 0.0, 0.0], (len(q), 1)))
    return FieldRows(
        np.full(len(at_s), flight),
        at_s,
        raw[places],
        rotate(back, earth_n),
        np.nan_to_num((after - before) / (2.0 * SLOPE_S)),
        rotate(back, np.tile([0.0, 0.0, 1.0], (len(q), 1))),
        np.arctan2(nose[:, 1], nose[:, 0]),
        attitude.near(attitude.sigma_heading_rad, at_s),
        series_at(evidence.context.throttle, at_s),
        series_at(evidence.context.current_a, at_s),
    )


def earth_at(earth: EarthFields, t_s: Array) -> Array:
    """(N, 3) the model's field, NED, microtesla."""
    place = np.clip(np.searchsorted(earth.t_s, t_s, side="right") - 1, 0, len(earth.t_s) - 1)
    norm, dip = earth.norm_ut[place], earth.dip_rad[place]
    declination = earth.declination_rad[place]
    level = norm * np.cos(dip)
    return np.stack(
        (level * np.cos(declination), level * np.sin(declination), norm * np.sin(dip)), axis=1
    )


def _earth_of(evidence: Evidence, t_s: Array) -> Array:
    """(N, 3) the field that the vehicle flew in, NED, microtesla.

    The world of ArduPilot's simulators has the field of the firmware's own table, with 10 deg
    between its points: up to some milligauss off the World Magnetic Model.
    """
    context = evidence.context
    fixes = [gps for gps in context.gps if gps.has_fix.any()]
    if context.truth is None or evidence.autopilot != ARDUPILOT or not fixes:
        return earth_at(evidence.flight.earth, t_s)
    from pymavlink.mavextra import expected_earth_field_lat_lon

    fix = fixes[0]
    latitude, longitude = (
        float(np.median(each[fix.has_fix])) for each in (fix.latitude_deg, fix.longitude_deg)
    )
    if not (abs(latitude) < 90.0 and abs(longitude) < 180.0):
        return earth_at(evidence.flight.earth, t_s)
    field = expected_earth_field_lat_lon(latitude, longitude)
    return np.tile(UT_PER_MGAUSS * np.array((field.x, field.y, field.z)), (len(t_s), 1))


def lever_of(rows: FieldRows, lever: Lever) -> Array:
    """(N,) the lever of the motors' field; 0 if unknown."""
    if lever is Lever.NONE:
        return np.zeros(len(rows.t_s))
    return np.nan_to_num(rows.throttle if lever is Lever.THROTTLE else rows.current_a)


def headings_flown(rows: FieldRows) -> Mask:
    """(16,) sectors of heading flown for a second or more, from north."""
    sector = np.floor(rows.heading_rad / (2.0 * np.pi) * SECTORS).astype(np.intp) % SECTORS
    return np.asarray(np.bincount(sector, minlength=SECTORS) >= SECTOR_ROWS)


def widest_gap_deg(flown: Mask) -> float:
    """The largest gap between headings flown."""
    places = np.flatnonzero(flown)
    if not len(places):
        return 360.0
    gaps = np.diff(np.append(places, places[0] + SECTORS)) - 1
    return float(gaps.max()) * 360.0 / SECTORS


def _raw(evidence: Evidence, track: CompassTrack, settings: CompassSettings | None) -> Array:
    """(N, 3) fields in the axes of the board, without any calibration."""
    if settings is None:
        return track.m_b_ut
    if evidence.is_raw(track.compass):
        turned: Array = track.m_b_ut @ rotations.matrix(settings.rotation or 0).T
        return turned
    offset, S, motor = settings.correction
    lever = {
        Lever.NONE: None,
        Lever.THROTTLE: evidence.context.throttle,
        Lever.CURRENT: evidence.context.current_a,
    }[settings.lever]
    added = np.nan_to_num(series_at(lever, track.t_s))[:, None] * motor
    added = np.where(np.isfinite(track.motor_ut), track.motor_ut, added)
    own = np.where(np.isfinite(track.offset_ut), track.offset_ut, offset)
    raw: Array = np.linalg.solve(S, (track.m_b_ut - added).T).T - own
    return raw


def _speed(evidence: Evidence, edges: Array) -> Array:
    """(M - 1,) the fastest mean rate of any working IMU; 0 without one."""
    found = np.zeros(len(edges) - 1)
    for track in evidence.context.imus:
        rate = np.linalg.norm(track.w_b, axis=1, keepdims=True).astype(float)
        found = np.fmax(found, means(track.t_s, np.nan_to_num(rate), edges)[:, 0])
    return found

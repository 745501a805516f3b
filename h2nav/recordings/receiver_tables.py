"""GNSS receivers in logs of every format: their column tables, and the tracks they make.

As in `h2nav.recordings.field_tables`: one row for each field and format, today's spelling first.
"""

from typing import NamedTuple

import numpy as np

from h2nav.recordings.columns import Field, RowFinder, Source, column, read, series
from h2nav.recordings.context import Array, GpsTrack, Series
from h2nav.recordings.imu_series import Mask, Times
from h2nav.recordings.log_rows import FIX_AGE_US, Rows
from h2nav.recordings.row_tables import Table
from h2nav.wire.position import DEFAULT_SIGMA_M_S, FASTEST_M_S
from h2nav.wire.vehicle import EARLIEST_UNIX_S, LATEST_UNIX_S

# Of the receivers, the first ones.
MAX_RECEIVERS = 2
FIX_3D = 3
SAME_FIX_US = 100_000
GPS_EPOCH_UNIX_S = 315_964_800.0
WEEK_S = 604_800.0
# Since 2017; one more than in 2015, which does not matter to the field model.
LEAP_S = 18.0
MILLI, CENTI, MICRO = 1e-3, 1e-2, 1e-6
MAX_UINT16 = 65_534.5  # 65535 is unknown
MAX_SATELLITES = 254  # 255 is unknown


class FixColumns(NamedTuple):
    """The fixes of one receiver; NaN where unknown. The velocity has one of two forms."""

    rows: Rows  # with their times
    number: int  # of the receiver, from 0
    fix_type: Array  # (N,) GPS_FIX_TYPE
    latitude_deg: Array  # (N,) WGS84
    longitude_deg: Array  # (N,) WGS84
    altitude_m: Array  # (N,) above mean sea level
    v_n: Array  # (N, 3) NED, m/s
    speed_m_s: Array  # (N,) over ground
    course_deg: Array  # (N,) over ground
    down_m_s: Array  # (N,)
    sigma_m_s: Array  # (N,) accuracy of the velocity
    satellites: Array  # (N,) used
    jamming: Array  # (N,) GPS_JAMMING_STATE
    spoofing: Array  # (N,) GPS_SPOOFING_STATE
    is_used: Array  # (N,) 0 = the autopilot uses another receiver


class AccuracyColumns(NamedTuple):
    """What a message beside the fixes says of them; NaN where unknown."""

    rows: Rows  # with their times
    number: int  # of the receiver, from 0
    sigma_m_s: Array  # (N,) accuracy of the velocity
    has_down: Array  # (N,) 0 = the velocity has no vertical part
    measured_ms: Array  # (N,) time of measurement on the autopilot's clock


class PowerColumns(NamedTuple):
    """The power at the antenna of one receiver; NaN where it measures nothing."""

    rows: Rows  # with their times
    number: int  # of the receiver, from 0
    levels: Array  # (N, 3) noise, gain, narrow lines


class ClockColumns(NamedTuple):
    """The time that one receiver tells; NaN where it has no fix."""

    rows: Rows  # with their times
    number: int  # of the receiver, from 0
    unix_s: Array  # (N,) UNIX time


class Receivers(NamedTuple):
    """The receivers of a recording."""

    tracks: tuple[GpsTrack, ...] = ()  # one per receiver
    used: int = 0  # number of the one that the autopilot used most
    fix_us: Times = np.empty(0, np.int64)  # (N,) times of its fixes, on the autopilot's clock


def valid_velocity(table: Table, *names: str) -> Array:
    """(N, 3) where the receiver does not call it invalid."""
    v_n = table.numbers(*names)
    if "vel_ned_valid" in table:
        v_n[table.integers("vel_ned_valid") == 0] = np.nan
    return v_n


def of_week(table: Table, week: str, time_ms: str, fix_type: str) -> Array:
    """UNIX time of a week and its milliseconds, at fixes of a receiver that knows the date."""
    weeks, times_ms = table.numbers(week), table.numbers(time_ms)
    unix_s = GPS_EPOCH_UNIX_S + WEEK_S * weeks + MILLI * times_ms - LEAP_S
    return _at_fixes(unix_s, table.integers(fix_type))


def utc_at_fixes(table: Table, time_us: str, fix_type: str) -> Array:
    """UNIX time, at fixes of a receiver that knows the date."""
    return _at_fixes(MICRO * table.numbers(time_us), table.integers(fix_type))


def _at_fixes(unix_s: Array, fix_type: Times) -> Array:
    """NaN elsewhere, and before the receiver knows the date: it counts from the first weeks."""
    known = (fix_type >= FIX_3D) & (unix_s >= EARLIEST_UNIX_S) & (unix_s <= LATEST_UNIX_S)
    return np.where(known, unix_s, np.nan)


_PX4_TOPICS = ("sensor_gps", "vehicle_gps_position")  # until 1.11 the second was the receiver
_PX4_PLACES = (
    {
        "latitude_deg": column("latitude_deg"),
        "longitude_deg": column("longitude_deg"),
        "altitude_m": column("altitude_msl_m"),
    },
    # Until 1.14.
    {
        "latitude_deg": column("lat", scale=1e-7),
        "longitude_deg": column("lon", scale=1e-7),
        "altitude_m": column("alt", scale=MILLI),
    },
)

FIXES = Field(
    "fixes",
    "deg, m, m/s",
    record=FixColumns,
    dataflash=(
        Source(
            "GPS",
            {
                "fix_type": column("Status"),
                "latitude_deg": column("Lat"),
                "longitude_deg": column("Lng"),
                "altitude_m": column("Alt"),
                "speed_m_s": column("Spd"),
                "course_deg": column("GCrs"),
                "down_m_s": column("VZ", may_lack=True),  # in spite of its name
                "satellites": column("NSats", may_lack=True),
                "is_used": column("U", may_lack=True),
            },
        ),
    ),
    ulog=tuple(
        Source(
            topic,
            {
                "fix_type": column("fix_type"),
                **places,
                "v_n": column("vel_n_m_s", "vel_e_m_s", "vel_d_m_s", form=valid_velocity),
                "sigma_m_s": column("s_variance_m_s", may_lack=True),
                "satellites": column("satellites_used", may_lack=True),
                "jamming": column("jamming_state", may_lack=True),
                "spoofing": column("spoofing_state", may_lack=True),
            },
        )
        for topic in _PX4_TOPICS
        for places in _PX4_PLACES
    ),
    telemetry=(
        tuple(
            Source(
                message,
                {
                    "fix_type": column("fix_type"),
                    "latitude_deg": column("lat", scale=1e-7),
                    "longitude_deg": column("lon", scale=1e-7),
                    "altitude_m": column("alt", scale=MILLI),
                    "speed_m_s": column("vel", scale=CENTI, most=CENTI * MAX_UINT16),
                    "course_deg": column("cog", scale=CENTI, most=CENTI * MAX_UINT16),
                    "sigma_m_s": column("vel_acc", scale=MILLI, may_lack=True),
                    "satellites": column("satellites_visible", most=MAX_SATELLITES),
                },
                first=number,
            )
            for number, message in enumerate(("GPS_RAW_INT", "GPS2_RAW"))
        ),
    ),
)
ACCURACIES = Field(
    "accuracies",
    "m/s, ms",
    record=AccuracyColumns,
    dataflash=(
        Source(
            "GPA",
            {
                "sigma_m_s": column("SAcc"),
                "has_down": column("VV", may_lack=True),
                "measured_ms": column("SMS", may_lack=True),
            },
        ),
    ),
)
POWERS = Field(
    "powers",
    "as the receiver counts",
    record=PowerColumns,
    dataflash=(
        Source("UBX1", {"levels": column("noisePerMS", "agcCnt", "jamInd", may_lack=True)}),
    ),
    ulog=tuple(
        Source(
            topic,
            {
                "levels": column(
                    "noise_per_ms", "automatic_gain_control", "jamming_indicator", may_lack=True
                )
            },
        )
        for topic in _PX4_TOPICS
    ),
)
CLOCKS = Field(
    "clocks",
    "s",
    record=ClockColumns,
    dataflash=(
        Source("GPS", {"unix_s": column("GWk", "GMS", "Status", form=of_week)}),
        Source("GPS", {"unix_s": column("Week", "TimeMS", "Status", form=of_week)}),
    ),
    ulog=tuple(
        Source(topic, {"unix_s": column("time_utc_usec", "fix_type", form=utc_at_fixes)})
        for topic in _PX4_TOPICS
    ),
)
DATE = Field(
    "unix_s",
    "s",
    dataflash=(
        series("GPS", "GWk", "GMS", "Status", form=of_week),
        series("GPS", "Week", "TimeMS", "Status", form=of_week),
    ),
    ulog=tuple(
        series(topic, "time_utc_usec", scale=MICRO, least=EARLIEST_UNIX_S, most=LATEST_UNIX_S)
        for topic in _PX4_TOPICS
    ),
    telemetry=(
        series(
            "SYSTEM_TIME", "time_unix_usec", scale=MICRO, least=EARLIEST_UNIX_S, most=LATEST_UNIX_S
        ),
    ),
)
RECEIVERS = (FIXES, ACCURACIES, POWERS, CLOCKS, DATE)
"""All of them."""


def start_unix_s(log: RowFinder) -> float | None:
    """The date at the beginning of a recording, by its receiver or clock; None if unknown."""
    found: Series | None = read(log, (DATE,)).values["unix_s"]
    return None if found is None else float(np.median(found.values - found.t_s))


def receivers_of(log: RowFinder) -> Receivers:
    """The receivers of a recording, with what else is known of their fixes."""
    found = read(log, (FIXES, ACCURACIES, POWERS, CLOCKS)).values
    accuracies = {one.number: one for one in found["accuracies"]}
    powers = {one.number: Series(one.rows.t_s, one.levels) for one in found["powers"]}
    clocks = {one.number: Series.finite(one.rows.t_s, one.unix_s) for one in found["clocks"]}
    tracks, stamps, uses = [], {}, {}
    for one in found["fixes"]:
        number = one.number
        if number < MAX_RECEIVERS:
            fixes, stamps[number] = _with_accuracy(one, accuracies.get(number))
            tracks.append(_track(fixes, powers.get(number), clocks.get(number)))
            uses[number] = np.count_nonzero(tracks[-1].has_fix & (fixes.is_used != 0.0))
    if not tracks:
        return Receivers()
    used = max(uses, key=lambda number: uses[number])
    return Receivers(tuple(tracks), used, stamps[used])


def _with_accuracy(fixes: FixColumns, accuracy: AccuracyColumns | None) -> tuple[FixColumns, Times]:
    """Fixes with what the message beside them says, and their times of measurement."""
    rows = fixes.rows
    if accuracy is None:
        return fixes, rows.sample_us
    t_us = accuracy.rows.t_us
    place = np.searchsorted(t_us, rows.t_us).clip(max=len(t_us) - 1)
    is_same = np.abs(t_us[place] - rows.t_us) <= SAME_FIX_US
    age_us = rows.t_us - 1e3 * accuracy.measured_ms[place]
    is_age = is_same & (age_us >= 0) & (age_us <= FIX_AGE_US)
    fixes = fixes._replace(
        sigma_m_s=np.where(is_same, accuracy.sigma_m_s[place], np.nan),
        down_m_s=np.where(is_same & (accuracy.has_down[place] == 0.0), np.nan, fixes.down_m_s),
    )
    return fixes, rows.t_us - np.where(is_age, age_us, 0.0).astype(np.int64)


def _track(fixes: FixColumns, power: Series | None, clock: Series | None) -> GpsTrack:
    place = fixes.latitude_deg, fixes.longitude_deg, fixes.altitude_m
    return GpsTrack(
        fixes.number,
        fixes.rows.t_s,
        (fixes.fix_type >= FIX_3D) & is_on_earth(*place[:2]) & np.isfinite(fixes.altitude_m),
        *place,
        _velocity(fixes),
        np.where(fixes.sigma_m_s > 0.0, fixes.sigma_m_s, DEFAULT_SIGMA_M_S),
        fixes.satellites,
        _states(fixes.jamming),
        _states(fixes.spoofing),
        power,
        clock,
    )


def _velocity(fixes: FixColumns) -> Array:
    """(N, 3) NED; NaN where it is unknown, or faster than anything."""
    v_n = fixes.v_n
    if not np.isfinite(v_n).any():
        speed_m_s, course = fixes.speed_m_s, np.radians(fixes.course_deg)
        v_n = np.stack(
            (speed_m_s * np.cos(course), speed_m_s * np.sin(course), fixes.down_m_s), axis=1
        )
    with np.errstate(invalid="ignore"):
        v_n[~(np.abs(v_n[:, :2]) <= FASTEST_M_S).all(axis=1)] = np.nan
        v_n[~(np.abs(v_n[:, 2]) <= FASTEST_M_S), 2] = np.nan
    return v_n


def _states(values: Array) -> Times | None:
    """(N,) whole numbers; None if the log has none."""
    return None if np.isnan(values).any() else values.astype(np.int64)


def is_on_earth(latitude_deg: Array, longitude_deg: Array) -> Mask:
    """(N,) whether these are a latitude and a longitude."""
    return np.asarray((np.abs(latitude_deg) <= 90.0) & (np.abs(longitude_deg) <= 180.0))

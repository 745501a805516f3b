"""Flights that were never flown, with what the review's page shows: a magnet, a GPS loss, modes."""

import json
import math
import re

import numpy as np
from needs import DEG

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.ratios import InnovationRatios
from h2nav.recordings.context import (
    AttitudeTrack,
    Battery,
    Context,
    GpsTrack,
    ImuTrack,
    Motors,
    ReportedFault,
    Said,
    Series,
    Span,
    Sticks,
)
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.document import document
from h2nav.reviews.flight import EarthFields, Estimates, Flight, Ratios
from h2nav.reviews.page import page
from h2nav.reviews.tracks import (
    Bias,
    CompassFit,
    FieldTrack,
    Peak,
    Receiver,
    Spectrum,
    TimingTrack,
    Vibrations,
)

EARTH_UT, DIP_DEG = 48.0, 64.0
MAGNET_S = (240.0, 360.0)
NO_GPS_S = (420.0, 470.0)


def page_of(flight, analysis):
    """The page of a flight, as `h2nav review` writes it."""
    return page(flight, analysis, document(flight, analysis))


def shown_by(html):
    """What the script of the page draws."""
    block = re.search(r'<script type="application/json" id="review">(.*?)</script>', html)
    return json.loads(block[1])


def text_of(html):
    """What is read, without scripts and styles."""
    html = re.sub(r"<(script|style)\b.*?</\1>", "", html, flags=re.DOTALL)
    return " ".join(re.sub(r"<[^>]*>", " ", html).split()).replace("&#x27;", "'")


def quaternions(roll, pitch, heading):
    """(N, 4) body to NED, of (N,) angles in rad."""
    (cr, sr), (cp, sp), (ch, sh) = (
        (np.cos(0.5 * angle), np.sin(0.5 * angle)) for angle in (roll, pitch, heading)
    )
    return np.column_stack(
        (
            cr * cp * ch + sr * sp * sh,
            sr * cp * ch - cr * sp * sh,
            cr * sp * ch + sr * cp * sh,
            cr * cp * sh - sr * sp * ch,
        )
    )


def _motion(t_s):
    roll = 12.0 * DEG * np.sin(0.31 * t_s) + 3.0 * DEG * np.sin(1.7 * t_s)
    pitch = 8.0 * DEG * np.sin(0.23 * t_s + 1.0)
    return roll, pitch, 0.06 * t_s + 0.5 * np.sin(0.11 * t_s)


def _within(t_s, span):
    return (t_s >= span[0]) & (t_s <= span[1])


def _estimates(t_s, rng, error_deg, sigma_deg):
    roll, pitch, heading = _motion(t_s)
    wander = np.sin(0.05 * t_s + rng.uniform(0.0, 6.0))
    sigma_heading = np.where(_within(t_s, MAGNET_S), 2.5, 1.0) * sigma_deg * DEG
    return Estimates(
        t_s,
        quaternions(
            roll + error_deg * DEG * wander, pitch, heading + 2.0 * error_deg * DEG * wander
        ),
        np.column_stack([0.2 * DEG * np.sin(0.002 * t_s + k) for k in range(3)]),
        np.full(len(t_s), sigma_deg * DEG) * np.where(t_s < 8.0, 5.0, 1.0),
        2.0 * sigma_heading,
    )


def _autopilot(t_s):
    roll, pitch, heading = _motion(t_s)
    magnet = np.where(_within(t_s, MAGNET_S), 1.0, 0.0) * np.clip((t_s - MAGNET_S[0]) / 8.0, 0, 1)
    ekf = AttitudeTrack("EKF3", t_s, quaternions(roll, pitch, heading + 14.0 * DEG * magnet))
    ahrs = AttitudeTrack(
        "AHRS2",
        t_s[::2],
        quaternions(roll + 1.5 * DEG, pitch, heading + 20.0 * DEG * magnet)[::2],
    )
    return ekf, ahrs


def _gps(duration_s):
    t_s = np.arange(0.0, duration_s, 0.2)
    has_fix = ~_within(t_s, NO_GPS_S)
    around = 0.035 * t_s
    north, east = 160.0 * np.sin(around), 90.0 * np.sin(2.0 * around) + 0.1 * t_s
    satellites = np.where(has_fix, 15.0, 3.0)
    return GpsTrack(
        0,
        t_s,
        has_fix,
        np.where(has_fix, 47.4 + north / 111_194.9, np.nan),
        np.where(has_fix, 8.5 + east / (111_194.9 * math.cos(47.4 * DEG)), np.nan),
        450.0 + 40.0 * np.clip(t_s / 60.0, 0.0, 1.0),
        np.column_stack((np.gradient(north, t_s), np.gradient(east, t_s), np.zeros(len(t_s)))),
        np.where(has_fix, 0.3, np.nan),
        satellites,
    )


def _imu(number, t_s, rng):
    shape = (len(t_s), 3)
    return ImuTrack(
        number,
        f"IMU{number}",
        t_s,
        (1e6 * t_s).astype(np.int64),
        0.01 * rng.standard_normal(shape),
        np.array([0.0, 0.0, -9.8]) + 0.3 * rng.standard_normal(shape),
        np.full(shape, np.nan),
    )


def _ratios(duration_s, rng):
    t_s = np.arange(5.0, duration_s, 1.0)
    values = np.abs(0.25 * rng.standard_normal((len(t_s), len(InnovationRatios._fields))))
    for column, name in enumerate(InnovationRatios._fields):
        if name.startswith("velocity"):
            values[_within(t_s, NO_GPS_S), column] = np.nan
        if name.startswith("field"):
            values[_within(t_s, MAGNET_S), column] += 2.4
    return Ratios(t_s, InnovationRatios._fields, values)


FINDINGS = (
    Finding(
        Kind.COMPASS_FIELD, Sensor(SensorKind.COMPASS), Severity.ERROR,
        *MAGNET_S, 14.2, "deg", "compass disturbed",
        "heading +14 deg, dip -9 deg, norm 131% of the earth's",
    ),
    Finding(
        Kind.AUTOPILOT_HEADING, Sensor(SensorKind.AUTOPILOT), Severity.WARNING,
        244.0, 362.0, 14.0, "deg",
        "autopilot heading off 14 deg, GPS backs us",
        "heading of ATTITUDE differs by 14 deg since 118 s; GPS velocity agrees with h2nav",
        backs_us=True,
    ),
    Finding(
        Kind.VIBRATION_LINE, Sensor(SensorKind.IMU, 1), Severity.INFO, 20.0, 590.0, 0.4, "rad/s",
        "gyro vibrates at 84 Hz", "lines at 84 Hz (0.4 rad/s rms, harmonic 1), 168 Hz",
    ),
)  # fmt: skip
GPS_LOST = Finding(
    Kind.GPS_LOST, Sensor(SensorKind.GPS, 1), Severity.WARNING, *NO_GPS_S, 50.0, "s",
    "no fix for 50 s",
    "3 satellites",
)  # fmt: skip


def made_flight(duration_s=600.0, rate_hz=100.0, imus=2, seed=3, **changes):
    """A multirotor with a magnet near its compass for two minutes and a time without GPS."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, duration_s, 1.0 / rate_hz)
    slow_s = np.arange(0.0, duration_s, 10.0)
    ekf, ahrs = _autopilot(np.arange(0.0, duration_s, 0.04))
    roll, pitch, heading = _motion(t_s)
    context = Context(
        firmware="ArduCopter V4.5.1",
        vehicle="quadrotor",
        start_unix_s=1_700_000_000.0,
        duration_s=duration_s,
        imus=tuple(_imu(number, t_s, rng) for number in range(imus)),
        attitudes=(ekf, ahrs),
        truth=AttitudeTrack("truth", t_s[::5], quaternions(roll, pitch, heading)[::5]),
        gps=(_gps(duration_s),),
        modes=(
            Span(0.0, 30.0, "STABILIZE"),
            Span(30.0, 200.0, "LOITER"),
            Span(200.0, 540.0, "AUTO"),
            Span(540.0, duration_s, "RTL"),
        ),
        armed=(Span(10.0, duration_s - 10.0, "armed"),),
        primary=(Span(0.0, 300.0, "EKF3 core 0"), Span(300.0, duration_s, "EKF3 core 1")),
        said=(Said(1.0, Severity.INFO, "ArduCopter V4.5.1"),),
        throttle=Series(slow_s, 0.5 + 0.1 * np.sin(0.1 * slow_s)),
        wind_n_m_s=Series(slow_s, np.tile([-3.0, 2.0], (len(slow_s), 1))),
        missing=("no temperatures",),
    )
    flight = Flight(
        name="made",
        file="made.tlog",
        kind="tlog",
        autopilot="ArduPilot quadrotor 1/1",
        context=context,
        estimates=_estimates(t_s, rng, 0.3, 0.35),
        smoothed=_estimates(t_s, rng, 0.1, 0.15),
        why_no_estimate="",
        imu_message="RAW_IMU",
        ratios=_ratios(duration_s, rng),
        earth=EarthFields(
            np.array([3.0]), np.array([EARTH_UT]), np.array([DIP_DEG * DEG]), np.array([0.05])
        ),
        states=(
            Span(0.0, 5.0, "aligning"),
            Span(5.0, 250.0, "active"),
            Span(250.0, 360.0, "degraded: attitude contradicts field"),
            Span(360.0, duration_s, "active"),
        ),
        lanes=(Span(0.0, duration_s, "IMU 1"),),
        notices=((250.0, "critical", "degraded: attitude contradicts field"),),
        findings=FINDINGS,
        rejected={"RAW_IMU: stale": 2},
    )
    return flight._replace(**changes)


def _falling(t_s):
    """Roll, pitch and heading of a vehicle that tips over from 100 s on and lies from 104 s on."""
    roll, pitch, heading = _motion(t_s)
    lost_s = np.clip(t_s - 100.0, 0.0, 4.0)
    is_down = t_s > 104.0
    pitch = np.where(is_down, -70.0 * DEG, pitch - 60.0 * DEG * (1.0 - np.exp(-lost_s)))
    return np.where(is_down, 15.0 * DEG, roll), pitch, heading + 0.3 * lost_s**2


def made_crash():
    """Motor 1 fails at 99.5 s, control is lost, it comes down at 104 s of 112; and its analysis."""
    flight = made_flight(112.0, 50.0, imus=1)
    t_s = np.arange(0.0, 112.0, 0.1)
    roll, pitch, heading = _motion(t_s)
    height_m = np.interp(t_s, (0.0, 8.0, 14.0, 101.0, 104.0), (0.0, 0.0, 20.0, 20.0, 0.0))
    throttle = np.where((t_s > 8.0) & (t_s < 104.5), 0.5 + 0.03 * np.sin(t_s), 0.0)
    share = np.tile(throttle[:, None], (1, 4)) + 0.04 * np.sin(np.outer(t_s, (1.1, 1.3, 1.7, 1.9)))
    is_lost = _within(t_s, (99.5, 104.5))
    share[is_lost] = (1.0, 0.6, 0.15, 0.8)
    pwm_us = np.where(throttle[:, None] > 0.0, 1000.0 + 1000.0 * share, 1000.0)
    lost = Finding(
        Kind.LOSS_OF_CONTROL, Sensor(SensorKind.VEHICLE), Severity.ERROR, 100.0, 104.0, 55.0,
        "deg", "pitch -60 deg where -5 was demanded", "motor 1 at its limit from 99.5 s on",
        id="loss_of_control.vehicle.1",
    )  # fmt: skip
    crash = Finding(
        Kind.CRASH, Sensor(SensorKind.VEHICLE), Severity.CRITICAL, 104.0, 105.0, 9.0, "g",
        "came down hard", "9 g", id="crash.vehicle.1", cause="loss_of_control.vehicle.1",
    )  # fmt: skip
    context = flight.context._replace(
        attitudes=tuple(_fallen(track) for track in flight.context.attitudes[:1]),
        truth=None,
        modes=(
            Span(0.0, 60.0, "STABILIZE"), Span(60.0, 103.0, "LOITER"), Span(103.0, 112.0, "LAND"),
        ),
        armed=(Span(5.0, 112.0, "armed"),),
        demand=Series(t_s, np.column_stack((roll, pitch, heading))),
        demanded_rates=Series(
            t_s, np.gradient(np.column_stack((roll, pitch, heading)), 0.1, axis=0)
        ),
        sticks=Sticks(t_s, 0.4 * np.sin(t_s), 0.2 * np.cos(t_s), np.zeros(len(t_s)), throttle),
        motors=Motors((1, 2, 3, 4), t_s, pwm_us, 1000.0, 2000.0),
        throttle=Series(t_s, throttle),
        height_m=Series(t_s, height_m),
        height_demand_m=Series(t_s, np.where(height_m > 0.0, 20.0, 0.0)),
        climb_m_s=Series(t_s, np.gradient(height_m, t_s)),
        baro_height_m=Series(t_s, height_m + 60.0),
        batteries=(
            Battery(0, t_s, 12.6 - 0.01 * t_s - throttle, 20.0 * throttle, 1.0 - 0.005 * t_s),
        ),
        gps=(flight.context.gps[0].part(slice(round(104.0 / 0.2))),),
        faults=(ReportedFault(102.0, "battery", 1, "low"),),
        airborne=Series(np.array([0.0, 8.0]), np.array([0.0, 1.0])),
        said=(Said(103.0, Severity.WARNING, "Battery Failsafe - Land"),),
    )  # fmt: skip
    flight = flight._replace(
        context=context,
        estimates=_fallen(flight.estimates),
        smoothed=_fallen(flight.smoothed),
        findings=(lost, crash),
    )
    return flight, made_analysis(flight)._replace(findings=())


def _fallen(track):
    return track._replace(q_nb=quaternions(*_falling(track.t_s)))


def made_analysis(flight, seed=4):
    """What would have been found in it, with arrays of the lengths that real ones have."""
    rng = np.random.default_rng(seed)
    end_s = flight.context.duration_s
    t_s = np.linspace(0.0, end_s, 2000)
    imus = [track.imu for track in flight.context.imus]
    is_magnet = _within(t_s, MAGNET_S)
    field = FieldTrack(
        0, t_s, EARTH_UT + rng.normal(0.0, 0.5, 2000) + 15.0 * is_magnet,
        (DIP_DEG - 9.0 * is_magnet + rng.normal(0.0, 0.5, 2000)) * DEG,
        (14.0 * is_magnet + rng.normal(0.0, 1.0, 2000)) * DEG,
        np.full(2000, EARTH_UT), np.full(2000, DIP_DEG * DEG),
    )  # fmt: skip
    sectors = np.arange(24) * 15.0 * DEG
    fit = CompassFit(
        0, sectors, 4.0 + 3.0 * np.sin(sectors), np.full(24, 1.0), 5.0 * DEG * np.sin(sectors),
        np.array([3.0, -2.0, 1.0]), 1.02, np.linspace(0.0, 1.0, 10), np.linspace(0.5, 5.0, 10),
        np.array([2.0, 1.0, -4.0]),
    )  # fmt: skip
    columns_s = np.linspace(0.0, end_s, 1000)
    return Analysis(
        looked_at=("crash and landing",),
        findings=(GPS_LOST,),
        spectra=tuple(
            _spectrum(imu, sensor, end_s, rng)
            for imu in imus
            for sensor in ("gyro", "accelerometer")
        ),
        vibrations=tuple(
            Vibrations(imu, t_s, np.abs(rng.normal(4.0, 1.0, (2000, 3))), 30.0, 0) for imu in imus
        ),
        fields=(field,),
        compasses=(fit,),
        biases=tuple(
            Bias(imu, t_s, np.column_stack([0.2 * DEG * np.sin(0.002 * t_s + k) for k in range(3)]),
                 1.0 * DEG, np.array([2.0, 4.0]), np.array([9.81, 9.8]))
            for imu in imus
        ),
        timings=tuple(
            TimingTrack(imu, f"IMU{imu}", columns_s, rng.normal(100.0, 0.3, 1000),
                   rng.uniform(0.01, 0.03, 1000), rng.uniform(0.0, 0.02, 1000))
            for imu in imus
        ),
        receivers=(
            Receiver(0, t_s, rng.normal(0.0, 0.2, (2000, 3)), rng.uniform(0.0, 1.0, 2000),
                     np.full(2000, 0.3), np.where(_within(t_s, NO_GPS_S), 3.0, 15.0), 0.22),
        ),
    )  # fmt: skip


def _spectrum(imu, sensor, end_s, rng):
    frequency, t_s = np.linspace(0.0, 200.0, 256), np.linspace(1.0, end_s - 1.0, 300)
    line = 84.0 + 6.0 * np.sin(0.1 * t_s)
    away = np.minimum(
        np.abs(frequency - line[:, None]), 2.0 * np.abs(frequency - 2.0 * line[:, None])
    )
    levels = 0.02 * rng.random((300, 256)) + np.exp(-((away / 3.0) ** 2))
    density = np.tile(levels.mean(axis=0)[:, None], (1, 3)) * [1.0, 0.7, 0.4]
    peaks = (Peak(84.0, 5.0, 0.4, 1), Peak(168.0, 6.0, 0.1, 2))
    unit = "rad/s" if sensor == "gyro" else "m/s^2"
    return Spectrum(
        imu, sensor, unit, 400.0, False, frequency, density, peaks, t_s, levels.astype(np.float32)
    )

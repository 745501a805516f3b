"""Pictures of the sensors: bias, vibration, throttle, rates and gaps, receivers."""

from itertools import chain

import numpy as np

from h2nav.maths.units import DEG
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.flight import Flight
from h2nav.reviews.pictures import colours
from h2nav.reviews.pictures.columns import COARSE, Columns
from h2nav.reviews.pictures.picture import Lines, Picture, PictureMark, Section, Trace

MS = 1e-3


def bias(flight: Flight, analysis: Analysis) -> Section:
    """Bias of each gyro; the first IMU at once, the others on demand."""
    columns = Columns(flight.context.duration_s, COARSE)
    of_imus: list[list[Picture]] = []
    for one in analysis.biases:
        limit = one.gyro_limit / DEG
        traces = tuple(
            Trace(axis, colour, columns.of(one.t_s, one.gyro_b[:, k] / DEG))
            for k, (axis, colour) in enumerate(
                zip(("roll axis", "pitch axis", "yaw axis"), colours.NUMBERED[:3], strict=True)
            )
        )
        picture = Lines(
            f"Gyro bias, IMU {one.imu + 1}",
            "What the gyro measures while nothing turns, as the filter has learnt it.",
            "deg/s",
            traces,
            (PictureMark(limit, "data sheet"), PictureMark(-limit, "data sheet"))
            if np.isfinite(limit)
            else (),
            digits=3,
        )
        of_imus.append([picture])
        if len(one.force_t_s):
            of_imus[-1].append(_force(columns, one.imu, one.force_t_s, one.force_norm))
    first = tuple(chain.from_iterable(of_imus[:1]))
    further = tuple(chain.from_iterable(of_imus[1:]))
    return Section("bias", "Gyro and accelerometer bias", first, further=further)


def _force(columns: Columns, imu: int, t_s: np.ndarray, norm: np.ndarray) -> Lines:
    return Lines(
        f"Accelerometer at rest, IMU {imu + 1}",
        "The force that it measures while the vehicle stands still; gravity is 9.8 m/s².",
        "m/s²",
        (Trace("norm of the force", colours.of(colours.NUMBERED, imu), columns.of(t_s, norm)),),
        (PictureMark(9.80665, "gravity"),),
        digits=3,
    )


def vibration(flight: Flight, analysis: Analysis) -> Section:
    """Vibration of every IMU, and the throttle under it."""
    columns = Columns(flight.context.duration_s, COARSE)
    pictures: list[Picture] = []
    if analysis.vibrations:
        traces = tuple(
            Trace(
                f"IMU {one.imu + 1}",
                colours.of(colours.NUMBERED, one.imu),
                columns.of(one.t_s, one.level.max(axis=1, initial=0.0)),
            )
            for one in analysis.vibrations
        )
        limit = analysis.vibrations[0].limit
        pictures.append(
            Lines(
                "Vibration",
                "How strongly the accelerometer is shaken, on its worst axis, as ArduPilot's VIBE.",
                "m/s²",
                traces,
                (PictureMark(limit, f"limit {limit:.0f} m/s²"),),
                at_least=(0.0, 1.0),
            )
        )
    throttle = flight.context.throttle
    if throttle is not None and len(throttle.t_s):
        points = columns.of(throttle.t_s, 100.0 * throttle.values)
        trace = Trace("throttle", colours.LIMIT, points)
        pictures.append(Lines("Throttle", "", "%", (trace,), digits=0))
    return Section("vibration", "Vibration", tuple(pictures))


def timing(flight: Flight, analysis: Analysis) -> Section:
    """Samples per second, gaps, lateness."""
    columns = Columns(flight.context.duration_s, COARSE)
    rates, gaps, late = [], [], []
    # Of few samples, or without times, nothing is known.
    for one in (timed for timed in analysis.timings if len(timed.t_s)):
        label, colour = f"IMU {one.imu + 1}", colours.of(colours.NUMBERED, one.imu)
        rates.append(Trace(label, colour, columns.of(one.t_s, one.rate_hz)))
        gaps.append(Trace(label, colour, columns.of(one.t_s, one.longest_s / MS)))
        if np.isfinite(one.lateness_s).any():
            late.append(Trace(label, colour, columns.of(one.t_s, one.lateness_s / MS)))
    pictures = [
        Lines(title, about, unit, tuple(traces), digits=1, at_least=(0.0, 1.0))
        for title, about, unit, traces in (
            ("Samples per second", "How often each IMU was recorded.", "Hz", rates),
            ("Longest gap", "The longest time between two samples.", "ms", gaps),
            (
                "Late samples",
                "How much later than usual samples reached the recorder.",
                "ms",
                late,
            ),
        )
        if traces
    ]
    return Section("timing", "Rates and gaps", tuple(pictures))


def receivers(flight: Flight, analysis: Analysis) -> Section:
    """GPS velocity against inertial motion, and the receivers' own accuracy."""
    columns = Columns(flight.context.duration_s, COARSE)
    apart: list[Trace] = []
    satellites: list[Trace] = []
    accuracy: list[Trace] = []
    for one in analysis.receivers:
        label, colour = f"GPS {one.receiver + 1}", colours.of(colours.NUMBERED, one.receiver)
        norm = np.linalg.norm(one.difference_n, axis=1)
        for traces, values in ((apart, norm), (satellites, one.satellites)):
            if np.isfinite(values).any():
                traces.append(Trace(label, colour, columns.of(one.t_s, values)))
        if np.isfinite(one.sigma_m_s).any():
            accuracy.append(Trace(label, colour, columns.of(one.t_s, one.sigma_m_s)))
    pictures = [
        Lines(title, about, unit, tuple(traces), digits=digits, at_least=(0.0, 1.0))
        for title, about, unit, digits, traces in (
            (
                "Change of velocity: GPS against IMU",
                "How far the receiver's change of velocity is from what the IMU felt, over "
                "short windows.",
                "m/s",
                2,
                apart,
            ),
            (
                "Accuracy of the velocity",
                "As the receiver states it.",
                "m/s",
                2,
                accuracy,
            ),
            ("Satellites", "In use.", "", 0, satellites),
        )
        if traces
    ]
    return Section("gps", "GPS", tuple(pictures))

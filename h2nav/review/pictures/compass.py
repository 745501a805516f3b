"""Pictures of the magnetic field against the earth's, over time, heading and throttle."""

import numpy as np

from h2nav.maths.units import DEG
from h2nav.review.analysis import Analysis
from h2nav.review.flight import Flight
from h2nav.review.pictures import colours
from h2nav.review.pictures.columns import COARSE, Columns
from h2nav.review.pictures.picture import Curves, Lines, Picture, Section, Trace
from h2nav.review.tracks import CompassFit

_MODEL = "The dashed black line is the earth's field at this place (World Magnetic Model)."


def compass(flight: Flight, analysis: Analysis) -> Section:
    """Strength, dip and heading of every compass; what is left over heading and throttle."""
    columns = Columns(flight.context.duration_s, COARSE)
    norms, dips, headings = [], [], []
    for one in analysis.fields:
        label, colour = f"compass {one.compass + 1}", colours.of(colours.SENSORS, one.compass)
        norms.append(Trace(label, colour, columns.of(one.t_s, one.norm_ut)))
        dips.append(Trace(label, colour, columns.of(one.t_s, one.dip_rad / DEG)))
        headings.append(Trace(label, colour, columns.of(one.t_s, one.heading_rad / DEG, 360.0)))
    for one in analysis.fields[:1]:
        for traces, values in ((norms, one.model_norm_ut), (dips, one.model_dip_rad / DEG)):
            points = columns.of(one.t_s, values)
            traces.append(Trace("earth's field", colours.MODEL, points, is_dashed=True))
    pictures: list[Picture] = [
        Lines(title, about, unit, tuple(traces))
        for title, about, unit, traces in (
            ("Strength of the field", _MODEL, "µT", norms),
            (
                "Dip of the field",
                "How steeply the field points into the ground, by the best attitude. " + _MODEL,
                "deg",
                dips,
            ),
            (
                "Heading error of the compass",
                "The compass's heading less that of the best attitude.",
                "deg",
                headings,
            ),
        )
        if any(np.isfinite(trace.values).any() for trace in traces)
    ]
    for fit in analysis.compasses:
        pictures += _fits(fit)
    return Section("compass", "Compass", tuple(pictures))


def _fits(fit: CompassFit) -> list[Picture]:
    name, colour = f"compass {fit.compass + 1}", colours.of(colours.SENSORS, fit.compass)
    pictures: list[Picture] = []
    if np.isfinite(fit.residual_ut).any():
        traces = [Trace("measured less earth's", colour, fit.residual_ut.astype(np.float32))]
        if np.isfinite(fit.fitted_ut).any():
            fitted = fit.fitted_ut.astype(np.float32)
            label = "the same after a new calibration"
            traces.append(Trace(label, "#555555", fitted, is_dashed=True))
        about = (
            "What is left between the measured field and the earth's, by where the nose pointed. "
            "A well calibrated compass has a few µT everywhere."
        )
        title, on_x = f"Error by heading, {name}", "heading, deg"
        pictures.append(Curves(title, about, "µT", on_x, fit.heading_rad / DEG, tuple(traces)))
    if len(fit.throttle) > 1 and np.isfinite(fit.motor_ut).any():
        trace = Trace("change of the field", colour, fit.motor_ut.astype(np.float32))
        pictures.append(
            Curves(
                f"Error by throttle, {name}",
                "A line that rises with the throttle is the field of the motors' current.",
                "µT",
                "throttle, %",
                100.0 * fit.throttle,
                (trace,),
            )
        )
    return pictures

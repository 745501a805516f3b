"""Pictures of the magnetic field against the earth's, over time, heading and throttle."""

import numpy as np

from h2nav.maths.units import DEG
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.flight import Flight
from h2nav.reviews.pictures import colours
from h2nav.reviews.pictures.columns import COARSE, Columns
from h2nav.reviews.pictures.picture import Curves, Dash, Lines, Picture, Section, Trace

_MODEL = "The dashed black line is the earth's field at this place (World Magnetic Model)."


def compass(flight: Flight, analysis: Analysis) -> Section:
    """Strength, dip and heading of every compass; residuals over heading and throttle."""
    columns = Columns(flight.context.duration_s, COARSE)
    norms, dips, headings = [], [], []
    for one in analysis.fields:
        label, colour = f"compass {one.compass + 1}", colours.of(colours.NUMBERED, one.compass)
        norms.append(Trace(label, colour, columns.of(one.t_s, one.norm_ut)))
        dips.append(Trace(label, colour, columns.of(one.t_s, one.dip_rad / DEG)))
        headings.append(Trace(label, colour, columns.of(one.t_s, one.heading_rad / DEG, 360.0)))
    for one in analysis.fields[:1]:
        for traces, values in ((norms, one.model_norm_ut), (dips, one.model_dip_rad / DEG)):
            points = columns.of(one.t_s, values)
            traces.append(Trace("earth's field", colours.MODEL, points, dash=Dash.DASHED))
    pictures: list[Picture] = [
        Lines(title, about, unit, tuple(traces))
        for title, about, unit, traces in (
            ("Strength of the field", _MODEL, "µT", norms),
            (
                "Dip of the field",
                "How steeply the field points into the ground (out of it where negative), by the "
                "best attitude. " + _MODEL,
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
    return Section(
        "compass", "Compass", (*pictures, *_by_heading(analysis), *_by_throttle(analysis))
    )


def _by_heading(analysis: Analysis) -> list[Curves]:
    """All compasses in one picture: their sectors are the same."""
    fits = [fit for fit in analysis.compasses if np.isfinite(fit.residual_ut).any()]
    traces = []
    for fit in fits:
        name, colour = f"compass {fit.compass + 1}", colours.of(colours.NUMBERED, fit.compass)
        traces.append(Trace(name, colour, fit.residual_ut.astype(np.float32)))
        if np.isfinite(fit.fitted_ut).any():
            fitted = fit.fitted_ut.astype(np.float32)
            traces.append(Trace(f"{name}, calibrated anew", colour, fitted, dash=Dash.DASHED))
    about = (
        "What is left between the measured field and the earth's, by where the nose pointed. "
        "A well calibrated compass has a few µT everywhere."
    )
    return [
        Curves("Error by heading", about, "µT", "heading, deg", x, tuple(traces))
        for x in [fit.heading_rad / DEG for fit in fits][:1]
    ]


def _by_throttle(analysis: Analysis) -> list[Curves]:
    return [
        Curves(
            f"Error by throttle, compass {fit.compass + 1}",
            "A line that rises with the throttle is the field of the motors' current.",
            "µT",
            "throttle, %",
            100.0 * fit.throttle,
            (
                Trace(
                    "change of the field",
                    colours.of(colours.NUMBERED, fit.compass),
                    fit.motor_ut.astype(np.float32),
                ),
            ),
        )
        for fit in analysis.compasses
        if len(fit.throttle) > 1 and np.isfinite(fit.motor_ut).any()
    ]

"""Pictures of control: the pilot's sticks, and the demanded rates against those that followed."""

import numpy as np

from h2nav.maths.units import DEG
from h2nav.recordings.context import Context
from h2nav.reviews.flight import Flight
from h2nav.reviews.inertial import rate_of
from h2nav.reviews.pictures import colours
from h2nav.reviews.pictures.columns import COARSE, FINE, Columns
from h2nav.reviews.pictures.picture import Dash, Lines, Section, Trace
from h2nav.reviews.pictures.vehicle import filled, traces_of

_AXES = (
    ("Roll rate", "Positive is right wing down."),
    ("Pitch rate", "Positive is nose up."),
    ("Yaw rate", "Positive is to the right."),
)
# A gyro that is logged more slowly than this shows no rates.
MIN_RATE_HZ = 8.0


def control(flight: Flight) -> Section:
    """The sticks, and each axis with its demand."""
    columns = Columns(flight.context.duration_s, FINE // 2)
    pictures = (
        stick_lines(flight.context, Columns(flight.context.duration_s, COARSE)),
        *rate_lines(flight.context, columns),
    )
    return Section("control", "Sticks, and rates against their demand", filled(pictures))


def stick_lines(context: Context, columns: Columns) -> Lines:
    """The sticks as shares of their travel; without traces if they were not recorded."""
    sticks = context.sticks
    traces: list[Trace] = []
    if sticks is not None and len(sticks.t_s):
        moved = (sticks.roll, sticks.pitch, sticks.yaw)
        for number, (name, values) in enumerate(zip(("roll", "pitch", "yaw"), moved, strict=True)):
            colour, dash = colours.numbered(number)
            traces += traces_of(columns, (name, colour, sticks.t_s, 100.0 * values), dash=dash)
        throttle = ("throttle", colours.THROTTLE, sticks.t_s, 100.0 * sticks.throttle)
        traces += traces_of(columns, throttle, dash=Dash.DASHED)
    about = (
        "What the pilot asked for, in percent of the stick's travel: roll and yaw positive to the "
        "right, pitch positive for the nose up; throttle (dashed) from 0 to 100."
    )
    return Lines("Sticks", about, "%", tuple(traces), digits=0, at_least=(-100.0, 100.0))


def rate_lines(context: Context, columns: Columns) -> tuple[Lines, ...]:
    """Rates of the body by the first gyro, each with its demand; none without a demand."""
    asked = context.demanded_rates
    if asked is None or len(asked.t_s) == 0:
        return ()
    gyro = next((one for one in context.imus if _shows_rates(one.t_s)), None)
    pictures = []
    for axis, (title, about) in enumerate(_AXES):
        traces: list[Trace] = []
        if gyro is not None:
            name = f"gyro {gyro.imu + 1}"
            rates = (name, colours.OURS, gyro.t_s, gyro.w_b[:, axis] / DEG)
            traces += traces_of(columns, rates)
        demand = ("demand", colours.DEMAND, asked.t_s, asked.values[:, axis] / DEG)
        traces += traces_of(columns, demand)
        pictures.append(Lines(title, f"{about} Dashed: the demand.", "deg/s", tuple(traces)))
    return tuple(pictures)


def _shows_rates(t_s: np.ndarray) -> bool:
    return len(t_s) > 1 and rate_of(t_s) >= MIN_RATE_HZ

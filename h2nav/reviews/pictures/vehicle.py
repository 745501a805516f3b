"""Pictures of the vehicle: demands, height, motors, battery."""

import numpy as np

from h2nav.maths.units import DEG
from h2nav.recordings.context import Array, Context, Series
from h2nav.reviews.flight import Flight
from h2nav.reviews.html import table
from h2nav.reviews.pictures import colours
from h2nav.reviews.pictures.columns import COARSE, FINE, Columns
from h2nav.reviews.pictures.grounds import GroundContact
from h2nav.reviews.pictures.picture import Dash, Lines, Picture, Section, Trace

MAX_MOTORS = 12
# Voltage up to this means that it was not measured.
MIN_VOLTAGE_V = 1.0
# Length over which the heights of barometer and estimate are aligned.
BEGIN_S = 2.0
_ANGLES = ("roll", "pitch", "heading")


def demand(context: Context, columns: Columns, angle: str, cut_rad: float = 0.0) -> list[Trace]:
    """Demanded roll, pitch or heading; none if unknown.

    Args:
        angle: ``roll``, ``pitch`` or ``heading``.
        cut_rad: the end of the picture's range of headings.
    """
    asked = context.demand
    if asked is None or len(asked.t_s) == 0:
        return []
    values = asked.values[:, _ANGLES.index(angle)]
    turn = None
    if angle == "heading":
        values = (values - cut_rad) % (2.0 * np.pi) + cut_rad - 2.0 * np.pi
        turn = 360.0
    return traces_of(columns, ("demand", colours.DEMAND, asked.t_s, values / DEG), turn=turn)


def height_lines(context: Context, columns: Columns) -> Lines:
    """Height, its demand, and the barometer's."""
    asked = context.height_demand_m
    if asked is not None:
        # Exactly zero is logged in modes without a height demand.
        asked = asked._replace(values=np.where(asked.values == 0.0, np.nan, asked.values))
    traces = [
        *traces_of(columns, _series("height", colours.OURS, context.height_m)),
        *traces_of(columns, _series("barometer", colours.NUMBERED[2], _from_the_start(context))),
        *traces_of(columns, _series("demand", colours.DEMAND, asked)),
    ]
    about = "Above the start, the autopilot's estimate; dashed: the demand."
    return Lines("Height", about, "m", tuple(traces))


def _from_the_start(context: Context) -> Series | None:
    """The barometer's height, shifted to the beginning of the estimate."""
    baro, height = context.baro_height_m, context.height_m
    if baro is None or height is None or min(len(baro.t_s), len(height.t_s)) == 0:
        return baro
    first = baro.t_s <= max(baro.t_s[0], height.t_s[0]) + BEGIN_S
    apart = baro.values[first] - np.interp(baro.t_s[first], height.t_s, height.values)
    shift = float(np.nanmedian(apart)) if np.isfinite(apart).any() else 0.0
    return baro._replace(values=baro.values - shift)


def height(flight: Flight, met: tuple[GroundContact, ...]) -> Section:
    """Height and climb, and how fast it met the ground.

    Args:
        met: take-offs, landings and crashes.
    """
    context = flight.context
    columns = Columns(context.duration_s, COARSE)
    climb = traces_of(columns, _series("climb", colours.OURS, context.climb_m_s))
    about = "Positive upward, as the autopilot estimates it."
    pictures = (
        height_lines(context, columns),
        Lines("Climb", about, "m/s", tuple(climb)),
    )
    return Section("height", "Height", filled(pictures), _landings(met))


def _landings(met: tuple[GroundContact, ...]) -> str:
    """A table of the vertical speeds at which it met the ground."""
    rows = [
        (f"{one.t_s:.1f}", one.name, f"{one.speed_m_s:.1f}" if np.isfinite(one.speed_m_s) else "–")
        for one in met
        if one.name != "take-off"
    ]
    if not rows:
        return ""
    heads = ("s", "how it came down", "vertical speed at the ground, m/s")
    return f"<h3>Touchdowns</h3>{table(heads, rows)}"


def motor_lines(context: Context, columns: Columns) -> Lines:
    """Outputs and throttle, as shares of their ranges."""
    traces: list[Trace] = []
    motors = context.motors
    if motors is not None and len(motors.t_s):
        share = 100.0 * motors.share()
        for column, number in enumerate(motors.numbers[:MAX_MOTORS]):
            traces += _motor(columns, number, motors.t_s, share[:, column])
    throttle = context.throttle
    if throttle is not None and len(throttle.t_s):
        asked = ("throttle", colours.THROTTLE, throttle.t_s, 100.0 * throttle.values)
        traces += traces_of(columns, asked, dash=Dash.DASHED if traces else Dash.NONE)
    about = (
        "0 % is a motor at rest, 100 % the autopilot's largest output. A motor far above the "
        "others makes up for a weak one or a bent arm; at 100 % nothing is left for control."
    )
    return Lines("Motors and throttle", about, "%", tuple(traces), digits=0, at_least=(0.0, 100.0))


def _motor(columns: Columns, number: int, t_s: Array, values: Array) -> list[Trace]:
    """A motor's line: the same colour, dash and tag in every picture."""
    colour, dash = colours.numbered(number - 1)
    traces = traces_of(columns, (f"motor {number}", colour, t_s, values), dash=dash)
    return [trace._replace(tag=str(number)) for trace in traces]


def motors(flight: Flight) -> Section:
    """Motor outputs, throttle, and the speeds reported by controllers."""
    context = flight.context
    columns = Columns(context.duration_s, FINE // 2)
    speeds = [
        trace
        for one in context.escs[:MAX_MOTORS]
        for trace in _motor(columns, one.number, one.t_s, one.rpm)
    ]
    pictures = (
        motor_lines(context, columns),
        Lines(
            "Speed of the motors", "As their controllers report it.", "rpm", tuple(speeds), digits=0
        ),
    )
    return Section("motors", "Motors", filled(pictures))


def voltage_lines(context: Context, columns: Columns) -> Lines:
    """Voltage of every measured battery."""
    traces = [
        trace
        for one in context.batteries
        if np.nanmax(np.append(one.voltage_v, 0.0)) > MIN_VOLTAGE_V
        for trace in traces_of(
            columns,
            (
                _battery(one.number),
                colours.of(colours.NUMBERED, one.number),
                one.t_s,
                one.voltage_v,
            ),
        )
    ]
    return Lines("Battery voltage", "It sags under load.", "V", tuple(traces), digits=2)


def battery(flight: Flight) -> Section:
    """Voltage, current, and the autopilot's own supply."""
    context = flight.context
    columns = Columns(context.duration_s, COARSE)
    currents = [
        trace
        for one in context.batteries
        if np.nanmax(np.append(one.current_a, 0.0)) > 0.0
        for trace in traces_of(
            columns,
            (
                _battery(one.number),
                colours.of(colours.NUMBERED, one.number),
                one.t_s,
                one.current_a,
            ),
        )
    ]
    board = traces_of(columns, _series("supply", colours.NUMBERED[0], context.board_v))
    pictures = (
        voltage_lines(context, columns),
        Lines("Battery current", "", "A", tuple(currents)),
        Lines("Supply of the autopilot", "", "V", tuple(board), digits=2),
    )
    return Section("battery", "Battery", filled(pictures))


def _battery(number: int) -> str:
    return f"battery {number + 1}"


def _series(label: str, colour: str, series: Series | None) -> tuple[str, str, Array, Array]:
    if series is None:
        return (label, colour, np.zeros(0), np.zeros(0))
    return (label, colour, series.t_s, series.values)


def traces_of(
    columns: Columns,
    line: tuple[str, str, Array, Array],
    *,
    dash: Dash = Dash.NONE,
    turn: float | None = None,
) -> list[Trace]:
    """One trace, or none if there is nothing to draw."""
    label, colour, t_s, values = line
    points = columns.of(t_s, values, turn)
    if not np.isfinite(points).any():
        return []
    return [Trace(label, colour, points, dash=Dash.DASHED if colour == colours.DEMAND else dash)]


def filled(pictures: tuple[Lines, ...]) -> tuple[Picture, ...]:
    """Those with something to draw."""
    return tuple(picture for picture in pictures if picture.traces)

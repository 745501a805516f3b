"""The colours of the pictures, distinguishable with any colour vision.

Okabe and Ito's for estimators, Tol's for sensors and axes.
"""

OURS = "#0072b2"
SMOOTHED = "#009e73"
TRUTH = "#000000"
MODEL = "#000000"
AUTOPILOT = ("#d55e00", "#e69f00", "#cc79a7", "#8a5a2b")
SENSORS = ("#332288", "#44aa99", "#aa4499", "#999933")
# The demand; and motors, with throttle over them.
DEMAND, THROTTLE = "#7a1fa2", "#1a1a1a"
MOTORS = (
    "#332288", "#88ccee", "#44aa99", "#117733", "#999933", "#ddaa33", "#cc6677", "#882255",
    "#aa4499", "#5566aa", "#777777", "#995522",
)  # fmt: skip
AXES = ("#4477aa", "#ee6677", "#228833")
# Backgrounds: pale, and also labelled.
MODES = ("#eef3fa", "#fdf3e1", "#eaf6ee", "#f8ecf4", "#f1f1e6", "#e8f4f6")
BARS = ("#a6c8e8", "#f6cf8f", "#a9d9bd", "#e3b6d3", "#cfcf9f", "#a4d4dc")
IMPACT, REPORTED = "#b03a00", "#8a8a8a"
GOOD, DOUBTFUL, BAD, UNKNOWN = "#a6d8c2", "#ffd479", "#e08a5e", "#d5d5d5"


def of(palette: tuple[str, ...], number: int) -> str:
    """The colour of a number; they repeat if there are too few."""
    return palette[number % len(palette)]

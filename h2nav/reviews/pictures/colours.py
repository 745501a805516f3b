"""The colours of the pictures, distinguishable with any colour vision, in light and in dark.

What is named here is drawn in that colour, or on a dark page in its counterpart in `DARK`. Lines
have a contrast of 3 and more to every background; tests/unit/reviews/test_colours.py simulates
deuteranopia, protanopia and tritanopia and holds the distances between those of one picture.
"""

from h2nav.reviews.pictures.picture import Dash

OURS = "#0072b2"
SMOOTHED = "#00845f"
TRUTH = "#000000"
MODEL = "#000000"
AUTOPILOT = ("#d55e00", "#9c7500", "#b8508a", "#8a5a2b")
# What there is several of in one picture: sensors, axes, motors; from the fifth on with dashes.
NUMBERED = ("#285fec", "#f44400", "#9f80a1", "#6a3f44")
DASHES = (Dash.NONE, Dash.DASHED, Dash.DOTTED)
DEMAND, THROTTLE, LIMIT = "#7a1fa2", "#1a1a1a", "#555555"
# Of the flight modes along the track.
PATHS = ("#2653c1", "#c8741d", "#7682e0", "#733d00", "#896075", "#093e6f")
# Backgrounds: pale, and also labelled.
MODES = ("#eef3fa", "#fdf3e1", "#eaf6ee", "#f8ecf4", "#f1f1e6", "#e8f4f6")
BARS = ("#a6c8e8", "#f6cf8f", "#a9d9bd", "#e3b6d3", "#cfcf9f", "#a4d4dc")
IMPACT, REPORTED = "#b03a00", "#707070"
GOOD, DOUBTFUL, BAD, UNKNOWN = "#a6d8c2", "#ffd479", "#e08a5e", "#d5d5d5"
# The track from its beginning to its end: brighter, and from blue to orange.
EARLY_TO_LATE = ("#081d58", "#285fec", "#956e96", "#d65a0a")

LINES_DARK = {
    OURS: "#56b4e9",
    SMOOTHED: "#2fc796",
    TRUTH: "#ffffff",
    **dict(zip(AUTOPILOT, ("#ff8b3d", "#e0b83a", "#e58fc0", "#c79a6b"), strict=True)),
    **dict(zip(NUMBERED, ("#5e62f8", "#f19a4b", "#a0acf1", "#c93f76"), strict=True)),
    **dict(zip((DEMAND, THROTTLE, LIMIT), ("#cf8bee", "#ececec", "#a8a8a8"), strict=True)),
    **dict(
        zip(PATHS, ("#5e62f8", "#cdcb54", "#29c1f6", "#97659c", "#c1908c", "#ce451e"), strict=True)
    ),
    **dict(zip((IMPACT, REPORTED), ("#ff7a45", "#9a9a9a"), strict=True)),
}
FILLS_DARK = {
    **dict(
        zip(MODES, ("#1b2433", "#2b2415", "#172a20", "#2a1d27", "#26261a", "#16282c"), strict=True)
    ),
    **dict(
        zip(BARS, ("#274b6e", "#6b4c14", "#24573a", "#683c57", "#55551f", "#1f565f"), strict=True)
    ),
    **dict(
        zip(
            (GOOD, DOUBTFUL, BAD, UNKNOWN),
            ("#245c44", "#755a12", "#8a4420", "#4a4a4a"),
            strict=True,
        )
    ),
}
DARK = LINES_DARK | FILLS_DARK
EARLY_TO_LATE_DARK = ("#5e62f8", "#a0acf1", "#e6be96", "#ff8c1a")


def of(palette: tuple[str, ...], number: int) -> str:
    """The colour of a number; they repeat if there are too few."""
    return palette[number % len(palette)]


def numbered(number: int) -> tuple[str, Dash]:
    """Colour and dash of a number from 0; twelve differ."""
    return of(NUMBERED, number), DASHES[number // len(NUMBERED) % len(DASHES)]

"""The figures of a flight beside those of the airframe's earlier flights."""

import numpy as np

from h2nav.airframes.features import FlightRow, Named, named
from h2nav.airframes.trend import MAX_EARLIER, MIN_EARLIER, own_past
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.flight import Flight
from h2nav.reviews.pictures import colours
from h2nav.reviews.pictures.picture import Curves, Dash, PictureMark, Section, Trace

MAX_PICTURES = 24
ABOUT = (
    "One point a flight of this airframe, this one at 0 and the one before it at -1, and the usual "
    "value of the earlier ones."
)


def past(flight: Flight, analysis: Analysis) -> Section:
    """What left the past in the first place, the other figures on demand."""
    before = own_past(flight.earlier, analysis.row)[-MAX_EARLIER:]
    departed = [one.name for one in analysis.trends]
    others = sorted(analysis.row.features.keys() - set(departed))
    pictures = [_picture(name, before, analysis.row) for name in (*departed, *others)]
    first = [one for one in pictures[: len(departed)] if one is not None]
    further = [one for one in pictures[len(departed) :] if one is not None]
    if not first:
        first, further = further[:1], further[1:]
    return Section(
        "past",
        "Earlier flights",
        tuple(first[:MAX_PICTURES]),
        further=tuple(further[:MAX_PICTURES]),
        further_title="the other figures",
    )


def _picture(name: str, before: tuple[FlightRow, ...], row: FlightRow) -> Curves | None:
    """None where too few earlier flights have the figure."""
    known = named(name)
    earlier = np.array([one.features.get(name, np.nan) for one in before], np.float64)
    if known is None or np.isfinite(earlier).sum() < MIN_EARLIER:
        return None
    values = np.append(earlier, row.features[name]).astype(np.float32)
    usual = np.full(len(values), np.nanmedian(earlier), np.float32)
    spread = float(np.nanmax(values) - np.nanmin(values))
    return Curves(
        _title(known),
        ABOUT,
        known.feature.unit,
        "flights since",
        np.arange(1.0 - len(values), 1.0),
        (
            Trace("flight", colours.OURS, values),
            Trace("usual", colours.LIMIT, usual, dash=Dash.DASHED),
        ),
        (PictureMark(0.0, "this flight"),),
        # As many digits as tell the flights apart.
        int(np.clip(1.0 - np.floor(np.log10(spread)), 0.0, 5.0)) if spread > 0.0 else 3,
    )


def _title(known: Named) -> str:
    """The feature's name without its unit, with the number of the sensor."""
    unit = known.feature.unit.lower().replace("/", "_").replace("^", "")
    bare = known.feature.name.removesuffix(f"_{unit}")
    words = bare.format(known.number).replace("_", " ")
    return words[:1].upper() + words[1:]

"""The World Magnetic Model, read from pygeomag's coefficient files."""

import datetime
import math

from h2nav.attitude.samples import EarthField

NT_PER_UT = 1000.0
# The years of pygeomag's coefficient files.
MODELS_FROM, MODELS_UNTIL = 2010.0, 2029.99
# The epoch of the newest of them, 2025, is that of a recording without a date: what is found in it
# must not depend on the day on which it is looked at.
UNDATED_UNIX_S = 1_735_689_600.0
EARLIEST_UNIX_S, LATEST_UNIX_S = 0.0, 4_102_444_800.0  # 1970 and 2100
# Where the horizontal field nearly vanishes the model has no declination.
SMALLEST_HORIZONTAL_UT = 2.0


def earth_field_at(
    latitude_deg: float, longitude_deg: float, altitude_m: float, unix_s: float
) -> EarthField | None:
    """The earth's field at a place and time.

    Args:
        latitude_deg: WGS84.
        longitude_deg: WGS84.
        altitude_m: above sea level.
        unix_s: date; clamped to the models' years.

    Returns:
        The field; None near the magnetic poles, where there is no usable declination.
    """
    from pygeomag import GeoMag

    year = min(max(_decimal_year(unix_s), MODELS_FROM), MODELS_UNTIL)
    model = GeoMag(base_year=year)
    result = model.calculate(
        glat=latitude_deg, glon=longitude_deg, alt=altitude_m * 1e-3, time=year
    )
    if result.h / NT_PER_UT < SMALLEST_HORIZONTAL_UT:
        return None
    return EarthField(result.f / NT_PER_UT, math.radians(result.i), math.radians(result.d))


def _decimal_year(unix_s: float) -> float:
    known_s = min(max(unix_s, EARLIEST_UNIX_S), LATEST_UNIX_S)
    moment = datetime.datetime.fromtimestamp(known_s, datetime.UTC)
    start = datetime.datetime(moment.year, 1, 1, tzinfo=datetime.UTC)
    end = datetime.datetime(moment.year + 1, 1, 1, tzinfo=datetime.UTC)
    return moment.year + (moment - start) / (end - start)

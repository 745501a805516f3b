"""Gravity of the earth.

Source: NIMA TR8350.2, World Geodetic System 1984, eqs. (4-1) and (4-3).
"""

import math

EQUATOR_M_S2 = 9.7803253359
SOMIGLIANA = 0.00193185265241
ECCENTRICITY_2 = 0.00669437999013
RADIUS_M, FLATTENING, CENTRIFUGAL = 6_378_137.0, 1.0 / 298.257223563, 0.00344978650684


def normal_gravity_m_s2(latitude_deg: float, altitude_m: float) -> float:
    """Normal gravity at a geodetic latitude and a height above the ellipsoid.

    Masses below change it by 0.003 m/s^2 at most, a geoid's height by 0.0003.
    """
    sine_2 = math.sin(math.radians(latitude_deg)) ** 2
    below = EQUATOR_M_S2 * (1.0 + SOMIGLIANA * sine_2) / math.sqrt(1.0 - ECCENTRICITY_2 * sine_2)
    share = altitude_m / RADIUS_M
    fall = 1.0 + FLATTENING + CENTRIFUGAL - 2.0 * FLATTENING * sine_2
    return below * (1.0 - 2.0 * fall * share + 3.0 * share * share)

"""Density of the air, and airspeed by it.

Source: ICAO Doc 7488, standard atmosphere: eqs. (2), (12) and (13) of the troposphere.
"""

import math

SEA_LEVEL_PA, SEA_LEVEL_K = 101_325.0, 288.15
LAPSE_K_M = 0.0065
GAS_CONSTANT_J_KG_K = 287.05287
BAROMETRIC_EXPONENT = 5.25588  # g/(LAPSE R)
TROPOPAUSE_M, LOWEST_M = 11_000.0, -1_000.0


def density_kg_m3(pressure_pa: float, temperature_k: float) -> float:
    """Density of dry air."""
    return pressure_pa / (GAS_CONSTANT_J_KG_K * temperature_k)


SEA_LEVEL_KG_M3 = density_kg_m3(SEA_LEVEL_PA, SEA_LEVEL_K)


def standard_density_kg_m3(altitude_m: float) -> float:
    """Density of the standard atmosphere at an altitude, which is limited to the troposphere.

    20 K of another temperature change a true airspeed by it by 3.5 %.
    """
    warmth = 1.0 - LAPSE_K_M * min(max(altitude_m, LOWEST_M), TROPOPAUSE_M) / SEA_LEVEL_K
    return density_kg_m3(SEA_LEVEL_PA * warmth**BAROMETRIC_EXPONENT, SEA_LEVEL_K * warmth)


def true_airspeed_m_s(calibrated_m_s: float, density: float) -> float:
    """True airspeed of a calibrated one, m/s; exact while air counts as incompressible.

    Args:
        calibrated_m_s: the speed that makes this dynamic pressure at sea level, m/s.
        density: of the air, kg/m^3.
    """
    return calibrated_m_s * math.sqrt(SEA_LEVEL_KG_M3 / density)

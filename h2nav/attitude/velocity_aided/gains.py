"""What the disturbance-shaped filter takes from its gain file: physical limits and gain sets."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from h2nav.attitude.gains import GainFile, is_within, numbers_of
from h2nav.attitude.kernels import shaped_layout as layout
from h2nav.errors import BadInput

GRAVITY_M_S2 = 9.80665
VEHICLE_CLASSES = ("handheld", "multirotor", "fixed-wing", "rover")
_DEG = math.pi / 180.0


class Parameter(NamedTuple):
    """How a number of the file becomes one of the kernel's.

    Attributes:
        place: index into the kernel's `g`.
        factor: from the file's unit to the kernel's.
        power: 2 for what the kernel uses squared.
        low, high: limits in the file's unit.
    """

    place: int
    factor: float
    power: int
    low: float
    high: float


# One row per physical parameter; meaning and effect of each: docs/filter.md, section 7.
PARAMETERS: dict[str, Parameter] = {
    "gyro_noise_deg_s_rthz": Parameter(layout.G_GYRO, _DEG, 2, 1e-4, 10.0),
    "gyro_scale_noise_rthz": Parameter(layout.G_SCALE, 1.0, 2, 0.0, 0.1),
    "heading_scale_noise_rthz": Parameter(layout.G_SCALE_HEADING, 1.0, 2, 0.0, 0.1),
    "bias_start_deg_s": Parameter(layout.G_BIAS_VAR, _DEG, 2, 1e-3, 20.0),
    "bias_walk_deg_s_rts": Parameter(layout.G_BIAS_WALK, _DEG, 2, 0.0, 1.0),
    "bias_limit_deg_s": Parameter(layout.G_BIAS_LIMIT, _DEG, 1, 0.1, 60.0),
    "bias_inflation": Parameter(layout.G_INFLATE, 1.0, 1, 1.0, 1e4),
    "velocity_floor_m_s_rthz": Parameter(layout.G_FLOOR, 1.0 / GRAVITY_M_S2, 2, 1e-3, 10.0),
    "velocity_ceiling_m_s_rthz": Parameter(layout.G_CEILING, 1.0 / GRAVITY_M_S2, 2, 1e-3, 1e4),
    "velocity_correlation_s": Parameter(layout.G_CORRELATION, 2.0, 1, 0.0, 60.0),
    "impossible_velocity_m_s": Parameter(layout.G_IMPOSSIBLE, 1.0 / GRAVITY_M_S2, 2, 1.0, 1e4),
    "fix_floor_m_s_rthz": Parameter(layout.G_FIX_FLOOR, 1.0 / GRAVITY_M_S2, 2, 1e-3, 10.0),
    "fix_ceiling_m_s_rthz": Parameter(layout.G_FIX_CEILING, 1.0 / GRAVITY_M_S2, 2, 1e-3, 1e4),
    "fix_correlation_s": Parameter(layout.G_FIX_CORRELATION, 2.0, 1, 0.0, 60.0),
    "fix_gate_sigmas": Parameter(layout.G_FIX_GATE, 1.0, 2, 1.0, 100.0),
    "fix_inflation": Parameter(layout.G_FIX_INFLATE, 1.0, 1, 1.0, 1e4),
    "level_time_s": Parameter(layout.G_T_LEVEL, 1.0, 1, 0.1, 60.0),
    "drift_time_s": Parameter(layout.G_T_DRIFT, 1.0, 1, 0.1, 600.0),
    "start_factor": Parameter(layout.G_START, 1.0, 1, 0.0, 20.0),
    "start_time_s": Parameter(layout.G_T_EASE, 1.0, 1, 0.0, 600.0),
    "heading_start_deg": Parameter(layout.G_HEADING_VAR, _DEG, 2, 1.0, 60.0),
    "field_noise_deg_rthz": Parameter(layout.G_FIELD, _DEG, 2, 1e-3, 100.0),
    "field_correlation_s": Parameter(layout.G_FIELD_CORRELATION, 2.0, 1, 0.0, 600.0),
    "field_norm_gate": Parameter(layout.G_NORM_GATE, 1.0, 1, 0.001, 1.0),
    "field_dip_gate_deg": Parameter(layout.G_DIP_GATE, _DEG, 1, 0.1, 45.0),
    "field_reference_time_s": Parameter(layout.G_T_REFERENCE, 1.0, 1, 1.0, 1e5),
    "field_renewal_time_s": Parameter(layout.G_T_NEW, 1.0, 1, 1.0, 1e5),
    "field_renewal_turn_deg": Parameter(layout.G_NEW_TURN, _DEG, 1, 0.0, 1e5),
    "field_latency_limit_s": Parameter(layout.G_LAG_MOST, 1.0, 1, 0.0, 1.0),
    "field_latency_weight_rad2_s": Parameter(layout.G_LAG_PRIOR, 1.0, 1, 1e-6, 1e6),
    "rest_lowpass_s": Parameter(layout.G_T_REST_LP, 1.0, 1, 0.01, 60.0),
    "rest_rate_deg_s": Parameter(layout.G_REST_RATE, _DEG, 2, 0.0, 60.0),
    "rest_force_m_s2": Parameter(layout.G_REST_FORCE, 1.0, 2, 0.0, 10.0),
    "rest_time_s": Parameter(layout.G_T_REST, 1.0, 1, 0.0, 600.0),
    "rest_noise_deg_s_rthz": Parameter(layout.G_REST_NOISE, _DEG, 2, 1e-4, 10.0),
}
CRUISE_SPEED = "cruise_speed_m_s"
TABLES = ("set_bounds_s4", "k_tilt_s2", "k_velocity_s", "fix_periods_s", "k_fix_tilt_s")
_KEYS = ("vehicle_class", *PARAMETERS, CRUISE_SPEED, *TABLES, "k_fix_velocity")


class ShapedGains(NamedTuple):
    """Everything precomputed that `ShapedFilter` takes.

    Attributes:
        name: of the gain file.
        rate_hz: nominal sample rate.
        vehicle_class: one of `VEHICLE_CLASSES`.
        cruise_speed_m_s: velocity along the nose when no airspeed is told; 0 but on a fixed wing.
        g: the kernel's gains and limits.
    """

    name: str
    rate_hz: float
    vehicle_class: str
    cruise_speed_m_s: float
    g: tuple[float, ...]


class GainSets(NamedTuple):
    """The synthesised gains, weakest set first.

    Attributes:
        bounds: omega0^4 up to which a set is taken, 1/s^4, one fewer than sets.
        k_tilt: 1/s^2 per set.
        k_velocity: 1/s per set.
        fix_periods: s; the periods that the gains at fixes are made for.
        k_fix_tilt: 1/s per period and set.
        k_fix_velocity: per period and set.
    """

    bounds: tuple[float, ...]
    k_tilt: tuple[float, ...]
    k_velocity: tuple[float, ...]
    fix_periods: tuple[float, ...]
    k_fix_tilt: tuple[tuple[float, ...], ...]
    k_fix_velocity: tuple[tuple[float, ...], ...]


def shaped_gains(file: GainFile, place: str) -> ShapedGains:
    """The record that the default filter takes, from a gain file of its kind.

    Raises:
        BadInput: one line per error, each naming the file and the key.
    """
    if file.kind != "shaped":
        raise BadInput(f"{place}: kind: expected shaped for this filter, found {file.kind}")
    section = file.gains
    errors = key_errors(section, _KEYS, f"{place}: gains.")
    errors += parameter_errors(section, f"{place}: gains.")
    if not errors:
        errors = _table_errors(section, f"{place}: gains.")
    if errors:
        raise BadInput(*errors)
    values = {key: float(str(section[key])) for key in PARAMETERS}
    return ShapedGains(
        name=file.name,
        rate_hz=file.rate_hz,
        vehicle_class=str(section["vehicle_class"]),
        cruise_speed_m_s=float(str(section[CRUISE_SPEED])),
        g=kernel_gains(values, sets_of(section)),
    )


def kernel_gains(values: Mapping[str, float], sets: GainSets) -> tuple[float, ...]:
    """The kernel's `g` from the parameters in the file's units and the gain sets."""
    g = [0.0] * layout.G_SIZE
    g[layout.G_GRAVITY] = GRAVITY_M_S2
    for key, row in PARAMETERS.items():
        g[row.place] = (row.factor * values[key]) ** row.power
    for number in range(layout.SETS):
        base = layout.G_SETS + layout.SET_SIZE * number
        g[base] = sets.bounds[number] if number < layout.SETS - 1 else 0.0
        g[base + 1] = sets.k_tilt[number]
        g[base + 2] = sets.k_velocity[number]
    for number_of_period, period in enumerate(sets.fix_periods):
        base = layout.G_PERIODS + layout.PERIOD_SIZE * number_of_period
        following = sets.fix_periods[min(number_of_period + 1, layout.PERIODS - 1)]
        g[base] = math.sqrt(period * following)
        for number in range(layout.SETS):
            g[base + 1 + 2 * number] = sets.k_fix_tilt[number_of_period][number]
            g[base + 2 + 2 * number] = sets.k_fix_velocity[number_of_period][number]
    return tuple(g)


def sets_of(section: Mapping[str, object]) -> GainSets:
    """The tables of a `gains` section that has been checked."""
    rows: dict[str, list[list[float]]] = {
        key: [[float(item) for item in row] for row in section[key]]  # type: ignore[attr-defined]
        for key in ("k_fix_tilt_s", "k_fix_velocity")
    }
    return GainSets(
        tuple(numbers_of(section["set_bounds_s4"])),
        tuple(numbers_of(section["k_tilt_s2"])),
        tuple(numbers_of(section["k_velocity_s"])),
        tuple(numbers_of(section["fix_periods_s"])),
        tuple(map(tuple, rows["k_fix_tilt_s"])),
        tuple(map(tuple, rows["k_fix_velocity"])),
    )


def parameter_errors(section: Mapping[str, object], prefix: str) -> list[str]:
    """One line per parameter that is out of its limits; absent ones are not counted."""
    errors = []
    if section.get("vehicle_class", "handheld") not in VEHICLE_CLASSES:
        errors.append(f"{prefix}vehicle_class: expected one of {', '.join(VEHICLE_CLASSES)}")
    limits = {key: (row.low, row.high) for key, row in PARAMETERS.items()}
    limits[CRUISE_SPEED] = (0.0, 1000.0)
    for key, (low, high) in limits.items():
        if key in section and not is_within(section[key], low, high):
            errors.append(f"{prefix}{key}: expected a number from {low:g} to {high:g}")
    return errors


def key_errors(section: Mapping[str, object], expected: Sequence[str], prefix: str) -> list[str]:
    """One line per key that is missing or unknown."""
    missing = [f"{prefix}{key}: missing" for key in expected if key not in section]
    unknown = [f"{prefix}{key}: unknown key" for key in section if key not in expected]
    return missing + unknown


def _table_errors(section: Mapping[str, object], prefix: str) -> list[str]:
    sizes = {
        "set_bounds_s4": layout.SETS - 1,
        "k_tilt_s2": layout.SETS,
        "k_velocity_s": layout.SETS,
        "fix_periods_s": layout.PERIODS,
    }
    errors = []
    for key, size in sizes.items():
        numbers = numbers_of(section[key])
        rising = all(0.0 < a < b for a, b in itertools.pairwise(numbers))
        if len(numbers) != size or not rising:
            errors.append(f"{prefix}{key}: expected {size} rising numbers > 0")
    for key in ("k_fix_tilt_s", "k_fix_velocity"):
        table = section[key]
        rows = list(table) if isinstance(table, Sequence) and not isinstance(table, str) else []
        fine = [len(numbers_of(row)) == layout.SETS and min(numbers_of(row)) > 0.0 for row in rows]
        if len(rows) != layout.PERIODS or not all(fine):
            errors.append(
                f"{prefix}{key}: expected {layout.PERIODS} rows of {layout.SETS} numbers > 0"
            )
    return errors

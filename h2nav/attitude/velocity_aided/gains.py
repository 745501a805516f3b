"""What the velocity-aided filter takes from its gain file: physical limits and gain sets."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from h2nav.attitude.gains.envelope import GainFile
from h2nav.attitude.velocity_aided.memory import PERIODS, SETS, Gains
from h2nav.errors import BadInput
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.validation import Within, finite_numbers, key_complaints, numbers_within

VEHICLE_CLASSES = ("handheld", "multirotor", "fixed-wing", "rover")


class Parameter(NamedTuple):
    """How a number of the file becomes one of the kernel's.

    Attributes:
        field: of the kernel's gains.
        factor: from the file's unit to the kernel's.
        power: 2 for what the kernel uses squared.
        low, high: limits in the file's unit.
        absent: what holds for a file of a time before this parameter; None where every file has it.
    """

    field: str
    factor: float
    power: int
    low: float
    high: float
    absent: float | None = None


# One row per physical parameter; meaning and effect of each: docs/filter.md, section 7.
PARAMETERS: dict[str, Parameter] = {
    "gyro_noise_deg_s_rthz": Parameter("gyro_noise", DEG, 2, 1e-4, 10.0),
    "gyro_scale_noise_rthz": Parameter("scale_noise", 1.0, 2, 0.0, 0.1),
    "heading_scale_noise_rthz": Parameter("heading_scale_noise", 1.0, 2, 0.0, 0.1),
    "bias_start_deg_s": Parameter("bias_variance", DEG, 2, 1e-3, 20.0),
    # The largest: as the other two.
    "vertical_bias_start_deg_s": Parameter("vertical_bias_variance", DEG, 2, 1e-3, 20.0, 20.0),
    "bias_walk_deg_s_rts": Parameter("bias_walk", DEG, 2, 0.0, 1.0),
    "bias_limit_deg_s": Parameter("bias_limit", DEG, 1, 0.1, 60.0),
    "bias_inflation": Parameter("bias_inflation", 1.0, 1, 1.0, 1e4),
    "velocity_floor_m_s_rthz": Parameter("velocity_floor", 1.0 / GRAVITY_M_S2, 2, 1e-3, 10.0),
    "velocity_ceiling_m_s_rthz": Parameter("velocity_ceiling", 1.0 / GRAVITY_M_S2, 2, 1e-3, 1e4),
    "velocity_correlation_s": Parameter("velocity_correlation", 2.0, 1, 0.0, 60.0),
    "impossible_velocity_m_s": Parameter("impossible_velocity", 1.0 / GRAVITY_M_S2, 2, 1.0, 1e4),
    "fix_floor_m_s_rthz": Parameter("fix_floor", 1.0 / GRAVITY_M_S2, 2, 1e-3, 10.0),
    "fix_ceiling_m_s_rthz": Parameter("fix_ceiling", 1.0 / GRAVITY_M_S2, 2, 1e-3, 1e4),
    "fix_correlation_s": Parameter("fix_correlation", 2.0, 1, 0.0, 60.0),
    "fix_gate_sigmas": Parameter("fix_gate", 1.0, 2, 1.0, 100.0),
    "fix_inflation": Parameter("fix_inflation", 1.0, 1, 1.0, 1e4),
    "level_time_s": Parameter("level_time_s", 1.0, 1, 0.1, 60.0),
    "drift_time_s": Parameter("innovation_mean_time_s", 1.0, 1, 0.1, 600.0),
    "start_factor": Parameter("start_factor", 1.0, 1, 0.0, 20.0),
    "start_time_s": Parameter("startup_time_s", 1.0, 1, 0.0, 600.0),
    "heading_start_deg": Parameter("heading_variance", DEG, 2, 1.0, 60.0),
    "field_noise_deg_rthz": Parameter("mag_noise", DEG, 2, 1e-3, 100.0),
    "field_correlation_s": Parameter("mag_correlation", 2.0, 1, 0.0, 600.0),
    "field_norm_gate": Parameter("mag_norm_gate", 1.0, 1, 0.001, 1.0),
    "field_dip_gate_deg": Parameter("mag_dip_gate", DEG, 1, 0.1, 45.0),
    "field_reference_time_s": Parameter("mag_ref_time_s", 1.0, 1, 1.0, 1e5),
    "field_renewal_time_s": Parameter("mag_new_time_s", 1.0, 1, 1.0, 1e5),
    "field_renewal_turn_deg": Parameter("mag_new_turn", DEG, 1, 0.0, 1e5),
    "field_latency_limit_s": Parameter("mag_lag_limit", 1.0, 1, 0.0, 1.0),
    "field_latency_weight_rad2_s": Parameter("mag_lag_prior", 1.0, 1, 1e-6, 1e6),
    "rest_lowpass_s": Parameter("rest_lowpass_s", 1.0, 1, 0.01, 60.0),
    "rest_rate_deg_s": Parameter("rest_gyro", DEG, 2, 0.0, 60.0),
    "rest_force_m_s2": Parameter("rest_accel", 1.0, 2, 0.0, 10.0),
    "rest_time_s": Parameter("rest_time_s", 1.0, 1, 0.0, 600.0),
    "rest_noise_deg_s_rthz": Parameter("rest_noise", DEG, 2, 1e-4, 10.0),
    "accel_bias_start_m_s2": Parameter("accel_variance", 1.0 / GRAVITY_M_S2, 2, 0.0, 2.0, 0.0),
    "accel_bias_walk_m_s2_rts": Parameter("accel_walk", 1.0 / GRAVITY_M_S2, 2, 0.0, 0.1, 0.0),
    "fix_latency_start_s": Parameter("fix_lag_variance", 1.0, 2, 0.0, 0.5, 0.0),
    "fix_latency_walk_s_rts": Parameter("fix_lag_walk", 1.0, 2, 0.0, 0.1, 0.0),
    "fix_latency_limit_s": Parameter("fix_lag_limit", 1.0, 1, 0.0, 0.4, 0.0),
    "gyro_jitter_share": Parameter("jitter_share", 1.0, 1, 0.0, 10.0, 0.0),
    "field_silence_s": Parameter("field_silence_s", 1.0, 1, 0.0, 1e9, 1e9),
    "field_heading_gate_sigmas": Parameter("mag_heading_gate", 1.0, 2, 0.0, 100.0, 0.0),
}
CRUISE_SPEED = "cruise_speed_m_s"
TABLES = ("set_bounds_s4", "k_tilt_s2", "k_velocity_s", "fix_periods_s", "k_fix_tilt_s")
LIMITS = {key: Within(row.low, row.high) for key, row in PARAMETERS.items()}
LIMITS[CRUISE_SPEED] = Within(0.0, 1000.0)
_KEYS = ("vehicle_class", *PARAMETERS, CRUISE_SPEED, *TABLES, "k_fix_velocity")
_REQUIRED = tuple(key for key in _KEYS if key not in PARAMETERS or PARAMETERS[key].absent is None)


class VelocityAidedGains(NamedTuple):
    """Everything precomputed that `VelocityAidedFilter` takes.

    Attributes:
        name: of the gain file.
        rate_hz: nominal sample rate.
        vehicle_class: one of `VEHICLE_CLASSES`.
        cruise_speed_m_s: velocity along the nose when no airspeed is known; 0 but on a fixed wing.
        kernel: the kernel's gains and limits.
    """

    name: str
    rate_hz: float
    vehicle_class: str
    cruise_speed_m_s: float
    kernel: Gains


class GainSets(NamedTuple):
    """The synthesized gains, weakest set first.

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


def velocity_aided_gains(file: GainFile, place: str) -> VelocityAidedGains:
    """The record that the velocity-aided filter takes, from a gain file of its kind.

    Raises:
        BadInput: one line per error, each naming the file and the key.
    """
    if file.filter_name != "velocity_aided":
        raise BadInput(f"{place}: kind: expected velocity_aided for this filter, found {file.kind}")
    section = file.gains
    errors = key_complaints(section, _KEYS, _REQUIRED, place, "gains.")
    errors += class_complaints(section, place, "gains.")
    parameters = numbers_within(section, LIMITS, errors, place, "gains.")
    if not errors:
        errors = _table_complaints(section, f"{place}: gains.")
    if errors:
        raise BadInput(*errors)
    return VelocityAidedGains(
        name=file.name,
        rate_hz=file.rate_hz,
        vehicle_class=str(section["vehicle_class"]),
        cruise_speed_m_s=parameters[CRUISE_SPEED],
        kernel=kernel_gains(parameters, sets_of(section)),
    )


def kernel_gains(parameters: Mapping[str, float], sets: GainSets) -> Gains:
    """The kernel's gains from the parameters in the file's units and the gain sets."""
    g = Gains(gravity=GRAVITY_M_S2)
    for key, row in PARAMETERS.items():
        value = parameters[key] if row.absent is None else parameters.get(key, row.absent)
        setattr(g, row.field, (row.factor * value) ** row.power)
    periods = sets.fix_periods
    g.set_bounds[:] = sets.bounds
    g.k_tilt[:] = sets.k_tilt
    g.k_velocity[:] = sets.k_velocity
    g.fix_periods[:] = (
        math.sqrt(period * following)
        for period, following in itertools.pairwise((*periods, periods[-1]))
    )
    g.k_fix_tilt[:] = itertools.chain(*sets.k_fix_tilt)
    g.k_fix_velocity[:] = itertools.chain(*sets.k_fix_velocity)
    return g


def sets_of(section: Mapping[str, object]) -> GainSets:
    """The tables of a `gains` section that has been checked."""
    rows: dict[str, list[list[float]]] = {
        key: [[float(item) for item in row] for row in section[key]]  # type: ignore[attr-defined]
        for key in ("k_fix_tilt_s", "k_fix_velocity")
    }
    return GainSets(
        tuple(finite_numbers(section["set_bounds_s4"])),
        tuple(finite_numbers(section["k_tilt_s2"])),
        tuple(finite_numbers(section["k_velocity_s"])),
        tuple(finite_numbers(section["fix_periods_s"])),
        tuple(map(tuple, rows["k_fix_tilt_s"])),
        tuple(map(tuple, rows["k_fix_velocity"])),
    )


def class_complaints(section: Mapping[str, object], place: str, prefix: str) -> list[str]:
    """One line when the vehicle class is not one of `VEHICLE_CLASSES`."""
    if section.get("vehicle_class", "handheld") in VEHICLE_CLASSES:
        return []
    return [f"{place}: {prefix}vehicle_class: expected one of {', '.join(VEHICLE_CLASSES)}"]


def _table_complaints(section: Mapping[str, object], prefix: str) -> list[str]:
    sizes = {
        "set_bounds_s4": SETS - 1,
        "k_tilt_s2": SETS,
        "k_velocity_s": SETS,
        "fix_periods_s": PERIODS,
    }
    errors = []
    for key, size in sizes.items():
        numbers = finite_numbers(section[key])
        rising = all(0.0 < a < b for a, b in itertools.pairwise(numbers))
        if len(numbers) != size or not rising:
            errors.append(f"{prefix}{key}: expected {size} rising numbers > 0")
    for key in ("k_fix_tilt_s", "k_fix_velocity"):
        table = section[key]
        rows = list(table) if isinstance(table, Sequence) and not isinstance(table, str) else []
        fine = [len(finite_numbers(row)) == SETS and min(finite_numbers(row)) > 0.0 for row in rows]
        if len(rows) != PERIODS or not all(fine):
            errors.append(f"{prefix}{key}: expected {PERIODS} rows of {SETS} numbers > 0")
    return errors

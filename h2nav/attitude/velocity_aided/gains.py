"""The velocity-aided filter's part of a gain file: physical limits and gain sets."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from h2nav.attitude.gains.envelope import VEHICLE_CLASSES, GainFile
from h2nav.attitude.velocity_aided.memory import PERIODS, SETS, Gains
from h2nav.attitude.velocity_aided.parameters import PARAMETERS
from h2nav.errors import BadInput
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.validation import Within, finite_numbers, key_complaints, numbers_within

CRUISE_SPEED = "cruise_speed_m_s"
TABLES = ("set_bounds_s4", "k_tilt_s2", "k_velocity_s", "fix_periods_s", "k_fix_tilt_s")
LIMITS = {row.key: row.limits for row in PARAMETERS}
LIMITS[CRUISE_SPEED] = Within(0.0, 1000.0)
_ABSENT = {row.key: row.absent for row in PARAMETERS if row.absent is not None}
_KEYS = ("vehicle_class", *LIMITS, *TABLES, "k_fix_velocity")
_REQUIRED = tuple(key for key in _KEYS if key not in _ABSENT)


class VelocityAidedGains(NamedTuple):
    """Everything precomputed for `VelocityAidedFilter`."""

    name: str  # of the gain file
    rate_hz: float  # nominal sample rate
    vehicle_class: str  # one of `VEHICLE_CLASSES`
    cruise_speed_m_s: float  # velocity along the nose without an airspeed; 0 except on a fixed wing
    kernel: Gains  # the kernel's gains and limits


class GainSets(NamedTuple):
    """The synthesized gains, weakest set first."""

    bounds: tuple[float, ...]  # omega0^4 up to which a set is used, 1/s^4, one fewer than sets
    k_tilt: tuple[float, ...]  # 1/s^2 per set
    k_velocity: tuple[float, ...]  # 1/s per set
    fix_periods: tuple[float, ...]  # s; the periods for which the gains at fixes are made
    k_fix_tilt: tuple[tuple[float, ...], ...]  # 1/s per period and set
    k_fix_velocity: tuple[tuple[float, ...], ...]  # per period and set


def velocity_aided_gains(file: GainFile, place: str) -> VelocityAidedGains:
    """The velocity-aided filter's record of a gain file of its kind.

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
    held = {**_ABSENT, **parameters}
    for row in PARAMETERS:
        setattr(g, row.field, row.in_kernel(held[row.key]))
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
    """One line if the vehicle class is not one of `VEHICLE_CLASSES`."""
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

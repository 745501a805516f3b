"""The sections of gain files: what is refused, with file, key and remedy; gains in closed form."""

import itertools
import math

import numpy as np
import pytest
import scipy.linalg

from h2nav.attitude.constant_gain.sensor_gains import (
    FORCE_WEIGHTS,
    design_sensor_gains,
    sensor_gains,
    sensor_section,
)
from h2nav.attitude.gains.densities import SensorDensities, information
from h2nav.attitude.samples import EarthField
from h2nav.attitude.velocity_aided.gains import kernel_gains, sets_of, velocity_aided_gains
from h2nav.attitude.velocity_aided.memory import PERIODS, SETS
from h2nav.errors import BadInput
from h2nav.files import gain_files
from h2nav.maths.units import DEG, GRAVITY_M_S2

DIP_RAD = math.radians(63.0)
DENSITIES = SensorDensities(1e-3, 2e-5, 0.1, 2.0, 9.80665, EarthField(50.0, DIP_RAD, 0.0))
ROVER, SENSOR = gain_files.load("rover_100hz"), gain_files.load("bmi088_100hz")


def refused(read, file, **changes):
    """The lines of the error on a file with some other entries; None: without the key."""
    gains = {**file.gains, **changes}
    kept = {key: value for key, value in gains.items() if value is not None}
    with pytest.raises(BadInput) as caught:
        read(
            file._replace(gains=kept) if hasattr(file, "_replace") else _with(file, kept), "a.yaml"
        )
    return list(caught.value.lines)


def _with(file, gains):
    kept = {name: getattr(file, name) for name in file.__slots__}
    return type(file)(**kept | {"gains": gains})


def rising(count):
    return [float(i) for i in range(1, count + 1)]


def rows(count, size):
    return [[1.0] * size for _ in range(count)]


# --- velocity_aided ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value", "remedy"),
    [
        ("k_tilt_s2", rising(SETS - 1), f"expected {SETS} rising numbers > 0"),
        ("k_tilt_s2", rising(SETS + 1), f"expected {SETS} rising numbers > 0"),
        ("k_tilt_s2", [1.0, 1.0, *rising(SETS)[2:]], f"expected {SETS} rising numbers > 0"),
        ("k_velocity_s", [0.0, *rising(SETS - 1)], f"expected {SETS} rising numbers > 0"),
        ("set_bounds_s4", rising(SETS), f"expected {SETS - 1} rising numbers > 0"),
        ("fix_periods_s", rising(PERIODS)[::-1], f"expected {PERIODS} rising numbers > 0"),
        ("k_fix_tilt_s", "none", f"expected {PERIODS} rows of {SETS} numbers > 0"),
        ("k_fix_tilt_s", rows(PERIODS - 1, SETS), f"expected {PERIODS} rows of {SETS} numbers > 0"),
        (
            "k_fix_velocity",
            rows(PERIODS, SETS - 1),
            f"expected {PERIODS} rows of {SETS} numbers > 0",
        ),
        (
            "k_fix_velocity",
            [*rows(PERIODS - 1, SETS), [0.0] * SETS],
            f"expected {PERIODS} rows of {SETS} numbers > 0",
        ),
        (
            "vehicle_class",
            "boat",
            "expected one of handheld, multirotor, fixed-wing, rover",
        ),
    ],
)
def test_a_table_that_does_not_fit_is_refused_with_its_key(key, value, remedy):
    assert refused(velocity_aided_gains, ROVER, **{key: value}) == [
        f"a.yaml: gains.{key}: {remedy}"
    ]


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"level_time_s": None}, "level_time_s"),
        ({"cruise_speed_m_s": 1000.1}, "cruise_speed_m_s"),
        ({"cruise_speed_m_s": -0.1}, "cruise_speed_m_s"),
        ({"fix_gate": 3.0}, "fix_gate"),
        ({"level_time_s": 0.09}, "level_time_s"),
    ],
)
def test_a_key_that_is_missing_unknown_or_beyond_its_limits_is_named(changes, key):
    (line,) = refused(velocity_aided_gains, ROVER, **changes)
    assert line.startswith(f"a.yaml: gains.{key}: ")


def test_a_file_of_another_filter_is_refused():
    (line,) = refused(velocity_aided_gains, SENSOR)
    assert line == f"a.yaml: kind: expected velocity_aided for this filter, found {SENSOR.kind}"
    (line,) = refused(sensor_gains, ROVER)
    assert line == f"a.yaml: kind: expected two_stage for this filter, found {ROVER.kind}"


def test_the_kernel_has_the_files_numbers_in_its_own_units():
    gains = velocity_aided_gains(ROVER, "a.yaml")
    g, section = gains.kernel, ROVER.gains
    assert (gains.vehicle_class, gains.rate_hz, gains.cruise_speed_m_s) == ("rover", 100.0, 0.0)
    assert g.gravity == GRAVITY_M_S2
    assert g.rest_time_s == section["rest_time_s"]
    assert g.bias_limit == pytest.approx(section["bias_limit_deg_s"] * DEG)
    assert g.bias_variance == pytest.approx((section["bias_start_deg_s"] * DEG) ** 2)
    assert g.gyro_noise == pytest.approx((section["gyro_noise_deg_s_rthz"] * DEG) ** 2)
    assert g.accel_variance == pytest.approx((section["accel_bias_start_m_s2"] / GRAVITY_M_S2) ** 2)
    assert g.k_tilt[:] == section["k_tilt_s2"]
    assert g.k_fix_tilt[SETS:] == list(itertools.chain(*section["k_fix_tilt_s"][1:]))
    # A row of gains holds up to the geometric mean with the next period, the last for all.
    periods = section["fix_periods_s"]
    assert g.fix_periods[0] == pytest.approx(math.sqrt(periods[0] * periods[1]))
    assert g.fix_periods[-1] == pytest.approx(periods[-1])
    assert len(g.fix_periods) == PERIODS


def test_a_file_of_before_a_parameter_has_what_held_then():
    sets = sets_of(ROVER.gains)
    old = {key: value for key, value in ROVER.gains.items() if isinstance(value, (int, float))}
    for key in ("field_silence_s", "field_heading_gate_sigmas", "field_offset_start"):
        del old[key]
    g = kernel_gains(old, sets)
    assert (g.field_silence_s, g.mag_heading_gate, g.offset_variance) == (1e9, 0.0, 0.0)


# --- of sensors ----------------------------------------------------------------------------------


@pytest.mark.parametrize("rate_hz", [50.0, 400.0])
@pytest.mark.parametrize("dip_deg", [63.0, -20.0])
def test_gains_of_sensors_are_the_steady_variances_of_a_bias_free_filter(rate_hz, dip_deg):
    dip_rad = math.radians(dip_deg)
    densities = DENSITIES._replace(field=EarthField(50.0, dip_rad, 0.0))
    gains = design_sensor_gains(densities, rate_hz, "made")
    force, field = information(densities, rate_hz)
    assert force == pytest.approx(9.80665**2 / (0.1**2 * rate_hz))
    assert field == pytest.approx(50.0**2 / (2.0**2 * rate_hz))
    down = np.array([0.0, 0.0, 1.0])
    north = np.array([math.cos(dip_rad), 0.0, math.sin(dip_rad)])
    assert tuple(level.force_weight for level in gains.levels) == FORCE_WEIGHTS
    assert FORCE_WEIGHTS[:3] == (1.0, 0.25, 0.0625)
    for level in gains.levels:
        m = level.force_weight * force * (np.eye(3) - np.outer(down, down))
        m += field * (np.eye(3) - np.outer(north, north))
        q = 1e-6 / rate_hz * np.eye(3)
        prior = scipy.linalg.solve_discrete_are(np.eye(3), np.eye(3), q, np.linalg.inv(m))
        posterior = np.linalg.inv(np.linalg.inv(prior) + m)
        found = np.diag((level.k_nn, level.k_ee, level.k_dd))
        found[0, 2] = found[2, 0] = level.k_nd
        assert found == pytest.approx(posterior, rel=1e-6, abs=1e-6 * posterior.max())


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        (
            {"k_nd_rad2": [1.0]},
            ["gains.k_nd_rad2: expected a list of 7 finite numbers, one per level"],
        ),
        (
            {"force_weight": [*FORCE_WEIGHTS[:5], FORCE_WEIGHTS[4], FORCE_WEIGHTS[6]]},
            ["gains.force_weight: expected weights that fall from 1 towards 0"],
        ),
        (
            {"force_weight": [0.99, *FORCE_WEIGHTS[1:]]},
            ["gains.force_weight: expected weights that fall from 1 towards 0"],
        ),
        (
            {"force_weight": [*FORCE_WEIGHTS[:6], 0.0]},
            ["gains.force_weight: expected weights that fall from 1 towards 0"],
        ),
        ({"k_ee_rad2": [0.0] + [1e-6] * 6}, ["gains.k_ee_rad2: expected numbers > 0"]),
    ],
)
def test_levels_that_do_not_fit_are_refused_with_their_key(changes, lines):
    assert refused(sensor_gains, SENSOR, **changes) == [f"a.yaml: {line}" for line in lines]


@pytest.mark.parametrize(
    ("key", "fits", "beyond"),
    [
        ("gyro_noise_rad_s_rthz", 1e-9, 0.9e-9),
        ("gyro_bias_walk_rad_s_rts", 0.0, -1e-12),
        ("accelerometer_noise_m_s2_rthz", 100.0, 101.0),
        ("magnetometer_noise_ut_rthz", 1000.0, 1001.0),
        ("gravity_m_s2", 9.7, 9.69),
        ("gravity_m_s2", 9.9, 9.91),
        ("field_norm_ut", 1.0, 0.99),
        ("field_norm_ut", 200.0, 201.0),
        ("field_dip_deg", -89.9, -90.0),
    ],
)
def test_a_density_has_limits(key, fits, beyond):
    sensor_gains(_with(SENSOR, {**SENSOR.gains, key: fits}), "a.yaml")
    (line,) = refused(sensor_gains, SENSOR, **{key: beyond})
    assert line.startswith(f"a.yaml: gains.{key}: ")


def test_a_section_gives_back_what_it_was_made_of():
    gains = design_sensor_gains(DENSITIES, 100.0, SENSOR.name)
    again = sensor_gains(_with(SENSOR, sensor_section(gains)), "a.yaml")
    assert again.levels == gains.levels
    assert again.densities[:5] == gains.densities[:5]
    assert again.densities.field.dip_rad == pytest.approx(DIP_RAD)
    assert (again.name, again.rate_hz) == (SENSOR.name, 100.0)

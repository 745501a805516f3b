import itertools
import math
from typing import Any

import pytest
from needs import DEG
from synthetic_imu import DENSITIES, FIELD

from h2nav.attitude.constant_gain.sensor_gains import (
    SensorGains,
    design_sensor_gains,
    sensor_gains,
    sensor_section,
)
from h2nav.attitude.gains.envelope import FORMAT, parse_gain_file
from h2nav.attitude.samples import EarthField
from h2nav.errors import BadInput

GAINS = design_sensor_gains(DENSITIES, 200.0, "unit_200hz")


def at(field: EarthField) -> SensorGains:
    return design_sensor_gains(DENSITIES._replace(field=field), 200.0, "elsewhere")


def document() -> dict[str, Any]:
    return {
        "format": FORMAT,
        "kind": "two_stage",
        "name": "unit_200hz",
        "rate_hz": 200,
        "model": {},
        "gains": sensor_section(GAINS),
        "methods": {},
        "certificate": {},
        "fixed_point": {},
        "made_by": "test",
    }


def test_a_gain_file_gives_back_what_was_put_in() -> None:
    gains = sensor_gains(parse_gain_file(document(), "a.yaml"), "a.yaml")
    assert gains.levels == GAINS.levels
    assert gains.densities.field.dip_rad == pytest.approx(FIELD.dip_rad, rel=1e-15)
    assert gains.densities._replace(field=FIELD) == DENSITIES
    assert (gains.name, gains.rate_hz) == ("unit_200hz", 200.0)


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("format", "h2nav-gains/9", "format: expected h2nav-gains/1"),
        ("kind", "magic", "kind: expected one of"),
        ("name", "", "name: expected a text"),
        ("rate_hz", 0.0, "rate_hz: expected a number from 1"),
        ("rate_hz", math.nan, "rate_hz: expected a number from 1"),
        ("rate_hz", True, "rate_hz: expected a number from 1"),
        ("gains", [], "gains: expected a mapping"),
        ("surprise", 1, "surprise: unknown key"),
    ],
)
def test_a_bad_envelope_is_refused_by_key(key: str, value: object, says: str) -> None:
    with pytest.raises(BadInput, match=says) as refusal:
        parse_gain_file(document() | {key: value}, "a.yaml")
    assert all(line.startswith("a.yaml: ") for line in refusal.value.lines)


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("k_nn_rad2", [1.0], "k_nn_rad2: expected a list of"),
        ("k_ee_rad2", "text", "k_ee_rad2: expected a list of"),
        ("k_dd_rad2", [-1.0] * len(GAINS.levels), "k_dd_rad2: expected numbers > 0"),
        ("k_nd_rad2", [math.inf] * len(GAINS.levels), "k_nd_rad2: expected a list of"),
        ("force_weight", [0.5] * len(GAINS.levels), "force_weight: expected weights that fall"),
        ("field_dip_deg", 90.0, "field_dip_deg: expected a number from -89.9"),
        ("gyro_noise_rad_s_rthz", 0.0, "gyro_noise_rad_s_rthz: expected a number from"),
        ("extra", 1.0, "gains.extra: unknown key"),
    ],
)
def test_bad_gains_are_refused_by_key(key: str, value: object, says: str) -> None:
    bad = document()
    bad["gains"] = bad["gains"] | {key: value}
    with pytest.raises(BadInput, match=says):
        sensor_gains(parse_gain_file(bad, "a.yaml"), "a.yaml")


@pytest.mark.parametrize(
    ("key", "low", "high"),
    [
        ("gyro_noise_rad_s_rthz", 1e-9, 1.0),
        ("gyro_bias_walk_rad_s_rts", 0.0, 1.0),
        ("accelerometer_noise_m_s2_rthz", 1e-7, 100.0),
        ("magnetometer_noise_ut_rthz", 1e-6, 1000.0),
        ("gravity_m_s2", 9.7, 9.9),
        ("field_norm_ut", 1.0, 200.0),
        ("field_dip_deg", -89.9, 89.9),
    ],
)
def test_the_range_of_a_number_is_inclusive(key: str, low: float, high: float) -> None:
    def read(value: float) -> None:
        changed = document()
        changed["gains"] = changed["gains"] | {key: value}
        sensor_gains(parse_gain_file(changed, "a.yaml"), "a.yaml")

    for end in (low, high):
        read(end)
    for beyond in (low - 1e-3 * (high - low), high + 1e-3 * (high - low)):
        with pytest.raises(BadInput, match=f"{key}: expected a number from"):
            read(beyond)


@pytest.mark.parametrize("missing", list(document()))
def test_every_key_of_the_envelope_is_needed(missing: str) -> None:
    short = document()
    del short[missing]
    with pytest.raises(BadInput, match=missing):
        parse_gain_file(short, "a.yaml")


def test_gains_of_another_kind_are_refused() -> None:
    file = parse_gain_file(document() | {"kind": "shaped"}, "a.yaml")
    with pytest.raises(BadInput, match="expected two_stage"):
        sensor_gains(file, "a.yaml")


def test_the_southern_hemisphere_mirrors_the_coupling() -> None:
    south = at(FIELD._replace(dip_rad=-FIELD.dip_rad))
    for here, there in zip(GAINS.levels, south.levels, strict=True):
        assert there.k_nd == pytest.approx(-here.k_nd, rel=1e-9)
        assert there.k_dd == pytest.approx(here.k_dd, rel=1e-9)


def test_each_level_roughly_doubles_the_time_constant_of_the_tilt_about_north() -> None:
    flat = at(FIELD._replace(dip_rad=0.0 * DEG))
    share = [level.force_weight * level.k_nn for level in flat.levels]
    ratios = [a / b for a, b in itertools.pairwise(share)]
    assert ratios == pytest.approx([2.0] * len(ratios), rel=0.02)

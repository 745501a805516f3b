"""Sensor models: data-sheet units to SI, and ill-posed models named as such."""

import math
from typing import Any

import pytest

from h2nav.apps.synthesize import sensor_model
from h2nav.errors import BadInput
from h2nav.synthesis.model import densities, given_values, model_from_values, vector_sensors

DEG = math.pi / 180.0


def document(**changes: Any) -> dict[str, Any]:
    """A fine model; ``gyro__noise_deg_s_rthz=1`` changes one key, None removes it."""
    model: dict[str, Any] = {
        "name": "test",
        "source": "made up",
        "gyro": {"noise_deg_s_rthz": 0.01, "bias_walk_deg_s_rts": 2e-4},
        "accelerometer": {"noise_ug_rthz": 300},
        "magnetometer": {"part": "none", "noise_ut_rms": 0.6, "rate_hz": 100},
        "field": {"norm_ut": 50, "dip_deg": 60},
    }
    for path, value in changes.items():
        section, key = path.split("__")
        if value is None:
            del model[section][key]
        else:
            model.setdefault(section, {})[key] = value
    return model


def refusal(**changes: Any) -> str:
    with pytest.raises(BadInput) as caught:
        densities(sensor_model(document(**changes), "m.yaml"), "m.yaml")
    return str(caught.value)


def test_units() -> None:
    noise = densities(sensor_model(document(), "m.yaml"), "m.yaml")
    assert noise.gyro == pytest.approx(0.01 * DEG / math.sqrt(2))
    assert noise.bias_walk == pytest.approx(2e-4 * DEG)
    assert noise.accelerometer == pytest.approx(300e-6 * 9.80665 / math.sqrt(2))
    # One reading of 0.6 uT, 100 times a second: variance = density^2 * rate.
    assert noise.magnetometer == pytest.approx(0.06)
    gravity, field = vector_sensors(noise)
    assert gravity.v_n == (0.0, 0.0, 9.80665)
    assert field.v_n == pytest.approx((25.0, 0.0, 43.30127))


def test_bias_instability_becomes_the_walk_of_a_first_order_process() -> None:
    model = document(
        gyro__bias_walk_deg_s_rts=None,
        gyro__bias_instability_deg_h=36,
        gyro__bias_correlation_s=200,
    )
    noise = densities(sensor_model(model, "m.yaml"), "m.yaml")
    # 0.01 deg/s of deviation with 200 s: density^2 / 2 * 200 s = deviation^2.
    assert noise.bias_walk == pytest.approx(0.01 * DEG * math.sqrt(2 / 200))


def test_disturbances_add_to_the_sensors_noise() -> None:
    noise = densities(
        sensor_model(document(disturbances__acceleration_ug_rthz=400), "m.yaml"), "m.yaml"
    )
    assert noise.accelerometer == pytest.approx(500e-6 * 9.80665 / math.sqrt(2))


def test_field_by_place() -> None:
    """Zurich: published values of the World Magnetic Model 2025 are 48.4 uT and 63.5 deg."""
    model = document(
        field__norm_ut=None,
        field__dip_deg=None,
        field__latitude_deg=47.4,
        field__longitude_deg=8.5,
        field__altitude_m=500,
        field__year=2026.5,
    )
    field = sensor_model(model, "m.yaml").field
    assert field.norm_ut == pytest.approx(48.38, abs=0.05)
    assert field.dip_deg == pytest.approx(63.53, abs=0.05)


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({"field__dip_deg": 89.95}, "parallel to gravity"),
        ({"field__dip_deg": -90}, "parallel to gravity"),
        ({"gyro__noise_deg_s_rthz": 0}, "gyro.noise_deg_s_rthz: zero noise"),
        ({"accelerometer__noise_ug_rthz": 0}, "accelerometer.noise_ug_rthz: zero noise"),
        ({"magnetometer__noise_ut_rms": 0.0}, "magnetometer.noise_ut_rms: zero noise"),
        ({"gyro__bias_walk_deg_s_rts": 0}, "gyro.bias_walk_deg_s_rts: zero noise"),
        ({"gyro__bias_walk_deg_s_rts": None}, "expected either bias_walk_deg_s_rts, or"),
        ({"gyro__bias_instability_deg_h": 2}, "expected either bias_walk_deg_s_rts, or"),
        ({"gyro__bias_correlation_s": 100}, "expected either bias_walk_deg_s_rts, or"),
        ({"field__norm_ut": None}, "expected either norm_ut and dip_deg"),
        ({"field__latitude_deg": 47}, "expected either norm_ut and dip_deg"),
        ({"field__altitude_m": 47}, "expected either norm_ut and dip_deg"),
        ({"gyro__noise_deg_s_rthz": -1}, "gyro.noise_deg_s_rthz: expected a number from"),
        ({"gyro__noise_deg_s_rthz": 1e-8}, "in SI, gyro_noise_rad_s_rthz: expected a number from"),
        ({"gyro__noise_deg_s_rthz": 99}, "in SI, gyro_noise_rad_s_rthz: expected a number from"),
        ({"accelerometer__noise_ug_rthz": 1e-300}, "in SI, accelerometer_noise_m_s2_rthz: exp"),
        ({"magnetometer__noise_ut_rms": 1e-300}, "in SI, magnetometer_noise_ut_rthz: expected"),
        ({"gyro__noise_deg_s_rthz": "low"}, "gyro.noise_deg_s_rthz: expected a number"),
        ({"gyro__noise_deg_rthz": 1}, "did you mean gyro.noise_deg_s_rthz?"),
        ({"magnetometer__part": None}, "magnetometer.part: missing"),
    ],
)
def test_ill_posed_model_is_refused_by_its_cause(changes: dict[str, Any], cause: str) -> None:
    message = refusal(**changes)
    assert cause in message
    assert all(line.startswith("m.yaml: ") for line in message.splitlines())


def test_magnetic_pole_is_refused() -> None:
    changes = {
        "field__norm_ut": None,
        "field__dip_deg": None,
        "field__latitude_deg": 86.0,
        "field__longitude_deg": 140.0,
        "field__year": 2026.0,
    }
    assert "parallel to gravity" in refusal(**changes)


def test_model_survives_the_gain_file() -> None:
    model = sensor_model(document(), "m.yaml")
    values = given_values(model)
    assert "bias_instability_deg_h" not in values["gyro"]  # type: ignore[operator]
    assert densities(model_from_values(values, "g.yaml"), "g.yaml") == densities(model, "m.yaml")


@pytest.mark.parametrize(
    "wrong",
    [
        {"name": "x"},
        {"name": "x", "surprise": {"a": 1.0}},
        {**document(), "gyro": {"noise_deg_s_rthz": "abc"}},
        {**document(), "gyro": 3.0},
        {**document(), "field": {"norm_ut": 50.0, "dip": 60.0}},
    ],
)
def test_foreign_model_section_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(BadInput, match=r"g\.yaml: model: "):
        model_from_values(wrong, "g.yaml")

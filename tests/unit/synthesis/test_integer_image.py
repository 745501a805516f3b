"""The integer image in a gain file is that of its gains, and stable once rounded."""

import math
from dataclasses import replace

import pytest

from h2nav.attitude.record import values
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.attitude.velocity_aided.integer.memory import Gains
from h2nav.errors import BadInput
from h2nav.files import gain_files
from h2nav.synthesis import kinds, velocity_aided
from h2nav.synthesis.certificate import CertificateError
from h2nav.synthesis.gain_certificate import certified


@pytest.mark.parametrize(
    ("name", "form"), [("mpu9250_100hz", "lean-1"), ("multirotor_200hz", "flight-2")]
)
def test_a_shipped_image_is_certified(name, form):
    file = gain_files.load(name)
    assert file.fixed_point["format"] == form
    assert file.fixed_point["params"]
    assert 0.0 < float(str(file.fixed_point["rounding_error"])) < 2e-4
    assert float(str(file.fixed_point["spectral_radius"])) < 1.0
    assert kinds.check(file, name).problems == ()


@pytest.mark.parametrize("name", ["mpu9250_100hz", "multirotor_200hz"])
@pytest.mark.parametrize(
    ("key", "value"),
    [("params", None), ("format", "flight-0"), ("rounding_error", 0.0), ("spectral_radius", 0.9)],
)
def test_another_image_is_noticed(name, key, value):
    file = gain_files.load(name)
    if key == "params":
        value = list(file.fixed_point["params"])
        value[1] += 1
    changed = replace(file, fixed_point={**file.fixed_point, key: value})
    problems = kinds.check(changed, "changed").problems
    assert any(problem.startswith(f"fixed_point.{key}") for problem in problems)
    assert any(problem.startswith("certificate.sha256") for problem in problems)


def test_the_filter_in_integers_takes_the_image_of_its_file():
    name = "fixed-wing_50hz"
    file = gain_files.load(name)
    made = IntegerVelocityAidedFilter(velocity_aided_gains(file, name), name)
    assert values(made.kernel_gains, Gains) == file.fixed_point["params"]


def test_the_radius_is_that_of_the_slowest_loop():
    """Set 0 of the slowest poles, 0.044 / sqrt(2) rad/s, at the file's rate."""
    file = gain_files.load("multirotor_100hz")
    radius = float(str(file.fixed_point["spectral_radius"]))
    assert radius == pytest.approx(math.exp(-(2.0**-4.5) / math.sqrt(2.0) / 100.0), abs=1e-6)


def test_a_model_that_the_integers_do_not_hold_serves_the_floats():
    """5 deg/s of bias at the start: synthesized and certified, and no integer filter."""
    model = dict(gain_files.load("multirotor_100hz").model)
    disturbance = {**model["disturbance"], "bias_start_deg_s": 5.0}
    file = velocity_aided.synthesize({**model, "disturbance": disturbance}, 100.0, "model", ()).file
    assert "bias_start_deg_s is outside" in str(file.fixed_point["refused"])
    assert kinds.check(file, "made").problems == ()
    with pytest.raises(BadInput, match="bias_start_deg_s is outside what the integer filter"):
        IntegerVelocityAidedFilter(velocity_aided_gains(file, "made"), "made")
    hidden = replace(file, fixed_point=gain_files.load("multirotor_100hz").fixed_point)
    assert any(p.startswith("fixed_point.") for p in kinds.check(hidden, "made").problems)


def test_rounded_gains_that_are_not_stable_get_no_certificate(monkeypatch):
    """The largest gain that the format holds, in place of one at fixes."""
    file = gain_files.load("multirotor_100hz")
    real = velocity_aided.integer_gains

    def broken(gains, place):
        image = real(gains, place)
        image.gains.k_fix_velocity[0] = 32767 << 5
        return image

    monkeypatch.setattr(velocity_aided, "integer_gains", broken)
    section = velocity_aided.fixed_point_section(file, "broken")
    assert float(str(section["spectral_radius"])) > 1.0
    with pytest.raises(CertificateError, match="the rounded gains are not stable"):
        certified(file, velocity_aided.loops(file, "broken"), section)

"""The velocity-aided gains against Riccati and their own certificates, and the class models."""

from pathlib import Path

import numpy as np
import pytest
from needs import DEG, REPOSITORY

from h2nav.attitude.velocity_aided.gains import sets_of, velocity_aided_gains
from h2nav.errors import BadInput
from h2nav.files import gain_files
from h2nav.files.plain_yaml import read_mapping
from h2nav.synthesis.kinds import check
from h2nav.synthesis.plant import discretise
from h2nav.synthesis.riccati import solve_riccati
from h2nav.synthesis.velocity_aided import synthesize, tilt_gain, tilt_plant

CLASSES = ("handheld", "multirotor", "fixed-wing", "rover")
RATES_HZ = (50, 100, 200, 400)


@pytest.mark.parametrize("velocity", [1e-3, 0.05, 0.7])
def test_closed_form_is_the_riccati_gain(velocity: float) -> None:
    gyro = 0.04 * DEG
    closed, riccati = tilt_gain(gyro, velocity), solve_riccati(tilt_plant(gyro, velocity))
    np.testing.assert_allclose(closed.L, riccati.L, rtol=1e-9)
    assert closed.claimed_h2_norm == pytest.approx(riccati.claimed_h2_norm, rel=1e-9)


def test_the_gain_depends_on_nothing_but_omega0() -> None:
    one = solve_riccati(discretise(tilt_plant(1e-3, 0.1), 0.01)).L
    other = solve_riccati(discretise(tilt_plant(5e-2, 5.0), 0.01)).L
    np.testing.assert_allclose(one, other, rtol=1e-9)


def test_discrete_gains_tend_to_the_closed_form() -> None:
    sets = sets_of(gain_files.load("rover_400hz").gains)
    squared = 2.0 ** np.arange(-9, 3)
    np.testing.assert_allclose(sets.k_tilt, squared, rtol=0.01)
    np.testing.assert_allclose(sets.k_velocity, np.sqrt(2.0 * squared), rtol=0.01)


@pytest.mark.parametrize("name", CLASSES)
@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_shipped_files_are_certified_and_read(name: str, rate_hz: int) -> None:
    file = gain_files.load(f"{name}_{rate_hz}hz")
    gains = velocity_aided_gains(file, file.name)
    assert (gains.vehicle_class, gains.rate_hz) == (name, rate_hz)
    assert file.model == read_mapping(REPOSITORY / "gains" / "models" / f"{name}.yaml")


def test_a_shipped_certificate_holds_and_a_changed_gain_does_not() -> None:
    file = gain_files.load("multirotor_100hz")
    assert check(file, "multirotor_100hz").problems == ()
    table = list(sets_of(file.gains).k_tilt)
    table[3] *= 1.05
    changed = type(file)(
        **{k: getattr(file, k) for k in file.__slots__}
        | {"gains": {**file.gains, "k_tilt_s2": table}}
    )
    assert check(changed, "changed").problems


def test_errors_of_a_model_name_file_and_key() -> None:
    path = REPOSITORY / "gains" / "models" / "rover.yaml"
    model = read_mapping(path)
    disturbance = dict(model["disturbance"])
    disturbance["bias_walk_deg_s_rts"] = -1.0
    disturbance["velocity_flor"] = 1.0
    del disturbance["level_time_s"]
    with pytest.raises(BadInput) as caught:
        synthesize(model | {"disturbance": disturbance, "vehicle_class": "boat"}, 100.0, "m", ())
    text = str(caught.value)
    for part in ("bias_walk_deg_s_rts", "velocity_flor", "level_time_s: missing", "vehicle_class"):
        assert part in text
    assert all(line.startswith("m: ") for line in caught.value.lines)


def test_errors_of_a_gain_file_name_file_and_key() -> None:
    file = gain_files.read(Path(gain_files.find("rover_50hz")))
    gains = dict(file.gains)
    gains["k_tilt_s2"] = [1.0, 2.0]
    gains["k_fix_tilt_s"] = "none"
    changed = type(file)(**{k: getattr(file, k) for k in file.__slots__} | {"gains": gains})
    with pytest.raises(BadInput) as caught:
        velocity_aided_gains(changed, "rover_50hz")
    assert "gains.k_tilt_s2: expected 12 rising numbers" in str(caught.value)
    assert "gains.k_fix_tilt_s: expected 4 rows" in str(caught.value)

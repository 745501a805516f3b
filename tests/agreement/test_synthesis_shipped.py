"""The shipped gains, synthesized again from their own models by every method."""

import dataclasses

import numpy as np
import pytest

from h2nav.attitude.constant_gain.sensor_gains import sensor_gains
from h2nav.attitude.gains.envelope import GainFile
from h2nav.files import gain_files
from h2nav.synthesis import kinds, sensors
from h2nav.synthesis.certificate import accept
from h2nav.synthesis.lmi import solve_lmi
from h2nav.synthesis.method import relative_distance
from h2nav.synthesis.model import model_from_values
from h2nav.synthesis.riccati import solve_riccati

TWO_STAGE = [
    f"{sensor}_{rate}hz"
    for sensor in ("mpu9250", "icm42688", "bmi088")
    for rate in (50, 100, 200, 400)
]


@pytest.mark.parametrize("name", sorted(gain_files.shipped()))
def test_certificate_holds(name: str) -> None:
    file = gain_files.load(name)
    verdict = kinds.check(file, name)
    assert verdict.problems == ()
    assert verdict.spectral_abscissa_per_s is not None
    assert verdict.spectral_abscissa_per_s < 0.0


@pytest.mark.parametrize("name", TWO_STAGE)
def test_closed_form_and_riccati_agree_with_the_file(name: str) -> None:
    file = gain_files.load(name)
    model = model_from_values(file.model, name)
    again = sensors.synthesize(model, file.rate_hz, name, lmi_solvers=()).file
    ours, theirs = sensor_gains(again, name), sensor_gains(file, name)
    for fresh, stored in zip(ours.levels, theirs.levels, strict=True):
        assert fresh == pytest.approx(stored, rel=1e-9)
    # The plant with bias and level 0 are optimal; the other levels follow the filter's own rules.
    for loop in sensors.loops(file, name)[:2]:
        assert relative_distance(loop.L, solve_riccati(loop.plant).L) <= 1e-9


@pytest.mark.parametrize("name", TWO_STAGE)
def test_recorded_methods_agree(name: str) -> None:
    """What the file says of its methods: LMI within 1e-5 of the closed form, Riccati 1e-9."""
    for plant in (sensors.WITH_BIAS, sensors.WITHOUT_BIAS):
        for time in ("continuous", "discrete"):
            section = gain_files.load(name).methods[plant][time]  # type: ignore[index]
            reference = np.array(section["closed_form"]["gain"])
            for method, limit in (("lmi_clarabel", 1e-5), ("lmi_scs", 1e-5), ("riccati", 1e-9)):
                gain = np.array(section[method]["gain"])
                assert relative_distance(gain, reference) <= limit
                norms = section[method]["h2_norm"], section["closed_form"]["h2_norm"]
                assert norms[0] == pytest.approx(norms[1], rel=1e-9)
            assert section["disagreement"] <= 1e-5


@pytest.mark.parametrize(
    ("name", "solver"),
    [("mpu9250_100hz", "CLARABEL"), ("icm42688_400hz", "CLARABEL"), ("bmi088_50hz", "SCS")],
)
def test_lmi_solved_again_agrees(name: str, solver: str) -> None:
    for loop in sensors.loops(gain_files.load(name), name)[:2]:
        candidate = solve_lmi(loop.plant, solver)
        accept(loop.plant, candidate)
        assert relative_distance(candidate.L, loop.L) <= 1e-5


def tampered(file: GainFile, level: int = 0) -> GainFile:
    column = list(file.gains["k_ee_rad2"])  # type: ignore[call-overload]
    column[level] *= 1.001
    return dataclasses.replace(file, gains={**file.gains, "k_ee_rad2": column})


def test_tampered_file_is_caught_even_with_a_new_seal() -> None:
    from h2nav.attitude.gains.seal import seal

    file = tampered(gain_files.load("mpu9250_100hz"))
    stale = kinds.check(file, "g.yaml").problems
    assert any("stale" in problem for problem in stale)
    resealed = dataclasses.replace(file, certificate={**file.certificate, "sha256": seal(file)})
    problems = kinds.check(resealed, "g.yaml").problems
    assert problems
    assert not any("stale" in problem for problem in problems)
    assert any("not optimal" in problem for problem in problems)


@pytest.mark.parametrize("level", [0, 1, 6])
def test_tampered_level_is_caught_even_with_a_new_certificate(level: int) -> None:
    """Stable, honestly certified, but not what the model leads to."""
    from h2nav.synthesis.certificate import CertificateError
    from h2nav.synthesis.gain_certificate import certified

    file = tampered(gain_files.load("mpu9250_100hz"), level)
    with pytest.raises(CertificateError, match=f"level_{level}: the gain is not"):
        certified(file, *(make(file, "g.yaml") for make in kinds.KINDS["two_stage"]))


def test_missing_loop_is_caught() -> None:
    file = gain_files.load("mpu9250_100hz")
    loops = dict(file.certificate["loops"])  # type: ignore[call-overload]
    loops.pop("attitude_level_0")
    less = dataclasses.replace(file, certificate={**file.certificate, "loops": loops})
    assert any("expected exactly" in problem for problem in kinds.check(less, "g.yaml").problems)

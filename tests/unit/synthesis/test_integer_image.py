"""The integer image in a gain file is that of its gains, and stable once rounded."""

from dataclasses import replace

import pytest

from h2nav.io import gain_files
from h2nav.synthesis import kinds


@pytest.mark.parametrize("name", ["mpu9250_100hz", "multirotor_200hz"])
def test_a_shipped_image_is_certified(name):
    file = gain_files.load(name)
    assert file.fixed_point["params"]
    assert float(str(file.fixed_point["spectral_radius"])) < 1.0
    assert kinds.check(file, name).problems == ()


def test_another_image_is_noticed():
    file = gain_files.load("mpu9250_100hz")
    params = list(file.fixed_point["params"])
    params[1] += 1
    changed = replace(file, fixed_point={**file.fixed_point, "params": params})
    problems = kinds.check(changed, "changed").problems
    assert any(problem.startswith("fixed_point.params") for problem in problems)
    assert any(problem.startswith("certificate.sha256") for problem in problems)

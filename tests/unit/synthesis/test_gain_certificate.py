"""A certificate that is not the one of its gains is refused, with what is wrong of it."""

import copy
import dataclasses

from h2nav.files import gain_files
from h2nav.synthesis.kinds import check

FILE = gain_files.read(gain_files.find("mpu9250_100hz"))


def problems(change) -> list[str]:
    certificate = copy.deepcopy(dict(FILE.certificate))
    change(certificate)
    return list(check(dataclasses.replace(FILE, certificate=certificate), "made").problems)


def test_the_shipped_one_is_right() -> None:
    assert problems(lambda certificate: None) == []


def test_without_loops_there_is_none() -> None:
    def change(certificate):
        del certificate["loops"]

    assert "certificate.loops: there is no certificate" in problems(change)


def test_it_is_of_exactly_the_loops_of_its_gains() -> None:
    def change(certificate):
        certificate["loops"]["another"] = certificate["loops"]["attitude_and_bias"]

    (problem,) = problems(change)
    assert problem.startswith("certificate.loops: expected exactly ")
    assert "attitude_and_bias" in problem


def test_what_is_not_readable_is_named_by_its_loop() -> None:
    def change(certificate):
        del certificate["loops"]["attitude_and_bias"]["h2_norm"]

    (problem,) = problems(change)
    assert problem.startswith("certificate.loops.attitude_and_bias: not readable")


def test_a_number_that_is_not_that_of_the_gains_is_named_by_its_loop() -> None:
    def change(certificate):
        certificate["loops"]["attitude_and_bias"]["h2_norm"] *= 0.9

    assert any(
        problem.startswith("certificate.loops.attitude_and_bias: ") for problem in problems(change)
    )

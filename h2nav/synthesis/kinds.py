"""The kinds of gain files: their loops and their integer images."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from h2nav.attitude.gains.envelope import GainFile
from h2nav.synthesis import constant_gain, sensors, velocity_aided
from h2nav.synthesis.gain_certificate import CertificateVerdict, Loop, checked


class GainKind(NamedTuple):
    """How to check a kind of gain file; both functions take the file and its place, for errors."""

    loops: Callable[[GainFile, str], list[Loop]]  # of its certificate
    # the section of its integer image, from its gains
    fixed_point: Callable[[GainFile, str], Mapping[str, object]]


KINDS: dict[str, GainKind] = {
    "two_stage": GainKind(sensors.loops, constant_gain.fixed_point_section),
    "velocity_aided": GainKind(velocity_aided.loops, velocity_aided.fixed_point_section),
}


def check(file: GainFile, place: str) -> CertificateVerdict:
    """Checks a gain file's certificate.

    Args:
        place: its path, for errors.

    Raises:
        BadInput: model or gains are invalid for the file's kind.
    """
    kind = KINDS[file.filter_name]
    return checked(file, kind.loops(file, place), kind.fixed_point(file, place))

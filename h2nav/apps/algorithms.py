"""The filters by name: their arithmetics, their gain files, and what makes them; one row each."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable

    from h2nav.attitude.filter import AttitudeFilter
    from h2nav.attitude.gains.envelope import GainFile


class Algorithm(NamedTuple):
    """A filter."""

    gain_kind: str  # of its gain files
    gains_by_class: bool  # they are shipped per vehicle class; else per sensor
    # arithmetic -> maker from a gain file; the default arithmetic first
    makers: dict[str, Callable[[GainFile], AttitudeFilter]]


def _velocity_aided(file: GainFile) -> AttitudeFilter:
    from h2nav.attitude.kernel_files import VELOCITY_AIDED
    from h2nav.attitude.native import compiled_step
    from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
    from h2nav.attitude.velocity_aided.gains import velocity_aided_gains

    gains = velocity_aided_gains(file, file.name)
    return VelocityAidedFilter(gains, compiled_step(VELOCITY_AIDED))


def _integer_velocity_aided(file: GainFile) -> AttitudeFilter:
    from h2nav.attitude.kernel_files import VELOCITY_AIDED_INTEGER
    from h2nav.attitude.native import compiled_step
    from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
    from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter

    gains = velocity_aided_gains(file, file.name)
    return IntegerVelocityAidedFilter(gains, file.name, compiled_step(VELOCITY_AIDED_INTEGER))


def _constant_gain(file: GainFile) -> AttitudeFilter:
    from h2nav.attitude.constant_gain.filter import ConstantGainFilter
    from h2nav.attitude.constant_gain.gains import constant_gain_model
    from h2nav.attitude.kernel_files import CONSTANT_GAIN
    from h2nav.attitude.native import compiled_step

    model = constant_gain_model(file, file.name)
    return ConstantGainFilter(model, compiled_step(CONSTANT_GAIN))


ALGORITHMS = {
    "velocity_aided": Algorithm(
        "velocity_aided",
        gains_by_class=True,
        makers={"float": _velocity_aided, "fixed": _integer_velocity_aided},
    ),
    "constant_gain": Algorithm("two_stage", gains_by_class=False, makers={"fixed": _constant_gain}),
}
RECOMMENDED = "velocity_aided"
NAMES = ("default", *ALGORITHMS)


def algorithm(name: str) -> Algorithm:
    """The filter of one of `NAMES`."""
    return ALGORITHMS[RECOMMENDED if name == "default" else name]

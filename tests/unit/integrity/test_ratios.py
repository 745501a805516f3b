"""The worst of several ratios, of which some are unknown."""

import math

import pytest

from h2nav.integrity.ratios import InnovationRatios

NAMES = {
    "of_velocity": ("velocity_1s", "velocity_3s", "velocity_10s"),
    "of_field": ("field_1s", "field_10s"),
    "of_turn": ("turn_1s", "turn_10s"),
    "of_inertial": (
        "velocity_1s", "velocity_3s", "velocity_10s", "force_10s", "turn_1s", "turn_10s",
    ),
}  # fmt: skip


@pytest.mark.parametrize("worst", NAMES)
def test_the_worst_of_those_that_are_known(worst):
    for name in InnovationRatios._fields:
        others = dict.fromkeys(NAMES[worst], 0.5)
        assert getattr(InnovationRatios(**others | {name: 2.0}), worst) == (
            2.0 if name in NAMES[worst] else 0.5
        )
        assert getattr(InnovationRatios(**others | {name: math.nan}), worst) == 0.5
        alone = getattr(InnovationRatios(**{name: 0.2}), worst)
        assert (alone == 0.2) == (name in NAMES[worst])


def test_nothing_known_is_not_a_number_and_no_fault_of_a_sensor():
    nothing = InnovationRatios()
    assert all(map(math.isnan, (nothing.of_velocity, nothing.of_field, nothing.of_turn)))
    assert nothing.of_inertial == 0.0

"""Which filter a name means, the names of earlier versions included."""

import pytest

from h2nav.apps.algorithms import NAMES, algorithm
from h2nav.apps.configuration import FilterSettings, build
from h2nav.apps.filters import FilterFactory
from h2nav.attitude.gains.envelope import parse_gain_file
from h2nav.errors import BadInput
from h2nav.files import gain_files, plain_yaml
from h2nav.service.autopilot import Identity

COPTER = Identity(1, 1, 3, 2)
CASES = [
    ("default", "float", "velocity_aided"),
    ("default", "fixed", "velocity_aided"),
    ("velocity_aided", "float", "velocity_aided"),
    ("velocity_aided", "fixed", "velocity_aided"),
    ("constant_gain", "fixed", "constant_gain"),
]


@pytest.mark.parametrize(("name", "arithmetic", "expected"), CASES)
def test_a_name_and_an_arithmetic_give_a_filter(name: str, arithmetic: str, expected: str) -> None:
    settings = FilterSettings(name=name, arithmetic=arithmetic)
    made = FilterFactory.shipped(settings, 100.0).filter_for(COPTER)
    assert made.name == expected


def test_every_name_is_tried() -> None:
    assert {(name, each) for name in NAMES for each in algorithm(name).makers} == {
        (name, arithmetic) for name, arithmetic, _ in CASES
    }


def test_an_arithmetic_that_a_filter_lacks_is_refused() -> None:
    with pytest.raises(BadInput, match=r"filter\.arithmetic: constant_gain runs in fixed"):
        build({"filter": {"name": "constant_gain"}}, "test")


def test_a_gain_file_of_a_former_kind_serves_the_filter() -> None:
    text = gain_files.text_of(gain_files.load("multirotor_100hz"))
    former = text.replace("kind: velocity_aided", "kind: shaped")
    file = parse_gain_file(plain_yaml.parse_bytes(former.encode(), "old"), "old")
    assert (file.kind, file.filter_name) == ("shaped", "velocity_aided")
    factory = FilterFactory(FilterSettings(), {"multirotor": "old"}, {"old": file}.__getitem__)
    assert factory.filter_for(COPTER).name == "velocity_aided"

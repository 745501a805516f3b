"""What the integers do without is said where they are chosen."""

from pathlib import Path

import pytest

from h2nav.apps.check_config import checked
from h2nav.apps.configuration import left_out, warnings


@pytest.mark.parametrize(
    ("name", "arithmetic", "is_said"),
    [
        ("default", "fixed", True),
        ("velocity_aided", "fixed", True),
        ("velocity_aided", "float", False),
        ("constant_gain", "fixed", False),
    ],
)
def test_a_configuration_that_leaves_something_out(
    tmp_path: Path, name: str, arithmetic: str, is_said: bool
) -> None:
    path = tmp_path / "made.yaml"
    path.write_text(f"filter:\n  name: {name}\n  arithmetic: {arithmetic}\n")
    chosen = checked(path)
    found = [line for line in warnings(chosen) if line.startswith("filter.arithmetic: ")]
    assert (bool(found), bool(left_out(chosen.filter))) == (is_said, is_said)
    assert not is_said or "docs/fixed-point.md" in found[0]

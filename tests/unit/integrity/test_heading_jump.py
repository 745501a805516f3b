"""A heading that jumps away from ours: when the compass decides, and when it must not."""

import math
from dataclasses import dataclass

import pytest

from h2nav.integrity.heading_jump import HeadingJump
from h2nav.maths.quaternion import from_euler
from h2nav.maths.units import DEG

REPORT_US = 100_000


@dataclass
class Case:
    """Two headings, of which one leaves the other at a time."""

    agreed_s: float = 12.0
    before_deg: float = 4.0  # the other one minus ours
    after_deg: float = 34.0
    over_reports: int = 1  # the reports that the change takes
    pause_s: float = 0.0  # without reports, before the change
    own_deg: float = 0.0  # by which our attitude turns with the change
    by_compass_deg: float | None = 12.0  # our largest error

    def backs_us_after(self, lasted_s):
        jump, t_us = HeadingJump(), 60_000_000
        ours = from_euler(0.1, 0.0, 1.0)
        by_compass_rad = None if self.by_compass_deg is None else self.by_compass_deg * DEG
        for _ in range(round(self.agreed_s * 1e6 / REPORT_US)):
            t_us += REPORT_US
            jump.look(t_us, ours, self.before_deg * DEG, by_compass_rad)
            assert not jump.compass_backs_us
        t_us += round(self.pause_s * 1e6)
        ours = from_euler(0.1, 0.0, 1.0 + self.own_deg * DEG)
        for count in range(round(lasted_s * 1e6 / REPORT_US)):
            t_us += REPORT_US
            share = min((count + 1) / self.over_reports, 1.0)
            heading_deg = self.before_deg + share * (self.after_deg - self.before_deg)
            jump.look(t_us, ours, math.remainder(heading_deg, 360.0) * DEG, by_compass_rad)
        return jump.compass_backs_us


@pytest.mark.parametrize(("lasted_s", "is_shown"), [(3.9, False), (4.2, True), (60.0, True)])
def test_it_has_to_last(lasted_s, is_shown):
    assert Case().backs_us_after(lasted_s) is is_shown


@pytest.mark.parametrize(
    ("case", "is_shown"),
    [
        (Case(agreed_s=9.8), False),
        (Case(agreed_s=10.4), True),
        (Case(before_deg=11.0), False),
        (Case(before_deg=-9.0, after_deg=-26.0), True),
        (Case(before_deg=-9.0, after_deg=-23.0), False),  # no more than late reports in a turn
        (Case(before_deg=-8.0, after_deg=-200.0), True),
        (Case(after_deg=36.0, over_reports=2), True),  # 16 deg at once
        (Case(over_reports=30), False),  # as a gyro's bias drifts
        (Case(pause_s=0.85), True),
        (Case(pause_s=1.1), False),
        (Case(own_deg=14.0), True),
        (Case(own_deg=-16.0), False),  # ours may have jumped
        (Case(by_compass_deg=16.0), True),
        (Case(by_compass_deg=18.0), False),
        (Case(by_compass_deg=None), False),
    ],
)
def test_what_is_just_a_jump_that_the_compass_contradicts(case, is_shown):
    assert case.backs_us_after(5.0) is is_shown


def test_one_that_comes_back_is_forgotten():
    jump, t_us = HeadingJump(), 60_000_000
    ours = from_euler(0.0, 0.0, 0.0)

    def looks(seconds, heading_deg, by_compass_rad=0.1):
        nonlocal t_us
        for _ in range(round(seconds * 1e6 / REPORT_US)):
            t_us += REPORT_US
            jump.look(t_us, ours, heading_deg * DEG, by_compass_rad)
        return jump.compass_backs_us

    assert not looks(12.0, 0.0)
    assert looks(5.0, 40.0)
    assert not looks(2.0, 40.0, by_compass_rad=None)  # the field is disturbed
    assert looks(5.0, 40.0)
    assert not looks(0.1, 3.0)
    # It has not agreed for long enough to be known to jump.
    assert not looks(5.0, 40.0)

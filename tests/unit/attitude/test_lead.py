"""An attitude extrapolated to a later time by its own rate."""

import math

import pytest

from h2nav.attitude.lead import extrapolated
from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.maths import quaternion

ESTIMATE = AttitudeEstimate(
    7, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0.1, 0.0, 0.0), (0.0, 0.0, 0.0), 0.01, Trust.ALIGNED
)


@pytest.mark.parametrize("lead_s", [-0.1, 0.008, 0.3])
def test_it_turns_about_the_bodys_axes_by_rate_times_time(lead_s: float) -> None:
    start = quaternion.from_euler(0.3, -0.2, 1.0)
    found = extrapolated(ESTIMATE._replace(q_nb=start), lead_s)
    expected = quaternion.multiply(start, quaternion.from_euler(0.0, 0.0, 2.0 * lead_s))
    assert quaternion.angle(found.q_nb, expected) < 1e-9
    assert math.isclose(quaternion.norm(found.q_nb), 1.0, abs_tol=1e-15)
    assert found._replace(q_nb=start) == ESTIMATE._replace(q_nb=start)


def test_no_lead_leaves_every_bit_as_it_is() -> None:
    assert extrapolated(ESTIMATE, 0.0) is ESTIMATE

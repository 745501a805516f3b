"""Innovation test ratios: deviations of measurements from an attitude, relative to their limits.

A test fails above 1, as in PX4's `*_test_ratio` and ArduPilot's EKF_STATUS_REPORT.
"""

import math
from typing import NamedTuple


class InnovationRatios(NamedTuple):
    """Ratios of one attitude, each over 1 s and 10 s, some over 3 s; NaN without a measurement.

    Attributes:
        velocity_1s: change of a measured velocity against the integrated force.
        velocity_3s: the same.
        velocity_10s: the same.
        force_10s: the integrated force against a velocity that is only bounded.
        field_1s: heading, dip and norm of the field against the earth's.
        field_10s: the same.
        turn_1s: turn of the field in space according to the gyro, which should be zero.
        turn_10s: the same.
    """

    velocity_1s: float = math.nan
    velocity_3s: float = math.nan
    velocity_10s: float = math.nan
    force_10s: float = math.nan
    field_1s: float = math.nan
    field_10s: float = math.nan
    turn_1s: float = math.nan
    turn_10s: float = math.nan

    @property
    def of_velocity(self) -> float:
        """The worst; NaN without any."""
        return _worst(self.velocity_1s, self.velocity_3s, self.velocity_10s)

    @property
    def of_field(self) -> float:
        """The worse of both; NaN without any."""
        return _worst(self.field_1s, self.field_10s)

    @property
    def of_turn(self) -> float:
        """The worse of both; NaN without any."""
        return _worst(self.turn_1s, self.turn_10s)

    @property
    def of_inertial(self) -> float:
        """The worst of those that a faulty gyro or accelerometer raises; 0 without any."""
        worst = _worst(self.of_velocity, self.force_10s, self.of_turn)
        return 0.0 if math.isnan(worst) else worst


def _worst(*ratios: float) -> float:
    worst = math.nan
    for ratio in ratios:
        if ratio > worst or worst != worst:  # noqa: PLR0124 - quicker than isnan
            worst = ratio
    return worst

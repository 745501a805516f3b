"""The axes of an ArduPilot board in its vehicle, from its parameters."""

import numpy as np

from h2nav.maths import quaternion
from h2nav.recordings.context import Array

LARGEST_TRIM_RAD = 0.5


class Trim:
    """The rotation from the autopilot's board to the vehicle's body: AHRS_TRIM, some degrees.

    IMU, compass and the estimators' quaternions are logged in the axes of the board, ATT and all
    angles in those of the body (`AP_AHRS::get_rotation_autopilot_body_to_vehicle_body`). A
    `Context` has everything in those of the body.
    """

    def __init__(self, parameters: dict[str, float]) -> None:
        angles = [parameters.get(f"AHRS_TRIM_{axis}", 0.0) for axis in "XYZ"]
        if max(map(abs, angles)) > LARGEST_TRIM_RAD:
            angles = [0.0, 0.0, 0.0]
        self.is_known = any(angles)
        self._q = quaternion.from_euler(*angles)
        axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        # Row i is the direction of axis i: vectors are rows as well.
        self._turn = np.array([quaternion.rotate(self._q, axis) for axis in axes])
        units = [tuple(unit) for unit in np.eye(4)]
        back = quaternion.conjugate(self._q)
        self._back = np.array([quaternion.multiply(unit, back) for unit in units])
        self._forth = np.array([quaternion.multiply(unit, self._q) for unit in units])

    def vectors(self, v: Array) -> Array:
        """(N, 3) vectors of the board in axes of the body."""
        return v @ self._turn if self.is_known else v

    def of_board(self, q: Array) -> Array:
        """(N, 4) attitudes of the body to attitudes of the board."""
        return q @ self._forth if self.is_known else q

    def attitudes(self, q: Array) -> Array:
        """(N, 4) attitudes of the board to attitudes of the body."""
        return q @ self._back if self.is_known else q


NO_TRIM = Trim({})
"""The board and the body have the same axes."""

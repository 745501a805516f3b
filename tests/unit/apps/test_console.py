"""What people see while the daemon runs."""

import os

from h2nav.apps.console import Console
from h2nav.service.records import HealthRecord


def shown(**values):
    health = HealthRecord("active", "", "1/1", "RAW_IMU", 100.0, 5, 1, 4, True, True, **values)
    screen, keyboard = os.openpty()
    with os.fdopen(keyboard, "w") as terminal:
        Console(stream=terminal).status(10**9, health)
        line = os.read(screen, 4096).decode()
    os.close(screen)
    return line


def test_the_difference_from_the_autopilot_is_in_the_status_line():
    line = shown(autopilot_tilt_deg=0.31, autopilot_heading_deg=-1.2)
    assert "EKF: tilt 0.3 heading -1.2 deg" in line
    assert "EKF" not in shown()

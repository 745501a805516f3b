"""Errors of a simulated flight by phase: h2nav with and without GPS, next to EKF3 and DCM.

Run: python tools/flight_phases.py FLIGHT.tlog [NAME=FROM-TO ...]   (boot time in s)
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from flight_picture import angles_of, errors, estimates_of
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.cli import main as h2nav
from h2nav.io import codec
from h2nav.io.deframer import Deframer
from h2nav.io.recordings import open_recording
from h2nav.maths import quaternion


def boot_offset_s(flight: Path) -> float:
    """UNIX time minus boot time."""
    deframer = Deframer()
    for t_ns, data in open_recording(flight).received():
        for frame in deframer.feed(data):
            if frame.msg_id == mavlink.MAVLINK_MSG_ID_ATTITUDE:
                return t_ns * 1e-9 - codec.decode(frame).time_boot_ms * 1e-3
    raise SystemExit(f"{flight}: no ATTITUDE")


def total_deg(angles: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Angle of the whole error rotation."""
    turns = []
    for row, difference in zip(np.radians(angles), np.radians(error), strict=True):
        ours = quaternion.from_euler(*row)
        truth = quaternion.from_euler(*(row - difference))
        turns.append(quaternion.angle(ours, truth))
    return np.degrees(np.array(turns))


def main() -> None:
    flight = Path(sys.argv[1])
    phases = [word.partition("=") for word in sys.argv[2:]] or [("whole flight", "=", "0-1e9")]
    truth = angles_of(flight, mavlink.MAVLINK_MSG_ID_SIMSTATE)
    offset_s = boot_offset_s(flight)
    candidates = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, words in (("h2nav with GPS", []), ("h2nav without", ["--no-gps"])):
            log = Path(folder) / f"{name}.mcap"
            h2nav(["replay", str(flight), "-o", str(log), *words])
            candidates[name] = estimates_of(log)
    candidates["EKF3"] = angles_of(flight, mavlink.MAVLINK_MSG_ID_ATTITUDE)
    candidates["DCM"] = angles_of(flight, mavlink.MAVLINK_MSG_ID_AHRS2)
    for name, (times, angles) in candidates.items():
        error = errors(times, angles, *truth)
        tilt, total = np.hypot(error[:, 0], error[:, 1]), total_deg(angles, error)
        cells = []
        for phase, _, span in phases:
            start_s, end_s = (float(word) for word in span.split("-"))
            inside = (times - offset_s > start_s) & (times - offset_s < end_s)
            rms = [np.sqrt(np.mean(values[inside] ** 2)) for values in (total, tilt)]
            cells.append(f"{phase} {rms[0]:.2f} / {rms[1]:.2f}")
        print(f"{name:16} " + "   ".join(cells))


if __name__ == "__main__":
    main()

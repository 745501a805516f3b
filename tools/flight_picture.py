"""Draws the README's picture: attitude errors of a recorded flight, ours next to the autopilot's.

Run: python tools/flight_picture.py FLIGHT.tlog OUT.png   (a simulated flight, with SIMSTATE in it)
"""

import sys
import tempfile
from pathlib import Path

import matplotlib as mpl
import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.cli import main as h2nav
from h2nav.recordings.recording import open_recording
from h2nav.wire import codec
from h2nav.wire.deframer import Deframer

mpl.use("Agg")
from matplotlib import pyplot as plt


def angles_of(flight: Path, message_id: int) -> tuple[np.ndarray, np.ndarray]:
    """UNIX time (s) and roll, pitch, yaw (deg) of every message of a kind."""
    deframer = Deframer()
    rows = []
    for t_ns, data in open_recording(flight).received():
        for frame in deframer.feed(data):
            if frame.msg_id == message_id:
                fields = codec.decode(frame)
                rows.append((t_ns * 1e-9, fields.roll, fields.pitch, fields.yaw))
    table = np.array(rows)
    return table[:, 0], np.degrees(table[:, 1:])


def estimates_of(log: Path) -> tuple[np.ndarray, np.ndarray]:
    """UNIX time (s) and roll, pitch, yaw (deg) of our estimates."""
    rows = [
        (unix_ns * 1e-9, record["roll_deg"], record["pitch_deg"], record["yaw_deg"])
        for unix_ns, record in open_recording(log).records("/estimate")
    ]
    table = np.array(rows)
    return table[:, 0], table[:, 1:]


def errors(
    times: np.ndarray, angles: np.ndarray, truth_times: np.ndarray, truth: np.ndarray
) -> np.ndarray:
    """Differences to the truth that is nearest in time, deg, wrapped."""
    after = np.clip(np.searchsorted(truth_times, times), 1, len(truth_times) - 1)
    is_nearer = times - truth_times[after - 1] < truth_times[after] - times
    nearest = np.where(is_nearer, after - 1, after)
    return (angles - truth[nearest] + 180.0) % 360.0 - 180.0


def main() -> None:
    flight, out = Path(sys.argv[1]), Path(sys.argv[2])
    truth_times, truth = angles_of(flight, mavlink.MAVLINK_MSG_ID_SIMSTATE)
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "flight.mcap"
        h2nav(["replay", str(flight), "-o", str(log)])
        candidates = {
            "DCM (AHRS2)": angles_of(flight, mavlink.MAVLINK_MSG_ID_AHRS2),
            "EKF3 (ATTITUDE)": angles_of(flight, mavlink.MAVLINK_MSG_ID_ATTITUDE),
            "h2nav": estimates_of(log),
        }
    figure, axes = plt.subplots(3, 1, figsize=(8.0, 5.0), sharex=True)
    for name, (times, angles) in candidates.items():
        error = errors(times, angles, truth_times, truth)
        for axis, column in zip(axes, error.T, strict=True):
            axis.plot(times - truth_times[0], column, label=name, linewidth=0.8)
    for axis, name, limit in zip(axes, ("roll", "pitch", "yaw"), (2.0, 2.0, 12.0), strict=True):
        axis.set_ylabel(f"{name} error, deg")
        axis.set_ylim(-limit, limit)
        axis.grid(alpha=0.3)
    axes[0].legend(loc="upper left", ncols=3, fontsize="small")
    axes[-1].set_xlabel("time, s")
    figure.align_ylabels()
    figure.tight_layout()
    figure.savefig(out, dpi=110)


if __name__ == "__main__":
    main()

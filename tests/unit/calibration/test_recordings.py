"""Calibrations of recorded flights against what their simulators were told."""

import struct
from pathlib import Path

import numpy as np
import pytest

from h2nav.apps.playback import PlaybackOptions
from h2nav.apps.reviewing import evidence_of
from h2nav.calibration.field_rows import earth_at
from h2nav.calibration.vehicle import calibrate
from h2nav.recordings.opening import open_flight
from h2nav.recordings.recording import open_recording
from h2nav.wire.imu import UT_PER_MGAUSS
from tests.needs import shared_data

pytestmark = pytest.mark.thorough

# What every ArduPilot simulator's parameters say unless they are told otherwise.
DEFAULTS = {
    "COMPASS_OFS_X": 5.0,
    "COMPASS_OFS_Y": 13.0,
    "COMPASS_OFS_Z": -18.0,
    "COMPASS_EXTERNAL": 1.0,
    "COMPASS_ORIENT": 0.0,
}
WITHIN_MG = 2.5
# The simulator's earth is PX4's own table, with 10 deg between its points: dip 63.15 deg there,
# where the World Magnetic Model has 63.54. Fitted to the raw field by true attitudes and iron.
PX4_WORLD_DOWN_MG = 429.6


def evidence(path: Path, parameters: dict[str, float]):
    return evidence_of(open_flight(path), PlaybackOptions(), parameters)


def part_of(path: Path, folder: Path, from_s: float, to_s: float) -> Path:
    """What arrived between two times after the recording's start."""
    part, entries = folder / path.name, list(open_recording(path).received())
    first_ns, last_ns = (entries[0][0] + s * 1e9 for s in (from_s, to_s))
    part.write_bytes(
        b"".join(
            struct.pack(">Q", t_ns // 1000) + data
            for t_ns, data in entries
            if first_ns <= t_ns < last_ns
        )
    )
    return part


# SIM_MAG1_OFS, and the rotation that was simulated; from before take-off to when it has flown and
# turned enough.
@pytest.mark.parametrize(
    ("name", "span_s", "offset", "orientation"),
    [
        ("hard_iron_from_boot", (50.0, 165.0), (50.0, -25.0, 25.0), None),
        ("compass_1_turned", (150.0, 250.0), (5.0, 13.0, -18.0), 2.0),
    ],
)
def test_offsets_and_rotation_are_those_of_the_simulator(
    name, span_s, offset, orientation, tmp_path
):
    path = part_of(shared_data(f"flights/{name}.tlog"), tmp_path, *span_s)
    found = calibrate([evidence(path, DEFAULTS)])
    new = {change.name: change.new for change in found.outcomes[0].changes}
    got = [new[f"COMPASS_OFS_{axis}"] for axis in "XYZ"]
    assert got == pytest.approx(offset, abs=WITHIN_MG)
    assert new.get("COMPASS_ORIENT") == orientation
    figures = found.outcomes[0].figures
    assert figures["residual_after_mg"] < 0.1 * figures["residual_before_mg"]


def test_a_raw_field_shows_what_px4_has_calibrated_away():
    found = evidence(shared_data("flights/px4_hard_iron.tlog"), {})
    outcome = calibrate([found]).outcomes[0]
    added = [outcome.figures[f"add_{axis}_mg"] for axis in "xyz"]
    assert np.negative(added[:2]) == pytest.approx((100.0, -80.0), abs=WITHIN_MG)
    # The flight has few tilts, so what the simulated earth lacks below counts as iron.
    world_down_mg = earth_at(found.flight.earth, np.zeros(1))[0, 2] / UT_PER_MGAUSS
    lacks_mg = world_down_mg - PX4_WORLD_DOWN_MG
    assert 2.0 < lacks_mg < 5.0
    assert -added[2] == pytest.approx(50.0 - lacks_mg, abs=WITHIN_MG)


def test_a_flight_without_turns_changes_nothing():
    found = calibrate([evidence(shared_data("flights/takeoff_40s.tlog"), DEFAULTS)])
    assert not found.changes
    compasses = [one for one in found.outcomes if one.sensor.startswith("compass")]
    assert all("no turns" in outcome.left[0] for outcome in compasses)
    assert all(outcome.left for outcome in found.outcomes)

"""Prints the tables of docs/calibrate.md: offsets given and found, and halves of flights.

    python tools/calibration_table.py told DIR
    python tools/calibration_table.py halves FLIGHT...
    python tools/calibration_table.py sound FLIGHT...
    python tools/calibration_table.py repeated COUNT

DIR holds recordings of simulators with offsets set. A half: offsets are fitted to the first half of
a flight; residual and heading are those of the second half, against the simulator's truth if there
is one, else against the attitude without a compass. Repeated: so many simulated vehicles with wrong
calibrations are flown, calibrated, flown again and calibrated again.
"""

import math
import sys
from pathlib import Path

import numpy as np

from h2nav.apps.playback import PlaybackOptions
from h2nav.apps.reviewing import evidence_of
from h2nav.calibration.evidence import Evidence
from h2nav.calibration.field_fit import COUNT, OFFSET, FieldCorrection, FieldRows, fitted
from h2nav.calibration.field_rows import earth_at, field_rows
from h2nav.calibration.imu import calibrate_accelerometer, calibrate_gyro, tracks_of
from h2nav.calibration.level import calibrate_level
from h2nav.calibration.regression import part_of
from h2nav.calibration.settings import CompassSettings, ardupilot_compass, px4_compass
from h2nav.calibration.vehicle import calibrate
from h2nav.maths.units import DEG, MG_PER_UT
from h2nav.recordings.opening import open_flight
from h2nav.reviews.inertial import attitudes, conjugate, rotate

# As every ArduPilot simulator starts.
DEFAULTS = {"COMPASS_OFS_X": 5.0, "COMPASS_OFS_Y": 13.0, "COMPASS_OFS_Z": -18.0}
DEFAULTS |= {"COMPASS_EXTERNAL": 1.0, "COMPASS_ORIENT": 0.0}
# Of a simulator whose accelerometers, gyros and board are sound.
SOUND = {f"INS_ACC2OFFS_{axis}": 0.0 for axis in "XYZ"}
SOUND |= {f"INS_ACC2SCAL_{axis}": 1.0 for axis in "XYZ"}
SOUND |= {f"INS_GYR2OFFS_{axis}": 0.0 for axis in "XYZ"}
SOUND |= {f"AHRS_TRIM_{axis}": 0.0 for axis in "XYZ"}
TOLD = ("hard_iron_from_boot", "compass_1_turned", "compass_1_hard_iron", "px4_hard_iron")


def told(folder: Path) -> None:
    """The offsets set in simulators are in the README of the recordings."""
    for name in TOLD:
        parameters = {} if name.startswith("px4") else DEFAULTS
        flight = evidence_of(open_flight(folder / f"{name}.tlog"), PlaybackOptions(), parameters)
        found = calibrate([flight]).outcomes[0]
        values = ", ".join(f"{change.name} {change.new:.0f}" for change in found.changes)
        figures = found.figures
        before, after = figures["residual_before_mg"], figures["residual_after_mg"]
        print(f"{name}: {values or '; '.join(found.notes)}; residual {before:.0f} -> {after:.0f}")


def halves(path: Path) -> None:
    """All compasses of a flight."""
    flight = evidence_of(open_flight(path), PlaybackOptions(), {})
    for track in flight.compasses():
        own = flight.parameters
        settings = (
            px4_compass(own, track.compass, track.device_id)
            if flight.autopilot == "PX4"
            else ardupilot_compass(own, track.compass)
        )
        rows = field_rows(flight, track, settings, 0)
        if rows is None:
            continue
        settings = settings or CompassSettings(track.compass, 0)
        middle = 0.5 * (rows.t_s[0] + rows.t_s[-1])
        first, second = (part_of(rows, half) for half in (rows.t_s < middle, rows.t_s >= middle))
        free = np.zeros(COUNT, dtype=bool)
        free[OFFSET] = True
        nothing = np.zeros(len(first.t_s))
        new = fitted(first, settings.correction, free, nothing).correction
        shown = " -> ".join(_scored(flight, second, each) for each in (settings.correction, new))
        print(f"{path.stem} compass {track.compass + 1}: {shown}")


def sound(path: Path) -> None:
    """Accelerometer, gyro and level by the second IMU of a simulator, which has no error."""
    flight = evidence_of(open_flight(path), PlaybackOptions(), SOUND)
    tracks = tracks_of([flight], 1)
    if not tracks.pairs:
        return
    forces = calibrate_accelerometer(tracks)
    for found in (forces.outcome, calibrate_gyro(tracks), calibrate_level(tracks, forces)):
        values = ", ".join(f"{name} {value:.3f}" for name, value in found.figures.items())
        words = "; ".join((*found.left, *found.notes))
        changes = ", ".join(f"{c.name} {c.new:.4g}" for c in found.changes)
        print(
            f"{path.stem} {found.sensor}: {changes or 'nothing to change'} ({words}) {values}",
            flush=True,
        )


def repeated(count: int) -> None:
    """What the second calibration writes, and how far the first one is off."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    from tests.unit.calibration.repeated_flights import twice, written_again

    again, late, off_mg = 0, 0, []
    for seed in range(count):
        vehicle, first, second = twice(seed)
        wrong = written_again(first, second)
        again += bool(wrong)
        late += len(second.changes) > len(wrong)
        new = {change.name: change.new for change in first.changes}
        found = np.array([new.get(f"COMPASS_OFS_{axis}", 0.0) for axis in "XYZ"])
        off_mg.append(float(np.linalg.norm(found - MG_PER_UT * vehicle.iron.offset_ut)))
        for change in second.changes:
            print(f"seed {seed}: {change.name} {change.old:.4g} -> {change.new:.4g}", flush=True)
    middle, most = np.quantile(off_mg, (0.5, 0.95))
    print(
        f"{again} of {count} second flights change what the first one showed, {late} show a sensor "
        f"that the first did not; the first compass offset is off by {middle:.1f} mG in the "
        f"middle, {most:.1f} mG at the 95th percentile"
    )


def _scored(flight: Evidence, rows: FieldRows, correction: FieldCorrection) -> str:
    """Rms of the residual and of the heading that the compass shows."""
    truth, earth_n = flight.context.truth, earth_at(flight.flight.earth, rows.t_s)
    expected = rows.earth_ut
    if truth is not None:
        q = flight.trim.of_board(attitudes(truth.t_s, truth.q_nb).at(rows.t_s))
        expected = rotate(conjugate(q), earth_n)
    good = np.isfinite(expected.sum(axis=1))
    field = correction.corrected(rows.raw_ut, np.zeros(len(rows.t_s)))[good]
    expected, down = expected[good], rows.down[good]
    residual = math.sqrt(float(((field - expected) ** 2).sum(axis=1).mean())) * MG_PER_UT
    across = (np.cross(expected, field) * down).sum(axis=1)
    level = (field * expected).sum(axis=1)
    level -= (field * down).sum(axis=1) * (expected * down).sum(axis=1)
    heading = math.sqrt(float((np.arctan2(across, level) ** 2).mean())) / DEG
    return f"{residual:.1f} mG {heading:.2f} deg"


if __name__ == "__main__":
    if sys.argv[1] == "told":
        told(Path(sys.argv[2]))
    elif sys.argv[1] == "repeated":
        repeated(int(sys.argv[2]))
    else:
        for name in sys.argv[2:]:
            {"halves": halves, "sound": sound}[sys.argv[1]](Path(name))

"""Short recordings against what they gave before; ``make golden`` rewrites, the diff is the review.

The tolerance covers the last bits of sin and atan2 on another machine, nothing else.
"""

import csv
import functools

import pytest
from needs import REPOSITORY
from replayed import Replayed

from h2nav.apps.configuration import Configuration, FilterSettings

GOLDEN = REPOSITORY / "tests" / "replay" / "golden"
RECORDING = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"
EVERY = 25
TOLERANCE_DEG = 0.002
COLUMNS = ("t_us", "roll_deg", "pitch_deg", "yaw_deg", "trust")
FILTERS = {
    "default": FilterSettings(),
    "default_fixed": FilterSettings(arithmetic="fixed"),
}


@functools.cache
def replayed(name):
    return Replayed(RECORDING, Configuration(filter=FILTERS[name]))


@pytest.mark.parametrize("name", FILTERS)
def test_takeoff_gives_the_golden_attitudes(name, update_golden):
    rows = [
        [record.t_us, record.roll_deg, record.pitch_deg, record.yaw_deg, record.trust]
        for record in replayed(name).estimates[::EVERY]
    ]
    path = GOLDEN / f"takeoff_40s.{name}.csv"
    if update_golden:
        with path.open("w", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(COLUMNS)
            writer.writerows(
                [t, f"{r:.4f}", f"{p:.4f}", f"{y:.4f}", trust] for t, r, p, y, trust in rows
            )
    with path.open(newline="") as stream:
        golden = list(csv.reader(stream))[1:]
    assert len(rows) == len(golden)
    for row, expected in zip(rows, golden, strict=True):
        assert row[0] == int(expected[0])
        assert row[1:4] == pytest.approx([float(x) for x in expected[1:4]], abs=TOLERANCE_DEG)
        assert row[4] == int(expected[4])


@pytest.mark.parametrize(
    ("name", "tilt_deg", "yaw_deg"),
    [("default", 0.3, 0.8), ("default_fixed", 0.3, 0.8)],
)
def test_takeoff_is_near_the_truth(name, tilt_deg, yaw_deg):
    errors = replayed(name).errors()
    assert errors.reference == "SIMSTATE"
    assert errors.tilt < tilt_deg
    assert errors.yaw < yaw_deg

"""Folders of flights as reviews leave them, without the work of reviewing."""

import random
from datetime import UTC, datetime, timedelta
from pathlib import Path

from h2nav.flights.folder import FlightFolder

KINDS = {
    "vibration": ("warning", "IMU 1 vibrates, 34 m/s^2"),
    "compass_hard_iron": ("notice", "compass 1 is off by 40 mG"),
    "crash": ("error", "crashed at 8 m/s"),
    "gps_velocity": ("warning", "the GPS velocity contradicts the IMU"),
    "clock_drift": ("info", "the autopilot's clock runs 120 ppm slow"),
}
AIRFRAMES = ("ArduPilot quadrotor 1/1", "ArduPilot fixed_wing 2/1", "PX4 quadrotor 3/1")
FIRMWARES = ("ArduCopter V4.6.1", "ArduPlane V4.6.1", "PX4 v1.16.0")
FIRST = datetime(2026, 1, 1, 8, 0, tzinfo=UTC)


def summary(seed: int) -> dict[str, object]:
    """A row of the list; equal seeds give equal ones."""
    dice = random.Random(seed)
    kinds = dice.sample(sorted(KINDS), dice.choice((0, 0, 1, 2)))
    found = sorted(
        ((KINDS[kind], kind) for kind in kinds),
        key=lambda pair: ("error", "warning", "notice", "info").index(pair[0][0]),
    )
    (worst, text), kind = found[0] if found else (("", ""), "")
    severities = [each[0] for each, _ in found]
    frame = dice.randrange(len(AIRFRAMES))
    sound = "Nothing was found wrong in what could be looked at."
    return {
        "date": f"{FIRST + timedelta(hours=7 * seed):%Y-%m-%dT%H:%M:%SZ}",
        "vehicle": AIRFRAMES[frame].split()[1],
        "airframe": AIRFRAMES[frame],
        "firmware": FIRMWARES[frame],
        "kind": "mcap",
        "duration_s": round(dice.uniform(40.0, 5000.0), 1),
        "distance_m": dice.choice((None, round(dice.uniform(0.0, 20000.0), 1))),
        "verdict": f"In flight {text}." if text else sound,
        "worst": worst,
        "worst_kind": kind,
        "worst_text": text,
        "errors": severities.count("error"),
        "warnings": severities.count("warning"),
        "notices": severities.count("notice") + severities.count("info"),
        "kinds": {kind: each[0] for each, kind in found},
    }


def add_flights(root: Path, count: int, size: int = 20) -> FlightFolder:
    """A folder with so many reviewed flights."""
    folder = FlightFolder(root)
    folder.reviews.mkdir(parents=True, exist_ok=True)
    for number in range(count):
        name = f"{FIRST + timedelta(hours=7 * number):%Y%m%dT%H%M%SZ}_0123abcd_{number:06d}.mcap"
        (root / name).write_bytes(b"\x89MCAP0\r\n" + bytes(size))
    for number, flight in enumerate(
        sorted(folder.flights().values(), key=lambda one: one.best.name)
    ):
        written = folder.reviews / ".written"
        written.mkdir(exist_ok=True)
        (written / "review.html").write_text(f"<!DOCTYPE html><title>{number}</title>")
        (written / "review.json").write_text("{}")
        folder.commit(flight, summary(number), written=written)
        written.rmdir()
    return folder

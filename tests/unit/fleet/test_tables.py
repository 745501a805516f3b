"""The tables of a fleet hold figures, trends and an odometer of each airframe."""

import numpy as np
from pyarrow import parquet

from h2nav.airframes.odometer import ComponentChange
from h2nav.fleet.sources import FlightSource
from h2nav.fleet.store import Store
from h2nav.fleet.tables import AIRFRAMES, FEATURES, FLIGHTS, write_tables
from h2nav.fleet.work import Task

DAYS = 12


def result(day, motor_us, airframe="uid:1"):
    flown = {"flown_s": 600.0, "distance_m": 2000.0, "landings": 1, "hard_landings": int(day == 3)}
    return {
        "airframe": airframe,
        **flown,
        "remembered": {
            "name": "x",
            "airframe": {"id": airframe},
            "start_utc": f"2026-01-{day + 1:02}T00:00:00Z",
            "features": {"motor_2_us": motor_us, "rotation_hz": 90.0},
            "flown": flown,
        },
    }


def task(name):
    return Task(FlightSource(f"/logs/{name}", 1, ""), name, "run")


def written(tmp_path, results, changes=()):
    tasks = [(task(f"{n:02}.bin"), each) for n, each in enumerate(results)]
    write_tables(tasks, tmp_path, Store(str(tmp_path / "out")), changes)
    read = (parquet.read_table(tmp_path / "out" / n) for n in (FLIGHTS, FEATURES, AIRFRAMES))
    return [table.to_pylist() for table in read]


def test_a_flight_that_left_its_past_has_it_in_the_table(tmp_path):
    noise = np.random.default_rng(1).normal(0.0, 3.0, DAYS)
    results = [result(day, float(value)) for day, value in enumerate(noise)]
    # The newest flight need not be the last file.
    flights, figures, _ = written(tmp_path, [result(DAYS, 60.0), *results])
    assert flights[0]["airframe"] == "uid:1"
    assert flights[0]["flown_s"] == 600.0
    told = [row for row in figures if row["trend"]]
    assert [(row["source"], row["name"], row["trend"]) for row in told] == [
        ("/logs/00.bin", "motor_2_us", "step")
    ]
    assert told[0]["earlier"] == DAYS
    assert len(figures) == 2 * (DAYS + 1)


def test_airframes_without_an_id_of_their_own_are_not_compared(tmp_path):
    results = [result(day, 0.0, "system:1 quadrotor") for day in range(DAYS)]
    results.append(result(DAYS, 500.0, "system:1 quadrotor"))
    _, figures, sums = written(tmp_path, results)
    assert not any(row["trend"] for row in figures)
    assert sums == []


def test_an_odometer_of_airframe_and_component(tmp_path):
    results = [result(day, 0.0) for day in range(4)] + [{"error": "broken"}]
    changes = [ComponentChange("uid:1", "motor 2", 1_767_225_600.0 + 2 * 86_400.0)]
    _, _, (whole, motor) = written(tmp_path, results, changes)
    assert (whole["flights"], whole["landings"], whole["hard_landings"]) == (4, 4, 1)
    assert whole["distance_m"] == 8000.0
    assert (motor["component"], motor["flights"], motor["flown_s"]) == ("motor 2", 2, 1200.0)
    assert motor["since"].isoformat() == "2026-01-03T00:00:00+00:00"

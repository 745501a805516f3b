"""The tables of a fleet hold figures, trends and an odometer of each airframe."""

from datetime import UTC, datetime

import numpy as np
from pyarrow import parquet

from h2nav.airframes.features import named
from h2nav.airframes.odometer import ComponentChange
from h2nav.fleet import tables
from h2nav.fleet.sources import FlightSource
from h2nav.fleet.store import Store
from h2nav.fleet.tables import (
    AIRFRAMES,
    FEATURES,
    FINDINGS,
    FLIGHTS,
    severity_rank,
    write_tables,
)
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


FINDING = {
    "kind": "magnet", "source": "IMU 1", "severity": "warning", "from_s": 1.0, "to_s": 2.5,
    "size": 9.0, "unit": "deg", "text": "near a magnet", "evidence": "dip",
}  # fmt: skip


def test_findings_have_a_table_and_the_worst_come_first_in_the_row(tmp_path):
    """In the table they stay in their order."""
    others = [{**FINDING, "severity": word, "text": word} for word in ("info", "critical", "error")]
    reviewed = {
        "kind": "tlog", "start": "2026-01-02T03:04:05+00:00", "findings": [FINDING, *others],
        "review": "reviews/a.html", "crash_s": 3.5,
    }  # fmt: skip
    tasks = [(task("a.bin"), reviewed), (task("b.bin"), {"error": "no recording"})]
    store = Store(str(tmp_path / "out"))
    first, second = write_tables(tasks, tmp_path, store)
    assert first.findings == (
        "IMU 1: critical", "IMU 1: error", "IMU 1: near a magnet", "IMU 1: info",
    )  # fmt: skip
    assert second.findings == ()
    rows = parquet.read_table(tmp_path / "out" / FLIGHTS).to_pylist()
    assert rows == [first.values, second.values]
    names = ("source", "size_bytes", "key", "kind", "crash_s", "worst_severity", "finding_count",
             "error", "review")  # fmt: skip
    assert [tuple(each[name] for name in names) for each in rows] == [
        ("/logs/a.bin", 1, "a.bin", "tlog", 3.5, "critical", 4, "", "reviews/a.html"),
        ("/logs/b.bin", 1, "b.bin", None, None, "", 0, "no recording", ""),
    ]
    assert rows[0]["start"] == datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
    assert rows[1]["start"] is None
    found = parquet.read_table(tmp_path / "out" / FINDINGS).to_pylist()
    assert [each["text"] for each in found] == ["near a magnet", "info", "critical", "error"]
    assert found[0] == {
        "source": "/logs/a.bin", "key": "a.bin", "part": "IMU 1",
        **{name: value for name, value in FINDING.items() if name != "source"},
    }  # fmt: skip
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        FLIGHTS, FINDINGS, FEATURES, AIRFRAMES,
    }  # fmt: skip


def test_every_column_says_its_unit_and_meaning(tmp_path):
    written(tmp_path, [result(0, 1.0)])
    for name in (FLIGHTS, FINDINGS, FEATURES, AIRFRAMES):
        schema = parquet.read_schema(tmp_path / "out" / name)
        for field in schema:
            assert field.metadata[b"description"], field.name
            ends = {"_s": b"s", "_m": b"m", "_deg": b"deg", "_hz": b"Hz", "_bytes": b"bytes"}
            unit = next((unit for end, unit in ends.items() if field.name.endswith(end)), b"")
            assert field.metadata[b"unit"] == unit


def test_the_worst_severity_sorts_first_and_none_last():
    words = ["critical", "error", "warning", "notice", "info", "", None, "odd"]
    assert [severity_rank(word) for word in words] == [0, 1, 2, 3, 4, 5, 5, 5]


def test_rows_are_written_in_groups_that_fit_into_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "_GROUP_ROWS", 2)
    tasks = [(task(f"{n}.bin"), {}) for n in range(5)]
    write_tables(tasks, tmp_path, Store(str(tmp_path / "out")))
    file = parquet.ParquetFile(tmp_path / "out" / FLIGHTS)
    sizes = [file.metadata.row_group(n).num_rows for n in range(file.num_row_groups)]
    assert sizes == [2, 2, 1]


def test_a_figure_has_its_unit_and_the_date_of_its_flight(tmp_path):
    undated = result(0, 7.0)
    undated["remembered"]["start_utc"] = None
    _, figures, _ = written(tmp_path, [result(4, 5.0), undated])
    assert [(each["source"], each["name"], each["value"]) for each in figures] == [
        (f"/logs/0{n}.bin", name, value)
        for n, motor_us in ((0, 5.0), (1, 7.0))
        for name, value in (("motor_2_us", motor_us), ("rotation_hz", 90.0))
    ]
    assert figures[0]["start"] == datetime(2026, 1, 5, tzinfo=UTC)
    assert figures[2]["start"] is None
    assert {each["airframe"] for each in figures} == {"uid:1"}
    assert all(each["trend"] is None and each["earlier"] is None for each in figures)
    assert [each["unit"] for each in figures[:2]] == [
        named(each["name"]).feature.unit for each in figures[:2]
    ]

"""A fleet on a cluster of two processes: every flight becomes a row, once."""

import functools
import zipfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import fleet_reviews
import pytest
from distributed import Client
from pyarrow import parquet

from h2nav.errors import BadInput
from h2nav.fleet import running
from h2nav.fleet.running import TaskOutcome, Work, cluster, run_fleet
from h2nav.fleet.sources import find
from h2nav.fleet.store import Store
from h2nav.fleet.work import Limits

LIMITS = Limits(time_s=600.0, memory_mib=700)


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with cluster(None, 2, 1000) as found:
        yield found


class Fleet:
    """Recordings in a folder, and what is made of them."""

    def __init__(self, folder: Path) -> None:
        self.logs, self.output, self.diary = folder / "logs", folder / "out", folder / "diary"
        self.logs.mkdir()
        self.told: list[str] = []

    def add(self, **words: str) -> None:
        for name, word in words.items():
            (self.logs / f"{name}.tlog").write_text(word)

    def run(
        self, client: Client, limits: Limits = LIMITS, sources: list[str] | None = None
    ) -> TaskOutcome:
        review = functools.partial(fleet_reviews.review, diary=str(self.diary))
        work = Work(review, "1", limits)
        store = Store(str(self.output))
        found = find(sources or [str(self.logs)])
        return run_fleet(client, found, work, store, lambda task, _: self.told.append(task.key))

    def done(self) -> Counter[str]:
        lines = self.diary.read_text().splitlines() if self.diary.exists() else []
        return Counter(line.split(".")[0] for line in lines)


@pytest.fixture
def fleet(tmp_path: Path) -> Fleet:
    return Fleet(tmp_path)


def errors(outcome: TaskOutcome) -> dict[str, str]:
    return {Path(row.values["source"]).stem: row.values["error"] for row in outcome.rows}


def test_every_flight_becomes_a_row_and_nothing_is_done_twice(client: Client, fleet: Fleet) -> None:
    fleet.add(a="good", b="broken", c="fault", d="better", e="good")
    outcome = fleet.run(client)
    assert errors(outcome) == {
        "a": "",
        "b": "b.tlog: no recording; expected MAVLink",
        "c": "fault of the review: ZeroDivisionError: division by zero",
        "d": "",
        "e": "",
    }
    assert outcome.done_before == 0
    assert len(outcome.costs) == 5
    flights = parquet.read_table(fleet.output / "flights.parquet").to_pylist()
    assert [row["imus"] for row in flights] == [4, None, None, 6, 4]
    assert [row["finding_count"] for row in flights] == [0, 0, 0, 2, 0]
    assert [row["worst_severity"] for row in flights] == ["", "", "", "warning", ""]
    findings = parquet.read_table(fleet.output / "findings.parquet").to_pylist()
    assert [(row["part"], row["size"], row["unit"]) for row in findings] == [
        ("IMU 1", 9.0, "deg")
    ] * 2
    assert {row["key"] for row in findings} == {flights[3]["key"]}
    assert (fleet.output / flights[3]["review"]).read_text() == "<p>better</p>"
    assert sorted(path.suffix for path in (fleet.output / "reviews").iterdir()) == [
        *[".html"] * 3, *[".json"] * 3
    ]  # fmt: skip

    before = {path: path.read_bytes() for path in fleet.output.glob("*.*")}
    fleet.add(f="good", a="best of all")
    again = fleet.run(client)
    assert again.done_before == 4
    assert fleet.done() == {"a": 2, "b": 1, "c": 1, "d": 1, "e": 1, "f": 1}
    (fleet.logs / "f.tlog").unlink()
    fleet.add(a="good")
    third = fleet.run(client)
    assert [row.values["source"] for row in third.rows] == [
        row.values["source"] for row in outcome.rows
    ]
    assert before.keys() == set(fleet.output.glob("*.*"))


def test_a_killed_run_goes_on_where_it_was(client: Client, fleet: Fleet) -> None:
    fleet.add(**{f"flight_{number:02}": "good" for number in range(12)})
    killed_after = 5

    class Killed(Exception):
        pass

    def told(*_: object) -> None:
        told.count += 1
        if told.count == killed_after:
            raise Killed

    told.count = 0
    review = functools.partial(fleet_reviews.review, diary=str(fleet.diary))
    with pytest.raises(Killed):
        run_fleet(
            client,
            find([str(fleet.logs)]),
            Work(review, "1", LIMITS),
            Store(str(fleet.output)),
            told,
        )
    assert not (fleet.output / "flights.parquet").exists()
    while any(client.run(lambda dask_worker: len(dask_worker.state.executing)).values()):
        pass  # with a killed run its own workers would be gone
    outcome = fleet.run(client)
    assert outcome.done_before >= killed_after
    assert len(outcome.rows) == 12
    assert set(fleet.done().values()) == {1}


@pytest.mark.thorough
def test_the_tables_do_not_depend_on_the_workers(client: Client, tmp_path: Path) -> None:
    words = {f"flight_{number:02}": "good" + "!" * (number % 5) for number in range(15)}
    fleets = []
    (tmp_path / "shared").mkdir()
    for name in ("one", "two"):
        folder = tmp_path / name
        folder.mkdir()
        fleet = Fleet(folder)
        fleet.logs = tmp_path / "shared"
        fleet.add(**words, broken="broken") if name == "one" else None
        fleets.append(fleet)
    fleets[0].run(client)
    with cluster(None, 1, 1000) as lonely:
        fleets[1].run(lonely)
    for name in ("flights.parquet", "findings.parquet", "index.html"):
        assert (
            fleets[0].output.joinpath(name).read_bytes()
            == fleets[1].output.joinpath(name).read_bytes()
        )


@pytest.mark.thorough
def test_what_hangs_is_given_up(client: Client, fleet: Fleet) -> None:
    fleet.add(a="good", b="hang")
    limits = Limits(time_s=5.0, memory_mib=700)
    outcome = fleet.run(client, limits)
    assert errors(outcome) == {"a": "", "b": "given up: the review took longer than 5 s"}
    assert fleet.run(client, limits).done_before == 2


@pytest.mark.thorough
def test_what_eats_or_kills_is_a_row_with_its_reason(client: Client, fleet: Fleet) -> None:
    fleet.add(a="good", b="die", c="eat", d="good")
    outcome = fleet.run(client)
    assert errors(outcome) == {
        "a": "",
        "b": "the worker died at this flight, each time",
        "c": "given up: the review needed more than 700 MiB of memory",
        "d": "",
    }
    assert fleet.done() == {"a": 1, "b": 2, "c": 1, "d": 1}
    assert not list((fleet.output / "started").iterdir())
    again = fleet.run(client)
    assert again.done_before == 3, "the one that killed its workers is tried again"


def test_remote_recordings_are_fetched_and_removed(
    client: Client, fleet: Fleet, tmp_path: Path
) -> None:
    archive = tmp_path / "logs.zip"
    with zipfile.ZipFile(archive, "w") as target:
        target.writestr("day/one.tlog", b"good")
        target.writestr("day/two.tlog", b"broken")
    outcome = fleet.run(client, sources=[f"zip::file://{archive}"])
    assert [row.values["error"] for row in outcome.rows] == [
        "",
        "two.tlog: no recording; expected MAVLink",
    ]
    scratch = client.run(lambda dask_worker: dask_worker.local_directory)
    assert not [path for place in scratch.values() for path in Path(place).glob("h2nav-*")]


@pytest.mark.thorough
def test_a_recording_that_is_gone_is_tried_again(client: Client, fleet: Fleet) -> None:
    fleet.add(a="good", b="good")
    sources = find([str(fleet.logs)])
    (fleet.logs / "b.tlog").rename(fleet.logs / "moved")
    review = functools.partial(fleet_reviews.review, diary=str(fleet.diary))
    work, store = Work(review, "1", LIMITS), Store(str(fleet.output))
    gone = run_fleet(client, sources, work, store, lambda *_: None)
    assert errors(gone)["b"].startswith("cannot be read: FileNotFoundError")
    (fleet.logs / "moved").rename(fleet.logs / "b.tlog")
    assert errors(run_fleet(client, sources, work, store, lambda *_: None)) == {"a": "", "b": ""}
    assert fleet.done() == {"a": 1, "b": 1}


@pytest.mark.thorough
def test_nobody_at_the_scheduler_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "_CONNECT_S", 1.0)
    with (
        pytest.raises(BadInput, match=r"tcp://127\.0\.0\.1:1: "),
        cluster("tcp://127.0.0.1:1", 1, 600),
    ):
        pass

"""Pipeline and fake autopilot on one manual clock: a flight, its log, another flight."""

import math
import os
import random
import time
from itertools import pairwise

import pytest
from log_limits import limits
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from simulated_flight import START_NS, SimulatedFlight

from h2nav.apps.configuration import Configuration, FlightSettings, LogSettings
from h2nav.apps.fetched_file import FetchedFile, unfinished
from h2nav.apps.flight_keeper import FlightKeeper
from h2nav.apps.log_fetcher import LogFetcher
from h2nav.fetch.log_fetch import PartOfLog
from h2nav.log.recorder import Recorder
from h2nav.recordings.recording import open_recording
from h2nav.service.settings import AutopilotSettings
from h2nav.sim.personalities import ARDUPILOT, PX4
from h2nav.sim.scenarios import SCENARIOS, Scenario
from h2nav.wire import codec
from h2nav.wire.deframer import Deframer

BYTES_PER_S = 92_160.0
# Nothing but whether it is armed and flies matters to the fetch.
HOP = SCENARIOS["rest"]._replace(armed_s=3.0, airborne_s=4.0, landed_s=6.0, disarmed_s=7.0)
PARTS = (mavlink.MAVLINK_MSG_ID_LOG_DATA, mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL)
# More by hand: `pytest -s tests/unit/apps/test_log_fetcher.py -k armed_again` with H2NAV_LOG_MB=10.
FIRST = random.Random(1).randbytes(round(float(os.environ.get("H2NAV_LOG_MB", "0.5")) * 1e6))
SECOND = random.Random(2).randbytes(200_000)
SHARE = FlightSettings().fetch_share
FETCH_S = 1.2 * len(FIRST) / (SHARE * BYTES_PER_S)
FETCH_FROM_S = 21.0
# The link is cut, and in the midst of the rest the second hop begins.
CUT_S, CUT_LENGTH_S = FETCH_FROM_S + 0.5 + 0.3 * FETCH_S, 20.0
AGAIN_S = CUT_S + CUT_LENGTH_S + 0.2 * FETCH_S


class TwoHops(Scenario):
    """The hop, and once more."""

    def _one(self, t_s):
        return t_s if t_s < AGAIN_S else t_s - AGAIN_S

    def is_armed(self, t_s):
        return HOP.is_armed(self._one(t_s))

    def is_airborne(self, t_s):
        return HOP.is_airborne(self._one(t_s))


TWO_HOPS = TwoHops(*HOP)


class Bench:
    """A daemon with a record of flights; `parts` and `arming` have the times of what it hears."""

    def __init__(
        self,
        folder,
        flown=TWO_HOPS,
        *,
        faults=(),
        personality=ARDUPILOT,
        logs=(FIRST,),
        has_files=True,
    ):
        self.folder = folder
        self.recorder = Recorder(folder, limits())
        self.parts: list[tuple[float, int]] = []
        self.is_armed: list[tuple[float, bool]] = []
        configuration = Configuration(
            autopilot=AutopilotSettings(simulation_truth=True),
            log=LogSettings(folder=str(folder)),
            flights=FlightSettings(review=False, fetch_log=True),
        )

        def watched_by(itself):
            self.fetcher = LogFetcher(configuration, itself)
            return self.fetcher

        flight = self.flight = SimulatedFlight(
            flown,
            faults=faults,
            personality=personality,
            configuration=configuration,
            line_bytes_per_s=BYTES_PER_S,
            recorder=self.recorder,
            logs=logs,
            has_files=has_files,
            watched_by=watched_by,
        )
        flight.message_ids |= {*PARTS, mavlink.MAVLINK_MSG_ID_HEARTBEAT}
        self.fetcher.message_ids |= flight.message_ids
        flight.pipeline._watched_ids = self.fetcher.message_ids
        self.watch, flight.frame = flight.frame, self.frame
        self.keeper = FlightKeeper(configuration, self.recorder, lambda *_: None, self.fetcher)
        flight.beside += [self.keeper.tend, self._keep_pace]

    def _keep_pace(self, *_):
        """The manual clock runs faster than any disk: it waits for both writers."""
        while len(self.recorder._queue) > 4000 or self._awaits_fetched_file():
            time.sleep(0.002)
        return []

    def _awaits_fetched_file(self):
        file = self.fetcher._file
        if file is None or not file._thread.is_alive():
            return False
        return file._is_complete or len(file._waiting) > 500

    def frame(self, t_ns, frame):
        t_s = (t_ns - START_NS) * 1e-9
        if frame.msg_id in PARTS:
            self.parts.append((t_s, len(frame.raw)))
        elif frame.msg_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            self.is_armed.append((t_s, bool(codec.decode(frame).base_mode & 128)))
        else:
            self.watch(t_ns, frame)

    def close(self):
        file = self.fetcher._file
        self.keeper.close()
        if file is not None:
            file.wait(60.0)
        self.recorder.close(10.0)

    def fetched(self):
        """The fetched logs in the order of the flights."""
        return [path.read_bytes() for path in sorted(self.folder.glob("*.[bu][il][ng]"))]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("personality", "has_files"),
    [(ARDUPILOT, False), (PX4, True)],
)
def test_cut_and_armed_again_the_fetch_goes_on_and_costs_no_attitude(
    tmp_path, personality, has_files
):
    cut = f"drop=1@{CUT_S}+{CUT_LENGTH_S}"
    bench = Bench(tmp_path, faults=(cut,), personality=personality, has_files=has_files)
    flight = bench.flight
    flight.run(CUT_S + CUT_LENGTH_S)
    had = bench.fetcher.fetched_bytes
    assert 0.1 * len(FIRST) < had < 0.5 * len(FIRST)
    flight.run(AGAIN_S + 6.5)
    armed_s = AGAIN_S + HOP.armed_s
    before, after = (
        [t_s for t_s, _ in bench.parts if (t_s > armed_s) is is_late] for is_late in (False, True)
    )
    assert armed_s - before[-1] < 0.2  # it was fetching
    stopped_s = after[-1] - armed_s if after else 0.0
    assert stopped_s < 0.2
    assert not bench.fetched()

    flight.autopilot.logs.add(SECOND)
    flight.run(AGAIN_S + FETCH_FROM_S + 12.0 + 0.6 * FETCH_S)
    bench.close()
    assert bench.fetched() == [FIRST, SECOND]
    assert not list(tmp_path.glob("*.part*"))
    assert bench.fetcher.fetched_bytes == len(FIRST) + len(SECOND)
    said = [text.split()[2] for _, _, text in flight.seen.notices if text.startswith("log fetched")]
    assert said == sorted(said, reverse=True)  # that of the last flight first
    assert flight.autopilot.streams.put_off == 0
    _assert_recorded_in_full(bench)
    used = sum(size for _, size in bench.parts) / (SHARE * BYTES_PER_S)
    print(
        f"{len(FIRST) / 1e6:g} MB, {had / 1e6:.2f} of them before the cut: {used:.0f} s of the "
        f"share, stopped {stopped_s:.3f} s after arming"
    )


def _assert_recorded_in_full(bench):
    """No attitude is missing but those of the cut: in the log, and of those that we send."""
    assert bench.recorder.dropped == 0
    heard_s = []
    for path in sorted(bench.folder.glob("*.mcap")):
        deframer = Deframer()
        for _, data in open_recording(path).received():
            heard_s += [
                codec.decode(frame).time_boot_ms * 1e-3
                for frame in deframer.feed(data)
                if frame.msg_id == mavlink.MAVLINK_MSG_ID_ATTITUDE
            ]
    sent = (each for _, each in bench.flight.seen.sent if type(each).__name__ == "ATTITUDE")
    for name, stamps_s in ("heard", heard_s), ("sent", [each.time_boot_ms * 1e-3 for each in sent]):
        gaps_s = sorted(b - a for a, b in pairwise(stamps_s))
        period_s = gaps_s[len(gaps_s) // 2]
        print(f"{len(stamps_s)} attitudes {name}, longest gaps {gaps_s[-2:]} s")
        assert gaps_s[-1] < CUT_LENGTH_S + 2.0
        assert gaps_s[-2] < 1.6 * period_s


@pytest.mark.thorough
def test_a_cut_of_twenty_seconds_and_a_restart_of_the_daemon_cost_nothing(tmp_path):
    bench = Bench(tmp_path, faults=("drop=1@29+20",), logs=(FIRST,))
    bench.flight.run(34.0)
    had = bench.fetcher.fetched_bytes
    assert had > 100_000
    bench.close()
    ((path, part),) = unfinished(tmp_path)
    assert part.size - sum(end - start for start, end in part.gaps) == had

    again = Bench(tmp_path, SCENARIOS["rest"], logs=(FIRST, SECOND))
    again.flight.run(15.0)
    again.close()
    assert path.read_bytes() == FIRST
    assert again.fetcher.fetched_bytes < 1.05 * (len(FIRST) - had)


@pytest.mark.thorough
def test_an_arming_text_stops_it_before_the_heartbeat(tmp_path):
    bench = Bench(tmp_path)
    bench.flight.run(29.0)
    assert bench.parts[-1][0] > 28.8
    bench.flight.inject(mavlink.MAVLink_statustext_message(6, b"Arming motors"))
    bench.flight.run(30.8)
    assert bench.parts[-1][0] < 29.2
    bench.flight.run(31.9)  # it was not armed: it goes on
    assert bench.parts[-1][0] > 31.7
    bench.close()


@pytest.mark.parametrize(
    "note",
    [
        b"",
        b"{}",
        b'{"size":100,"time_utc":1,"gaps":[[50,200]]}',
        b'{"size":100,"time_utc":1,"gaps":[[60,50]]}',
        b'{"size":1e400,"time_utc":1,"gaps":[]}',
        b'{"size":100,"time_utc":1,"gaps":[[-5,50]]}',
    ],
)
def test_a_note_that_cannot_be_true_is_removed_with_its_parts(tmp_path, note):
    (tmp_path / "a.bin.part").write_bytes(b"x" * 100)
    (tmp_path / "a.bin.part.json").write_bytes(note)
    assert unfinished(tmp_path) == []
    assert not list(tmp_path.iterdir())


def test_a_begun_log_whose_parts_are_gone_is_not_made_up(tmp_path):
    part = PartOfLog(100, 1, ((50, 100),))
    file = FetchedFile(tmp_path / "a.bin", part)
    file.write(50, b"x" * 50)
    file.complete()
    file.wait(10.0)
    assert file.trouble
    assert not list(tmp_path.iterdir())


def test_only_the_newest_unfinished_logs_are_kept(tmp_path):
    for number in range(6):
        part = PartOfLog(100, 1, ((0, 100),))
        file = FetchedFile(tmp_path / f"{number}.bin", part)
        file.write(0, b"12345")
        file.set_aside(part._replace(gaps=((5, 100),)))
        file.wait(10.0)
    assert [path.name for path, _ in unfinished(tmp_path)] == ["5.bin", "4.bin", "3.bin", "2.bin"]
    assert len(list(tmp_path.iterdir())) == 8
    assert math.isclose((tmp_path / "5.bin.part").stat().st_size, 5)

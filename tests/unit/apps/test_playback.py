"""In which order a recording reaches the pipelines: arrivals, timers, silence; and its inputs."""

import argparse
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import pytest
from wire_frames import FrameMaker, raw_imu

from h2nav.apps.configuration import Configuration
from h2nav.apps.log_contents import RecordedInputs
from h2nav.apps.playback import (
    Playback,
    PlaybackOptions,
    add_arguments,
    date_of,
    fusing_gps,
    inputs_for,
    options,
)
from h2nav.errors import BadInput
from h2nav.files import gain_files
from h2nav.recordings.imported import ImportedLog
from h2nav.wire.arrivals import gathered
from h2nav.wire.readers import Envelope

MS, S = 1_000_000, 1_000_000_000
RAW_IMU, NEVER_NS = 27, 1 << 62


class Pieces:
    """A recording of one RAW_IMU a time."""

    def __init__(self, *times_ms):
        maker = FrameMaker()
        self.pieces = [(t * MS, maker.frame(raw_imu(n))) for n, t in enumerate(times_ms)]

    def batches(self):
        return gathered(self.pieces)


class Noted:
    """A pipeline that notes what it is told, in milliseconds."""

    wanted_ids = frozenset({RAW_IMU})
    records = False

    def __init__(self, due_ms=NEVER_NS):
        self.told, self._due_ms = [], due_ms

    @property
    def next_timer_ns(self):
        """A second after the newest tick, or when it is said."""
        return self._due_ms * MS

    def link(self, t_ns, is_up):
        self.told.append(("link", t_ns / MS, is_up))

    def tick(self, t_ns):
        self.told.append(("tick", t_ns / MS))

    def play(self, played, before=None):
        times = [each[0] for each in played.frames]
        for t_ns in times:
            if before is not None:
                before(t_ns)
        if times:
            self.told.append(("play", played.first, *(t_ns / MS for t_ns in times)))

    def record_stream(self, t_ns, data):
        self.told.append(("record", t_ns / MS, len(data)))

    def imported(self, envelope, message):
        self.told.append(("imported", envelope.t_ns / MS, message))

    def named(self, name):
        return [each[1:] for each in self.told if each[0] == name]


def played(pipeline, *times_ms, before=None):
    playback = Playback(Pieces(*times_ms), whole_frames=False)
    yielded = [t_ns / MS for t_ns in playback.through(pipeline, before=before)]
    return playback, yielded


def test_the_link_comes_up_with_the_first_arrival_and_timers_run_in_gaps():
    pipeline = Noted()
    playback, yielded = played(pipeline, 1000, 1050, 1100, 1350)
    assert pipeline.told == [
        ("link", 1000, True),
        ("tick", 1000),
        ("play", 0, 1000),
        ("tick", 1050),
        ("play", 1, 1050, 1100),
        ("tick", 1200),
        ("tick", 1300),
        ("tick", 1350),
        ("play", 3, 1350),
    ]
    assert yielded == [1000, 1100, 1200, 1300, 1350]
    assert playback.span_ns == 350 * MS
    assert playback.counters.frames == 4


@pytest.mark.parametrize(
    ("gap_ms", "ticks"), [(100, []), (101, [100]), (200, [100]), (201, [100, 200])]
)
def test_a_gap_is_longer_than_a_tick(gap_ms, ticks):
    pipeline = Noted()
    played(pipeline, 0, 1, 1 + gap_ms)
    between = [t_ms for (t_ms,) in pipeline.named("tick") if 1 < t_ms < 1 + gap_ms]
    assert between == [1 + t_ms for t_ms in ticks]


def test_after_a_minute_of_silence_there_is_nothing_more_to_report():
    pipeline = Noted()
    played(pipeline, 0, 200_000)
    ticks = [t_ms for (t_ms,) in pipeline.named("tick")]
    assert ticks == [0, *range(100, 60_000, 100), 200_000]


@pytest.mark.parametrize(
    ("due_ms", "runs"),
    [
        (121, [[50, 100], [150], [200]]),
        (100, [[50], [100], [150], [200]]),
        (101, [[50, 100], [150], [200]]),
        (200, [[50, 100, 150], [200]]),
        (201, [[50, 100, 150, 200]]),
    ],
)
def test_what_is_due_by_the_clock_comes_before_the_next_arrival(due_ms, runs):
    pipeline = Noted(due_ms)
    played(pipeline, 0, 50, 100, 150, 200)
    assert [list(times) for _, *times in pipeline.named("play")] == [[0], *runs]
    assert [t_ms for (t_ms,) in pipeline.named("tick")] == [0, *(run[0] for run in runs)]


def test_several_pipelines_hear_the_same_and_the_earliest_timer_counts():
    first, second = Noted(), Noted(101)
    playback = Playback(Pieces(0, 50, 100, 150), whole_frames=False)
    assert list(playback.through(first, second)) == [0, 100 * MS, 150 * MS]
    assert first.told == second.told


def test_what_is_recorded_is_written_before_it_is_read_arrival_by_arrival():
    pipeline = Noted()
    pipeline.records = True
    played(pipeline, 0, 50, 100)
    size = len(FrameMaker().frame(raw_imu(0)))
    assert [told for told in pipeline.told if told[0] in ("record", "play")] == [
        ("record", 0, size), ("play", 0, 0),
        ("record", 50, size), ("play", 1, 50),
        ("record", 100, size), ("play", 2, 100),
    ]  # fmt: skip


def test_a_frame_in_two_pieces_arrives_with_the_second():
    pipeline, source = Noted(), Pieces(0, 50)
    (first_ns, first), (second_ns, second) = source.pieces
    source.pieces = [(first_ns, first + second[:7]), (second_ns, second[7:])]
    for _ in Playback(source, whole_frames=False).through(pipeline):
        pass
    assert [list(times) for _, *times in pipeline.named("play")] == [[0], [50]]


def test_who_listens_is_called_before_each_message_and_timer():
    pipeline, times = Noted(), []

    def before(t_ns):
        times.append(t_ns / MS)
        assert [told for told in pipeline.told if told[1] >= t_ns / MS and told[0] != "link"] == []

    pipeline_play = pipeline.play
    pipeline.play = lambda frames, before: pipeline_play(frames)
    played(pipeline, 0, 50, 350, before=before)
    assert times == [0, 50, 350]


class Imported(ImportedLog):
    """A log of an autopilot with an event a time."""

    def __init__(self, *times_ms):
        self._times_ms = times_ms

    def events(self):
        for t_ms in self._times_ms:
            yield Envelope(t_ms * MS, t_ms * MS, (1, 1), RAW_IMU), f"at {t_ms}"

    def context(self):
        raise NotImplementedError


def test_an_imported_log_is_played_event_by_event():
    pipeline, times = Noted(), []
    playback = Playback(Imported(1000, 1099, 1100, 1150, 1199, 1250), whole_frames=False)
    yielded = [t / MS for t in playback.through(pipeline, before=lambda t: times.append(t / MS))]
    assert pipeline.told[0] == ("link", 1000, True)
    assert pipeline.told[1:] == [("imported", t, f"at {t}") for t in map(int, times)]
    assert times == [1000, 1099, 1100, 1150, 1199, 1250]
    assert yielded == [1000, 1100, 1250]
    assert all(later - earlier >= 100 for earlier, later in pairwise(yielded))
    assert playback.span_ns == 250 * MS


def test_the_end_of_an_imported_log_is_told_though_it_is_not_due():
    playback = Playback(Imported(0, 20), whole_frames=False)
    assert list(playback.through(Noted())) == [0, 20 * MS]
    assert playback.span_ns == 20 * MS
    empty = Playback(Imported(), whole_frames=False)
    assert list(empty.through(Noted())) == []
    assert empty.span_ns == 0


# --- the inputs ---------------------------------------------------------------------------------


FOREIGN = SimpleNamespace(attachments={}, unix_start_ns=1_700_000_000_500_000_000, path=Path("a"))


@pytest.mark.parametrize(
    ("unix_start_ns", "recorded", "unix_s"),
    [
        (1_700_000_000_500_000_000, None, 1_700_000_000.5),
        (0, None, 1_735_689_600.0),  # 2025
        (1_700_000_000_500_000_000, RecordedInputs(Configuration(), {}, 5.0), 5.0),
        (0, RecordedInputs(Configuration(), {}, 0.0), 0.0),
    ],
)
def test_the_date_is_that_of_the_run_or_else_of_the_recording(unix_start_ns, recorded, unix_s):
    recording = SimpleNamespace(unix_start_ns=unix_start_ns)
    assert date_of(recording, recorded) == unix_s


@pytest.mark.parametrize(
    ("changes", "name", "arithmetic", "vehicle_class", "gps_velocity"),
    [
        (PlaybackOptions(), "default", "float", "auto", True),
        (PlaybackOptions(vehicle_class="rover"), "default", "float", "rover", True),
        (PlaybackOptions(gps_velocity=False), "default", "float", "auto", False),
        (PlaybackOptions(gps_velocity=True), "default", "float", "auto", True),
        (PlaybackOptions(filter_name="constant_gain"), "constant_gain", "fixed", "auto", True),
    ],
)
def test_the_user_changes_what_is_named(changes, name, arithmetic, vehicle_class, gps_velocity):
    inputs = inputs_for(FOREIGN, changes)
    found = inputs.configuration
    assert (found.filter.name, found.filter.arithmetic) == (name, arithmetic)
    assert (found.filter.vehicle_class, found.aiding.gps_velocity) == (vehicle_class, gps_velocity)
    assert (inputs.is_original, inputs.whole_frames) == (False, False)
    assert inputs.unix_s == 1_700_000_000.5


def test_an_arithmetic_that_the_filter_has_stays(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text("filter: {arithmetic: fixed}")
    found = inputs_for(FOREIGN, PlaybackOptions(config=path, filter_name="constant_gain"))
    assert found.configuration.filter.arithmetic == "fixed"
    path.write_text("filter: {gains: none.yaml}")
    with pytest.raises(BadInput, match=r"none\.yaml: no such gain file"):
        inputs_for(FOREIGN, PlaybackOptions(config=path))


@pytest.mark.parametrize("is_wanted", [True, False])
def test_the_gps_is_fused_or_not_and_nothing_else_changes(is_wanted):
    found = fusing_gps(Configuration(), is_wanted)
    assert found.aiding.gps_velocity is is_wanted
    assert fusing_gps(found, Configuration().aiding.gps_velocity) == Configuration()


def test_the_command_line_says_what_is_changed():
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    assert options(parser.parse_args([])) == PlaybackOptions()
    words = ["-c", "a.yaml", "--filter", "constant_gain", "--class", "rover"]
    found = options(parser.parse_args(words))
    assert found == PlaybackOptions(Path("a.yaml"), "constant_gain", "rover")
    assert options(parser.parse_args(["--config", "a.yaml"])).config == Path("a.yaml")


FILTER = b"filter: {name: constant_gain, arithmetic: fixed}\n"  # which needs one gain file


def of_ours(configuration=FILTER, **gains):
    """A log of h2nav."""
    files = {"configuration.yaml": configuration}
    files |= {f"gains/{name}": content for name, content in gains.items()}
    return SimpleNamespace(
        path=Path("log.mcap"),
        unix_start_ns=0,
        attachments={name: SimpleNamespace(data=data) for name, data in files.items()},
        metadata={"h2nav": {"unix_s": "5.5"}},
    )


SHIPPED = {"mpu9250_100hz": gain_files.find("mpu9250_100hz").read_bytes()}


def test_a_log_of_ours_is_played_with_its_own_configuration_gains_and_date():
    inputs = inputs_for(
        of_ours(FILTER + b"aiding: {gps_velocity: false}", **SHIPPED), PlaybackOptions()
    )
    assert inputs.configuration.aiding.gps_velocity is False
    assert (inputs.is_original, inputs.unix_s, inputs.whole_frames) == (True, 5.5, False)
    assert set(inputs.filters.gain_texts()) == set(SHIPPED)


@pytest.mark.parametrize(
    ("changes", "is_original"),
    [
        (PlaybackOptions(gps_velocity=True), True),  # as it was
        (PlaybackOptions(gps_velocity=False), False),
        (PlaybackOptions(vehicle_class="rover"), False),
    ],
)
def test_what_differs_from_the_run_is_no_longer_the_original(changes, is_original):
    inputs = inputs_for(of_ours(**SHIPPED), changes)
    assert (inputs.is_original, inputs.unix_s) == (is_original, 5.5)


def test_gains_that_a_log_lacks_are_named_before_anything_is_played():
    with pytest.raises(BadInput, match=r"the log does not hold this gain file; replay with --con"):
        inputs_for(of_ours(), PlaybackOptions())
    assert not inputs_for(of_ours(), PlaybackOptions(gps_velocity=False)).is_original


def test_the_frames_of_a_signed_link_were_admitted_whole():
    signing = FILTER + b"signing: {key_file: /k, state_file: /s}"
    for changes in PlaybackOptions(), PlaybackOptions(gps_velocity=False):
        assert inputs_for(of_ours(signing, **SHIPPED), changes).whole_frames is True


@pytest.mark.parametrize("name", ["two_stage"])
def test_a_filter_that_no_longer_exists_is_remarked_unless_the_user_names_one(
    tmp_path, capsys, name
):
    log = of_ours(b"filter: {name: %s}" % name.encode(), **SHIPPED)
    assert not inputs_for(log, PlaybackOptions()).is_original
    said = capsys.readouterr().err
    assert said.startswith(f"log.mcap: recorded with the filter {name}, which no longer exists")
    config = tmp_path / "config.yaml"
    config.write_text("aiding: {gps_velocity: false}")
    own = inputs_for(log, PlaybackOptions(config=config))
    assert (own.is_original, own.configuration.aiding.gps_velocity) == (False, False)
    assert capsys.readouterr().err == ""


def test_a_configuration_that_cannot_be_used_counts_unless_the_user_gives_one(tmp_path):
    log = of_ours(b"link: [")
    with pytest.raises(BadInput, match=r"log\.mcap: configuration\.yaml: not YAML"):
        inputs_for(log, PlaybackOptions())
    config = tmp_path / "config.yaml"
    config.write_text("")
    assert inputs_for(log, PlaybackOptions(config=config)).configuration == Configuration()


def test_an_imported_log_has_no_inputs_of_ours():
    log = Imported()
    log.unix_start_ns = 3 * S
    assert inputs_for(log, PlaybackOptions()).unix_s == 3.0

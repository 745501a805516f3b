"""What the pipeline hands to the service, and where it carries the effects, one event at a time."""

import types

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from wire_frames import FrameMaker, raw_imu

from h2nav.apps.link_signing import Sorted
from h2nav.apps.pipeline import Junk, Outlets, Pipeline, PlayedFrames, deliver
from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Trust
from h2nav.integrity.findings import Finding, Kind, Phase, Sensor, SensorKind, Severity
from h2nav.links.link_statistics import LinkStatistics
from h2nav.maths.units import SECOND_NS
from h2nav.service.effects import Found, Notice, Record, Send, Used
from h2nav.wire.deframer import Deframer
from h2nav.wire.readers import Envelope

RAW_IMU = mavlink.MAVLINK_MSG_ID_RAW_IMU
HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
MOVED_NS = 5 * SECOND_NS  # UNIX time minus the clock
T_NS = 100 * SECOND_NS
SAMPLE = ImuSample(1_000, (0.1, 0.2, 0.3), (0.0, 0.0, -9.8))
LEVEL = (1.0, 0.0, 0.0, 0.0)
ZERO = (0.0, 0.0, 0.0)
ESTIMATE = AttitudeEstimate(2_000, LEVEL, ZERO, ZERO, ZERO, 0.01, next(iter(Trust)))


class FakeService:
    """Notes every call; answers with what a test gives it."""

    system_id = 1
    message_ids = frozenset({RAW_IMU, HEARTBEAT})

    def __init__(self):
        self.calls = []
        self.effects = []  # of the next event
        self.error = None  # of every event but a fault
        self.reads = True
        self.offset_ns = None
        self.speaks = lambda envelope, message: False
        self.time_sync = types.SimpleNamespace(offset_ns=lambda t_ns: self.offset_ns)

    def _event(self, name, *args):
        self.calls.append((name, *args))
        if self.error is not None:
            raise self.error
        effects, self.effects = self.effects, []
        return effects

    def on_arrival(self, t_ns, sender, message_id):
        self.calls.append(("arrival", t_ns, sender, message_id))
        return self.reads

    def on_message(self, envelope, message):
        return self._event("message", envelope, type(message).__name__)

    def on_imu(self, envelope, reading):
        return self._event("imu", envelope, reading)

    def on_refusal(self, envelope, reason):
        return self._event("refusal", envelope, reason)

    def on_bytes(self, t_ns, are_present):
        return self._event("bytes", t_ns, are_present)

    def on_timer(self, t_ns):
        return self._event("timer", t_ns)

    def on_link(self, t_ns, is_up, error):
        return self._event("link", t_ns, is_up, error)

    def on_stall(self, t_ns, length_ns):
        return self._event("stall", t_ns, length_ns)

    def on_note(self, t_ns, said):
        self.calls.append(("note", t_ns, said))
        return [said]

    def on_fault(self, t_ns, where, text):
        self.calls.append(("fault", t_ns, where, text))
        return []

    def next_timer_ns(self, t_ns):
        return t_ns + SECOND_NS

    def speaks_for_vehicle(self, envelope, message):
        return self.speaks(envelope, message)

    def named(self, name):
        return [call[1:] for call in self.calls if call[0] == name]


class Outlet:
    """A watcher, an observer, a log or a live view: notes every call."""

    def __init__(self, *message_ids):
        self.message_ids = frozenset(message_ids)
        self.calls = []
        self.to_tell = []

    def notices(self):
        told, self.to_tell = self.to_tell, []
        return told

    def statistics(self):
        return ("statistics",)

    def __getattr__(self, name):
        return lambda *args: self.calls.append((name, *args))

    def named(self, name):
        return [call[1:] for call in self.calls if call[0] == name]


class Bench:
    """A pipeline between all of them; `without` some."""

    def __init__(self, *without, watched=()):
        self.service, self.watcher = FakeService(), Outlet(*watched)
        self.sent, self.found = [], []
        self.recorder, self.observer, self.live = Outlet(), Outlet(), Outlet()
        kept = {
            "send": self.sent.append,
            "recorder": self.recorder,
            "observer": self.observer,
            "live": self.live,
            "finding": lambda *args: self.found.append(args),
        }
        kept |= dict.fromkeys(without)
        outlets = Outlets(lambda t_ns: t_ns + MOVED_NS, watcher=self.watcher, **kept)
        self.pipeline = Pipeline(self.service, 191, outlets)

    def carried_out(self, *effects):
        """By an event that has these effects."""
        self.service.effects = list(effects)
        self.pipeline.stalled(T_NS, 1)
        return self


def frames(*messages):
    maker = FrameMaker()
    return b"".join(maker.frame(message) for message in messages)


# --- bytes without frames ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sizes", "last_ns", "is_junk"),
    [
        ((1024, 1), 3 * SECOND_NS + 1, True),
        ((1024, 1), 3 * SECOND_NS, False),
        ((1023, 1), 3 * SECOND_NS + 1, False),
    ],
)
def test_junk_is_more_and_longer_than_a_boot_text(sizes, last_ns, is_junk):
    junk = Junk()
    assert not junk.changes(T_NS, sizes[0], has_frames=False)
    assert junk.changes(T_NS + last_ns, sizes[1], has_frames=False) is is_junk
    assert junk.is_raised is is_junk


def test_junk_is_told_once_and_ends_with_a_frame():
    junk = Junk()
    junk.changes(0, 2000, has_frames=False)
    assert junk.changes(4 * SECOND_NS, 2000, has_frames=False)
    assert not junk.changes(8 * SECOND_NS, 2000, has_frames=False)
    assert junk.changes(9 * SECOND_NS, 2000, has_frames=True)
    assert not junk.is_raised
    assert not junk.changes(10 * SECOND_NS, 2000, has_frames=True)
    assert not junk.changes(11 * SECOND_NS, 2000, has_frames=False)
    assert not junk.changes(14 * SECOND_NS, 2000, has_frames=False)  # counted anew
    assert junk.changes(14 * SECOND_NS + 1, 1, has_frames=False)


def test_the_service_is_told_when_junk_begins_and_ends():
    bench = Bench()
    bench.pipeline.received(0, b"x" * 2000)
    bench.pipeline.received(4 * SECOND_NS, b"x" * 10)
    bench.pipeline.received(5 * SECOND_NS, frames(raw_imu(1)))
    assert bench.service.named("bytes") == [(4 * SECOND_NS, True), (5 * SECOND_NS, False)]


# --- from bytes to the service ----------------------------------------------------------------


def test_a_frame_is_read_and_handed_on_with_both_times():
    bench = Bench()
    bench.pipeline.received(T_NS, frames(raw_imu(1)), T_NS + 5)
    bench.pipeline.received(T_NS + 9, frames(raw_imu(2)))
    found = bench.service.named("message")
    assert found == [
        (Envelope(T_NS, T_NS + 5, (1, 1), RAW_IMU), "ImuReading"),
        (Envelope(T_NS + 9, T_NS + 9, (1, 1), RAW_IMU), "ImuReading"),
    ]
    assert bench.service.named("arrival")[0] == (T_NS, (1, 1), RAW_IMU)


def test_a_frame_that_the_service_does_not_read_costs_no_more():
    bench = Bench()
    bench.service.reads = False
    bench.pipeline.received(T_NS, frames(raw_imu(1)))
    assert bench.service.named("message") == []
    assert len(bench.service.named("arrival")) == 1


@pytest.mark.parametrize(
    ("watched", "seen"), [((RAW_IMU,), [RAW_IMU]), ((77,), []), ((30,), [30]), ((), [])]
)
def test_only_what_is_watched_is_shown_and_only_what_is_used_is_read(watched, seen):
    bench = Bench(watched=watched)
    attitude = mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0)
    bench.pipeline.received(T_NS, frames(raw_imu(1), attitude))
    assert [frame.msg_id for _, frame in bench.watcher.named("frame")] == seen
    assert len(bench.service.named("arrival")) == 1
    assert bench.pipeline.wanted_ids == {RAW_IMU, HEARTBEAT, *watched}


def test_what_cannot_be_true_is_refused_with_its_reason():
    bench = Bench()
    bench.service.message_ids = frozenset({mavlink.MAVLINK_MSG_ID_HIGHRES_IMU})
    bench = _with_service(bench.service)
    nan = float("nan")
    message = mavlink.MAVLink_highres_imu_message(
        1, nan, 0.2, -9.8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFFFF
    )
    bench.pipeline.received(T_NS, frames(message))
    ((envelope, reason),) = bench.service.named("refusal")
    assert envelope.message_id == mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
    assert reason
    assert bench.service.named("message") == []


def _with_service(service):
    bench = Bench()
    bench.service = service
    outlets = Outlets(lambda t_ns: t_ns, None, None, bench.watcher)
    bench.pipeline = Pipeline(service, 191, outlets)
    return bench


def test_a_bug_costs_one_message_and_is_told_with_its_place():
    bench = Bench()
    bench.service.error = ValueError("of a test")
    bench.pipeline.received(T_NS, frames(raw_imu(1), raw_imu(2)))
    faults = bench.service.named("fault")
    assert [fault[:2] for fault in faults] == [(T_NS, "RAW_IMU")] * 2
    assert faults[0][2].startswith("ValueError: of a test at test_pipeline.py:")


def test_a_bug_of_the_watcher_costs_the_service_no_message():
    bench = Bench(watched=(RAW_IMU,))

    def fails(_t_ns, _frame):
        raise ValueError("of a test")

    bench.watcher.frame = fails
    bench.pipeline.received(T_NS, frames(raw_imu(1)))
    assert [fault[1] for fault in bench.service.named("fault")] == ["RAW_IMU"]
    assert len(bench.service.named("message")) == 1


@pytest.mark.parametrize(
    ("event", "where"),
    [
        (lambda pipeline: pipeline.tick(T_NS), "timer"),
        (lambda pipeline: pipeline.link(T_NS, True), "link"),
        (lambda pipeline: pipeline.stalled(T_NS, 7), "stall"),
        (lambda pipeline: pipeline.tend(T_NS, "keeper", lambda *_: 1 // 0), "keeper"),
        (
            lambda pipeline: pipeline.imported(
                Envelope(1, 1, (1, 1), HEARTBEAT), types.SimpleNamespace()
            ),
            "HEARTBEAT",
        ),
    ],
)
def test_a_bug_is_told_by_where_it_was(event, where):
    bench = Bench()
    bench.service.error = ZeroDivisionError()
    event(bench.pipeline)
    assert where in [fault[1] for fault in bench.service.named("fault")]


# --- the clock and the link -------------------------------------------------------------------


def test_the_timer_runs_when_it_is_due_and_the_live_view_is_fed_always():
    bench = Bench()
    for t_ns in (T_NS, T_NS + SECOND_NS - 1, T_NS + SECOND_NS):
        bench.pipeline.tick(t_ns)
    assert bench.service.named("timer") == [(T_NS,), (T_NS + SECOND_NS,)]
    assert bench.pipeline.next_timer_ns == T_NS + 2 * SECOND_NS
    assert len(bench.live.named("flush")) == 3
    Bench("live").pipeline.tick(T_NS)


def test_only_a_changed_link_is_told():
    bench = Bench()
    states = [(False, ""), (False, ""), (False, "refused"), (True, "refused"), (True, "refused")]
    for number, (is_up, error) in enumerate(states):
        bench.pipeline.link(number, is_up, error)
    assert bench.service.named("link") == [
        (0, False, ""),
        (2, False, "refused"),
        (3, True, "refused"),
    ]


def test_a_stall_is_passed_on():
    bench = Bench()
    bench.pipeline.stalled(T_NS, 7)
    assert bench.service.named("stall") == [(T_NS, 7)]


def test_what_runs_beside_the_service_sends_and_tells():
    bench, seen = Bench(), []
    notice = Notice(Severity.INFO, "kept")

    def work(t_ns, unix_ns, service):
        seen.append((t_ns, unix_ns, service))
        return [Send(raw_imu(1), 1), notice]

    bench.pipeline.tend(T_NS, "keeper", work)
    assert seen == [(T_NS, T_NS + MOVED_NS, bench.service)]
    assert len(bench.sent) == 1
    assert bench.service.named("note") == [(T_NS, notice)]


@pytest.mark.parametrize(
    ("without", "topics"),
    [
        ((), ["/link", "/deframer", "/recorder"]),
        (("recorder",), ["/link", "/deframer"]),
    ],
)
def test_counters_are_logged_and_trouble_with_the_log_is_told(without, topics):
    bench = Bench(*without)
    bench.recorder.to_tell = [(Severity.WARNING, "the disk is full", "disk")]
    bench.pipeline.report(T_NS, LinkStatistics())
    assert [call[0] for call in bench.live.named("record")] == topics
    notes = bench.service.named("note")
    assert notes == (
        [] if without else [(T_NS, Notice(Severity.WARNING, "the disk is full", "disk"))]
    )
    assert bench.pipeline.records is not bool(without)


# --- a recording ------------------------------------------------------------------------------


def played(bench, data, reading=lambda number, message_id: None, before=None):
    scan = Deframer().feed(data)
    places, at = [], 0
    for frame in scan:
        start = data.index(frame.raw, at)
        at = start + len(frame.raw)
        places.append((T_NS, frame.msg_id, (frame.sysid, frame.compid), start, start + 10, at - 2))
    bench.pipeline.play(PlayedFrames(data, places, 40, reading), before)
    return bench


def test_a_recording_gives_what_its_bytes_give():
    data = frames(raw_imu(1), mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0), raw_imu(2))
    heard, seen = Bench(watched=(30,)), Bench(watched=(30,))
    heard.pipeline.received(T_NS, data)
    played(seen, data)
    assert seen.service.calls == heard.service.calls
    assert seen.watcher.named("frame") == heard.watcher.named("frame")
    assert len(seen.watcher.named("frame")) == 1


def test_readings_that_are_known_are_not_read_again():
    asked, times = [], []

    def reading(number, message_id):
        asked.append((number, message_id))
        return "known" if number == 41 else None

    bench = Bench()
    heartbeat = mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3)
    played(bench, frames(raw_imu(1), raw_imu(2), heartbeat), reading, times.append)
    assert asked == [(40, RAW_IMU), (41, RAW_IMU)]
    envelope = Envelope(T_NS, T_NS, (1, 1), RAW_IMU)
    assert bench.service.named("imu") == [(envelope, "known")]
    assert [kind for _, kind in bench.service.named("message")] == ["ImuReading", "Heartbeat"]
    assert times == [T_NS] * 3


def test_a_recording_survives_a_bug_and_skips_what_is_not_read():
    bench, times = Bench(), []
    bench.service.error = ValueError("of a test")
    played(bench, frames(raw_imu(1), raw_imu(2)))
    assert [fault[1] for fault in bench.service.named("fault")] == ["RAW_IMU"] * 2
    bench.service.reads = False
    played(bench, frames(raw_imu(3)), before=times.append)
    assert times == []


def test_an_imported_event_follows_what_is_due_by_the_clock():
    bench, message = Bench(), types.SimpleNamespace()
    bench.pipeline.tick(T_NS)
    bench.service.calls.clear()
    for t_ns in (T_NS + SECOND_NS - 1, T_NS + SECOND_NS):
        bench.pipeline.imported(Envelope(t_ns, t_ns, (1, 1), HEARTBEAT), message)
    names = [call[0] for call in bench.service.calls]
    assert names == ["arrival", "message", "timer", "arrival", "message"]
    assert bench.observer.named("message") == [
        (T_NS + SECOND_NS - 1, message),
        (T_NS + SECOND_NS, message),
    ]
    bench.service.reads = False
    bench.pipeline.imported(Envelope(T_NS, T_NS, (1, 1), HEARTBEAT), message)
    assert len(bench.service.named("message")) == 2


# --- who may speak ----------------------------------------------------------------------------


@pytest.mark.parametrize(("sysid", "speaks"), [(1, True), (2, False)])
def test_a_datagram_of_an_unknown_sender_needs_a_frame_of_the_vehicle(sysid, speaks):
    bench, asked = Bench(), []

    def service(envelope, message):
        asked.append((envelope.t_ns, envelope.message_id, message is not None))
        return envelope.sender[0] == 1

    bench.service.speaks = service
    bench.pipeline.tick(T_NS)
    heartbeat = mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3)
    data = FrameMaker(9).frame(raw_imu(1)) + FrameMaker(sysid).frame(heartbeat)
    assert bench.pipeline.comes_from_vehicle(data) is speaks
    assert asked == [(T_NS, RAW_IMU, False), (T_NS, HEARTBEAT, True)]
    assert not bench.pipeline.comes_from_vehicle(b"no frame at all")


# --- effects ----------------------------------------------------------------------------------


def test_bytes_of_the_link_are_logged_as_they_came():
    bench, data = Bench(), frames(raw_imu(1))
    bench.pipeline.received(T_NS, data[:10])
    bench.pipeline.received(T_NS + 1, data[10:])
    bench.pipeline.received(T_NS + 2, b"")
    logged = bench.recorder.named("raw")
    assert b"".join(one[2] for one in logged) == data
    assert [one[:2] for one in logged] == [
        ("autopilot", T_NS + MOVED_NS),
        ("autopilot", T_NS + MOVED_NS + 1),
    ]


@pytest.mark.parametrize("estimate", [ESTIMATE, None])
def test_a_sample_and_its_estimate_are_shown_and_logged(estimate):
    bench = Bench().carried_out(Used(SAMPLE, estimate, 3))
    shown = [] if estimate is None else [(T_NS, ESTIMATE, 3)]
    assert bench.watcher.named("estimate") == shown
    topics = ["/imu"] if estimate is None else ["/imu", "/estimate"]
    for writer in (bench.recorder, bench.live):
        assert [(call[0], call[1].t_us) for call in writer.named("record")] == list(
            zip(topics, (1_000, 2_000), strict=False)
        )
    turned = [] if estimate is None else [(T_NS + MOVED_NS, LEVEL)]
    assert bench.recorder.named("transform") == turned
    assert bench.live.named("transform") == []


@pytest.mark.parametrize("without", [("recorder",), ("live",), ("recorder", "live")])
def test_estimates_are_shown_where_nothing_is_logged(without):
    bench = Bench(*without).carried_out(Used(SAMPLE, ESTIMATE), Notice(Severity.ERROR, "said"))
    assert len(bench.watcher.named("estimate")) == 1
    assert bench.watcher.named("notice") == [(T_NS, Severity.ERROR, "said")]
    for name in ("recorder", "live"):
        writer = getattr(bench, name)
        assert len(writer.named("text")) == (name not in without)
        assert len(writer.named("record")) == (0 if name in without else 2)


@pytest.mark.parametrize(
    ("t_us", "offset_ns", "published_ns"),
    [
        (None, None, None),
        (2_000_000, None, None),
        (None, 7, None),
        # the autopilot's clock is ahead of ours by the offset
        (2_000_000, 7, 2 * SECOND_NS - 7 + MOVED_NS),
        (0, 7, MOVED_NS - 7),
    ],
)
def test_a_record_has_the_autopilots_time_once_the_clocks_are_related(
    t_us, offset_ns, published_ns
):
    bench = Bench()
    bench.service.offset_ns = offset_ns
    bench.carried_out(Record("/topic", (1, 2), t_us))
    logged = ("/topic", (1, 2), T_NS + MOVED_NS, published_ns)
    assert bench.recorder.named("record") == bench.live.named("record") == [logged]
    assert bench.observer.named("record") == [(T_NS, "/topic", (1, 2))]
    Bench("observer").carried_out(Record("/topic", (1, 2)))


def test_a_finding_is_logged_and_reported():
    finding = Finding(
        next(iter(Kind)),
        Sensor(SensorKind.IMU, 0),
        Severity.ERROR,
        1.0,
        2.0,
        3.0,
        "m",
        "t",
        "e",
        "4",
    )
    bench = Bench().carried_out(Found(Phase.BEGIN, finding))
    assert bench.found == [(T_NS, Phase.BEGIN, finding)]
    (logged,) = bench.recorder.named("record")
    assert (logged[0], logged[1].id) == ("/finding", "4")
    assert Bench("finding").carried_out(Found(Phase.BEGIN, finding)).found == []


def test_a_message_is_sent_as_the_vehicle_it_is_bound_to():
    bench = Bench().carried_out(Send(raw_imu(1), 1), Send(raw_imu(1), 7), Send(raw_imu(1), 7))
    (first, second, third) = Deframer().feed(b"".join(bench.sent))
    assert [(one.sysid, one.compid) for one in (first, second, third)] == [
        (1, 191),
        (7, 191),
        (7, 191),
    ]
    assert bench.recorder.named("sent") == [
        ("autopilot", T_NS + MOVED_NS, frame) for frame in bench.sent
    ]
    # a number each: the receiver counts what is lost
    assert [one[4] for one in bench.sent] == [0, 0, 1]


def test_a_replay_sends_nothing():
    bench = Bench("send").carried_out(Send(raw_imu(1), 1))
    assert bench.recorder.named("sent") == []


# --- a signed link ----------------------------------------------------------------------------


class FakeSigning:
    """Admits the frames of system 1; turns the others away with a notice."""

    signer = None

    def sort(self, t_ns, arrived):
        admitted = [frame for frame in arrived if frame.sysid == 1]
        refused = [frame for frame in arrived if frame.sysid != 1]
        received, kept = (b"".join(each.raw for each in some) for some in (admitted, refused))
        notices = [Notice(Severity.WARNING, "refused")] * len(refused)
        return Sorted(admitted, received, kept, notices)

    def notices(self):
        return [Notice(Severity.ERROR, "the stamp is not stored")]

    def record(self):
        return ("counters",)

    def would_answer(self, frame):
        return frame.sysid == 1

    def turned_away(self, t_ns, frame):
        return [Notice(Severity.WARNING, f"turned away {frame.sysid}")]


def signed(*without):
    bench = Bench(*without)
    outlets = Outlets(lambda t_ns: t_ns + MOVED_NS, None, bench.recorder, bench.watcher)
    bench.pipeline = Pipeline(bench.service, 191, outlets, FakeSigning())
    return bench


def test_of_a_signed_link_only_admitted_frames_are_read_and_the_others_kept_apart():
    bench, ours, theirs = signed(), frames(raw_imu(1)), FrameMaker(2).frame(raw_imu(2))
    bench.pipeline.received(T_NS, b"junk" + theirs + ours, T_NS + 5)
    assert bench.recorder.named("raw") == [("autopilot", T_NS + MOVED_NS, ours)]
    assert bench.recorder.named("refused") == [("autopilot", T_NS + MOVED_NS, theirs)]
    ((envelope, _),) = bench.service.named("message")
    assert envelope == Envelope(T_NS, T_NS + 5, (1, 1), RAW_IMU)
    assert bench.watcher.named("notice") == [(T_NS, Severity.WARNING, "refused")]
    bench.pipeline.received(T_NS, ours)
    assert len(bench.recorder.named("refused")) == 1
    signed("recorder").pipeline.received(T_NS, theirs + ours)


def test_the_counters_and_troubles_of_signing_are_reported():
    bench = signed()
    bench.pipeline.report(T_NS, LinkStatistics())
    topics = [call[0] for call in bench.recorder.named("record")]
    assert topics == ["/signing", "/link", "/deframer", "/recorder"]
    assert bench.recorder.named("record")[0][1] == ("counters",)
    assert bench.watcher.named("notice") == [(T_NS, Severity.ERROR, "the stamp is not stored")]


def test_a_stranger_on_a_signed_link_is_turned_away_and_told_of():
    bench = signed()
    bench.service.speaks = lambda envelope, message: True
    bench.pipeline.tick(T_NS)
    assert not bench.pipeline.comes_from_vehicle(FrameMaker(2).frame(raw_imu(1)))
    assert bench.watcher.named("notice") == [(T_NS, Severity.WARNING, "turned away 2")]
    data = FrameMaker(2).frame(raw_imu(1)) + frames(raw_imu(2))
    assert bench.pipeline.comes_from_vehicle(data)


def test_what_a_recording_makes_the_service_do_is_carried_out():
    bench = Bench()
    bench.service.effects = [Notice(Severity.INFO, "heard")]
    played(bench, frames(raw_imu(1)))
    assert bench.watcher.named("notice") == [(T_NS, Severity.INFO, "heard")]


def test_a_message_that_is_not_read_has_no_effects():
    bench = Bench()
    bench.service.reads = False
    (frame,) = Deframer().feed(frames(raw_imu(1)))
    assert deliver(bench.service, frame, T_NS, T_NS) == []

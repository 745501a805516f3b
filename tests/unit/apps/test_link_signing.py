"""The daemon's pipeline on a signed link: what gets in, what is told, recorded and replayed."""

import json
import random
from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from signing_peer import KEY, Clock, Peer, frame_of
from wire_frames import raw_imu

from h2nav.apps import configuration
from h2nav.apps.autopilot_bytes import AutopilotBytes, AutopilotSigning
from h2nav.apps.filters import FilterFactory
from h2nav.apps.link_signing import RECORDED_PER_WINDOW, LinkSigning
from h2nav.apps.log_contents import attach_inputs
from h2nav.apps.pipeline import Outlets, Pipeline
from h2nav.cli import main
from h2nav.files.earth_field import earth_field_at
from h2nav.files.signing_keys import write_signing_key
from h2nav.integrity.findings import Severity
from h2nav.links.link_statistics import LinkStatistics
from h2nav.log.recorder import RECEIVED_TOPIC, REFUSED_TOPIC, SENT_TOPIC, Recorder
from h2nav.maths.units import SECOND_NS
from h2nav.recordings.recording import open_recording
from h2nav.service.service import Service, Surroundings
from h2nav.sim.autopilot import AutopilotOptions, FakeAutopilot
from h2nav.sim.personalities import ARDUPILOT
from h2nav.sim.scenarios import scenario
from h2nav.wire.deframer import Deframer
from h2nav.wire.signing import LocalStamp, SignatureChecker, Signer

START_NS = 1_000_000_000_000
STEP_NS = 2_000_000
UNIX_S = 1_795_000_000.0
SECRET = bytes(range(100, 132))
SETUP = mavlink.MAVLink_setup_signing_message(1, 191, list(SECRET), 1)


class FlightClock(Clock):
    """UNIX time that goes with the simulated monotonic time."""

    t_ns = START_NS

    def __call__(self) -> int:
        return super().__call__() + self.t_ns - START_NS


class SignedFlight:
    """A signed autopilot and a signed daemon on one manual clock, and somebody between them.

    Args:
        folder: for key, state and log.
        attack: what arrives instead of a piece of the autopilot's bytes, as several pieces.
    """

    message_ids: frozenset[int] = frozenset()

    def __init__(self, folder, attack: Callable[[bytes], list[bytes]] = lambda data: [data]):
        if not (folder / "key").exists():
            write_signing_key(folder / "key", KEY)
        signing = {"key_file": str(folder / "key"), "state_file": str(folder / "stamp")}
        chosen = configuration.build({"signing": signing}, "test")
        filters = FilterFactory.shipped(chosen.filter, chosen.autopilot.imu_rate_hz)
        self.log = folder / "flight.mcap"
        self.estimates, self.notices = [], []
        self._clock = FlightClock()
        self._recorder = Recorder.to_file(self.log, 0)
        attach_inputs(self._recorder, chosen, filters, UNIX_S)
        surroundings = Surroundings(filters.filter_for, earth_field_at, UNIX_S)
        self.signing = LinkSigning(chosen.signing, self._clock)
        outlets = Outlets(lambda t_ns: t_ns, self._to_autopilot, self._recorder, self)
        self.pipeline = Pipeline(
            Service(chosen.service, surroundings), 191, outlets, signing=self.signing
        )
        stamp = LocalStamp(self._clock)
        ends = AutopilotSigning(Signer(KEY, 0, stamp), SignatureChecker(KEY, stamp))
        vehicle = FakeAutopilot(AutopilotOptions(scenario("aggressive"), ARDUPILOT, seed=5))
        self.vehicle = AutopilotBytes(vehicle, START_NS, signing=ends)
        self._attack = attack

    def run(self, seconds: float) -> "SignedFlight":
        self.pipeline.link(START_NS, True)
        for number in range(round(seconds * 1e9) // STEP_NS):
            t_ns = self._clock.t_ns = START_NS + number * STEP_NS
            for data in self.vehicle.advance(t_ns):
                for piece in self._attack(data):
                    self.pipeline.received(t_ns, piece)
            self.pipeline.tick(t_ns)
            if number % (SECOND_NS // STEP_NS) == 0:
                self.pipeline.report(t_ns, LinkStatistics())
        self.counts = self.signing.record()
        self.signing.close()
        self._recorder.close()
        return self

    def topics(self) -> dict[str, list[bytes]]:
        """Bytes of the link in the log."""
        names = {RECEIVED_TOPIC: "received", REFUSED_TOPIC: "refused", SENT_TOPIC: "sent"}
        found: dict[str, list[bytes]] = {}
        for topic, stored in open_recording(self.log)._messages("mavlink"):
            name = names[topic.removesuffix("autopilot")]
            found.setdefault(name, []).append(stored.data)
        return found

    def frame(self, t_ns, frame) -> None:
        raise AssertionError("none was asked for")

    def estimate(self, t_ns, estimate, late_ns) -> None:
        self.estimates.append(estimate)

    def notice(self, t_ns, severity, text) -> None:
        self.notices.append((severity, text))

    def _to_autopilot(self, frame: bytes) -> None:
        self.vehicle.received(self._clock.t_ns, frame)


class Attacker:
    """Has the wire, but not the key: forges, replays, downgrades, reflects and makes noise."""

    def __init__(self, seed: int) -> None:
        self._rng = random.Random(seed)
        self._forger = Peer(key=b"x" * 32, link_id=0, stamp=2**48 - 10**6)
        self._heard: list[bytes] = []

    def __call__(self, data: bytes) -> list[bytes]:
        self._heard = [*self._heard[-50:], data]
        forged = mavlink.MAVLink_raw_imu_message(
            self._rng.getrandbits(40), *(self._rng.randrange(-2000, 2000) for _ in range(9))
        )
        pieces = [
            self._forger.raw(forged, signed=False),
            self._forger.raw(forged, version=1),
            self._forger.raw(forged),
            self._rng.choice(self._heard),
            self._forger.raw(SETUP, signed=False),
            self._rng.randbytes(self._rng.randrange(20)).replace(b"\xfd", b"\xfc"),
        ]
        before, behind = self._rng.choices(pieces, k=2)
        stream, cut = before + data + behind, self._rng.randrange(20)
        return [stream[:cut], stream[cut:]]


@pytest.fixture(scope="module")
def attacked(tmp_path_factory):
    return SignedFlight(tmp_path_factory.mktemp("attacked"), Attacker(1)).run(8.0)


@pytest.mark.thorough
def test_an_attack_without_the_key_changes_no_estimate(tmp_path, attacked):
    alone = SignedFlight(tmp_path).run(8.0)
    assert len(alone.estimates) > 500
    assert attacked.estimates == alone.estimates
    assert alone.vehicle.counts()["frames_refused"] == 0
    counts = attacked.counts
    assert min(counts.unsigned, counts.mavlink_1, counts.bad_signature, counts.replayed) > 50
    assert counts.signed == alone.counts.signed
    assert counts.streams == 1


def test_an_attacked_flight_replays_to_the_very_same_estimates(attacked, capsys):
    assert main(["replay", str(attacked.log), "--no-log", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["estimates_compared"] == len(attacked.estimates)
    assert result["estimates_equal"] == result["estimates_compared"]


def test_a_log_holds_the_refused_frames_apart_and_no_key_at_all(attacked):
    topics = attacked.topics()
    received, refused = b"".join(topics["received"]), b"".join(topics["refused"])
    assert len(Deframer().feed(received)) == attacked.counts.signed
    assert Deframer().feed(refused)
    assert attacked.counts.setup_signing > 50
    assert SECRET not in attacked.log.read_bytes()
    assert SECRET not in refused
    assert KEY not in refused


def test_a_log_holds_no_signature_to_try_passphrases_on(attacked):
    """As the specification asks for."""
    topics = attacked.topics()
    assert topics.keys() == {"received", "refused", "sent"}
    for pieces in topics.values():
        frames = Deframer().feed(b"".join(pieces))
        assert frames
        assert not any(frame.signed for frame in frames)


def test_each_cause_is_told_once_a_minute_with_its_count(attacked):
    told = [text for severity, text in attacked.notices if severity is Severity.WARNING]
    refusals = [text for text in told if " refused: " in text]
    assert len(refusals) == len(set(refusals)) == 5
    assert sum("RAW_IMU of 1/1 refused" in text for text in refusals) >= 3


def test_the_counters_are_in_the_log_each_second(attacked):
    records = [fields for _, fields in open_recording(attacked.log).records("/signing")]
    assert len(records) == 8
    assert records[-1]["bad_signature"] > records[0]["bad_signature"]
    assert records[-1]["streams"] == 1


@pytest.fixture
def signing(tmp_path):
    write_signing_key(tmp_path / "key", KEY)
    settings = configuration.SigningSettings(str(tmp_path / "key"), 0, str(tmp_path / "stamp"))
    opened = LinkSigning(settings, Clock())
    yield opened
    opened.close()


def test_a_cause_is_told_again_after_a_minute_and_says_how_often(signing):
    frame = Peer().frame(signed=False)
    told = [
        notice.text
        for t_s in range(130)
        for notice in signing.sort(t_s * SECOND_NS, [frame]).notices
    ]
    assert len(told) == 3
    assert "RAW_IMU of 1/1 refused: it is not signed" in told[0]
    assert "(61 of this kind so far)" in told[1]


def test_a_flood_of_refused_frames_does_not_fill_the_log(signing):
    frame = Peer().frame(signed=False)
    outcome = signing.sort(START_NS, [frame] * 1000)
    assert outcome.refused == frame.raw * RECORDED_PER_WINDOW
    assert signing.record().unsigned == 1000
    assert signing.sort(START_NS + SECOND_NS, [frame]).refused == frame.raw


def test_asking_counts_nothing(signing):
    frame = Peer().frame()
    assert signing.would_admit(frame)
    assert signing.would_admit(frame)
    assert not signing.would_admit(frame_of(Peer().raw(raw_imu(1), signed=False)))
    assert sum(signing.record()[:10]) == 0


def test_a_stranger_without_the_key_is_turned_away_and_told_of(signing):
    for frame in (Peer().frame(signed=False), Peer(key=b"x" * 32).frame()):
        assert not signing.would_answer(frame)
        (notice,) = signing.turned_away(START_NS, frame)
        assert "RAW_IMU of 1/1 refused" in notice.text
        assert signing.turned_away(START_NS, frame) == []
    assert (signing.record().unsigned, signing.record().bad_signature) == (2, 2)


def test_a_radio_is_heard_without_a_key_by_default(signing):
    status = mavlink.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7)
    assert signing.sort(START_NS, [Peer().frame(status, version=1)]).admitted
    assert signing.record().accepted_unsigned == 1

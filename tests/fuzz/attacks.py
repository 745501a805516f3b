"""A seeded attacker between an honest autopilot and the pipeline, who can do what a link allows.

He changes, forges, repeats, delays and drops frames, always with a right checksum; stops and moves
clocks; takes the link down. He changes his mood every few hundred frames, so that what needs a
lasting cause is met as well as what needs a mixture. When he is gone the honest autopilot goes on.

Everything that he feeds is kept as events, which feed the same to another pipeline.
"""

import json
import random
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fuzz.clean_sessions import Player, restamped
from fuzz.raw_frames import RawFrame, extreme, place, random_payload, with_extremes
from fuzz.watched_pipeline import START_NS, InvariantBrokenError, WatchedPipeline
from h2nav.maths.units import SECOND_NS
from h2nav.wire.dialect import LAYOUTS

MS_NS = 1_000_000
HISTORY = 200
AUTOPILOT = (1, 1)
US = (1, 191)
RECOVERY_S = 40.0
FRAMES_BETWEEN_CHECKS = 500
ASKED = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
        mavlink.MAVLINK_MSG_ID_COMMAND_INT,
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
        mavlink.MAVLINK_MSG_ID_PARAM_SET,
    }
)
OUR_COMMANDS = (511, 510, 512, 519, 520, 521, 0, 400, 246)
OUR_OUTPUTS = (30.0, 31.0, 331.0, 148.0, 0.0)
OUR_PARAMETERS = (b"H2_ATT_HZ", b"H2_STAT_HZ", b"H2_DIF_HZ", b"H2_ODO_HZ", b"", b"\xff" * 16)


class Event(NamedTuple):
    """Something that was fed.

    Attributes:
        t_ns: after the start.
        kind: ``rx``, ``tick``, ``up`` or ``down``.
        data: the bytes of ``rx``.
    """

    t_ns: int
    kind: str
    data: bytes = b""


class Session:
    """One pipeline with its honest autopilot, and what was fed so far.

    Args:
        pipeline: fresh.
        estimator: whose recording is played.
    """

    def __init__(self, pipeline: WatchedPipeline, estimator: str) -> None:
        self.pipeline = pipeline
        self.events: list[Event] = []
        self.player = Player(estimator, 0)
        self.t_ns = 0
        self._answers: deque[tuple[int, RawFrame]] = deque()
        self._seq = 0
        self.feed(Event(0, "up"))

    def feed(self, event: Event) -> None:
        """Lets one event happen; what is due by the clock before it happens by itself."""
        self.t_ns = max(self.t_ns, event.t_ns)
        self.events.append(event)
        feed(self.pipeline, event)
        for message in self.pipeline.heard():
            self._answer(message)

    def repeat(self, event: Event) -> None:
        """Lets an event of an earlier session happen; its autopilot's answers are among them."""
        self.player.wait(max(event.t_ns - self.t_ns, 0))
        self.t_ns = max(self.t_ns, event.t_ns)
        feed(self.pipeline, event)
        self.pipeline.heard()
        self._answers.clear()

    def frame(self, frame: RawFrame, version: int = 2) -> None:
        """Feeds one frame now, after the clock's work."""
        self._tick()
        self._seq = (self._seq + 1) % 256
        self.feed(Event(self.t_ns, "rx", frame.packed(self._seq, version)))

    def go_to(self, t_ns: int) -> None:
        """Time passes; the autopilot's answers arrive meanwhile."""
        while self._answers and self._answers[0][0] <= t_ns:
            due_ns, answer = self._answers.popleft()
            self.t_ns = max(self.t_ns, due_ns)
            self.frame(answer)
        self.t_ns = max(self.t_ns, t_ns)

    def honest(self) -> RawFrame:
        """The next frame of the autopilot, at its time."""
        t_ns, frame = self.player.next()
        self.go_to(t_ns)
        return frame

    def recover(self) -> float:
        """Plays the honest autopilot until the service is active; how many seconds that took.

        What he says is not kept among the events: whoever repeats them plays him again.
        """
        attack = len(self.events)
        begun_ns = self.t_ns
        try:
            self.feed(Event(self.t_ns, "up"))
            while not self.pipeline.is_active:
                if self.t_ns - begun_ns > RECOVERY_S * SECOND_NS:
                    health = self.pipeline.service.health
                    raise InvariantBrokenError(
                        f"{health.state} {RECOVERY_S:g} s after the attack: {health.reason}"
                    )
                self.frame(self.honest())
        finally:
            del self.events[attack:]
        return (self.t_ns - begun_ns) * 1e-9

    def _tick(self) -> None:
        if self.t_ns + START_NS >= self.pipeline.next_timer_ns:
            self.feed(Event(self.t_ns, "tick"))

    def _answer(self, message: Any) -> None:
        """What an autopilot says to our questions, 3 ms later."""
        name = type(message).__name__
        if name == "TIMESYNC" and message.tc1 == 0:
            clock_ns = self.t_ns + 5 * SECOND_NS
            answer = mavlink.MAVLink_timesync_message(clock_ns, message.ts1)
        elif name == "COMMAND_LONG":
            answer = mavlink.MAVLink_command_ack_message(message.command, 0, 0, 0, *US)
        else:
            return
        self._answers.append((self.t_ns + 3 * MS_NS, raw_of(answer)))


def feed(pipeline: WatchedPipeline, event: Event) -> None:
    """Lets one event happen to a pipeline."""
    t_ns = START_NS + event.t_ns
    if event.kind == "rx":
        pipeline.received(t_ns, event.data)
    elif event.kind == "tick":
        pipeline.tick(t_ns)
    else:
        pipeline.link(t_ns, event.kind == "up")


def raw_of(message: Any, sender: tuple[int, int] = AUTOPILOT) -> RawFrame:
    """A message of pymavlink's dialect as a raw frame."""
    frame = message.pack(mavlink.MAVLink(None, *sender))
    return RawFrame(message.id, *sender, bytes(frame[10:-2]))


class Attacker:
    """Feeds a session with honest frames that passed his hands.

    Args:
        session: to attack.
        seed: of all that he does.
    """

    def __init__(self, session: Session, seed: int) -> None:
        self._session = session
        self._rng = random.Random(seed)
        self._known_ids = sorted(session.pipeline.service.message_ids)
        self._history: deque[RawFrame] = deque(maxlen=HISTORY)
        self._held: list[RawFrame] = []
        self._clock_us = 0  # what he adds to the autopilot's time stamps
        self._tricks: tuple[Callable[[RawFrame], None], ...] = (
            self._change_one,
            self._change_many,
            self._forge,
            self._impersonate,
            self._ask,
            self._flip_type,
            self._repeat,
            self._hold,
            self._release,
            self._drop,
            self._move_clock,
            self._pause,
            self._move_link,
            self._tick_oddly,
            self._jump_place,
            self._noise,
            self._old_version,
        )
        self._mood: tuple[float, ...] = ()
        self._mood_left = 0

    def attack(self, frames: int) -> None:
        """Feeds about so many frames, and looks at counts and memory in between."""
        pipeline = self._session.pipeline
        end = pipeline.frames + frames
        next_check = pipeline.frames
        while pipeline.frames < end:
            if pipeline.frames >= next_check:
                next_check += FRAMES_BETWEEN_CHECKS
                pipeline.check_counts()
            self._one()
        pipeline.check_counts()

    def _one(self) -> None:
        if self._mood_left == 0:
            self._new_mood()
        self._mood_left -= 1
        frame = restamped(self._session.honest(), self._clock_us)
        self._history.append(frame)
        if self._rng.random() < self._calm:
            self._session.frame(frame)
        else:
            (trick,) = self._rng.choices(self._tricks, self._mood)
            trick(frame)

    def _new_mood(self) -> None:
        """Some moods are all for one trick, others for a few."""
        rng = self._rng
        self._mood_left = rng.randint(30, 400)
        self._calm = rng.choice((0.0, 0.3, 0.7, 0.95))
        share = rng.choice((0.05, 0.2, 1.0))
        weights = [rng.random() if rng.random() < share else 0.0 for _ in self._tricks]
        weights[rng.randrange(len(weights))] += 1.0
        self._mood = tuple(weights)
        self._wait = rng.choice((0.2, 2.0, 11.0, 70.0))

    # --- tricks -------------------------------------------------------------------------------

    def _change_one(self, frame: RawFrame) -> None:
        self._session.frame(with_extremes(self._rng, frame, 0.0))

    def _change_many(self, frame: RawFrame) -> None:
        self._session.frame(with_extremes(self._rng, frame, self._rng.random()))

    def _forge(self, frame: RawFrame) -> None:
        """Any message that the service understands, with any payload, from whom it listens to."""
        msg_id = self._rng.choice(self._known_ids)
        forged = RawFrame(msg_id, *self._sender(frame), random_payload(self._rng, msg_id))
        self._session.frame(self._addressed(forged))
        self._session.frame(frame)

    def _impersonate(self, frame: RawFrame) -> None:
        """The same under other ids; sometimes thousands of ids."""
        sysid = self._rng.choice((1, 0, 255, 77, self._rng.randrange(256)))
        compid = self._rng.choice((1, 0, 191, 197, self._rng.randrange(256)))
        self._session.frame(frame._replace(sysid=sysid, compid=compid))

    def _ask(self, frame: RawFrame) -> None:
        """Commands and parameter questions that are meant for us, with wild arguments."""
        rng = self._rng
        msg_id = rng.choice(sorted(ASKED))
        question = RawFrame(msg_id, *self._sender(frame), random_payload(rng, msg_id))
        question = self._addressed(question)
        if "command" in mavlink.mavlink_map[msg_id].fieldnames:
            question = question.where(place(msg_id, "command"), rng.choice(OUR_COMMANDS))
            question = question.where(place(msg_id, "param1"), rng.choice(OUR_OUTPUTS))
            if rng.random() < 0.5:
                wild = 10.0 ** rng.uniform(-12.0, 12.0)
                question = question.where(place(msg_id, "param2"), wild)
        elif msg_id != mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST and rng.random() < 0.8:
            at = place(msg_id, "param_id").offset
            name = rng.choice(OUR_PARAMETERS).ljust(16, b"\0")
            payload = question.payload
            question = question._replace(payload=payload[:at] + name + payload[at + 16 :])
        self._session.frame(question)
        self._session.frame(frame)

    def _flip_type(self, frame: RawFrame) -> None:
        """The autopilot's HEARTBEAT says another type, make or state."""
        beat = mavlink.MAVLink_heartbeat_message(
            self._rng.choice((1, 2, 10, 6, 255, self._rng.randrange(256))),
            self._rng.choice((3, 12, 8, self._rng.randrange(256))),
            self._rng.choice((0, 81, 209, 255)),
            0,
            self._rng.randrange(9),
            3,
        )
        self._session.frame(raw_of(beat, (frame.sysid, 1)))
        self._session.frame(frame)

    def _repeat(self, frame: RawFrame) -> None:
        self._session.frame(frame)
        self._session.frame(self._rng.choice(self._history))

    def _hold(self, frame: RawFrame) -> None:
        """Keeps it for later."""
        if len(self._held) < HISTORY:
            self._held.append(frame)

    def _release(self, frame: RawFrame) -> None:
        """All that was held, in any order, at once."""
        self._rng.shuffle(self._held)
        for held in self._held:
            self._session.frame(held)
        self._held.clear()
        self._session.frame(frame)

    def _drop(self, frame: RawFrame) -> None:
        """It never arrives."""

    def _move_clock(self, frame: RawFrame) -> None:
        """The autopilot's clock jumps, by a little or to an end of its counter."""
        rng = self._rng
        edges = (0, 1 << 32, 4_294_000_000, 4_294_967_000 * 1000, (1 << 63) - 10**7, (1 << 64) - 10)
        step_us = rng.choice((1, 10_000, 1_900_000, 2_100_000, 9_000_000, 11_000_000, 10**12))
        if rng.random() < 0.3:
            self._clock_us = rng.choice(edges)
        else:
            self._clock_us += rng.choice((-1, 1)) * step_us
        self._session.frame(frame)

    def _pause(self, frame: RawFrame) -> None:
        """Silence, with or without the clock's work."""
        pause_ns = round(self._rng.uniform(0.0, self._wait) * SECOND_NS)
        session = self._session
        session.player.wait(pause_ns)
        if self._rng.random() < 0.5:
            end_ns = session.t_ns + pause_ns
            while session.t_ns + 100 * MS_NS < end_ns:
                session.t_ns += 100 * MS_NS
                session.feed(Event(session.t_ns, "tick"))
        session.t_ns += pause_ns // 1000
        session.frame(frame)

    def _move_link(self, frame: RawFrame) -> None:
        kind = self._rng.choice(("up", "down"))
        self._session.feed(Event(self._session.t_ns, kind))
        self._session.frame(frame)

    def _tick_oddly(self, frame: RawFrame) -> None:
        self._session.t_ns += self._rng.choice((0, 1, 999, 20 * MS_NS))
        self._session.feed(Event(self._session.t_ns, "tick"))
        self._session.frame(frame)

    def _jump_place(self, frame: RawFrame) -> None:
        """A position elsewhere on the earth, and a date."""
        rng = self._rng
        lat, lon = rng.randint(-900_000_000, 900_000_000), rng.randint(-(1 << 31), (1 << 31) - 1)
        alt = int(extreme(rng, "int32_t"))
        messages = (
            mavlink.MAVLink_gps_global_origin_message(lat, lon, alt),
            mavlink.MAVLink_global_position_int_message(0, lat, lon, alt, 0, 0, 0, 0, 0),
            mavlink.MAVLink_system_time_message(int(extreme(rng, "uint64_t")), 0),
        )
        self._session.frame(raw_of(rng.choice(messages)))
        self._session.frame(frame)

    def _noise(self, frame: RawFrame) -> None:
        """Bytes of no frame, and the frame cut in two."""
        session, rng = self._session, self._rng
        session.feed(Event(session.t_ns, "rx", rng.randbytes(rng.randint(0, 300))))
        data = frame.packed(signed=rng.random() < 0.5)
        cut = rng.randint(0, len(data))
        session.feed(Event(session.t_ns, "rx", data[:cut]))
        session.feed(Event(session.t_ns, "rx", data[cut:]))

    def _old_version(self, frame: RawFrame) -> None:
        self._session.frame(frame, version=1 if frame.msg_id < 256 else 2)

    # --- whom he pretends to be, and whom he talks to -----------------------------------------

    def _sender(self, frame: RawFrame) -> tuple[int, int]:
        if self._rng.random() < 0.7:
            return frame.sysid, self._rng.choice((frame.compid, 1, 197, 191))
        return self._rng.randrange(256), self._rng.randrange(256)

    def _addressed(self, frame: RawFrame) -> RawFrame:
        """To us, mostly."""
        if self._rng.random() < 0.1:
            return frame
        us = self._rng.choice((US, US, US, (0, 0), (1, 0)))
        for name, value in zip(("target_system", "target_component"), us, strict=True):
            if name in LAYOUTS[frame.msg_id].field_names:
                frame = frame.where(place(frame.msg_id, name), value)
        return frame


class Written(NamedTuple):
    """A session as it stands in a file: a line for what it begins with, then a line per event.

    Attributes:
        configuration: a name of `clean_sessions.CONFIGURATIONS`.
        is_active_first: the honest autopilot had the service active before the first event.
        events: what was fed.
        note: for people.
    """

    configuration: str
    is_active_first: bool
    events: Sequence[Event]
    note: str = ""

    @property
    def estimator(self) -> str:
        """The motion estimator of the configuration."""
        return self.configuration.rsplit("-", 1)[1]

    def as_text(self) -> bytes:
        """The file."""
        rows: list[Any] = [[self.configuration, self.is_active_first, self.note]]
        rows += [[event.t_ns, event.kind, event.data.hex()] for event in self.events]
        return "".join(json.dumps(row) + "\n" for row in rows).encode()

    @classmethod
    def from_text(cls, data: bytes) -> "Written":
        """What `as_text` wrote."""
        head, *rows = (json.loads(line) for line in data.decode().splitlines())
        events = [Event(t_ns, kind, bytes.fromhex(text)) for t_ns, kind, text in rows]
        return cls(head[0], head[1], events, head[2])

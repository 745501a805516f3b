"""The input of a lane: the messages that feed it, their clock, and the source of their field."""

from enum import IntEnum
from typing import NamedTuple

from h2nav.attitude.samples import ImuSample
from h2nav.maths.units import SECOND_NS
from h2nav.service.field_source import CALIBRATED_ID, FieldSource
from h2nav.service.health import Objection
from h2nav.service.imu_choice import FOREVER_NS, ImuChoice, LaneMessages
from h2nav.service.imu_identity import ANYONES_ID, FIRST_ID, ImuIdentity, Shown
from h2nav.service.sample_clock import NEXT, SampleClock, TimeVerdict
from h2nav.wire.imu import IMU_MESSAGES, NUMBERED_IDS, ImuMessage, ImuReading

# Two clocks under one identity are an objection for this long.
CONTESTED_NS = 5 * SECOND_NS
TELLING_IDS = frozenset({ANYONES_ID, FIRST_ID})
NEW_EPOCHS = (TimeVerdict.REBOOT, TimeVerdict.NEW_EPOCH)


class Need(IntEnum):
    """What a lane needs a message for; an unneeded message is not even decoded."""

    NONE = 0
    FIELD = 1
    SAMPLE = 2
    IDENTITY = 3  # it shows whether the message in use is still that of the lane's IMU


class Incoming(NamedTuple):
    """A reading for the lanes that need it."""

    t_ns: int  # host time
    message_id: int  # of its message
    reading: ImuReading  # its content
    # time of the newest sample that was sent and of its arrival, us and host ns
    newest_sent: tuple[int, int] | None = None


class Arrived(NamedTuple):
    """The result of a reading."""

    verdict: TimeVerdict | None = None  # on its time; None if only its field was used
    sample: ImuSample | None = None  # in the time of the lane; None if the reading is not usable


FIELD_ONLY = Arrived()


class Intake:
    """Turns readings of several messages into the samples of one IMU.

    Args:
        messages: that may feed the lane.
        autopilot: MAV_AUTOPILOT of its heartbeat.
        lends: the field of another message may be used.

    Attributes:
        ignores_others: a reading that names another IMU tells nothing here.
        newest_us: time of the newest sample of this epoch; None before the first.
        field_is_raw: the field of the newest sample is the sensor's, not calibrated.
    """

    def __init__(self, messages: LaneMessages, autopilot: int, *, lends: bool) -> None:
        self._imu, message_ids, self._takes_others = messages
        self._autopilot = autopilot
        self._choice = ImuChoice(message_ids)
        self._ids = {*message_ids, CALIBRATED_ID}
        # Whether both messages that tell whose samples HIGHRES_IMU has may feed the lane.
        self._can_identify = not self._takes_others and {ANYONES_ID, FIRST_ID} <= {*message_ids}
        self._fields = FieldSource(autopilot, lends=lends)
        rows = [IMU_MESSAGES[message_id] for message_id in message_ids]
        borrows = any(self._fields.is_wanted(row) for row in rows)
        self.ignores_others = not (self._takes_others or self._can_identify or borrows)
        self._identity = ImuIdentity()
        self._clock: SampleClock | None = None
        self._clock_of: int | None = None
        self._newest_ns: int | None = None
        self._contested_line: int | None = None
        self._contested_ns: int | None = None
        self.newest_us: int | None = None
        self.field_is_raw = False
        self._is_left = False

    @property
    def message(self) -> ImuMessage | None:
        """The message in use."""
        return self._choice.chosen

    @property
    def is_left(self) -> bool:
        """Whether the autopilot flies on another IMU, whose samples HIGHRES_IMU shows."""
        row = self._choice.chosen
        return self._is_left and row is not None and row.message_id == FIRST_ID

    @property
    def has_lent(self) -> bool:
        """Whether a sample has used the field of another message."""
        return self._fields.has_lent

    @property
    def bias_is_removed(self) -> bool:
        """Whether the message in use lacks the bias that the autopilot's estimator removed."""
        row = self.message
        return row is not None and self._autopilot in row.bias_removed_by

    def objections(self, t_ns: int) -> tuple[Objection, ...]:
        """Lasting objections to the clock of the samples."""
        if self._contested_ns is None or t_ns - self._contested_ns >= CONTESTED_NS:
            return ()
        return (Objection("two senders", "two senders use the autopilot's identity"),)

    def need(self, t_ns: int, message_id: int) -> Need:
        """What a message is needed for now."""
        if message_id not in self._ids:
            return Need.NONE
        if self._choice.is_candidate(message_id, t_ns):
            return Need.SAMPLE
        if self._may_identify(message_id):
            return Need.IDENTITY if t_ns >= self._identity.next_ns else Need.NONE
        lends = message_id == CALIBRATED_ID and self._fields.is_wanted(self._choice.chosen)
        return Need.FIELD if lends else Need.NONE

    def needs_until_ns(self, message_id: int, need: Need) -> int:
        """The host time until which an answer of `need` holds while other messages come.

        A message that only identifies, or would be the first of the lane, is asked for anew.
        """
        if need is Need.SAMPLE:
            chosen = self._choice.chosen
            if chosen is None:
                # Of a message of several IMUs, perhaps none is ever this one's.
                return FOREVER_NS if message_id in NUMBERED_IDS else 0
            return FOREVER_NS if chosen.message_id == message_id else 0
        if need is Need.IDENTITY:
            return 0
        return self.idle_until_ns(message_id) if message_id in self._ids else FOREVER_NS

    def idle_until_ns(self, message_id: int) -> int:
        """The host time until which a message that is not needed stays so."""
        if message_id == CALIBRATED_ID and not self._choice.is_settled:
            return 0  # a message that borrows its field may come into use
        idle_ns = self._choice.idle_until_ns(message_id)
        return min(idle_ns, self._identity.next_ns) if self._may_identify(message_id) else idle_ns

    def _may_identify(self, message_id: int) -> bool:
        """Whether a message shows whose samples HIGHRES_IMU has, beside the one in use."""
        if not self._can_identify:
            return False
        row = self._choice.chosen
        chosen_id = None if row is None else row.message_id
        return {message_id, chosen_id} == {ANYONES_ID, FIRST_ID}

    def take(self, incoming: Incoming, need: Need) -> Arrived:
        """Takes a reading; `need` is the answer to whether it is needed."""
        t_ns, message_id, reading, newest_sent = incoming
        is_telling = self._can_identify and message_id in TELLING_IDS
        if is_telling and self._only_identifies(incoming, need):
            return FIELD_ONLY
        if need is Need.FIELD or not (self._takes_others or reading.imu in (None, self._imu)):
            self._fields.take_field(t_ns, reading.m_b_ut)
            return FIELD_ONLY
        self._choice.takes(message_id, t_ns)
        clock = self._clock
        if clock is None or self._clock_of != message_id:
            clock = self._begin_clock(message_id, newest_sent)
        verdict, t_us = clock.advance(t_ns, reading.time)
        if verdict is not NEXT or self._contested_line is not None:
            self._note_contest(t_ns, verdict)
            if verdict in NEW_EPOCHS:
                self.restart()
            elif verdict is not NEXT:
                return Arrived(verdict)
        self.newest_us, self._newest_ns = t_us, t_ns
        _, w_b, f_b, _, clipped, _, _ = reading
        m_b_ut = self._fields.choose(t_ns, IMU_MESSAGES[message_id], reading.m_b_ut)
        self.field_is_raw = self._fields.is_raw
        sample = tuple.__new__(ImuSample, (t_us, w_b, f_b, m_b_ut, clipped))
        return tuple.__new__(Arrived, (verdict, sample))

    def _only_identifies(self, incoming: Incoming, need: Need) -> bool:
        """Whether a reading is no sample, because it is another IMU's or beside the one in use."""
        t_ns, message_id, reading, _ = incoming
        shown = self._identity.take(t_ns, message_id, reading, is_sample=need is Need.SAMPLE)
        row = self._choice.chosen
        chosen_id = None if row is None else row.message_id
        names_another = message_id == ANYONES_ID and reading.imu not in (None, self._imu)
        self._is_left |= names_another or shown is Shown.ANOTHER
        if shown is Shown.ANOTHER and chosen_id == ANYONES_ID:
            self._choice.prefer(FIRST_ID, t_ns)
            return True
        if shown is Shown.FIRST and chosen_id == FIRST_ID:
            self._choice.prefer(ANYONES_ID, t_ns)
            self._is_left = False
            return True
        return need is Need.IDENTITY

    def restart(self) -> None:
        """Restarts with the autopilot's time or the filter."""
        self.newest_us = None
        self._fields.restart()

    def _begin_clock(self, message_id: int, sent: tuple[int, int] | None) -> SampleClock:
        newest_us, newest_ns = self.newest_us, self._newest_ns
        if newest_us is None and sent is not None:
            newest_us, newest_ns = sent
        self._clock = SampleClock(IMU_MESSAGES[message_id].time_unit_us, newest_us, newest_ns)
        self._clock_of = message_id
        return self._clock

    def _note_contest(self, t_ns: int, verdict: TimeVerdict) -> None:
        """Distinguishes two senders, where the first goes on, from one that was held up."""
        assert self._clock is not None
        if verdict is TimeVerdict.SECOND_SENDER:
            self._contested_line = self._clock.line
        elif verdict is TimeVerdict.NEXT or verdict in NEW_EPOCHS:
            if verdict is TimeVerdict.NEXT and self._contested_line == self._clock.line:
                self._contested_ns = t_ns
            self._contested_line = None

"""Replies to commands, parameter requests and TIMESYNC, limited per second."""

from collections import Counter

from h2nav.service.commands import Commands
from h2nav.service.limits import RateLimit
from h2nav.service.outputs import Outputs
from h2nav.service.parameters import Parameters
from h2nav.service.settings import OutputSettings
from h2nav.service.time_sync import TimeSync
from h2nav.wire import outbound
from h2nav.wire.outbound import Address, OutMessage
from h2nav.wire.questions import Command, ParameterList, ParameterRead, Question
from h2nav.wire.readers import Envelope
from h2nav.wire.vehicle import TimeSyncMessage

ANSWERS_PER_S = 20.0
ANSWERS_AT_ONCE = 40
LIMITED = "question_too_many"


class Conversation:
    """Replies to requests addressed to this component.

    Args:
        settings: our component id, and whether others may change our rates.
    """

    def __init__(self, settings: OutputSettings, outputs: Outputs, time_sync: TimeSync) -> None:
        self._commands = Commands(outputs, settings.allow_remote_changes)
        self._parameters = Parameters(outputs, settings.allow_remote_changes)
        self._time_sync = time_sync
        self._limit = RateLimit(ANSWERS_PER_S, ANSWERS_AT_ONCE)
        self.rejected: Counter[str] = Counter()

    def on_question(
        self, envelope: Envelope, question: Question, ours: Address
    ) -> list[OutMessage]:
        """Returns everything to send in reply.

        Args:
            question: of any sender.
            ours: our system and component id.
        """
        is_for_us = question.target == ours
        # Ground stations request parameters and messages from all components of a vehicle at once.
        is_for_all = question.target in ((ours[0], 0), (0, 0))
        may_be_for_all = isinstance(question, Command | ParameterList)
        if envelope.sender == ours or not (is_for_us or (is_for_all and may_be_for_all)):
            return []
        if not self._limit.allows(envelope.t_ns):
            self.rejected[LIMITED] += 1
            return []
        return self._answers(question, envelope.sender)

    def on_time_question(self, envelope: Envelope, question: TimeSyncMessage) -> OutMessage | None:
        """The arrival of the request on the autopilot's clock; None until that is known.

        PX4 takes our reply for the clock of our time stamps, which are on its own clock.
        """
        offset_ns = self._time_sync.offset_ns(envelope.t_ns)
        if offset_ns is None or not self._limit.allows(envelope.t_ns):
            return None
        return outbound.time_sync(envelope.t_ns + offset_ns, question.ts1_ns, envelope.sender)

    def _answers(self, question: Question, asker: Address) -> list[OutMessage]:
        if isinstance(question, Command):
            return self._commands.answer(question, asker)
        if isinstance(question, ParameterList):
            return list(self._parameters.every_value())
        if isinstance(question, ParameterRead):
            value = self._parameters.read(question)
        else:
            value = self._parameters.write(question)
        return [] if value is None else [value]

"""One wanted stream: whether it comes by itself, what was requested, what was settled on.

    LISTENING --comes--> HELD <--comes-- GRANTED <--acknowledged-- ASKED
        |                 |                 |                        |
        +----missing----> WANTING <---------+--- too slow, refused --+--> REFUSED (a long rest)

A stream is requested only while it is missing, and never for less than came before any request. A
refused rate is lowered to 80 % and then by halves, once each; then the next message is tried. A
granted rate that is never reached is lowered to 80 % of the measured one, and once more by half.
"""

from enum import Enum
from typing import NamedTuple

from h2nav.maths.units import SECOND_NS
from h2nav.service.rate_meter import ArrivalCount, RateMeter

# Arrivals were seen up to 157 ms late: a shorter measurement could miss a stream that comes.
SHORTEST_LOOK_NS = 300_000_000
SHORTEST_SPAN_NS = 2 * SECOND_NS
LONGEST_SPAN_NS = 8 * SECOND_NS
MESSAGES_TO_FIND = 3.0
MESSAGES_TO_JUDGE = 20.0
FIRST_PAUSE_NS = 3 * SECOND_NS
LAST_PAUSE_NS = 60 * SECOND_NS
REFUSED_REST_NS = 600 * SECOND_NS
LOWER_SHARE = 0.8
# The slowest loop of an autopilot runs at 50 Hz: a refusal below this is not about the rate.
MIN_LOWERED_HZ = 20.0
TRIALS_BEFORE_CUT = 2
CUTS = 2
MIN_CUT_HZ = 5.0
MIN_CUT_SHARE = 0.2
MIN_OPTIONAL_SHARE = 0.5


class WantedStream(NamedTuple):
    """A wanted stream."""

    message_id: int  # of the message
    rate_hz: float  # wanted rate
    # message ids to request instead, in order, if this one is refused
    alternatives: tuple[int, ...] = ()
    # requested once the others come, silently, and given up if it does not come at half of
    # that rate, or if another one suffers
    is_optional: bool = False


class StreamPhase(Enum):
    """State of the negotiation."""

    LISTENING = "listening"
    WANTING = "wanting"
    ASKED = "asked"
    GRANTED = "granted"
    HELD = "held"
    REFUSED = "refused"
    GIVEN_UP = "given up"


class Trouble(Enum):
    """A problem of a stream to report."""

    LOWERED = "the autopilot refuses more"
    CUT = "asked for less, because it was never reached"
    SHORT = "never reached"
    TAKEN = "reached once, and then lowered by another program"
    ABSENT = "granted, but none arrives"
    REFUSED = "refused at any rate"


class RequestedStream:
    """The state of one wanted stream."""

    def __init__(self, wanted: WantedStream) -> None:
        self.wanted = wanted
        self.candidates = (wanted.message_id, *wanted.alternatives)
        self._settled = (0, wanted.rate_hz)
        self.phase = StreamPhase.LISTENING
        self.since_ns: int | None = None
        self.due_ns = 0
        self.rate_hz = wanted.rate_hz
        self._pause_ns = FIRST_PAUSE_NS
        self._index = 0
        # Rates before any request, and when a granted rate was missed.
        self._found_hz = 0.0
        self._measured_hz = 0.0
        self._cuts = 0
        self._misses = 0
        self._is_lowered = False
        self._is_untouched = True
        self._has_held = False

    def restart(self) -> None:
        """Starts again; a negotiated rate is still good if it comes by itself."""
        self.phase = StreamPhase.LISTENING
        self.since_ns = None
        self.due_ns = 0
        self._pause_ns = FIRST_PAUSE_NS
        self._take_candidate(0)

    @property
    def message_id(self) -> int:
        """Id of the message that is requested at present."""
        return self.candidates[self._index]

    @property
    def measured_hz(self) -> float:
        """The rate when it was last found too low."""
        return self._measured_hz

    def review(self, t_ns: int, meter: RateMeter) -> Trouble | None:
        """Compares what is wanted with the arrivals; called after each snapshot of the meter."""
        if self.since_ns is None:
            self.since_ns = t_ns
        if self.phase is StreamPhase.LISTENING:
            self._listen(t_ns, meter)
        elif self.phase is StreamPhase.GRANTED:
            return self._try_granted(t_ns, meter)
        elif self.phase in (StreamPhase.HELD, StreamPhase.WANTING):
            self._watch(t_ns, meter)
        elif self.phase is StreamPhase.REFUSED and t_ns - self.since_ns >= REFUSED_REST_NS:
            self._take_candidate(0)
            self._want(t_ns, t_ns)
        elif self.phase is StreamPhase.GIVEN_UP and t_ns - self.since_ns >= REFUSED_REST_NS:
            self.restart()
        return None

    @property
    def is_untouched(self) -> bool:
        """Whether nothing has been requested."""
        return self._is_untouched

    @property
    def is_decided(self) -> bool:
        """Whether it comes, or was found not to."""
        return (
            self.phase in (StreamPhase.HELD, StreamPhase.REFUSED)
            or self._misses >= TRIALS_BEFORE_CUT
        )

    @property
    def is_short(self) -> bool:
        """Whether it was requested and came, and no longer does."""
        return self.phase is not StreamPhase.HELD and self._has_held

    def is_enough(self, first_hz: float) -> bool:
        """Whether the rate justifies an optional stream beside a first one of `first_hz`."""
        return self.rate_hz >= MIN_OPTIONAL_SHARE * min(first_hz, self.wanted.rate_hz)

    @property
    def is_to_be_left(self) -> bool:
        """Whether it was given up, and the autopilot has not been asked to stop it yet."""
        return self.phase is StreamPhase.GIVEN_UP and not self._is_untouched

    def give_up(self, t_ns: int) -> None:
        """Gives it up for a long rest; a requested stream returns to its former rate."""
        if self.phase not in (StreamPhase.GIVEN_UP, StreamPhase.REFUSED):
            self.phase, self.since_ns = StreamPhase.GIVEN_UP, t_ns

    def left(self, t_ns: int) -> None:
        """Notes that its former rate is being requested."""
        self._take_candidate(0)
        self.since_ns = t_ns

    def want_now(self, t_ns: int) -> None:
        """Requests it at once: there is nothing to listen to."""
        if self.phase is StreamPhase.LISTENING:
            self._want(t_ns, t_ns)

    def is_due(self, t_ns: int) -> bool:
        """Whether a request is due now."""
        return self.phase is StreamPhase.WANTING and t_ns >= self.due_ns

    def asked(self, t_ns: int, most_hz: float) -> float:
        """Notes a request; returns its rate, at most `most_hz` as far as possible."""
        self.rate_hz = max(min(self.rate_hz, most_hz), self._found_hz)
        self.phase, self.since_ns = StreamPhase.ASKED, t_ns
        self._is_untouched = False
        self.due_ns = t_ns + self._pause_ns
        return self.rate_hz

    def granted(self, t_ns: int) -> Trouble | None:
        """Notes that the request was acknowledged, or is of a kind that never is."""
        self.phase, self.since_ns = StreamPhase.GRANTED, t_ns
        return Trouble.LOWERED if self._is_lowered else None

    def unanswered(self, t_ns: int, at_once: bool) -> None:
        """Notes that the request or its reply was lost."""
        self._want(t_ns, t_ns if at_once else self._next_turn_ns())

    def refused(self, t_ns: int, is_unknown: bool) -> Trouble | None:
        """Notes a refusal.

        Args:
            is_unknown: because of the message, not of its rate.
        """
        if self.rate_hz > self.wanted.rate_hz:
            # A stream that once came by itself is refused today: the wanted rate will do.
            self.rate_hz, self._found_hz = self.wanted.rate_hz, 0.0
            self._want(t_ns, t_ns)
            return None
        lower_hz = None if is_unknown else self._lower_hz()
        if lower_hz is not None:
            if lower_hz <= self._found_hz:
                self._hold(t_ns, self._found_hz)
            else:
                self.rate_hz = lower_hz
                self._is_lowered = True
                self._want(t_ns, t_ns)
            return None
        if self._take_next_candidate(t_ns):
            return None
        self.rate_hz = self.wanted.rate_hz
        self.phase, self.since_ns = StreamPhase.REFUSED, t_ns
        return Trouble.REFUSED

    # --- judging ------------------------------------------------------------------------------

    def _listen(self, t_ns: int, meter: RateMeter) -> None:
        """Checks whether it comes by itself, as wanted or as negotiated before."""
        assert self.since_ns is not None
        look_ns = max(SHORTEST_LOOK_NS, round(MESSAGES_TO_FIND / self.wanted.rate_hz * SECOND_NS))
        if t_ns - self.since_ns < min(look_ns, LONGEST_SPAN_NS):
            return
        for index, rate_hz in ((0, self.wanted.rate_hz), self._settled):
            found = meter.since(self.candidates[index], self.since_ns)
            if found.reach(rate_hz):
                self._index = index
                self._hold(t_ns, rate_hz)
                return
        self._found_hz = meter.since(self.message_id, self.since_ns).hz
        self._want(t_ns, t_ns)

    def _watch(self, t_ns: int, meter: RateMeter) -> None:
        """Checks whether it is still, or again, present."""
        recent = self._recent(t_ns, meter)
        if recent is None:
            return
        reached = recent.reach(self.rate_hz)
        if reached and self._is_untouched:
            usual = meter.since(self.message_id, t_ns - LONGEST_SPAN_NS)
            self._found_hz = max(self._found_hz, usual.hz)
        if reached and self.phase is StreamPhase.WANTING:
            self._hold(t_ns, self.rate_hz)
        elif not reached and self.phase is StreamPhase.HELD:
            assert self.since_ns is not None
            was_steady = t_ns - self.since_ns >= LAST_PAUSE_NS
            self._want(t_ns, max(t_ns, self._next_turn_ns()))
            if was_steady:
                self._pause_ns = FIRST_PAUSE_NS

    def _try_granted(self, t_ns: int, meter: RateMeter) -> Trouble | None:
        assert self.since_ns is not None
        if t_ns - self.since_ns < self._span_ns():
            return None
        arrivals = meter.since(self.message_id, self.since_ns)
        if arrivals.reach(self.rate_hz):
            self._hold(t_ns, self.rate_hz)
            return None
        return self._miss(t_ns, arrivals)

    def _miss(self, t_ns: int, arrivals: ArrivalCount) -> Trouble | None:
        """Handles a granted rate that was not reached."""
        self._misses += 1
        self._measured_hz = arrivals.hz
        if arrivals.messages == 0 and self._take_next_candidate(t_ns):
            return None
        again = self._misses >= TRIALS_BEFORE_CUT
        if arrivals.messages and not self._has_held and again and self._cut(t_ns, arrivals.hz):
            return Trouble.CUT
        self._want(t_ns, self._next_turn_ns())
        if self._has_held:
            return Trouble.TAKEN
        if not again:
            return None
        return Trouble.SHORT if arrivals.messages else Trouble.ABSENT

    def _lower_hz(self) -> float | None:
        """The next rate to try after a refusal; None if a lower one would be useless."""
        lower_hz = LOWER_SHARE * self.wanted.rate_hz
        while lower_hz >= self.rate_hz:
            lower_hz *= 0.5
        return lower_hz if lower_hz >= MIN_LOWERED_HZ else None

    def _cut(self, t_ns: int, achieved_hz: float) -> bool:
        """Requests less than the measured rate; returns False if that would be too little."""
        lower_hz = LOWER_SHARE * achieved_hz if self._cuts == 0 else 0.5 * self.rate_hz
        least_hz = max(MIN_CUT_HZ, MIN_CUT_SHARE * self.wanted.rate_hz)
        if self._cuts == CUTS or lower_hz < least_hz or lower_hz <= self._found_hz:
            return False
        self._cuts += 1
        self.rate_hz = lower_hz
        self._want(t_ns, t_ns)
        return True

    # --- changing -----------------------------------------------------------------------------

    def _take_candidate(self, index: int) -> None:
        self._index = index
        self.rate_hz = self.wanted.rate_hz
        self._found_hz = 0.0
        self._measured_hz = 0.0
        self._cuts = self._misses = 0
        self._is_lowered = False
        self._has_held = False
        self._is_untouched = True

    def _take_next_candidate(self, t_ns: int) -> bool:
        """Turns to the next message at once; returns False after the last one."""
        if self._index + 1 == len(self.candidates):
            return False
        self._take_candidate(self._index + 1)
        self._want(t_ns, t_ns)
        return True

    def _want(self, t_ns: int, due_ns: int) -> None:
        self.phase, self.since_ns, self.due_ns = StreamPhase.WANTING, t_ns, due_ns

    def _hold(self, t_ns: int, rate_hz: float) -> None:
        self.phase, self.since_ns = StreamPhase.HELD, t_ns
        self.rate_hz = rate_hz
        self._misses = 0
        self._has_held = not self._is_untouched
        self._settled = (self._index, rate_hz)

    def _next_turn_ns(self) -> int:
        """When to repeat a request that did not help for long; the pauses grow."""
        turn_ns = self.due_ns
        self._pause_ns = min(2 * self._pause_ns, LAST_PAUSE_NS)
        return turn_ns

    def _span_ns(self) -> int:
        """Time needed to judge the present rate."""
        wanted_ns = round(MESSAGES_TO_JUDGE / self.rate_hz * SECOND_NS)
        return min(max(wanted_ns, SHORTEST_SPAN_NS), LONGEST_SPAN_NS)

    def _recent(self, t_ns: int, meter: RateMeter) -> ArrivalCount | None:
        """Recent arrivals; None before they are known."""
        span_ns = self._span_ns()
        recent = meter.since(self.message_id, t_ns - span_ns)
        return recent if recent.seconds * 1e9 >= 0.9 * span_ns else None

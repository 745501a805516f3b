"""From IMU readings to estimates: one lane per IMU, and the selection of the one that is sent."""

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.filter import InputRecord, LastingInput
from h2nav.attitude.lead import extrapolated
from h2nav.attitude.samples import AttitudeEstimate, EarthField, ImuSample, VelocityFix
from h2nav.integrity.compasses import SAME_TIME_US, Compasses, Level
from h2nav.integrity.field_voting import FieldVoting
from h2nav.integrity.findings import Alarm
from h2nav.integrity.opened_errors import shown_by_difference
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.reported_vibration import ReportedVibration
from h2nav.integrity.sensor_pairs import InertialSensor
from h2nav.integrity.velocity_witness import NO_DOUBT, OwnDoubt
from h2nav.integrity.voting import Voting
from h2nav.maths.quaternion import conjugate, multiply, tilt_and_heading
from h2nav.maths.units import GRAVITY_M_S2, SECOND_NS
from h2nav.service.attitude_votes import is_outvoted
from h2nav.service.autopilot import Identity
from h2nav.service.before_arming import BeforeArming
from h2nav.service.health import Objection
from h2nav.service.imu_choice import lanes_wanted
from h2nav.service.intake import Incoming, Need
from h2nav.service.lane import NOT_ITS_OWN, SILENT_NS, FilterFor, Lane, Step
from h2nav.service.lane_selection import CLEARLY, Condition, LaneSelection, Switch, SwitchCause
from h2nav.service.records import LaneRecord
from h2nav.service.sample_clock import TimeVerdict
from h2nav.service.sensor_delays import SensorTiming
from h2nav.service.settings import AutopilotSettings
from h2nav.service.twins import Twins
from h2nav.wire.imu import NUMBERED_IDS, RECORDED_IMU, ImuMessage, ImuReading
from h2nav.wire.vehicle import ParameterValue, Vibration

LOOK_NS = 50_000_000
# Of one clock, samples are apart by as much as their arrivals, within this.
SAME_CLOCK_NS = 2 * SECOND_NS
# Two lanes whose attitudes differ.
APART_RAD = math.radians(2.0)


class SentSample(NamedTuple):
    """The result of an IMU reading.

    Attributes:
        sample: the sample that was used; None if the reading was rejected, only lent its field, or
            went to a lane that is not sent.
        estimate: at the time of the sample.
        filtered: the filter's output: at the time at which the sample's values were true.
        event: REBOOT or NEW_EPOCH if the sample began a new epoch.
        switched: reports that another IMU is sent from this sample on, and why.
        is_accused: the reading has shown that a sensor of any lane is faulty.
    """

    sample: ImuSample | None = None
    estimate: AttitudeEstimate | None = None
    filtered: AttitudeEstimate | None = None
    event: TimeVerdict | None = None
    switched: str = ""
    is_accused: bool = False


NOTHING_SENT = SentSample()
Takers = tuple[tuple[Lane, Need], ...]
NO_ROUTE: tuple[int, Takers] = (0, ())


class Estimation:
    """The lanes of one autopilot.

    Args:
        filter_for: creates the filters for a vehicle once it is known.
        settings: the messages to use, and their known delays.
        before_arming: also takes the samples of every IMU.

    Attributes:
        used: number of samples of the lanes that were sent.
        routes: by message id, until when (host ns) a decision holds if nothing happens, and who
            takes it.
    """

    def __init__(
        self, filter_for: FilterFor, settings: AutopilotSettings, before_arming: BeforeArming
    ) -> None:
        self._filter_for = filter_for
        self._settings = settings
        self._before_arming = before_arming
        self._lanes: tuple[Lane, ...] = ()
        self._sent: Lane | None = None
        self._lasting: dict[type, LastingInput] = {}  # by kind
        self._gravity_m_s2 = GRAVITY_M_S2
        self._selection = LaneSelection()
        self._shaking = ReportedVibration()
        self._is_ardupilot = False
        self._twins: dict[int, list[tuple[Lane, Lane, Twins]]] = {}  # by the IMU of either
        self._are_several = False
        self._compasses = Compasses()
        self._lender: Lane | None = None  # its field is also that of IMUs without a compass
        self._without_compass: tuple[Lane, ...] = ()
        self._looked_ns = self._tilts_ns = 0
        self._heard_ns = 0
        self._begin_epoch()
        self.routes: dict[int, tuple[int, Takers]] = {}
        self._rejected: Counter[str] = Counter()
        self.used = 0

    def begin(self, identity: Identity) -> None:
        """Starts for a new vehicle: its filters and its messages."""
        self._lanes = tuple(
            Lane(
                messages,
                self._filter_for(identity),
                identity,
                self._settings,
                _uncounted if number else self.reject,
            )
            for number, messages in enumerate(lanes_wanted(identity.autopilot, self._settings))
        )
        self._sent = self._lanes[0]
        self._selection = LaneSelection()
        self._shaking = ReportedVibration()
        self._is_ardupilot = identity.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        self._twins = {lane.imu: [] for lane in self._lanes}
        for one, other in itertools.combinations(self._lanes, 2):
            pair = one, other, Twins()
            self._twins[one.imu].append(pair)
            self._twins[other.imu].append(pair)
        self._are_several = len(self._lanes) > 1
        self._lender, self._without_compass = None, ()
        self._begin_epoch()
        self._compasses = Compasses()
        self.routes.clear()
        for lane in self._lanes:
            lane.use_gravity(self._gravity_m_s2)
        for what in tuple(self._lasting.values()):
            self.use(what)

    def _begin_epoch(self) -> None:
        self._newest: tuple[int, int] | None = None
        self._has_sent = False
        self._first_ns: int | None = None
        self._voting, self._field_voting = Voting(), FieldVoting()
        self._tilts_apart_rad = 0.0  # from the one that is sent to the furthest
        self._is_outvoted = False  # the one that is sent, by two others

    # --- what is known of the lane that is sent -----------------------------------------------

    @property
    def timing(self) -> SensorTiming:
        """Delays of the sensors."""
        return self._lane.timing

    @property
    def imu_message(self) -> ImuMessage | None:
        """The message in use."""
        return self._sent.intake.message if self._sent else None

    @property
    def is_independent(self) -> bool:
        """Whether nothing of the autopilot's own estimator is in the estimate."""
        return self._sent is None or not self._sent.dependent_source

    @property
    def dependent_source(self) -> str:
        """The source of the dependence on the autopilot's own estimator."""
        return self._lane.dependent_source

    @property
    def has_estimate(self) -> bool:
        """Whether there is an attitude."""
        return self._sent is not None and self._sent.has_estimate

    @property
    def newest_t_us(self) -> int | None:
        """Time of the newest sample used."""
        return self._newest[0] if self._newest else None

    @property
    def heard_t_us(self) -> int | None:
        """Time of the newest sample of any IMU, used or not: the autopilot's clock."""
        return max((lane.newest.t_us for lane in self._lanes if lane.newest), default=None)

    @property
    def velocity_is_false(self) -> bool:
        """Whether the force has shown that the receiver's velocity is false."""
        return self._sent is not None and self._sent.monitor.velocity_is_known_false

    def corrected(self, fix: VelocityFix) -> VelocityFix:
        """The velocity of the IMU that is sent, at its time; see `Monitor.corrected`."""
        return fix if self._sent is None else self._sent.monitor.corrected(fix)

    @property
    def doubt(self) -> OwnDoubt:
        """What may be wrong with the attitude that is sent."""
        sent = self._sent
        if sent is None:
            return NO_DOUBT
        # The force of a sensor that is known to be wrong speaks for nobody.
        may_be_bent = sent.trust.sensor_is_bad or sent.monitor.may_be_bent
        return OwnDoubt(may_be_bent, sent.monitor.corrections, self._tilts_apart_rad)

    @property
    def error_by_compass_rad(self) -> float | None:
        """How far the heading that is sent may be off by its compass; None = unknown."""
        sent = self._sent
        if sent is None or sent.compass_is_wrong or sent.intake.field_is_raw:
            return None
        return sent.monitor.error_by_compass_rad

    def objections(self, t_ns: int) -> tuple[Objection, ...]:
        """Lasting objections to the samples, such as a stuck axis."""
        return self._sent.intake.objections(t_ns) if self._sent else ()

    def alarms(self) -> list[Alarm]:
        """Alarms of the attitude that is sent, and of the sensors of every IMU."""
        found = [alarm for lane in self._lanes for alarm in lane.alarms(lane is self._sent)]
        found += self._voted(found) + self._compasses.alarms()
        known = {alarm.kind for alarm in found}
        reported = self._shaking.alarms(self._heard_ns)
        return found + [alarm for alarm in reported if alarm.kind not in known]

    def _voted(self, known: list[Alarm]) -> list[Alarm]:
        """Alarms of sensors that others contradict, but for those already found to be faulty."""
        own = {(alarm.kind, alarm.sensor) for alarm in known}
        sent = None if self._sent is None else self._sent.sensor
        return [
            alarm._replace(degrades=alarm.degrades and alarm.sensor == sent)
            for alarm in (*self._voting.alarms(), *self._field_voting.alarms())
            if (alarm.kind, alarm.sensor) not in own
        ]

    @property
    def ratios(self) -> InnovationRatios:
        """Innovation test ratios of the attitude that is sent."""
        return self._sent.monitor.ratios if self._sent else InnovationRatios()

    def why_no_samples(self, t_ns: int) -> Objection | None:
        """What is wrong with the latest readings; None if there were none."""
        return self._sent.trust.why_no_samples(t_ns) if self._sent else None

    def lost_imus(self, comes: Callable[[int], bool]) -> Iterator[str]:
        """IMUs besides the one sent that were heard and are not, for people.

        Args:
            comes: whether a message may be expected: of a stream that we do without, no IMU is
                lost.
        """
        for lane in self._lanes:
            if lane is self._sent or lane.faults():
                continue
            if lane.lost:
                yield f"{lane.sensor.name}: {lane.lost}"
            elif lane.is_missing(self._heard_ns) and comes(lane.stream_id):
                yield f"{lane.sensor.name}: no samples"

    def useless_streams(self) -> Iterator[int]:
        """Requested messages that turned out not to be lanes."""
        for lane in self._lanes:
            if lane.is_resting:
                yield lane.stream_id

    def lane_records(self) -> list[LaneRecord]:
        """The state of the lanes; empty if there is only one."""
        sent = self._sent
        lanes = [lane for lane in self._lanes if lane.newest is not None]
        if sent is None or len(lanes) < 2:
            return []
        return [self._record(lane, sent) for lane in lanes]

    # --- readings -----------------------------------------------------------------------------

    @property
    def rejected(self) -> Counter[str]:
        """Rejected readings, by reason.

        Lanes other than the first are optional and do not count.
        """
        return self._rejected

    def reject(self, reason: str) -> None:
        """Counts a rejected reading."""
        self._rejected[reason] += 1

    def on_arrival(self, t_ns: int, message_id: int) -> bool:
        """Ends rests that are over; returns whether any lane needs this message."""
        route = self.routes.get(message_id)
        if route is not None and t_ns < route[0]:
            return bool(route[1])
        for lane in self._lanes:
            lane.trust.wake(t_ns)
        return bool(self._takers(t_ns, message_id))

    def _takers(self, t_ns: int, message_id: int) -> Takers:
        """Who needs a message, decided before it is decoded."""
        route = self.routes.get(message_id)
        if route is not None and t_ns < route[0]:
            return route[1]
        needs = [(lane, lane.need(t_ns, message_id)) for lane in self._lanes]
        takers = tuple(taker for taker in needs if taker[1])
        until_ns = min([lane.needs_until_ns(message_id, need) for lane, need in needs])
        # At least for the reading that comes now.
        self.routes[message_id] = max(until_ns, t_ns), takers
        return takers

    def take(self, t_ns: int, message_id: int, reading: ImuReading) -> SentSample:
        """Takes a reading of the bound autopilot for which `on_arrival` was True."""
        if self._first_ns is None or t_ns - self._heard_ns > SILENT_NS:
            self._hear_again(t_ns)
        self._heard_ns = t_ns
        newest_sent = self._newest if self._has_sent else None
        incoming = tuple.__new__(Incoming, (t_ns, message_id, reading, newest_sent))
        steps: dict[Lane | None, Step] = {}
        is_accused = False
        takers = self._takers_of(t_ns, message_id, reading)
        is_numbered = message_id in NUMBERED_IDS
        named = reading.imu if is_numbered else None
        for lane, need in takers:
            if named is not None and named != lane.imu and lane.intake.ignores_others:
                continue
            before = lane.newest
            message = lane.intake.message if is_numbered or need is Need.IDENTITY else None
            step = lane.take(incoming, need)
            newest = lane.newest
            if self._are_several and newest is not None and newest is not before:
                self._voting.take(lane.imu, newest)
                self._find_twins(t_ns, lane)
                if lane is self._lender:
                    self._lend(t_ns, lane, newest)
            is_accused |= step.is_accused
            if is_numbered or step.sample is None:
                self._revise_routes(lane, need, step, message)
            if step.sample is None:
                continue
            steps[lane] = step
            if not self._before_arming.is_armed:
                seen = newest or step.sample  # with a field that the filter does not use
                self._before_arming.on_sample(lane.imu, seen, field_is_raw=lane.intake.field_is_raw)
        is_asked_anew = self.routes.get(message_id, NO_ROUTE)[0] <= t_ns
        if is_asked_anew and any(need is Need.SAMPLE for _, need in takers):
            self.routes.clear()  # the reading has made this message the one in use
        switched = ""
        if self._are_several and (is_accused or t_ns - self._looked_ns >= LOOK_NS):
            switched = self._look(t_ns)
        sent = NOTHING_SENT if not switched else SentSample(switched=switched)
        own = steps.get(self._sent)
        if own is not None:
            sent = self._sendable(t_ns, own, switched)
        return sent._replace(is_accused=True) if is_accused else sent

    def _takers_of(self, t_ns: int, message_id: int, reading: ImuReading) -> Takers:
        """Who takes a reading that has come."""
        route = self.routes.get(message_id)
        takers = route[1] if route and t_ns <= route[0] else self._takers(t_ns, message_id)
        if message_id == RECORDED_IMU and self._are_several:
            # It names its IMU, and its field is of no use to the lane of another.
            return tuple(taker for taker in takers if taker[0].imu == reading.imu)
        return takers

    def _revise_routes(
        self, lane: Lane, need: Need, step: Step, message: ImuMessage | None
    ) -> None:
        """Forgets them if a reading may have changed which messages a lane needs.

        Args:
            message: in use before it.
        """
        is_refused = step.sample is None and step is not NOT_ITS_OWN and need is not Need.IDENTITY
        if need is not Need.FIELD and (is_refused or lane.intake.message is not message):
            self.routes.clear()

    def _hear_again(self, t_ns: int) -> None:
        """Notes the first reading of an epoch, or the first one after a silence of all lanes."""
        if self._first_ns is None:
            self._first_ns = t_ns
        if t_ns - self._heard_ns > SILENT_NS:
            for lane in self._lanes:
                lane.resume(t_ns)

    def refuse(self, t_ns: int, message_id: int, reason: str) -> None:
        """Counts a rejected reading for which `on_arrival` was True."""
        for lane, _ in self._takers(t_ns, message_id)[:1]:
            lane.trust.refuse(t_ns, reason)
            if lane.trust.is_refused and lane is not self._sent:
                lane.rest(t_ns)
                self.routes.clear()

    def idle_until_ns(self, message_id: int) -> int:
        """The host time until which a message that is not needed stays so.

        It holds until the next `begin`.
        """
        return min(lane.idle_until_ns(message_id) for lane in self._lanes)

    def use(self, what: InputRecord) -> None:
        """Passes it to every filter, to later ones too if it lasts."""
        if isinstance(what, LastingInput):
            self._lasting[type(what)] = what
        if isinstance(what, EarthField):
            self._compasses.use_field(what)
            self._before_arming.on_earth(what)
        for lane in self._lanes:
            lane.use(what)

    def use_gravity(self, gravity_m_s2: float) -> None:
        """Passes the local gravity to every present and later lane."""
        self._gravity_m_s2 = gravity_m_s2
        for lane in self._lanes:
            lane.use_gravity(gravity_m_s2)

    def use_vibration(self, t_ns: int, vibration: Vibration) -> None:
        """Takes the autopilot's report of vibration and clipped samples."""
        level_m_s2 = max(vibration.levels) if self._is_ardupilot else 0.0
        self._shaking.take(t_ns, level_m_s2, vibration.clips)

    def take_parameter(self, parameter: ParameterValue) -> bool:
        """Takes a parameter of the autopilot; returns whether it changed the sensors' delays."""
        changed = [lane.timing.take_parameter(parameter) for lane in self._lanes]
        return any(changed)

    # --- which lane is sent -------------------------------------------------------------------

    @property
    def _lane(self) -> Lane:
        assert self._sent is not None
        return self._sent

    def _sendable(self, t_ns: int, step: Step, switched: str) -> SentSample:
        """What is sent of a step of the lane that is sent; its times only increase."""
        (sample, filtered, of_step, _), lane = step, self._sent
        assert sample is not None
        assert lane is not None
        event = None if lane.event is None else lane.pop_event()
        if event is not None and of_step is None and self._goes_on(t_ns, sample.t_us):
            event = None  # told when the lane that was sent then began it
        if event is not None:
            self._begin_epoch()
            self._first_ns = t_ns
            for other in self._lanes:
                if other is not lane:
                    other.newest = None  # of the clock before, for as long as nothing comes
        if self._newest is not None and sample.t_us <= self._newest[0]:
            return SentSample(switched=switched)
        self._newest = sample.t_us, t_ns
        self._has_sent |= filtered is not None
        self.used += 1
        estimate = None if filtered is None else lane.lead(filtered)
        return tuple.__new__(SentSample, (sample, estimate, filtered, event, switched, False))

    def _goes_on(self, t_ns: int, t_us: int) -> bool:
        """Whether a time is of the same clock as that of the newest sample sent."""
        if self._newest is None:
            return False
        newest_us, newest_ns = self._newest
        return abs((t_us - newest_us) * 1000 - (t_ns - newest_ns)) < SAME_CLOCK_NS

    def _look(self, t_ns: int) -> str:
        """Judges all lanes; returns the text of a switch."""
        self._looked_ns = t_ns
        self._vote()
        self._choose_lender(t_ns)
        for lane in self._lanes:
            lane.judge(t_ns)
        if not self._has_sent:
            self._sent = self._first_lane(t_ns)
            return ""
        self._compare_compasses(t_ns)
        if t_ns - self._tilts_ns >= SECOND_NS:
            self._compare_attitudes(t_ns)
        self._restart_lanes(t_ns)
        sent = self._lane
        conditions = {sent.imu: self._condition(t_ns, sent, sent)}
        if conditions[sent.imu].may_be_left:
            others = (lane for lane in self._lanes if lane is not sent)
            conditions |= {lane.imu: self._condition(t_ns, lane, sent) for lane in others}
        switch = self._selection.look(t_ns, sent.imu, conditions)
        return self._switched(switch) if switch is not None else ""

    def _compare_attitudes(self, t_ns: int) -> None:
        """Opens the deviations of tilts that differ by more than these allow; lets all vote."""
        self._tilts_ns, self._tilts_apart_rad = t_ns, 0.0
        lanes = [lane for lane in self._lanes if lane.may_be_right(t_ns)]
        votes, between_rad, sent = [], 0.0, self._lane
        for one, other in itertools.combinations(lanes, 2):
            tilt_rad, heading_rad = _apart(one, other)
            apart_rad = math.hypot(tilt_rad, heading_rad)
            if sent in (one, other):
                self._tilts_apart_rad = max(self._tilts_apart_rad, tilt_rad)
                voter = one if other is sent else other
                votes.append(voter.vote(apart_rad))
            else:
                between_rad = max(between_rad, apart_rad)
            first_rad, second_rad = shown_by_difference(
                tilt_rad, one.sigma_tilt_rad, other.sigma_tilt_rad
            )
            one.monitor.open(first_rad)
            other.monitor.open(second_rad)
        self._is_outvoted = is_outvoted(sent.vote(0.0), votes, between_rad)

    def _choose_lender(self, t_ns: int) -> None:
        """Chooses whose field the IMUs without a compass take."""
        self._without_compass = tuple(lane for lane in self._lanes if lane.lent.is_wanted(t_ns))
        lenders = (lane for lane in self._lanes if lane.may_lend(t_ns))
        self._lender = next(lenders, None) if self._without_compass else None

    def _lend(self, t_ns: int, lender: Lane, newest: ImuSample) -> None:
        """Passes a new field to the IMUs without a compass."""
        if newest.m_b_ut is not None:
            for lane in self._without_compass:
                lane.lent.lend(t_ns, newest.m_b_ut, lender.imu)

    def _vote(self) -> None:
        """Compares the sensors of all lanes."""
        lanes = {lane.imu: lane for lane in self._lanes if lane.newest is not None}
        for imu, lane in lanes.items():
            if lane.monitor.force_is_off:
                others = [o.monitor.force_excess_m_s2 for i, o in lanes.items() if i != imu]
                lane.monitor.use_other_excesses(others)
        frozen = {(part, imu) for imu, lane in lanes.items() for part in lane.frozen_parts()}
        if frozen or self._voting.has_doubts:
            suspicions = {imu: lane.suspicion for imu, lane in lanes.items()}
            for imu, moved in self._voting.look(suspicions, frozen).items():
                if imu in lanes:
                    lanes[imu].use_moved_zero(moved)
        for imu, lane in lanes.items():
            lane.use_votes(self._voting.verdict(imu))

    def _condition(self, t_ns: int, lane: Lane, sent: Lane) -> Condition:
        # VIBRATION does not name the IMU: the noise of the lanes shows which it is.
        shaken = self._shaking.clips(lane.imu, t_ns) > 0 or self._shaking.is_high(t_ns)
        is_outvoted = self._is_outvoted and lane is sent
        return lane.condition(t_ns, sent, is_reported=shaken, is_outvoted=is_outvoted)

    def _first_lane(self, t_ns: int) -> Lane:
        """The first lane with samples; waits briefly for the preferred one."""
        assert self._first_ns is not None
        for lane in self._lanes:
            heard_ns = self._first_ns if lane.last_used_ns is None else lane.last_used_ns
            if t_ns - max(heard_ns, self._first_ns) <= SILENT_NS:
                return lane
        return self._lane

    def _find_twins(self, t_ns: int, lane: Lane) -> None:
        """Compares a lane's newest sample with those of all others."""
        for one, other, twins in self._twins[lane.imu]:
            first, second = one.newest, other.newest
            if first is not None and second is not None and twins.compare(first, second):
                (one if other is self._sent else other).rest(t_ns)
                self.routes.clear()

    def _compare_compasses(self, t_ns: int) -> None:
        """Compares all IMUs' fields through one attitude: from velocities, or the sent one."""
        lanes = [lane for lane in self._lanes if not lane.is_silent(t_ns) and lane.has_estimate]
        shown = [lane for lane in lanes if lane.monitor.heading_is_shown]
        sent = self._lane
        level = sent if sent in shown or not shown else shown[0]
        estimate, newest = level.estimate, level.newest
        if estimate is None or newest is None:
            return
        fields = {
            lane.imu: lane.newest.m_b_ut
            for lane in lanes
            if lane.newest is not None
            and lane.newest.m_b_ut is not None
            and not lane.intake.field_is_raw
            and abs(lane.newest.t_us - newest.t_us) <= SAME_TIME_US
        }
        fits = {lane.imu: lane.monitor.field_fits for lane in lanes}
        compasses = self._compasses
        turned = Level(estimate.q_nb, math.hypot(*estimate.w_b), level in shown)
        compasses.look(t_ns // 1000, fields, turned, fits)
        self._field_voting.look(t_ns // 1000, fields)
        wrong = compasses.wrong | self._field_voting.frozen
        for lane in self._lanes:
            lane.use_verdict(lane.lent.of in wrong, compasses.doubt_rad(lane.lent.of))
            if lane is not sent:
                lane.drop_heading()

    def _restart_lanes(self, t_ns: int) -> None:
        sent = self._lane
        for lane in self._lanes:
            if (lane is not sent or lane.is_lost) and lane.may_begin_anew(t_ns):
                is_sound = (
                    lane is not sent
                    and not sent.trust.sensor_is_bad
                    and not sent.trust.needs_restart
                    and not sent.is_silent(t_ns)
                )
                lane.begin_as(sent if is_sound else None)

    def _switched(self, switch: Switch) -> str:
        before = self._lane
        (self._sent,) = (lane for lane in self._lanes if lane.imu == switch.lane)
        reason = self._reason(before, self._lane, switch.cause)
        return f"{self._lane.sensor.name} instead of {before.imu + 1}: {reason}"

    def _reason(self, before: Lane, lane: Lane, cause: SwitchCause) -> str:
        """Why another lane is sent, for people."""
        if cause is SwitchCause.BAD:
            faults = (*before.faults(), *self._voting.alarms())
            own = (alarm.text for alarm in faults if alarm.sensor == before.sensor)
            return next(own, "its gyro or force is off")
        if cause is SwitchCause.WORSE:
            return self._worse_by(before, lane)
        if cause is SwitchCause.SILENT and before.is_left:
            return "the autopilot has left it"
        return _REASONS[cause]

    def _worse_by(self, worse: Lane, lane: Lane) -> str:
        """What is worse in a lane than in another.

        If both gyros agree, it is the compass where their forces agree too, or where the same turn
        agrees with one field and contradicts the other. Two headings that hardly differ say nothing
        about a compass, unless the compasses differ, nor is it gyro or force then.
        """
        rates_agree, forces_agree = (
            self._voting.agree(part, worse.imu, lane.imu) for part in InertialSensor
        )
        turn, of_lane = worse.monitor.ratios.of_turn, lane.monitor.ratios.of_turn
        turns_apart = turn > 1.0 and of_lane < CLEARLY * turn
        if not rates_agree and forces_agree:
            return "its gyro is off"
        if not rates_agree or not (forces_agree or turns_apart):
            return _REASONS[SwitchCause.WORSE]
        tilt_rad, heading_rad = _apart(worse, lane)
        is_turned = abs(heading_rad) > max(APART_RAD, tilt_rad)
        if is_turned or self._compasses.differ(worse.imu, lane.imu):
            return _REASONS[SwitchCause.COMPASS]
        return "it contradicts the field" if turns_apart else "its attitude is off"

    def _record(self, lane: Lane, sent: Lane) -> LaneRecord:
        row = lane.intake.message
        tilt, heading = _apart(lane, sent)
        return LaneRecord(
            lane.imu + 1,
            row.name if row else "",
            lane.rate_hz,
            lane.ratio,
            lane.monitor.ratios.of_field,
            math.degrees(tilt),
            math.degrees(heading),
            lane is sent,
        )


_REASONS = {
    SwitchCause.SILENT: "no samples",
    SwitchCause.WORSE: "its gyro or force is off",
    SwitchCause.NOISE: "it vibrates",
    SwitchCause.COMPASS: "its compass is off",
    SwitchCause.UNSURE: "it is less certain",
    SwitchCause.OUTVOTED: "the others agree",
}


def _uncounted(_reason: str) -> None:
    """Does not count."""


def _apart(lane: Lane, sent: Lane) -> tuple[float, float]:
    """Tilt and heading between both at the time of the sent one, rad; NaN if unknown."""
    one, other = lane.estimate, sent.estimate
    if one is None or other is None:
        return math.nan, math.nan
    q = extrapolated(one, (other.t_us - one.t_us) * 1e-6).q_nb
    return tilt_and_heading(multiply(q, conjugate(other.q_nb)))

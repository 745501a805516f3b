"""What is wanted of the bound autopilot: its streams and its parameters.

Which streams follows from the settings, the autopilot's make and its kind of vehicle; whether they
come is measured (`stream_requests`), and only what is missing is requested, if the settings allow.
"""

from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service import before_arming, comparing, imu_identity
from h2nav.service.autopilot import Identity
from h2nav.service.effects import Notice
from h2nav.service.field_source import CALIBRATED_ID
from h2nav.service.imu_choice import lanes_wanted, preference
from h2nav.service.parameter_request import ParameterRequests
from h2nav.service.requested_stream import WantedStream
from h2nav.service.settings import ServiceSettings
from h2nav.service.stream_requests import StreamRequests
from h2nav.wire.imu import IMU_MESSAGES
from h2nav.wire.outbound import Address, OutMessage
from h2nav.wire.vehicle import CommandAck, ParameterValue, StatusText

# Requested rate of a message that only lends its field: a compass is read at 10 to 20 Hz, and a
# link with few samples carries few fields.
FIELD_RATE_HZ = 20.0
FIELD_SHARE = 0.2


class Wanted:
    """The streams and parameters of one autopilot after the other.

    Args:
        settings: of the service.
        of_motion: further streams, for an estimator of motion.

    Attributes:
        counts: messages of the bound autopilot so far, by their ids: routing adds to them.
    """

    def __init__(self, settings: ServiceSettings, of_motion: tuple[WantedStream, ...]) -> None:
        self._settings, self._of_motion = settings, of_motion
        self._streams = StreamRequests((), 0, False)
        self._parameters = ParameterRequests()
        self._imu_ids: tuple[int, ...] = ()
        self.counts = self._streams.counts

    def on_binding(self, identity: Identity, *parameters: str) -> None:
        """Begins for an autopilot.

        Args:
            identity: of it.
            parameters: names of those wanted most; empty ones do not count.
        """
        make, settings = identity.autopilot, self._settings
        streams = streams_wanted(settings, identity, self._of_motion)
        self._streams = StreamRequests(streams, make, settings.autopilot.request_streams)
        self._parameters = ParameterRequests(
            *filter(None, parameters), *before_arming.parameters(make)
        )
        self._imu_ids = preference(make, settings.autopilot.imu_message)
        self.counts = self._streams.counts

    def on_link_up(self) -> None:
        """Begins to listen again."""
        self._streams.restart()

    def on_new_epoch(self) -> None:
        """Begins again after a reboot of the autopilot, which may have changed everything."""
        self._streams.restart()
        self._parameters.restart()

    def on_heartbeat(self, t_ns: int) -> None:
        """Takes a heartbeat of the autopilot."""
        self._streams.heard(t_ns)

    def on_text(self, said: StatusText) -> None:
        """Takes a text of the autopilot, which may explain a refusal."""
        self._streams.said(said.text)

    def on_parameter(self, parameter: ParameterValue) -> None:
        """Takes a parameter of the autopilot, whoever requested it."""
        self._parameters.heard(parameter.name)

    def on_ack(self, t_ns: int, ack: CommandAck, ours: Address) -> None:
        """Takes an acknowledgement of the autopilot, for our address or another."""
        is_interval = ack.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        if is_interval and ack.target in (ours, (0, 0)):
            self._streams.acknowledged(t_ns, ack.result)

    def next_stream(self, t_ns: int, target: Address, useless: Iterable[int]) -> OutMessage | None:
        """Measures the streams; returns the request for one of them, if it is time for one.

        Args:
            t_ns: host time, ten times a second.
            target: the autopilot.
            useless: messages that are no longer wanted.
        """
        self._streams.measure(t_ns)
        for message_id in useless:
            self._streams.give_up(t_ns, message_id)
        if not self._settings.autopilot.request_streams:
            return None
        return self._streams.next_request(t_ns, target)

    def next_parameter(self, t_ns: int, target: Address) -> OutMessage | None:
        """The request for a parameter, if it is time for one."""
        if not self._settings.autopilot.request_streams:
            return None
        return self._parameters.next(t_ns, target)

    def may_come(self, message_id: int) -> bool:
        """Whether we do not do without a message."""
        return not self._streams.is_given_up(message_id)

    @property
    def imu_is_denied(self) -> bool:
        """Whether the autopilot denies every IMU message."""
        return bool(self._imu_ids) and self._streams.is_refused(self._imu_ids[0])

    def measured_hz(self, message_id: int) -> float | None:
        """The rate at which a message comes; None if it is not known yet."""
        return self._streams.measured_hz(message_id)

    def granted_hz(self, message_id: int) -> float | None:
        """The rate at which it has to come; None without a grant."""
        return self._streams.granted_hz(message_id)

    def notices(self) -> Iterable[Notice]:
        """What has become of requests since the last call."""
        return self._streams.notices()


def streams_wanted(
    settings: ServiceSettings, identity: Identity, of_motion: tuple[WantedStream, ...]
) -> tuple[WantedStream, ...]:
    """The streams to request from an autopilot, the most important first."""
    autopilot = identity.autopilot
    first, *others = preference(autopilot, settings.autopilot.imu_message)
    streams = [WantedStream(first, settings.autopilot.imu_rate_hz, tuple(others))]
    is_raw = autopilot in IMU_MESSAGES[first].raw_field_of
    if is_raw and CALIBRATED_ID in others:
        field_rate_hz = min(FIELD_RATE_HZ, FIELD_SHARE * settings.autopilot.imu_rate_hz)
        streams.append(WantedStream(CALIBRATED_ID, field_rate_hz))
    if settings.aiding.gps_velocity or settings.north.declination != "none":
        streams.append(WantedStream(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 5.0))
    streams.append(WantedStream(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 1.0))
    streams.append(WantedStream(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, 1.0))
    if settings.autopilot.simulation_truth:
        truth = mavlink.MAVLINK_MSG_ID_SIMSTATE
        streams.append(WantedStream(truth, settings.autopilot.imu_rate_hz))
    if settings.aiding.autopilot_velocity:
        streams.append(WantedStream(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 10.0))
    lanes = lanes_wanted(autopilot, settings.autopilot)[1:]
    optional = [
        WantedStream(lane.message_ids[0], settings.autopilot.imu_rate_hz, is_optional=True)
        for lane in lanes
    ]
    if lanes and {imu_identity.ANYONES_ID, imu_identity.FIRST_ID} <= {first, *others}:
        known = WantedStream(imu_identity.FIRST_ID, imu_identity.RATE_HZ, is_optional=True)
        optional.append(known)
    optional += comparing.wanted_streams(autopilot, settings.autopilot.compare_rate_hz)
    if settings.aiding.airspeed and identity.is_fixed_wing:
        optional.append(WantedStream(mavlink.MAVLINK_MSG_ID_AIRSPEED, 4.0, is_optional=True))
    optional.append(WantedStream(mavlink.MAVLINK_MSG_ID_VIBRATION, 2.0, is_optional=True))
    return (*streams, *of_motion, *optional)

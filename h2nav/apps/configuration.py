"""The daemon's configuration file: sections, defaults, contradictions."""

import dataclasses
import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from h2nav.apps.algorithms import NAMES, algorithm
from h2nav.attitude.gains.envelope import VEHICLE_CLASSES
from h2nav.errors import BadInput
from h2nav.files import plain_yaml, strict_yaml
from h2nav.links.link_urls import SerialUrl, parse_link_url
from h2nav.links.listen_address import parse_listen_address
from h2nav.motion.settings import OdometrySettings, TwistObserverSettings
from h2nav.service.settings import (
    AidingSettings,
    AutopilotSettings,
    MotionSettings,
    NorthSettings,
    OutputSettings,
    ServiceSettings,
)
from h2nav.validation import OneOf, Within, shown
from h2nav.wire.dialect import LAYOUTS
from h2nav.wire.signing import SETUP_SIGNING_ID

# Bytes on the wire per message (MAVLink 2, unsigned, as observed), for the bandwidth check.
HIGHRES_IMU_FRAME_BYTES = 74
IMU_FRAME_BYTES = {
    "RAW_IMU": 41,
    "SCALED_IMU": 36,
    "SCALED_IMU2": 36,
    "SCALED_IMU3": 36,
}
ATTITUDE_FRAME_BYTES = 40
ATTITUDE_QUATERNION_FRAME_BYTES = 44
ATTITUDE_QUATERNION_COV_FRAME_BYTES = 84
ESTIMATOR_STATUS_FRAME_BYTES = 53
DIFFERENCE_FRAMES_BYTES = 2 * 30
AHRS2_FRAME_BYTES = 36
ODOMETRY_FRAME_BYTES = 245
WHEEL_DISTANCE_FRAME_BYTES = 149
OTHER_TRAFFIC_BYTES_S = 600.0
BITS_PER_SERIAL_BYTE = 10
MAX_OF_A_SHARED_LINK = 0.5
MIN_IMU_RATE_HZ = 5.0  # that `autopilot.imu_rate_hz` may be
LONGEST_SOCKET_BYTES = 107  # of a path in the system's sockaddr_un, less the final zero
AUTOPILOT_COMPONENT_ID = 1  # MAV_COMP_ID_AUTOPILOT1, the only one that autopilots use


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """The connection to the autopilot.

    Attributes:
        url: udpin:HOST:PORT, udpout:HOST:PORT, serial:DEVICE:BAUD or tcp:HOST:PORT.
    """

    url: str = "udpin:0.0.0.0:14550"


@dataclass(frozen=True, slots=True)
class FilterSettings:
    """The estimator.

    Attributes:
        name: `velocity_aided`; `default` is the recommended one, today the same; `constant_gain`
            in integers, as on the smallest microcontrollers.
        arithmetic: `float`, or `fixed` for the 32-bit integers of microcontrollers.
        vehicle_class: `auto` = from the type in the autopilot's heartbeat.
        gains: a gain file, `~` = the home of the daemon's user; `auto` = the shipped one for class
            (or sensor) and rate.
        sensor: whose shipped gains `constant_gain` uses.
        gyro_sampling: `mean`, for sensors that integrate between samples; nothing else is
            supported.
    """

    name: Annotated[str, OneOf(NAMES)] = "default"
    arithmetic: Annotated[str, OneOf(("float", "fixed"))] = "float"
    vehicle_class: Annotated[str, OneOf(("auto", *VEHICLE_CLASSES))] = "auto"
    gains: str = "auto"
    sensor: Annotated[str, OneOf(("mpu9250", "icm42688", "bmi088"))] = "mpu9250"
    gyro_sampling: Annotated[str, OneOf(("mean",))] = "mean"


@dataclass(frozen=True, slots=True)
class LogSettings:
    """The MCAP log.

    Attributes:
        folder: where logs are written, `~` = the home of the daemon's user; empty = no log.
        max_file_mb: size at which a new file begins.
        max_file_minutes: age at which a new file begins.
        max_files: number of logs that are kept; the oldest are deleted.
        max_run_mb: space for one run; beyond it the run's own oldest files are deleted, so that no
            flood of input deletes earlier flights. 0 = a quarter of `max_files` times
            `max_file_mb`, or of the disk's space for logs where that is less.
        min_free_mb: free space that stays on the disk.
        decode_autopilot: also write the autopilot's common messages as channels for plots
            (`h2nav log decode` does it afterwards).
    """

    folder: str = ""
    max_file_mb: Annotated[int, Within(1, 100_000)] = 512
    max_file_minutes: Annotated[int, Within(1, 100_000)] = 60
    max_files: Annotated[int, Within(1, 100_000)] = 100
    max_run_mb: Annotated[int, Within(0, 100_000_000)] = 0
    min_free_mb: Annotated[int, Within(0, 1_000_000)] = 256
    decode_autopilot: bool = False


@dataclass(frozen=True, slots=True)
class SigningSettings:
    """MAVLink 2 signing, both directions.

    Attributes:
        key_file: 32 bytes or 64 hexadecimal digits, mode 0600; empty = signing is off: frames are
            neither signed nor verified.
        link_id: of outgoing frames; links under the same system and component id need different
            ones.
        state_file: where the time stamp survives a restart; created if missing.
        accept_unsigned: messages accepted without a signature, and hence in MAVLink 1; by default
            those that the firmware of telemetry radios sends.
    """

    key_file: str = ""
    link_id: Annotated[int, Within(0, 255)] = 0
    state_file: str = ""
    accept_unsigned: tuple[str, ...] = ("RADIO_STATUS", "RADIO")

    def unsigned_ids(self) -> frozenset[int]:
        """The ids of `accept_unsigned`.

        Raises:
            BadInput: one line per name that is no message.
        """
        ids = {layout.name: msg_id for msg_id, layout in LAYOUTS.items()}
        unknown = [name for name in self.accept_unsigned if name not in ids]
        if unknown:
            raise BadInput(*(f"{name}: no message of the dialect" for name in unknown))
        return frozenset(ids[name] for name in self.accept_unsigned)


@dataclass(frozen=True, slots=True)
class LiveSettings:
    """The live view while the daemon runs: read-only, open to all who can reach the ports.

    Attributes:
        address: HOST:PORT of the status page and the metrics; empty = off.
        foxglove_port: of the Foxglove WebSocket on the same host; 0 = none.
    """

    address: str = ""
    foxglove_port: Annotated[int, Within(0, 65535)] = 8765


@dataclass(frozen=True, slots=True)
class EventSettings:
    """Events for other programs of this computer while the daemon runs.

    Attributes:
        socket: path of a Unix socket that sends the events of ``h2nav run --json`` to every
            client, such as /run/h2nav/events; empty = none.
    """

    socket: str = ""


@dataclass(frozen=True, slots=True)
class FlightSettings:
    """The record of flights, in the folder of the log.

    Attributes:
        review: review each flight when the vehicle has disarmed, in a process of its own, which
            ends when the vehicle is armed again and is taken up later.
        review_memory_mb: memory of that process; a recording that needs more is not reviewed.
        review_minutes: processor time of that process.
        review_priority: `idle`, or `normal` for a computer whose processors are always busy, where
            an idle process waits for ever: the review then has its share of them, as others have.
        fetch_log: fetch the autopilot's own log after each flight, which then is what is reviewed:
            while the vehicle is disarmed, and while nobody else fetches.
        token_file: file with the token that uploads and deletions on the page need, made if it is
            missing; empty = the page is read-only.
        upload_mb: largest upload; 0 = none.
        max_gb: space for the recordings of all flights; beyond it the oldest reviewed ones are
            deleted, those with errors last. 0 = no limit but that of the log.
        max_days: age at which a reviewed flight without an error is deleted; 0 = never.
        fetch_share: part of the link that this may take; a link without a baud rate counts as one
            of 921600 baud.
    """

    review: bool = True
    review_memory_mb: Annotated[int, Within(128, 65536)] = 512
    review_minutes: Annotated[int, Within(1, 1440)] = 30
    review_priority: Annotated[str, OneOf(("idle", "normal"))] = "idle"
    fetch_log: bool = False
    fetch_share: Annotated[float, Within(0.01, 0.9)] = 0.5
    token_file: str = ""
    upload_mb: Annotated[int, Within(0, 100_000)] = 1024
    max_gb: Annotated[float, Within(0.0, 1e6)] = 0.0
    max_days: Annotated[int, Within(0, 36_500)] = 0


@dataclass(frozen=True, slots=True)
class Configuration:
    """The whole file, one field per section."""

    link: LinkSettings = field(default_factory=LinkSettings)
    autopilot: AutopilotSettings = field(default_factory=AutopilotSettings)
    output: OutputSettings = field(default_factory=OutputSettings)
    north: NorthSettings = field(default_factory=NorthSettings)
    aiding: AidingSettings = field(default_factory=AidingSettings)
    filter: FilterSettings = field(default_factory=FilterSettings)
    motion: MotionSettings = field(default_factory=MotionSettings)
    twist: TwistObserverSettings = field(default_factory=TwistObserverSettings)
    odometry: OdometrySettings = field(default_factory=OdometrySettings)
    log: LogSettings = field(default_factory=LogSettings)
    signing: SigningSettings = field(default_factory=SigningSettings)
    live: LiveSettings = field(default_factory=LiveSettings)
    events: EventSettings = field(default_factory=EventSettings)
    flights: FlightSettings = field(default_factory=FlightSettings)

    @property
    def service(self) -> ServiceSettings:
        """The sections that the service reads."""
        return ServiceSettings(
            self.autopilot,
            self.output,
            self.north,
            self.aiding,
            self.motion,
            self.twist,
            self.odometry,
        )

    def as_mapping(self) -> dict[str, Any]:
        """Every key with its value, as in the file; for the log and for replay."""
        return dataclasses.asdict(self)


def read(path: Path) -> Configuration:
    """Reads and checks a configuration file.

    Raises:
        BadInput: one line per error, naming file, key and remedy.
    """
    return build(plain_yaml.read_mapping(path), str(path))


def build(mapping: dict[str, Any], place: str) -> Configuration:
    """Checks a configuration that is already a mapping.

    Raises:
        BadInput: one line per error.
    """
    configuration = at_home(strict_yaml.into_record(Configuration, mapping, place), place)
    complaints = [f"{place}: {complaint}" for complaint in contradictions(configuration)]
    if complaints:
        raise BadInput(*complaints)
    return configuration


def at_home(configuration: Configuration, place: str) -> Configuration:
    """The configuration with `~` and `~user` in its paths replaced by home folders.

    Args:
        place: its source, for errors.

    Raises:
        BadInput: one line per path with an unknown home.
    """
    complaints: list[str] = []

    def expanded(key: str, path: str) -> str:
        whole = os.path.expanduser(path)
        if whole.startswith("~"):
            complaints.append(f"{place}: {key}: {path}: no such home; write out the path")
        if "\0" in whole:
            complaints.append(f"{place}: {key}: {shown(path)}: no path; leave out the \\0")
        return whole

    log, gains, signing = configuration.log, configuration.filter, configuration.signing
    log = dataclasses.replace(log, folder=expanded("log.folder", log.folder))
    gains = dataclasses.replace(gains, gains=expanded("filter.gains", gains.gains))
    signing = dataclasses.replace(
        signing,
        key_file=expanded("signing.key_file", signing.key_file),
        state_file=expanded("signing.state_file", signing.state_file),
    )
    events = EventSettings(expanded("events.socket", configuration.events.socket))
    token_file = expanded("flights.token_file", configuration.flights.token_file)
    flights = dataclasses.replace(configuration.flights, token_file=token_file)
    if complaints:
        raise BadInput(*complaints)
    return dataclasses.replace(
        configuration, log=log, filter=gains, signing=signing, events=events, flights=flights
    )


def contradictions(configuration: Configuration) -> list[str]:
    """Values that are valid and yet cannot work, with key and remedy for each."""
    link = _link_complaints(configuration.link.url) or _bandwidth_complaints(configuration)
    return [
        *link,
        *_identity_complaints(configuration),
        *_filter_complaints(configuration.filter),
        *_motion_complaints(configuration),
        *_signing_complaints(configuration.signing),
        *_live_complaints(configuration.live),
        *_event_complaints(configuration.events),
        *_flight_complaints(configuration),
    ]


def _link_complaints(url: str) -> list[str]:
    try:
        parse_link_url(url)
    except BadInput as error:
        return [f"link.url: {line}" for line in error.lines]
    return []


def _identity_complaints(configuration: Configuration) -> list[str]:
    """A component with the autopilot's id would be mistaken for the autopilot."""
    ours, asked = configuration.output.component_id, configuration.autopilot.component_id
    if ours == AUTOPILOT_COMPONENT_ID:
        taken = "the autopilot's: its ground stations would take our messages for its own"
    elif ours == asked:
        taken = "that of autopilot.component_id: ours could not be told from the autopilot's"
    else:
        return []
    return [
        f"output.component_id: {ours} is {taken}; leave it out (191, an onboard computer), or "
        "give an unused one"
    ]


def _filter_complaints(settings: FilterSettings) -> list[str]:
    """A filter that exists in integers only."""
    possible = tuple(algorithm(settings.name).makers)
    if settings.arithmetic not in possible:
        return [f"filter.arithmetic: {settings.name} runs in {possible[0]} arithmetic; set that"]
    return []


def _motion_complaints(configuration: Configuration) -> list[str]:
    """What the motion estimators cannot do in the daemon."""
    complaints = []
    try:
        configuration.odometry.chassis()
    except BadInput as error:
        complaints += [f"odometry.angle_1_deg: {line}" for line in error.lines]
    if configuration.twist.velocity != "integrated":
        complaints.append(
            "twist.velocity: the daemon has no other source of velocity than the IMU; "
            "set `integrated` or leave it out"
        )
    motion = configuration.motion
    if (
        motion.estimator == "twist"
        and motion.pose_component_id == configuration.output.component_id
    ):
        complaints.append(
            f"motion.pose_component_id: {motion.pose_component_id} is our own component id; "
            "give that of the camera, or 0 for the first one received"
        )
    return complaints


def _signing_complaints(settings: SigningSettings) -> list[str]:
    """Missing parts of signing. The key itself is read at the start: a replay has none."""
    complaints = []
    if settings.key_file and not settings.state_file:
        complaints.append(
            "signing.state_file: missing; name a file for the time stamp, such as "
            "/var/lib/h2nav/signing-stamp"
        )
    try:
        ids = settings.unsigned_ids()
    except BadInput as error:
        return complaints + [f"signing.accept_unsigned: {line}" for line in error.lines]
    if SETUP_SIGNING_ID in ids:
        complaints.append(
            "signing.accept_unsigned: SETUP_SIGNING is never obeyed; leave it out of the list"
        )
    return complaints


def _live_complaints(settings: LiveSettings) -> list[str]:
    if not settings.address:
        return []
    try:
        address = parse_listen_address(settings.address)
    except BadInput as error:
        return [f"live.address: {line}" for line in error.lines]
    if address.port and address.port == settings.foxglove_port:
        return [
            f"live.foxglove_port: {address.port} is also the port of live.address; give another, "
            "or 0 for no Foxglove WebSocket"
        ]
    return []


def _event_complaints(settings: EventSettings) -> list[str]:
    length = len(os.fsencode(settings.socket))
    if length <= LONGEST_SOCKET_BYTES:
        return []
    return [
        f"events.socket: {length} bytes are too many for the path of a socket; give one of at most "
        f"{LONGEST_SOCKET_BYTES}, such as /run/h2nav/events"
    ]


def _flight_complaints(configuration: Configuration) -> list[str]:
    """A fetched log needs a folder."""
    if configuration.flights.fetch_log and not configuration.log.folder:
        return ["flights.fetch_log: there is no folder for it; set log.folder, or leave it out"]
    return []


class LinkLoad(NamedTuple):
    """The load that the configuration puts on the link to the autopilot, bytes/s."""

    imu_frame: int  # bytes of one IMU message; the longest where the choice is open
    besides: float  # requested from the autopilot besides its IMU
    inbound: float  # everything requested from the autopilot
    outbound: float  # sent by h2nav


def link_load(configuration: Configuration) -> LinkLoad:
    """Estimates the load from the requested rates."""
    asked, output, motion = configuration.autopilot, configuration.output, configuration.motion
    besides = OTHER_TRAFFIC_BYTES_S
    besides += asked.compare_rate_hz * (ATTITUDE_FRAME_BYTES + 0.5 * AHRS2_FRAME_BYTES)
    if motion.estimator == "wheels":
        besides += motion.wheel_distance_rate_hz * WHEEL_DISTANCE_FRAME_BYTES
    outbound = (
        output.attitude_rate_hz * ATTITUDE_FRAME_BYTES
        + output.attitude_quaternion_rate_hz * ATTITUDE_QUATERNION_FRAME_BYTES
        + output.attitude_covariance_rate_hz * ATTITUDE_QUATERNION_COV_FRAME_BYTES
        + output.estimator_status_rate_hz * ESTIMATOR_STATUS_FRAME_BYTES
        + output.difference_rate_hz * DIFFERENCE_FRAMES_BYTES
    )
    if motion.estimator != "none":
        outbound += motion.odometry_rate_hz * ODOMETRY_FRAME_BYTES
    imu_frame = IMU_FRAME_BYTES.get(asked.imu_message, HIGHRES_IMU_FRAME_BYTES)
    return LinkLoad(imu_frame, besides, asked.imu_rate_hz * imu_frame + besides, outbound)


def _bandwidth_complaints(configuration: Configuration) -> list[str]:
    """A serial link must carry the requested rates; autopilots acknowledge any."""
    link = parse_link_url(configuration.link.url)
    if not isinstance(link, SerialUrl):
        return []
    baud, capacity = link.baud, link.baud / BITS_PER_SERIAL_BYTE
    load = link_load(configuration)
    complaints = []
    if load.inbound > capacity:
        best_hz = math.floor((capacity - load.besides) / load.imu_frame)
        lower = f"lower it to {best_hz} or " if best_hz >= MIN_IMU_RATE_HZ else ""
        complaints.append(
            f"autopilot.imu_rate_hz: {configuration.autopilot.imu_rate_hz:g} Hz needs "
            f"{load.inbound:.0f} B/s, {baud} baud carries {capacity:.0f}; {lower}raise the baud "
            "rate in link.url"
        )
    if load.outbound > capacity:
        complaints.append(
            f"output.attitude_rate_hz: the outputs need {load.outbound:.0f} B/s, {baud} baud "
            f"carries {capacity:.0f}; lower their rates or raise the baud rate in link.url"
        )
    return complaints


def warnings(configuration: Configuration) -> list[str]:
    """Values that work but may be unwise, each with its key."""
    return [
        *_filter_warnings(configuration.filter),
        *_link_warnings(configuration),
        *_live_warnings(configuration.live),
    ]


def left_out(settings: FilterSettings) -> str:
    """Features missing in the default filter in integers; empty for others."""
    if settings.name == "constant_gain" or settings.arithmetic == "float":
        return ""
    return "without hard iron learnt in flight, without repair of clipped rates"


def _filter_warnings(settings: FilterSettings) -> list[str]:
    without = left_out(settings)
    return [f"filter.arithmetic: fixed, {without}: docs/fixed-point.md"] if without else []


def _link_warnings(configuration: Configuration) -> list[str]:
    link = parse_link_url(configuration.link.url)
    if not isinstance(link, SerialUrl):
        return []
    load = link_load(configuration)
    share = (load.inbound + load.outbound) / (link.baud / BITS_PER_SERIAL_BYTE)
    if share <= MAX_OF_A_SHARED_LINK:
        return []
    return [
        f"link.url: what we ask for and send is {100.0 * share:.0f} % of what {link.baud} baud "
        "carry one way; on a radio that a ground station shares, start from "
        "`h2nav check-config --example telemetry-radio`"
    ]


def _live_warnings(settings: LiveSettings) -> list[str]:
    if not settings.address or parse_listen_address(settings.address).is_loopback:
        return []
    return [
        f"live.address: {settings.address} shows attitude, state and configuration, without a "
        "password, to all who can reach it; 127.0.0.1 shows them to this machine alone"
    ]

"""``h2nav fake-autopilot``: a SITL-style autopilot on a UDP port, TCP port or pseudo-terminal."""

import argparse
import select
import socket
import sys
import textwrap
import time
from pathlib import Path

from h2nav.apps.autopilot_bytes import AutopilotBytes, AutopilotSigning
from h2nav.apps.json_output import print_json
from h2nav.apps.order_input import QUIT, OrderInput, order_input
from h2nav.apps.parameter_files import read_parameters
from h2nav.errors import BadInput
from h2nav.files.signing_keys import read_signing_key
from h2nav.host.stop_signals import StopSignals
from h2nav.links.link_urls import FORMS
from h2nav.links.links import Link
from h2nav.links.server_links import FORMS as SERVER_FORMS
from h2nav.links.server_links import open_server_link
from h2nav.sim.autopilot import AutopilotOptions, FakeAutopilot
from h2nav.sim.calibrations import SOUND, Miscalibration
from h2nav.sim.faults import parse_fault
from h2nav.sim.imu_model import MPU_9250
from h2nav.sim.orders import HELP, KEYS, Orders, key_table, name_tables
from h2nav.sim.personalities import personality
from h2nav.sim.scenarios import scenario
from h2nav.sim.streams import Stream
from h2nav.sim.vision_streams import VISION_MESSAGES, VisionOptions, vision_stream
from h2nav.wire.signing import LocalStamp, SignatureChecker, Signer

SIGNING_LINK_ID = 0
LONGEST_WAIT_S = 0.1
LONGEST_S = 1e9  # 32 years
MAX_BIAS_DEG_S = 100.0
MAX_FIELD_MG = 5000.0
MAX_OFFSET = 10.0
AXES = ("X", "Y", "Z")
BITS_PER_BYTE_ON_A_LINE = 10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    orders = textwrap.indent(HELP, "  ")
    parser.epilog = f"{name_tables()}\n\norders on standard input while it flies:\n{orders}"
    parser.add_argument(
        "--connect",
        required=True,
        action="append",
        metavar="URL",
        help=f"one of {FORMS}, {SERVER_FORMS}. If given twice, each receives the other's messages",
    )
    parser.add_argument("--scenario", default="flight", metavar="NAME", help="default: flight")
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of all random numbers"
    )
    parser.add_argument("--seconds", type=float, metavar="S", help="end after this time")
    parser.add_argument(
        "--autopilot",
        default="ardupilot",
        metavar="MAKE",
        help="ardupilot (default), arduplane or px4",
    )
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="NAME[=ARG]@START[+DURATION][/IMU]",
        help="a fault to simulate, times in seconds; may be repeated",
    )
    parser.add_argument(
        "--imus", type=int, default=1, choices=(1, 2, 3), help="IMUs on board (default: 1)"
    )
    parser.add_argument(
        "--baud", type=float, metavar="BAUD", help="as slow as a serial line of this speed"
    )
    parser.add_argument(
        "--boot-text", action="store_true", help="send plain text at power-on, as on a serial port"
    )
    parser.add_argument(
        "--gyro-bias-deg-s",
        nargs=3,
        type=float,
        default=MPU_9250.gyro_bias_deg_s,
        metavar=("X", "Y", "Z"),
        help="bias of the gyro in body axes, added to the small one drawn from the seed",
    )
    wrong = parser.add_argument_group("a first IMU that was calibrated or mounted wrongly")
    for name, unit in (
        ("--compass-offset", "a field of the vehicle's own, mG"),
        ("--motor-field", "the motors' field at full throttle, mG"),
        ("--accelerometer-offset", "what the accelerometer shows of no force, m/s^2"),
        ("--gyro-offset", "what the gyro shows of no turn, deg/s"),
    ):
        wrong.add_argument(
            name, nargs=3, type=float, default=SOUND.compass_offset_mg, metavar=AXES, help=unit
        )
    for name in ("--compass-scale", "--accelerometer-scale"):
        wrong.add_argument(
            name,
            nargs=3,
            type=float,
            default=SOUND.compass_scale,
            metavar=AXES,
            help="what it shows of each axis",
        )
    wrong.add_argument(
        "--compass-turned",
        type=float,
        default=0.0,
        metavar="DEG",
        help="the compass is mounted turned about the vertical",
    )
    wrong.add_argument(
        "--board",
        nargs=2,
        type=float,
        default=SOUND.board_deg,
        metavar=("ROLL", "PITCH"),
        help="how the board is mounted in the frame, deg",
    )
    wrong.add_argument(
        "--parameters",
        type=Path,
        metavar="FILE",
        help="parameters to start with, as written by `h2nav calibrate`",
    )
    parser.add_argument(
        "--log",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="a log of its logger, which can be fetched; may be repeated, the newest last",
    )
    parser.add_argument(
        "--no-ftp", action="store_true", help="serve logs by LOG_REQUEST_DATA alone"
    )
    parser.add_argument(
        "--arm-authorization",
        action="store_true",
        help="request an authorization on the link before arming, as PX4 does",
    )
    parser.add_argument(
        "--signing-key",
        type=Path,
        metavar="FILE",
        help="sign all frames with this key; obey and forward only frames signed with it",
    )
    vision = parser.add_argument_group("poses of a visual odometry, forwarded by the autopilot")
    vision.add_argument("--vision", choices=VISION_MESSAGES, help="send them as this message")
    vision.add_argument("--vision-rate-hz", type=float, default=30.0, metavar="HZ")
    vision.add_argument("--vision-delay-ms", type=float, default=0.0, metavar="MS")
    vision.add_argument("--vision-drop-out", type=float, default=0.0, metavar="SHARE")
    parser.add_argument("--json", action="store_true", help="print the counts as JSON at the end")


def run(args: argparse.Namespace) -> int:
    """Flies until the time is over or a signal arrives."""
    options = _options(args)
    signing = None if args.signing_key is None else _signing(args.signing_key)
    links = [open_server_link(url) for url in args.connect]
    try:
        with StopSignals().installed() as stop, order_input(KEYS | {"q": QUIT}) as orders:
            _wait_for(links, stop.wake)
            start_ns = time.monotonic_ns()
            end_ns = None if args.seconds is None else start_ns + round(args.seconds * 1e9)
            autopilot = FakeAutopilot(options)
            vehicle = AutopilotBytes(autopilot, start_ns, len(links), signing)
            user = _User(orders, Orders(autopilot))
            if orders.has_keys:
                print(key_table(), file=sys.stderr)
            while not (stop.stopped or user.has_quit) and (
                end_ns is None or time.monotonic_ns() < end_ns
            ):
                _turn(vehicle, links, user, stop.wake)
    finally:
        for link in links:
            link.close()
    counts = vehicle.counts()
    if args.json:
        print_json({"seconds": (time.monotonic_ns() - start_ns) * 1e-9, **counts})
    else:
        for name, count in counts.items():
            print(f"{name:18} {count}", file=sys.stderr)
    return 0


def _wait_for(links: list[Link], wake: socket.socket) -> None:
    """Waits up to a second for the links to open, so that the first heartbeat is not lost."""
    for _ in range(100):
        for link in links:
            link.maintain(time.monotonic_ns())
        if all(link.is_up for link in links) or select.select([wake], [], [], 0.01)[0]:
            return
    for link in links:
        if not link.is_up:
            print(f"h2nav: {link.url} is not open yet: {link.last_error}", file=sys.stderr)


class _User:
    """Carries out the user's orders; replies go to standard error."""

    def __init__(self, source: OrderInput, orders: Orders) -> None:
        self._source = source
        self._orders = orders
        self.has_quit = False

    def fileno(self) -> int | None:
        """The descriptor to wait on, if there is input."""
        return self._source.fileno()

    def serve(self, t_ns: int) -> None:
        """Carries out new orders."""
        for line in self._source.read():
            if line.strip() == QUIT:
                self.has_quit = True
                return
            try:
                answer = self._orders.obey(t_ns, line)
            except BadInput as error:
                answer = f"h2nav: {error}"
            if answer:
                print(answer, file=sys.stderr)


def _turn(vehicle: AutopilotBytes, links: list[Link], user: _User, wake: socket.socket) -> None:
    """Waits for a link, an order or the vehicle's next deadline, then does what is due."""
    now_ns = time.monotonic_ns()
    waiting: list[int] = [wake.fileno()]
    keyboard = user.fileno()
    if keyboard is not None:
        waiting.append(keyboard)
    for link in links:
        link.maintain(now_ns)
        descriptor = link.fileno()
        if descriptor is not None:
            waiting.append(descriptor)
    wait_s = (vehicle.next_deadline_ns - now_ns) * 1e-9
    readable, _, _ = select.select(waiting, [], [], min(max(wait_s, 0.0), LONGEST_WAIT_S))
    now_ns = time.monotonic_ns()
    vehicle.skip_if_late(now_ns)
    reboots = vehicle.reboots
    if keyboard in readable:
        user.serve(now_ns)
    for number, link in enumerate(links):
        if link.fileno() in readable:
            _hear(vehicle, links, number, now_ns)
    for data in vehicle.advance(now_ns):
        for link in links:
            link.write(data)
    if vehicle.reboots != reboots:
        for link in links:
            # A rebooted autopilot returns from another port.
            if link.url.startswith("udpout"):
                link.close()


def _hear(vehicle: AutopilotBytes, links: list[Link], number: int, now_ns: int) -> None:
    """Passes bytes of one link to the vehicle, and forwarded frames to the other links."""
    for data, _ in links[number].read():
        for frame in vehicle.received(now_ns, data, number):
            for other, link in enumerate(links):
                if other != number:
                    link.write(frame)


def _options(args: argparse.Namespace) -> AutopilotOptions:
    if args.seconds is not None and not 0.0 <= args.seconds <= LONGEST_S:
        raise BadInput(f"--seconds: expected a number from 0 to {LONGEST_S:g}")
    if args.seed < 0:
        raise BadInput("--seed: expected 0 or more")
    if args.baud is not None and not 300 <= args.baud <= 12e6:
        raise BadInput("--baud: expected a number from 300 to 12000000")
    if not all(abs(bias) <= MAX_BIAS_DEG_S for bias in args.gyro_bias_deg_s):
        raise BadInput(f"--gyro-bias-deg-s: expected three numbers within +-{MAX_BIAS_DEG_S:g}")
    faults = tuple(parse_fault(text) for text in args.fault)
    for text, fault in zip(args.fault, faults, strict=True):
        if fault.imu > args.imus:
            raise BadInput(f"fault {text!r}: there is no IMU {fault.imu}; use --imus {fault.imu}")
    vision: tuple[Stream, ...] = ()
    if args.vision is not None:
        source = VisionOptions(
            args.vision, args.vision_rate_hz, args.vision_delay_ms * 1e-3, args.vision_drop_out
        )
        vision = (vision_stream(source, args.seed),)
    return AutopilotOptions(
        scenario=scenario(args.scenario),
        personality=personality(args.autopilot),
        seed=args.seed,
        faults=faults,
        sensor=MPU_9250._replace(gyro_bias_deg_s=tuple(args.gyro_bias_deg_s)),
        imus=args.imus,
        extra_streams=vision,
        boot_text=args.boot_text,
        line_bytes_per_s=None if args.baud is None else args.baud / BITS_PER_BYTE_ON_A_LINE,
        wrong=_wrong(args),
        asks_to_arm=args.arm_authorization,
        logs=tuple(_log(path) for path in args.log),
        has_files=not args.no_ftp,
        parameters={} if args.parameters is None else read_parameters(args.parameters),
    )


def _log(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BadInput(f"--log: {path}: {error.strerror}") from error


def _wrong(args: argparse.Namespace) -> Miscalibration:
    """The requested miscalibration, within the range of a sensor."""
    wrong = Miscalibration(
        tuple(args.compass_offset),
        args.compass_turned,
        tuple(args.compass_scale),
        tuple(args.motor_field),
        tuple(args.accelerometer_scale),
        tuple(args.accelerometer_offset),
        tuple(args.gyro_offset),
        tuple(args.board),
    )
    fields = (*wrong.compass_offset_mg, *wrong.motor_field_mg)
    scales = (*wrong.compass_scale, *wrong.accelerometer_scale)
    if not all(abs(value) <= MAX_FIELD_MG for value in fields):
        raise BadInput(f"a field: expected numbers within +-{MAX_FIELD_MG:g} mG")
    if not all(0.5 <= value <= 2.0 for value in scales):
        raise BadInput("a scale: expected numbers from 0.5 to 2")
    offsets = (*wrong.accelerometer_offset_m_s2, *wrong.gyro_offset_deg_s, *wrong.board_deg)
    if not all(abs(value) <= MAX_OFFSET for value in offsets):
        raise BadInput(f"an offset or an angle: expected numbers within +-{MAX_OFFSET:g}")
    if not abs(wrong.compass_turned_deg) <= 360.0:
        raise BadInput("--compass-turned: expected a number within +-360")
    return wrong


def _signing(key_file: Path) -> AutopilotSigning:
    key = read_signing_key(key_file)
    stamp = LocalStamp(time.time_ns)
    return AutopilotSigning(Signer(key, SIGNING_LINK_ID, stamp), SignatureChecker(key, stamp))

"""``h2nav setup``: finds the autopilot, writes and checks the configuration, starts the service."""

import argparse
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps import check_config
from h2nav.apps import configuration as configurations
from h2nav.apps.json_output import print_json
from h2nav.apps.log_progress import count_bar
from h2nav.errors import BadInput, TaskFailed
from h2nav.host import system_unit
from h2nav.links.link_scan import Hearing, LinkPlace, Speaker, scan, serial_place
from h2nav.links.link_urls import SerialUrl, parse_link_url
from h2nav.links.serial_ports import PortListing, listed_ports, port_at
from h2nav.service.autopilot import Identity
from h2nav.wire.readers import message_name

# Usual outputs of QGroundControl and MAVProxy, PX4's onboard one, a second output; SITL, BlueOS.
USUAL_URLS = (
    "udpin:0.0.0.0:14550",
    "udpin:0.0.0.0:14540",
    "udpin:0.0.0.0:14551",
    "tcp:127.0.0.1:5760",
    "tcp:127.0.0.1:5777",
)
SERVICE_CONFIG = Path("/etc/h2nav/config.yaml")
USER_CONFIG = Path("h2nav.yaml")
SERVICE_LOGS, USER_LOGS = "/var/log/h2nav", "~/h2nav-logs"
SERVICE_TOKEN, USER_TOKEN = "/var/lib/h2nav/page-token", "~/h2nav-logs/page-token"
# A line up to this rate counts as a telemetry radio, which others share.
RADIO_BAUD = 57600
# An attitude needs some 50 samples a second; two IMUs at 100 Hz need this rate.
GOOD_BAUD = 230400
SHOWN_STREAMS = 6
_CLOSING = """\
Serial ports are tried at the usual baud rates until frames pass their checksum; UDP and TCP at the
usual ports. Only version requests to detected autopilots are sent (and a heartbeat to a silent USB
port). Without a terminal and without --yes nothing is written."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _CLOSING
    parser.add_argument(
        "--connect",
        action="append",
        default=[],
        metavar="URL",
        help="look only here: a device (all baud rates), or a connection URL; may be repeated",
    )
    parser.add_argument(
        "--system-id", type=int, metavar="N", help="which one, where there are several autopilots"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="CONFIG.yaml",
        help=f"file to write (default: {SERVICE_CONFIG} for root, else ./{USER_CONFIG})",
    )
    parser.add_argument(
        "--fetch-log",
        action="store_true",
        help="fetch the autopilot's own log after each flight, for the review",
    )
    parser.add_argument("--yes", action="store_true", help="take the defaults, ask nothing")
    parser.add_argument("--force", action="store_true", help="replace an existing file")
    parser.add_argument("--no-service", action="store_true", help="leave systemd alone")
    parser.add_argument("--json", action="store_true", help="print what was found as JSON")


class Choice(NamedTuple):
    """An autopilot and its link."""

    hearing: Hearing  # the scan that detected it
    speaker: Speaker  # the autopilot


class Flights(NamedTuple):
    """What becomes of a flight after landing."""

    reviews: bool = True  # it is reviewed
    fetches_log: bool = False  # the autopilot's own log is fetched; over no telemetry radio


def run(args: argparse.Namespace) -> int:
    """Scans, reports, writes, starts; returns 0 if there is an autopilot."""
    output = args.output or (SERVICE_CONFIG if os.geteuid() == 0 else USER_CONFIG)
    replaces = args.force or check_config.is_example(output)  # such as that of the Debian package
    if output.exists() and not replaces and (args.yes or args.output):
        raise BadInput(f"{output}: exists; --force replaces it")
    ports, urls = _wanted(args.connect)
    places = [serial_place(port.path) for port in ports] + [LinkPlace(url, (url,)) for url in urls]
    with count_bar("listening", "ports") as progress:
        hearings = scan(places, progress)
    choices = [Choice(hearing, each) for hearing in hearings for each in hearing.speakers]
    if args.json:
        print_json(_document(ports, hearings))
    else:
        print("\n".join(_report(ports, hearings)))
    if not choices:
        raise TaskFailed(_nothing_heard(hearings))
    asks = sys.stdin.isatty() and not args.yes and not args.json
    if not asks and not args.yes:
        return 0
    chosen = _pick(_with_system(choices, args.system_id), asks)
    if chosen is None:
        return 0
    flights = Flights(fetches_log=args.fetch_log)
    if asks:
        flights = _asked_about_flights(flights)
    if not _write(output, chosen, choices, replaces, asks, flights):
        return 0
    if not args.no_service and os.geteuid() == 0 and output == SERVICE_CONFIG:
        _offer_service(asks)
    else:
        print(f"start it: h2nav run -c {output}")
    return 0


def _wanted(connect: Sequence[str]) -> tuple[list[PortListing], list[str]]:
    """Places to scan: the user's, otherwise all."""
    if not connect:
        return listed_ports(), list(USUAL_URLS)
    ports, urls = [], []
    for text in connect:
        if text.startswith("/") and not re.search(r"[:,][0-9]+$", text):
            ports.append(port_at(text))
            continue
        parse_link_url(text)
        urls.append(text)
    return ports, urls


def _report(ports: Sequence[PortListing], hearings: Sequence[Hearing]) -> list[str]:
    """The results, place by place; closed network ports are only counted."""
    by_name = {port.path: port for port in ports}
    lines = []
    for hearing in hearings:
        port = by_name.get(hearing.place.name)
        if port is None and not hearing.bytes_in and not _is_taken(hearing):
            continue
        title = hearing.place.name if port is None else _title(port)
        lines.append(f"{title}: {_what(hearing)}")
        lines += [f"    {line}" for each in hearing.speakers for line in _about(each)]
        lines += [f"    {line}" for line in (port.obstacles if port is not None else ())]
        lines += [f"    {line}" for line in _advice(hearing)]
    if not ports:
        lines.insert(0, "no serial ports")
    return lines


def _title(port: PortListing) -> str:
    words = [port.path]
    if port.device != port.path:
        words.append(f"({port.device})")
    if port.description:
        words.append(f"[{port.description}]")
    return " ".join(words)


def _what(hearing: Hearing) -> str:
    if hearing.frames:
        target = parse_link_url(hearing.url)
        rate = f" at {target.baud} baud" if isinstance(target, SerialUrl) else ""
        return f"MAVLink{rate}" + ("" if hearing.speakers else ", but no autopilot's heartbeat")
    if hearing.error:
        return hearing.error
    if hearing.is_junk:
        bauds = [parse_link_url(url) for url in hearing.place.urls]
        tried = ", ".join(str(each.baud) for each in bauds if isinstance(each, SerialUrl))
        return f"{hearing.bytes_in} bytes, but no MAVLink" + (f" at {tried} baud" if tried else "")
    return "silent"


def _about(speaker: Speaker) -> list[str]:
    firmware = f", firmware {speaker.firmware}" if speaker.firmware is not None else ""
    streams = sorted(speaker.rates_hz.items(), key=lambda each: -each[1])
    shown = [f"{message_name(number)} {rate:.0f} Hz" for number, rate in streams if rate >= 0.5]
    more = f" and {len(shown) - SHOWN_STREAMS} more" if len(shown) > SHOWN_STREAMS else ""
    armed = ", armed" if speaker.heartbeat.is_armed else ""
    return [
        f"{identity(speaker).description}{firmware}{armed}",
        f"streams: {', '.join(shown[:SHOWN_STREAMS])}{more}",
    ]


def _advice(hearing: Hearing) -> list[str]:
    """Possible improvements of a link that works."""
    target = parse_link_url(hearing.url or hearing.place.urls[0])
    if not hearing.speakers or not isinstance(target, SerialUrl) or target.baud >= GOOD_BAUD:
        return []
    return [
        f"{target.baud} baud carries few IMU samples: set SERIALn_BAUD (ArduPilot) or SER_*_BAUD "
        "(PX4) to 921600 unless this is a telemetry radio"
    ]


def identity(speaker: Speaker) -> Identity:
    """The autopilot's identity from its heartbeat, as the daemon shows it."""
    return Identity(*speaker.address, speaker.heartbeat.autopilot, speaker.heartbeat.vehicle_type)


def _is_taken(hearing: Hearing) -> bool:
    return "another program" in hearing.error


def _nothing_heard(hearings: Sequence[Hearing]) -> str:
    remedy = "is the autopilot powered, is its port set to MAVLink (ArduPilot: SERIALn_PROTOCOL 2)?"
    if any(hearing.is_junk for hearing in hearings):
        remedy = "bytes came, but no MAVLink: an unusual baud rate, or another protocol"
    elif any(_is_taken(hearing) for hearing in hearings):
        remedy = "some ports are held by other programs, see above"
    return f"no autopilot detected at {len(hearings)} places: {remedy}"


def _with_system(choices: Sequence[Choice], system_id: int | None) -> list[Choice]:
    """Those that the user may mean; TaskFailed where there is none."""
    meant = [each for each in choices if system_id in (None, each.speaker.address[0])]
    if not meant:
        found = ", ".join(sorted({str(each.speaker.address[0]) for each in choices}))
        raise TaskFailed(f"no autopilot with system id {system_id} was heard, but {found}")
    return meant


def _pick(choices: Sequence[Choice], asks: bool) -> Choice | None:
    """Selects the autopilot: the only one, or the user's choice.

    Raises:
        TaskFailed: there are several, and no terminal for a question.
    """
    vehicles = {identity(choice.speaker) for choice in choices}
    ordered = sorted(choices, key=_preference)
    if not asks:
        if len(vehicles) > 1:
            found = ", ".join(
                f"{identity(each.speaker).description} at {each.hearing.url}" for each in ordered
            )
            remedy = "name the link with --connect URL, or the vehicle with --system-id N"
            raise TaskFailed(f"several autopilots: {found}; {remedy}")
        return ordered[0]
    if len(ordered) == 1:
        return ordered[0]
    for number, each in enumerate(ordered, 1):
        print(f"{number}) {identity(each.speaker).description} at {each.hearing.url}")
    answer = _answer(f"which one? [1-{len(ordered)}, Enter = 1, q = none] ") or "1"
    if not answer.isdecimal() or not 1 <= int(answer) <= len(ordered):
        return None
    return ordered[int(answer) - 1]


def _preference(choice: Choice) -> tuple[int, float]:
    """Sort key: serial lines, which are not shared, come first; then faster streams."""
    is_serial = isinstance(parse_link_url(choice.hearing.url), SerialUrl)
    return (0 if is_serial else 1, -sum(choice.speaker.rates_hz.values()))


def _write(
    output: Path,
    chosen: Choice,
    choices: Sequence[Choice],
    replaces: bool,
    asks: bool,
    flights: Flights,
) -> bool:
    """Writes and checks the configuration; returns False if the user declines."""
    if asks and not _agrees(f"write {output}?"):
        return False
    keeps = output.exists() and not replaces
    if keeps and not (asks and _agrees(f"{output} exists; replace it?")):
        return False
    others = [each for each in choices if each.hearing is chosen.hearing]
    text = configuration_text(chosen, len(others) > 1, flights)
    if output == SERVICE_CONFIG:
        os.umask(0o022)  # the daemon's user has to read it and the unit
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{output}: {error.strerror}; name another file with -o") from error
    checked = check_config.checked(output)
    for line in configurations.warnings(checked):
        print(f"h2nav: {output}: {line}", file=sys.stderr)
    print(f"{output}: written and checked")
    return True


def configuration_text(chosen: Choice, is_shared: bool, flights: Flights) -> str:
    """The example for this kind of link, with this link's URL.

    Args:
        is_shared: other autopilots are on the same link, so that this one has to be named.
        flights: what becomes of them.
    """
    target = parse_link_url(chosen.hearing.url)
    is_px4 = chosen.speaker.heartbeat.autopilot == mavlink.MAV_AUTOPILOT_PX4
    kind = "serial" if isinstance(target, SerialUrl) else "udp"
    name = f"{'px4' if is_px4 else 'ardupilot'}-{kind}"
    if isinstance(target, SerialUrl) and target.baud <= RADIO_BAUD:
        name = "telemetry-radio"
    text = re.sub(
        r"(?m)^  url: .*$", lambda _: f"  url: {chosen.hearing.url}", check_config.example(name)
    )
    if is_shared:
        line = f"\nautopilot:\n  system_id: {chosen.speaker.address[0]}\n"
        text = re.sub(r"(?m)^\nautopilot:\n", lambda _: line, text)
        if "system_id:" not in text:
            text += line
    if os.geteuid() != 0:
        text = text.replace(SERVICE_LOGS, USER_LOGS).replace(SERVICE_TOKEN, USER_TOKEN)
    if flights.fetches_log:
        text = text.replace("  fetch_log: false ", "  fetch_log: true  ")
    if not flights.reviews:
        text = text if "\nflights:\n" in text else text + "\nflights:\n"
        text = text.replace("\nflights:\n", "\nflights:\n  review: false\n")
    return text


def _asked_about_flights(flights: Flights) -> Flights:
    reviews = _agrees("review every flight after landing, at idle priority?")
    fetches = reviews and (
        flights.fetches_log
        or _agrees("fetch the autopilot's own log for it (while disarmed)?", is_usual=False)
    )
    return Flights(reviews, fetches)


def _offer_service(asks: bool) -> None:
    if not system_unit.is_booted():
        print(f"no systemd here; start it: h2nav run -c {SERVICE_CONFIG}")
        return
    if asks and not _agrees("install and start the service h2nav?"):
        return
    try:
        system_unit.install_and_start()
    except OSError as error:
        raise TaskFailed(f"{error.filename}: {error.strerror}") from error
    print("h2nav.service runs; `h2nav status` shows its state, `journalctl -fu h2nav` follows it")


def _agrees(question: str, *, is_usual: bool = True) -> bool:
    answer = _answer(f"{question} [{'Y/n' if is_usual else 'y/N'}] ").lower()
    return answer in ("y", "yes") or (is_usual and not answer)


def _answer(question: str) -> str:
    """What the user types; the end of the input, Ctrl-D, is as Ctrl-C."""
    try:
        return input(question).strip()
    except EOFError:
        raise KeyboardInterrupt from None


def _document(ports: Sequence[PortListing], hearings: Sequence[Hearing]) -> dict[str, Any]:
    by_name = {port.path: port for port in ports}
    return {"places": [_place_document(each, by_name.get(each.place.name)) for each in hearings]}


def _place_document(hearing: Hearing, port: PortListing | None) -> dict[str, Any]:
    return {
        "place": hearing.place.name,
        "url": hearing.url if hearing.frames else None,
        "device": None if port is None else port.device,
        "description": "" if port is None else port.description,
        "obstacles": [] if port is None else list(port.obstacles),
        "bytes_in": hearing.bytes_in,
        "frames": hearing.frames,
        "error": hearing.error,
        "autopilots": [
            {
                "system_id": each.address[0],
                "component_id": each.address[1],
                "description": identity(each).description,
                "firmware": None if each.firmware is None else str(each.firmware),
                "is_armed": each.heartbeat.is_armed,
                "rates_hz": {
                    message_name(number): round(rate, 1) for number, rate in each.rates_hz.items()
                },
            }
            for each in hearing.speakers
        ],
    }

"""`h2nav check`: checks a vehicle on the ground before arming."""

import argparse
import dataclasses
import io
from typing import Any

from h2nav.apps import configuration
from h2nav.apps.configuration import Configuration
from h2nav.apps.console import Console
from h2nav.apps.json_output import print_json
from h2nav.apps.session import Session
from h2nav.errors import BadInput
from h2nav.host.stop_signals import StopSignals
from h2nav.integrity.preflight import NOT_READ, Item
from h2nav.links.link_urls import FORMS
from h2nav.service.service import Service
from h2nav.service.settings import OutputSettings

MAX_CHECK_S = 3600.0
_CLOSING = """\
Exit status: 0 no check failed, of those that were possible; 1 a check failed, or none was possible;
2 bad input. The vehicle must stand still, disarmed. It receives requests for messages and nothing
else: this neither arms nor disarms, and a status of 0 is no guarantee (docs/preflight.md)."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _CLOSING
    parser.add_argument(
        "--connect", required=True, metavar="URL", help=f"link to the autopilot: {FORMS}"
    )
    parser.add_argument(
        "--seconds", type=float, default=30.0, metavar="S", help="how long to listen (default: 30)"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    if not 1.0 <= args.seconds <= MAX_CHECK_S:
        raise BadInput(f"--seconds: expected a number from 1 to {MAX_CHECK_S:g}")
    console = Console(stream=io.StringIO())
    with (
        StopSignals().installed() as stop,
        Session(_listening(args.connect), console) as session,
    ):
        session.run(stop, args.seconds)
        if stop.stopped:  # what was heard so far says nothing of the rest
            raise KeyboardInterrupt
        found = verdict_of(session.service)
    if args.json:
        print_json(found)
    else:
        _show(found)
    return 0 if found["ok"] else 1


def verdict_of(service: Service) -> dict[str, Any]:
    """The result, in the form of the JSON document."""
    faults, judged = service.before_arming
    return {
        "ok": bool(judged) and not service.reasons_not_to_arm,
        "vehicle": service.bound_to,
        "armed": service.health.armed,
        "faults": [
            {
                "item": fault.item.value,
                "sensor": fault.sensor,
                "size": fault.size,
                "unit": fault.unit,
                "limit": fault.limit,
                "text": fault.text,
            }
            for fault in faults
        ],
        "reasons": list(service.reasons_not_to_arm),
        "judged": [item.value for item in Item if item in judged],
        "not_judged": [item.value for item in Item if item not in judged],
    }


def _listening(url: str) -> Configuration:
    """The default configuration without a log and without outputs."""
    quiet = OutputSettings(
        attitude_rate_hz=0.0,
        attitude_quaternion_rate_hz=0.0,
        estimator_status_rate_hz=0.0,
        status_text=False,
    )
    chosen = Configuration()
    return dataclasses.replace(chosen, link=configuration.LinkSettings(url), output=quiet)


def _show(found: dict[str, Any]) -> None:
    if not found["vehicle"]:
        print("no autopilot was detected")
    elif found["armed"]:
        print("the vehicle is armed: no check was made")
    elif not found["judged"]:
        print("no check was possible: the vehicle has to stand still and send its IMU's messages")
    limits = {
        fault["text"]: f" (at most {fault['limit']:.3g})"
        for fault in found["faults"]
        if fault["unit"] != NOT_READ
    }
    for reason in found["reasons"]:
        print(f"wrong: {reason}{limits.get(reason, '')}")
    if found["ok"]:
        print(f"nothing wrong with: {', '.join(found['judged'])}")
    if found["not_judged"]:
        print(f"not judged: {', '.join(found['not_judged'])}")

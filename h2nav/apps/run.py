"""``h2nav run``: the daemon."""

import argparse
import dataclasses
import os
from pathlib import Path

from h2nav.apps import configuration
from h2nav.apps.configuration import Configuration
from h2nav.apps.console import Console
from h2nav.apps.json_output import print_json
from h2nav.apps.session import Session
from h2nav.errors import BadInput
from h2nav.host.runtime_folder import own_socket
from h2nav.host.stop_signals import StopSignals
from h2nav.links.link_urls import FORMS

USUAL_ADDRESS = "127.0.0.1:8080"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    parser.add_argument(
        "-c", "--config", type=Path, metavar="CONFIG.yaml", help="configuration file (see configs/)"
    )
    parser.add_argument("--connect", metavar="URL", help=f"link to the autopilot: {FORMS}")
    parser.add_argument("--log-dir", metavar="DIR", help="folder of the MCAP logs")
    add_live_argument(parser)
    parser.add_argument("--json", action="store_true", help="events on standard output")
    parser.add_argument(
        "--schema", action="store_true", help="print the JSON Schema of the events instead"
    )


def add_live_argument(parser: argparse.ArgumentParser) -> None:
    """Declares the option ``--live``."""
    parser.add_argument(
        "--live",
        nargs="?",
        const=USUAL_ADDRESS,
        metavar="HOST:PORT",
        help=f"show a status page, metrics and a Foxglove WebSocket (default: {USUAL_ADDRESS})",
    )


def run(args: argparse.Namespace) -> int:
    """Runs until SIGTERM or SIGINT, then flushes the log; returns 0."""
    if args.schema:
        from h2nav.apps.event_schema import event_schema

        print_json(event_schema(), indent=2)
        return 0
    chosen = _configuration(args)
    console = Console(events_as_json=args.json)
    with (
        StopSignals().installed() as stop,
        Session(chosen, console, own_socket=own_socket()) as session,
    ):
        session.run(stop)
    return 0


def _configuration(args: argparse.Namespace) -> Configuration:
    """The file, overridden by the command line."""
    if args.config is None and args.connect is None:
        raise BadInput("run: give -c CONFIG.yaml or --connect URL; --help shows both")
    chosen = configuration.read(args.config) if args.config else Configuration()
    if args.connect is not None:
        chosen = dataclasses.replace(chosen, link=configuration.LinkSettings(args.connect))
    if args.log_dir is not None:
        log = dataclasses.replace(chosen.log, folder=args.log_dir)
        chosen = configuration.at_home(dataclasses.replace(chosen, log=log), "run")
    if args.live is not None:
        live = dataclasses.replace(chosen.live, address=args.live)
        chosen = dataclasses.replace(chosen, live=live)
    runtime_folder = os.environ.get("RUNTIME_DIRECTORY")  # of systemd
    if runtime_folder and not chosen.events.socket:
        events = configuration.EventSettings(f"{runtime_folder}/events")
        chosen = dataclasses.replace(chosen, events=events)
    complaints = configuration.contradictions(chosen)
    if complaints:
        raise BadInput(*complaints)
    return chosen

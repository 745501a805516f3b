"""`h2nav fleet`: the reviews of thousands of flights, on all cores of this machine or a cluster."""

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from h2nav import __version__
from h2nav.apps import extras, playback
from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput

if TYPE_CHECKING:
    from h2nav.fleet.running import Outcome

MEMORY_MIB = 600
LONGEST_S = 1800.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument(
        "sources",
        nargs="+",
        metavar="SOURCE",
        help="recordings: files, folders, patterns, or addresses such as s3://bucket/logs",
    )
    parser.add_argument(
        "-o", "--output", required=True, metavar="DIR", help="folder or address of the results"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="an existing Dask cluster, such as tcp://host:8786"
    )
    parser.add_argument(
        "--workers", type=int, metavar="N", help="processes of our own (default: one per core)"
    )
    parser.add_argument(
        "--memory-mb",
        type=int,
        default=MEMORY_MIB,
        metavar="MB",
        help=f"of each worker; a flight that needs more is given up (default: {MEMORY_MIB})",
    )
    parser.add_argument(
        "--longest-s",
        type=float,
        default=LONGEST_S,
        metavar="S",
        help=f"time for one flight; what takes longer is given up (default: {LONGEST_S:g})",
    )
    playback.add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.epilog = (
        "DIR gets index.html, flights.parquet, findings.parquet and reviews/. Flights whose results "
        "are in DIR already are not reviewed again, so a run that was ended goes on when it is "
        "started again. Broken recordings become rows that say why."
    )

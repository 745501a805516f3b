"""``h2nav serve``: a folder of flights in the browser, without any vehicle."""

import argparse
import asyncio
import contextlib
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from h2nav.apps import extras
from h2nav.apps.browser import open_page
from h2nav.apps.page_token import new_token
from h2nav.apps.review_process import ReviewOutcome, ReviewProcess
from h2nav.apps.reviewer import ReviewJob
from h2nav.errors import BadInput, TaskFailed
from h2nav.flights.folder import REVIEWS, FlightFolder
from h2nav.links.listen_address import ListenAddress, parse_listen_address
from h2nav.log.folder import MIB

if TYPE_CHECKING:  # needs the extra
    from h2nav.live.flights_site import FlightsSite

USUAL_ADDRESS = "127.0.0.1:8080"
LARGEST = 1_000_000  # of a limit, MiB or minutes: what the system can count
LOOK_S = 0.2
# Between two looks at a folder in which every flight has a review.
FOLDER_S = 10.0
_CLOSING = """\
Recordings anywhere below FOLDER are listed: .mcap of h2nav, .tlog, .bin, .log, .ulg. Those without
a review are reviewed, newest first, one at a time and at idle priority, into FOLDER/reviews. The
folder of the daemon's logs can be served while it runs. Ctrl-C ends the command; a review that it
interrupts is taken up again by the next one.

The address that is printed holds a token; who opens it may upload and delete."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _CLOSING
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the recordings")
    parser.add_argument(
        "--reviews", type=Path, metavar="DIR", help=f"of the reviews (FOLDER/{REVIEWS})"
    )
    parser.add_argument(
        "--address",
        default=USUAL_ADDRESS,
        metavar="HOST:PORT",
        help=f"to listen on ({USUAL_ADDRESS}); port 0 = any free one",
    )
    parser.add_argument("--no-review", action="store_true", help="show what there is, no more")
    parser.add_argument(
        "--read-only", action="store_true", help="no uploads and no deletions, whoever asks"
    )
    parser.add_argument(
        "--upload-mb", type=int, default=1024, metavar="N", help="largest upload (1024 MiB)"
    )
    parser.add_argument("--open", action="store_true", help="open the list in the browser")
    parser.add_argument(
        "--memory-mb", type=int, default=1024, metavar="N", help="memory of a review (1024 MiB)"
    )
    parser.add_argument(
        "--minutes", type=int, default=60, metavar="N", help="processor time of a review (60 min)"
    )
    parser.add_argument(
        "--review-priority",
        choices=("idle", "normal"),
        default="idle",
        help="normal: review although other programs keep all processors busy (idle)",
    )


def run(args: argparse.Namespace) -> int:
    """Serves until it is interrupted; returns 0."""
    if not all(1 <= most <= LARGEST for most in (args.memory_mb, args.minutes, args.upload_mb)):
        raise BadInput(f"--memory-mb, --minutes and --upload-mb: expected 1 to {LARGEST}")
    try:
        address = parse_listen_address(args.address)
    except BadInput as error:
        raise BadInput(*(f"--address: {line}" for line in error.lines)) from None
    if not args.folder.is_dir():
        raise BadInput(f"{args.folder}: no such folder; name a folder of recordings")
    extras.require("live", "serve", "tornado", "prometheus_client")
    asyncio.run(_serve(args, address))
    return 0


async def _serve(args: argparse.Namespace, address: ListenAddress) -> None:
    from h2nav.live.flights_site import FlightsSite, SiteRights
    from h2nav.live.server import PageServer

    folder = FlightFolder(args.folder, args.reviews)
    token = "" if args.read_only else new_token()
    site = FlightsSite(folder, SiteRights(token, args.upload_mb * MIB))
    stopped = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, stopped.set)
    try:
        server = PageServer(None, address.host, address.port, site)
    except OSError as error:
        raise TaskFailed(
            f"--address: {address}: {error.strerror or error}; choose another"
        ) from None
    url = f"http://{address._replace(port=server.port)}/flights"
    if token:
        url += f"#token={token}"
    print(url, flush=True)
    if args.open:
        open_page(url)
    reviewing = asyncio.create_task(_review(site, args))
    try:
        await stopped.wait()
    finally:
        reviewing.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await reviewing
        server.close()
        site.close()


async def _review(site: "FlightsSite", args: argparse.Namespace) -> None:
    """Reviews what has no review, for as long as it is not cancelled."""
    if args.no_review:
        return
    folder = site.folder
    root, reviews = folder.root.resolve(), folder.reviews.resolve()
    is_idle = args.review_priority == "idle"
    job = ReviewJob(str(root), str(reviews), args.memory_mb, args.minutes, is_idle=is_idle)
    process = ReviewProcess(job)
    told = ""
    try:
        while True:
            outcome = await _outcome(process)
            line = _line(outcome)
            if line and line != told:
                print(f"h2nav: {line}", file=sys.stderr)
            told = line if outcome.trouble else ""
            if outcome.did_nothing or outcome.trouble:
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(site.changed.wait(), FOLDER_S)
                site.changed.clear()
    finally:
        process.stop()


async def _outcome(process: ReviewProcess) -> ReviewOutcome:
    """What comes of a review that begins now."""
    try:
        process.start()
    except OSError as error:
        return ReviewOutcome(trouble=error.strerror or str(error))
    while (outcome := process.outcome()) is None:
        await asyncio.sleep(LOOK_S)
    return outcome


def _line(outcome: ReviewOutcome) -> str:
    if outcome.trouble:
        return f"not reviewed: {outcome.trouble}"
    if outcome.did_nothing:
        return ""
    return f"{outcome.name}: {outcome.error or outcome.text}"

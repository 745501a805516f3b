"""``h2nav demo``: runs fake autopilot and daemon over loopback; error table and log."""

import argparse
import contextlib
import math
import os
import select
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from h2nav.apps.browser import open_page
from h2nav.apps.configuration import (
    Configuration,
    LinkSettings,
    LiveSettings,
    LogSettings,
    contradictions,
)
from h2nav.apps.console import Console
from h2nav.apps.json_output import print_json
from h2nav.apps.order_input import QUIT, OrderInput, order_input
from h2nav.apps.own_process import start_module
from h2nav.apps.panel import Sight
from h2nav.apps.run import add_live_argument
from h2nav.apps.session import Session
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.errors import BadInput, TaskFailed
from h2nav.host.stop_signals import StopSignals
from h2nav.integrity.findings import Severity
from h2nav.recordings.reference import ErrorTable, Reference
from h2nav.service.records import HealthRecord
from h2nav.service.settings import AutopilotSettings
from h2nav.sim.orders import KEYS, key_table
from h2nav.sim.scenarios import SCENARIOS
from h2nav.wire.deframer import Frame

DEFAULT_SECONDS = 20.0
# Scenarios with visible motion.
LIVE_SECONDS = 600.0
LONGEST_SECONDS = 3600.0
# The demo fails above this error: something is broken then.
WORST_TOTAL_DEG = 5.0
# The fake autopilot stops by itself soon after the demo, should the demo be killed.
SPARE_S = 10.0
PATIENCE_S = 5.0
LONGEST_ANSWER = 65536


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    parser.add_argument(
        "--seconds",
        type=float,
        help=f"how long to fly (default {DEFAULT_SECONDS:g}, with --live {LIVE_SECONDS:g})",
    )
    parser.add_argument(
        "--log-dir", type=Path, metavar="DIR", help="folder of the log (default: a temporary one)"
    )
    parser.add_argument(
        "--scenario",
        choices=SCENARIOS,
        default="flight",
        metavar="NAME",
        help=f"scenario to fly: {', '.join(SCENARIOS)} (default: flight)",
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of the simulated sensors")
    add_live_argument(parser)
    parser.add_argument("--open", action="store_true", help="open the page in the browser")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Flies the demo; raises TaskFailed if the daemon did not work."""
    if args.seconds is None:
        args.seconds = DEFAULT_SECONDS if args.live is None else LIVE_SECONDS
    if not 0.0 < args.seconds <= LONGEST_SECONDS:
        raise BadInput(f"--seconds: expected a number above 0 up to {LONGEST_SECONDS:.0f}")
    if args.seed < 0:
        raise BadInput("--seed: expected 0 or more")
    configuration = _configuration(args)
    onlooker = _Onlooker(opens_page=args.open)
    print(f"flying scenario {args.scenario!r} for {args.seconds:g} s", file=sys.stderr)
    with order_input(KEYS | {"q": QUIT}) as orders, StopSignals().installed() as stop:
        if orders.has_keys:
            print(key_table(), file=sys.stderr)
        with Session(configuration, onlooker) as session:
            session.open()
            onlooker.session = session
            with _fake_autopilot(session.link.local_port, args) as autopilot:
                onlooker.user = _User(orders, autopilot, stop)
                session.run(stop, args.seconds)
            health = session.service.health
    user = onlooker.user
    if stop.stopped and not user.has_quit:
        raise KeyboardInterrupt
    table = onlooker.reference.table()
    log = None if session.recorder is None else session.recorder.path
    # With injected faults the result is the user's business.
    complaint = "" if user.has_ordered else _complaint(health, table)
    _show(args, health, table, log, ok=not complaint)
    if complaint:
        raise TaskFailed(f"demo: {complaint}")
    return 0


def _configuration(args: argparse.Namespace) -> Configuration:
    """The daemon's configuration."""
    if args.open and args.live is None:
        raise BadInput("--open: without --live there is no page; give both")
    folder = args.log_dir or Path(tempfile.mkdtemp(prefix="h2nav-demo-"))
    configuration = Configuration(
        link=LinkSettings("udpin:127.0.0.1:0"),
        autopilot=AutopilotSettings(simulation_truth=True),
        log=LogSettings(folder=str(folder)),
        live=LiveSettings(args.live or ""),
    )
    complaints = contradictions(configuration)
    if complaints:
        raise BadInput(*complaints)
    return configuration


class _Onlooker(Console):
    """Displays the daemon, collects the error table, and passes orders on.

    Args:
        opens_page: in the browser, once it is served.
    """

    def __init__(self, *, opens_page: bool) -> None:
        super().__init__()
        self._opens_page = opens_page
        self.session: Session | None = None
        self.reference = Reference()
        self.message_ids = self.reference.message_ids
        self.user: _User | None = None

    def frame(self, t_ns: int, frame: Frame) -> None:
        self.reference.frame(t_ns, frame)

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        super().estimate(t_ns, estimate, late_ns)
        self.reference.estimate(t_ns, estimate)

    def status(self, t_ns: int, look: Callable[[int], Sight]) -> None:
        super().status(t_ns, look)
        if self._opens_page and self.session is not None and self.session.page_url:
            self._opens_page = False
            open_page(self.session.page_url)
        if self.user is not None:
            for answer in self.user.serve():
                self.notice(t_ns, Severity.NOTICE, answer)


class _FakeAutopilot:
    """The fake autopilot as a separate process, as a real one is."""

    def __init__(self, port: int | None, args: argparse.Namespace, said: IO[bytes]) -> None:
        words = ["--connect", f"udpout:127.0.0.1:{port}", "--seconds", f"{args.seconds + SPARE_S}"]
        words += ["--scenario", args.scenario, "--seed", str(args.seed)]
        self._said = said
        self._heard = 0
        self._process = start_module(
            "h2nav",
            "fake-autopilot",
            *words,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=said,
        )

    def check(self) -> None:
        """Raises TaskFailed with its last output if it has ended early."""
        status = self._process.poll()
        if status is not None:
            self._said.seek(0)
            words = self._said.read().decode(errors="replace").strip().rpartition("\n")[2]
            raise TaskFailed(f"demo: the fake autopilot ended with status {status}: {words}")

    def order(self, line: str) -> None:
        """Passes an order on."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # `check` reports what happened to it
            self._process.stdin.write(f"{line}\n".encode())
            self._process.stdin.flush()

    def answers(self) -> list[str]:
        """Returns its output since the last call, in whole lines."""
        # Without moving the file's position, which the other process shares.
        new = os.pread(self._said.fileno(), LONGEST_ANSWER, self._heard)
        whole = new[: new.rfind(b"\n") + 1]
        self._heard += len(whole)
        return whole.decode(errors="replace").splitlines()

    def end(self) -> None:
        """Ends the process, gently first."""
        self._process.terminate()
        try:
            self._process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


class _User:
    """The orders of a user at the terminal, if there is one."""

    def __init__(self, orders: OrderInput, autopilot: _FakeAutopilot, stop: StopSignals) -> None:
        self._orders = orders
        self._autopilot = autopilot
        self._stop = stop
        self.has_ordered = False  # an order was given
        self.has_quit = False  # the user wants to end the demo

    def serve(self) -> list[str]:
        """Passes orders on and returns the replies; raises TaskFailed if the autopilot ended."""
        self._autopilot.check()
        keyboard = self._orders.fileno()
        if keyboard is not None and select.select([keyboard], [], [], 0)[0]:
            for line in self._orders.read():
                self._pass_on(line)
        return self._autopilot.answers()

    def _pass_on(self, line: str) -> None:
        if line.strip() == QUIT:
            self.has_quit = True
            self._stop.stop()
        else:
            self.has_ordered = True
            self._autopilot.order(line)


@contextmanager
def _fake_autopilot(port: int | None, args: argparse.Namespace) -> Iterator[_FakeAutopilot]:
    """A fake autopilot that ends with the block, whatever happens in it."""
    with tempfile.TemporaryFile() as said:
        autopilot = _FakeAutopilot(port, args, said)
        try:
            yield autopilot
        finally:
            autopilot.end()


def _complaint(health: HealthRecord, table: ErrorTable) -> str:
    """What went wrong, in one line; empty if nothing did."""
    if table.compared == 0:
        reason = f" ({health.reason})" if health.reason else ""
        return (
            f"no attitude that could be compared with the truth: the service is {health.state}"
            f"{reason} after {health.samples_used} samples; fly longer with --seconds"
        )
    if not math.isfinite(table.total) or table.total >= WORST_TOTAL_DEG:
        return f"the attitude is off by {table.total:.1f} deg; expected below {WORST_TOTAL_DEG:g}"
    return ""


def _show(
    args: argparse.Namespace, health: HealthRecord, table: ErrorTable, log: Path | None, *, ok: bool
) -> None:
    if args.json:
        rms = table.as_mapping()
        result = {
            "ok": ok,
            "imu_messages": health.samples_used,
            "attitudes_sent": health.estimates_sent,
            "rms_deg": {name: rms[name] for name in ("roll", "pitch", "yaw", "tilt", "total")},
            "log": None if log is None else str(log),
        }
        print_json(result)
        return
    print(
        f"{health.samples_used} {health.imu_message or 'IMU'} messages in, "
        f"{health.estimates_sent} attitudes out"
    )
    if table.compared:
        print(f"\nRMS error against the simulator's truth ({table.compared} samples), deg")
        for name in ("roll", "pitch", "yaw", "tilt", "total"):
            print(f"  {name:5} {getattr(table, name):7.3f}")
    if log is None:
        print("\nno log: its folder is not usable")
        return
    print(f"\nlog: {log}\n\nnext, try")
    print(f"  h2nav log info {log}")
    print(f"  h2nav replay {log} --no-log     # the same estimates again")
    print("  h2nav run --connect udpin:0.0.0.0:14550 --log-dir logs     # a real autopilot")

"""``h2nav demo``: the fake autopilot and the daemon over loopback, an error table, a log."""

import argparse
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from h2nav.apps.configuration import Configuration, LinkSettings, LogSettings
from h2nav.apps.console import Console
from h2nav.apps.daemon import StopSignals
from h2nav.apps.reference import ErrorTable, Reference
from h2nav.apps.session import Session
from h2nav.errors import TaskFailed
from h2nav.io.deframer import Frame
from h2nav.service.effects import Severity
from h2nav.service.records import EstimateRecord, HealthRecord
from h2nav.service.settings import AutopilotSettings

DEFAULT_SECONDS = 20.0
# The demo fails when it does not come near this: something is broken then.
WORST_TOTAL_DEG = 5.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    parser.add_argument(
        "--seconds", type=float, default=DEFAULT_SECONDS, help="how long to fly (default 20)"
    )
    parser.add_argument("--log-dir", type=Path, help="folder of the log (default: a new one)")
    parser.add_argument("--scenario", default="flight", help="what is flown (default: flight)")
    parser.add_argument("--seed", type=int, default=1, help="of the simulated sensors")
    parser.add_argument("--json", action="store_true", help="the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Flies the demo; TaskFailed when the daemon did not do its job."""
    folder = args.log_dir or Path(tempfile.mkdtemp(prefix="h2nav-demo-"))
    configuration = Configuration(
        link=LinkSettings("udpin:127.0.0.1:0"),
        autopilot=AutopilotSettings(simulation_truth=True),
        log=LogSettings(folder=str(folder)),
    )
    watcher = _Watcher()
    with StopSignals().installed() as stop, Session(configuration, Console(), watcher) as session:
        session.open()
        with _fake_autopilot(session.link.local_port, args):
            session.run(stop, args.seconds)
        health = session.service.health
    assert session.recorder is not None
    table = watcher.reference.table()
    _show(args, health, table, session.recorder.path)
    if not _is_good(table):
        raise TaskFailed("demo: the estimate is missing or wrong; the log tells why")
    return 0


class _Watcher:
    """Shows notices like the daemon, and collects the error table."""

    def __init__(self) -> None:
        self.reference = Reference()
        self.message_ids = self.reference.message_ids
        self._console = Console()

    def frame(self, t_ns: int, frame: Frame) -> None:
        self.reference.frame(t_ns, frame)

    def estimate(self, t_ns: int, record: EstimateRecord) -> None:
        self.reference.estimate(t_ns, record)
        self._console.estimate(t_ns, record)

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        self._console.notice(t_ns, severity, text)


@contextmanager
def _fake_autopilot(port: int | None, args: argparse.Namespace) -> Iterator[None]:
    """The other side, as a process of its own, as a real autopilot is."""
    command = [sys.executable, "-m", "h2nav", "fake-autopilot"]
    command += ["--connect", f"udpout:127.0.0.1:{port}"]
    command += ["--scenario", args.scenario, "--seed", str(args.seed)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def _is_good(table: ErrorTable) -> bool:
    return table.compared > 0 and math.isfinite(table.total) and table.total < WORST_TOTAL_DEG


def _show(
    args: argparse.Namespace, health: HealthRecord, table: ErrorTable, log: Path | None
) -> None:
    if args.json:
        rms = table.as_mapping()
        result = {
            "ok": _is_good(table),
            "imu_messages": health.samples_used,
            "attitudes_sent": health.estimates_sent,
            "rms_deg": {name: rms[name] for name in ("roll", "pitch", "yaw", "tilt", "total")},
            "log": str(log),
        }
        print(json.dumps(result))
        return
    print(
        f"\n{health.samples_used} {health.imu_message} messages in, "
        f"{health.estimates_sent} attitudes out"
    )
    print(f"RMS error against the simulator's truth ({table.compared} samples), deg")
    for name, value in table.as_mapping().items():
        print(f"  {name:5} {value}")
    print(f"\nlog: {log}")
    print("next:")
    print(f"  h2nav log info {log}")
    print(f"  h2nav replay {log} --no-log      # the very same estimates again")
    print("  h2nav run -c configs/ardupilot-udp.yaml   # a real autopilot")

"""The daemon's loop: one thread waits for the link and the clock, and does everything in turn.

Only the log is written elsewhere (the recorder's thread). Nothing in the loop raises on bad input,
blocks on a peer, or runs more often than there is work.
"""

import gc
import select
import socket
import sys
import time
from collections.abc import Iterator

from h2nav.apps.pipeline import Pipeline
from h2nav.host.host_clock import UnixClock
from h2nav.host.service_manager import ServiceManager
from h2nav.host.stop_signals import StopSignals
from h2nav.integrity.severity import Severity
from h2nav.links.links import Link
from h2nav.service.effects import Notice

LONGEST_WAIT_NS = 100_000_000
LINK_RECORD_NS = 1_000_000_000
CLOCK_STEP_NS = 500_000_000
# A turn takes this long only if the program was stopped or starved.
STALL_NS = 400_000_000
# Reads per turn while there is a backlog, before timers run.
READS_PER_ROUND = 8
# The recorder's thread shares the interpreter; Python's 5 ms switch could delay an attitude.
THREAD_SWITCH_S = 1e-4


class Daemon:
    """Runs link, pipeline and clock, one `turn` after the other.

    Args:
        clock: the host's UNIX clock at the start.
        manager: systemd, if present.
    """

    def __init__(
        self, link: Link, pipeline: Pipeline, clock: UnixClock, manager: ServiceManager
    ) -> None:
        self._link = link
        self._pipeline = pipeline
        self._clock = clock
        self._manager = manager
        self._record_ns = 0
        self._known_step_ns = 0
        self._round_ns: int | None = None
        self._arrived_ns = 0

    def turns(self, stop: StopSignals, until_ns: int | None = None) -> Iterator[int]:
        """Runs until a stop signal or a monotonic time; yields the time after each turn."""
        sys.setswitchinterval(THREAD_SWITCH_S)
        gc.freeze()  # loaded objects stay; a full collection over them would take milliseconds
        self._manager.ready()
        while not stop.stopped:
            now_ns = time.monotonic_ns()
            if until_ns is not None and now_ns >= until_ns:
                break
            yield self.turn(now_ns, stop.wake)
        self._manager.stopping()

    def turn(self, now_ns: int, wake: socket.socket) -> int:
        """Maintains the link, waits, reads, processes, and runs timers.

        Returns:
            The time after the wait and the reading.
        """
        self._link.maintain(now_ns)
        self._pipeline.link(now_ns, self._link.is_up, self._link.last_error)
        wait_ns = min(max(self._pipeline.next_timer_ns - now_ns, 0), LONGEST_WAIT_NS)
        descriptor = self._link.fileno()
        readers = [wake.fileno()] if descriptor is None else [wake.fileno(), descriptor]
        writers = [descriptor] if descriptor is not None and self._link.has_backlog else []
        readable, _, _ = select.select(readers, writers, [], wait_ns * 1e-9)
        self._notice_stall(time.monotonic_ns())
        if descriptor is not None and descriptor in readable:
            self._read()
        now_ns = time.monotonic_ns()
        self._pipeline.tick(now_ns)
        if self._pipeline.service.is_progressing(now_ns):
            self._manager.alive(now_ns)
        if now_ns >= self._record_ns:
            self._record_ns = now_ns + LINK_RECORD_NS
            self._pipeline.report(now_ns, self._link.statistics)
            self._manager.status(self._pipeline.service.health.summary)
            self._watch_clock(now_ns)
        return now_ns

    def _read(self) -> None:
        """Processes what has arrived, up to a limit; the rest is left for the next turn."""
        for _ in range(READS_PER_ROUND):
            for data, stamp_ns in self._link.read():
                now_ns = time.monotonic_ns()
                # The kernel's stamp follows the UNIX clock, which may have been set since.
                arrived_ns = now_ns if stamp_ns is None else min(stamp_ns, now_ns)
                self._arrived_ns = max(self._arrived_ns, arrived_ns)
                self._pipeline.received(self._arrived_ns, data, now_ns)
            if not self._link.has_more:
                break

    def _notice_stall(self, now_ns: int) -> None:
        """Reports a previous turn that ended much longer ago than a turn takes."""
        if self._round_ns is not None and now_ns - self._round_ns > STALL_NS:
            self._pipeline.stalled(now_ns, now_ns - self._round_ns)
        self._round_ns = now_ns

    def _watch_clock(self, now_ns: int) -> None:
        """Reports a step of the host's UNIX clock; only the log depends on it."""
        step_ns = self._clock.step_ns() - self._known_step_ns
        if abs(step_ns) > CLOCK_STEP_NS:
            self._known_step_ns += step_ns
            text = f"host clock stepped by {step_ns * 1e-9:+.1f} s"
            self._pipeline.note(now_ns, Notice(Severity.NOTICE, text, "host clock stepped"))

"""What could go stale, wrong or full without a word about it."""

import contextlib
import fcntl
import math
import os
import resource
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from bench import H2NAV, Lateness, Row, Scene, WatchedDaemon, free_udp_port, scene
from hostile import longest_silence_s
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from udp_vehicle import Reading, UdpVehicle, turning

OLD_S = 0.3
IMU_MESSAGES = {"HIGHRES_IMU", "RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3"}
AHEAD_US = 1_900_000
WATCHDOG_S = 0.9
SMALL_FILE_BYTES = 300_000
SMALL_DISK = "size=1m"
PIPE_BYTES = 4096
NO_LINKS = {
    "link-serial": ("a serial device that is not there", "serial:/dev/ttyABSENT:115200"),
    "link-host": ("a host that nobody knows", "udpout:no-such-host.invalid:14550"),
    "link-port": ("a UDP port that another program has", "udpin:127.0.0.1:{port}"),
}


def stopped(seconds: float) -> Row:
    """The process gets no time for so long; what came meanwhile waits in the socket."""
    with scene() as at:
        at.until_active()
        at.vehicle.fly(4.0)
        calm = Lateness.of(at.vehicle.ages_s())
        at.daemon.process.send_signal(signal.SIGSTOP)
        at.vehicle.fly(seconds)
        at.daemon.process.send_signal(signal.SIGCONT)
        on_unix_ns, on_s = time.time_ns(), time.monotonic()
        at.vehicle.fly(8.0)
        row = at.row(f"D3-{seconds:.0f}", f"SIGSTOP for {seconds:.0f} s")
    row.calm = calm
    ages_s = at.vehicle.ages_s(on_unix_ns)
    row.late = Lateness.of(ages_s)
    old = [age_s for age_s in ages_s if age_s > OLD_S]
    active_s = at.daemon.state_since("active", on_s)
    told = [text for _, text in at.daemon.notices("degraded", on_s)]
    row.figures += [
        f"{len(old)} of {len(ages_s)} ATTITUDE older than {OLD_S} s, the oldest {max(ages_s):.2f} s"
        if ages_s
        else "no ATTITUDE afterwards",
        f"degraded told: {told}",
        f"active {active_s - on_s:.2f} s after SIGCONT" if active_s else "not active afterwards",
    ]
    return row


def ahead() -> Row:
    """One stamp that is 1.9 s ahead of its time."""
    with scene() as at:
        at.until_active()
        at.vehicle.fly(3.0)
        at.vehicle.stamp_shift_us = AHEAD_US
        count, since_unix_ns = len(at.vehicle.sent), time.time_ns()
        at.vehicle.fly(1.0, lambda: len(at.vehicle.sent) > count)
        at.vehicle.stamp_shift_us = 0
        at.vehicle.fly(6.0)
        row = at.row("ahead", "one stamp 1.9 s ahead")
        silence_s = longest_silence_s(at, since_unix_ns)
        row.figures.append(f"longest silence of ATTITUDE afterwards {silence_s:.2f} s")
        return row


def slow_in_use() -> Row:
    """The message in use comes at a tenth of its rate while a better one comes at the full rate."""
    with scene() as at:
        at.vehicle.rates_hz["RAW_IMU"] = 10.0
        at.vehicle.also_accepts.add("HIGHRES_IMU")
        at.vehicle.fly(2.4)
        at.vehicle.rates_hz["HIGHRES_IMU"] = 100.0
        at.vehicle.fly(14.0)
        row = at.row("D9", "RAW_IMU at 10 Hz in use, then HIGHRES_IMU at 100 Hz beside it")
        last = at.daemon.statuses[-1][1]
        row.figures.append(f"in use {last['imu_message']}, rate told {last['imu_rate_hz']:.0f} Hz")
        return row


@contextmanager
def _notified() -> Iterator[tuple[dict[str, str], socket.socket]]:
    """The end of the notification socket that systemd has, and the environment that names it."""
    with (
        tempfile.TemporaryDirectory() as folder,
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear,
    ):
        path = f"{folder}/notify"
        ear.bind(path)
        ear.setblocking(False)
        yield {"NOTIFY_SOCKET": path, "WATCHDOG_USEC": str(round(WATCHDOG_S * 1e6))}, ear


def watchdog(name: str, done: str, flies_first: bool) -> Row:
    """Heartbeats without IMU messages: is the watchdog fed?"""
    with _notified() as (environment, ear), scene(environment=environment) as at:
        if flies_first:
            at.until_active()
            at.vehicle.fly(2.0)
        at.vehicle.rates_hz.pop("RAW_IMU")
        pings = []
        for _ in range(12):
            at.vehicle.fly(1.0)
            pings.append(_pings(ear))
        row = at.row(name, done)
        row.figures.append(f"watchdog of {WATCHDOG_S} s, pings in each second: {pings}")
        return row


def _pings(ear: socket.socket) -> int:
    count = 0
    with contextlib.suppress(BlockingIOError):
        while True:
            count += ear.recv(4096) == b"WATCHDOG=1"
    return count


def no_samples(name: str, done: str) -> Row:
    """IMU messages that are of no use: which cause is told?"""
    with scene(imu="HIGHRES_IMU") as at:
        if name == "imu-nan":
            at.vehicle.makers["HIGHRES_IMU"] = lambda t_us: _highres(t_us, math.nan)
        elif name == "imu-zero":
            at.vehicle.makers["HIGHRES_IMU"] = lambda t_us: _highres(t_us, 0.0)
        else:
            at.vehicle.rates_hz.pop("HIGHRES_IMU")
            if name == "imu-silent":
                at.vehicle.also_accepts |= IMU_MESSAGES
        at.vehicle.fly(12.0)
        row = at.row(name, done)
        row.figures += [f"told: {text}" for _, text in at.daemon.notices()]
        return row


def _highres(t_us: int, value: float) -> object:
    pressure = (1013.25, 0.0, 0.0, 25.0)
    return mavlink.MAVLink_highres_imu_message(t_us, *(value,) * 9, *pressure, 0xFFF)


def stuck_axes() -> Row:
    """First one axis of the gyro repeats its value, then another."""
    with scene() as at:
        at.vehicle.is_noisy = False
        at.vehicle.sense = turning
        at.until_active()
        at.vehicle.fly(2.0)
        for axes in ((0,), (0, 2), (2,)):
            at.vehicle.sense = partial(_stuck, axes)
            at.vehicle.fly(4.0)
        row = at.row("stuck", "gyro x stuck for 4 s, x and z for 4 s, z alone for 4 s")
        row.figures += [f"told: {text}" for _, text in at.daemon.notices("stuck")]
        return row


def _stuck(axes: tuple[int, ...], t_s: float) -> Reading:
    reading = turning(t_s)
    rates = list(reading.gyro_mrad_s)
    for axis in axes:
        rates[axis] = 123.0
    return reading._replace(gyro_mrad_s=(rates[0], rates[1], rates[2]))


def no_link(name: str) -> Row:
    """The link cannot be opened: what is said, and when?"""
    done, url = NO_LINKS[name]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        daemon = WatchedDaemon(["--connect", url.format(port=taken.getsockname()[1])])
        daemon.wait(lambda: False, 8.0)
        row = Row(name, done, daemon.stop(), states=daemon.states())
    row.figures += [
        f"stderr after {t_s - daemon.started_s:.1f} s: {text}" for t_s, text in daemon.said
    ]
    return row


def link_full() -> Row:
    """The autopilot is gone: is the link blamed?"""
    with scene() as at:
        at.until_active()
        at.vehicle.fly(6.0)
        at.vehicle.pause(20.0)
        return _full_notices(at, "link-full", "the autopilot falls silent for 20 s")


def late_stream() -> Row:
    """A stream of 1 Hz that comes a little late."""
    with scene() as at:
        at.vehicle.rates_hz["EXTENDED_SYS_STATE"] = 0.93
        at.vehicle.fly(26.0)
        return _full_notices(at, "late-1hz", "a stream of 1 Hz that comes at 0.93 Hz, 26 s")


def _full_notices(at: Scene, name: str, done: str) -> Row:
    row = at.row(name, done)
    told = [text for _, text in at.daemon.notices("link full")]
    row.figures += [f"{len(told)} notices of a full link: {told[:3]}"]
    return row


def file_limit() -> Row:
    """The log may not grow (EFBIG)."""
    limits = (SMALL_FILE_BYTES, SMALL_FILE_BYTES)
    with scene() as at:
        resource.prlimit(at.daemon.process.pid, resource.RLIMIT_FSIZE, limits)
        at.vehicle.fly(22.0)
        return _log_notices(at, "disk-limit", f"log files limited to {SMALL_FILE_BYTES} bytes")


def disk_full() -> Row:
    """The log's disk is full (ENOSPC)."""
    done = "log on a disk of 1 MiB"
    with tempfile.TemporaryDirectory() as folder:
        mount = ["mount", "-t", "tmpfs", "-o", SMALL_DISK, "h2nav-attack", folder]
        if subprocess.run(mount, check=False, capture_output=True).returncode:
            return Row("disk-full", done, "not run: it needs the right to mount")
        try:
            with scene(log=f"{{folder: '{folder}', min_free_mb: 0}}") as at:
                at.vehicle.fly(25.0)
                return _log_notices(at, "disk-full", done)
        finally:
            subprocess.run(["umount", folder], check=True)


def _log_notices(at: Scene, name: str, done: str) -> Row:
    row = at.row(name, done)
    row.figures += [f"told: {text}" for _, text in at.daemon.notices()][:8]
    return row


def unread(name: str) -> Row:
    """Nobody reads what the daemon writes to a pipe, and the pipe is full."""
    port = free_udp_port()
    stream = name.removeprefix("pipe-")
    reader, writer = os.pipe()
    fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    other = {"stdout": "stderr", "stderr": "stdout"}[stream]
    words = ["--json"] if stream == "stdout" else []
    process = subprocess.Popen(
        [*H2NAV, "run", *words, "--connect", f"udpin:127.0.0.1:{port}"],
        **{stream: writer, other: subprocess.DEVNULL},
    )
    vehicle = UdpVehicle(port)
    try:
        vehicle.fly(20.0, lambda: len(vehicle.ages_s()) > 50)
        if stream == "stderr":
            os.write(writer, b"x" * (PIPE_BYTES - 200))
            for system in range(2, 20):
                vehicle.send(vehicle.makers["HEARTBEAT"](0), (system, 1))
        vehicle.fly(25.0 if stream == "stdout" else 4.0)
        last_unix_ns = max(arrival.unix_ns for arrival in vehicle.arrivals)
        silent_s = (time.time_ns() - last_unix_ns) * 1e-9
        process.terminate()
        ended = str(process.wait(5.0))
    except subprocess.TimeoutExpired:
        ended = "does not end 5 s after SIGTERM"
    finally:
        process.kill()
        process.wait()
        vehicle.close()
        os.close(reader)
        os.close(writer)
    row = Row(name, f"{stream} is a pipe of {PIPE_BYTES} bytes that nobody reads", ended)
    row.late = Lateness.of(vehicle.ages_s())
    row.figures.append(f"nothing sent for {silent_s:.1f} s at the end")
    return row


def spoken() -> Row:
    """What a user sees who starts and ends it by hand."""
    with scene() as at:
        at.until_active()
        at.vehicle.fly(2.0)
        at.daemon.process.send_signal(signal.SIGINT)
        at.daemon.process.wait(5.0)
        row = at.row("spoken", "start, some seconds of flight, Ctrl-C")
        row.figures += [f"stderr: {text}" for _, text in at.daemon.said]
        return row


ROWS = {
    "D3-2": partial(stopped, 2.0),
    "D3-10": partial(stopped, 10.0),
    "ahead": ahead,
    "D9": slow_in_use,
    "watchdog-never": partial(
        watchdog, "watchdog-never", "heartbeats, never an IMU message", False
    ),
    "watchdog-silent": partial(watchdog, "watchdog-silent", "active, then no IMU message", True),
    "imu-nan": partial(no_samples, "imu-nan", "HIGHRES_IMU of nothing but NaN"),
    "imu-zero": partial(no_samples, "imu-zero", "HIGHRES_IMU of nothing but zeros"),
    "imu-silent": partial(no_samples, "imu-silent", "streams accepted and never sent"),
    "imu-denied": partial(no_samples, "imu-denied", "every IMU message denied"),
    "stuck": stuck_axes,
    **{name: partial(no_link, name) for name in NO_LINKS},
    "link-full": link_full,
    "late-1hz": late_stream,
    "disk-limit": file_limit,
    "disk-full": disk_full,
    "pipe-stdout": partial(unread, "pipe-stdout"),
    "pipe-stderr": partial(unread, "pipe-stderr"),
    "spoken": spoken,
}

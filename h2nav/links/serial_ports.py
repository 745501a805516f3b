"""The serial ports of this computer: stable names, descriptions, obstacles to using them."""

import contextlib
import glob
import grp
import os
from pathlib import Path
from typing import NamedTuple

from serial.tools.list_ports_linux import SysFS

BY_ID = "/dev/serial/by-id"
# Raspberry Pi OS gives the header's UART these names, whatever drives it.
ALIASES = ("/dev/serial0", "/dev/serial1")
# USB adapters and autopilots; UARTs of Broadcom, Nvidia, Qualcomm, NXP, TI and PC boards.
PATTERNS = ("ttyACM*", "ttyUSB*", "ttyAMA*", "ttyTHS*", "ttyHS*", "ttymxc*", "ttyO*", "ttyS*")
ABSENT_UART = "0"  # PORT_UNKNOWN of the kernel: a name without hardware behind it


class PortListing(NamedTuple):
    """One serial port."""

    path: str  # the name that does not depend on the order in which devices are plugged in
    device: str  # the node that it resolves to now
    description: str  # the device's own name; empty if it has none
    obstacles: tuple[str, ...]  # what prevents its use, each with the remedy


def listed_ports() -> list[PortListing]:
    """Lists every serial port with hardware behind it."""
    stable = {os.path.realpath(link): link for link in _links()}
    nodes = [node for pattern in PATTERNS for node in sorted(glob.glob(f"/dev/{pattern}"))]
    nodes = [node for node in nodes if node in stable or _has_hardware(node)]
    return [port_at(stable.get(node, node)) for node in nodes]


def port_at(path: str) -> PortListing:
    """Describes the port at a path, whether or not it exists."""
    device = os.path.realpath(path)
    return PortListing(path, device, _description(device), tuple(_obstacles(device)))


def _links() -> list[str]:
    """Returns the stable names, the preferred ones last."""
    aliases = [alias for alias in ALIASES if os.path.exists(alias)]
    return aliases + sorted(glob.glob(f"{BY_ID}/*"))


def _has_hardware(node: str) -> bool:
    """Whether a UART exists behind the name; the kernel also reserves names without one."""
    try:
        kind = Path(f"/sys/class/tty/{os.path.basename(node)}/type").read_text(encoding="ascii")
    except OSError:
        return True
    return kind.strip() != ABSENT_UART


def _description(device: str) -> str:
    """Returns manufacturer and product from the USB descriptor."""
    try:
        info = SysFS(device)
    except OSError:
        return ""
    words = [word for word in (info.manufacturer, info.product) if word]
    return " ".join(dict.fromkeys(words))


def _obstacles(device: str) -> list[str]:
    found = []
    if _is_console(device):
        found.append(
            "the kernel's console is on this port: take `console=` of it out of the boot options "
            "(Raspberry Pi: raspi-config, Interface Options, Serial Port)"
        )
    found += [f"{name} has it open (process {pid})" for name, pid in _users(device)]
    try:
        state = os.stat(device)
    except OSError:
        return found
    if not os.access(device, os.R_OK | os.W_OK):
        found.append(
            f"permission denied: `sudo usermod -aG {_group(state.st_gid)} $USER`, then log in again"
        )
    return found


def _group(gid: int) -> str:
    with contextlib.suppress(KeyError):
        return grp.getgrgid(gid).gr_name
    return str(gid)


def _is_console(device: str) -> bool:
    try:
        words = Path("/proc/cmdline").read_text(encoding="utf-8", errors="replace").split()
    except OSError:
        return False
    consoles = [word.removeprefix("console=").split(",")[0] for word in words if "console=" in word]
    return any(os.path.realpath(f"/dev/{name}") == device for name in consoles)


def _users(device: str) -> list[tuple[str, int]]:
    """Returns the programs that have the device open, as far as permissions show them."""
    found = []
    for folder in glob.glob("/proc/[0-9]*/fd"):
        pid = int(folder.split("/")[2])
        if pid == os.getpid() or device not in _open_files(folder):
            continue
        with contextlib.suppress(OSError):
            name = Path(f"/proc/{pid}/comm").read_text(encoding="utf-8", errors="replace").strip()
            found.append((name, pid))
    return found


def _open_files(folder: str) -> set[str]:
    found = set()
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):
            with contextlib.suppress(OSError):
                found.add(os.readlink(f"{folder}/{name}"))
    return found

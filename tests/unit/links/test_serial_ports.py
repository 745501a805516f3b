"""What is listed of a serial port: its stable name, its node, and why it cannot be used."""

import grp
import os

import pytest

from h2nav.links import serial_ports
from h2nav.links.serial_ports import PortListing, listed_ports, port_at


@pytest.fixture
def port():
    """A serial line of this process."""
    far_end, near_end = os.openpty()
    yield os.ttyname(near_end)
    os.close(near_end)
    os.close(far_end)


def test_a_port_is_known_by_its_node(port, tmp_path):
    stable = tmp_path / "usb-Hex_CubeOrange-if00"
    stable.symlink_to(port)
    assert port_at(str(stable)) == PortListing(str(stable), port, "", ())


def test_a_port_that_is_absent_has_no_obstacle(tmp_path):
    path = str(tmp_path / "ttyABSENT")
    assert port_at(path) == PortListing(path, path, "", ())


def test_who_may_not_use_it_is_told_the_group(port, monkeypatch):
    asked = []
    monkeypatch.setattr(os, "access", lambda path, mode: asked.append((path, mode)))
    group = grp.getgrgid(os.stat(port).st_gid).gr_name
    assert port_at(port).obstacles == (
        f"permission denied: `sudo usermod -aG {group} $USER`, then log in again",
    )
    assert asked == [(port, os.R_OK | os.W_OK)]


def test_a_group_without_a_name_is_told_by_its_number(port, monkeypatch):
    def nobody(gid):
        raise KeyError(gid)

    monkeypatch.setattr(os, "access", lambda *_: False)
    monkeypatch.setattr(grp, "getgrgid", nobody)
    (obstacle,) = port_at(port).obstacles
    assert f"usermod -aG {os.stat(port).st_gid} $USER" in obstacle


@pytest.mark.parametrize(
    ("words", "is_console"),
    [
        ("console={},115200 root=/dev/sda1", True),
        ("root=/dev/sda1 console=tty1 console={}", True),
        ("console=tty1 other={}", False),
    ],
)
def test_the_kernels_console_is_an_obstacle(port, monkeypatch, tmp_path, words, is_console):
    boot = tmp_path / "cmdline"
    boot.write_text(words.format(port.removeprefix("/dev/")))
    path_of = serial_ports.Path
    monkeypatch.setattr(
        serial_ports, "Path", lambda path: boot if path == "/proc/cmdline" else path_of(path)
    )
    obstacles = port_at(port).obstacles
    assert [text.startswith("the kernel's console is on this port") for text in obstacles] == (
        [True] * is_console
    )


def test_ports_without_hardware_are_left_out_and_stable_names_come_first(monkeypatch, tmp_path):
    for name in ("ttyUSB1", "ttyUSB0", "ttyACM0", "ttyS0"):
        (tmp_path / name).touch()
    (tmp_path / "by-id").mkdir()
    (tmp_path / "by-id" / "usb-Radio").symlink_to(tmp_path / "ttyUSB1")

    def found(pattern):
        real = {"/dev/serial/by-id/*": "by-id/*"}.get(pattern, pattern.removeprefix("/dev/"))
        return [str(path) for path in tmp_path.glob(real)] if "proc" not in pattern else []

    monkeypatch.setattr(serial_ports.glob, "glob", found)
    monkeypatch.setattr(serial_ports, "_has_hardware", lambda node: "ttyS" not in node)
    monkeypatch.setattr(serial_ports, "ALIASES", ())
    names = [port.path.removeprefix(f"{tmp_path}/") for port in listed_ports()]
    assert names == ["ttyACM0", "ttyUSB0", "by-id/usb-Radio"]

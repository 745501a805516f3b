import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from h2nav.errors import BadInput
from h2nav.links.link_urls import SerialUrl, TcpUrl, UdpUrl, parse_link_url

GOOD = {
    "udpin:0.0.0.0:14550": UdpUrl("0.0.0.0", 14550, listens=True),
    "udpin:127.0.0.1:0": UdpUrl("127.0.0.1", 0, listens=True),
    "udp:127.0.0.1:14550": UdpUrl("127.0.0.1", 14550, listens=True),
    "udpin://0.0.0.0:14540": UdpUrl("0.0.0.0", 14540, listens=True),
    "udpin:[::1]:14550": UdpUrl("::1", 14550, listens=True),
    "udpout:10.1.2.3:14551": UdpUrl("10.1.2.3", 14551, listens=False),
    "udpout:[fe80::1%eth0]:14551": UdpUrl("fe80::1%eth0", 14551, listens=False),
    "tcp:sitl-1.local:5760": TcpUrl("sitl-1.local", 5760),
    "serial:/dev/ttyAMA0:921600": SerialUrl("/dev/ttyAMA0", 921600),
    "serial:///dev/ttyUSB0:57600": SerialUrl("/dev/ttyUSB0", 57600),
    "/dev/ttyACM0,115200": SerialUrl("/dev/ttyACM0", 115200),
    "/dev/ttyACM0:115200": SerialUrl("/dev/ttyACM0", 115200),
    "serial:/dev/serial/by-id/usb-Hex_CubeOrange-if00:115200": SerialUrl(
        "/dev/serial/by-id/usb-Hex_CubeOrange-if00", 115200
    ),
    "serial:/dev/serial/by-path/pci-0000:01:00.0-usb-0:1.3:1.0:921600": SerialUrl(
        "/dev/serial/by-path/pci-0000:01:00.0-usb-0:1.3:1.0", 921600
    ),
}
BAD = {
    "": "is not a kind of link",
    "14550": "is not a kind of link",
    "tcpin:0.0.0.0:5760": "'tcpin' is not a kind of link",
    "COM3,115200": "is not a kind of link",
    "udpin:14550": "is not HOST:PORT",
    "udpin::14550": "is not HOST:PORT",
    "udpin:::1:14550": "IPv6 address needs [brackets]",
    "udpin:0.0.0.0": "is not HOST:PORT",
    "udpin:0.0.0.0:14550:14551": "is not HOST:PORT",
    "udpin:0.0.0.0:+1": "is not HOST:PORT",
    "udpin:0.0.0.0:65536": "port 65536 is outside 0..65535",
    "udpout:10.0.0.1:0": "port 0 is outside 1..65535",
    "tcp:localhost:0": "port 0 is outside 1..65535",
    "serial:/dev/ttyAMA0": "is not an absolute device path with a baud rate",
    "serial:ttyAMA0:115200": "is not an absolute device path with a baud rate",
    "/dev/ttyACM0,fast": "is not an absolute device path with a baud rate",
    "/dev/ttyACM0,1": "baud rate 1 is outside",
    "udpin:0.0.0.0:14550\n": "is not HOST:PORT",
}


@pytest.mark.parametrize("url", GOOD)
def test_accepted(url: str) -> None:
    assert parse_link_url(url) == GOOD[url]


@pytest.mark.parametrize("url", BAD)
def test_refused_in_one_line_with_the_remedy(url: str) -> None:
    with pytest.raises(BadInput) as caught:
        parse_link_url(url)
    (line,) = caught.value.lines
    assert BAD[url] in line
    assert repr(url) in line
    assert "write one of udpin:HOST:PORT" in line
    assert "\n" not in line


@settings(derandomize=True, deadline=None)
@given(st.sampled_from(["", "udpin:", "tcp:", "serial:", "/dev/"]), st.text(max_size=30))
def test_any_text_is_read_or_refused(start: str, rest: str) -> None:
    with contextlib.suppress(BadInput):
        parse_link_url(start + rest)


@pytest.mark.parametrize(
    ("url", "is_good"),
    [
        ("udpin:0.0.0.0:65535", True),
        ("udpout:10.0.0.1:1", True),
        ("udpout:10.0.0.1:65536", False),
        ("tcp:localhost:1", True),
        ("tcp:localhost:65535", True),
        ("/dev/ttyACM0,299", False),
        ("/dev/ttyACM0,300", True),
        ("/dev/ttyACM0,12000000", True),
        ("/dev/ttyACM0,12000001", False),
    ],
)
def test_ports_and_baud_rates_have_limits(url: str, is_good: bool) -> None:
    if is_good:
        parse_link_url(url)
        return
    with pytest.raises(BadInput, match=r"outside (1\.\.65535|300\.\.12000000)"):
        parse_link_url(url)

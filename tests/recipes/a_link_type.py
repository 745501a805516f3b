"""A link type"""

CHANGES = {
    "h2nav/links/made.py": '''\
"""A made transport."""

from h2nav.links.link_urls import MadeUrl
from h2nav.links.tcp import TcpTransport


class MadeTransport(TcpTransport):
    """TCP by another name."""

    def __init__(self, target: MadeUrl) -> None:
        super().__init__(target.tcp)
''',
    "h2nav/links/link_urls.py": (
        (
            "LinkUrl = UdpUrl | TcpUrl | SerialUrl\n",
            '''\
class MadeUrl(NamedTuple):
    """A made one."""

    tcp: TcpUrl


LinkUrl = UdpUrl | TcpUrl | SerialUrl | MadeUrl
''',
        ),
        (
            '    if colon and kind == "tcp":\n',
            """\
    if colon and kind == "made":
        return MadeUrl(TcpUrl(*_host_and_port(url, rest, lowest_port=1)))
    if colon and kind == "tcp":
""",
        ),
    ),
    "h2nav/links/links.py": (
        (
            "    transport = SerialTransport(target)",
            """\
    if isinstance(target, MadeUrl):
        made = MadeTransport(target)
        return StreamLink(url, made, lambda error: f"made: {error}")
    transport = SerialTransport(target)""",
        ),
        (
            "from h2nav.links.link_errors import explained\n",
            """\
from h2nav.links.link_errors import explained
from h2nav.links.link_urls import MadeUrl
from h2nav.links.made import MadeTransport
""",
        ),
    ),
}

if __name__ == "__main__":
    import socket
    import time

    from h2nav.links.links import open_link

    with socket.create_server(("127.0.0.1", 0)) as server:
        link = open_link(f"made:127.0.0.1:{server.getsockname()[1]}")
        link.maintain(time.monotonic_ns())
        accepted, _ = server.accept()
        accepted.close()
        link.close()

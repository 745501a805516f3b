import socket

import pytest
from link_drivers import attempts

from h2nav.links.host_lookup import HostLookup, SocketAddress


def outcome(lookup: HostLookup) -> list[SocketAddress]:
    """What the lookup comes to; a lookup under way is asked again."""
    for _ in attempts():
        if addresses := lookup.addresses():
            return addresses
    raise AssertionError("the lookup does not end")


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("127.0.0.1", SocketAddress(socket.AF_INET, ("127.0.0.1", 5760))),
        ("::1", SocketAddress(socket.AF_INET6, ("::1", 5760, 0, 0))),
    ],
)
def test_literal_address_is_known_at_once(host: str, expected: SocketAddress) -> None:
    assert HostLookup(host, 5760).addresses() == [expected]


def test_name_is_known_after_a_while_ipv4_first() -> None:
    addresses = outcome(HostLookup("localhost", 5760))
    assert addresses[0] == SocketAddress(socket.AF_INET, ("127.0.0.1", 5760))


@pytest.mark.parametrize("host", ["no..such.host", "x" * 80, "a..b"])
def test_name_that_cannot_be_resolved(host: str) -> None:
    lookup = HostLookup(host, 5760)
    with pytest.raises(OSError, match="cannot be resolved"):
        outcome(lookup)

import pytest

from h2nav.errors import BadInput
from h2nav.links.listen_address import parse_listen_address


@pytest.mark.parametrize(
    ("text", "host", "port", "is_loopback"),
    [
        ("127.0.0.1:8080", "127.0.0.1", 8080, True),
        ("127.1.2.3:1", "127.1.2.3", 1, True),
        ("localhost:0", "localhost", 0, True),
        ("[::1]:8080", "::1", 8080, True),
        ("0.0.0.0:65535", "0.0.0.0", 65535, False),
        ("[::]:80", "::", 80, False),
        ("[fe80::1%eth0]:80", "fe80::1%eth0", 80, False),
        ("drone-7.local:8080", "drone-7.local", 8080, False),
        ("drone.local.:80", "drone.local.", 80, False),
        (f"{'x' * 63}.local:80", f"{'x' * 63}.local", 80, False),
    ],
)
def test_an_address_is_read_and_written(text, host, port, is_loopback):
    address = parse_listen_address(text)
    assert address == (host, port)
    assert address.is_loopback is is_loopback
    assert str(address) == text


@pytest.mark.parametrize(
    "text",
    ["8080", ":8080", "127.0.0.1", "127.0.0.1:", "a b:1", "h:65536", "h:-1", "::1:80",
     "127.0..1:8080", ".local:80", f"{'x' * 64}.local:80"],
)  # fmt: skip
def test_what_is_no_address_is_refused_with_a_remedy(text):
    with pytest.raises(BadInput) as refused:
        parse_listen_address(text)
    (line,) = refused.value.lines
    assert repr(text) in line
    assert "127.0.0.1:8080" in line

"""The words for a link that does not open: what it is, and what to do."""

import errno

import pytest

from h2nav.links.link_errors import explained
from h2nav.links.link_urls import parse_link_url

SERIAL, TCP = "serial:/dev/ttyACM0:57600", "tcp:10.0.0.1:5760"
LISTENS, SENDS = "udpin:0.0.0.0:14550", "udpout:10.0.0.255:14550"


@pytest.mark.parametrize(
    ("url", "number", "words"),
    [
        (SERIAL, errno.EACCES, "permission denied: is the user in the group dialout?"),
        (SERIAL, errno.EIO, "the device is gone"),
        (TCP, errno.ECONNREFUSED, "no program listens there"),
        (SENDS, errno.ECONNREFUSED, "no program listens there yet"),
        (LISTENS, errno.EACCES, "permission denied: ports below 1024 are reserved"),
        (SENDS, errno.EACCES, "a broadcast address: name the one that answers"),
        (LISTENS, errno.EADDRINUSE, "another program listens on this port"),
        (LISTENS, errno.EDOM, "said"),
    ],
)
def test_an_error_is_told_with_its_url_and_remedy(url, number, words):
    assert explained(url, parse_link_url(url), OSError(number, "said")) == f"{url}: {words}"


def test_an_error_without_a_number_is_told_in_its_own_words():
    assert explained(TCP, parse_link_url(TCP), OSError("own words")) == f"{TCP}: own words"


@pytest.mark.parametrize(
    ("url", "texts"),
    [
        (
            SERIAL,
            {
                errno.ENOENT: "there is no such device: is it plugged in, is link.url right?",
                errno.ENXIO: "there is no device behind it: is it plugged in?",
                errno.EPERM: "permission denied: is the user in the group dialout?",
                errno.EBUSY: "another program has it open",
                errno.EAGAIN: "another program has it open",
                errno.ENOTTY: "it is not a serial port",
                errno.ECONNREFUSED: "said",
            },
        ),
        (
            TCP,
            {
                errno.EADDRNOTAVAIL: "this computer does not have that address",
                errno.EHOSTUNREACH: "no route to that host",
                errno.ENETUNREACH: "the network is unreachable",
                errno.ENETDOWN: "the network is down",
                errno.ETIMEDOUT: "no answer",
                errno.EACCES: "permission denied: ports below 1024 are reserved",
                errno.ENOTTY: "said",
            },
        ),
    ],
)
def test_each_error_has_its_words(url, texts):
    told = {
        number: explained(url, parse_link_url(url), OSError(number, "said")) for number in texts
    }
    assert told == {number: f"{url}: {text}" for number, text in texts.items()}

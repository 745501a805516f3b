"""Explains why a link does not open, with the remedy."""

import errno

from h2nav.links.link_urls import LinkUrl, SerialUrl, UdpUrl

_SERIAL = {
    errno.ENOENT: "there is no such device: is it plugged in, is link.url right?",
    errno.ENXIO: "there is no device behind it: is it plugged in?",
    errno.EACCES: "permission denied: is the user in the group dialout?",
    errno.EPERM: "permission denied: is the user in the group dialout?",
    errno.EBUSY: "another program has it open",
    errno.EAGAIN: "another program has it open",
    errno.ENOTTY: "it is not a serial port",
    errno.EIO: "the device is gone",
}
_NETWORK = {
    errno.EADDRINUSE: "another program listens on this port",
    errno.EACCES: "permission denied: ports below 1024 are reserved",
    errno.EADDRNOTAVAIL: "this computer does not have that address",
    errno.ECONNREFUSED: "no program listens there",
    errno.EHOSTUNREACH: "no route to that host",
    errno.ENETUNREACH: "the network is unreachable",
    errno.ENETDOWN: "the network is down",
    errno.ETIMEDOUT: "no answer",
}


def explained(url: str, target: LinkUrl, error: OSError) -> str:
    """Returns one line: the URL, the error and, where known, the remedy.

    Args:
        url: as the user wrote it.
    """
    words = _SERIAL if isinstance(target, SerialUrl) else _NETWORK
    known = words.get(error.errno or 0)
    if known is None:
        known = error.strerror or str(error)
    if isinstance(target, UdpUrl) and error.errno == errno.ECONNREFUSED:
        known = "no program listens there yet"
    if isinstance(target, UdpUrl) and not target.listens and error.errno == errno.EACCES:
        known = "a broadcast address: name the one that answers"
    return f"{url}: {known}"

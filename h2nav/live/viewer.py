"""The viewer's process: what the daemon feeds it goes to the page and to Foxglove."""

import socket


def view(feed: socket.socket) -> int:
    """Works until the daemon closes its end; the exit code.

    Args:
        feed: the viewer's end of `h2nav.io.live_feed.feed_sockets`.
    """
    feed.close()
    return 0

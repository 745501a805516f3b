"""``python -m h2nav.live``: started by the daemon, whose socket is its standard input."""

import socket
import sys

from h2nav.live.viewer import view

sys.exit(view(socket.socket(fileno=0)))

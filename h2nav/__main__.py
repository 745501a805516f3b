"""``python -m h2nav``."""

import sys

from h2nav.cli import main

sys.exit(main())

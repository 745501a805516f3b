"""All rows by name, in the order in which they run."""

from collections.abc import Callable

import files
import floods
import hostile
import manners
import onlookers
import stale
from bench import Row

ROWS: dict[str, Callable[[], Row]] = {
    **hostile.ROWS,
    **floods.ROWS,
    **stale.ROWS,
    **manners.ROWS,
    **onlookers.ROWS,
    **files.ROWS,
}

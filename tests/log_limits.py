"""Limits of logs for tests: the usual ones, without a floor of free space on the test's disk."""

import dataclasses
from typing import Any

from h2nav.apps.configuration import LogSettings
from h2nav.apps.log_contents import log_limits
from h2nav.log.folder import LogLimits


def limits(**changes: Any) -> LogLimits:
    """The usual limits with these fields changed."""
    return dataclasses.replace(log_limits(LogSettings(min_free_mb=0)), **changes)

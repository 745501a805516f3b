"""The file in which a user notes the components of airframes, for the odometer."""

import math
from pathlib import Path

from h2nav.airframes.features import unix_s_of
from h2nav.airframes.odometer import ComponentChange
from h2nav.errors import BadInput
from h2nav.files import plain_yaml

_REMEDY = 'expected a date in quotes, such as motor 2: "2026-03-01", below an airframe'


def read_components(path: Path) -> tuple[ComponentChange, ...]:
    """The components and when each was put in.

    Raises:
        BadInput: one line per error.
    """
    complaints, found = [], []
    for airframe, components in plain_yaml.read_mapping(path).items():
        if not isinstance(components, dict):
            complaints.append(f"{path}: {airframe}: {_REMEDY}")
            continue
        for component, date in components.items():
            since = unix_s_of(date)
            if math.isnan(since):
                complaints.append(f"{path}: {airframe}: {component}: {date!r}; {_REMEDY}")
            found.append(ComponentChange(airframe, component, since))
    if complaints:
        raise BadInput(*complaints)
    return tuple(found)

"""h2nav: an independent attitude and motion service for companion computers.

>>> from h2nav import AttitudeFilter, Velocity, estimate, read_flight, review, smooth
"""

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"
__all__ = [
    "Attitude",
    "AttitudeFilter",
    "BadInput",
    "Velocity",
    "__version__",
    "estimate",
    "read_flight",
    "review",
    "smooth",
]

if TYPE_CHECKING:
    from h2nav.errors import BadInput
    from h2nav.library.estimation import Attitude, AttitudeFilter, Velocity, estimate, smooth
    from h2nav.library.flights import read_flight, review

# The daemon imports h2nav too, and shall not load numpy for that.
_PLACES = {
    **dict.fromkeys(
        ("Attitude", "AttitudeFilter", "Velocity", "estimate", "smooth"),
        "h2nav.library.estimation",
    ),
    **dict.fromkeys(("read_flight", "review"), "h2nav.library.flights"),
    "BadInput": "h2nav.errors",
}


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'h2nav' has no attribute {name!r}")
    import importlib

    return getattr(importlib.import_module(_PLACES[name]), name)

"""Which files of `kernels` make a kernel, imported ones first, and the name of one version of them.

The build writes that name into the extension, so that one made from older kernels is noticed.
"""

import hashlib
from collections.abc import Sequence

SHAPED_MODULES = (
    "shaped_layout.py",
    "shaped_motion.py",
    "shaped_theta.py",
    "shaped_doubt.py",
    "shaped_velocity.py",
    "shaped_field.py",
    "shaped_rest.py",
    "shaped.py",
)
LEAN_MODULES = ("fixed_triad.py", "fixed_motion.py", "fixed_lean.py")
FLIGHT_MODULES = (
    "fixed_triad.py",
    "fixed_motion.py",
    "fixed_functions.py",
    "fixed_flight_layout.py",
    "fixed_flight_theta.py",
    "fixed_flight_doubt.py",
    "fixed_flight_velocity.py",
    "fixed_flight_fixes.py",
    "fixed_flight_field.py",
    "fixed_flight_start.py",
    "fixed_flight_frame.py",
    "fixed_flight.py",
)
# all that are compiled, each once
COMPILED_MODULES = tuple(dict.fromkeys((*SHAPED_MODULES, *LEAN_MODULES, *FLIGHT_MODULES)))


def digest(texts: Sequence[str]) -> str:
    """The name of the kernels with these texts."""
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()

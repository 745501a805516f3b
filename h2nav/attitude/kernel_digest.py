"""Which kernels are compiled for batches, and the name of one version of them.

The build writes the name into the extension, so that one made from older kernels is noticed.
"""

import hashlib
from collections.abc import Sequence

# files in `kernels`, in the order in which their texts are hashed
COMPILED_MODULES = (
    "shaped_layout.py",
    "shaped_motion.py",
    "shaped_theta.py",
    "shaped_doubt.py",
    "shaped_velocity.py",
    "shaped_field.py",
    "shaped_rest.py",
    "shaped.py",
    "fixed_triad.py",
    "fixed_motion.py",
    "fixed_lean.py",
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


def digest(texts: Sequence[str]) -> str:
    """The name of the kernels with these texts."""
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()

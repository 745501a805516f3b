"""The common result of all synthesis methods."""

from dataclasses import dataclass

import numpy as np

from h2nav.synthesis.plant import Matrix


@dataclass(frozen=True, slots=True)
class Candidate:
    """A gain that a method claims to be optimal; a certificate proves it."""

    method: str  # "lmi_clarabel", "lmi_scs", "riccati" or "closed_form"
    L: Matrix  # (n, p) observer gain, per second (continuous plant) or per step (discrete plant)
    claimed_h2_norm: float  # the norm that the method reports
    status: str = "solved"  # the solver's status
    wall_time_s: float | None = None  # duration; None if not measured


class SynthesisError(Exception):
    """A method found no gain; the message names the reason."""


def relative_distance(L: Matrix, reference: Matrix) -> float:
    """Distance of a gain from another one, by blocks of three states with one unit each.

    Args:
        L: (n, p).
        reference: (n, p), no block zero.
    """
    return max(
        float(np.linalg.norm(L[i : i + 3] - block) / np.linalg.norm(block))
        for i in range(0, len(reference), 3)
        for block in (reference[i : i + 3],)
    )

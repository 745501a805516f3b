"""The hash that ties a gain file's certificate to its contents, and a check without scipy.

The full check (`h2nav certify`) recomputes every figure with scipy. This one, for the start of the
daemon, needs only the standard library: the seal must match the contents, and the certificate must
state for every loop that it is stable and that its matrix inequalities hold.
"""

import hashlib
import json
import math
from collections.abc import Mapping

from h2nav.attitude.gains.envelope import FORMAT, GainFile
from h2nav.errors import BadInput
from h2nav.validation import LARGEST_DOUBLE, Within

POSITIVE = Within(math.ulp(0.0), LARGEST_DOUBLE)
NEGATIVE = Within(-LARGEST_DOUBLE, -math.ulp(0.0))


def seal(file: GainFile) -> str:
    """SHA-256 of everything that the certificate covers, as canonical JSON.

    Raises:
        ValueError: a number is not finite or a value is not plain data.
    """
    sealed = {
        "format": FORMAT,
        "kind": file.kind,
        "name": file.name,
        "rate_hz": file.rate_hz,
        "model": file.model,
        "gains": file.gains,
        "methods": file.methods,
        "fixed_point": file.fixed_point,
    }
    text = json.dumps(sealed, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def check_seal(file: GainFile, place: str) -> None:
    """Accepts a file whose seal and certificate are valid.

    Raises:
        BadInput: one line with the fault.
    """
    fault = _fault(file)
    if fault is not None:
        raise BadInput(
            f"{place}: {fault}; expected a certified gain file: make it again with h2nav "
            "synthesize, or see h2nav certify"
        )


def _fault(file: GainFile) -> str | None:
    certificate = file.certificate
    loops = certificate.get("loops")
    if not isinstance(loops, Mapping) or not loops:
        return "certificate: it has no certificate"
    try:
        now = seal(file)
    except (TypeError, ValueError) as error:
        return f"certificate.sha256: the contents cannot be hashed ({error})"
    if certificate.get("sha256") != now:
        return "certificate.sha256: model or gains were changed after they were certified"
    for name, loop in loops.items():
        if not isinstance(loop, Mapping):
            return f"certificate.loops.{name}: expected a mapping"
        abscissa, margin = loop.get("spectral_abscissa_per_s"), loop.get("lmi_margin")
        if NEGATIVE.complaint(abscissa) is not None:
            return f"certificate.loops.{name}: not stable (spectral abscissa {abscissa})"
        if POSITIVE.complaint(margin) is not None:
            return f"certificate.loops.{name}: not proved (margin {margin})"
    return None

"""The `certificate` section of a gain file: made from proofs of its loops, and verified.

Each kind of gain file has a function that rebuilds the plants of its `Loop`s from the file's model;
nothing in the certificate itself is trusted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from h2nav.attitude.gains.envelope import GainFile
from h2nav.attitude.gains.seal import seal
from h2nav.synthesis.certificate import (
    OPTIMAL,
    REPEATABLE,
    CertificateError,
    LoopCertificate,
    prove,
    verify,
)
from h2nav.synthesis.method import relative_distance
from h2nav.synthesis.plant import Matrix, Plant

# A gain may differ from its design by rounding only.
DESIGNED = 1e-9

# The rounding error is a difference of nearly equal gains from iterations.
REPEATABLE_GAIN = 1e-8


@dataclass(frozen=True, slots=True)
class Loop:
    """One closed loop that a gain file certifies."""

    name: str  # key in the certificate
    plant: Plant  # rebuilt from the model
    L: Matrix  # (n, p) the gain that the filter applies, in the plant's terms
    optimality_limit: float = OPTIMAL  # as for `certificate.verify`
    # the gain given by the model, where a rule and not the optimum of `plant` defines it; the
    # filter's gain must equal it
    design: Matrix | None = None

    def problems(self, proof: LoopCertificate) -> list[str]:
        """What is wrong with the loop's gain or its proof."""
        lines = verify(self.plant, self.L, proof, self.optimality_limit)
        if self.design is not None:
            distance = relative_distance(self.L, self.design)
            if not distance <= DESIGNED:
                lines.append(f"the gain is not the model's: off by {distance:.3g}")
        return lines


class CertificateVerdict(NamedTuple):
    """The result of checking a gain file."""

    problems: tuple[str, ...]  # everything that is wrong; empty if the certificate holds
    # recomputed, the worst of all loops; None when a loop has no proof
    spectral_abscissa_per_s: float | None
    h2_norm: float | None  # recomputed, of the first loop


def certified(file: GainFile, loops: Sequence[Loop], fixed_point: Mapping[str, object]) -> GainFile:
    """The file with its integer image and a new certificate over all its other sections.

    Args:
        file: complete except for the two sections.
        fixed_point: the section of its integer image.

    Raises:
        CertificateError: a loop cannot be proved; the message names it.
    """
    file = replace(file, fixed_point=fixed_point)
    image_problems = _image_problems(file, fixed_point)
    if image_problems:
        raise CertificateError(image_problems[0])
    sections = {}
    for loop in loops:
        try:
            proof = prove(loop.plant, loop.L)
        except CertificateError as error:
            raise CertificateError(f"loop {loop.name}: {error}") from None
        problems = loop.problems(proof)
        if problems:
            raise CertificateError(f"loop {loop.name}: {problems[0]}")
        sections[loop.name] = _section(proof)
    return replace(file, certificate={"sha256": seal(file), "loops": sections})


def checked(
    file: GainFile, loops: Sequence[Loop], fixed_point: Mapping[str, object]
) -> CertificateVerdict:
    """Checks a file's certificate against its loops, without trusting any of it.

    Args:
        loops: rebuilt from its model.
        fixed_point: the section of its integer image, computed anew from its gains.
    """
    problems = [*_seal_problems(file), *_image_problems(file, fixed_point)]
    stored = file.certificate.get("loops")
    if not isinstance(stored, Mapping):
        problems.append("certificate.loops: there is no certificate")
        stored = {}
    elif set(stored) != {loop.name for loop in loops}:
        expected = ", ".join(loop.name for loop in loops)
        problems.append(f"certificate.loops: expected exactly {expected}")
    proofs = []
    for loop in loops:
        place = f"certificate.loops.{loop.name}"
        try:
            proofs.append(prove(loop.plant, loop.L))
            if loop.name in stored:
                lines = loop.problems(_proof(stored[loop.name]))
                problems += [f"{place}: {line}" for line in lines]
        except CertificateError as error:
            problems.append(f"{place}: {error}")
        except (KeyError, TypeError, ValueError) as error:
            problems.append(f"{place}: not readable ({error!r})")
    if len(proofs) < len(loops):
        return CertificateVerdict(tuple(problems), None, None)
    abscissa = max(proof.spectral_abscissa_per_s for proof in proofs)
    return CertificateVerdict(tuple(problems), abscissa, proofs[0].h2_norm)


def _seal_problems(file: GainFile) -> list[str]:
    try:
        fresh = seal(file)
    except (TypeError, ValueError) as error:
        return [f"certificate.sha256: the contents cannot be hashed ({error})"]
    if file.certificate.get("sha256") != fresh:
        return ["certificate.sha256: stale: model or gains were changed after they were certified"]
    return []


def _image_problems(file: GainFile, fresh: Mapping[str, object]) -> list[str]:
    """What is wrong with the integer image: not that of the gains, or not stable once rounded."""
    for key in ("format", "params", "refused"):
        if file.fixed_point.get(key) != fresh.get(key):
            return [f"fixed_point.{key}: not that of the integer image of the gains"]
    if "refused" in fresh:
        return []
    problems = []
    for key, least in (("rounding_error", REPEATABLE_GAIN), ("spectral_radius", 0.0)):
        stored, now = file.fixed_point.get(key), float(str(fresh[key]))
        if not isinstance(stored, float) or not abs(stored - now) <= REPEATABLE * now + least:
            problems.append(f"fixed_point.{key}: stored {stored!r} is not the recomputed {now!r}")
    radius = float(str(fresh["spectral_radius"]))
    if not radius < 1.0:
        problems.append(
            f"fixed_point.spectral_radius: {radius:g}: the rounded gains are not stable"
        )
    return problems


def _section(proof: LoopCertificate) -> dict[str, object]:
    section: dict[str, object] = {
        "spectral_abscissa_per_s": proof.spectral_abscissa_per_s,
        "h2_norm": proof.h2_norm,
        "h2_bound": proof.h2_bound,
        "lmi_margin": proof.lmi_margin,
        "optimality_residual": proof.optimality_residual,
        "X": proof.X.tolist(),
        "Q": proof.Q.tolist(),
    }
    if proof.spectral_radius is not None:
        section["spectral_radius"] = proof.spectral_radius
    return section


def _proof(section: Mapping[str, object]) -> LoopCertificate:
    def number(key: str) -> float:
        return float(str(section[key]))

    return LoopCertificate(
        spectral_abscissa_per_s=number("spectral_abscissa_per_s"),
        spectral_radius=number("spectral_radius") if "spectral_radius" in section else None,
        h2_norm=number("h2_norm"),
        h2_bound=number("h2_bound"),
        lmi_margin=number("lmi_margin"),
        optimality_residual=number("optimality_residual"),
        X=np.asarray(section["X"], dtype=np.float64),
        Q=np.asarray(section["Q"], dtype=np.float64),
    )

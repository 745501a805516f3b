"""The `certificate` section of a gain file: made from proofs of its loops, and checked again.

A kind of gain file has a function from the file to its `Loop`s, which rebuilds every plant from
the file's model; nothing in the certificate itself is believed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from h2nav.attitude.gain_seal import seal
from h2nav.attitude.gains import GainFile
from h2nav.attitude.plant import Matrix, Plant
from h2nav.synthesis.certificate import (
    OPTIMAL,
    CertificateError,
    LoopCertificate,
    prove,
    verify,
)


@dataclass(frozen=True, slots=True)
class Loop:
    """One closed loop that a gain file vouches for.

    Attributes:
        name: key in the certificate.
        plant: rebuilt from the model.
        L: (n, p) the gain that the filter applies, in the plant's terms.
        optimality_limit: as for `certificate.verify`.
    """

    name: str
    plant: Plant
    L: Matrix
    optimality_limit: float = OPTIMAL


def certified(file: GainFile, loops: Sequence[Loop]) -> GainFile:
    """The file with a new certificate over all its other sections.

    Raises:
        CertificateError: a loop cannot be proved; the message names it.
    """
    sections = {}
    for loop in loops:
        try:
            proof = prove(loop.plant, loop.L)
        except CertificateError as error:
            raise CertificateError(f"loop {loop.name}: {error}") from None
        problems = verify(loop.plant, loop.L, proof, loop.optimality_limit)
        if problems:
            raise CertificateError(f"loop {loop.name}: {problems[0]}")
        sections[loop.name] = _section(proof)
    return replace(file, certificate={"sha256": seal(file), "loops": sections})


def problems_of(file: GainFile, loops: Sequence[Loop]) -> list[str]:
    """Everything that is wrong with a file's certificate; empty when it holds."""
    problems = []
    try:
        if file.certificate.get("sha256") != seal(file):
            problems.append("certificate.sha256: stale: model or gains were changed after it")
    except (TypeError, ValueError) as error:
        return [f"certificate.sha256: the contents cannot be hashed ({error})"]
    stored = file.certificate.get("loops")
    if not isinstance(stored, Mapping):
        return [*problems, "certificate.loops: there is no certificate"]
    if set(stored) != {loop.name for loop in loops}:
        expected = ", ".join(loop.name for loop in loops)
        problems.append(f"certificate.loops: expected exactly {expected}")
    for loop in loops:
        if loop.name not in stored:
            continue
        try:
            proof = _proof(stored[loop.name])
        except (KeyError, TypeError, ValueError) as error:
            problems.append(f"certificate.loops.{loop.name}: not readable ({error!r})")
            continue
        problems += [
            f"certificate.loops.{loop.name}: {line}"
            for line in verify(loop.plant, loop.L, proof, loop.optimality_limit)
        ]
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

"""Prints the figures behind the claims of docs/paper.md: `python tools/paper_claims.py`."""

import numpy as np

from h2nav.evaluation.paper.filter import (
    Weights,
    linearised_plant,
    literal_slides_plant,
    paper_gain,
    spectral_abscissa,
    stable_share,
)
from h2nav.evaluation.paper.trials import Assumptions, densities
from h2nav.maths.units import DEG
from h2nav.synthesis.certificate import CertificateError, accept, prove
from h2nav.synthesis.lmi import solve_lmi, solve_raw_lmi
from h2nav.synthesis.method import SynthesisError, relative_distance
from h2nav.synthesis.model import vector_sensors
from h2nav.synthesis.plant import attitude_bias_plant, discretise
from h2nav.synthesis.riccati import solve_riccati

ASSUMPTIONS = Assumptions()
VECTORS = ASSUMPTIONS.vectors


def noise_vector() -> None:
    print(
        "1. One noise vector of six for process and measurement (D_w = I), as the slides print it"
    )
    right = linearised_plant(VECTORS, Weights())
    best = solve_riccati(right)
    literal = literal_slides_plant(VECTORS)
    L = solve_riccati(literal).L
    print(f"   largest entry of B_w D_w^T: {np.abs(literal.B_w @ literal.D_w.T).max():g}, not 0")
    for name, gain in (("literal", L), ("twelve noises", best.L)):
        rates = np.linalg.eigvals(right.A - gain @ right.C_y).real
        try:
            norm = f"H2 norm {prove(right, gain).h2_norm:.3f}"
        except CertificateError as error:
            norm = f"refused: {error}"
        print(f"   {name:13}: slowest error {rates.max():+.2e} 1/s; {norm}")


def sign() -> None:
    print("2. The slides' sign: x^' = f + L0 (h(x^) - y) needs L0 = -L")
    plant = linearised_plant(VECTORS, Weights())
    L = solve_riccati(plant).L
    for name, gain in (("L0 = -L", L), ("L0 = +L", -L)):
        print(f"   {name}: {np.linalg.eigvals(plant.A - gain @ plant.C_y).real.max():+.3f} 1/s")


def raw_lmi() -> None:
    print("3. The LMI in physical units against the scaled one (MPU-9250, gyro bias walk varied)")
    noise = densities(ASSUMPTIONS)
    sensors = vector_sensors(noise)
    for walk in (2e-4 * DEG, 1e-5 * DEG):
        continuous = attitude_bias_plant(noise.gyro, walk, sensors)
        for plant in (continuous, discretise(continuous, 0.01)):
            when = "100 Hz" if plant.dt_s else "continuous"
            best = solve_riccati(plant)
            print(f"   bias walk {walk / DEG:.0e} deg/s/rts, {when}: optimum 1")
            for name, solve in (("raw", solve_raw_lmi), ("scaled", solve_lmi)):
                for solver in ("CLARABEL", "SCS"):
                    try:
                        claim = solve(plant, solver)
                    except SynthesisError as error:
                        print(f"     {name:6} {solver:8} {error}")
                        continue
                    try:
                        true = f"{prove(plant, claim.L).h2_norm / best.claimed_h2_norm:.4f}"
                        accept(plant, claim)
                        verdict = "certified"
                    except CertificateError as error:
                        true = true if "unstable" not in str(error) else "unstable"
                        verdict = "refused"
                    print(
                        f"     {name:6} {solver:8} says {claim.status!r}, norm "
                        f"{claim.claimed_h2_norm / best.claimed_h2_norm:.4f}; true norm {true}; "
                        f"gain off by {relative_distance(claim.L, best.L):.1e}; {verdict}"
                    )


def stability() -> None:
    print("4. The Euler gain L0, linearised at zero, at resting attitudes")
    L = paper_gain(VECTORS)
    for number, name in enumerate(("roll", "pitch", "yaw")):
        angles = np.zeros((1801, 3))
        angles[:, number] = np.linspace(0.0, 180.0, 1801) * DEG
        unstable = spectral_abscissa(L, VECTORS, angles) >= 0.0
        print(f"   {name}: unstable from {angles[unstable, number].min() / DEG:.1f} deg on")
    for tilt_deg in (15.0, 30.0, 45.0):
        share = 1.0 - stable_share(VECTORS, tilt_deg)
        print(f"   |roll|, |pitch| up to {tilt_deg:.0f} deg, any heading: {share:.1%} unstable")


def cost() -> None:
    print("5. Multiplications of one step (n states, p measurements, dense matrices)")
    n, p = 6, 6
    kinematics, measurement = 9 + 9, 2 * 9
    constant_gain = kinematics + measurement + n * p + n
    propagate = kinematics + 2 * n**3
    gain = p * n * n + p * p * n + p**3 + n * p * p
    update = measurement + n * p + n * n * p
    ekf = propagate + gain + update + 18 * 3
    print(f"   constant gain {constant_gain}, EKF {ekf}: 1/{ekf / constant_gain:.0f}")


def main() -> None:
    for claim in (noise_vector, sign, raw_lmi, stability, cost):
        claim()


if __name__ == "__main__":
    main()

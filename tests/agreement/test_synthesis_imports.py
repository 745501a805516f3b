"""The daemon's way to its gains needs no solver: proved by what a fresh interpreter has loaded."""

import subprocess
import sys

LIGHT = """
import sys
from h2nav.attitude import filter, samples
from h2nav.attitude.velocity_aided.integer import filter, gains
from h2nav.attitude.gains import envelope, seal
from h2nav.files import gain_files
for name in gain_files.shipped():
    gain_files.load(name)
heavy = {"cvxpy", "scipy", "matplotlib", "numpy", "clarabel", "scs"} & set(sys.modules)
print(",".join(sorted(heavy)))
"""

CERTIFY = """
import sys
from h2nav.cli import main
status = main(["certify", "mpu9250_100hz"])
print(status, "cvxpy" in sys.modules)
"""


def output_of(program: str) -> str:
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=120
    )
    return result.stdout.strip()


def test_loading_gains_needs_neither_solver_nor_numpy() -> None:
    assert output_of(LIGHT) == ""


def test_certify_needs_no_solver() -> None:
    assert output_of(CERTIFY).endswith("0 False")

"""`ConstantGainReference` and its flight, compiled: an hour at 400 Hz takes seconds."""

import ctypes
import subprocess
from pathlib import Path

import needs
import numpy as np

from h2nav.attitude.constant_gain.gains import (
    DIP_TOLERANCE,
    FIELD_TOLERANCE,
    FORCE_TOLERANCE,
    ConstantGains,
)

SOURCE = Path(__file__).with_name("constant_gain_reference.c")
Q, BIAS = slice(0, 4), slice(4, 7)
MEMORY_SIZE = 11


class CompiledReference:
    """The filter and the flight in C.

    Args:
        folder: where the library is built.
        gains: as for `ConstantGainReference`.
        boost_s: as for `ConstantGainReference`.
    """

    def __init__(self, folder: Path, gains: ConstantGains, boost_s: float) -> None:
        library = folder / "constant_gain_reference.so"
        compiler = needs.need_program("gcc")
        flags = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC")
        subprocess.run([compiler, *flags, SOURCE, "-lm", "-o", library], check=True)
        self._c = ctypes.CDLL(str(library))
        self._dt = 1.0 / gains.rate_hz
        tolerances = (FORCE_TOLERANCE, FIELD_TOLERANCE, DIP_TOLERANCE)
        scalars = (gains.gravity_weight, gains.dip_rad, boost_s, self._dt)
        self._settings = np.array([*gains.attitude, *gains.bias, *scalars, *tolerances])
        self.memory = np.zeros(MEMORY_SIZE)
        self.q_true = np.array([1.0, 0.0, 0.0, 0.0])

    def fly(self, rates: np.ndarray) -> np.ndarray:
        """Matrices (N, 3, 3), body to NED, of the true attitude after each row of rates, rad/s."""
        rates = np.ascontiguousarray(rates)
        matrices = np.empty((len(rates), 3, 3))
        self._c.fly(
            _at(self.q_true), ctypes.c_double(self._dt), _at(rates),
            ctypes.c_size_t(len(rates)), _at(matrices),
        )  # fmt: skip
        return matrices

    def start(self, q: np.ndarray) -> None:
        """The first attitude."""
        self.memory[:] = 0.0
        self.memory[Q] = q / np.linalg.norm(q)

    def run(self, samples: np.ndarray) -> np.ndarray:
        """Attitude and bias (N, 7) after each row of rate, gravity, field, has field (N, 10)."""
        samples = np.ascontiguousarray(samples)
        results = np.empty((len(samples), 7))
        self._c.run_reference(
            _at(self.memory), _at(self._settings), _at(samples),
            ctypes.c_size_t(len(samples)), _at(results),
        )  # fmt: skip
        return results


def _at(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)

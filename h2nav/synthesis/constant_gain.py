"""The constant-gain filter's section of a gain file: its integers and their stability."""

import math

import numpy as np
import numpy.typing as npt

from h2nav.attitude.constant_gain.gains import ConstantGains, Matrix, integer_gains_of
from h2nav.attitude.constant_gain.memory import Gains
from h2nav.attitude.gains.envelope import GainFile
from h2nav.attitude.record import values


def fixed_point_section(file: GainFile, place: str) -> dict[str, object]:
    """The `fixed_point` section: the integers, their rounding error, stability after rounding.

    Raises:
        BadInput: the file's gains are not usable, or outside the fixed-point format.
    """
    image = integer_gains_of(file, place)
    return {
        "format": "lean-1",
        "params": values(image.gains, Gains),
        "rounding_error": image.rounding_error,
        "spectral_radius": spectral_radius(image.rounded),
    }


def spectral_radius(gains: ConstantGains) -> float:
    """Largest magnitude of an eigenvalue of the filter's error from sample to sample.

    Below one, the filter with exactly these gains is stable. The error has six states, attitude and
    bias; with a correction that acts one step later there are nine.

    Source: docs/fixed-point.md Eq. (14).
    """
    w, dip, dt = gains.gravity_weight, gains.dip_rad, 1.0 / gains.rate_hz
    h = np.array([math.cos(dip), 0.0, math.sin(dip)])
    down = np.array([0.0, 0.0, 1.0])
    share = np.diag([1.0 - w, 1.0 - w, 1.0])
    m = w * (np.eye(3) - np.outer(down, down)) + share @ (np.eye(3) - np.outer(h, h))
    attitude, bias = _full(gains.attitude) @ m, _full(gains.bias) @ m
    one, none = np.eye(3), np.zeros((3, 3))
    # error, bias error, correction still to come
    after_turn = np.block([[one, -dt * one, -one], [none, one, none], [none, none, none]])
    use = np.block([[one, none, none], [bias, one, none], [attitude, none, none]])
    return float(np.abs(np.linalg.eigvals(use @ after_turn)).max())


def _full(matrix: Matrix) -> npt.NDArray[np.float64]:
    xx, xz, yy, zx, zz = matrix
    return np.array([[xx, 0.0, xz], [0.0, yy, 0.0], [zx, 0.0, zz]])

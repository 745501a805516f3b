"""An attitude from gravity and field in integers, against scipy and at its limits."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.integer.triad import Q_LIMIT, inverse_root, triad

RANDOM = np.random.default_rng(2)
ATTITUDES = [
    *Rotation.random(40, random_state=2),
    # every element of the quaternion is the largest once, with either sign of the others
    *(
        Rotation.from_rotvec(angle * np.array(axis))
        for axis in np.eye(3)
        for angle in (0.0, 1.0, -1.0, 3.1, -3.1, math.pi)
    ),
]
DIP = 60.0 * math.pi / 180.0


def whole(vector):
    return [round(float(part) * 2.0**14) for part in vector]


def found(attitude, *, down=1.0, field=1.0, dip=DIP):
    """The attitude that is found of a vehicle in this one, None where there is none."""
    q = [0] * 4
    seen = attitude.inv().apply(field * np.array((math.cos(dip), 0.0, math.sin(dip))))
    if not triad(whole(attitude.inv().apply((0.0, 0.0, down))), whole(seen), q):
        assert q == [0] * 4
        return None
    assert max(map(abs, q)) <= Q_LIMIT
    size = np.linalg.norm(np.array(q) / 2.0**29)
    assert 0.995 < size < 1.0  # never longer than one
    return Rotation.from_quat(np.roll(np.array(q, float), -1))


@pytest.mark.parametrize("down", [0.52, 1.0, 1.2])
@pytest.mark.parametrize("field", [0.3, 1.0, 1.2])
def test_the_attitude_is_that_of_both_directions(down, field):
    for attitude in ATTITUDES:
        error = (found(attitude, down=down, field=field) * attitude.inv()).magnitude()
        assert error < (2e-3 if field == 0.3 else 6e-4)


@pytest.mark.parametrize(
    ("dip_deg", "is_found"),
    [(0.0, True), (88.9, True), (-88.9, True), (89.4, False), (-89.4, False), (90.0, False)],
)
def test_a_field_along_the_vertical_shows_no_heading(dip_deg, is_found):
    """Its horizontal part has to be a sixty-fourth of one at least."""
    for attitude in ATTITUDES[:10]:
        dip = dip_deg * math.pi / 180.0
        made = found(attitude, dip=dip)
        assert (made is not None) is is_found
        if made is not None:
            error = (made * attitude.inv()).magnitude()
            assert error < 2e-2
    assert found(ATTITUDES[0], field=0.0) is None


@pytest.mark.parametrize("norm", [0.25, 0.26, 0.5, 0.999, 1.0, 1.1, 1.5])
def test_the_inverse_root(norm):
    root = inverse_root(round(norm * 2.0**26)) / 2.0**14
    assert root == pytest.approx(1.0 / math.sqrt(norm), abs=3e-4)


@pytest.mark.parametrize(("norm", "as_if"), [(0.1, 0.25), (0.0, 0.25), (3.0, 1.5)])
def test_a_length_beyond_its_range_counts_as_the_nearest(norm, as_if):
    assert inverse_root(round(norm * 2.0**26)) == inverse_root(round(as_if * 2.0**26))

"""What the keys of the motion sections mean."""

import math

import pytest

from h2nav.errors import BadInput
from h2nav.motion.settings import OdometrySettings, TwistObserverSettings
from h2nav.motion.wheels import CorrectedChassis, DifferentialDrive, OmniDrive

ROWS = COLUMNS = ("ahead", "left", "turn")
OMNI = {"layout": "omni", "arm_m": 0.3, "angle_1_deg": 30.0, "angle_2_deg": 150.0}


def test_a_reading_is_scaled_by_the_radius_of_its_wheel_over_the_autopilots():
    radii = {"radius_left_m": 0.2, "radius_right_m": 0.3, "radius_1_m": 0.4, "radius_2_m": 0.5}
    chosen = OdometrySettings(**radii, radius_3_m=0.6, autopilot_radius_m=0.1)
    assert chosen.scales == pytest.approx((2.0, 3.0))
    omni = OdometrySettings(**radii, **OMNI, radius_3_m=0.6, autopilot_radius_m=0.1)
    assert omni.scales == pytest.approx((4.0, 5.0, 6.0))


@pytest.mark.parametrize("row", ROWS)
@pytest.mark.parametrize("column", COLUMNS)
def test_a_correction_has_the_row_and_the_column_of_its_name(row, column):
    settings = OdometrySettings(**{f"{row}_per_{column}": 0.7})
    matrix = settings.correction
    assert matrix[ROWS.index(row)][COLUMNS.index(column)] == 0.7
    identity = [[float(i == j) for j in range(3)] for i in range(3)]
    identity[ROWS.index(row)][COLUMNS.index(column)] = 0.7
    assert [list(line) for line in matrix] == identity
    assert settings.chassis() == CorrectedChassis(DifferentialDrive(0.5), matrix)


def test_the_layout_chooses_the_chassis():
    assert OdometrySettings(track_m=0.8).chassis() == DifferentialDrive(0.8)
    omni = OdometrySettings(**OMNI, angle_3_deg=270.0).chassis()
    assert isinstance(omni, OmniDrive)
    assert omni.arm_m == 0.3
    assert omni.wheel_angles_rad == pytest.approx([math.radians(a) for a in (30, 150, 270)])
    with pytest.raises(BadInput, match="30, 150, 150"):
        OdometrySettings(**OMNI, angle_3_deg=150.0).chassis()


@pytest.mark.parametrize("a1", [0.5, 1.001, math.nan])
@pytest.mark.parametrize("gain", [0.0009, 1000.1, math.nan])
def test_every_gain_that_is_none_is_named(a1, gain):
    with pytest.raises(BadInput) as caught:
        TwistObserverSettings(k1=gain, k2=-gain, a1=a1)
    assert all(name in str(caught.value) for name in ("a1 = ", "k1 = ", "k2 = "))


def test_gains_at_their_bounds_are_taken():
    settings = TwistObserverSettings(k1=1e-3, k2=1e3, a1=1.0)
    assert settings.gains == (1e-3, 1e3, 1.0)
    assert settings.gains.a2 == 1.0

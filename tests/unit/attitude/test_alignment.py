import math

import pytest
from needs import DEG
from synthetic_imu import FIELD_N, GRAVITY, brisk, fly, still

from h2nav.attitude.alignment import attitude, begin, extend, triad
from h2nav.attitude.samples import ImuSample
from h2nav.maths import quaternion

ATTITUDES = [
    (0.0, 0.0, 0.0),
    (30.0, -20.0, 170.0),
    (180.0, 0.0, -60.0),
    (0.0, 90.0, 0.0),
    (0.0, -90.0, 100.0),
]


@pytest.mark.parametrize("euler_deg", ATTITUDES)
def test_triad_is_exact_at_every_attitude(euler_deg: tuple[float, float, float]) -> None:
    roll, pitch, yaw = (angle * DEG for angle in euler_deg)
    q = quaternion.from_euler(roll, pitch, yaw)
    back = quaternion.conjugate(q)
    force = quaternion.rotate(back, (0.0, 0.0, -GRAVITY))
    field = quaternion.rotate(back, FIELD_N)
    assert quaternion.angle(triad(force, field), q) < 1e-14


@pytest.mark.parametrize("euler_deg", ATTITUDES)
def test_without_a_field_gravity_still_points_down(euler_deg: tuple[float, float, float]) -> None:
    roll, pitch, yaw = (angle * DEG for angle in euler_deg)
    back = quaternion.conjugate(quaternion.from_euler(roll, pitch, yaw))
    force = quaternion.rotate(back, (0.0, 0.0, -GRAVITY))
    assert quaternion.rotate(triad(force, None), force) == pytest.approx(
        (0.0, 0.0, -GRAVITY), abs=1e-12
    )


def test_a_field_along_gravity_gives_no_heading_but_an_attitude() -> None:
    assert triad((0.0, 0.0, -1.0), (0.0, 0.0, 50.0)) == pytest.approx(quaternion.IDENTITY)


@pytest.mark.parametrize("force", [(0.0, 0.0, 0.0), (math.nan, 0.0, 0.0)])
def test_no_force_is_no_alignment(force: quaternion.Vec3) -> None:
    with pytest.raises(ValueError, match="no direction"):
        triad(force, None)


def test_a_field_of_zero_is_none() -> None:
    sample = ImuSample(0, (0.0, 0.0, 0.0), (0.0, 0.0, -GRAVITY), (0.0, 0.0, 0.0))
    window = extend(begin(sample), sample._replace(t_us=10_000, m_b_ut=FIELD_N), (0.0, 0.0, 0.0))
    assert (window.forces, window.fields, window.field) == (2, 1, FIELD_N)


@pytest.mark.parametrize("law", [still, brisk])
def test_the_window_averages_while_the_vehicle_turns(law) -> None:  # type: ignore[no-untyped-def]
    flight = fly(law, 0.5, 1, bias_b=(0.0, 0.0, 0.0))
    window = begin(flight.samples[0])
    for sample in flight.samples[1:]:
        window = extend(window, sample, (0.0, 0.0, 0.0))
    assert window.length_s == pytest.approx(0.49)
    assert window.forces == window.fields == 50
    assert quaternion.angle(attitude(window), flight.q_nb[-1]) < 0.2 * DEG

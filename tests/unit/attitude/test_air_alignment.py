"""Alignment in flight alone, from exact samples and velocities."""

import math
from typing import NamedTuple

import pytest
from needs import DEG
from synthetic_imu import FIELD, FIELD_N, GRAVITY
from velocity_flights import tilt_apart, turning

from h2nav.attitude.samples import Quat, Vec3
from h2nav.attitude.velocity_aided.air_alignment import (
    LONGEST_S,
    SHORTEST_S,
    AirAlignment,
    AirReference,
    Leveled,
)
from h2nav.maths import quaternion

START = quaternion.from_euler(20.0 * DEG, -15.0 * DEG, 70.0 * DEG)
# What is believed at the end: a false tilt, and a heading that is false by 90 deg.
BELIEVED = quaternion.from_euler(5.0 * DEG, 10.0 * DEG, 0.0)
KNOWN = AirReference(FIELD.norm_ut, FIELD.dip_rad, FIELD.declination_rad, 0.1, 10.0 * DEG)
UNKNOWN = KNOWN._replace(norm=0.0)
DT_US = 10_000
SIGMA_M_S = 0.1


class Sample(NamedTuple):
    """An exact sample, and the truth with it."""

    t_us: int
    w_b: Vec3
    f_b: Vec3
    m_b: Vec3
    v_n: Vec3
    q_nb: Quat


def acceleration(t: float) -> Vec3:
    """Level, and never along a straight line."""
    return (4.0 * math.sin(2.0 * t), 3.0 * math.cos(1.7 * t), 0.0)


def exact(seconds: float, a_n=acceleration) -> list[Sample]:
    q: Quat = START
    v: Vec3 = (30.0, -12.0, 0.0)
    samples = []
    for i in range(1, round(seconds * 1e6) // DT_US + 1):
        t = i * DT_US * 1e-6
        w, a = turning(t), a_n(t)
        q = quaternion.multiply(q, quaternion.exp((0.01 * w[0], 0.01 * w[1], 0.01 * w[2])))
        v = (v[0] + 0.01 * a[0], v[1] + 0.01 * a[1], 0.0)
        back = quaternion.conjugate(q)
        f = quaternion.rotate(back, (a[0], a[1], -GRAVITY))
        samples.append(Sample(i * DT_US, w, f, quaternion.rotate(back, FIELD_N), v, q))
    return samples


def feed(window: AirAlignment, samples: list[Sample], field: bool = True) -> AirAlignment:
    """Every sample, and every twentieth velocity."""
    for s in samples:
        window.add(s.t_us, s.w_b, s.f_b, s.m_b if field else None, 0.0)
        if s.t_us % (20 * DT_US) == 0:
            window.take(s.t_us, s.v_n)
    return window


def solved(window: AirAlignment, reference: AirReference, times: int = 1) -> Leveled:
    """What a window shows; again from what it has shown, as with every fix, if `times` > 1."""
    q_nb = BELIEVED
    for _ in range(times):
        found = window.solve(q_nb, reference, SIGMA_M_S)
        assert found is not None
        q_nb = found.q_nb
    return found


def test_exact_inputs_with_a_field_give_the_exact_attitude() -> None:
    samples = exact(3.0)
    found = solved(feed(AirAlignment(0), samples), KNOWN)
    assert quaternion.angle(found.q_nb, samples[-1].q_nb) < 1e-3
    assert found.length_s == pytest.approx(3.0)
    assert found.heading_sigma_rad < math.inf


def test_without_a_field_the_velocities_give_the_heading_too() -> None:
    samples = exact(3.0)
    window = feed(AirAlignment(0), samples, field=False)
    found = solved(window, UNKNOWN)
    assert quaternion.angle(found.q_nb, samples[-1].q_nb) < 0.5 * DEG
    again = solved(window, UNKNOWN, 2)
    assert quaternion.angle(again.q_nb, samples[-1].q_nb) < 1e-3
    assert found.heading_sigma_rad < 5.0 * DEG


def test_without_field_and_acceleration_the_tilt_is_exact_and_no_heading_is_claimed() -> None:
    samples = exact(3.0, a_n=lambda _t: (0.0, 0.0, 0.0))
    found = solved(feed(AirAlignment(0), samples, field=False), UNKNOWN)
    assert tilt_apart(found.q_nb, samples[-1].q_nb) < 1e-3
    assert found.heading_sigma_rad == math.inf


@pytest.mark.parametrize("scale", [0.5, 1.5])
def test_a_field_of_another_norm_gives_no_heading(scale: float) -> None:
    """It points elsewhere, of the right dip; the velocities give the heading instead."""
    x, y, z = quaternion.rotate(quaternion.from_euler(0.0, 0.0, 1.0), FIELD_N)
    other = (scale * x, scale * y, scale * z)
    samples = [
        s._replace(m_b=quaternion.rotate(quaternion.conjugate(s.q_nb), other)) for s in exact(3.0)
    ]
    found = solved(feed(AirAlignment(0), samples), KNOWN, 2)
    assert quaternion.angle(found.q_nb, samples[-1].q_nb) < 1e-3


def test_velocities_that_come_late_are_used_at_their_own_time() -> None:
    samples = exact(3.0)
    window = AirAlignment(0)
    for i, s in enumerate(samples):
        window.add(s.t_us, s.w_b, s.f_b, s.m_b, 0.0)
        if i % 20 == 19 and i >= 30:
            window.take(samples[i - 30].t_us, samples[i - 30].v_n)
    found = solved(window, KNOWN)
    assert quaternion.angle(found.q_nb, samples[-1].q_nb) < 1e-3


def test_a_short_window_and_few_velocities_show_nothing() -> None:
    short = feed(AirAlignment(0), exact(SHORTEST_S - 0.1))
    assert short.solve(BELIEVED, KNOWN, SIGMA_M_S) is None
    few = AirAlignment(0)
    for s in exact(2.0):
        few.add(s.t_us, s.w_b, s.f_b, s.m_b, 0.0)
        if s.t_us % 700_000 == 0:
            few.take(s.t_us, s.v_n)
    assert few.solve(BELIEVED, KNOWN, SIGMA_M_S) is None


def test_velocities_that_no_force_explains_show_nothing() -> None:
    """The receiver says 50 m/s^2, the force says one g."""
    samples = [s._replace(v_n=(50e-6 * s.t_us, 0.0, 0.0)) for s in exact(2.0)]
    assert feed(AirAlignment(0), samples).solve(BELIEVED, KNOWN, SIGMA_M_S) is None


def test_a_window_ends_after_its_longest_time() -> None:
    window = AirAlignment(1_000_000)
    assert not window.is_over(round(1e6 + LONGEST_S * 1e6))
    assert window.is_over(round(1e6 + LONGEST_S * 1e6) + 1)


def test_a_window_made_from_its_values_goes_on_identically() -> None:
    samples = exact(3.0)
    window = feed(AirAlignment(0), samples[:170])
    again = AirAlignment.of(window.values())
    assert again.values() == window.values()
    feed(window, samples[170:])
    feed(again, samples[170:])
    assert again.values() == window.values()
    assert solved(again, KNOWN) == solved(window, KNOWN)


# --- what is just enough, and just too little -----------------------------------------------------


def at_rest(count: int, length_s: float, field: Vec3 = FIELD_N, latency_s: float = 0.0):
    """A level window without acceleration, with so many velocities, evenly from its end back."""
    window = AirAlignment(0)
    steps = round(length_s * 100)
    taken = {steps - (steps - 1) * i // max(count - 1, 1) for i in range(count)}
    for i in range(1, steps + 1):
        window.add(i * DT_US, (0.0, 0.0, 0.0), (0.0, 0.0, -GRAVITY), field, latency_s)
        if i in taken:
            window.take(i * DT_US, (5.0, -3.0))
    return window.solve(quaternion.IDENTITY, KNOWN, SIGMA_M_S)


@pytest.mark.parametrize(
    ("count", "length_s", "is_solved"),
    [(4, 1.0, True), (3, 1.0, False), (4, 0.99, False), (9, 4.0, True)],
)
def test_a_second_and_four_velocities_are_enough(count, length_s, is_solved) -> None:
    found = at_rest(count, length_s)
    assert (found is not None) is is_solved
    if found is not None:
        assert found.length_s == pytest.approx(length_s)


def test_a_tilt_is_as_certain_as_velocities_by_their_times() -> None:
    """Of a line through noisy velocities: sqrt(2 / sum of squares about their mean time) / g."""
    found = at_rest(4, 1.0)
    times_s = [1.0 - 0.01 * (99 * i // 3) for i in range(4)]
    mean_s = sum(times_s) / 4
    spread = sum((t_s - mean_s) ** 2 for t_s in times_s)
    assert found.tilt_sigma_rad == pytest.approx(math.sqrt(2.0 / spread) * SIGMA_M_S / GRAVITY)
    assert found.heading_sigma_rad == pytest.approx(5.0 * DEG)


def leaned(field_scale=1.0, more_dip_deg=0.0, dip_deg=None):
    """The deviation of a heading by a field of another norm and dip than that of the reference."""
    dip = FIELD.dip_rad + more_dip_deg * DEG if dip_deg is None else dip_deg * DEG
    size, angle = field_scale * FIELD.norm_ut, FIELD.declination_rad
    field = (size * math.cos(dip) * math.cos(angle), size * math.cos(dip) * math.sin(angle),
             size * math.sin(dip))  # fmt: skip
    return at_rest(6, 2.0, field)


@pytest.mark.parametrize(
    ("how", "gives"),
    [
        ({"field_scale": 1.09}, True),
        ({"field_scale": 1.11}, False),
        ({"field_scale": 0.91}, True),
        ({"field_scale": 0.89}, False),
        ({"more_dip_deg": 9.9}, True),
        ({"more_dip_deg": 10.1}, False),
        ({"more_dip_deg": -9.9}, True),
        ({"more_dip_deg": -10.1}, False),
    ],
)
def test_a_field_of_the_references_norm_and_dip_gives_a_heading(how, gives) -> None:
    found = leaned(**how)
    assert (found.heading_sigma_rad < math.inf) is gives
    assert quaternion.angle(found.q_nb, quaternion.IDENTITY) < 1e-6


@pytest.mark.parametrize(("dip_deg", "gives"), [(86.9, True), (87.3, False), (-87.3, False)])
def test_a_field_along_the_force_gives_no_heading(dip_deg, gives) -> None:
    """Its part across is a twentieth."""
    steep = KNOWN._replace(dip_rad=dip_deg * DEG, dip_gate_rad=20.0 * DEG)
    window = AirAlignment(0)
    field = (50.0 * math.cos(dip_deg * DEG), 0.0, 50.0 * math.sin(dip_deg * DEG))
    for i in range(1, 201):
        window.add(i * DT_US, (0.0, 0.0, 0.0), (0.0, 0.0, -GRAVITY), field, 0.0)
        if i % 20 == 0:
            window.take(i * DT_US, (5.0, -3.0))
    found = window.solve(quaternion.IDENTITY, steep._replace(norm=50.0), SIGMA_M_S)
    assert (found.heading_sigma_rad < math.inf) is gives


def test_a_field_is_that_of_its_own_time() -> None:
    """A vehicle that yaws, of which each field is 50 ms old."""
    rate, window = 1.0, AirAlignment(0)
    for i in range(1, 201):
        then = quaternion.from_euler(0.0, 0.0, rate * (0.01 * i - 0.05))
        m_b = quaternion.rotate(quaternion.conjugate(then), FIELD_N)
        window.add(i * DT_US, (0.0, 0.0, rate), (0.0, 0.0, -GRAVITY), m_b, 0.05)
        if i % 20 == 0:
            window.take(i * DT_US, (5.0, -3.0))
    found = window.solve(quaternion.from_euler(0.0, 0.0, 1.3), KNOWN, SIGMA_M_S)
    assert quaternion.angle(found.q_nb, quaternion.from_euler(0.0, 0.0, 2.0 * rate)) < 1e-3


@pytest.mark.parametrize(("t_us", "counts"), [(-1, False), (0, True), (4_000_000, True)])
def test_velocities_of_the_window_count(t_us, counts) -> None:
    window = AirAlignment(0)
    window.take(5, (1.0, 2.0))
    assert not any(window.values()[12:]), "without a sample before it"
    window.add(10_000, (0.0, 0.0, 0.0), (0.0, 0.0, -GRAVITY), None, 0.0)
    before = window.values()
    window.take(t_us, (1.0, 2.0))
    assert (window.values() != before) is counts

"""Drawn flights: their physics, what is drawn, whom they hold to account, and how they shrink."""

import dataclasses
import math
from array import array
from pathlib import Path

import numpy as np
import pytest
from needs import DEG, REPOSITORY

from h2nav.errors import BadInput
from h2nav.evaluation.campaign import blame
from h2nav.evaluation.campaign.blame import Told, can_be_told, false_reports, fault_row
from h2nav.evaluation.campaign.distribution import Range, read_distribution
from h2nav.evaluation.campaign.draw import (
    FORMS,
    SECTIONS,
    VEHICLES,
    AccelerometerDraw,
    CompassDraw,
    Draw,
    FlightDraw,
    GyroDraw,
    ImuDraw,
    LinkDraw,
    ReceiverDraw,
    as_text,
    read_draw,
)
from h2nav.evaluation.campaign.effects import shows, without
from h2nav.evaluation.campaign.flight import (
    BOOT_US,
    events,
    link_gaps_s,
    place_of,
    reported_attitudes,
    simulated,
)
from h2nav.evaluation.campaign.motion import DrawnMotion
from h2nav.evaluation.campaign.scores import Errors, HeardDraw, longest_run, score
from h2nav.evaluation.campaign.shown import faulty, shown
from h2nav.evaluation.campaign.shrinking import shrink
from h2nav.evaluation.campaign.summary import badness, summary, table, worst
from h2nav.files.earth_field import earth_field_at
from h2nav.integrity.findings import Finding, Sensor, Severity
from h2nav.integrity.kinds import Kind, SensorKind
from h2nav.maths.attitude_errors import errors
from h2nav.maths.rows import product
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.sim.faults import parse_fault
from h2nav.wire.imu import ImuReading
from h2nav.wire.position import GpsFix, NoFix

SHIPPED = REPOSITORY / "configs" / "campaign.yaml"
BRISK = FlightDraw(manoeuvre_m_s2=5.0, brisk_share=0.7, gust_m_s=1.5, wind_m_s=6.0, length_min=2.0)
IDEAL = {
    "imu": ImuDraw(jitter_ms=0.0, delay_ms=0.0, vibration_m_s2=0.0, rate_hz=100.0),
    "gyro": GyroDraw(0.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0),
    "accelerometer": AccelerometerDraw(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "compass": CompassDraw(1, 100.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "receiver": ReceiverDraw(delay_s=0.0, noise_m_s=0.0, lever_arm_m=0.0),
    "link": LinkDraw(latency_ms=0.0),
}


def ideal(vehicle="copter", **changes):
    draw = Draw(7, flight=dataclasses.replace(BRISK, vehicle=vehicle), **{**IDEAL, **changes})
    return simulated(draw, earth_field_at(*place_of(draw), 1.8e9))


@pytest.fixture(scope="module", params=VEHICLES)
def perfect(request):
    """A flight of each vehicle whose sensors have no error."""
    return ideal(request.param)


# --- physics ------------------------------------------------------------------------------------


def test_the_rates_of_a_perfect_gyro_turn_into_the_true_attitude(perfect):
    found = perfect.imus[0]
    half = 0.5 * np.diff(found.t_s)[:, None] * 0.5 * (found.w_b[1:] + found.w_b[:-1])
    angle = np.linalg.norm(half, axis=1, keepdims=True)
    turns = np.hstack((np.cos(angle), np.sinc(angle / np.pi) * half))
    true = perfect.motion.at(found.t_s).q_nb
    q = true[:1]
    for turn in turns:
        q = product(q, turn[None])
    assert errors(q, true[-1:], np.ones(1, bool), True).total[0] < 0.02


def test_the_force_of_a_perfect_accelerometer_turns_into_the_true_velocity(perfect):
    found = perfect.imus[0]
    true = perfect.motion.at(found.t_s)
    a_n = np.einsum("nij,nj->ni", true.to_ned, found.f_b) + np.array([0.0, 0.0, GRAVITY_M_S2])
    steps = 0.5 * (a_n[1:] + a_n[:-1]) * np.diff(found.t_s)[:, None]
    v_n = true.v_n[0] + np.vstack((np.zeros(3), np.cumsum(steps, axis=0)))
    assert np.abs(v_n - true.v_n).max() < 0.01
    assert np.abs(true.v_n).max() > 2.0


def test_at_rest_the_force_is_gravity_upward_and_nothing_turns(perfect):
    still = perfect.imus[0].t_s < perfect.draw.flight.rest_s - 3.0
    assert np.allclose(perfect.imus[0].f_b[still], [0.0, 0.0, -GRAVITY_M_S2], atol=1e-9)
    assert np.allclose(perfect.imus[0].w_b[still], 0.0, atol=1e-12)


def test_the_field_turned_by_the_truth_is_the_earths(perfect):
    found, field = perfect.imus[0], perfect.field
    m_n = np.einsum("nij,nj->ni", perfect.motion.at(found.t_s).to_ned, found.m_b_ut)
    assert np.allclose(np.linalg.norm(m_n, axis=1), field.norm_ut, atol=1e-9)
    assert np.allclose(np.arctan2(m_n[:, 1], m_n[:, 0]), field.declination_rad)
    assert np.allclose(np.arctan2(m_n[:, 2], np.hypot(*m_n[:, :2].T)), field.dip_rad)


def test_fixes_have_the_velocity_and_its_integral(perfect):
    fixes = perfect.fixes
    assert np.allclose(fixes.v_n, perfect.motion.at(fixes.t_s).v_n, atol=1e-9)
    moved = 0.5 * (fixes.v_n[1:] + fixes.v_n[:-1]) * np.diff(fixes.t_s)[:, None]
    assert np.abs(np.cumsum(moved, axis=0) - (fixes.p_n[1:] - fixes.p_n[0])).max() < 0.3


def test_a_late_receiver_off_the_centre_sees_an_earlier_motion_and_its_own_turns():
    arm = ReceiverDraw(delay_s=0.3, noise_m_s=0.0, lever_arm_m=1.0)
    flight = ideal(receiver=arm)
    true = flight.motion.at(flight.fixes.t_s - 0.3)
    apart = np.linalg.norm(flight.fixes.v_n - true.v_n, axis=1)
    assert (apart <= np.linalg.norm(true.w_b, axis=1) + 1e-9).all()
    assert apart.max() > 0.2


def test_a_receiver_states_its_noise_as_smaller_as_its_draw_says():
    own = ReceiverDraw(delay_s=0.0, noise_m_s=0.3, noise_over_stated=1.5, lever_arm_m=0.0)
    fixes, exact = ideal(receiver=own).fixes, ideal().fixes
    assert fixes.sigma_m_s == pytest.approx(0.2)
    assert (fixes.v_n - exact.v_n).std() == pytest.approx(0.3, rel=0.1)


def test_sensor_noise_has_the_density_of_the_data_sheet():
    flight = ideal(
        gyro=dataclasses.replace(IDEAL["gyro"], noise_deg_s_rthz=0.01),
        accelerometer=dataclasses.replace(IDEAL["accelerometer"], noise_ug_rthz=300.0),
    )
    found, perfect = flight.imus[0], ideal().imus[0]
    root_hz = math.sqrt(0.5 * 100.0)
    assert (found.w_b - perfect.w_b).std() == pytest.approx(0.01 * DEG * root_hz, rel=0.02)
    force = 300e-6 * GRAVITY_M_S2 * root_hz
    assert (found.f_b - perfect.f_b).std() == pytest.approx(force, rel=0.02)


def test_a_gyro_that_warms_up_drifts_by_its_slope_and_then_no_more():
    warm = dataclasses.replace(IDEAL["gyro"], warm_up_deg_s_min=0.3, warm_up_min=0.5)
    drift = (ideal(gyro=warm).imus[0].w_b - ideal().imus[0].w_b) / DEG
    early, late = drift[1000] - drift[0], drift[-1] - drift[-1000]
    slope = drift[-1] / (1.0 - math.exp(-4.0)) / 0.5  # deg/s per minute at the start
    assert np.allclose(early, slope * 0.5 * (1.0 - math.exp(-10.0 / 30.0)), rtol=0.02)
    assert (np.abs(late) < 0.12 * np.abs(early)).all()


def test_steel_at_the_start_is_gone_in_the_air_and_motors_are_off_on_the_ground():
    own = IDEAL["compass"]
    perfect = ideal().imus[0].m_b_ut
    steel = ideal(compass=dataclasses.replace(own, steel_ut=30.0)).imus[0].m_b_ut - perfect
    motors = ideal(compass=dataclasses.replace(own, motor_ut=30.0)).imus[0].m_b_ut - perfect
    ground, air = slice(0, 1900), slice(5_000, 10_000)
    assert np.linalg.norm(steel[ground], axis=1).min() > 10.0
    assert np.linalg.norm(steel[air], axis=1).max() < 0.3
    assert np.abs(motors[ground]).max() == 0.0
    assert np.linalg.norm(motors[air], axis=1).mean() > 3.0


def test_the_autopilots_attitude_is_near_the_truth_and_as_far_off_as_its_fault():
    draw = Draw(7, flight=BRISK, faults=("autopilot-heading=40@50+20",))
    flight = simulated(draw, earth_field_at(*place_of(draw), 1.8e9))
    t_s = np.arange(30.0, 100.0, 0.5)
    found = errors(
        reported_attitudes(flight, t_s), flight.motion.at(t_s).q_nb, np.ones(len(t_s), bool), True
    )
    off = (t_s >= 50.0) & (t_s < 70.0)
    assert np.abs(found.heading[off] - 40.0).max() < 3.0
    assert np.abs(found.heading[~off]).max() < 3.0
    assert found.inclination.max() < 1.0


def test_what_arrives_is_in_order_late_by_the_link_and_not_in_its_gaps():
    link = LinkDraw(loss_share=0.1, gaps_per_h=60.0, gap_s=3.0, latency_ms=20.0)
    draw = Draw(5, flight=BRISK, link=link, imu=ImuDraw(count=2, form="integers"))
    flight = simulated(draw, earth_field_at(*place_of(draw), 1.8e9))
    t_ns, kinds = zip(*((e.t_ns, (type(m), e.message_id)) for e, m in events(flight)), strict=True)
    assert (np.diff(t_ns) >= 0).all()
    arrived = [t for t, kind in zip(t_ns, kinds, strict=True) if kind == (ImuReading, 27)]
    assert 0.8 < len(arrived) / len(flight.imus[0].t_s) < 0.95
    assert np.diff(arrived).max() > 2.5e9


@pytest.mark.parametrize("form", FORMS)
def test_messages_carry_the_sensors_values_at_their_resolution(form):
    draw = Draw(5, flight=BRISK, imu=ImuDraw(form=form), faults=("gps-lost@60+20",))
    flight = simulated(draw, earth_field_at(*place_of(draw), 1.8e9))
    every = list(events(flight))
    readings = [m for _, m in every if isinstance(m, ImuReading)]
    times = np.array([m.time for m in readings])
    assert np.array_equal(times, BOOT_US + flight.imus[0].stamp_us)
    rates = np.array([m.w_b for m in readings]) / 1e-3
    assert np.allclose(rates, np.round(rates), atol=1e-6) == (form == "integers")
    new = sum(m.m_b_ut is not None for m in readings) / len(readings)
    assert new == pytest.approx(1.0 if form == "integers" else 0.1, abs=0.02)
    without = [e.t_ns for e, m in every if isinstance(m, NoFix)]
    assert (without[-1] - without[0]) * 1e-9 == pytest.approx(20.0, abs=0.5)
    assert sum(isinstance(m, GpsFix) for _, m in every) > 400


def test_a_fault_changes_its_imu_while_it_lasts_and_nothing_else():
    two = dataclasses.replace(IDEAL["imu"], count=2)
    sound = ideal(imu=two)
    broken = ideal(imu=two, faults=("gyro-bias=5@60+20/2",))
    apart = (broken.imus[1].w_b - sound.imus[1].w_b) / DEG
    during = (sound.imus[1].t_s >= 60.0) & (sound.imus[1].t_s < 80.0)
    assert np.allclose(apart[during], [5.0, 0.0, 0.0])
    assert not apart[~during].any()
    assert np.array_equal(broken.imus[0].w_b, sound.imus[0].w_b)


# --- what is drawn ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def shipped():
    return read_distribution(SHIPPED)


def test_a_seed_is_a_flight_and_its_text_is_the_same_flight(shipped, tmp_path):
    for seed in range(30):
        draw = shipped.draw(seed)
        assert draw == shipped.draw(seed)
        path = tmp_path / "draw.yaml"
        path.write_text(as_text(draw))
        assert read_draw(path) == draw
    assert shipped.draw(1) != shipped.draw(2)


def test_draws_fill_their_ranges(shipped):
    draws = [shipped.draw(seed) for seed in range(400)]
    for name, ranges in shipped.sections.items():
        for key, ranged in ranges.items():
            values = [getattr(getattr(draw, name), key) for draw in draws]
            if ranged.form == "choice":
                assert set(values) == set(ranged.values), key
            else:
                low, high = ranged.values
                nominal = getattr(SECTIONS[name](), key)
                inside = [low <= value <= high for value in values]
                assert all(i or v == nominal for i, v in zip(inside, values, strict=True)), key
                share = sum(v != nominal for v in values) / len(values)
                assert share == pytest.approx(ranged.chance, abs=0.08), key
    faults = [parse_fault(text).name for draw in draws for text in draw.faults]
    assert set(faults) == set(shipped.fault_sizes)
    for draw in draws:
        for fault in draw.scheduled:
            assert fault.start_s >= draw.flight.rest_s + 29.9


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("  wind_m_s:", "  wind_ms:", "flight.wind_ms: unknown key; did you mean flight.wind_m_s?"),
        ("  jitter_ms: {log: [0.05, 2]}", "", "imu.jitter_ms: missing"),
        ("{log: [2, 90]}", "{log: [90, 2]}", "flight.length_min: log: expected two rising numbers"),
        ("{log: [2, 90]}", "{log: [0, 90]}", "expected two rising numbers above 0"),
        ("{log: [2, 90]}", "{log: [2, 900]}", "flight.length_min: expected a number from 1 to 240"),
        ("{log: [2, 90]}", "[2, 90]", "flight.length_min: expected one of uniform, log, choice"),
        ("choice: [1, 2, 3]", "choice: [1, 9]", "imu.count: expected a number from 1 to 3"),
        ("choice: [1, 2, 3]", "choice: [1, two]", "imu.count: expected values that are int"),
        ("chance: 0.5}", "chance: 5}", "chance: expected a number from 0 to 1, found 5"),
        ("    gyro-zero:", "    gyro-nil:", "faults.kinds.gyro-nil: no such fault"),
        ("count: {choice: [0, 0,", "count: {choice: [7, 0,", "faults.count: expected choices"),
        ("count: {choice: [0, 0, 1, 1, 2, 3]}", "count: {uniform: [0, 3]}", "expected choices"),
        ("count: {choice: [1, 2, 3]}", "count: {uniform: [1, 3]}", "imu.count: uniform: expected"),
        ("length_s: {choice: [20,", "length_s: {choice: [-20,", "faults.length_s: expected a"),
        ("length_s: {choice: [20,", "length_s: {choice: [long,", "expected values that are float"),
        ("gyro-bias: {log: [2, 20]}", "gyro-bias: {value: x}", "gyro-bias: expected values"),
        ("gyro-bias: {log: [2, 20]}", "gyro-bias: {log: [2, 2001]}", "a number from -2000 to 2000"),
        ("    gyro-zero:", "    gyro-zero: {value: 3}", "gyro-zero: it has no size"),
        ("    gyro-zero:", "    drop:", "faults.kinds.drop: no such fault"),
        ("link:", "lnk:", "lnk: unknown key; did you mean link?"),
        ("faults:", "faults: []\nflights:", "faults: expected count, length_s and kinds"),
        ("  kinds:", "  kinds: 3\n  others:", "faults: expected count, length_s and kinds"),
    ],
)
def test_errors_of_a_distribution_name_file_key_and_remedy(old, new, said, tmp_path):
    path = tmp_path / "mine.yaml"
    text = SHIPPED.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(BadInput) as caught:
        read_distribution(path)
    assert any(line.startswith(str(path)) and said in line for line in caught.value.lines)


def test_a_value_is_drawn_within_its_ends_however_long_they_are():
    ends = (0.123456, 0.123458)
    for form in ("uniform", "log"):
        drawn = [Range(form, ends).drawn(np.random.default_rng(k), 0.0) for k in range(9)]
        assert all(ends[0] <= value <= ends[1] for value in drawn)


def test_a_fault_whose_size_holds_by_chance_otherwise_has_the_usual_one(shipped):
    sizes = {"gyro-scale": Range("value", (1.5,), chance=0.5)}
    own = shipped._replace(fault_sizes=sizes, fault_count=Range("value", (1,)))
    found = {fault.argument for seed in range(20) for fault in own.draw(seed).scheduled}
    assert found == {1.02, 1.5}


def test_a_draw_of_small_values_is_read_again(tmp_path):
    draw = Draw(3, imu=ImuDraw(jitter_ms=1e-6), gyro=GyroDraw(noise_deg_s_rthz=1.5e-7))
    path = tmp_path / "draw.yaml"
    path.write_text(as_text(draw))
    assert read_draw(path) == draw


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("seed: 1\nimu: {cuont: 2}", "did you mean imu.count?"),
        ("seed: 1\nfaults: ['gyro-frozen@10/2']", "gyro-frozen is of IMU 2 of 1"),
        ("seed: 1\nfaults: ['gyro-frosen@10']", "gyro-frosen is not known"),
        (
            "seed: 1\nimu: {count: 2}\nfaults: ['hard-iron=30@10/2']",
            "hard-iron is of compass 2 of 1",
        ),
        ("imu: {count: 2}", "seed: missing"),
    ],
)
def test_errors_of_a_draw_name_file_key_and_remedy(text, said, tmp_path):
    path = tmp_path / "draw.yaml"
    path.write_text(text)
    with pytest.raises(BadInput) as caught:
        read_draw(path)
    assert any(str(path) in line and said in line for line in caught.value.lines)


# --- whom they hold to account ------------------------------------------------------------------


def said(kind, sensor, from_s, told_s=None, text="text", backs_us=None):
    found = Finding(kind, sensor, Severity.WARNING, from_s, from_s + 5.0, 1.0, "", text, "evidence")
    return Told(told_s or from_s + 1.0, found._replace(backs_us=backs_us))


IMU_1, IMU_2 = Sensor(SensorKind.IMU, 1), Sensor(SensorKind.IMU, 2)
GPS, COMPASS = Sensor(SensorKind.GPS), Sensor(SensorKind.COMPASS)
COMPASS_1 = Sensor(SensorKind.COMPASS, 1)
AUTOPILOT = Sensor(SensorKind.AUTOPILOT)


@pytest.mark.parametrize(
    ("fault", "told", "outcome"),
    [
        ("gyro-frozen@100+20/1", [said(Kind.GYRO_FROZEN, IMU_1, 100.1)], "right"),
        ("gyro-frozen@100+20/1", [said(Kind.GYRO_FROZEN, IMU_2, 100.1)], "wrong"),
        ("gyro-frozen@100+20/1", [said(Kind.IMU_FROZEN, IMU_1, 100.1)], "right"),
        ("gyro-frozen@100+20/1", [said(Kind.GYRO_FROZEN, IMU_1, 115.0)], "late"),
        ("gyro-bias=5@100+20/1", [said(Kind.ATTITUDE_VELOCITY, GPS, 101.0)], "undecided"),
        ("gyro-bias=5@100+20/1", [said(Kind.GPS_VELOCITY, GPS, 101.0)], "wrong"),
        ("gyro-bias=5@100+20/1", [said(Kind.GYRO_BIAS_STEP, IMU_1, 90.0)], "missed"),
        ("gyro-bias=5@100+20/1", [], "missed"),
        ("hard-iron=30@100+20/1", [said(Kind.COMPASS_FIELD, COMPASS, 101.0)], "right"),
        (
            "hard-iron=30@100+20/1",
            [said(Kind.COMPASSES_DIFFER, Sensor(SensorKind.COMPASS, None, (1, 2)), 101.0)],
            "undecided",
        ),
        ("imu-frozen@100+20/1", [said(Kind.COMPASS_FROZEN, COMPASS_1, 101.0)], "right"),
        ("imu-frozen@100+20/2", [said(Kind.COMPASS_FROZEN, COMPASS_1, 101.0)], "wrong"),
        ("gps-step=5@100+20", [said(Kind.GPS_VELOCITY, GPS, 101.0)], "right"),
        (
            "autopilot-tilt=9@100+20",
            [said(Kind.AUTOPILOT_TILT, AUTOPILOT, 101.0, backs_us=True)],
            "right",
        ),
        (
            "autopilot-tilt=9@100+20",
            [said(Kind.AUTOPILOT_TILT, AUTOPILOT, 101.0, backs_us=False)],
            "undecided",
        ),
        (
            "gps-lag=0.5@100+20",
            [said(Kind.ATTITUDE_VELOCITY, GPS, 101.0, text="velocity contradicts: latency")],
            "right",
        ),
    ],
)
def test_what_becomes_of_a_fault(fault, told, outcome):
    one = parse_fault(fault)
    row = fault_row(one, told, (one,))
    assert row["outcome"] == outcome
    assert bool(row["accused"]) == (outcome == "wrong")


def test_a_report_that_another_fault_explains_is_not_held_against_this_one():
    gyro, lost = parse_fault("gyro-frozen@100+20/1"), parse_fault("gps-step=5@105+20")
    every = [said(Kind.GYRO_FROZEN, IMU_1, 100.1), said(Kind.GPS_VELOCITY, GPS, 106.0)]
    for fault in (gyro, lost):
        row = fault_row(fault, every, (gyro, lost))
        assert (row["outcome"], row["accused"]) == ("right", [])


def test_a_difference_that_is_dated_from_before_its_fault_is_still_of_it():
    """A heading was off by steel on the ground when the autopilot's became wrong."""
    fault = parse_fault("autopilot-heading=45@100+60")
    named = said(Kind.AUTOPILOT_HEADING, AUTOPILOT, 80.0, 130.0, backs_us=True)
    assert fault_row(fault, [named], (fault,))["outcome"] == "late"
    flight = ideal(faults=("autopilot-heading=45@100+60",))
    over = named._replace(told_s=161.0)
    for told, accusations in ((named, 0), (over, 1)):
        found = false_reports([told], flight, shown(flight), lambda *_: False)
        assert len(found.accusations) == accusations


def test_a_difference_from_the_autopilot_is_of_its_fault_whoever_is_named():
    fault = parse_fault("autopilot-heading=45@100+60")
    told = said(Kind.AUTOPILOT_HEADING, AUTOPILOT, 80.0, 130.0)
    assert fault_row(fault, [told], (fault,))["outcome"] == "undecided"
    flight = ideal(faults=("autopilot-heading=45@100+60",))
    assert false_reports([told], flight, shown(flight), lambda *_: False).alarms == []


@pytest.mark.parametrize(("error_deg", "is_so"), [(3.0, True), (1.0, False)])
def test_that_our_heading_is_off_by_5_deg_is_true_from_half_of_that_on(error_deg, is_so):
    told = said(Kind.AUTOPILOT_HEADING, AUTOPILOT, 60.0, backs_us=False)
    told = told._replace(finding=told.finding._replace(size=5.0))
    t_s = np.arange(0.0, 120.0, 0.1)
    errors = Errors(t_s, np.full(len(t_s), -error_deg), np.zeros(len(t_s)))
    assert errors.are_as(told) is is_so
    assert not errors.are_as(said(Kind.ATTITUDE_VELOCITY, GPS, 60.0))


@pytest.mark.parametrize(("start_s", "can"), [(50.0, True), (290.0, True), (291.0, False)])
def test_a_fault_at_the_end_of_a_flight_is_not_held_against_anybody(start_s, can):
    assert can_be_told(parse_fault(f"gyro-frozen@{start_s}+20/1"), 300.0) is can


def test_a_sound_part_that_is_named_is_a_false_accusation_and_a_disturbed_one_is_not():
    iron = dataclasses.replace(IDEAL["compass"], hard_iron_ut=30.0)
    for flight, is_disturbed in ((ideal(), False), (ideal(compass=iron), True)):
        told = [said(Kind.COMPASS_FIELD, COMPASS, 60.0), said(Kind.GYRO_BIAS_STEP, IMU_1, 60.0)]
        found = false_reports(told, flight, shown(flight), lambda *_: False)
        assert [one.part for one in found.accusations] == (
            [blame.GYRO] if is_disturbed else [blame.COMPASS, blame.GYRO]
        )


def test_a_gap_of_the_link_excuses_what_is_said_of_the_receiver_while_it_lasts():
    flight = ideal(link=LinkDraw(gaps_per_h=60.0, gap_s=3.0))
    ((begin_s, end_s),) = link_gaps_s(flight.draw)
    for kind in (Kind.VELOCITY_LOST, Kind.IMU_GAPS):
        told = [said(kind, GPS, at_s) for at_s in (begin_s + 1.0, begin_s - 20.0, end_s + 6.0)]
        found = false_reports(told, flight, shown(flight), lambda *_: False)
        assert found.accusations == told[1:]


def test_a_contradiction_is_an_alarm_only_while_nothing_is_wrong():
    flight = ideal()
    told = [said(Kind.ATTITUDE_VELOCITY, GPS, 60.0)]
    for is_wrong in (True, False):
        found = false_reports(told, flight, shown(flight), lambda *_, wrong=is_wrong: wrong)
        assert (found.alarms == []) is is_wrong
        assert found.accusations == []


def test_a_compass_shows_the_heading_until_it_is_wrong_and_velocities_while_they_change():
    compass = ideal(faults=("compass-reversed@60+60",), receiver=ReceiverDraw(outages_per_h=0.0))
    seen = shown(compass)
    assert seen.heading[15:59].all()
    by_velocity = seen.heading[65:]
    assert by_velocity.any()  # brisk parts
    none = ideal(faults=("compass-reversed@60+60", "gps-lost@60+60"))
    assert not shown(none).heading[62:].any()
    gyro = ideal(faults=("gyro-frozen@60+20",))
    assert not shown(gyro).heading[61:85].any()
    assert shown(gyro).heading[95:100].all()


def test_a_fault_within_a_second_is_in_that_second_alone():
    draw = Draw(3, faults=("gps-lost@30.2+0.5", "gps-lost@40.0+1.0"))
    acting = np.flatnonzero(faulty(draw, ("gps-",), np.arange(300.0)))
    assert acting.tolist() == [30, 39, 40]


def test_a_flight_whose_rest_outlasts_it_and_that_ends_within_a_second_is_scored():
    draw = Draw(
        3,
        flight=FlightDraw(length_min=1.01, rest_s=120.0),
        receiver=ReceiverDraw(rate_hz=0.5, outages_per_h=100.0),
        link=LinkDraw(gaps_per_h=100.0),
    )
    flight = simulated(draw, earth_field_at(*place_of(draw), 1.8e9))
    stamps = [BOOT_US + row for row in flight.imus[0].stamp_us[::10].tolist()]
    assert 1e-6 * (stamps[-1] - BOOT_US) > 60.0
    true = flight.motion.at(1e-6 * (np.array(stamps) - BOOT_US)).q_nb
    rows = array("d", np.column_stack((true, np.ones((len(true), 2)))).ravel())
    found = score(flight, HeardDraw(array("q", stamps), rows, (), {}, 0, 0.0))
    assert found["estimated_share"] == 1.0
    assert found["heading_deg"]["p100"] == 0.0
    assert any(isinstance(message, ImuReading) for _, message in events(flight))
    assert not shown(flight).receiver[0]


def test_an_outage_beside_a_fault_is_the_receivers_and_no_wrong_name():
    fault = "gyro-bias=3@60+20/1"
    for outages_per_h in (0.0, 600.0):
        receiver = ReceiverDraw(outages_per_h=outages_per_h, outage_s=20.0)
        flight = ideal(receiver=receiver, faults=(fault,))
        t_us = [BOOT_US + 1_000_000 * second for second in range(1, 100)]
        true = flight.motion.at(np.arange(1.0, 100.0)).q_nb
        rows = array("d", np.column_stack((true, np.ones((len(true), 2)))).ravel())
        lost = said(Kind.VELOCITY_LOST, GPS, 65.0).finding
        heard = HeardDraw(array("q", t_us), rows, (lost,), {}, 0, 0.0)
        (row,) = score(flight, heard)["faults"]
        assert row["outcome"] == ("missed" if outages_per_h else "wrong")


def test_at_rest_only_an_accelerometer_that_is_level_shows_the_tilt():
    """In motion velocities do; 1.5 deg are 26 mg."""
    rest_s = int(BRISK.rest_s)
    for seed in range(3):
        draw = Draw(seed, flight=BRISK, **(IDEAL | {"accelerometer": AccelerometerDraw(0, 40.0)}))
        flight = simulated(draw, earth_field_at(*place_of(draw), 1.8e9))
        still = slice(10, rest_s)
        off_n = flight.imus[0].f_b[: 50 * rest_s].mean(axis=0)
        off_deg = math.degrees(math.atan(math.hypot(*off_n[:2]) / GRAVITY_M_S2))
        assert shown(flight).tilt[still].all() == (off_deg < 1.5)
        assert shown(flight).tilt[rest_s + 15]
    assert shown(ideal()).tilt[10:].all()


@pytest.mark.parametrize(
    ("fault", "does"),
    [
        ("gyro-bias=0.6@60+20", True),
        ("gyro-bias=0.4@60+20", False),
        ("accel-bias=0.3@60+20", True),
        ("accel-bias=0.2@60+20", False),
        ("hard-iron=4@60+20", True),
        ("hard-iron=2@60+20", False),
        # what stands still already does not freeze, and what rests is not late
        ("gyro-scale=1.3@1+20", False),
        ("gyro-scale=1.3@60+40", True),
        ("gps-lag=0.5@1+20", False),
        ("gps-lag=0.5@30+60", True),
        ("gps-lost@60+20", True),
        ("autopilot-tilt=8@60+20", True),
    ],
)
def test_a_fault_shows_if_the_readings_leave_what_a_sound_sensor_may_show(fault, does):
    flight = ideal(faults=(fault,), receiver=ReceiverDraw(noise_m_s=0.05))
    assert shows(flight, *flight.draw.scheduled) is does


def test_a_fault_of_a_sensor_that_stands_still_does_not_show():
    flight = ideal(faults=("accel-frozen@50+60", "accel-bias=2@60+20", "accel-bias=2@100+20"))
    frozen, hidden, seen = flight.draw.scheduled
    assert shows(flight, frozen)
    assert not shows(flight, hidden)
    assert shows(flight, seen)
    assert without(flight.draw, hidden).scheduled == (frozen, seen)


def test_the_longest_run_of_wrong_rows():
    t_s = np.arange(0.0, 10.0, 0.5)
    bad = (t_s > 1.0) & (t_s < 2.0) | (t_s >= 5.0) & (t_s <= 8.0)
    assert longest_run(t_s, bad) == (3.0, 5.0)
    assert longest_run(t_s, bad & False) == (0.0, 0.0)


# --- the sum of all, and small flights ----------------------------------------------------------


def row(seed, **changes):
    errors_deg = {"p50": 0.5, "p95": 1.0, "p99": 2.0, "p100": 3.0}
    return {
        "seed": seed, "length_s": 360.0, "calm_h": 0.1, "cpu_s": 1.0, "handler_errors": 0,
        "heading_deg": errors_deg, "tilt_deg": errors_deg, "heading_wrong_s": 0.0,
        "heading_wrong_at_s": 0.0, "tilt_wrong_s": 0.0, "tilt_wrong_at_s": 0.0,
        "nees_tilt": 1.0, "nees_heading": 0.1, "false_accusations": [], "false_alarms": [],
        "faults": [], **changes,
    }  # fmt: skip


def test_the_summary_counts_and_the_worst_come_first():
    accused = said(Kind.GYRO_BIAS_STEP, IMU_1, 60.0).row()
    missed = fault_row(parse_fault("gps-step=5@100"), [], ()) | {"shows": True}
    hidden = fault_row(parse_fault("gps-lag=0.4@100"), [], ()) | {"shows": False}
    rows = [
        row(1),
        row(2, heading_wrong_s=40.0),
        row(3, false_accusations=[accused], faults=[missed, hidden]),
    ]
    found = summary(rows)
    assert (found["faults"]["count"], found["faults_that_show"]["count"]) == (2, 1)
    assert found["hours"] == pytest.approx(0.3)
    assert found["heading_wrong_over_10_s"] == 1
    assert found["nees"]["heading"] == {"median": 0.1, "flights": 3, "below": 3, "above": 0}
    assert found["false_accusations_per_100_h"] == pytest.approx(100.0 / 0.3)
    assert found["false_accusations_by_kind"] == {"gyro_bias_step": 1}
    assert found["by_fault"]["gps-step"]["missed"] == 1
    ranked = worst(rows)
    assert [one["seed"] for one in ranked] == [3, 2]
    text = table({"summary": found, "worst": ranked}, lambda seed: f"fly {seed}")
    assert "heading wrong for 40 s" in text
    assert text.index("fly 3") < text.index("fly 2")


def test_a_bad_flight_is_shrunk_to_what_makes_it_bad():
    """Bad because of one fault and of a late receiver; all else goes."""
    faults = ("gps-lost@70+20", "gyro-bias=3@80+20/1", "gps-step=5@90+9")
    draw = Draw(
        3,
        flight=FlightDraw(length_min=30.0, wind_m_s=7.0),
        imu=ImuDraw(count=3, vibration_m_s2=9.0),
        receiver=ReceiverDraw(delay_s=0.4, noise_m_s=0.3),
        compass=CompassDraw(count=2, hard_iron_ut=2.0),
        faults=faults,
    )

    def fly(one):
        is_bad = one.receiver.delay_s == 0.4 and faults[1] in one.faults
        return row(3, tilt_wrong_s=30.0 if is_bad and one.flight.length_min >= 4.0 else 0.0)

    tried = []
    small = shrink(draw, fly, lambda *each: tried.append(each), 60)
    assert 10 < len(tried) <= 60
    assert all(found == badness(fly(one)) for one, found in tried)
    assert small in [one for one, _ in tried]
    assert small.faults == (faults[1],)
    assert small.receiver == ReceiverDraw(delay_s=0.4)
    assert small.imu == ImuDraw()
    assert 4.0 <= small.flight.length_min < 6.0
    assert len(as_text(small).splitlines()) <= 6
    assert badness(fly(small)) == badness(fly(draw))


def test_a_fault_of_a_compass_keeps_its_compass_when_it_is_shrunk():
    """Without it the fault would be missed, too, and for another reason."""
    draw = Draw(
        3,
        imu=ImuDraw(count=2),
        compass=CompassDraw(count=2, noise_ut=0.7),
        faults=("hard-iron=30@80+20/2",),
    )
    missed = {"outcome": "missed"}
    small = shrink(draw, lambda one: row(3, faults=[missed] * len(one.faults)), lambda *_: None, 20)
    assert small.faults == draw.faults
    assert small.compass == CompassDraw(count=2)


def test_a_good_flight_stays_as_it_is():
    draw = Draw(3, flight=BRISK)
    assert shrink(draw, lambda _: row(3), lambda *_: None, 9) is draw


def test_every_motion_ends_where_it_can_land():
    for vehicle in VEHICLES:
        motion = DrawnMotion(Draw(11, flight=dataclasses.replace(BRISK, vehicle=vehicle)))
        assert np.allclose(motion.at(np.array([119.0])).v_n, 0.0, atol=1e-9)


def test_every_key_of_a_draw_is_documented():
    text = (Path(REPOSITORY) / "docs" / "campaign.md").read_text()
    for name, section in SECTIONS.items():
        for part in dataclasses.fields(section):
            assert f"`{name}.{part.name}`" in text, f"{name}.{part.name}"

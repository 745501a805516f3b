import math
from collections.abc import Iterable

import pytest
from needs import DEG
from synthetic_imu import Disturbance, Flight, fly, rms_deg, slow, still, wild

from h2nav.attitude.kernel_files import VELOCITY_AIDED
from h2nav.attitude.native import compiled_step
from h2nav.attitude.samples import (
    AttitudeEstimate,
    ImuSample,
    SensorDelays,
    Trust,
    Vec3,
    VehicleState,
)
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains, velocity_aided_gains
from h2nav.files import gain_files
from h2nav.maths import quaternion

FLYING = VehicleState(on_ground=False)
GROUND = VehicleState(on_ground=True)
MULTIROTOR = velocity_aided_gains(gain_files.load("multirotor_100hz"), "multirotor_100hz")
HANDHELD = velocity_aided_gains(gain_files.load("handheld_100hz"), "handheld_100hz")
FIXED_WING = velocity_aided_gains(gain_files.load("fixed-wing_100hz"), "fixed-wing_100hz")
GENTLE_BIAS = (1.0 * DEG, -1.0 * DEG, 1.0 * DEG)


def compiled(gains: VelocityAidedGains) -> VelocityAidedFilter:
    """A filter, compiled where that is possible."""
    return VelocityAidedFilter(gains, compiled_step(VELOCITY_AIDED))


def new_filter(vehicle: VehicleState = FLYING) -> VelocityAidedFilter:
    filter_ = compiled(MULTIROTOR)
    filter_.use_vehicle(vehicle)
    return filter_


def run(
    filter_: VelocityAidedFilter, samples: Iterable[ImuSample]
) -> list[tuple[float, AttitudeEstimate]]:
    found = ((sample.t_us * 1e-6, filter_.update(sample)) for sample in samples)
    return [(t_s, estimate) for t_s, estimate in found if estimate is not None]


def gentle(t: float) -> Vec3:
    """Some 10 deg of roll and pitch, 30 deg of yaw."""
    return (0.2 * math.cos(1.2 * t), 0.25 * math.cos(0.9 * t + 1.0), 0.15 * math.sin(0.3 * t))


def breeze(t: float) -> Vec3:
    """Accelerations of a vehicle whose velocity stays within a metre per second."""
    return (0.8 * math.sin(1.1 * t), 0.6 * math.cos(0.8 * t), 0.5 * math.sin(2.0 * t))


def with_bias_step(flight: Flight, at_s: float, step: Vec3) -> list[ImuSample]:
    def moved(sample: ImuSample) -> ImuSample:
        if sample.t_us < at_s * 1e6:
            return sample
        w = sample.w_b
        return sample._replace(w_b=(w[0] + step[0], w[1] + step[1], w[2] + step[2]))

    return [moved(sample) for sample in flight.samples]


def bias_error_deg_s(estimate: AttitudeEstimate, true: Vec3) -> float:
    return max(abs(a - b) for a, b in zip(estimate.bias_b, true, strict=True)) / DEG


def errors_deg(flight: Flight, filter_: VelocityAidedFilter, after_s: float = 0.0) -> list[float]:
    errors = []
    for sample, q in zip(flight.samples, flight.q_nb, strict=True):
        estimate = filter_.update(sample)
        if estimate is not None and sample.t_us >= after_s * 1e6:
            errors.append(quaternion.angle(estimate.q_nb, q))
    return errors


# --- accuracy and bias --------------------------------------------------------------------------


@pytest.mark.parametrize("gains", [HANDHELD, MULTIROTOR], ids=lambda gains: gains.vehicle_class)
def test_learns_an_unknown_bias_within_30_s_of_gentle_motion(gains) -> None:
    filter_ = compiled(gains)
    flight = fly(gentle, 30.0, 1, bias_b=GENTLE_BIAS, disturbance=Disturbance(force=breeze))
    estimates = run(filter_, flight.samples)
    assert bias_error_deg_s(estimates[-1][1], GENTLE_BIAS) < 0.05


def test_learns_a_bias_step_in_flight_within_60_s() -> None:
    flight = fly(gentle, 130.0, 2, bias_b=(0.0, 0.0, 0.0), disturbance=Disturbance(force=breeze))
    step = (0.5 * DEG, 0.5 * DEG, 0.5 * DEG)
    estimates = run(new_filter(), with_bias_step(flight, 60.0, step))
    at_120 = next(estimate for t_s, estimate in estimates if t_s >= 120.0)
    assert bias_error_deg_s(at_120, step) < 0.05


def test_a_steady_turn_in_the_air_is_not_taken_for_rest() -> None:
    flight = fly(lambda _t: (0.0, 0.0, 20.0 * DEG), 60.0, 3, bias_b=(0.0, 0.0, 0.0))
    for vehicle in (FLYING, VehicleState(on_ground=None)):
        estimates = run(new_filter(vehicle), flight.samples)
        assert bias_error_deg_s(estimates[-1][1], (0.0, 0.0, 0.0)) < 0.05
        assert not any(estimate.trust & Trust.REST for _, estimate in estimates)


def test_learns_the_bias_at_rest_on_the_ground_only() -> None:
    flight = fly(still, 10.0, 4, bias_b=GENTLE_BIAS)
    estimates = run(new_filter(GROUND), flight.samples)
    assert estimates[-1][1].trust & Trust.REST
    assert bias_error_deg_s(estimates[-1][1], GENTLE_BIAS) < 0.02
    in_the_air = run(new_filter(FLYING), flight.samples)
    assert not any(estimate.trust & Trust.REST for _, estimate in in_the_air)


def test_a_slow_turn_of_an_armed_vehicle_on_the_ground_is_not_taken_for_a_bias() -> None:
    turn = (0.0, 0.0, 0.2 * DEG)
    flight = fly(lambda t: turn if t > 10.0 else (0.0, 0.0, 0.0), 20.0, 4, bias_b=(0.0, 0.0, 0.0))
    filter_ = new_filter(GROUND)
    for sample in flight.samples:
        if sample.t_us == 10_000_000:
            filter_.use_vehicle(GROUND._replace(is_armed=True))
        estimate = filter_.update(sample)
    assert estimate is not None
    assert bias_error_deg_s(estimate, (0.0, 0.0, 0.0)) < 0.05
    disarmed = run(new_filter(GROUND), flight.samples)[-1][1]
    assert bias_error_deg_s(disarmed, turn) < 0.05


def test_a_bias_that_is_unknown_is_learnt_at_rest_by_an_armed_vehicle_too() -> None:
    """A log that begins with arming holds no other rest; without a field nothing else shows it."""
    flight = fly(still, 10.0, 4, bias_b=GENTLE_BIAS)
    last = run(new_filter(GROUND._replace(is_armed=True)), flight.samples)[-1][1]
    assert bias_error_deg_s(last, GENTLE_BIAS) < 0.1
    blind = [sample._replace(m_b_ut=None) for sample in flight.samples]
    last = run(new_filter(GROUND._replace(is_armed=True)), blind)[-1][1]
    assert bias_error_deg_s(last, GENTLE_BIAS) < 0.02


@pytest.mark.parametrize(
    "rate_hz", [25.0, 50.0, 200.0, pytest.param(1000.0, marks=pytest.mark.thorough)]
)
def test_any_sample_rate_serves(rate_hz: float) -> None:
    flight = fly(slow, 40.0, 5, rate_hz=rate_hz, bias_b=(0.002, -0.001, 0.003))
    assert rms_deg(errors_deg(flight, new_filter(), after_s=20.0)) < 0.5


def test_fast_rotation_is_followed() -> None:
    flight = fly(wild, 40.0, 6, bias_b=(0.002, -0.001, 0.003))
    assert rms_deg(errors_deg(flight, new_filter(), after_s=15.0)) < 0.5


def test_lost_samples_cost_next_to_nothing() -> None:
    flight = fly(gentle, 60.0, 7, disturbance=Disturbance(force=breeze))
    kept = [i for i in range(len(flight.samples)) if (i * 7919) % 10]
    thinned = Flight(
        [flight.samples[i] for i in kept], [flight.q_nb[i] for i in kept], flight.bias_b
    )
    whole = rms_deg(errors_deg(flight, new_filter(), after_s=30.0))
    assert rms_deg(errors_deg(thinned, new_filter(), after_s=30.0)) < whole + 0.3


def test_a_start_in_a_false_field_is_undone_when_the_field_is_true_again() -> None:
    def near_iron(t: float) -> Vec3:
        return (0.0, 25.0, 0.0) if t < 5.0 else (0.0, 0.0, 0.0)

    flight = fly(gentle, 120.0, 8, bias_b=(0.0, 0.0, 0.0), disturbance=Disturbance(field=near_iron))
    errors = errors_deg(flight, new_filter(), after_s=100.0)
    assert rms_deg(errors) < 2.0


def test_predicted_tilt_deviation_is_of_the_size_of_the_error() -> None:
    flight = fly(gentle, 90.0, 9, disturbance=Disturbance(force=breeze))
    filter_ = new_filter()
    ratios = []
    for sample, q in zip(flight.samples, flight.q_nb, strict=True):
        estimate = filter_.update(sample)
        if estimate is None or sample.t_us < 40e6:
            continue
        down_true = quaternion.rotate(quaternion.conjugate(q), (0.0, 0.0, 1.0))
        down = quaternion.rotate(quaternion.conjugate(estimate.q_nb), (0.0, 0.0, 1.0))
        tilt = math.dist(down_true, down)
        ratios.append((tilt / estimate.sigma_tilt_rad) ** 2)
    assert math.sqrt(sum(ratios) / len(ratios)) < 3.0


# --- field --------------------------------------------------------------------------------------


def test_a_strong_disturbance_is_not_believed_and_a_lasting_new_field_is() -> None:
    def iron(t: float) -> Vec3:
        return (0.0, 0.0, 0.0) if t < 20.0 else (0.0, 0.0, 30.0)

    flight = fly(gentle, 25.0, 11, bias_b=(0.0, 0.0, 0.0), disturbance=Disturbance(field=iron))
    late = [e for t_s, e in run(new_filter(), flight.samples) if t_s > 20.1]
    assert not any(e.trust & Trust.FIELD_USED for e in late)

    calm = fly(lambda t: (0.4 * math.cos(t), 0.0, 0.6), 60.0, 12, bias_b=(0.0, 0.0, 0.0))
    scaled = [
        s
        if s.t_us < 20e6 or s.m_b_ut is None
        else s._replace(m_b_ut=tuple(0.7 * m for m in s.m_b_ut))
        for s in calm.samples
    ]
    estimates = run(new_filter(), scaled)
    just_after = [e for t_s, e in estimates if 20.1 < t_s < 35.0]
    assert not any(e.trust & Trust.FIELD_USED for e in just_after)
    assert estimates[-1][1].trust & Trust.FIELD_USED
    assert quaternion.angle(estimates[-1][1].q_nb, calm.q_nb[-1]) < 2.0 * DEG


def test_the_latency_of_the_magnetometer_is_learnt() -> None:
    flight = fly(lambda t: (1.2 * math.cos(2.0 * t), 1.0 * math.cos(1.7 * t), 0.3), 60.0, 13)
    late = 4  # samples of 10 ms
    samples = [
        sample._replace(m_b_ut=flight.samples[max(0, i - late)].m_b_ut)
        for i, sample in enumerate(flight.samples)
    ]
    filter_ = new_filter()
    run(filter_, samples)
    assert filter_.field_latency_s == pytest.approx(0.04, abs=0.004)


@pytest.mark.parametrize(
    ("delays", "expected_s"),
    [
        (SensorDelays(), 0.0),
        (SensorDelays(0.008, 0.05), 0.042),
        (SensorDelays(0.05, 0.008), 0.0),
        (SensorDelays(0.0, 2.0), 0.1),
    ],
)
def test_a_latency_is_expected_until_one_is_learnt(delays: SensorDelays, expected_s: float) -> None:
    filter_ = new_filter()
    filter_.use_delays(delays)
    assert filter_.field_latency_s == pytest.approx(expected_s)


def test_a_latency_that_is_learnt_outweighs_a_wrong_expectation() -> None:
    flight = fly(lambda t: (1.2 * math.cos(2.0 * t), 1.0 * math.cos(1.7 * t), 0.3), 120.0, 13)
    filter_ = new_filter()
    filter_.use_delays(SensorDelays(0.0, 0.05))
    run(filter_, flight.samples)
    assert filter_.field_latency_s < 0.008


# --- bad samples --------------------------------------------------------------------------------


# --- memory -------------------------------------------------------------------------------------


def test_a_slow_turn_in_the_hand_is_not_taken_for_rest() -> None:
    flight = fly(slow, 60.0, 20, bias_b=(0.3 * DEG, -0.3 * DEG, 0.3 * DEG))
    estimates = run(compiled(HANDHELD), flight.samples)
    assert bias_error_deg_s(estimates[-1][1], flight.bias_b) < 0.1

"""A simulated ArduCopter flight (calm, 208 s) with one fault put into it, without GPS."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from needs import DEG, shared_data

from h2nav.attitude.kernel_files import VELOCITY_AIDED
from h2nav.attitude.native import compiled_step
from h2nav.attitude.samples import ImuSample, Trust, VehicleState
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.evaluation.dataset.filters import samples
from h2nav.files import gain_files
from h2nav.maths.attitude_errors import AttitudeErrors, errors
from h2nav.maths.rows import enu_from_ned
from h2nav.recordings.trials import Trial, read_trial

FAULT_S = (110.0, 130.0)
Fault = Callable[[ImuSample], ImuSample | None]


@pytest.fixture(scope="module")
def trial() -> Trial:
    return read_trial(shared_data("imu/sitl__calm.npz"))


def fly(
    trial: Trial, fault: Fault
) -> tuple[AttitudeErrors, np.ndarray, list[Trust], VelocityAidedFilter]:
    """Errors and mask of the samples that got an estimate, and what was trusted."""
    filter_ = VelocityAidedFilter(
        velocity_aided_gains(gain_files.load("multirotor_100hz"), "multirotor_100hz"),
        compiled_step(VELOCITY_AIDED),
    )
    filter_.use_vehicle(VehicleState(on_ground=False))
    rows, places, trust = [], [], []
    for place, sample in enumerate(samples(trial)):
        damaged = fault(sample)
        estimate = None if damaged is None else filter_.update(damaged)
        if estimate is not None:
            rows.append(estimate.q_nb)
            places.append(place)
            trust.append(estimate.trust)
    assert trial.q_es is not None
    mask = trial.mask[places]
    return errors(enu_from_ned(rows), trial.q_es[places], mask, True), mask, trust, filter_


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def during(sample: ImuSample) -> bool:
    return FAULT_S[0] <= sample.t_us * 1e-6 < FAULT_S[1]


def window(trial: Trial, first_s: float, last_s: float) -> np.ndarray:
    return (trial.t_us >= first_s * 1e6) & (trial.t_us < last_s * 1e6)


def test_ten_percent_of_the_samples_lost(trial: Trial) -> None:
    """Nothing is noticed: true time stamps carry over the holes."""
    pattern: Iterator[int] = iter(np.random.default_rng(1).integers(0, 10, 30_000).tolist())
    found, mask, _, _ = fly(trial, lambda sample: sample if next(pattern) else None)
    assert rms(found.total[mask]) < 1.2
    assert rms(found.inclination[mask]) < 0.7


def test_hard_iron_that_appears_in_flight(trial: Trial) -> None:
    """The field is refused while it lies, tilt does not suffer, heading comes back."""

    def iron(sample: ImuSample) -> ImuSample:
        m = sample.m_b_ut
        if m is None or not during(sample):
            return sample
        return sample._replace(m_b_ut=(m[0] + 120.0, m[1] - 80.0, m[2]))

    found, mask, _, _ = fly(trial, iron)
    assert rms(found.inclination[mask]) < 0.7
    assert np.abs(found.heading[mask]).max() < 8.0
    assert rms(found.heading[-1000:]) < 2.0


def test_vibration_of_the_accelerometer(trial: Trial) -> None:
    """Ten m/s^2 of shaking in every axis costs little: velocity averages it."""
    rng = np.random.default_rng(2)

    def shaken(sample: ImuSample) -> ImuSample:
        if not during(sample):
            return sample
        x, y, z = (float(f + n) for f, n in zip(sample.f_b, rng.normal(0, 10, 3), strict=True))
        return sample._replace(f_b=(x, y, z))

    found, mask, _, _ = fly(trial, shaken)
    assert rms(found.inclination[mask]) < 1.2


def test_switch_to_another_gyro(trial: Trial) -> None:
    """A bias step of 0.5 deg/s in every axis: the tilt is right again after a minute."""

    def other(sample: ImuSample) -> ImuSample:
        x, y, z = sample.w_b
        d = 0.5 * DEG if sample.t_us >= 110e6 else 0.0
        return sample._replace(w_b=(x + d, y + d, z + d))

    found, mask, _, _ = fly(trial, other)
    assert rms(found.inclination[mask & window(trial, 170.0, 1e9)[-len(mask) :]]) < 1.0


def test_saturated_accelerometer(trial: Trial) -> None:
    """Clipped samples are integrated with gain 0 and say so."""
    found, mask, trust, _ = fly(
        trial, lambda sample: sample._replace(clipped=True) if during(sample) else sample
    )
    clipped = sum(map(during, samples(trial)))
    assert sum(bool(t & Trust.SATURATED) for t in trust) == clipped
    assert rms(found.inclination[mask]) < 1.5


def test_start_with_a_wrong_attitude(trial: Trial) -> None:
    """The flight entered in the middle, while accelerating: good within 20 s."""
    found, _, _, _ = fly(trial, lambda sample: sample if sample.t_us >= 80e6 else None)
    assert rms(found.inclination[2000:]) < 1.0
    assert rms(found.total[4000:]) < 3.0

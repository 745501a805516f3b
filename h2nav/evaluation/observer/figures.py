"""Figures of the twist observer for `h2nav evaluate observer`, by exponent."""

import math
from typing import Any

from h2nav.evaluation.observer.trials import Course, ObserverTrial, rms_after, run, time_to
from h2nav.motion.finite_time import FiniteTimeGains

EXPONENTS = (1.0, 0.9, 0.8, 0.75, 0.6)
VISION_EXPONENTS = (1.0, 0.9, 0.85, 0.75)
NOISE_SETTLED_S = 30.0
VISION_SETTLED_S = 20.0
CONDITIONS = {
    "convergence": "start 170 deg and 3 m off, k = 4, 4, a pose with each sample, 500 Hz, no noise",
    "noise": "pose noise 2 mrad and 5 mm per axis at 200 Hz, k = 2, 1; rms per axis after 30 s",
    "vision": "30 Hz, 50 ms late, 10 % lost, 2 mrad and 5 mm, IMU at 300 Hz, k = 3, 3, from the "
    "first pose; after 20 s",
}


def convergence() -> dict[float, Course]:
    """Exponent -> errors from far off, without noise."""
    return {
        a1: run(ObserverTrial(FiniteTimeGains(4.0, 4.0, a1), 18.0, imu_hz=500.0))
        for a1 in EXPONENTS
    }


def document(courses: dict[float, Course]) -> dict[str, Any]:
    """All figures; a time that is never reached is infinite.

    Args:
        courses: of `convergence`.
    """
    return {
        "conditions": CONDITIONS,
        "a1": {str(a1): {**_times(course), **_noise(a1)} for a1, course in courses.items()},
        "vision": {str(a1): _vision(a1) for a1 in VISION_EXPONENTS},
    }


def _times(course: Course) -> dict[str, float]:
    keys = {"time_to_1e-2_s": 1e-2, "time_to_1e-4_s": 1e-4, "time_to_1e-6_s": 1e-6}
    return {key: time_to(course, threshold) for key, threshold in keys.items()}


def _noise(a1: float) -> dict[str, float]:
    gains = FiniteTimeGains(2.0, 1.0, a1)
    trial = ObserverTrial(
        gains, 60.0, imu_hz=200.0, sigma_r_rad=2e-3, sigma_p_m=5e-3, starts_off=False, seed=1
    )
    course = run(trial)
    return {
        key: rms_after(values, course.t_s, NOISE_SETTLED_S) / math.sqrt(axes)
        for key, values, axes in (
            ("bias_rms_noisy", course.bias, 6.0),
            ("bias_rms_noisy_rad_s", course.bias_w, 3.0),
            ("bias_rms_noisy_m_s", course.bias_v, 3.0),
        )
    }


def _vision(a1: float) -> dict[str, float]:
    figures: dict[str, float] = {}
    for name, noise in (("noisy", 1.0), ("noise_free", 0.0)):
        trial = ObserverTrial(
            FiniteTimeGains(3.0, 3.0, a1),
            40.0,
            imu_hz=300.0,
            imu_per_pose=10,
            delay_samples=15,
            drop_share=0.1,
            sigma_r_rad=2e-3 * noise,
            sigma_p_m=5e-3 * noise,
            starts_off=False,
            seed=2,
        )
        course = run(trial)
        for key, values in (
            ("bias_rms_rad_s", course.bias_w),
            ("bias_rms_m_s", course.bias_v),
            ("attitude_rms_rad", course.attitude),
            ("position_rms_m", course.position),
        ):
            rms = rms_after(values, course.t_s, VISION_SETTLED_S) / math.sqrt(3.0)
            figures[f"{name}_{key}"] = rms
        figures[f"{name}_time_to_2e-2_s"] = time_to(course, 0.02)
    return figures

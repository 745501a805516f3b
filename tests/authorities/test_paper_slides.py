"""The source slides' tables (seed 001; Kim, Tadiparthi, Bhattacharya, ACC 2020) as an authority.

They were made with MATLAB's imuSensor; what they do not say is assumed as `evaluate paper` prints.
"""

import functools
import json
import math

import numpy as np
import pytest

from h2nav.cli import main
from h2nav.evaluation.paper.tables import SLIDES, WITHIN
from h2nav.evaluation.paper.trials import CASES, Assumptions, errors_deg, make_trials, runners

pytestmark = pytest.mark.thorough

SEEDS = range(3)
ASSUMPTIONS = Assumptions(run_in_s=10.0)
TRIALS = {case.key: make_trials(case, ASSUMPTIONS, SEEDS) for case in CASES[:2]}


@functools.cache
def estimates_of(case: str, runner: str) -> dict[str, np.ndarray]:
    return runners(CASES[0])[runner](TRIALS[case])


def rms(case: str, name: str) -> np.ndarray:
    estimates = estimates_of(case, name.removesuffix("_prompt"))[name]
    errors = errors_deg(TRIALS[case], estimates)
    result: np.ndarray = np.sqrt(np.nanmean(errors**2, axis=(0, 1)))
    return result


@pytest.mark.parametrize("case", ["case_1", "case_2"])
@pytest.mark.parametrize("name", ["eh2_paper", "ekf_unit"])
def test_unit_weighted_filters_reproduce_the_slides(case: str, name: str) -> None:
    ratio = rms(case, name) / np.array(SLIDES[case][name].rms_deg)
    assert np.all(ratio < WITHIN)
    assert np.all(ratio > 1 / WITHIN)


def test_tuning_makes_the_difference_not_the_method() -> None:
    """ "H2 beats the EKF" holds between unit matrices and vanishes for the sensor's own."""
    assert np.all(rms("case_1", "ekf_unit") > 1.5 * rms("case_1", "eh2_paper"))
    assert np.all(rms("case_1", "ekf_tuned") < 0.7 * rms("case_1", "eh2_paper"))


def test_lag_of_a_sample_is_most_of_case_two() -> None:
    lag = rms("case_2", "ekf_unit")
    prompt = rms("case_2", "ekf_unit_prompt")
    assert np.all(lag > 2.0 * prompt)


def test_command_prints_one_json_document(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "paper", "--seeds", "1", "--run-in-s", "0", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    for case in ("case_1", "case_2"):
        for name in ("eh2_paper", "ekf_unit", "ekf_tuned", "default"):
            figures = document[case][name]
            assert len(figures["rms_deg"]) == len(figures["rms_second_half_deg"]) == 3
            assert [len(pair) for pair in figures["min_max_deg"]] == [2, 2, 2]
            assert all(math.isfinite(x) for x in figures["rms_deg"])
    assert document["assumptions"]["run_in_s"] == 0.0


def test_senseless_arguments_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["--seeds", "0"], ["--run-in-s", "-1"], ["--dip-deg", "90"]):
        assert main(["evaluate", "paper", *words]) == 2
    assert capsys.readouterr().err.count("expected a number from") == 3


def test_peers_run_when_they_are_installed() -> None:
    trials = make_trials(CASES[1], ASSUMPTIONS, range(1))
    found = runners(CASES[1])
    for name in {"vqf", "imufusion"} & set(found):
        errors = errors_deg(trials, found[name](trials)[name])
        assert np.sqrt(np.mean(errors[:, 500:] ** 2)) < 1.0

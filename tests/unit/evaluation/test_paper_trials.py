"""The paper's trials on half a second of data, and its tables on numbers whose sums are known."""

import importlib.util
import math

import numpy as np
import pytest

from h2nav.evaluation.paper import tables, trials
from h2nav.evaluation.paper.filter import Weights, linearised_plant
from h2nav.evaluation.paper.tables import SLIDES, PaperComparison, PaperRow, comparisons
from h2nav.evaluation.paper.trials import CASES, Assumptions, Case, errors_deg, make_trials
from h2nav.maths.units import DEG, GRAVITY_M_S2

SHORT = Assumptions(run_in_s=0.2)
CASE = Case("case_1", "case1", 0.3, averaged=True)


@pytest.fixture(scope="module")
def data():
    return make_trials(CASE, SHORT, range(3, 5))


def test_a_trial_has_its_run_in_its_seeds_and_the_same_truth(data):
    assert data.t_us.tolist() == [10_000.0 * k for k in range(51)]
    assert data.scored == 20
    assert data.rate.shape == data.force.shape == data.field.shape == (2, 51, 3)
    assert np.abs(data.rate[0] - data.rate[1]).mean() > 1e-3
    other = make_trials(CASE, SHORT, range(4, 5))
    assert np.array_equal(other.rate[0], data.rate[1])
    assert np.array_equal(other.truth, data.truth)
    # the motion begins with the case: the run-in lies before it
    longer = make_trials(CASE, SHORT._replace(run_in_s=0.1), range(3, 4))
    assert longer.truth[10:] == pytest.approx(data.truth[20:])


def test_gyro_samples_are_averaged_with_the_one_before(data):
    assert data.own_rate[:, 0] == pytest.approx(data.rate[:, 0])
    assert data.own_rate[:, 7] == pytest.approx(0.5 * (data.rate[:, 6] + data.rate[:, 7]))
    held = make_trials(CASE._replace(averaged=False), SHORT, range(3, 4))
    assert np.array_equal(held.own_rate, held.rate)


def test_measurements_are_the_directions_of_gravity_and_of_the_field(data):
    """42 deg of dip and 50 uT, seen by a sensor that is nearly level and heads nearly north."""
    expected = [0.0, 0.0, 1.0, math.cos(42.0 * DEG), 0.0, math.sin(42.0 * DEG)]
    turned = np.abs(data.truth).max()
    assert np.abs(data.measured - expected).max() < 0.1 + 2.0 * turned
    assert data.measured[:, :, :3] == pytest.approx(-data.force / GRAVITY_M_S2)
    assert data.measured[:, :, 3:] == pytest.approx(data.field / 50.0)
    assert Assumptions().vectors == pytest.approx(np.reshape(expected, (2, 3)))
    assert (Assumptions().run_in_s, Assumptions().field.declination_rad) == (150.0, 0.0)


def test_errors_are_those_of_the_case_the_short_way_around(data):
    estimates = data.truth + np.array((0.5 * DEG, -2.0 * math.pi, math.pi + 1.0 * DEG))
    found = errors_deg(data, np.array([estimates, data.truth]))
    assert found.shape == (2, 31, 3)
    assert found[0] == pytest.approx(np.tile((0.5, 0.0, -179.0), (31, 1)), abs=1e-9)
    assert not found[1].any()


def test_the_noise_of_tuned_filters_is_that_of_the_sensor(data):
    """Half of the variance of a sample at 100 Hz, per hertz of either sign."""
    noise = trials.densities(SHORT)
    sensor = SHORT.sensor
    still = make_trials(Case("", "rest", 10.0, averaged=False), SHORT, range(1))
    spread = np.median(still.rate.std(axis=1)), np.median(still.force.std(axis=1))
    assert noise.gyro * 10.0 == pytest.approx(spread[0], rel=0.1)
    assert noise.accelerometer * 10.0 == pytest.approx(spread[1], rel=0.1)
    assert noise.magnetometer * 10.0 == pytest.approx(sensor.mag_noise_ut)
    assert noise.bias_walk == pytest.approx(1e-5 * DEG)
    assert (noise.gravity_m_s2, noise.field) == (GRAVITY_M_S2, SHORT.field)


def test_who_runs_in_which_case():
    peers = [name for name in ("vqf", "imufusion") if importlib.util.find_spec(name)]
    assert list(trials.runners(CASES[0])) == [
        "eh2_paper", "ekf_unit", "ekf_tuned", "default", *peers,
    ]  # fmt: skip
    assert list(trials.runners(CASES[2])) == ["ekf_tuned", "default", *peers]
    assert [(case.scenario, case.duration_s, case.averaged) for case in CASES] == [
        ("case1", 50.0, True),
        ("case2", 10.0, True),
        ("case2", 10.0, False),
    ]


@pytest.mark.parametrize(
    ("name", "late_by"), [("eh2_paper", 1), ("ekf_unit", None), ("ekf_tuned", None)]
)
def test_a_filter_starts_from_the_truth_and_stays_near_it(data, name, late_by):
    found = trials.runners(CASE)[name](data)
    for estimates in found.values():
        assert estimates.shape == data.rate.shape
        assert np.abs(errors_deg(data, estimates)).max() < 5.0
    assert np.abs(found[name][:, 0] - data.truth[0]).max() < 2.0 * DEG
    if late_by:
        # before its step it is where the last step left it
        late, prompt = found["eh2_paper"], found["eh2_paper_prompt"]
        assert prompt[:, 1:] == pytest.approx(late[:, :-1])
        assert prompt[:, 0] == pytest.approx(np.tile(data.truth[0], (2, 1)))


def test_filters_with_unit_weights_begin_twenty_seconds_before_the_case(monkeypatch, data):
    monkeypatch.setattr(trials, "UNIT_RUN_IN", 5)
    for run in (trials._paper, trials._ekf_unit):
        for estimates in run(data).values():
            assert np.isnan(estimates[:, :15]).all()
            assert np.isfinite(estimates[:, 15:]).all()


def test_filters_of_ours_have_no_attitude_until_they_have_aligned(data):
    found = trials.runners(CASE)["default"](data)["default"]
    known = np.isfinite(found[..., 0])
    if known.any():
        assert (np.diff(known.astype(int), axis=1) >= 0).all()


# --- tables ---------------------------------------------------------------------------------------


def test_a_row_is_over_all_runs_and_its_extremes_are_those_of_a_typical_one():
    first = np.zeros((2, 4, 3))
    first[0, :, 0], first[1, :, 0] = (3.0, -1.0, 2.0, -4.0), (0.0, 0.0, 0.0, 6.0)
    second = np.full((1, 4, 3), np.nan)
    second[0, 3] = (5.0, 1.0, -2.0)
    row = tables._row([tables._summed(first), tables._summed(second)])
    assert row.rms_deg == pytest.approx(
        [math.sqrt((9 + 1 + 4 + 16 + 36 + 25) / 9.0), 1.0 / 3.0, 2.0 / 3.0]
    )
    assert row.rms_second_half_deg == pytest.approx(
        [math.sqrt((4 + 16 + 36 + 25) / 5.0), math.sqrt(0.2), math.sqrt(0.8)]
    )
    assert np.array(row.min_max_deg) == pytest.approx(
        np.array([[(-4 + 0 + 5) / 3.0, (3 + 6 + 5) / 3.0], [1 / 3.0] * 2, [-2 / 3.0] * 2])
    )


@pytest.mark.parametrize(
    ("slides", "ours", "is_within"),
    [
        (1.0, 1.5, True),
        (1.0, 1.51, False),
        (1.0, 0.667, True),
        (1.0, 0.66, False),
        (-1.0, -1.2, True),
        (-1.0, 1.0, False),
        (1.0, 0.0, False),
    ],
)
def test_a_figure_is_that_of_the_slides_within_a_half(slides, ours, is_within):
    assert PaperComparison("", slides, ours).is_within is is_within


def test_each_figure_of_the_slides_is_compared_with_that_of_the_same_axis():
    ours = PaperRow([1.0, 2.0, 3.0], [9.0] * 3, [[-1.0, 1.0], [-2.0, 2.0], [-3.0, 3.0]])
    found = {case: dict.fromkeys(rows, ours) for case, rows in SLIDES.items()}
    rms = list(comparisons(found, "rms_deg"))
    assert rms[:3] == [
        ("case_1 eh2_paper roll", 0.0331, 1.0),
        ("case_1 eh2_paper pitch", 0.0538, 2.0),
        ("case_1 eh2_paper yaw", 0.1107, 3.0),
    ]
    assert (len(rms), rms[-1]) == (12, ("case_2 ekf_unit yaw", 0.5275, 3.0))
    extremes = list(comparisons(found, "min_max_deg"))
    assert extremes[2:5] == [
        ("case_1 eh2_paper pitch", -0.284, -2.0),
        ("case_1 eh2_paper pitch", 0.240, 2.0),
        ("case_1 eh2_paper yaw", -0.423, -3.0),
    ]
    assert len(extremes) == 24


def test_seeds_are_shared_out_and_gathered_again(monkeypatch):
    asked = []

    def results(run, tasks):
        asked.extend((case.key, list(seeds)) for case, _, seeds in tasks)
        for _, _, seeds in tasks:
            errors = np.tile(np.array(seeds, dtype=float)[:, None, None], (1, 2, 3))
            yield {"some": tables._summed(errors)}

    monkeypatch.setattr(tables.parallel, "results", results)
    found = tables.tables(SHORT, 60)
    assert list(found) == ["case_1", "case_2", "case_2_held"]
    expected = math.sqrt(np.mean(np.arange(60.0) ** 2))
    assert found["case_2"]["some"].rms_deg == pytest.approx([expected] * 3)
    assert [seeds for key, seeds in asked if key == "case_1"] == [
        list(range(25)), list(range(25, 50)), list(range(50, 60)),
    ]  # fmt: skip


def test_the_slides_weigh_all_noises_alike():
    assert Weights() == (1.0, 1.0, 1.0, 1.0)
    vectors = Assumptions().vectors
    unit = linearised_plant(vectors, Weights())
    heavy = linearised_plant(vectors, Weights(2.0, 3.0, 5.0, 7.0))
    assert np.diag(unit.B_w @ unit.B_w.T) == pytest.approx([1.0] * 6)
    assert np.diag(heavy.B_w @ heavy.B_w.T) == pytest.approx([4.0] * 3 + [9.0] * 3)
    assert np.diag(heavy.D_w @ heavy.D_w.T) == pytest.approx([25.0] * 3 + [49.0] * 3)

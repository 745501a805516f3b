"""What decides on an accelerometer: just enough and just too little, and the words for it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from h2nav.calibration import imu
from h2nav.calibration.imu_settings import SensorSettings
from h2nav.calibration.motion_fit import COUNT, MotionFit
from h2nav.calibration.motion_rows import MotionRows
from h2nav.maths.units import DEG, GRAVITY_M_S2


def made_rows(count=4, share=1.0, up=(0.0, 0.0, -1.0)):
    """Windows of 1 s, of a vehicle that neither turns nor leans."""
    whole = np.tile(np.eye(3), (count, 1, 1))
    whole[:, 2] = -np.array(up)
    ones = np.ones((count, 3))
    return MotionRows(
        np.zeros(count, np.int64), np.arange(count) + 0.5, ones[:, 0], 0.0 * ones, share * ones,
        whole, GRAVITY_M_S2 * whole, -GRAVITY_M_S2 * ones, 0.0 * ones, 0.0 * whole,
        0.003 * ones[:, 0], 0.02 * ones[:, 0],
    )  # fmt: skip


def made_fit(values=(), sigma=0.001, lasting=0.001, weight=None, residual=None):
    every = np.zeros(COUNT)
    every[: len(values)] = values
    return MotionFit(
        every,
        np.diag(np.broadcast_to(sigma, COUNT) ** 2.0),
        np.array(np.broadcast_to(lasting, COUNT), dtype=float),
        np.ones(4) if weight is None else np.array(weight),
        np.zeros((4, 3)) if residual is None else residual,
    )


@pytest.mark.parametrize(
    ("values", "weight", "says"),
    [
        ((3.49, -3.49), [0.5] * 4, ""),
        ((0.0, 0.0, -3.51), [1.0] * 4, "3.5 m/s^2 off: it is broken"),
        ((0.0,), [0.49, 0.49, 1.0, 1.0, 1.0], ""),
        (
            (0.0,),
            [0.49, 0.49, 1.0, 1.0],
            "force, attitude and receiver contradict each other in 50% of the windows",
        ),
    ],
)
def test_what_is_no_fit(values, weight, says):
    assert imu._unusable(made_fit(values, weight=weight)) == says


@pytest.mark.parametrize(
    ("place", "value", "sigma", "lasting", "is_set"),
    [
        (0, 0.126, 0.001, 0.001, True),
        (0, 0.124, 0.001, 0.001, False),  # five times the 2.5 mg by which an attitude may lean
        (0, -0.19, 0.028, 0.001, True),
        (0, -0.18, 0.028, 0.001, False),
        (1, 0.2, 0.001, 0.0499, True),
        (1, 0.2, 0.001, 0.0501, False),
        (3, 0.0101, 0.001, 0.001, True),
        (3, 0.0099, 0.001, 0.001, False),
        (4, 0.0151, 0.003, 0.001, True),
        (4, 0.0149, 0.003, 0.001, False),
        (5, -0.02, 0.001, 0.00499, True),
        (5, -0.02, 0.001, 0.00501, False),
    ],
)
def test_what_is_set_is_relevant_sure_and_lasting(
    monkeypatch, place, value, sigma, lasting, is_set
):
    """10 mg and a percent; five deviations; half of that without any one part of the flights."""
    monkeypatch.setattr(imu, "_constant", lambda rows, value: np.ones(6, bool))
    values, lastings = np.zeros(6), np.full(COUNT, 0.001)
    values[place], lastings[place] = value, lasting
    wanted, left = imu._significant(made_rows(), made_fit(values, sigma, lastings))
    assert np.flatnonzero(wanted).tolist() == [place] * is_set
    assert any(f" of {'xyz'[place % 3]}: known to" in why for why in left) is (
        lasting > (0.05 if place < 3 else 0.005)
    )


def test_what_is_not_set_is_said_and_why(monkeypatch):
    monkeypatch.setattr(imu, "_constant", lambda rows, value: np.ones(6, bool))
    _, left = imu._significant(made_rows(), made_fit((0.05, -0.061, 0.0, 0.004, 0.0, -0.0051)))
    assert left == ["no change: (+0.05, -0.06, +0.00) m/s^2 and 0.5 % are insignificant"]
    lasting = np.array([0.001, 0.12, 0.33, 0.001, 0.02, 0.001, 0, 0, 0, 0])
    wanted, left = imu._significant(made_rows(), made_fit((0.2,), lasting=lasting))
    assert wanted.tolist() == [True, *[False] * 5]
    assert left == [
        "offset of y, z: known to ± (0.001, 0.12, 0.33) from this flight",
        "scale of y: known to ± (0.001, 0.02, 0.001) from this flight",
    ]


def test_an_accelerometer_that_changed_in_one_axis_is_set_in_none(monkeypatch):
    changed = np.array([True, True, False, True, False, True])
    monkeypatch.setattr(imu, "_constant", lambda rows, value: changed)
    wanted, left = imu._significant(made_rows(), made_fit((0.3, 0.0, 0.3, 0.0, 0.03, 0.0)))
    assert not wanted.any()
    assert left[0] == "offset of z, scale of y changed in flight"


@pytest.mark.parametrize(
    ("apart", "sigma", "value", "agree"),
    [
        # four deviations of both, or 30 % of the value
        (0.079, 0.014, 0.2, True),
        (0.080, 0.014, 0.2, False),
        (0.059, 0.001, 0.2, True),
        (0.061, 0.001, 0.2, False),
        (0.0565, 0.01, 0.0, True),
        (0.0567, 0.01, 0.0, False),
    ],
)
def test_quarters_of_a_flight_agree(monkeypatch, apart, sigma, value, agree):
    """Every two of them, the first and the last alike."""
    seen = []

    def fitted(rows, free):
        seen.append(rows.t_s.tolist())
        return made_fit((0.0, value + (apart if len(seen) == 4 else 0.0)), sigma)

    monkeypatch.setattr(imu, "fitted", fitted)
    found = imu._constant(made_rows(9), np.array([0.0, value, 0.0, 0.0, 0.0, 0.0]))
    assert found.tolist() == [True, agree, *[True] * 4]
    assert [len(part) for part in seen] == [3, 2, 2, 2]
    assert np.concatenate(seen).tolist() == made_rows(9).t_s.tolist()


@pytest.mark.parametrize(
    ("offset", "scale", "sigma", "says"),
    [
        (0.0, 0.0103, 0.001, "0.10 ± 0.01 m/s^2 too little at 1 g: offset or scale of z"),
        (0.0, -0.0101, 0.0001, ""),
        (0.3, 0.0, 0.005, "0.30 ± 0.05 m/s^2 too much at 1 g"),
        (-0.2, 0.0, 0.005, ""),  # five deviations of a scale: 0.05 m/s^2 each
        (-0.2, -0.01, 0.0001, "0.10 ± 0.00 m/s^2 too little at 1 g"),
        (-0.3, 0.0, 0.0001, "0.30 ± 0.00 m/s^2 too little at 1 g"),
    ],
)
def test_of_a_vertical_axis_the_sum_of_offset_and_scale_is_known(offset, scale, sigma, says):
    fit = made_fit((0.0, 0.0, offset, 0.0, 0.0, scale), sigma)
    found = imu._vertical(made_rows(), fit)
    if not says:
        assert found == ()
    else:
        (note,) = found
        assert note.startswith(says)
        assert note.endswith("inseparable in these flights; calibrate it in six positions")


def test_residuals_count_by_the_weight_of_each_axis():
    residual = np.array([[0.3, 0.0, 0.4]] * 2 + [[9.0, 9.0, 9.0]] * 2)
    fit = made_fit(weight=[1.0, 1.0, 0.0, 0.0], residual=residual)
    assert imu._rms_m_s(made_rows(), fit) == pytest.approx(math.sqrt(0.25 / 3.0))
    # of windows that count half, residuals are half as large
    assert imu._rms_m_s(made_rows(share=0.5), fit) == pytest.approx(2.0 * math.sqrt(0.25 / 3.0))
    negative = fit._replace(residual=-residual)
    assert imu._rms_m_s(made_rows(), negative) == pytest.approx(math.sqrt(0.25 / 3.0))
    assert imu._shown(made_rows(), fit, negative) == (
        "changes of velocity in 4 windows: 0.289 -> 0.289 m/s rms"
    )


def test_figures_have_values_deviations_and_residuals():
    fit = made_fit((0.3, -0.2, 0.1, 0.01, 0.0, -0.02), 0.003)
    found = imu._figures(made_rows(), fit, fit)
    assert [found[f"add_{axis}_m_s2"] for axis in "xyz"] == pytest.approx([0.3, -0.2, 0.1])
    assert [found[f"scale_{axis}"] for axis in "xyz"] == pytest.approx([0.01, 0.0, -0.02])
    # a lean of 2.5 mg, and a tenth of the value, which the attitude may have taken over
    expected = [math.hypot(0.003, 0.025, 0.1 * value) for value in (0.3, 0.2, 0.1)]
    assert [found[f"add_{axis}_m_s2_sigma"] for axis in "xyz"] == pytest.approx(expected)
    expected = [math.hypot(0.003, 0.1 * value) for value in (0.01, 0.0, 0.02)]
    assert [found[f"scale_{axis}_sigma"] for axis in "xyz"] == pytest.approx(expected)
    assert found["windows"] == 4.0
    assert found["residual_before_m_s"] == found["residual_after_m_s"] == 0.0


def test_new_parameters_take_the_raw_force_to_the_true_one():
    """(1 + scale) value + offset = new scale (raw - new offset), of raw forces of any size."""
    settings = SensorSettings(
        "", "OFF_%s", "SCAL_%s", np.array((0.1, -0.2, 0.3)), np.array((1.01, 0.98, 1.0)), np.eye(3)
    )
    added, scales = np.array((0.3, 0.0, -0.2)), np.array((0.02, 0.03, 0.0))
    fit = made_fit((*added, *scales), 0.004)
    wanted = np.array([True, False, True, True, True, False])
    changes = {c.name: c for c in imu._force_changes(settings, fit, wanted)}
    assert list(changes) == ["OFF_X", "OFF_Z", "SCAL_X", "SCAL_Y"]
    assert [c.old for c in changes.values()] == [0.1, 0.3, 1.01, 0.98]
    new_offset = np.array((changes["OFF_X"].new, -0.2, changes["OFF_Z"].new))
    new_scale = np.array((changes["SCAL_X"].new, changes["SCAL_Y"].new, 1.0))
    raw = np.array([(1.0, 2.0, -9.0), (-4.0, 0.5, 3.0)])
    in_use = settings.scale * (raw - settings.offset)
    expected = (1.0 + scales) * in_use + added
    assert new_scale * (raw - new_offset) == pytest.approx(expected)
    assert changes["OFF_X"].sigma == pytest.approx(
        math.hypot(0.004, 0.025, 0.03) / changes["SCAL_X"].new
    )
    assert changes["SCAL_Y"].sigma == pytest.approx(0.98 * math.hypot(0.004, 0.003))


def gyro_outcome(monkeypatch, first_deg_s, second_deg_s, count=80, **parameters):
    """Of a gyro whose x axis is off by that in the first half of a flight, and in the second."""
    off = np.where(np.arange(count) < count // 2, first_deg_s, second_deg_s)
    bias = DEG * np.outer(off, (1.0, 0.0, 0.0))
    rows = imu._Biases(np.zeros(count, np.int64), 5.0 * np.arange(count), bias)
    settings = SensorSettings("7", "OFF_%s", "", np.array((0.5, 0.0, 0.0)), np.ones(3), np.eye(3))
    monkeypatch.setattr(imu, "sensor_settings", lambda *_, is_gyro: settings)
    monkeypatch.setattr(imu, "_turned", lambda *_: rows)
    flown = SimpleNamespace(parameters=parameters)
    return imu.calibrate_gyro(imu.Tracks(1, ((flown, None),)))


@pytest.mark.parametrize(
    ("case", "left"),
    [
        ((1.0, 1.0, 7), "too little flight time with a certain attitude"),
        ((0.29, 0.29), "no change: 0.29 ± 0.02 deg/s are insignificant"),
        ((1.0, 1.4), "its bias changed by 0.40 deg/s in flight"),
        ((1.4, 1.0), "its bias changed by 0.40 deg/s in flight"),
    ],
)
def test_why_a_gyro_is_left_as_it_is(monkeypatch, case, left):
    outcome = gyro_outcome(monkeypatch, *case)
    assert (outcome.sensor, outcome.device) == ("gyro 2", "7")
    assert (outcome.left, outcome.changes) == ((left,), ())


def test_an_offset_that_is_learnt_at_every_start_is_left_to_the_autopilot(monkeypatch):
    outcome = gyro_outcome(monkeypatch, 1.0, 1.0, INS_GYR_CAL=1.0)
    assert outcome.left == (
        "1.00 deg/s remain, but the autopilot learns the offset again at every start "
        "(INS_GYR_CAL 1): keep it still and warm then",
    )
    assert outcome.changes == ()


@pytest.mark.parametrize("case", [(0.31, 0.31), (1.0, 1.0, 8), (1.0, 1.2)])
def test_a_gyro_that_is_off_alike_throughout_is_set(monkeypatch, case):
    """Halves agree within 30 % of the bias."""
    outcome = gyro_outcome(monkeypatch, *case, INS_GYR_CAL=0.0)
    (change,) = outcome.changes
    assert outcome.left == ()
    assert (change.name, change.old) == ("OFF_X", 0.5)
    assert change.new == pytest.approx(0.5 + 0.5 * (case[0] + case[1]) * DEG, abs=1e-3)

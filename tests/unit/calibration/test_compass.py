"""What decides on a compass: just enough and just too little of it, and the words for it."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.calibration import compass, rotations
from h2nav.calibration.compass import Model, Subject
from h2nav.calibration.field_fit import (
    COUNT,
    MATRIX,
    MOTOR,
    NONE,
    OFFSET,
    FieldCorrection,
    FieldFit,
    FieldRows,
)
from h2nav.calibration.outcome import Outcome
from h2nav.calibration.settings import Lever, ardupilot_compass, ardupilot_values
from h2nav.maths.units import DEG
from tests.unit.calibration.fields import flown_rows
from tests.unit.calibration.repeated_flights import PARAMETERS

EARTH_N_UT = np.array((20.0, 0.0, 43.0))
NORM_UT = 50.0


def made_rows(headings_deg, tilt_deg=0.0, **columns):
    """A row each 0.2 s; the field that it shows is the earth's."""
    count = len(headings_deg)
    turns = Rotation.from_euler(
        "ZYX", [(h, tilt_deg * math.sin(k), 0.0) for k, h in enumerate(headings_deg)], degrees=True
    ).inv()
    earth = turns.apply(np.tile(EARTH_N_UT, (count, 1)))
    rows = FieldRows(
        np.zeros(count, np.int64), 0.2 * np.arange(count), earth, earth, np.zeros((count, 3)),
        turns.apply(np.tile((0.0, 0.0, 1.0), (count, 1))), np.radians(headings_deg),
        np.full(count, 1.5 * DEG), np.full(count, np.nan), np.full(count, np.nan),
    )  # fmt: skip
    return rows._replace(**columns)


def made_fit(residual_ut, weight=None, covariance=None):
    count = len(residual_ut)
    return FieldFit(
        NONE,
        np.zeros((COUNT, COUNT)) if covariance is None else covariance,
        np.zeros(count),
        np.ones(count) if weight is None else weight,
        np.asarray(residual_ut, dtype=float),
        0.0,
    )


def subject_of(rows, parameters, **settings):
    own = ardupilot_compass({**PARAMETERS, **parameters}, 0)._replace(**settings)
    return Subject("compass 1", rows, own, {**PARAMETERS, **parameters}, ardupilot_values)


def without_parameters(rows):
    return subject_of(rows, {}, can_shape=False)._replace(parameters={})


def sectors(count, each=7):
    """Headings in the middle of so many of the sixteen sectors."""
    return np.repeat(22.5 * np.arange(count) + 11.25, each)


@pytest.mark.parametrize(
    ("model", "fitted"),
    [
        (Model(), range(3)),
        (Model(has_matrix=True), range(9)),
        (Model(lever=Lever.CURRENT), (0, 1, 2, 9, 10, 11)),
        (Model(True, Lever.THROTTLE), range(12)),
    ],
)
def test_a_model_has_offset_matrix_and_motors(model, fitted):
    assert np.flatnonzero(model.free).tolist() == list(fitted)


FULL = made_rows(sectors(16), tilt_deg=20.0)


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        (FULL, ""),
        (made_rows(sectors(16)[:50], 20.0), "no turns: 202 deg of heading"),
        (made_rows(sectors(16)[:49], 20.0), "only 10 s of usable flight"),
        (made_rows(sectors(9, 6)[:50], 20.0), ""),
        (made_rows(sectors(8), 20.0), ""),
        (
            made_rows(sectors(7, 8), 20.0),
            "no turns: 202 deg of heading were not flown, at most 180 may",
        ),
        (made_rows(np.append(sectors(8), [11.25 + 22.5 * 8] * 4), 20.0), ""),
        (FULL._replace(raw_ut=0.31 * FULL.raw_ut), ""),
        (
            FULL._replace(raw_ut=0.29 * FULL.raw_ut),
            "its field does not follow the turns: it is dead, or far too weak",
        ),
        # what the earth's field hardly changes, no compass has to follow
        (FULL._replace(raw_ut=0.02 * FULL.raw_ut, earth_ut=0.1 * FULL.earth_ut), ""),
        (FULL._replace(raw_ut=0.08 * FULL.raw_ut, earth_ut=0.3 * FULL.earth_ut), "not follow"),
    ],
)
def test_what_flight_shows_a_compass_at_all(rows, says):
    found = compass._unusable(rows)
    assert found == says if not says else says in found


@pytest.mark.parametrize(("deviation_ut", "is_dead"), [(0.0098, True), (0.0102, False)])
def test_an_axis_is_dead_that_moves_by_less_than_the_finest_compass_resolves(deviation_ut, is_dead):
    """Along any direction, not only along an axis of the board."""
    noise = np.where(np.arange(len(FULL.t_s)) % 2, 1.0, -1.0) * deviation_ut
    turn = Rotation.from_euler("xyz", (0.4, -0.7, 0.2)).as_matrix()
    around = np.radians(360.0 / 28.0) * np.arange(112)  # each direction under either sign
    own = np.stack((15.0 * np.cos(around), 15.0 * np.sin(around), 40.0 + noise), axis=1)
    rows = FULL._replace(raw_ut=own @ turn.T)
    assert ("an axis is dead" in compass._unusable(rows)) is is_dead


@pytest.mark.parametrize(
    ("lever", "spread", "shows"),
    [
        (Lever.THROTTLE, 0.168, True),
        (Lever.THROTTLE, 0.166, False),
        (Lever.CURRENT, 2.23, True),
        (Lever.CURRENT, 2.21, False),
    ],
)
def test_motors_show_between_the_5th_and_the_95th_percentile(lever, spread, shows):
    values = np.random.default_rng(1).permutation(np.linspace(0.4, 0.4 + spread, 2000))
    name = "throttle" if lever is Lever.THROTTLE else "current_a"
    rows = made_rows(np.zeros(2000), **{name: values})
    assert compass._shows(rows, lever) is shows
    other = Lever.CURRENT if lever is Lever.THROTTLE else Lever.THROTTLE
    assert not compass._shows(rows, other)


@pytest.mark.parametrize(("unknown", "shows"), [(20, True), (21, False), (100, False)])
def test_motors_show_if_the_lever_is_known_for_four_fifths_of_the_flight(unknown, shows):
    throttle = np.linspace(0.0, 1.0, 100)
    throttle[:unknown] = np.nan
    assert compass._shows(made_rows(np.zeros(100), throttle=throttle), Lever.THROTTLE) is shows


def test_halves_of_a_flight_are_every_second_block_of_twenty_seconds():
    rows = made_rows(np.zeros(6), t_s=np.array((0.0, 19.9, 20.0, 39.9, 40.0, 60.0)))
    assert compass._half(rows).tolist() == [0, 0, 1, 1, 0, 1]


def lengths(*values):
    return np.array(values)[:, None] * np.array((0.0, 0.6, -0.8))


@pytest.mark.parametrize(
    ("fit_ut", "plain_ut", "says"),
    [
        ([7.4] * 10, [4.9] * 10, ""),
        ([7.6] * 10, [4.9] * 10, "no calibration explains it: 76 of 500 mG are left"),
        # a third of the flight may fit as badly as it likes, as seen by most of the rows
        ([7.4] * 8 + [30.0] * 2, [4.9] * 10, ""),
        ([7.4] * 6 + [30.0] * 4, [4.9] * 10, "no calibration explains it: 300 of 500 mG"),
        ([1.0] * 10, [5.1] * 4 + [4.9] * 6, ""),
        (
            [1.0] * 10,
            [5.1] * 5 + [4.9] * 5,
            "50% of the flight fit no single calibration: a magnet came or went",
        ),
    ],
)
def test_what_no_calibration_explains_is_said(fit_ut, plain_ut, says):
    found = compass._left(made_fit(lengths(*fit_ut)), made_fit(lengths(*plain_ut)), NORM_UT)
    assert found.startswith(says)
    assert bool(found) is bool(says)


def test_the_heading_of_a_compass_is_off_by_the_turn_of_its_field_about_the_vertical():
    """In any attitude; what is off along the vertical turns no heading, and is no part of it."""
    rows = made_rows(np.linspace(0.0, 350.0, 40), tilt_deg=40.0)
    angles = np.where(np.arange(40) % 2, 5.0, -12.0) * DEG
    turned = Rotation.from_rotvec(angles[:, None] * rows.down).apply(rows.earth_ut)
    fit = made_fit(turned - rows.earth_ut + 7.0 * rows.down)
    every = np.ones(40, bool)
    expected = math.sqrt((25.0 + 144.0) / 2.0) * DEG
    assert compass._heading_rms(rows, fit, every) == pytest.approx(expected)
    first = np.arange(40) % 2 == 1
    assert compass._heading_rms(rows, fit, first) == pytest.approx(5.0 * DEG)
    assert math.isnan(compass._heading_rms(rows, fit, ~every))


def test_the_figures_of_a_compass():
    rows = made_rows(sectors(15, 4), throttle=np.append(np.linspace(0.2, 0.6, 59), np.nan))
    weight = np.where(np.arange(60) < 45, 0.8, 0.5)
    after = made_fit(np.tile((0.3, 0.0, 0.4), (60, 1)), weight)
    before = made_fit(np.tile((0.0, 0.0, 5.0), (60, 1)), weight)
    found = compass._figures(rows, rows, before, after)
    expected = {
        "residual_before_mg": 50.0,
        "residual_after_mg": 5.0,
        "heading_before_deg": 0.0,
        "field_mg": 10.0 * np.linalg.norm(EARTH_N_UT),
        "used_s": 9.0,
        "used_share": 0.75,
        "heading_gap_deg": 360.0,  # no sector for a second
        "attitude_heading_sigma_deg": 1.5,
        "throttle_low": 0.22,
        "throttle_high": 0.58,
    }
    assert {name: found[name] for name in expected} == pytest.approx(expected, abs=1e-9)
    assert set(found) - set(expected) == {"heading_after_deg"}
    assert all(math.isnan(end) for end in compass._quantiles(np.full(3, np.nan)))


# --- significance -------------------------------------------------------------------------------


@pytest.mark.parametrize(("size", "sure"), [(0.499, False), (0.501, True)])
def test_a_change_is_sure_from_five_deviations_along_its_own_direction(size, sure):
    turn = Rotation.from_euler("xyz", (0.3, 0.5, -0.2)).as_matrix()
    covariance = np.zeros((COUNT, COUNT))
    covariance[OFFSET, OFFSET] = turn @ np.diag((0.01, 9.0, 4.0)) @ turn.T
    change = np.zeros(COUNT)
    change[OFFSET] = size * turn[:, 0]
    change[MATRIX] = 99.0  # not of this kind
    assert compass._is_sure(change, covariance, OFFSET) is sure
    # what was not fitted has no deviation, and does not count
    covariance[:2, :] = covariance[:, :2] = 0.0
    change[:2], change[2] = 99.0, 10.0 * size * math.sqrt(covariance[2, 2])
    assert compass._is_sure(change, covariance, OFFSET) is sure


@pytest.mark.parametrize(
    ("part", "rows", "least"),
    [
        (MATRIX, 22026, math.sqrt(60.0)),  # six values, ln 22026 = 10
        (MOTOR, 22026, math.sqrt(30.0)),
        (MOTOR, 1000, 5.0),
    ],
)
def test_more_values_are_demanded_if_they_are_worth_their_number(part, rows, least):
    fit = made_fit(np.zeros((rows, 3)), covariance=np.eye(COUNT))
    change = np.zeros(COUNT)
    for share, wanted in ((0.999, False), (1.001, True)):
        change[part.start] = share * least
        assert compass._is_demanded(change, fit, part) is wanted


@pytest.mark.parametrize(
    ("model", "place", "sigma", "change", "shown"),
    [
        (Model(), 0, 0.99, 0.0, True),
        (Model(), 0, 1.01, 0.0, False),
        (Model(), 0, 1.01, -3.04, True),
        (Model(), 0, 1.01, 3.02, False),
        (Model(True), 2, 99.0, 0.0, True),
        (Model(True), 3, 0.0449, 0.0, True),
        (Model(True), 3, 0.0451, 0.0, False),
        (Model(True), 5, 0.0451, 0.14, True),
        (Model(True), 6, 0.0269, 0.0, True),
        (Model(True), 8, 0.0271, 0.0, False),
        (Model(), 9, 99.0, 0.0, True),
    ],
)
def test_a_value_is_shown_if_it_is_known_better_than_before_or_clearly_off(
    model, place, sigma, change, shown
):
    covariance, changes = np.zeros((COUNT, COUNT)), np.zeros(COUNT)
    covariance[place, place], changes[place] = sigma**2, change
    found = compass._shown(model, changes, covariance, NORM_UT)
    assert found[place] == shown
    assert np.delete(found, place).all()


def test_what_stays_hidden_is_named_with_how_well_it_is_known():
    covariance = np.diag(np.array([1.0, 2.0, 3.0, *[0.06] * 3, 0.01, 0.02, 0.04, 9, 9, 9]) ** 2)
    hidden = np.zeros(COUNT, bool)
    assert compass._hidden(hidden, covariance) == ()
    hidden[[0, 1, 5, 7, 9]] = True
    assert compass._hidden(hidden, covariance) == (
        "offset of x, y: known to ± 20 mG from this flight",
        "scale and soft iron of z, xz: known to ± 6 % from this flight",
    )


def test_an_offset_is_said_in_words_where_the_parameters_are_unknown():
    change = np.zeros(COUNT)
    change[OFFSET] = (1.26, -3.04, 0.0)
    covariance = np.diag([0.04, 0.09, 0.16, *[9.0] * 9])
    found = compass._to_add(
        change, covariance, Outcome("compass 1", notes=("a",), figures={"b": 1})
    )
    note = "add (+13 ± 2, -30 ± 3, +0 ± 4) mG to its offset; the parameters in use are not in the"
    assert found.notes == ("a", f"{note} recording (--parameters)")
    assert found.figures == pytest.approx(
        {"b": 1, "add_x_mg": 12.6, "add_y_mg": -30.4, "add_z_mg": 0.0}
    )


# --- parameters ---------------------------------------------------------------------------------


def test_what_changes_is_written_with_its_deviation_and_nothing_else():
    subject = subject_of(FULL, {"COMPASS_OFS_X": 20.0, "COMPASS_OFS_Y": -5.0})
    new = subject.settings._replace(
        correction=subject.settings.correction._replace(offset_ut=np.array((5.0, -0.5, 0.0)))
    )
    (change,) = compass._changes(subject, new, np.diag([0.09, 4.0, *[1.0] * 10]))
    assert change[:2] == ("COMPASS_OFS_X", 20.0)
    assert change[2:] == pytest.approx((50.0, 3.0), rel=1e-6)


def test_a_matrix_is_written_as_a_whole():
    """A diagonal of zeros is taken for ones: one element alone would be the whole matrix."""
    zeros = {f"COMPASS_DIA_{axis}": 0.0 for axis in "XYZ"}
    subject = subject_of(FULL, zeros)
    same = compass._changes(subject, subject.settings, np.zeros((COUNT, COUNT)))
    assert not [change for change in same if change.name.startswith("COMPASS_OFS")]
    S = np.eye(3)
    S[0, 1] = S[1, 0] = 0.02
    new = subject.settings._replace(correction=FieldCorrection(np.zeros(3), S, np.zeros(3)))
    found = {c.name: c for c in compass._changes(subject, new, 1e-4 * np.eye(COUNT))}
    assert set(found) == {"COMPASS_ODI_X", *zeros}
    assert [found[name].new for name in zeros] == pytest.approx([1.0] * 3)
    assert found["COMPASS_ODI_X"].new == pytest.approx(0.02)
    assert found["COMPASS_ODI_X"].sigma == pytest.approx(0.01, rel=1e-3)


# --- rotation -----------------------------------------------------------------------------------


def turned_rows(number, correction=NONE):
    """Of a compass that lies by this rotation, and whose driver takes it for one that does not."""
    rng = np.random.default_rng(4)
    rows = flown_rows(rng, correction._replace(motor_ut=np.zeros(3)), seconds=12.0, turns=1.0)
    return rows._replace(raw_ut=rows.raw_ut @ rotations.matrix(number))


@pytest.mark.parametrize(
    ("in_use", "lies", "can_turn", "found"),
    [(0, 0, True, None), (2, 6, True, 0), (2, 4, False, 4)],
)
def test_a_rotation_is_found_only_where_the_one_in_use_is_wrong(
    monkeypatch, in_use, lies, can_turn, found
):
    monkeypatch.setattr(rotations, "ANGLES_DEG", rotations.ANGLES_DEG[:10])
    rows = turned_rows(lies)
    subject = subject_of(rows, {}, rotation=in_use, can_turn=can_turn)
    assert compass._rotation(subject, 47.0) == found
    if found is not None:
        # an attitude that does not know its heading would take any turn for its own error
        lost = rows._replace(sigma_rad=np.full(len(rows.t_s), 20.1 * DEG))
        assert compass._rotation(subject._replace(rows=lost), 47.0) is None


def test_rotations_are_apart_by_the_angle_between_them():
    for one, other, apart_deg in ((0, 0, 0.0), (0, 1, 45.0), (2, 6, 180.0), (0, 41, 7.0)):
        assert compass._apart_rad(one, other) == pytest.approx(apart_deg * DEG, abs=1e-6)


def test_a_turned_compass_is_said_and_starts_anew():
    rows = turned_rows(4)
    subject = subject_of(rows, {"COMPASS_OFS_X": 20.0}, rotation=2, can_turn=True)
    turned, settings, note = compass._turned(subject, 6)
    assert note == "it lies turned: yaw 270, and not yaw 90"
    assert (settings.rotation, settings.correction) == (6, NONE)
    assert turned.raw_ut == pytest.approx(rows.raw_ut * (-1.0, -1.0, 1.0))
    fixed = subject._replace(settings=subject.settings._replace(can_turn=False))
    turned, settings, note = compass._turned(fixed, 4)
    assert settings.rotation == 0
    assert turned.raw_ut == pytest.approx(rows.raw_ut * (-1.0, -1.0, 1.0))
    assert note == (
        "it lies turned: yaw 180, and not none; an internal compass has no rotation of its own, "
        "unless it is called external"
    )
    _, _, note = compass._turned(without_parameters(rows), 4)
    assert note == "it lies turned against what its rotation says: yaw 180"


# --- which model --------------------------------------------------------------------------------

SOFT = np.array(((1.08, 0.03, 0.0), (0.03, 0.95, -0.02), (0.0, -0.02, 0.97)))
OFFSET_UT = np.array((12.0, -7.0, 4.0))


@pytest.mark.parametrize(
    ("needed", "levers", "known", "model"),
    [
        (FieldCorrection(OFFSET_UT, np.eye(3), np.zeros(3)), (1,), True, Model()),
        (FieldCorrection(OFFSET_UT, SOFT, np.zeros(3)), (), True, Model(True)),
        (
            FieldCorrection(OFFSET_UT, np.eye(3), np.array((14.0, 9.0, 0.0))),
            (1,),
            True,
            Model(False, Lever.THROTTLE),
        ),
        # nobody knows how the motors are compensated
        (
            FieldCorrection(OFFSET_UT, np.eye(3), np.array((14.0, 9.0, 0.0))),
            (1,),
            False,
            Model(),
        ),
    ],
)
def test_a_model_is_as_rich_as_the_flight_demands(needed, levers, known, model):
    rows = flown_rows(np.random.default_rng(3), needed, seconds=60.0, turns=2.0)
    subject = subject_of(rows, {}) if known else without_parameters(rows)
    subject = subject._replace(settings=subject.settings._replace(can_shape=model.has_matrix))
    assert compass._chosen(subject, tuple(map(Lever, levers)), 47.0) == model
    lost = rows._replace(sigma_rad=np.full(len(rows.t_s), 20.1 * DEG))
    assert compass._chosen(subject._replace(rows=lost), tuple(map(Lever, levers)), 47.0) == Model()


@pytest.mark.parametrize(
    ("model", "rows_each", "is_enough"),
    [
        (Model(), 25, True),
        (Model(), 24, False),
        (Model(True), 75, True),
        (Model(True), 74, False),
    ],
)
def test_rows_of_each_half_that_a_model_needs(model, rows_each, is_enough):
    rows = flown_rows(np.random.default_rng(3), NONE, seconds=40.0, turns=1.0)
    keep = np.concatenate((np.arange(rows_each), 100 + np.arange(rows_each)))
    rows = FieldRows(*(column[keep] for column in rows))
    assert math.isfinite(compass._unseen_ut(subject_of(rows, {}), model)) is is_enough


def test_a_flight_without_parameters_says_what_to_add():
    iron = FieldCorrection(OFFSET_UT, np.eye(3), np.zeros(3))
    rows = flown_rows(np.random.default_rng(3), iron, seconds=60.0, turns=2.0)
    found = compass._outcome(without_parameters(rows), ())
    assert found.changes == ()
    added = [found.figures[f"add_{axis}_mg"] for axis in "xyz"]
    assert added == pytest.approx(10.0 * OFFSET_UT, abs=10.0)
    assert found.shown.startswith(f"residual {found.figures['residual_before_mg']:.0f} -> ")
    none = flown_rows(np.random.default_rng(3), NONE, seconds=60.0, turns=2.0)
    (why, *_) = compass._outcome(without_parameters(none), ()).left
    assert why.startswith("no change: ")
    assert why.endswith(" mG are insignificant")

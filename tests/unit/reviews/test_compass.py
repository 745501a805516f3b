"""Compasses with known faults: what is told, how large, and that the advice undoes it."""

import numpy as np
import pytest
from reviewed_flights import (
    body_field,
    estimates,
    flight,
    followed_compass,
    ideal,
    with_imu,
)

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import DEG
from h2nav.recordings.context import Array, Context, Series
from h2nav.reviews.analysis import Analysis, analyse
from h2nav.reviews.compass import compensation, detect_compass
from h2nav.reviews.flight import Flight
from h2nav.reviews.inertial import best_attitude

IRON_UT = np.array([10.0, -8.0, 5.0])
OFFSETS = {"COMPASS_OFS_X": 20.0, "COMPASS_OFS_Y": -30.0, "COMPASS_OFS_Z": 40.0}


def with_field(flown: Flight, m_b_ut: Array) -> Flight:
    return with_imu(flown, m_b_ut=m_b_ut)


def measured(flown: Flight) -> Array:
    return flown.context.imus[0].m_b_ut


def kinds(analysis: Analysis) -> list[str]:
    return [finding.kind for finding in analysis.findings]


@pytest.mark.parametrize("name", ["flight", "aggressive"])
@pytest.mark.parametrize("follows", [False, True])
def test_hard_iron_from_boot_is_found_whatever_the_heading_was(name, follows):
    flown = flight(name, parameters=OFFSETS)
    flown = with_field(flown, measured(flown) + IRON_UT)
    if follows:
        error = followed_compass(name, measured(flown))
        wrong = estimates(name, error)
        flown = flown._replace(
            estimates=wrong,
            context=flown.context._replace(
                attitudes=(flown.context.attitudes[0]._replace(q_nb=wrong.q_nb),)
            ),
        )
    analysis = analyse(flown)
    (found,) = [f for f in analysis.findings if f.kind == "compass_hard_iron"]
    assert found.size == pytest.approx(10.0 * np.linalg.norm(IRON_UT), rel=0.1)
    assert found.severity is Severity.WARNING
    np.testing.assert_allclose(analysis.compasses[0].offset_b_ut, IRON_UT, atol=1.0)
    # ArduPilot adds its offsets, in milligauss, to what the sensor reads.
    told = dict(part.split() for part in found.evidence.split("set ")[1].split(";")[0].split(", "))
    changes = [float(told[name]) - old for name, old in OFFSETS.items()]
    mended = measured(flown) + np.array(changes) / 10.0
    np.testing.assert_allclose(mended.mean(axis=0), body_field(name).mean(axis=0), atol=1.0)


def test_the_offsets_of_px4_are_taken_off():
    parameters = {"CAL_MAG0_XOFF": 0.1, "CAL_MAG0_YOFF": 0.2, "CAL_MAG0_ZOFF": -0.1}
    flown = flight(parameters=parameters)
    flown = with_field(flown, measured(flown) + IRON_UT)
    (found,) = [f for f in analyse(flown).findings if f.kind == "compass_hard_iron"]
    x, y, z = IRON_UT / 100.0
    told = found.evidence.split("set ")[1].split(";")[0].split(", ")
    values = [float(part.split()[1]) for part in told]
    np.testing.assert_allclose(values, [0.1 + x, 0.2 + y, -0.1 + z], atol=0.01)


def test_a_field_that_px4_sends_without_its_calibration_is_no_fault():
    flown = flight(firmware="PX4 1.17")
    flown = with_imu(flown, m_b_ut=measured(flown) + IRON_UT, source="SCALED_IMU")
    (found,) = [f for f in analyse(flown).findings if f.kind == "compass_hard_iron"]
    assert found.severity is Severity.INFO


def test_no_setting_is_named_where_the_field_also_changed_in_flight():
    flown = flight(parameters=OFFSETS)
    is_there = (flown.context.imus[0].t_s > 60.0)[:, None]
    magnet = np.array([20.0, -8.0, 3.0])
    analysis = analyse(with_field(flown, measured(flown) + IRON_UT + is_there * magnet))
    found = {one.kind: one for one in analysis.findings}
    assert found["compass_step"].severity is Severity.WARNING
    assert "COMPASS_OFS" not in found["compass_hard_iron"].evidence


def test_a_magnet_that_comes_and_goes_has_its_times_and_its_field():
    flown = flight()
    t_s = flown.context.imus[0].t_s
    magnet = np.array([12.0, -8.0, 3.0])
    is_there = (t_s > 50.0) & (t_s < 80.0)
    analysis = analyse(with_field(flown, measured(flown) + is_there[:, None] * magnet))
    assert kinds(analysis) == ["compass_step"]
    found = analysis.findings[0]
    assert found.from_s == pytest.approx(50.0, abs=1.5)
    assert found.to_s == pytest.approx(80.0, abs=1.5)
    assert found.size == pytest.approx(10.0 * np.linalg.norm(magnet), rel=0.1)
    assert (
        "(+120, -80, +30)" in found.evidence
        or "(+119, " in found.evidence
        or ("(+121, " in found.evidence)
    )


@pytest.mark.parametrize(("throttle", "severity"), [(0.1, "notice"), (0.45, "warning")])
def test_a_magnet_that_comes_with_the_throttle_may_be_of_the_motors(throttle, severity):
    flown = flight("hover")
    t_s = flown.context.imus[0].t_s
    is_there = t_s > 40.0
    series = Series(t_s, np.where(is_there, 0.45, throttle))
    flown = flown._replace(context=flown.context._replace(throttle=series))
    magnet = is_there[:, None] * np.array([12.0, -8.0, 3.0])
    found = analyse(with_field(flown, measured(flown) + magnet)).findings
    assert [one.severity.word for one in found if one.kind == "compass_step"] == [severity]


def test_a_magnet_that_stays_is_not_taken_for_the_usual_field():
    flown = flight()
    t_s = flown.context.imus[0].t_s
    analysis = analyse(
        with_field(flown, measured(flown) + (t_s > 30.0)[:, None] * np.array([20.0, 10.0, 0.0]))
    )
    assert kinds(analysis) == ["compass_step"]
    assert analysis.findings[0].from_s == pytest.approx(30.0, abs=1.0)


@pytest.mark.parametrize(("sigma_deg", "severity"), [(8.0, "notice"), (1.0, "warning")])
def test_a_field_that_turned_no_further_than_our_heading_may_be_wrong_is_a_note(
    sigma_deg, severity
):
    flown = flight("hover")
    t_s = flown.estimates.t_s
    ours = estimates("hover", 30.0 * DEG * (t_s > 60.0))
    ours = ours._replace(sigma_heading_rad=np.full(len(t_s), sigma_deg * DEG))
    analysis = analyse(flown._replace(estimates=ours))
    (found,) = [one for one in analysis.findings if one.kind == "compass_step"]
    assert found.severity.word == severity


def test_soft_iron_of_a_fifth_is_told():
    flown = flight("aggressive")
    soft = np.diag([1.0 / 1.2, 1.0 / 0.8, 1.0])
    (found,) = [
        f
        for f in analyse(with_field(flown, measured(flown) @ soft)).findings
        if f.kind == "compass_soft_iron"
    ]
    assert found.size == pytest.approx(40.0, abs=6.0)


@pytest.mark.parametrize(("scale", "told"), [(0.8, ["compass_scale"]), (0.9, [])])
def test_a_wrong_strength_is_told_although_level_flight_may_hide_whether_it_is_iron(scale, told):
    flown = flight("square")
    analysis = analyse(with_field(flown, scale * measured(flown)))
    assert kinds(analysis) == told
    assert all("or by iron" in one.evidence for one in analysis.findings)


def test_a_wrong_scale_is_told_and_no_offset_with_it():
    flown = flight("aggressive")
    analysis = analyse(with_field(flown, 1.3 * measured(flown)))
    assert kinds(analysis) == ["compass_scale"]
    assert analysis.findings[0].size == pytest.approx(30.0, abs=3.0)


def test_motors_that_change_the_field_are_told_with_the_compensation():
    flown = flight("aggressive")
    throttle = flown.context.throttle
    assert throttle is not None
    motor = np.array([25.0, 10.0, -15.0])
    m_b_ut = measured(flown) + throttle.values[:, None] * motor
    analysis = analyse(with_field(flown, m_b_ut))
    (found,) = [f for f in analysis.findings if f.kind == "compass_motors"]
    assert found.size == pytest.approx(10.0 * np.linalg.norm(motor), rel=0.1)
    np.testing.assert_allclose(analysis.compasses[0].motor_b_ut, motor, atol=3.0)
    # ArduPilot adds throttle * COMPASS_MOT.
    values = found.evidence.split("COMPASS_MOT (")[1].split(")")[0].split(", ")
    np.testing.assert_allclose([float(v) for v in values], -10.0 * motor, atol=30.0)


X, Y, Z = (f"COMPASS_MOT_{axis}" for axis in "XYZ")


@pytest.mark.parametrize(
    ("compass", "own", "has_throttle", "told"),
    [
        (0, {}, True, "ArduPilot: COMPASS_MOTCT 1, COMPASS_MOT (-20.0, +0.0, +30.0)"),
        (0, {}, False, "ArduPilot: COMPASS_MOTCT 2, COMPASS_MOT (-20.0, +0.0, +30.0)"),
        (1, {}, True, "ArduPilot: COMPASS_MOTCT 1, COMPASS_MOT2 (-20.0, +0.0, +30.0)"),
        # what is compensated already is not in the field
        (0, {"COMPASS_MOTCT": 1.0, X: 5.0, Y: -7.0, Z: -40.0}, True,
         "ArduPilot: COMPASS_MOTCT 1, COMPASS_MOT (-15.0, -7.0, -10.0)"),
        (0, {"COMPASS_MOTCT": 0.0, X: 5.0}, True,
         "ArduPilot: COMPASS_MOTCT 1, COMPASS_MOT (-20.0, +0.0, +30.0)"),
        (0, {"COMPASS_MOTCT": 2.0, X: 5.0}, True,
         "ArduPilot compensates by COMPASS_MOTCT 2: run compassmot anew"),
    ],
)  # fmt: skip
def test_a_compensation_adds_to_the_one_that_is_set(compass, own, has_throttle, told):
    throttle = Series(np.zeros(1), np.zeros(1)) if has_throttle else None
    context = Context(parameters=own, throttle=throttle)
    assert compensation(compass, np.array([2.0, 0.0, -3.0]), context) == told


def test_residuals_per_heading_fall_with_the_fit():
    flown = flight()
    fit = analyse(with_field(flown, measured(flown) + IRON_UT)).compasses[0]
    flown_sectors = np.isfinite(fit.residual_ut)
    assert flown_sectors.sum() > 6
    np.testing.assert_allclose(fit.residual_ut[flown_sectors], np.linalg.norm(IRON_UT), atol=1.5)
    assert (fit.fitted_ut[flown_sectors] < 2.5).all()


def test_the_picture_of_the_field_has_the_models_norm_and_dip():
    analysis = analyse(flight())
    field = analysis.fields[0]
    assert len(field.t_s) <= 2000
    np.testing.assert_allclose(field.norm_ut, field.model_norm_ut, atol=3.0)
    np.testing.assert_allclose(field.dip_rad, field.model_dip_rad, atol=0.05)
    assert abs(np.median(field.heading_rad)) < 0.03


@pytest.mark.parametrize(("tilt_deg", "is_shown"), [(5.0, True), (8.0, False)])
def test_an_attitude_unsure_of_its_tilt_shows_no_compass(tilt_deg, is_shown):
    flown = flight()
    sigma = np.full(len(flown.estimates.t_s), tilt_deg * DEG)
    best = best_attitude(flown._replace(estimates=flown.estimates._replace(sigma_tilt_rad=sigma)))
    track = flown.context.imus[0]
    field, _, _ = detect_compass(track, best, flown.earth, flown.context, is_raw=False)
    assert (field is not None) is is_shown


def test_without_an_attitude_nothing_is_said_of_a_compass():
    analysis = analyse(flight()._replace(estimates=None))
    assert not analysis.compasses
    assert not analysis.fields
    assert len(ideal("flight").t_us) == len(flight().context.imus[0].t_s)


@pytest.mark.parametrize(("share", "is_noted"), [(1.0, True), (0.7, False)])
def test_a_field_that_is_the_earths_but_for_its_direction_is_undecided(share, is_noted):
    flown = flight()
    blamed = Finding(
        Kind.COMPASS_FIELD, Sensor(SensorKind.COMPASS), Severity.ERROR, 40.0, 60.0, 30.0, "deg",
        "attitude contradicts field", "", "a",
    )  # fmt: skip
    flown = with_imu(flown, m_b_ut=share * flown.context.imus[0].m_b_ut)
    found = analyse(flown._replace(findings=(blamed,))).judged
    assert ("a" in found) is is_noted
    assert not is_noted or found["a"].severity is Severity.NOTICE

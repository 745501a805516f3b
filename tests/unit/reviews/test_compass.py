"""Compasses with known faults: what is told, how large, and that the advice undoes it."""

import re
from typing import NamedTuple

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
from scipy.spatial.transform import Rotation

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import DEG
from h2nav.recordings.context import Array, Context, ImuTrack, Series, Span
from h2nav.reviews.analysis import Analysis, analyse
from h2nav.reviews.compass import compensation, detect_compass
from h2nav.reviews.flight import EarthFields, Flight
from h2nav.reviews.inertial import attitudes, best_attitude

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


# --- each bound, on a vehicle that turns and leans in a known field -------------------------------

NORM_UT, DIP_RAD, DECLINATION_RAD = 50.0, 60.0 * DEG, 4.0 * DEG
EARTH = EarthFields(*np.array([[0.0], [NORM_UT], [DIP_RAD], [DECLINATION_RAD]]))
EARTH_N = NORM_UT * np.array(
    (
        np.cos(DIP_RAD) * np.cos(DECLINATION_RAD),
        np.cos(DIP_RAD) * np.sin(DECLINATION_RAD),
        np.sin(DIP_RAD),
    )
)
SECONDS = 80.0


class Compass(NamedTuple):
    """How a compass reads what, and how far our attitude is known."""

    offset_ut: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: float = 1.0
    soft: tuple[float, float] = (0.0, 0.0)  # what turns with twice the heading
    motor_ut: tuple[float, float, float] = (0.0, 0.0, 0.0)  # per full throttle
    throttle: tuple[float, float] = (0.3, 0.3)  # by turns of a second
    step_ut: tuple[float, float, float] = (0.0, 0.0, 0.0)
    step_s: tuple[float, float] = (40.0, 40.0)  # its begin, and when it is complete
    asked_more: float = 0.0  # of the throttle from the step on
    turns_deg: float = 400.0  # over the whole flight
    turned_deg: float = 0.0  # the measured field about the vertical, clockwise
    rate_deg_s: float = 0.0  # that the gyro tells
    seconds: float = SECONDS
    sigma_tilt_deg: float = 1.0
    sigma_heading_deg: float = 1.0
    armed_s: tuple[float, float] = (0.0, SECONDS)
    compass: int = 0
    is_current: bool = False
    is_raw: bool = False
    parameters: dict[str, float] = {}  # noqa: RUF012 - never changed

    def looked_at(self):
        t_s = np.arange(0.0, self.seconds, 0.2)
        middle_s = t_s + 0.1  # of the row that has this sample's field
        turned = Rotation.from_euler("z", self.turned_deg, degrees=True)
        true = self._attitude(middle_s).inv().apply(turned.apply(EARTH_N))
        a, b = self.soft
        mixed = np.array(((1.0 + a, b, 0.0), (b, 1.0 - a, 0.0), (0.0, 0.0, 1.0)))
        throttle = np.where(t_s % 2.0 < 1.0, *self.throttle)
        throttle += np.where(t_s > self.step_s[0], self.asked_more, 0.0)
        begin_s, end_s = self.step_s
        came = np.clip((t_s - begin_s) / max(end_s - begin_s, 1e-9), 0.0, 1.0)
        m_b = self.scale * true @ np.linalg.inv(mixed) + self.offset_ut
        m_b += np.outer(throttle, self.motor_ut) + np.outer(came, self.step_ut)
        w_b = np.tile((0.0, 0.0, self.rate_deg_s * DEG), (len(t_s), 1))
        stamps = np.round(t_s * 1e6).astype(np.int64)
        track = ImuTrack(self.compass, "IMU", t_s, stamps, w_b, np.zeros(w_b.shape), m_b)
        q_nb = np.roll(self._attitude(t_s).as_quat(), 1, axis=1)
        best = attitudes(t_s, q_nb)._replace(
            sigma_tilt_rad=np.full(len(t_s), self.sigma_tilt_deg * DEG),
            sigma_heading_rad=np.full(len(t_s), self.sigma_heading_deg * DEG),
        )
        lever = "current_a" if self.is_current else "throttle"
        context = Context(
            armed=(Span(*self.armed_s, "armed"),), parameters=self.parameters,
            **{lever: Series(middle_s, throttle)},
        )  # fmt: skip
        return detect_compass(track, best, EARTH, context, is_raw=self.is_raw)

    def _attitude(self, t_s) -> Rotation:
        angles = self.turns_deg / SECONDS * t_s, 15.0 * np.sin(0.9 * t_s), 20.0 * np.cos(0.7 * t_s)
        return Rotation.from_euler("ZYX", np.column_stack(angles), degrees=True)

    def told(self) -> list[tuple[str, str]]:
        return [(one.kind, one.severity.word) for one in self.looked_at()[2]]


IRON, STEP, MOTORS = "compass_hard_iron", "compass_step", "compass_motors"


@pytest.mark.parametrize(
    ("case", "told"),
    [
        # 10 deg of heading at worst: of the horizontal field's 25 uT, or of the whole field upward.
        (Compass((4.1, 0.0, 0.0)), []),
        (Compass((0.0, -4.7, 0.0)), [(IRON, "warning")]),
        (Compass((0.0, 0.0, 8.4)), []),
        (Compass((0.0, 0.0, 9.4)), [(IRON, "warning")]),
        (Compass((6.0, 0.0, 0.0), is_raw=True), [(IRON, "info")]),
        (Compass((8.0, 0.0, 0.0), armed_s=(0.0, 0.0)), [(IRON, "warning")]),
        # Of sixteen directions five.
        (Compass((8.0, 0.0, 0.0), turns_deg=89.0), []),
        (Compass((8.0, 0.0, 0.0), turns_deg=112.0), [(IRON, "warning")]),
        (Compass(scale=1.14), []),
        (Compass(scale=1.17), [("compass_scale", "warning")]),
        (Compass(scale=0.83), [("compass_scale", "warning")]),
        (Compass(soft=(0.0, 0.16)), []),
        (Compass(soft=(0.19, 0.0)), [("compass_soft_iron", "warning")]),
        (Compass(soft=(-0.14, 0.14)), [("compass_soft_iron", "warning")]),
        # 30 and 60 % of 50 uT at full throttle, where it changes by more than 0.15.
        (Compass(motor_ut=(14.3, 0.0, 0.0), throttle=(0.2, 0.6)), []),
        (Compass(motor_ut=(0.0, 15.7, 0.0), throttle=(0.2, 0.6)), [(MOTORS, "notice")]),
        (Compass(motor_ut=(0.0, 0.0, 29.3), throttle=(0.2, 0.6)), [(MOTORS, "notice")]),
        (Compass(motor_ut=(0.0, 0.0, 31.0), throttle=(0.2, 0.6)), [(MOTORS, "warning")]),
        (Compass(motor_ut=(0.0, 0.0, 20.0), throttle=(0.15, 0.29)), []),
        (Compass(motor_ut=(0.0, 0.0, 20.0), throttle=(0.15, 0.32)), [(MOTORS, "notice")]),
        (Compass(motor_ut=(40.0, 0.0, 0.0), throttle=(0.2, 0.6), armed_s=(30.0, 80.0)),
         [(MOTORS, "warning")]),
        # 12 % of the field at once; more slowly, it is none.
        (Compass(step_ut=(5.8, 0.0, 0.0)), []),
        (Compass(step_ut=(0.0, 0.0, -6.2)), [(STEP, "warning")]),
        (Compass(step_ut=(9.0, 0.0, 0.0), step_s=(39.8, 40.2)), [(STEP, "warning")]),
        (Compass(step_ut=(0.0, 0.0, 9.0), step_s=(36.0, 44.0)), []),
        # Near the time of arming, or with the throttle, it may be what it stood on.
        (Compass(step_ut=(9.0, 0.0, 0.0), armed_s=(28.6, 80.0)), [(STEP, "notice")]),
        (Compass(step_ut=(9.0, 0.0, 0.0), armed_s=(27.4, 80.0)), [(STEP, "warning")]),
        (Compass(step_ut=(9.0, 0.0, 0.0), asked_more=0.16), [(STEP, "notice")]),
        (Compass(step_ut=(9.0, 0.0, 0.0), asked_more=0.14), [(STEP, "warning")]),
    ],
)  # fmt: skip
def test_what_is_told_of_a_compass(case, told):
    assert case.told() == told


@pytest.mark.parametrize(
    ("too_little", "enough"),
    [
        (Compass(seconds=9.8), Compass(seconds=10.3)),
        (Compass(rate_deg_s=91.0), Compass(rate_deg_s=-89.0)),
        (Compass(sigma_tilt_deg=6.1), Compass(sigma_tilt_deg=5.9)),
    ],
)
def test_what_shows_a_compass(too_little, enough):
    assert too_little.looked_at() == (None, None, [])
    field, fit, found = enough.looked_at()
    assert (field is not None, fit is not None, found) == (True, True, [])


def test_the_field_is_shown_with_its_error_of_heading():
    field, fit, _ = Compass(turned_deg=3.0, compass=1, scale=1.1).looked_at()
    assert (field.compass, fit.compass) == (1, 1)
    assert field.norm_ut == pytest.approx(1.1 * NORM_UT, rel=2e-3)
    assert field.dip_rad == pytest.approx(DIP_RAD, abs=0.5 * DEG)
    assert np.median(field.heading_rad) == pytest.approx(3.0 * DEG, abs=0.1 * DEG)
    assert set(field.model_norm_ut) == {NORM_UT}
    assert set(field.model_dip_rad) == {DIP_RAD}
    assert fit.heading_rad == pytest.approx((np.arange(16) + 0.5) * np.pi / 8.0)
    assert fit.heading_error_rad == pytest.approx(np.full(16, 3.0 * DEG), abs=0.3 * DEG)
    assert fit.scale == pytest.approx(1.1, abs=0.01)
    assert fit.offset_b_ut == pytest.approx(np.zeros(3), abs=0.4)
    # What is left of a scale of 1.1 and a turn by 3 deg about the vertical.
    turned = Rotation.from_euler("z", 3.0, degrees=True)
    left = np.linalg.norm(1.1 * turned.apply(EARTH_N) - EARTH_N)
    assert fit.residual_ut == pytest.approx(np.full(16, left), rel=0.05)
    after = np.linalg.norm(turned.apply(EARTH_N) - EARTH_N)
    assert fit.fitted_ut == pytest.approx(np.full(16, after), abs=0.3)
    assert np.isnan(fit.motor_b_ut).all()


def test_motors_are_shown_by_throttle():
    fit = Compass(motor_ut=(10.0, 0.0, -20.0), throttle=(0.2, 0.6)).looked_at()[1]
    assert fit.motor_b_ut == pytest.approx((10.0, 0.0, -20.0), rel=0.02, abs=0.2)
    assert fit.throttle == pytest.approx((np.arange(8) + 0.5) / 8.0)
    assert np.flatnonzero(np.isfinite(fit.motor_ut)).tolist() == [1, 4]
    # Of both halves of the flight, each is as far from the median of all as the other or less.
    assert np.nansum(fit.motor_ut) == pytest.approx(0.4 * np.hypot(10.0, 20.0), rel=0.05)


@pytest.mark.parametrize(
    ("case", "text", "evidence"),
    [
        (
            Compass((6.0, 0.0, -3.0)),
            "hard iron of 67 mG",
            "(+60, +0, -30) mG forward, right, down: up to 14 deg of heading; add (-60, +0, +30) "
            "to ArduPilot's COMPASS_OFS, or calibrate anew; by strength and dip alone, whatever "
            "the heading was; the rest falls from ",
        ),
        (
            Compass((6.0, 0.0, -3.0), compass=1,
                    parameters={f"COMPASS_OFS2_{axis}": 100.0 for axis in "XYZ"}),
            "hard iron of 67 mG",
            "set COMPASS_OFS2_X 40, COMPASS_OFS2_Y 100, COMPASS_OFS2_Z 130;",
        ),
        (
            Compass((6.0, 0.0, -3.0), parameters={f"CAL_MAG0_{axis}OFF": 0.1 for axis in "XYZ"}),
            "hard iron of 67 mG",
            "set CAL_MAG0_XOFF 0.160, CAL_MAG0_YOFF 0.100, CAL_MAG0_ZOFF 0.070;",
        ),
        (
            Compass((6.0, 0.0, -3.0), parameters={
                "CAL_MAG0_ROT": 4.0, **{f"CAL_MAG0_{axis}OFF": 0.1 for axis in "XYZ"}
            }),
            "hard iron of 67 mG",
            "add (-60, +0, +30) to ArduPilot's",  # its axes are not the vehicle's
        ),
        (
            Compass((6.0, 0.0, -3.0), is_raw=True),
            "hard iron of 67 mG",
            "; the message shows the field without the autopilot's calibration;",
        ),
        (
            Compass(scale=1.2),
            "field is +{:.0f}% against the earth's",
            "the same in all headings; the rest falls from ",
        ),
        (
            Compass(soft=(0.2, 0.0)),
            "soft iron: {:.0f}% stronger one way than across",
            "up to 11 deg of heading, twice in a full turn; the rest falls from ",
        ),
        (
            Compass(step_ut=(9.0, 0.0, -3.0)),
            "field of the vehicle itself changed by 95 mG",
            "(+90, +0, -30) mG forward, right, down, fixed to the body: a magnet, a motor or a "
            "wire near the compass",
        ),
        (
            Compass(motor_ut=(0.0, 20.0, 0.0), throttle=(0.2, 0.6)),
            "motors change the field by 200 mG",
            "40% of the earth's field at full throttle; ArduPilot: COMPASS_MOTCT 1, COMPASS_MOT "
            "(+0.0, -199.8, +0.0); 30% are usual, 60% too much",
        ),
        (
            Compass(motor_ut=(0.0, 2.0, 0.0), throttle=(2.0, 10.0), is_current=True),
            "motors change the field by 200 mG",
            "40% of the earth's field at the largest current; ArduPilot: COMPASS_MOTCT 2,",
        ),
    ],
)  # fmt: skip
def test_how_a_compass_is_told(case, text, evidence):
    (one,) = case.looked_at()[2]
    assert one.text == text.format(one.size)
    assert evidence in re.sub(r"-0(?=[,)]|\.0)", "+0", one.evidence)
    assert one.source == f"compass {case.compass + 1}"
    begin_s = 40.0 if one.kind == STEP else 0.0
    assert (one.from_s, one.to_s) == pytest.approx((begin_s, SECONDS), abs=0.3)

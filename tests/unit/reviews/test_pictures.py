"""The pictures of a review draw what their records say, in the units of their axes."""

import math

import numpy as np
import pytest
from needs import DEG
from scipy.spatial.transform import Rotation

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import (
    AttitudeTrack,
    Battery,
    ChangedSetting,
    Context,
    Esc,
    ImuTrack,
    Motors,
    Occurrence,
    ReportedFault,
    Said,
    Series,
    Span,
    Sticks,
)
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.flight import EarthFields, Estimates, Flight, Ratios
from h2nav.reviews.pictures import attitude, colours, control, event, sensors, timeline, vehicle
from h2nav.reviews.pictures.columns import Columns
from h2nav.reviews.pictures.grounds import GroundContact
from h2nav.reviews.pictures.picture import Dash, Lines, PictureMark
from h2nav.reviews.pictures.spectra import shades, spectra
from h2nav.reviews.tracks import Bias, Peak, Receiver, Spectrum, TimingTrack, Vibrations

NOTHING = np.zeros(0)
T_S = np.arange(0.0, 100.5, 0.5)
ONES = np.ones(len(T_S))


def made(context: Context | None = None, **changes: object) -> Flight:
    """A flight of 100 s with nothing in it but what is given."""
    bare = Flight(
        "made", "made.bin", "dataflash", "", context or Context(duration_s=100.0), None, None, "",
        "IMU", Ratios(NOTHING, (), np.zeros((0, 0))),
        EarthFields(NOTHING, NOTHING, NOTHING, NOTHING), (), (), (), (), {},
    )  # fmt: skip
    return bare._replace(**changes)


def of(**quantities: object) -> Context:
    return Context(duration_s=100.0, **quantities)


def attitudes(roll=0.0, pitch=0.0, heading=0.0) -> np.ndarray:
    """(N, 4) in degrees, scalar first."""
    angles = np.column_stack([np.broadcast_to(one, len(T_S)) for one in (heading, pitch, roll)])
    return np.roll(Rotation.from_euler("ZYX", angles, degrees=True).as_quat(), 1, axis=1)


def estimates(q_nb=None, tilt_deg=1.0, heading_deg=2.0) -> Estimates:
    q_nb = attitudes() if q_nb is None else q_nb
    return Estimates(
        T_S, q_nb, np.zeros((len(T_S), 3)), tilt_deg * DEG * ONES, heading_deg * DEG * ONES
    )


def finding(kind, from_s, to_s=None, severity=Severity.WARNING, size=1.0, number=1, text="it"):
    sensor = Sensor(SensorKind.IMU, number)
    end_s = from_s if to_s is None else to_s
    return Finding(kind, sensor, severity, from_s, end_s, size, "", text, "")


def levels(picture: Lines) -> dict[str, float]:
    """Each line's name and its median."""
    return {one.label: float(np.nanmedian(one.values)) for one in picture.traces}


# --- attitude ---------------------------------------------------------------------------------


def test_angles_are_drawn_in_degrees_with_three_deviations():
    asked = Series(T_S, np.tile(np.array((4.0, 5.0, 320.0)) * DEG, (len(T_S), 1)))
    others = tuple(AttitudeTrack(f"EKF {n}", T_S, attitudes(n, -n, 330.0)) for n in range(6))
    truth = AttitudeTrack("truth", T_S, attitudes(9.0, 8.0, 340.0))
    flown = made(
        of(demand=asked, attitudes=others, truth=truth),
        estimates=estimates(attitudes(20.0, -10.0, 350.0)),
    )
    roll, pitch, heading = attitude.attitude(flown).pictures
    assert [one.title for one in (roll, pitch, heading)] == ["Roll", "Pitch", "Heading"]
    assert [one.unit for one in (roll, pitch, heading)] == ["deg"] * 3
    assert [one.goes_round for one in (roll, pitch, heading)] == [False, False, True]
    names = ["demand", "EKF 0", "EKF 1", "EKF 2", "EKF 3", "h2nav", "truth"]
    for picture, expected in ((roll, (4, 0, 1, 2, 3, 20, 9)), (pitch, (5, 0, -1, -2, -3, -10, 8))):
        assert list(levels(picture)) == names
        assert tuple(levels(picture).values()) == pytest.approx(expected, abs=1e-4)
    shown = np.array(tuple(levels(heading).values()))
    assert shown % 360.0 == pytest.approx((320, 330, 330, 330, 330, 350, 340), abs=1e-3)
    assert np.ptp(shown) < 180.0  # in one range, whatever its end
    bands = {one.label: one for one in (*roll.traces, *heading.traces) if one.low is not None}
    assert list(bands) == ["h2nav"]
    for picture, width_deg in ((roll, 3.0), (heading, 6.0)):
        (ours,) = (one for one in picture.traces if one.label == "h2nav")
        assert np.nanmedian(ours.high - ours.values) == pytest.approx(width_deg, abs=1e-3)
        assert np.nanmedian(ours.values - ours.low) == pytest.approx(width_deg, abs=1e-3)
    dashed = [one.label for one in roll.traces if one.dash is Dash.DASHED]
    assert dashed == ["demand", "truth"]


def test_the_band_is_that_of_the_surest_and_only_where_it_tells_anything():
    smoothed = estimates(tilt_deg=0.5, heading_deg=31.0)
    flown = made(estimates=estimates(tilt_deg=29.0), smoothed=smoothed)
    roll, _, heading = attitude.attitude(flown).pictures
    bands = [one.label for one in roll.traces if one.low is not None]
    assert bands == ["h2nav, smoothed"]
    (late,) = (one for one in heading.traces if one.low is not None)
    assert np.isnan(late.low).all()  # 93 deg would hide the rest
    # A part of the flight leaves out what knows more than a flight could.
    columns = Columns(20.0, 50, 10.0)
    roll, _, _ = attitude.attitude_lines(flown, columns, (10.0, 30.0))
    assert list(levels(roll)) == ["h2nav"]
    assert roll.window_s == (10.0, 30.0)
    (ours,) = roll.traces
    assert np.nanmedian(ours.high) == pytest.approx(87.0, abs=1e-2)


@pytest.mark.parametrize("middle_deg", [5.0, 100.0, 185.0, 355.0])
def test_the_range_of_headings_begins_where_the_nose_points_least(middle_deg):
    heading = middle_deg + 60.0 * np.sin(T_S)
    track = AttitudeTrack("EKF3", T_S, attitudes(heading=heading))
    (picture,) = (
        one for one in attitude.attitude(made(of(attitudes=(track,)))).pictures
        if one.title == "Heading"
    )  # fmt: skip
    points = picture.traces[0].values
    known = points[np.isfinite(points)]
    assert np.ptp(known) == pytest.approx(120.0, abs=2.0)  # never cut
    assert len(known) > 390


@pytest.mark.parametrize(
    ("kind", "size_deg_s", "number", "lanes", "lost_s"),
    [
        (Kind.GYRO_BIAS, 5.1, 1, (), (20.0, 60.0)),
        (Kind.GYRO_BIAS, 4.9, 1, (), None),
        (Kind.GYRO_BIAS_STEP, 9.0, 1, (), None),
        (Kind.GYRO_BIAS, 5.1, 2, (), None),  # another IMU
        (Kind.GYRO_BIAS, 5.1, 2, ((0.0, 40.0, "IMU 1"), (40.0, 100.0, "IMU 2")), (40.0, 60.0)),
    ],
)
def test_what_a_gyro_turned_at_rest_is_not_drawn(kind, size_deg_s, number, lanes, lost_s):
    nothing = np.zeros((0, 3))
    imu = ImuTrack(0, "IMU", NOTHING, NOTHING.astype(int), nothing, nothing, nothing)
    flown = made(
        of(imus=(imu,)), estimates=estimates(), smoothed=estimates(),
        lanes=tuple(Span(*lane) for lane in lanes),
    )  # fmt: skip
    one = finding(kind, 20.0, 60.0, size=size_deg_s, number=number)
    kept = attitude.without_useless(flown, (one,))
    for ours in (kept.estimates, kept.smoothed):
        lost = np.isnan(ours.q_nb).all(axis=1)
        assert lost.any() == (lost_s is not None)
        if lost_s is not None:
            assert (T_S[lost][0], T_S[lost][-1]) == lost_s


@pytest.mark.parametrize(("to_s", "is_left"), [(89.5, True), (90.0, False)])
def test_an_attitude_that_was_useless_for_nearly_all_of_it_is_left_out(to_s, is_left):
    ratios = Ratios(T_S, ("velocity",), ONES[:, None])
    flown = made(
        estimates=estimates(), smoothed=estimates(), ratios=ratios,
        states=(Span(0.0, 9.0, "active"),), lanes=(Span(0.0, 100.0, "IMU 1"),),
        held=(Span(0.0, 9.0, "rest"),),
    )  # fmt: skip
    kept = attitude.without_useless(flown, (finding(Kind.GYRO_BIAS, 0.0, to_s, size=9.0),))
    rest = (kept.smoothed, kept.states, kept.lanes, kept.held, len(kept.ratios.t_s))
    if is_left:
        assert kept.estimates is not None
        assert rest[1:] == (flown.states, flown.lanes, flown.held, len(T_S))
    else:
        assert (kept.estimates, *rest) == (None, None, (), (), (), 0)
    assert attitude.without_useless(made(), ()).estimates is None


def test_differences_are_drawn_with_what_they_may_be():
    other = AttitudeTrack("EKF3", T_S, attitudes(roll=4.0, heading=357.0))
    truth = AttitudeTrack("truth", T_S, attitudes(pitch=1.0, heading=2.0))
    flown = made(of(attitudes=(other,), truth=truth), estimates=estimates())
    tilt, heading = attitude.difference(flown).pictures
    assert levels(tilt)["EKF3"] == pytest.approx(4.0, abs=1e-3)
    assert levels(tilt)["truth"] == pytest.approx(1.0, abs=1e-3)
    assert levels(heading)["EKF3"] == pytest.approx(-3.0, abs=1e-3)
    assert levels(heading)["truth"] == pytest.approx(2.0, abs=1e-3)
    assert [one.dash for one in tilt.traces] == [Dash.NONE, Dash.DASHED, Dash.DASHED]
    limits = levels(heading)
    assert limits["three deviations"] > 6.0
    assert limits["three deviations, below"] == -limits["three deviations"]
    assert levels(tilt)["three deviations"] > 3.0
    assert [one.sets_range for one in heading.traces] == [True, True, False, False]
    assert (tilt.at_least, heading.at_least) == ((0.0, 3.0), (-6.0, 6.0))
    assert attitude.difference(made(of(attitudes=(other,)))).pictures == ()


def test_our_deviations_and_tests_are_drawn():
    ratios = Ratios(T_S, ("velocity_n", "velocity_e", "turn"), np.outer(ONES, (0.2, 0.7, 0.4)))
    flown = made(
        estimates=estimates(), smoothed=estimates(tilt_deg=0.5, heading_deg=np.nan), ratios=ratios,
        states=(Span(0.0, 9.0, "active"), Span(9.0, 20.0, "degraded: tilt"), Span(20.0, 30.0, "x")),
        held=(Span(3.0, 4.0, "rest"), Span(5.0, 6.0, "wheels"), Span(7.0, 8.0, "rest")),
    )  # fmt: skip
    deviations, rows = attitude.certainty(flown).pictures
    assert levels(deviations) == pytest.approx(
        {"h2nav: tilt": 1.0, "h2nav: heading": 2.0, "smoothed: tilt": 0.5}
    )
    dashes = [one.dash for one in deviations.traces]
    assert dashes == [Dash.NONE, Dash.DASHED, Dash.NONE]
    shown = {row.label: row for row in rows.rows}
    assert list(shown) == [
        "h2nav", "held by rest", "held by wheels", "tested: attitude by GPS velocity",
        "tested: gyro by compass",
    ]  # fmt: skip
    assert shown["h2nav"].colours == (colours.GOOD, colours.BAD, colours.UNKNOWN)
    assert [span.from_s for span in shown["held by rest"].spans] == [3.0, 7.0]
    assert shown["tested: gyro by compass"].spans == (Span(0.0, 100.0, "tested"),)
    (picture,) = attitude.innovations(flown).pictures
    assert levels(picture) == pytest.approx(
        {"attitude by GPS velocity": 0.7, "gyro by compass": 0.4}
    )
    assert [one.colour for one in picture.traces] == [colours.NUMBERED[0], colours.NUMBERED[3]]
    assert picture.limits == (PictureMark(1.0, "1: test fails"),)
    assert attitude.innovations(made()).pictures == attitude.certainty(made()).pictures == ()


# --- sensors ----------------------------------------------------------------------------------


def bias(imu: int, gyro_limit: float = 3.0 * DEG, at_rest: int = 1) -> Bias:
    gyro_b = np.outer(ONES, (1.0, -2.0, 3.0)) * DEG
    return Bias(imu, T_S, gyro_b, gyro_limit, T_S[:at_rest], 9.7 * ONES[:at_rest])


def test_the_bias_of_the_first_imu_is_shown_at_once():
    found = sensors.bias(made(), Analysis(biases=(bias(0), bias(1, math.nan))))
    gyro, force = found.pictures
    assert gyro.title == "Gyro bias, IMU 1"
    assert levels(gyro) == pytest.approx({"roll axis": 1.0, "pitch axis": -2.0, "yaw axis": 3.0})
    assert [mark.value for mark in gyro.limits] == pytest.approx([3.0, -3.0])
    assert force.title == "Accelerometer at rest, IMU 1"
    assert levels(force) == pytest.approx({"norm of the force": 9.7})
    assert [mark.value for mark in force.limits] == [9.80665]
    titles = ["Gyro bias, IMU 2", "Accelerometer at rest, IMU 2"]
    assert [one.title for one in found.further] == titles
    assert found.further[0].limits == ()
    # Without a time at rest, too, the others wait.
    moved = sensors.bias(made(), Analysis(biases=(bias(0, at_rest=0), bias(1))))
    assert [one.title for one in moved.pictures] == ["Gyro bias, IMU 1"]
    assert [one.title for one in moved.further] == titles


def test_vibration_is_that_of_the_worst_axis():
    level = np.outer(ONES, (1.0, 5.0, 2.0))
    tracks = (Vibrations(0, T_S, level, 30.0, 0), Vibrations(2, T_S, 2.0 * level, 60.0, 0))
    flown = made(of(throttle=Series(T_S, 0.4 * ONES)))
    shaken, throttle = sensors.vibration(flown, Analysis(vibrations=tracks)).pictures
    assert levels(shaken) == {"IMU 1": 5.0, "IMU 3": 10.0}
    assert shaken.limits == (PictureMark(30.0, "limit 30 m/s²"),)
    assert [one.colour for one in shaken.traces] == [colours.NUMBERED[0], colours.NUMBERED[2]]
    assert levels(throttle) == pytest.approx({"throttle": 40.0})
    nothing = made(of(throttle=Series(NOTHING, NOTHING)))
    assert sensors.vibration(nothing, Analysis()).pictures == ()


def test_rates_and_gaps_of_what_has_times():
    first = TimingTrack(0, "IMU", T_S, 50.0 * ONES, 0.02 * ONES, np.nan * ONES)
    second = first._replace(imu=1, lateness_s=0.3 * ONES)
    untimed = TimingTrack(2, "IMU", NOTHING, NOTHING, NOTHING, NOTHING)
    shown = sensors.timing(made(), Analysis(timings=(first, second, untimed))).pictures
    assert [(one.title, one.unit, one.at_least) for one in shown] == [
        ("Samples per second", "Hz", (0.0, 1.0)), ("Longest gap", "ms", (0.0, 1.0)),
        ("Late samples", "ms", (0.0, 1.0)),
    ]  # fmt: skip
    rates, gaps, late = map(levels, shown)
    assert rates == {"IMU 1": 50.0, "IMU 2": 50.0}
    assert gaps == pytest.approx({"IMU 1": 20.0, "IMU 2": 20.0})
    assert late == pytest.approx({"IMU 2": 300.0})
    # Of an old log without times there is nothing to draw.
    assert sensors.timing(made(), Analysis(timings=(untimed,))).pictures == ()


def test_receivers_are_drawn_with_what_they_state():
    apart = np.outer(ONES, (0.3, 0.0, -0.4))
    first = Receiver(0, T_S, apart, 0.0 * ONES, 0.25 * ONES, 14.0 * ONES, 0.1)
    silent = first._replace(receiver=1, difference_n=np.nan * apart, sigma_m_s=np.nan * ONES)
    shown = sensors.receivers(made(), Analysis(receivers=(first, silent))).pictures
    assert [levels(one) for one in shown] == [
        pytest.approx({"GPS 1": 0.5}), {"GPS 1": 0.25}, {"GPS 1": 14.0, "GPS 2": 14.0},
    ]  # fmt: skip
    assert [one.digits for one in shown] == [2, 2, 0]
    assert [one.colour for one in shown[2].traces] == list(colours.NUMBERED[:2])


# --- spectra ----------------------------------------------------------------------------------


def test_shades_are_decibels_of_the_largest():
    found = shades(np.array([[1.0, 10.0**-1.25, 10.0**-2.5], [1e-4, 0.0, np.nan]], np.float32))
    assert found.dtype == np.uint8
    assert found[0] == pytest.approx([255, 127, 0], abs=1)
    assert not found[1].any()
    assert not shades(np.full((2, 3), np.nan, np.float32)).any()
    assert not shades(np.zeros((2, 3), np.float32)).any()
    # One blow in a thousand columns leaves the rest as dark as it was.
    levels_ = np.ones((2000, 1), np.float32)
    levels_[7] = 1e4
    assert shades(levels_)[8] > 250


def test_the_first_imus_spectra_are_shown_at_once():
    def spectrum(imu, sensor):
        hz = np.arange(1.0, 201.0)
        peaks = tuple(Peak(10.0 * n, 2.0, 1.0, 0) for n in range(1, 7))
        density = np.outer(np.ones(200), (1.0, 0.0, 3.0))
        flat = np.ones((5, 200), np.float32)
        return Spectrum(imu, sensor, "rad/s", 400.0, imu == 1, hz, density, peaks, T_S[:5], flat)

    of_first = (spectrum(1, "gyro"), spectrum(1, "accelerometer"))
    found = spectra(Analysis(spectra=(spectrum(2, "gyro"), *of_first)))
    assert [one.title for one in found.pictures] == [
        "Spectrogram: gyro of IMU 2", "Spectrogram: accelerometer of IMU 2",
        "Mean spectrum: gyro of IMU 2", "Mean spectrum: accelerometer of IMU 2",
    ]  # fmt: skip
    heat, _, mean, _ = found.pictures
    assert heat.to_hz == 200.0
    assert "bursts at the sensor's own rate, 400 per second; what is above 200 Hz" in heat.about
    assert mean.unit == "rad/s/√Hz"
    assert [mark.text for mark in mean.marks] == ["10 Hz", "20 Hz", "30 Hz", "40 Hz"]
    values = [one.values[0] for one in mean.traces]
    assert values == pytest.approx([1.0, 1e-9, 3.0])  # none is not on a logarithmic axis
    assert mean.is_logarithmic
    assert [one.title for one in found.further] == [
        "Spectrogram: gyro of IMU 3", "Mean spectrum: gyro of IMU 3",
    ]  # fmt: skip
    assert "samples as recorded" in found.further[0].about


# --- vehicle ----------------------------------------------------------------------------------


def test_heights_begin_together_and_no_demand_is_no_height():
    rising = Series(T_S, 0.1 * T_S)
    asked = Series(T_S, np.where(T_S < 60.0, 0.0, 5.0))
    baro = Series(T_S, 400.0 + 0.1 * T_S + np.where(T_S > 2.0, 3.0, 0.0))
    context = of(height_m=rising, height_demand_m=asked, baro_height_m=baro, climb_m_s=rising)
    met = (
        GroundContact(1.0, "take-off", math.nan),
        GroundContact(90.0, "landing", 1.25),
        GroundContact(95.0, "crash", math.nan),
    )
    height, climb = vehicle.height(made(context), met).pictures
    assert levels(height) == pytest.approx(
        {"height": 5.0, "barometer": 8.0, "demand": 5.0}, abs=0.1
    )
    (demand,) = (one for one in height.traces if one.label == "demand")
    assert demand.dash is Dash.DASHED
    assert np.count_nonzero(np.isfinite(demand.values)) < 0.42 * len(demand.values)
    assert levels(climb) == pytest.approx({"climb": 5.0}, abs=0.1)
    html = vehicle.height(made(context), met).html
    assert "<td>90.0</td><td>landing</td><td>1.2</td>" in html
    assert "<td>95.0</td><td>crash</td><td>–</td>" in html
    assert "take-off" not in html
    assert vehicle.height(made(), met[:1]).html == ""
    assert vehicle.height(made(), ()).pictures == ()


def test_motors_are_shares_of_their_range():
    pwm = np.outer(ONES, np.arange(1100.0, 1100.0 + 100.0 * 14, 100.0))
    motors = Motors(tuple(range(1, 15)), T_S, pwm, 1000.0, 2000.0)
    escs = tuple(Esc(n, T_S, 1000.0 * n * ONES, ONES, ONES) for n in range(1, 15))
    context = of(motors=motors, throttle=Series(T_S, 0.35 * ONES), escs=escs)
    share, speed = vehicle.motors(made(context)).pictures
    expected = {f"motor {n}": min(10.0 * n, 100.0) for n in range(1, 13)} | {"throttle": 35.0}
    assert levels(share) == pytest.approx(expected)
    assert [one.tag for one in share.traces] == [str(n) for n in range(1, 13)] + [""]
    assert share.traces[-1].dash is Dash.DASHED
    assert (share.traces[4].colour, share.traces[4].dash) == (colours.NUMBERED[0], Dash.DASHED)
    assert levels(speed) == {f"motor {n}": 1000.0 * n for n in range(1, 13)}
    (alone,) = vehicle.motors(made(of(throttle=context.throttle))).pictures
    assert alone.traces[0].dash is Dash.NONE
    assert vehicle.motors(made()).pictures == ()


@pytest.mark.parametrize(
    ("voltage_v", "current_a", "titles"),
    [
        (11.1, 7.0, ["Battery voltage", "Battery current"]),
        (1.0, 0.0, []),  # not measured
        (1.1, np.nan, ["Battery voltage"]),
        (np.nan, 0.1, ["Battery current"]),
    ],
)
def test_a_battery_is_drawn_where_it_was_measured(voltage_v, current_a, titles):
    one = Battery(1, T_S, voltage_v * ONES, current_a * ONES, ONES)
    shown = vehicle.battery(made(of(batteries=(one,)))).pictures
    assert [picture.title for picture in shown] == titles
    for picture in shown:
        size = voltage_v if picture.unit == "V" else current_a
        assert levels(picture) == pytest.approx({"battery 2": size})
    (board,) = vehicle.battery(made(of(board_v=Series(T_S, 5.1 * ONES)))).pictures
    assert (board.title, levels(board)) == (
        "Supply of the autopilot", pytest.approx({"supply": 5.1}),
    )  # fmt: skip


@pytest.mark.parametrize(("period_s", "has_gyro"), [(0.124, True), (0.126, False)])
def test_sticks_and_rates_with_their_demand(period_s, has_gyro):
    t_s = np.arange(0.0, 100.0, period_s)
    rates = np.outer(np.ones(len(t_s)), (10.0, -20.0, 30.0)) * DEG
    imu = ImuTrack(1, "IMU", t_s, t_s.astype(int), rates, rates, rates)
    context = of(
        imus=(imu,),
        demanded_rates=Series(T_S, np.outer(ONES, (1.0, 2.0, 3.0)) * DEG),
        sticks=Sticks(T_S, 0.1 * ONES, -0.2 * ONES, 0.3 * ONES, 0.4 * ONES),
    )
    sticks, *axes = control.control(made(context)).pictures
    assert levels(sticks) == pytest.approx(
        {"roll": 10.0, "pitch": -20.0, "yaw": 30.0, "throttle": 40.0}
    )
    assert sticks.traces[3].dash is Dash.DASHED
    assert [one.title for one in axes] == ["Roll rate", "Pitch rate", "Yaw rate"]
    gyro = ({"gyro 2": 10.0}, {"gyro 2": -20.0}, {"gyro 2": 30.0}) if has_gyro else ({},) * 3
    for number, picture in enumerate(axes):
        assert levels(picture) == pytest.approx({**gyro[number], "demand": number + 1.0}, rel=1e-5)
    assert control.control(made(of(imus=(imu,)))).pictures == ()


# --- time line and events ---------------------------------------------------------------------


def test_the_time_line_has_what_the_autopilot_said():
    context = of(
        modes=(Span(0.0, 50.0, "LOITER"), Span(50.0, 80.0, "RTL"), Span(80.0, 100.0, "LOITER")),
        armed=(Span(5.0, 95.0, "armed"),),
        airborne=Series(np.array((10.0, 20.0, 30.0, 90.0)), np.array((1.0, 1.0, 0.0, 1.0))),
        faults=(
            ReportedFault(30.0, "radio_in", 2, "lost"), ReportedFault(35.0, "radio_in", 3, "bad"),
            ReportedFault(40.0, "radio_in", 0, "fine"), ReportedFault(60.0, "gps", 1, "glitch"),
            ReportedFault(70.0, "ekf", 0, "fine"),
        ),
        said=(Said(1.0, Severity.ERROR, "bad"), Said(2.0, Severity.WARNING, "hm"),
              Said(3.0, Severity.NOTICE, "hello")),
        occurrences=(Occurrence(4.0, 10, "armed"),),
        changes=(ChangedSetting(6.0, "P", 0.0, 0.123456789),),
        primary=(Span(0.0, 100.0, "EKF3 core 0"),),
    )  # fmt: skip
    findings = (finding(Kind.GPS_LOST, 10.0, 20.0, Severity.ERROR, text="lost"),)
    (picture,) = timeline.timeline(made(context), findings).pictures
    rows = {row.label: row for row in picture.rows}
    assert list(rows) == [
        "findings", "flight mode", "armed", "in the air (autopilot)",
        "autopilot reports: radio in", "autopilot reports: gps", "autopilot says", "events",
        "parameters changed", "autopilot's estimator",
    ]  # fmt: skip
    first, second = colours.BARS[:2]
    assert rows["flight mode"].colours == (first, second, first)
    spans = {label: [(span.from_s, span.to_s) for span in row.spans] for label, row in rows.items()}
    assert spans["in the air (autopilot)"] == [(10.0, 30.0), (90.0, 100.0)]
    assert spans["autopilot reports: radio in"] == [(30.0, 35.0), (35.0, 40.0)]
    assert spans["autopilot reports: gps"] == [(60.0, 100.0)]
    assert spans["autopilot says"] == [(1.0, 1.0), (2.0, 2.0)]
    assert rows["autopilot says"].colours == (colours.BAD, colours.DOUBTFUL)
    assert rows["parameters changed"].spans == (Span(6.0, 6.0, "P 0.123457"),)
    assert rows["findings"].colours == (colours.BAD,)
    assert timeline.timeline(made(), ()).pictures == ()
    pale = timeline.mode_backdrop(made(context))
    assert [one[2] for one in pale] == ["LOITER", "RTL", "LOITER"]
    assert [one[3] for one in pale] == [colours.MODES[0], colours.MODES[1], colours.MODES[0]]


def test_findings_that_overlap_have_rows_of_their_own():
    spans = (
        (0.0, 50.0), (60.0, 70.0), (50.0, 55.0), (40.0, 60.0), (45.0, 48.0), (46.0, 47.0),
        (46.5, 46.8), (20.0, 30.0),
    )  # fmt: skip
    findings = tuple(finding(Kind.GPS_LOST, *ends, Severity.NOTICE) for ends in spans)
    (picture,) = timeline.timeline(made(), findings).pictures
    rows = [[(span.from_s, span.to_s) for span in row.spans] for row in picture.rows]
    assert rows == [
        [(0.0, 50.0), (60.0, 70.0)], [(20.0, 30.0), (45.0, 48.0), (50.0, 55.0)],
        [(40.0, 60.0)], [(46.0, 47.0)],
    ]  # fmt: skip
    assert [row.label for row in picture.rows] == ["findings", "", "", ""]
    assert picture.rows[0].colours == (colours.BARS[0],) * 2


def test_moments_are_marked_in_order_and_no_more_than_a_dozen_of_each():
    crash = finding(Kind.CRASH, 50.0)
    slight = finding(Kind.HARD_LANDING, 10.0, severity=Severity.NOTICE)
    other = finding(Kind.GPS_LOST, 5.0)
    faults = (ReportedFault(20.0, "gps", 1, "glitch"), ReportedFault(30.0, "gps", 0, "fine"))
    found = timeline.marks(made(of(faults=faults)), (crash, slight, other))
    assert found == [(20.0, "glitch", colours.REPORTED), (50.0, "impact", colours.IMPACT)]
    many = made(of(faults=faults[:1] * 20))
    assert len(timeline.marks(many, (crash,) * 20)) == 24


@pytest.mark.parametrize(
    ("at_s", "windows_s", "title"),
    [
        ((50.0,), [(35.0, 55.0)], "Impact at 50.0 s"),
        ((40.0, 55.0), [(36.25, 60.0)], "Impact at 40.0 s, impact at 55.0 s"),
        ((40.0, 55.1), [(25.0, 45.0), (40.1, 60.1)], "Impact at 40.0 s"),
        ((3.0,), [(0.0, 8.0)], "Impact at 3.0 s"),
        ((98.0,), [(83.0, 100.0)], "Impact at 98.0 s"),
        ((1.0, 17.0, 33.0, 49.0, 65.0), [(0, 6), (2, 22), (18, 38), (34, 54)], "Impact at 1.0 s"),
    ],
)
def test_an_event_is_shown_from_before_it_until_after(at_s, windows_s, title):
    context = of(
        sticks=Sticks(T_S, ONES, ONES, ONES, ONES),
        modes=(Span(0.0, 34.0, "A"), Span(50.1, 60, "B")),
    )
    findings = tuple(finding(Kind.CRASH, one) for one in reversed(at_s))
    quiet = (finding(Kind.CRASH, 70.0, severity=Severity.NOTICE), finding(Kind.GPS_LOST, 80.0))
    found = event.event(made(context, estimates=estimates()), (*findings, *quiet))
    stacks = (found.pictures[0], *found.further)
    assert found.title == title
    assert [one.lanes[0].window_s for one in stacks] == windows_s
    assert len(found.pictures) == 1
    if len(stacks) > 1:
        assert found.further_title.startswith(f"later: impact at {at_s[1]:.1f} s")
    rows = [lane for lane in stacks[0].lanes if lane.title == ""]
    begins_or_ends = windows_s[0][0] < 34.0 < windows_s[0][1] or (
        windows_s[0][0] < 50.1 < windows_s[0][1]
    )
    assert bool(rows) == begins_or_ends


def test_an_event_behind_the_end_has_a_second_of_its_own():
    context = of(sticks=Sticks(T_S, ONES, ONES, ONES, ONES))._replace(duration_s=50.0)
    for at_s, window_s in ((60.0, (45.0, 50.0)), (70.0, (55.0, 56.0))):
        (stack,) = event.event(made(context), (finding(Kind.CRASH, at_s),)).pictures
        assert stack.lanes[0].window_s == window_s


def test_without_an_event_nothing_is_shown():
    found = event.event(made(), ())
    assert (found.title, found.pictures, found.further) == ("", (), ())

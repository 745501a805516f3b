import pytest

from h2nav.attitude.samples import ImuSample
from h2nav.service.units_check import REST_SAMPLES, UnitsCheck


def report_for(force=9.80665, field_ut=50.0, rate=0.0):
    check = UnitsCheck()
    for i in range(REST_SAMPLES):
        field = (field_ut, 0.0, 0.0) if field_ut else None
        check.add(ImuSample(i * 10_000, (rate, 0.0, 0.0), (0.0, 0.0, -force), field))
    return check


def test_earth_is_fine():
    assert report_for().is_over


def test_no_magnetometer_is_no_complaint():
    assert report_for(field_ut=0.0).complaints == ()


@pytest.mark.parametrize(
    ("force", "cause"), [(1.0, "in g"), (9806.65, "thousandths"), (96.2, "in m/s2 as if in g")]
)
def test_a_wrong_force_names_its_likely_cause(force, cause):
    report = report_for(force=force)
    assert not report.is_over
    assert cause in report.complaints[0].text


@pytest.mark.parametrize(("field_ut", "cause"), [(0.5, "gauss"), (5e7, "10^6")])
def test_a_wrong_field_names_its_likely_cause(field_ut, cause):
    assert cause in report_for(field_ut=field_ut).complaints[0].text


def test_a_moving_vehicle_is_not_judged():
    report = report_for(force=15.0, rate=1.0)
    assert not report.is_over
    assert not report.complaints


def test_what_was_wrong_for_a_while_is_not_held_against_the_sensor():
    check = UnitsCheck()
    forces = [98.0665] * REST_SAMPLES + [9.80665] * REST_SAMPLES
    complaints = []
    for i, force in enumerate(forces):
        if check.add(ImuSample(i * 10_000, (0.0, 0.0, 0.0), (0.0, 0.0, -force))):
            complaints.append(check.complaints)
    assert [bool(found) for found in complaints] == [True, False]
    assert check.is_over


@pytest.mark.parametrize(
    ("how", "quantities"),
    [
        ({"force": 0.901 * 9.80665}, []),
        ({"force": 0.899 * 9.80665}, ["acc"]),
        ({"force": 1.099 * 9.80665}, []),
        ({"force": 1.101 * 9.80665}, ["acc"]),
        ({"field_ut": 20.0}, []),
        ({"field_ut": 19.9}, ["mag"]),
        ({"field_ut": 70.0}, []),
        ({"field_ut": 70.1}, ["mag"]),
        ({"force": 1.0, "field_ut": 0.5}, ["acc", "mag"]),
    ],
)
def test_what_the_earth_cannot_be_is_complained_of(how, quantities):
    report = report_for(**how)
    assert [complaint.quantity for complaint in report.complaints] == quantities
    assert report.is_over is not bool(quantities)


@pytest.mark.parametrize(
    ("how", "text"),
    [
        ({"force": 9.80665e-3}, "|acc| at rest 0.00981 m/s2, not 9.8: sent in units of 1/1000"),
        ({"force": 9806.65},
         "|acc| at rest 9.81e+03 m/s2, not 9.8: sent as thousandths of the unit"),
        ({"force": 1.0}, "|acc| at rest 1 m/s2, not 9.8: sent in g as if in m/s2"),
        ({"force": 96.2}, "|acc| at rest 96.2 m/s2, not 9.8: sent in m/s2 as if in g"),
        ({"force": 15.0}, "|acc| at rest 15 m/s2, not 9.8"),
        ({"field_ut": 0.45}, "|mag| at rest 0.45 uT, not 20-70: sent in gauss as if in uT"),
        ({"field_ut": 4.5e7}, "|mag| at rest 4.5e+07 uT, not 20-70: sent 10^6 too large"),
        ({"field_ut": 200.0}, "|mag| at rest 200 uT, not 20-70"),
        # half as much again is still the slip, more is another thing
        ({"field_ut": 0.7}, "|mag| at rest 0.7 uT, not 20-70: sent in gauss as if in uT"),
        ({"field_ut": 0.73}, "|mag| at rest 0.73 uT, not 20-70"),
    ],
)  # fmt: skip
def test_a_complaint_has_the_figure_what_is_right_and_the_slip(how, text):
    assert [complaint.text for complaint in report_for(**how).complaints] == [text]


@pytest.mark.parametrize(("rate", "is_over"), [(0.05, True), (0.0501, False)])
def test_slow_turns_are_rest(rate, is_over):
    assert report_for(rate=rate).is_over is is_over


def test_fifty_samples_are_a_window_and_a_sensor_without_a_force_none():
    check = UnitsCheck()
    rest = ImuSample(0, (0.0, 0.0, 0.0), (0.0, 0.0, -9.80665))
    nothing = rest._replace(f_b=(0.0, 0.0, 0.0))
    assert not any(check.add(nothing) for _ in range(200))
    assert [check.add(rest) for _ in range(50)] == [False] * 49 + [True]
    assert not check.add(rest)  # it is over

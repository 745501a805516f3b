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

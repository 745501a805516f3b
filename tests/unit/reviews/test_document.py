"""The figures of the review's document, against what its records say, in the units of its keys."""

import math

import numpy as np
import pytest
from needs import DEG

from h2nav.airframes.features import FlightRow
from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import AttitudeTrack, Context, Said, Span
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.document import document
from h2nav.reviews.flight import EarthFields, Estimates, Flight, Ratios
from h2nav.reviews.tracks import (
    Bias,
    CompassFit,
    Peak,
    Receiver,
    Spectrum,
    TimingTrack,
    Vibrations,
)

NOTHING = np.zeros(0)
# Its 95th percentile is 9.5, its median 5, the largest 10.
T_S = np.arange(0.0, 10.1, 0.1)
RISING = 0.1 * np.arange(101.0)
ONES = np.ones(101)
LEVEL = np.tile((1.0, 0.0, 0.0, 0.0), (101, 1))


def told(analysis: Analysis | None = None, **changes: object):
    flight = Flight(
        "made", "made.bin", "dataflash", "", Context(duration_s=10.0), None, None, "", "IMU",
        Ratios(NOTHING, (), np.zeros((0, 0))), EarthFields(NOTHING, NOTHING, NOTHING, NOTHING),
        (), (), (), (), {},
    )._replace(**changes)  # fmt: skip
    return document(flight, analysis or Analysis())


def ours(tilt_deg, heading_deg=ONES) -> Estimates:
    return Estimates(T_S, LEVEL, np.zeros((101, 3)), tilt_deg * DEG, heading_deg * DEG)


@pytest.mark.parametrize(
    ("start_unix_s", "text"),
    [
        (None, None),
        (0.0, "1970-01-01T00:00:00Z"),
        (1_700_000_000.9, "2023-11-14T22:13:20Z"),
        (1e18, None),
        (math.nan, None),
    ],
)
def test_a_date_that_is_none_is_unknown(start_unix_s, text):
    assert told(context=Context(start_unix_s=start_unix_s))["start_utc"] == text


@pytest.mark.parametrize(
    ("armed", "median", "largest", "last"),
    [
        ((), 5.0, 10.0, 10.0),
        ((Span(2.0, 4.0, ""), Span(6.0, 8.0, "")), 5.0, 8.0, 8.0),
        ((Span(20.0, 30.0, ""),), None, None, 10.0),
    ],
)
def test_our_deviation_is_that_while_armed(armed, median, largest, last):
    certainty = told(estimates=ours(RISING, 2.0 * ONES), context=Context(armed=armed))["certainty"]
    expected = {"median_deg": median, "largest_deg": largest, "last_deg": last}
    assert certainty["h2nav"]["tilt"] == pytest.approx(expected, abs=0.051)
    assert certainty["h2nav"]["heading"]["last_deg"] == 2.0
    assert certainty["smoothed"] is None


def test_tests_and_states_have_their_shares():
    ratios = Ratios(np.arange(0.0, 5.0), ("force",), np.ones((5, 1)))
    states = (Span(0.0, 2.0, "active"), Span(2.0, 5.0, "degraded"), Span(5.0, 9.5, "active"))
    found = told(ratios=ratios, states=states)
    tested = found["certainty"]["tested"]
    assert tested["attitude by gravity"]["share_percent"] == 40.0
    assert tested["compass by attitude"] == {"share_percent": 0.0, "spans": []}
    assert found["certainty"]["states_s"] == {"active": 6.5, "degraded": 3.0}
    assert found["checked"] == [{"what": "our attitude against gravity", "for_s": 4.0}]
    unknown = told(ratios=ratios, context=Context())["certainty"]["tested"]
    assert unknown["attitude by gravity"]["share_percent"] is None


def test_differences_are_in_degrees_with_the_share_beyond_their_limit():
    turned = np.column_stack((np.cos(RISING * DEG), *np.zeros((2, 101)), -np.sin(RISING * DEG)))
    context = Context(
        duration_s=10.0,
        attitudes=(AttitudeTrack("EKF3", T_S, turned),),
        truth=AttitudeTrack("truth", T_S, turned),
    )
    other, truth = told(estimates=ours(ONES, ONES), context=context)["differences"]
    assert (other["name"], other["is_truth"], truth["is_truth"]) == ("EKF3", False, True)
    expected = {"median_deg": 10.0, "p95_deg": 19.0, "largest_deg": 20.0}  # twice the half angle
    for one in (other, truth):
        heading = {key: one["heading"][key] for key in expected}
        assert heading == pytest.approx(expected, abs=1e-4)
        assert one["tilt"]["largest_deg"] == pytest.approx(0.0, abs=1e-4)
        assert one["tilt"]["beyond_limit_percent"] == 0.0
    # Beyond three of our degrees, of 20 that are passed evenly; with the other's more, later.
    assert truth["heading"]["beyond_limit_percent"] == pytest.approx(85.0, abs=1.1)
    assert other["heading"]["beyond_limit_percent"] < 84.0
    checked = [one["what"] for one in told(estimates=ours(ONES), context=context)["checked"]]
    assert checked == ["attitude of EKF3 against ours"]


def test_the_figures_of_sensors():
    axes = np.column_stack((RISING, -RISING, 0.0 * RISING))
    peak = Peak(80.0, 5.0, 0.123456789, 1)
    fit = CompassFit(
        1, np.array([np.pi]), ONES[:1], 2.0 * ONES[:1], np.array([-3.0 * DEG]), np.full(3, np.nan),
        1.1, np.array([0.25]), ONES[:1], np.zeros(3),
    )  # fmt: skip
    receiver = Receiver(0, T_S, axes, RISING, 0.1 * RISING, 4.0 + RISING, math.nan)
    spectrum = Spectrum(
        1, "gyro", "rad/s", 400.0, True, NOTHING, axes[:0], (peak,), NOTHING, axes[:0]
    )
    analysis = Analysis(
        timings=(TimingTrack(0, "RAW_IMU", T_S, RISING, 0.1 * RISING, np.nan * ONES),),
        vibrations=(Vibrations(0, T_S, axes, 30.0, 7), Vibrations(2, T_S, axes, 60.0, 8)),
        biases=(Bias(1, T_S, axes * DEG, 2.0 * DEG, T_S, RISING),),
        spectra=(spectrum,),
        compasses=(fit,),
        receivers=(receiver,),
        row=FlightRow("", "", math.nan, {}),
    )
    found = told(analysis)
    first, second, third = found["imus"]
    assert first == {
        "imu": 1, "message": "RAW_IMU", "rate_hz": 5.0, "longest_gap_s": 1.0, "latest_s": None,
        "vibration_largest_m_s2": 10.0, "vibration_limit_m_s2": 30.0, "clipped_samples": 7,
    }  # fmt: skip
    assert second == {
        "imu": 2, "gyro_bias_median_deg_s": [5.0, -5.0, 0.0],
        "gyro_bias_largest_deg_s": 14.1421, "gyro_bias_limit_deg_s": 2.0,
        "force_at_rest_m_s2": 5.0,
    }  # fmt: skip
    assert (third["imu"], third["clipped_samples"]) == (3, 8)
    (shown,) = found["spectra"]
    assert (shown["imu"], shown["peaks"][0]["rms"]) == (2, 0.123457)  # six digits
    (compass,) = found["compasses"]
    assert {key: compass[key] for key in ("compass", "heading_deg", "heading_error_deg")} == {
        "compass": 2, "heading_deg": [180.0], "heading_error_deg": [-3.0],
    }  # fmt: skip
    assert (compass["throttle_percent"], compass["offset_b_ut"]) == ([25.0], [None] * 3)
    assert found["receivers"] == [
        {
            "receiver": 1, "velocity_difference_median_m_s": 7.07107,
            "velocity_difference_largest_m_s": 14.1421, "position_difference_largest_m": 10.0,
            "accuracy_median_m_s": 0.5, "fewest_satellites": 4.0, "lag_s": None,
        }
    ]  # fmt: skip
    assert [one["what"] for one in found["checked"]] == [
        "vibration and clipping of the accelerometers", "vibration by frequency",
        "gyro and accelerometer bias", "rates and gaps of the samples",
        "calibration of the compasses", "GPS against inertial motion",
    ]  # fmt: skip


def test_findings_have_their_meaning_and_texts_are_bounded():
    one = Finding(
        Kind.IMU_GAPS, Sensor(SensorKind.IMU, 1), Severity.WARNING, 1.0, 2.0, 0.5, "s", "a gap",
        "x", "gap.1",
    )  # fmt: skip
    said = tuple(Said(float(n), Severity.INFO, f"text {n}") for n in range(501))
    notices = tuple((float(n), "info", "hm") for n in range(501))
    found = told(
        findings=(one,), notices=notices, rejected={"crc": 3},
        context=Context(said=said, notes={"damaged": 2}, parameters={"B": 0.1 + 0.2, "A": 1.0}),
    )  # fmt: skip
    (shown,) = found["findings"]
    assert (shown["consequence_of"], shown["means"]) == (None, "Samples are missing.")
    assert (len(found["said"]), len(found["notices"])) == (500, 500)
    assert found["said"][-1] == {"t_s": 499.0, "severity": "info", "text": "text 499"}
    assert (found["rejected"], found["damaged"]) == ({"crc": 3}, {"damaged": 2})
    assert list(found["parameters"]) == ["A", "B"]
    assert (found["format"], found["imu_message"], found["why_no_estimate"]) == (1, "IMU", None)

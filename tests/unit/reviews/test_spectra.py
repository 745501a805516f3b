"""Lines of known frequency in bursts and streams, and the level that ArduPilot calls VIBE."""

import numpy as np
import pytest
from known_evidence import imu_track
from reviewed_flights import DURATION_S, flight, with_imu

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import Burst, Span, VibrationTrack
from h2nav.reviews.analysis import analyse
from h2nav.reviews.spectra import detect_vibration, vibe

RATE_HZ = 2000.0
LENGTH = 1024


def bursts(lines: dict[float, float], sensor: str = "gyro") -> tuple[Burst, ...]:
    """Bursts every 2 s of lines (Hz -> rms) in the noise of the data sheet."""
    random = np.random.default_rng(3)
    found = []
    for number in range(40):
        t_s = number * 2.0 + 20.0
        t = t_s + np.arange(LENGTH) / RATE_HZ
        values = random.normal(0.0, 1.7e-4 * np.sqrt(RATE_HZ / 2.0), (LENGTH, 3))
        for hz, rms in lines.items():
            values[:, 0] += np.sqrt(2.0) * rms * np.sin(2.0 * np.pi * hz * t)
        found.append(Burst(0, sensor, t_s, RATE_HZ, values))
    return tuple(found)


def test_a_motors_line_and_its_harmonics_are_found_with_the_notch():
    analysis = analyse(flight(bursts=bursts({82.0: 0.3, 164.0: 0.15, 246.0: 0.1})))
    spectrum = next(s for s in analysis.spectra if s.is_burst)
    lines = {p.harmonic: p for p in spectrum.peaks if p.harmonic}
    assert sorted(lines) == [1, 2, 3]
    for harmonic, rms in ((1, 0.3), (2, 0.15), (3, 0.1)):
        assert lines[harmonic].frequency_hz == pytest.approx(82.0 * harmonic, abs=1.0)
        assert lines[harmonic].rms == pytest.approx(rms, rel=0.1)
    (finding,) = analysis.findings
    assert finding.kind == "vibration_line"
    assert finding.severity is Severity.INFO
    assert finding.size == pytest.approx(0.3, rel=0.1)
    assert "INS_HNTCH_FREQ 82, INS_HNTCH_BW 41, INS_HNTCH_HMNCS 7" in finding.evidence
    assert "IMU_GYRO_NF0_FRQ 82" in finding.evidence
    assert "IMU_GYRO_NF1_FRQ 164" in finding.evidence


def test_noise_alone_is_no_line():
    analysis = analyse(flight(bursts=bursts({})))
    assert not analysis.findings


def test_a_line_that_a_stream_cannot_show_is_told_as_an_alias_and_without_a_notch():
    flown = flight()
    first = flown.context.imus[0]
    # 130 Hz in samples of 100 Hz shows at 30 Hz.
    shaken = 0.2 * np.sin(2.0 * np.pi * 130.0 * first.t_s)[:, None] * np.array([1.0, 0.0, 0.0])
    (finding,) = analyse(with_imu(flown, w_b=first.w_b + shaken)).findings
    assert finding.kind == "vibration_line"
    assert "30 Hz or an alias" in finding.text
    assert "no notch can be advised" in finding.evidence


def test_the_level_is_that_of_ardupilots_filters():
    random = np.random.default_rng(5)
    f_b = random.normal(0.0, 3.0, (1000, 3)) + np.array([0.0, 0.0, -9.8])
    rate = 200.0

    def share(cutoff):
        step = 2.0 * np.pi * cutoff / rate
        return step / (step + 1.0)

    floor, level = f_b[0].copy(), np.zeros(3)
    for number, force in enumerate(f_b):
        floor = floor + share(5.0) * (force - floor)
        square = (force - floor) ** 2
        level = square if number == 0 else level + share(2.0) * (square - level)
    np.testing.assert_allclose(vibe(f_b, rate)[-1], np.sqrt(level), rtol=1e-9)


def test_strong_vibration_is_told_once():
    flown = flight()
    first = flown.context.imus[0]
    shaken = 60.0 * np.sin(2.0 * np.pi * 37.0 * first.t_s) * (np.abs(first.t_s - 60.0) < 10.0)
    flown = with_imu(flown, f_b=first.f_b + shaken[:, None] * np.array([0.0, 0.0, 1.0]))
    told = {f.kind: f for f in analyse(flown).findings}
    assert told["vibration_level"].size == pytest.approx(60.0 / np.sqrt(2.0), rel=0.2)
    assert told["vibration_level"].from_s == pytest.approx(50.0, abs=1.0)
    assert told["vibration_level"].to_s == pytest.approx(70.0, abs=1.0)
    in_flight = Finding(
        Kind.VIBRATION,
        Sensor(SensorKind.IMU, 1),
        Severity.WARNING,
        50.0,
        70.0,
        40.0,
        "m/s2",
        "",
        "",
    )
    again = analyse(flown._replace(findings=(in_flight,))).findings
    assert "vibration_level" not in {f.kind for f in again}


@pytest.mark.parametrize("pause_s", [0.0, 200.0])
def test_what_was_not_logged_makes_no_samples_seldom(pause_s):
    t_s = np.arange(0.0, 20.0, 0.01)
    f_b = 40.0 * np.random.default_rng(1).normal(0.0, 1.0, (len(t_s), 3))
    f_b[(t_s < 5.0) | (t_s > 8.0)] *= 0.02
    track = imu_track(np.where(t_s > 15.0, t_s + pause_s, t_s), f_b=f_b)
    (found,) = detect_vibration(track, (Span(0.0, 300.0, ""),), is_reported=False)[1]
    assert "for 3 s, by ArduPilot's VIBE of samples at 100 Hz" in found.evidence


@pytest.mark.parametrize(
    ("level_m_s2", "lasts_s", "autopilot", "is_told"),
    [
        (31.0, 11.0, "ArduPilot", True),
        (29.0, 11.0, "ArduPilot", False),
        (31.0, 9.0, "ArduPilot", False),  # a landing
        (31.0, 11.0, "PX4", False),  # its metric
    ],
)
def test_where_samples_are_too_seldom_the_autopilots_own_level_tells(
    level_m_s2, lasts_s, autopilot, is_told
):
    flown = flight()._replace(autopilot=f"{autopilot} quadrotor 1/1")
    t_s = np.arange(0.0, 100.0, 0.2)
    level = np.full((len(t_s), 3), 2.0)
    level[(t_s > 40.0) & (t_s < 40.0 + lasts_s), -1] = level_m_s2
    measured = (VibrationTrack(0, t_s, level, 0.0 * t_s),)
    seldom = flown.context.imus[0]
    rows = slice(None, None, round(0.1 / float(np.median(np.diff(seldom.t_s)))))
    seldom = seldom._replace(**{
        name: getattr(seldom, name)[rows] for name in ("t_s", "stamp_us", "w_b", "f_b", "m_b_ut")
    })  # fmt: skip
    for imu, is_seldom in ((seldom, True), (flown.context.imus[0], False)):
        context = flown.context._replace(imus=(imu,), vibrations=measured)
        found = analyse(flown._replace(context=context))
        told = [one for one in found.findings if one.kind is Kind.VIBRATION_LEVEL]
        assert len(told) == (is_told and is_seldom)
        assert ("vibration" in found.looked_at) == (autopilot != "PX4" or not is_seldom)
        for one in told:
            assert one.from_s == pytest.approx(40.2, abs=0.01)
            assert one.to_s == pytest.approx(50.8, abs=0.01)
            assert one.text == "vibration up to 31 m/s^2"


def test_clipped_samples_are_counted_in_flight():
    flown = flight()
    first = flown.context.imus[0]
    f_b = first.f_b.copy()
    f_b[5000:5150, 2] = -160.0
    found = {f.kind: f for f in analyse(with_imu(flown, f_b=f_b)).findings}
    assert found["clipped_samples"].size == 150.0


def test_pictures_are_bounded():
    flown = flight(imus=2)
    analysis = analyse(flown)
    assert len(analysis.spectra) == 4
    for spectrum in analysis.spectra:
        assert len(spectrum.frequency_hz) <= 256
        assert len(spectrum.t_s) <= 300
        assert (np.diff(spectrum.t_s) > 0.0).all()
        assert 0.0 <= spectrum.t_s[0] < spectrum.t_s[-1] <= DURATION_S
        assert spectrum.levels.shape == (len(spectrum.t_s), len(spectrum.frequency_hz))
        assert spectrum.density.shape == (len(spectrum.frequency_hz), 3)
    assert all(len(v.t_s) <= 2000 for v in analysis.vibrations)
    ends = [(track.t_s[0], track.t_s[-1]) for track in flown.context.imus]
    assert [(v.t_s[0], v.t_s[-1]) for v in analysis.vibrations] == ends

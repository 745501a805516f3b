"""Lines of known frequency in bursts and streams, and the level that ArduPilot calls VIBE."""

import numpy as np
import pytest
from known_evidence import imu_track
from reviewed_flights import DURATION_S, flight, with_imu

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.context import Burst, ImuTrack, Span, VibrationTrack
from h2nav.reviews.analysis import analyse
from h2nav.reviews.spectra import detect_measured, detect_spectra, detect_vibration, family_of, vibe
from h2nav.reviews.tracks import Peak, Spectrum

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


# --- densities and lines of made streams ----------------------------------------------------------

STREAM_HZ = 400.0
ARMED = (Span(0.0, 100.0, "armed"),)


def stream(values, rate_hz=STREAM_HZ, sensor="gyro", imu=0):
    """An IMU whose named sensor reads these values on its first axis, and nothing on the others."""
    values = np.asarray(values, dtype=float)
    t_s = np.arange(len(values)) / rate_hz
    of_axes = {name: np.zeros((len(values), 3)) for name in ("gyro", "accelerometer")}
    of_axes[sensor] = np.outer(values, (1.0, 0.0, 0.0)) if values.ndim == 1 else values
    stamps = np.round(t_s * 1e6).astype(np.int64)
    gyro, force = of_axes["gyro"], of_axes["accelerometer"]
    return ImuTrack(imu, "IMU", t_s, stamps, gyro, force, np.full(force.shape, np.nan))


def tone(hz, rms, count=2048, rate_hz=STREAM_HZ):
    return np.sqrt(2.0) * rms * np.sin(2.0 * np.pi * hz * np.arange(count) / rate_hz + 0.3)


def noise(density, count=2048, rate_hz=STREAM_HZ, seed=7):
    return np.random.default_rng(seed).normal(0.0, density * np.sqrt(rate_hz / 2.0), count)


def of(tracks, armed=ARMED, own=()):
    """The spectra by their sensor, and what is found."""
    shown, found = detect_spectra(tuple(tracks), own, armed)
    return {(one.imu, one.sensor): one for one in shown}, found


def test_a_density_is_that_of_the_noise_whatever_slow_motion_it_rides_on():
    t_s = np.arange(20_000) / STREAM_HZ
    values = noise(0.02, 20_000) + 5.0 + 3.0 * t_s
    spectrum = of([stream(values)])[0][0, "gyro"]
    assert spectrum.frequency_hz[0] == pytest.approx(STREAM_HZ / 512)
    assert spectrum.frequency_hz[-1] == pytest.approx(STREAM_HZ / 2.0)
    assert (spectrum.rate_hz, spectrum.unit) == (pytest.approx(STREAM_HZ), "rad/s")
    # All of it, the lowest bins too: mean and slope were taken off.
    assert spectrum.density[1:-1, 0] == pytest.approx(np.full(254, 0.02), rel=0.35)
    assert np.sqrt((spectrum.density[1:-1, 0] ** 2).mean()) == pytest.approx(0.02, rel=0.03)
    assert spectrum.density[:, 1:].max() == 0.0
    assert spectrum.levels.shape == (len(spectrum.t_s), 256)
    assert np.sqrt((spectrum.levels**2).mean(axis=0)) == pytest.approx(
        spectrum.density[:, 0], rel=0.05
    )


@pytest.mark.parametrize(
    ("sensor", "rms", "is_told"),
    [
        ("gyro", 0.0165, True), ("gyro", 0.0155, False),
        ("accelerometer", 3.1, True), ("accelerometer", 2.9, False),
    ],
)  # fmt: skip
def test_how_strong_a_line_has_to_be(sensor, rms, is_told):
    track = stream(tone(75.0, rms) + noise(rms / 300.0), sensor=sensor, imu=1)
    shown, found = of([track])
    (peak,) = (one for one in shown[1, sensor].peaks if one.rms > 0.1 * rms)
    assert peak.rms == pytest.approx(rms, rel=0.02)
    assert peak.frequency_hz == pytest.approx(75.0, abs=0.1)
    assert [one.kind for one in found] == ["vibration_line"] * is_told
    assert of([track], armed=())[1] == []  # whether its motors turned is not known
    if is_told:
        (one,) = found
        assert (one.source, one.unit, one.severity) == (
            "IMU 2", shown[1, sensor].unit, Severity.INFO,
        )  # fmt: skip
        assert one.text == f"{sensor} vibrates at 75 Hz or an alias of it"
        assert one.evidence.startswith(f"lines at 75 Hz ({one.size:.2g} {one.unit} rms)")
        assert (
            "samples at 400 Hz show nothing above 200 Hz, and a line f above it as |f - n 400|"
            in (one.evidence)
        )
        assert ("INS_HNTCH_FREQ 75" in one.evidence) == (sensor == "gyro")
        assert (one.from_s, one.to_s) == (
            shown[1, sensor].t_s[0], shown[1, sensor].t_s[-1],
        )  # fmt: skip


@pytest.mark.parametrize(("hz", "is_line"), [(7.0, False), (9.0, True), (195.0, True)])
def test_slow_lines_are_the_flight(hz, is_line):
    peaks = of([stream(tone(hz, 0.1) + noise(1e-4))])[0][0, "gyro"].peaks
    assert any(one.rms > 0.05 for one in peaks) == is_line


@pytest.mark.parametrize(
    ("count", "armed", "is_shown"),
    [
        (512 + 3 * 256, ARMED, True),
        (512 + 3 * 256 - 1, ARMED, False),  # four windows
        (2048, (Span(1.2, 4.5, "armed"),), True),
        (2048, (Span(1.3, 4.5, "armed"),), False),
        (2048, (Span(1.2, 4.4, "armed"),), False),
        (2048, (), True),
    ],
)
def test_four_windows_show_a_spectrum(count, armed, is_shown):
    assert bool(of([stream(tone(75.0, 1.0, count))], armed)[0]) == is_shown


@pytest.mark.parametrize(("late_s", "is_shown"), [(0.024, True), (0.028, False)])
def test_windows_with_a_gap_show_nothing(late_s, is_shown):
    track = stream(tone(75.0, 1.0, 1400))  # windows of 1.28 s
    shifted = track.stamp_us + np.where(np.arange(1400) >= 600, round(late_s * 1e6), 0)
    assert bool(of([track._replace(stamp_us=shifted)])[0]) == is_shown
    assert not of([track._replace(stamp_us=0 * shifted)])[0]


def test_bursts_replace_a_stream_where_there_are_enough():
    def burst(t_s, hz=75.0, rate_hz=1000.0, count=512):
        values = np.outer(tone(hz, 1.0, count, rate_hz), (1.0, 0.0, 0.0))
        return Burst(0, "gyro", t_s, rate_hz, values)

    track = stream(tone(30.0, 1.0))
    for others, is_burst in (
        ((burst(4.0),), True),
        ((), False),
        ((burst(4.0, rate_hz=1049.0),), True),
        ((burst(4.0, rate_hz=1051.0),), False),  # of another rate
        ((burst(4.0, count=63),), False),
        ((burst(101.0),), False),  # not armed
        ((burst(4.0)._replace(imu=1),), False),
        ((burst(4.0)._replace(sensor="accelerometer"),), False),
    ):
        own = (burst(1.0), burst(2.0), burst(3.0), *others)
        spectrum = of([track], own=own)[0][0, "gyro"]
        assert spectrum.is_burst == is_burst
        strongest = spectrum.peaks[0].frequency_hz
        assert strongest == pytest.approx(75.0 if is_burst else 30.0, abs=1.0)
    # Longer ones have several windows each, at the middles of these.
    long = tuple(burst(float(t_s), count=1024) for t_s in (4, 3, 2, 1))
    spectrum = of([], own=long)[0][0, "gyro"]
    expected = [t_s + 0.256 * (n + 1) for t_s in (1, 2, 3, 4) for n in range(3)]
    assert spectrum.t_s == pytest.approx(expected)
    (one,) = of([], own=long)[1]
    assert one.text == "gyro vibrates at 75 Hz"
    assert "from bursts at 1000 Hz" in one.evidence


def made(peaks, rate_hz=1000.0):
    nothing = np.zeros(0)
    return Spectrum(0, "gyro", "rad/s", rate_hz, True, nothing, np.zeros((0, 3)),
                    tuple(peaks), nothing, np.zeros((0, 0), np.float32))  # fmt: skip


@pytest.mark.parametrize(
    ("peaks", "rate_hz", "expected"),
    [
        ([Peak(80.0, 5.0, 0.017, 0)], 1000.0, (80.0, 1, 1)),
        ([Peak(80.0, 5.0, 0.015, 0)], 1000.0, None),
        ([Peak(80.0, 5.0, 0.017, 0)], 391.0, (80.0, 1, 1)),
        ([Peak(80.0, 5.0, 0.017, 0)], 389.0, None),  # such a stream shows aliases
        ([Peak(449.0, 5.0, 0.1, 0)], 1000.0, (449.0, 1, 1)),
        ([Peak(451.0, 5.0, 0.1, 0)], 1000.0, None),
        # Harmonics, of which the fundamental may be the weaker one, or missing.
        ([Peak(160.0, 5.0, 0.1, 2), Peak(80.0, 5.0, 0.01, 1)], 1000.0, (80.0, 0b11, 2)),
        ([Peak(160.0, 5.0, 0.1, 2), Peak(320.0, 5.0, 0.1, 4)], 1000.0, (80.0, 0b1010, 2)),
        # A stronger line of no family.
        (
            [Peak(130.0, 5.0, 0.2, 0), Peak(80.0, 5.0, 0.1, 1), Peak(160.0, 5.0, 0.1, 2)],
            1000.0,
            (130.0, 1, 1),
        ),
    ],
)
def test_the_family_of_lines_for_a_notch(peaks, rate_hz, expected):
    found = family_of(made(peaks, rate_hz))
    if expected is None:
        assert found is None
        return
    assert (found.base_hz, found.mask, len(found.lines)) == expected


def test_harmonics_are_numbered_by_what_explains_most():
    values = tone(40.0, 0.1) + tone(80.5, 0.1) + tone(160.0, 0.1) + tone(110.0, 0.15)
    spectrum = of([stream(values + noise(1e-4))])[0][0, "gyro"]
    found = {round(one.frequency_hz): one.harmonic for one in spectrum.peaks if one.rms > 0.05}
    assert found in ({40: 1, 80: 2, 160: 4, 110: 0}, {40: 1, 81: 2, 160: 4, 110: 0})
    assert [round(one.rms, 2) for one in spectrum.peaks[:2]] == [0.15, 0.1]
    # The fifth is none that a notch has, nor what is farther than a bin and a half away.
    values = tone(35.0, 0.1) + tone(175.0, 0.1) + tone(72.6, 0.1)
    spectrum = of([stream(values + noise(1e-4))])[0][0, "gyro"]
    assert {one.harmonic for one in spectrum.peaks if one.rms > 0.05} == {0}


def test_a_notch_has_the_frequencies_of_the_lines():
    (one,) = of([stream(tone(80.0, 0.1) + noise(1e-5))])[1]
    assert one.evidence.endswith(
        "ArduPilot: INS_HNTCH_ENABLE 1, INS_HNTCH_FREQ 80, INS_HNTCH_BW 40, INS_HNTCH_HMNCS 1; "
        "PX4: IMU_GYRO_NF0_FRQ 80, IMU_GYRO_NF0_BW 20"
    )
    (two,) = of([stream(tone(60.0, 0.2) + tone(120.0, 0.1) + noise(1e-5))])[1]
    assert "Hz (0.1 rad/s rms, harmonic 2)" in two.evidence
    assert two.evidence.endswith(
        "INS_HNTCH_FREQ 60, INS_HNTCH_BW 30, INS_HNTCH_HMNCS 3; PX4: IMU_GYRO_NF0_FRQ 60, "
        "IMU_GYRO_NF0_BW 20, IMU_GYRO_NF1_FRQ 120, IMU_GYRO_NF1_BW 20"
    )
    (slow,) = of([stream(tone(60.0, 0.2, rate_hz=380.0), rate_hz=380.0)])[1]
    assert slow.evidence.endswith("no notch can be advised: record bursts (INS_LOG_BAT_MASK) or "
                                  "the raw gyro")  # fmt: skip
    (near,) = of([stream(tone(185.0, 0.2))])[1]
    assert near.evidence.endswith("the line is too near half the rate for a notch to be advised")


# --- level and clipped samples --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("count", "size_g", "is_told"), [(101, 15.51, True), (100, 15.51, False), (200, 15.49, False)]
)
def test_more_than_a_hundred_clipped_samples_are_no_landing(count, size_g, is_told):
    values = np.zeros((2000, 3))
    values[400 : 400 + count, 1] = -size_g * GRAVITY_M_S2
    track = stream(values, sensor="accelerometer", imu=2)
    shown, found = detect_vibration(track, (Span(0.5, 4.5, "armed"),), is_reported=True)
    assert shown.clipped == (count if size_g > 15.5 else 0)
    assert (shown.imu, shown.limit) == (2, 30.0)
    assert [one.kind for one in found] == ["clipped_samples"] * is_told
    if is_told:
        (one,) = found
        assert one.text == "101 samples of the accelerometer clipped"
        assert one.evidence == "beyond 15.5 g while armed; a few may be the landing"
        assert (one.size, one.from_s, one.to_s) == (101.0, track.t_s[400], track.t_s[500])
    assert detect_vibration(track, (Span(1.1, 4.5, "armed"),), is_reported=True)[1] == []


@pytest.mark.parametrize(
    ("lasts_s", "level", "is_told"), [(1.1, 40.0, True), (0.8, 40.0, False), (4.0, 28.0, False)]
)
def test_a_level_that_lasts_a_second(lasts_s, level, is_told):
    # At 200 Hz of 400 the filters pass all of it.
    values = np.zeros((2400, 3))
    shaken = slice(400, 400 + round(lasts_s * STREAM_HZ))
    values[shaken, 2] = level * np.where(np.arange(2400)[shaken] % 2, 1.0, -1.0)
    track = stream(values, sensor="accelerometer")
    shown, found = detect_vibration(track, ARMED, is_reported=False)
    assert [one.kind for one in found] == ["vibration_level"] * is_told
    assert shown.level.max(axis=0) == pytest.approx((0.0, 0.0, level), rel=0.05)
    if is_told:
        (one,) = found
        assert one.text == f"vibration up to {one.size:.0f} m/s^2"
        assert one.evidence == (
            "above 30 m/s^2 for 1 s, by ArduPilot's VIBE of samples at 400 Hz; 60 is nearly always "
            "trouble"
        )
        assert 1.0 < one.from_s < 1.2
        assert 2.1 <= one.to_s < 2.2
        assert detect_vibration(track, (), is_reported=False)[1] == []
        assert detect_vibration(track, ARMED, is_reported=True)[1] == []


def test_the_measured_level_counts_for_ten_seconds():
    for rows, level, is_told in ((101, 31.0, True), (99, 31.0, False), (150, 29.9, False)):
        t_s = 0.1 * np.arange(300)
        levels = np.full((300, 3), np.nan)
        levels[:, 1] = 5.0
        levels[50 : 50 + rows, 1] = level
        levels[10] = np.nan  # of a row without a level
        found = detect_measured(VibrationTrack(1, t_s, levels, 0.0 * t_s), ARMED)
        assert len(found) == is_told
        if is_told:
            (one,) = found
            assert (one.source, one.size) == ("IMU 2", 31.0)
            assert (one.from_s, one.to_s) == pytest.approx((5.0, 15.0))
            assert one.evidence.startswith("above 30 m/s^2 for 10 s, as the autopilot measured it")
            assert detect_measured(VibrationTrack(1, t_s[:1], levels[:1], t_s[:1]), ARMED) == []

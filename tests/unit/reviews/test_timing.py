"""Samples that are missing, twice, late, or stamped by a clock that drifts."""

import numpy as np
import pytest
from reviewed_flights import flight, with_imu

from h2nav.integrity.findings import Finding, Severity
from h2nav.recordings.context import AttitudeTrack, Context, GpsTrack, ImuTrack, Motors, Span
from h2nav.reviews.analysis import analyse
from h2nav.reviews.flight import Flight
from h2nav.reviews.timing import detect_pauses, detect_slow_log, detect_timing, pauses, stamps_s


def kept(track: ImuTrack, rows: np.ndarray) -> dict[str, np.ndarray]:
    names = ("t_s", "stamp_us", "w_b", "f_b", "m_b_ut")
    return {name: getattr(track, name)[rows] for name in names}


def only(flown: Flight) -> Finding:
    (finding,) = analyse(flown).findings
    return finding


def test_missing_samples_are_counted_and_measured():
    flown = flight()
    first = flown.context.imus[0]
    rows = (first.t_s < 50.0) | (first.t_s >= 50.4)
    rows &= (first.t_s < 70.0) | (first.t_s >= 70.2)
    finding = only(with_imu(flown, **kept(first, rows)))
    assert finding.kind == "imu_gaps"
    assert finding.size == pytest.approx(0.41, abs=0.02)
    assert finding.from_s == pytest.approx(50.0, abs=0.05)
    assert "2 gaps" in finding.text
    assert finding.severity is Severity.NOTICE


def test_a_second_without_samples_is_a_warning():
    flown = flight()
    first = flown.context.imus[0]
    finding = only(with_imu(flown, **kept(first, (first.t_s < 50.0) | (first.t_s > 51.2))))
    assert (finding.kind, finding.severity) == ("imu_gaps", Severity.WARNING)


def test_a_log_that_pauses_blames_no_sensor():
    flown = flight()._replace(kind="dataflash")
    context = flown.context

    def rest(t_s: np.ndarray) -> np.ndarray:
        return (t_s < 40.0) | (t_s > 60.0)

    paused = with_imu(flown, **kept(context.imus[0], rest(context.imus[0].t_s)))
    attitudes = tuple(
        track._replace(t_s=track.t_s[rest(track.t_s)], q_nb=track.q_nb[rest(track.t_s)])
        for track in context.attitudes
    )
    gps = tuple(track.part(rest(track.t_s)) for track in context.gps)
    found = paused._replace(context=paused.context._replace(attitudes=attitudes, gps=gps))
    finding = only(found)
    assert (finding.kind, finding.severity) == ("log_paused", Severity.INFO)
    assert finding.size == pytest.approx(20.0, abs=0.1)
    # What a ground station does not get was lost on its link.
    assert "imu_gaps" in {f.kind for f in analyse(found._replace(kind="tlog")).findings}


def test_samples_that_come_twice_are_told():
    flown = flight()
    first = flown.context.imus[0]
    rows = np.sort(np.concatenate((np.arange(len(first.t_s)), np.arange(0, len(first.t_s), 10))))
    finding = only(with_imu(flown, **kept(first, rows)))
    assert finding.kind == "imu_twice"
    assert finding.size == pytest.approx(9.1, abs=0.2)


@pytest.mark.parametrize("jump_s", [3.0, -0.6])
def test_a_clock_that_is_set_loses_no_samples(jump_s):
    flown = flight()
    first = flown.context.imus[0]
    stamps = first.stamp_us + np.where(first.t_s >= 50.0, round(jump_s * 1e6), 0)
    finding = only(with_imu(flown, stamp_us=stamps))
    assert (finding.kind, finding.severity) == ("clock_jump", Severity.WARNING)
    assert f"jumped by {jump_s:+.2f} s" in finding.text
    assert finding.from_s == pytest.approx(50.0, abs=0.05)


def test_a_link_that_held_samples_back_set_no_clock():
    flown = flight()
    first = flown.context.imus[0]
    held = (first.t_s > 50.0) & (first.t_s < 51.0)
    arrived = np.where(held, 51.0, first.t_s)
    # Some of them it lost.
    rows = ~((first.t_s > 50.3) & (first.t_s < 50.8))
    changed = {**kept(first, rows), "t_s": arrived[rows]}
    kinds = {f.kind for f in analyse(with_imu(flown, **changed)).findings}
    assert kinds == {"imu_gaps", "late_bursts"}


def test_a_stamp_clock_that_drifts_is_measured():
    flown = flight()
    first = flown.context.imus[0]
    stamps = np.round(first.stamp_us * (1.0 + 600e-6)).astype(np.int64)
    finding = only(with_imu(flown, stamp_us=stamps))
    assert finding.kind == "clock_drift"
    assert finding.size == pytest.approx(600.0, abs=5.0)
    assert "fast" in finding.text


def test_two_good_clocks_with_jitter_are_not_complained_of():
    flown = flight()
    first = flown.context.imus[0]
    late = np.random.default_rng(4).exponential(0.004, len(first.t_s))
    t_s = np.maximum.accumulate(first.t_s + late)
    stamps = np.round(first.stamp_us * (1.0 - 40e-6)).astype(np.int64)
    assert not analyse(with_imu(flown, t_s=t_s, stamp_us=stamps)).findings


def test_bursts_that_a_link_held_back_are_told_and_are_no_gaps():
    flown = flight()
    first = flown.context.imus[0]
    t_s = first.t_s.copy()
    for begin in (30.0, 60.0, 90.0):
        held = (t_s > begin) & (t_s < begin + 0.5)
        t_s[held] = begin + 0.5
    finding = only(with_imu(flown, t_s=t_s))
    assert finding.kind == "late_bursts"
    assert finding.size == pytest.approx(0.49, abs=0.02)
    assert "3 bursts" in finding.evidence


def test_slow_recordings_say_so():
    flown = flight()
    first = flown.context.imus[0]
    seldom = with_imu(flown, **kept(first, np.arange(0, len(first.t_s), 10)))
    kinds = {f.kind for f in analyse(seldom._replace(kind="tlog")).findings}
    assert "imu_slow" in kinds
    assert "imu_too_slow" not in kinds


def test_an_autopilots_own_log_that_aliases_names_the_setting():
    flown = flight(parameters={"LOG_BITMASK": 176126.0})
    first = flown.context.imus[0]
    seldom = with_imu(flown, **kept(first, np.arange(0, len(first.t_s), 4)))
    (found,) = [f for f in analyse(seldom).findings if f.kind == "imu_too_slow"]
    assert found.size == pytest.approx(25.0, abs=0.5)
    assert "LOG_BITMASK 700414 (now 176126)" in found.evidence


def test_the_picture_shows_rate_and_gap():
    flown = flight()
    first = flown.context.imus[0]
    rows = (first.t_s < 50.0) | (first.t_s >= 52.0)
    timing = analyse(with_imu(flown, **kept(first, rows))).timings[0]
    assert len(timing.t_s) <= 1000
    assert np.median(timing.rate_hz) == pytest.approx(100.0, abs=3.0)
    assert np.nanmax(timing.longest_s) == pytest.approx(2.01, abs=0.02)
    assert np.isnan(timing.longest_s[(timing.t_s > 50.6) & (timing.t_s < 51.4)]).all()
    assert np.isnan(timing.lateness_s).all()


# --- each bound, on tracks of one clock or two -------------------------------------------------

ARMED = (Span(0.0, 1e6, "armed"),)


def made(t_s, stamp_us=None, imu=0, *, is_timed=True) -> ImuTrack:
    """Samples that say nothing but their times; the stamps are those of arrival unless given."""
    t_s = np.asarray(t_s, dtype=float)
    stamps = np.round(t_s * 1e6) if stamp_us is None else np.asarray(stamp_us)
    nothing = np.zeros((len(t_s), 3))
    return ImuTrack(
        imu, "RAW_IMU", t_s, stamps.astype(np.int64), nothing, nothing, nothing, is_timed=is_timed
    )


def steps(period_s: float, count: int, gaps: dict[int, float] | None = None) -> np.ndarray:
    """Times from 0 on; `gaps` are steps of another length, by their place."""
    lengths = np.full(count - 1, period_s)
    for place, length in (gaps or {}).items():
        lengths[place] = length
    return np.concatenate(([0.0], np.cumsum(lengths)))


def gaps_in(track: ImuTrack, armed=ARMED, paused=()) -> list[Finding]:
    return [f for f in detect_timing(track, armed, paused)[1] if f.kind == "imu_gaps"]


@pytest.mark.parametrize(
    ("step_us", "expected_s"),
    [
        (-1_000_000, -1.0),  # set back, by no more than an autopilot may correct it
        (-1_000_001, 0.01),  # it restarted
        (60_010_000, 60.01),
        (60_010_002, 0.01),  # another clock
    ],
)
def test_a_clock_that_starts_anew_goes_on(step_us, expected_s):
    stamps = np.cumsum([5_000_000, 10_000, step_us, 10_000])
    found = stamps_s(made([3.0, 3.01, 3.02, 3.03], stamps))
    assert found == pytest.approx([0.0, 0.01, 0.01 + expected_s, 0.02 + expected_s], abs=1e-9)


def test_nothing_is_logged_in_a_pause():
    def paused(imu_s, attitude_s=(), gps_s=()):
        context = Context(
            imus=(made(imu_s), made([])),
            attitudes=(AttitudeTrack("EKF3", np.array(attitude_s), np.zeros((0, 4))),),
            gps=(GpsTrack(0, np.array(gps_s), *[np.zeros(0)] * 7),),
        )
        return pauses(context)

    assert paused([0.0, 1.0, 2.0]) == ()  # seldom, and no pause
    assert paused([0.0, 1.01, 2.0]) == (Span(0.0, 1.01, "paused"),)
    assert paused([0.0, 3.0], [1.0, 1.5], [2.0]) == ()
    assert paused([0.0, 3.0], [1.0], [2.5]) == (Span(1.0, 2.5, "paused"),)
    assert paused([4.0, 5.0], [0.0, 9.0], [1.0]) == ()  # before and after the IMU's samples
    assert pauses(Context()) == pauses(Context(imus=(made([]),))) == ()


def test_pauses_are_told_once():
    spans = tuple(Span(10.0 * i, 10.0 * i + 2.25, "paused") for i in range(1, 6))
    (one,) = detect_pauses(spans[:1])
    assert one.text == "logging paused once, for 2 s in all"
    assert one.evidence == "no message of any kind from 10.0 to 12.2 s"
    assert (one.from_s, one.to_s, one.size, one.unit) == (10.0, 12.25, 2.25, "s")
    (four,) = detect_pauses(spans[:4])
    assert four.evidence.endswith("; 40.0 to 42.2 s")
    (five,) = detect_pauses(spans)
    assert five.text == "logging paused 5 times, for 11 s in all"
    assert five.evidence.endswith("; 40.0 to 42.2 s ...")
    assert (five.from_s, five.to_s, five.size) == (10.0, 52.25, 11.25)
    assert detect_pauses(()) == []


@pytest.mark.parametrize(
    ("period_s", "gaps_s", "expected"),
    [
        (0.01, (0.09,), None),
        (0.01, (0.11,), Severity.NOTICE),  # longer than an estimator predicts over
        (0.01, (0.09,) * 2, None),  # 16 of 2016 missing
        (0.01, (0.09,) * 3, Severity.NOTICE),  # 24 of 2024
        (0.01, (0.048,) * 10, None),  # shorter than anything suffers from
        (0.01, (0.06,) * 10, Severity.NOTICE),
        (0.05, (0.14,), None),  # of slow samples one or two may be late
        (0.05, (0.16,), Severity.NOTICE),
        (0.01, (0.99,), Severity.NOTICE),
        (0.01, (1.01,), Severity.WARNING),  # filters begin anew
    ],
)
def test_what_is_a_gap(period_s, gaps_s, expected):
    places = {200 + 100 * number: gap for number, gap in enumerate(gaps_s)}
    found = gaps_in(made(steps(period_s, 2000, places)))
    assert [one.severity for one in found] == ([expected] if expected else [])
    assert gaps_in(made(steps(period_s, 2000, places)), armed=()) == []


def test_gaps_are_counted_while_the_motors_could_turn():
    t_s = steps(0.01, 1000, {299: 0.31, 599: 0.21, 799: 0.51})
    (found,) = gaps_in(made(t_s, imu=1), (Span(0.0, 8.0, "armed"),))
    assert (found.source, found.unit) == ("IMU 2", "s")
    assert found.text == "2 gaps in the samples, the longest 0.31 s"
    # 30 and 20 in a time in which 751 came
    assert found.evidence == (
        "the autopilot's stamps jump: 50 samples (6.2%) are missing in RAW_IMU; "
        "usual is one every 10.0 ms"
    )
    assert (found.from_s, found.to_s) == pytest.approx((t_s[299], t_s[600]))
    assert found.size == pytest.approx(0.31)
    (one,) = gaps_in(made(t_s), ARMED, (Span(2.99, 3.30, "paused"), Span(6.3, 6.5, "paused")))
    assert one.text == "a gap of 0.51 s in the samples"
    assert "50 samples" in one.evidence


@pytest.mark.parametrize("change", ["few", "untimed"])
def test_without_times_nothing_is_said(change):
    t_s = steps(0.1, 99 if change == "few" else 200, {50: 3.0})
    timing, found = detect_timing(made(t_s, imu=2, is_timed=change == "few"), ARMED)
    assert (timing.imu, timing.source, len(timing.t_s), found) == (2, "RAW_IMU", 0, [])
    assert len(timing.rate_hz) == len(timing.longest_s) == len(timing.lateness_s) == 0
    assert detect_timing(made(steps(0.1, 100, {50: 3.0})), ARMED)[1]


@pytest.mark.parametrize(("rate_hz", "is_slow"), [(24.8, True), (25.1, False)])
def test_too_few_samples_a_second(rate_hz, is_slow):
    t_s = steps(1.0 / rate_hz, 200, {100: 5.0})
    paused = (Span(float(t_s[100]), float(t_s[101]), "paused"),)
    found = detect_timing(made(t_s), ARMED, paused)[1]
    assert [f.kind for f in found] == ["imu_slow"] * is_slow
    if is_slow:
        assert found[0].text == "only 25 samples a second were recorded"
        assert found[0].evidence == "200 of RAW_IMU in 8 s"
        assert (found[0].unit, found[0].size) == ("Hz", pytest.approx(24.8))
        assert (found[0].from_s, found[0].to_s) == (0.0, t_s[-1])


@pytest.mark.parametrize(
    ("count", "step_us", "is_told"), [(9, 0, False), (10, 0, True), (10, 1, False)]
)
def test_samples_that_come_twice_have_the_stamp_of_the_one_before(count, step_us, is_told):
    advance = np.full(999, 10_000)
    advance[100 : 100 + 20 * count : 20] = step_us
    stamps = np.concatenate(([0], np.cumsum(advance)))
    found = detect_timing(made(stamps * 1e-6, stamps), ARMED)[1]
    assert [f.kind for f in found] == ["imu_twice"] * is_told
    if is_told:
        assert found[0].text == "1% of the samples came twice"
        assert (found[0].size, found[0].unit) == (pytest.approx(100.0 * 10 / 999), "%")
        assert (found[0].from_s, found[0].severity) == (0.0, Severity.NOTICE)


@pytest.mark.parametrize(
    ("ppm", "duration_s", "expected"),
    [
        (190.0, 80.0, None),
        (210.0, 80.0, (Severity.NOTICE, "fast")),
        (-210.0, 80.0, (Severity.NOTICE, "slow")),
        (-4900.0, 80.0, (Severity.NOTICE, "slow")),
        (5100.0, 80.0, (Severity.INFO, "fast")),
        (210.0, 61.0, (Severity.NOTICE, "fast")),
        (210.0, 59.0, None),
    ],
)
def test_how_far_two_clocks_may_drift_apart(ppm, duration_s, expected):
    t_s = 5.0 + np.arange(0.0, duration_s, 0.02)
    found = detect_timing(made(t_s, np.round(t_s * (1e6 + ppm))), ARMED)[1]
    assert [f.kind for f in found] == ["clock_drift"] * (expected is not None)
    if expected is not None:
        assert (found[0].severity, found[0].unit) == (expected[0], "ppm")
        assert found[0].text == f"the autopilot's clock runs {abs(ppm):.0f} ppm {expected[1]}"
        assert found[0].size == pytest.approx(abs(ppm), rel=1e-3)
        assert (found[0].from_s, found[0].to_s) == (t_s[0], t_s[-1])
        simulated = "simulation that did not keep to real time" in found[0].evidence
        assert simulated == (expected[0] is Severity.INFO)
        assert f"over {t_s[-1] - t_s[0]:.0f} s, by the quickest" in found[0].evidence


@pytest.mark.parametrize(
    ("late_s", "held", "count", "text"),
    [
        (0.195, 3, 1000, None),
        (0.206, 3, 1000, "samples up to 0.21 s late on the link"),
        (0.5, 1, 1001, None),  # one of 1,001 is bad luck
        (0.5, 1, 999, "samples up to 0.50 s late on the link"),
    ],
)
def test_what_is_late_on_a_link(late_s, held, count, text):
    sent_s = 0.6 * np.arange(count)
    # Seen from the quickest arrivals; two bursts, where there is more than one sample.
    places = [300, 500, 501][:held]
    t_s = sent_s + 0.03
    t_s[places] += late_s
    timing, found = detect_timing(made(t_s, np.round(sent_s * 1e6)), ARMED)
    late = [f for f in found if f.kind == "late_bursts"]
    assert [f.text for f in late] == ([text] if text else [])
    assert np.nanmax(timing.lateness_s) == pytest.approx(late_s)
    assert np.nanmin(timing.lateness_s) == pytest.approx(0.0, abs=1e-9)
    if text:
        bursts = "in 2 bursts" if held > 1 else "in 1 burst"
        assert late[0].evidence.endswith(bursts)
        assert late[0].evidence.startswith("0.3% of" if held > 1 else "0.1% of")
        assert "more than 200 ms later" in late[0].evidence
        assert (late[0].from_s, late[0].to_s) == (t_s[places[0]], t_s[places[-1]])
        assert (late[0].size, late[0].unit) == (pytest.approx(late_s), "s")


def test_arrivals_of_a_simulation_say_nothing_of_a_link():
    t_s = 0.02 * np.arange(4000)
    arrived = t_s + np.where((t_s > 30.0) & (t_s < 31.0), 0.4, 0.0)
    arrived = np.maximum.accumulate(arrived)
    for ppm, kinds in ((4900.0, {"clock_drift", "late_bursts"}), (5100.0, {"clock_drift"})):
        found = detect_timing(made(arrived, np.round(t_s * (1e6 + ppm))), ARMED)[1]
        assert {f.kind for f in found} == kinds


@pytest.mark.parametrize(
    ("period_s", "jumps_s", "text"),
    [
        (0.01, (0.19,), None),
        (0.01, (0.21,), "jumped by +0.21 s"),
        (0.01, (-0.21,), "jumped by -0.21 s"),
        (0.08, (0.235,), None),  # three periods of slow samples
        (0.08, (0.246,), "jumped by +0.25 s"),
        (0.01, (0.3, -0.5, 0.4), "jumped by -0.50 s, 3 times"),
    ],
)
def test_what_sets_a_clock(period_s, jumps_s, text):
    t_s = steps(period_s, 2000)
    stamps = t_s.copy()
    for number, jump in enumerate(jumps_s):
        stamps[300 + 400 * number :] += jump
    found = detect_timing(made(t_s, np.round(stamps * 1e6)), ())[1]
    told = [f for f in found if f.kind == "clock_jump"]
    assert [f.text for f in told] == ([f"the autopilot's clock {text}"] if text else [])
    if text:
        last = 300 + 400 * (len(jumps_s) - 1)
        assert (told[0].from_s, told[0].to_s) == (t_s[299], t_s[last])
        assert told[0].size == pytest.approx(max(map(abs, jumps_s)))
        largest = 300 + 400 * int(np.argmax(np.abs(jumps_s)))
        assert f"at {t_s[largest]:.1f} s, while" in told[0].evidence
        assert not {"imu_gaps", "imu_twice"} & {f.kind for f in found}


@pytest.mark.parametrize(("duration_s", "count"), [(0.4, 1), (10.0, 20), (600.0, 1000)])
def test_a_picture_of_half_seconds_while_they_are_few(duration_s, count):
    t_s = 2.0 + np.linspace(0.0, duration_s, 6001)
    timing, _ = detect_timing(made(t_s), ())
    assert len(timing.t_s) == count
    width_s = duration_s / count
    assert timing.t_s == pytest.approx(2.0 + width_s * (np.arange(count) + 0.5))
    assert timing.rate_hz == pytest.approx(6000.0 / duration_s, rel=0.2)
    assert timing.rate_hz.mean() == pytest.approx(6000.0 / duration_s, rel=1e-3)
    assert timing.longest_s == pytest.approx(duration_s / 6000.0, abs=3e-6)


@pytest.mark.parametrize(
    ("period_us", "count", "is_told"),
    [(22_222, 300, False), (22_223, 300, True), (22_223, 100, True), (22_223, 99, False)],
)
def test_a_log_that_is_too_slow_for_an_attitude(period_us, count, is_told):
    stamps = period_us * np.arange(count)
    found = detect_slow_log(made(stamps * 1e-6, stamps, imu=1), Context())
    assert len(found) == is_told
    if is_told:
        (one,) = found
        assert one.text == "logged 45 times a second: too seldom for an attitude of our own"
        assert one.evidence.endswith("set SDLOG_PROFILE with high rates (bit 2)")
        assert (one.source, one.size, one.unit) == ("IMU 2", pytest.approx(1e6 / period_us), "Hz")
        assert (one.from_s, one.to_s) == (0.0, stamps[-1] * 1e-6)
    assert detect_slow_log(made([]), Context()) == []


@pytest.mark.parametrize(("is_copter", "mask"), [(True, 1 + (1 << 18)), (False, 1 + (1 << 19))])
def test_the_bit_of_the_log_is_that_of_the_vehicle(is_copter, mask):
    motors = Motors((1,), np.zeros(1), np.zeros((1, 1)), 1000.0, 2000.0) if is_copter else None
    context = Context(parameters={"LOG_BITMASK": 1.0}, motors=motors)
    (found,) = detect_slow_log(made(steps(0.1, 200)), context)
    assert found.evidence.endswith(f"set LOG_BITMASK {mask} (now 1)")

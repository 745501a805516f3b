"""Logs of autopilots: what becomes of them as context, as events, and through the service."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_logs import (
    GPS_WEEK,
    GPS_WEEK_MS,
    PARAMETERS,
    START_US,
    DataflashWriter,
    MadeFlight,
    ULogWriter,
    dataflash,
    made_flight,
    ulog,
)
from needs import DEG, shared_data

from fuzz.worn_logs import text_of
from h2nav.apps.playback import Playback, PlaybackOptions, inputs_for, pipeline_for
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.maths import quaternion
from h2nav.recordings.autopilot_log import AutopilotLog
from h2nav.recordings.context import AttitudeTrack
from h2nav.recordings.dataflash import open_dataflash
from h2nav.recordings.imu_series import THINNED_HZ
from h2nav.recordings.ulog import open_ulog
from h2nav.service.records import EstimateRecord, estimate_record
from h2nav.sim.imu_model import GyroSampling
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.deframer import Frame
from h2nav.wire.imu import MAX_IMUS, ImuReading
from h2nav.wire.position import GpsFix
from h2nav.wire.vehicle import Heartbeat, LandedState, ParameterValue, StatusText, SystemTime

SETTLED_S = 12.0


@pytest.fixture(scope="module")
def flown() -> MadeFlight:
    """As ArduPilot's filtered gyros show it."""
    return made_flight()


@pytest.fixture(scope="module")
def integrated() -> MadeFlight:
    """As PX4's integrals show it."""
    return made_flight(rate_hz=200.0, rates_s=0.0, field_s=0.0, sampling=GyroSampling.MEAN)


def opened(tmp_path: Path, data: bytes) -> AutopilotLog:
    path = tmp_path / "log"
    path.write_bytes(data)
    return open_ulog(path) if data.startswith(b"ULog") else open_dataflash(path)


def of_kind(log: AutopilotLog, kind: Any) -> list[tuple[float, Any]]:
    """Messages of a kind with their times since the log began."""
    first_ns = next(iter(log.events()))[0].t_ns
    return [
        ((envelope.t_ns - first_ns) * 1e-9, message)
        for envelope, message in log.events()
        if isinstance(message, kind)
    ]


# --- dataflash ----------------------------------------------------------------------------------


@pytest.mark.parametrize("old", [False, True])
def test_a_dataflash_log_says_the_same_under_all_names(
    tmp_path: Path, flown: MadeFlight, old: bool
) -> None:
    context = opened(tmp_path, dataflash(flown, old=old)).context()
    assert context.firmware.endswith("V3.3.3 (acf2e10c)" if old else "V4.5.7 (2a3dc4b7)")
    assert context.vehicle == "quadrotor"
    assert context.missing == ()
    assert context.notes == {}
    assert context.duration_s == pytest.approx(39.99, abs=0.01)
    assert context.parameters == pytest.approx(PARAMETERS)
    assert [(span.from_s, span.name) for span in context.armed] == [(3.0, "armed")]
    assert [span.name for span in context.modes] == ["LOITER"]
    gps_s = GPS_WEEK * 604_800 + GPS_WEEK_MS * 1e-3
    assert context.start_unix_s == pytest.approx(315_964_800 - 18 + gps_s)
    for number, (track, made) in enumerate(zip(context.imus, flown.imus, strict=True)):
        assert track.imu == number
        np.testing.assert_allclose(track.w_b, made.w_b, atol=1e-6)
        np.testing.assert_allclose(track.f_b, made.f_b, atol=1e-5)
        np.testing.assert_array_equal(track.stamp_us, made.t_us)
        has_field = np.isfinite(track.m_b_ut[:, 0])
        assert has_field.sum() == 400
        np.testing.assert_allclose(track.m_b_ut[has_field], made.m_b_ut[has_field], atol=0.051)
    gps = context.gps[0]
    np.testing.assert_allclose(gps.v_n, flown.v_n, atol=0.02)
    np.testing.assert_allclose(gps.latitude_deg, flown.place[:, 0], atol=1e-6)
    np.testing.assert_allclose(gps.altitude_m, flown.place[:, 2], atol=0.1)
    assert gps.has_fix.all()
    names = {track.name for track in context.attitudes}
    assert names == (
        {"autopilot", "EKF1", "AHRS2"} if old else {"autopilot", "EKF3 core 1", "EKF3 core 2"}
    )
    for track in context.attitudes:
        assert largest_deg(track, flown) < 0.03


def largest_deg(track: AttitudeTrack, made: MadeFlight) -> float:
    places = np.searchsorted(made.t_us - START_US, np.round(track.t_s * 1e6))
    pairs = zip(track.q_nb, made.q_nb[places.clip(max=len(made.q_nb) - 1)], strict=True)
    return max(quaternion.angle(tuple(p), tuple(q)) for p, q in pairs) / DEG


def test_simulators_truth_and_primary_core_are_found(tmp_path: Path, flown: MadeFlight) -> None:
    context = opened(tmp_path, dataflash(flown)).context()
    assert context.truth is not None
    assert largest_deg(context.truth, flown) < 0.01
    assert [span.name for span in context.primary] == ["EKF3 core 1"]


def test_the_service_is_told_what_it_would_have_heard(tmp_path: Path, flown: MadeFlight) -> None:
    log = opened(tmp_path, dataflash(flown))
    times = [envelope.t_ns for envelope, _ in log.events()]
    assert times == sorted(times)
    assert log.progress == (log.path.stat().st_size,) * 2
    beats = of_kind(log, Heartbeat)
    assert [t_s for t_s, _ in beats] == pytest.approx(range(40))
    assert [beat.is_armed for _, beat in beats] == [t_s >= 3.0 for t_s, _ in beats]
    assert {state.on_ground for t_s, state in of_kind(log, LandedState) if t_s < 5.0} == {True}
    assert {state.on_ground for t_s, state in of_kind(log, LandedState) if t_s > 5.0} == {False}
    assert {message.name for _, message in of_kind(log, ParameterValue)} == set(PARAMETERS)
    assert len(of_kind(log, StatusText)) == 1
    assert of_kind(log, SystemTime)[0][1].unix_s == log.context().start_unix_s
    fixes = of_kind(log, GpsFix)
    np.testing.assert_allclose([fix.v_n for _, fix in fixes], flown.v_n, atol=0.02)
    assert [fix.time_us for _, fix in fixes] == flown.fix_us.tolist()
    assert {fix.sigma_m_s for _, fix in fixes} == {0.2}
    attitudes = of_kind(log, ReportedAttitude)
    assert 15.0 < len(attitudes) / 40.0 <= 25.0
    readings = [reading for _, reading in of_kind(log, ImuReading)]
    assert sorted({reading.imu for reading in readings}) == [0, 1]
    assert sum(reading.m_b_ut is not None for reading in readings) == 800


def test_sensors_are_turned_by_the_trim(tmp_path: Path, flown: MadeFlight) -> None:
    """They are logged in the axes of the board, and the angles in those of the body."""
    extra = DataflashWriter()
    at_start = np.array([START_US] * 2)
    names = np.array([b"AHRS_TRIM_X", b"AHRS_TRIM_Y"])
    extra.add("PARM", "QNf", "TimeUS,Name,Value", at_start, names, np.array([0.03, -0.05]))
    context = opened(tmp_path, dataflash(flown, extra=extra)).context()
    q = quaternion.from_euler(0.03, -0.05, 0.0)
    board, body = flown.imus[0].f_b[700], context.imus[0].f_b[700]
    np.testing.assert_allclose(body, quaternion.rotate(q, tuple(board)), atol=1e-5)
    by_name = {track.name: track for track in context.attitudes}
    core, angles = by_name["EKF3 core 1"].q_nb[200], by_name["autopilot"].q_nb[200]
    turned = quaternion.multiply(tuple(angles), quaternion.conjugate(q))
    assert quaternion.angle(tuple(core), turned) < 0.01 * DEG


def imu_log(
    t_us: Any, values: Any = (0.0, 0.0, 0.0, 0.0, 0.0, -9.8), healthy: Any = 1
) -> DataflashWriter:
    writer = DataflashWriter()
    columns = "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,GH,AH"
    writer.add("IMU", "QBffffffBB", columns, np.asarray(t_us), 0, *values, healthy, 1)
    return writer


def test_fast_samples_come_as_means_at_their_mean_time(tmp_path: Path) -> None:
    t_us = START_US + np.arange(2000) * 1000
    t_us[1001:] += 500_000  # a pause, which no mean reaches over
    rate = np.arange(2000) * 1e-3
    log = opened(tmp_path, imu_log(t_us, (rate, 0, 0, 0, 0, -9.8)).bytes())
    readings = [reading for _, reading in of_kind(log, ImuReading)]
    assert len(log.context().imus[0].t_s) == 2000
    assert 0.9 * THINNED_HZ < 2.0 / 2000 * 1e3 * len(readings) / 2.0 <= 1.05 * THINNED_HZ
    assert [r.time for r in readings[:2]] == [START_US + 2000, START_US + 7000]
    assert [r.w_b[0] for r in readings[:2]] == pytest.approx([0.002, 0.007], abs=1e-7)
    inside = [r.time for r in readings if t_us[1000] < r.time < t_us[1001]]
    assert not inside


def test_a_clipped_sample_makes_its_mean_clipped(tmp_path: Path) -> None:
    force = np.full(400, -9.8)
    force[7] = -155.0
    t_us = START_US + np.arange(400) * 1000
    log = opened(tmp_path, imu_log(t_us, (0, 0, 0, 0, 0, force)).bytes())
    clipped = [reading.clipped for _, reading in of_kind(log, ImuReading)]
    assert clipped[:3] == [False, True, False]
    assert sum(clipped) == 1


def test_what_the_autopilot_calls_unhealthy_is_left_out(tmp_path: Path) -> None:
    healthy = np.ones(200)
    healthy[50:60] = 0
    log = opened(tmp_path, imu_log(START_US + np.arange(200) * 10_000, healthy=healthy).bytes())
    assert len(of_kind(log, ImuReading)) == 190
    assert log.notes == {"samples of IMU 1 that the autopilot calls unhealthy": 10}


def test_an_imu_without_a_compass_takes_the_first_one(tmp_path: Path, flown: MadeFlight) -> None:
    alone = flown._replace(imus=flown.imus[:1])
    extra = DataflashWriter()
    columns = "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"
    imu = flown.imus[1]
    values = (1, *imu.w_b.T, *imu.f_b.T, 0, 0, 45.0, 1, 1, 1000, 1000)
    extra.add("IMU", "QBffffffIIfBBHH", columns, imu.t_us, *values)
    log = opened(tmp_path, dataflash(alone, extra=extra))
    fields = [r.m_b_ut for _, r in of_kind(log, ImuReading) if r.imu == 1 and r.m_b_ut]
    assert len(fields) == 400
    assert not np.isfinite(log.context().imus[1].m_b_ut).any()


def test_a_compass_that_repeats_a_measurement_tells_nothing_new(tmp_path: Path) -> None:
    writer = imu_log(START_US + np.arange(400) * 10_000)
    t_us = START_US + np.arange(40) * 100_000
    measured_us = START_US + np.arange(40) // 2 * 200_000
    columns = "TimeUS,I,MagX,MagY,MagZ,Health,S"
    writer.add("MAG", "QBhhhBI", columns, t_us, 0, 200, 10, 400, 1, measured_us)
    context = opened(tmp_path, writer.bytes()).context()
    assert np.isfinite(context.imus[0].m_b_ut[:, 0]).sum() == 20
    np.testing.assert_allclose(np.nanmean(context.imus[0].m_b_ut, axis=0), (20.0, 1.0, 40.0))


def test_slow_samples_are_said_to_be_too_slow(tmp_path: Path) -> None:
    log = opened(tmp_path, imu_log(START_US + np.arange(100) * 200_000).bytes())
    assert not of_kind(log, ImuReading)
    assert log.context().missing == (
        "IMU samples only 5 times a second",
        "no compass",
        "no GPS fix",
        "no date",
        "no autopilot's attitude to compare with",
        "no word of when the motors were armed",
        "no version of the firmware",
    )
    assert [(span.from_s, span.name) for span in log.context().armed] == [(0.0, "armed")]


def log_without_times(errors: Any = ((11, 2),)) -> DataflashWriter:
    """As until 2015: only samples have times; logging pauses from 4 to 10 s, disarmed."""
    t_us = START_US + np.arange(1000) * 10_000
    t_us[400:] += 6_000_000
    writer = DataflashWriter()
    rates = np.zeros((6, len(t_us)))
    rates[5] = -9.8
    writer.add("IMU", "Iffffff", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", t_us, *rates)
    start = t_us[:1] + 1
    writer.add("MSG", "Z", "Message", start, np.array([b"ArduCopter V3.2 (c8e0f3e1)"]))
    writer.add("PARM", "Nf", "Name,Value", start, np.array([b"FRAME"]), 1.0)
    writer.add("MODE", "Mh", "Mode,ThrCrs", t_us[[100]] + 1, 5, 500)
    events = np.array([t_us[0] - 1, t_us[399] + 1, t_us[400] - 1])
    writer.add("EV", "B", "Id", events, [10, 11, 10])
    for subsystem, code in errors:
        writer.add("ERR", "BB", "Subsys,ECode", t_us[[200]] + 1, subsystem, code)
    return writer


@pytest.mark.parametrize("word", ["5", "LOITER"])
def test_a_text_writes_modes_as_names_or_as_numbers(tmp_path: Path, word: str) -> None:
    """As those that were made of a binary do, or those that the autopilot sent."""
    text = text_of(log_without_times().bytes())
    assert b"MODE, 5, 500" in text
    renamed = text.replace(b"MODE, 5, 500", f"MODE, {word}, 500".encode())
    assert [span.name for span in opened(tmp_path, renamed).context().modes] == ["LOITER"]


def test_what_has_no_time_has_that_of_its_place(tmp_path: Path) -> None:
    context = opened(tmp_path, log_without_times().bytes()).context()
    assert (context.firmware, context.vehicle) == ("ArduCopter V3.2 (c8e0f3e1)", "quadrotor")
    assert context.parameters == {"FRAME": 1.0}
    assert [(span.from_s, span.name) for span in context.modes] == [(1.0, "LOITER")]
    armed = [time_s for span in context.armed for time_s in (span.from_s, span.to_s)]
    # It logs while it is armed: what ends belongs to the rows before, what begins to those after.
    assert armed == pytest.approx([0.0, 3.99, 10.0, 15.99])


def test_errors_are_said_in_words_and_once(tmp_path: Path) -> None:
    errors = ((11, 2), (16, 0), (24, 1), (5, 1), (99, 1))
    writer = log_without_times(errors)
    texts = [said.text for said in opened(tmp_path, writer.bytes()).context().said][1:]
    assert texts == [
        "error: GPS glitch",
        "error: EKF check: over",
        "error: EKF primary changed: 1",
        "error: radio failsafe",
    ]
    writer.add("MSG", "Z", "Message", np.array([START_US + 2_000_002]), np.array([b"GPS Glitch"]))
    texts = [said.text for said in opened(tmp_path, writer.bytes()).context().said][1:]
    assert texts == ["GPS Glitch"]


def test_batches_become_bursts(tmp_path: Path) -> None:
    writer = imu_log(START_US + np.arange(200) * 10_000)
    head, block_us = np.array([START_US + 500_000]), START_US + 500_000 + np.arange(32) * 100
    columns = "TimeUS,N,type,instance,mul,smp_cnt,SampleUS,smp_rate"
    writer.add("ISBH", "QHBBHHQf", columns, head, 7, 1, 1, 100, 1000, head, 4000.0)
    wave = np.round(100.0 * np.sin(np.arange(1024) * 0.1)).reshape(32, 32)
    values = (7, np.arange(32), wave, np.zeros((32, 32)), -wave)
    writer.add("ISBD", "QHHaaa", "TimeUS,N,seqno,x,y,z", block_us, *values)
    (burst,) = opened(tmp_path, writer.bytes()).context().bursts
    assert (burst.imu, burst.sensor, burst.rate_hz, burst.t_s) == (1, "gyro", 4000.0, 0.5)
    np.testing.assert_allclose(burst.values[:, 0], wave.ravel()[:1000] / 100.0)
    np.testing.assert_allclose(burst.values[:, 2], -burst.values[:, 0])


BATCH = ("ISBH", "HBBHHf", "N,type,instance,mul,smp_cnt,smp_rate", 7, 1, 0, 1, 100, 1000.0)
BLOCK = ("ISBD", "HHaaa", "N,seqno,x,y,z", 7, 0, *[np.zeros(32)] * 3)


@pytest.mark.parametrize(
    "messages",
    [
        [("PARM", "Nn", "Name,Value", b"FRAME_CLASS", b"one")],
        [("PARM", "If", "Name,Value", 2**31, 1.0)],  # as many bytes would fill the memory
        [("EV", "n", "Id", b"abc")],
        [("GPS", "BaHLLfff", "Status,GMS,GWk,Lat,Lng,Alt,Spd,GCrs", 3, 0, 2000, 1, 1, 1, 1, 1)],
        [("GPS", "BQHLLfff", "Status,GMS,GWk,Lat,Lng,Alt,Spd,GCrs", 3, 2**63, 2000, *[1.0] * 5)],
        [BLOCK, ("ISBH", "HfffHf", BATCH[2], 7, 1, 0, np.nan, 100, 1000.0)],
        [BLOCK, ("ISBH", "HBBHff", BATCH[2], 7, 1, 0, 1, np.nan, np.inf)],
        [BATCH, ("ISBD", "HHaaf", *BLOCK[2:-1], 0.0)],
        [BATCH, ("ISBD", "HHaa", "N,seqno,x,y", *BLOCK[3:-1])],
    ],
)
def test_a_definition_that_calls_a_column_something_else_costs_that_column_only(
    tmp_path: Path, messages: list[tuple[Any, ...]]
) -> None:
    t_us = START_US + np.arange(100) * 10_000
    writer = imu_log(t_us)
    for name, letters, columns, *values in messages:
        writer.add(name, f"Q{letters}", f"TimeUS,{columns}", t_us, *values)
    log = opened(tmp_path, writer.bytes())
    assert (len(log.context().imus), log.context().bursts) == (1, ())
    assert log.context().start_unix_s is None
    assert sum(1 for _ in log.events()) > 100


def test_raw_rows_become_bursts_without_pauses(tmp_path: Path) -> None:
    writer = imu_log(START_US + np.arange(200) * 10_000)
    t_us = START_US + np.arange(1000) * 1000
    t_us[400:] += 50_000
    writer.add("GYR", "QBQfff", "TimeUS,I,SampleUS,GyrX,GyrY,GyrZ", t_us, 0, t_us, 0.1, 0.2, 0.3)
    bursts = opened(tmp_path, writer.bytes()).context().bursts
    assert [len(burst.values) for burst in bursts] == [400, 600]
    assert [burst.rate_hz for burst in bursts] == pytest.approx([1000.0, 1000.0])


def test_a_wrong_time_costs_one_row(tmp_path: Path) -> None:
    t_us = START_US + np.arange(500) * 10_000
    for place, change_us in ((100, 2**50), (200, 3_000_000), (300, -3_000_000), (400, -(10**7))):
        t_us[place] += change_us
    columns = "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,GH,AH"
    data = bytearray(imu_log(START_US + np.arange(500) * 10_000).bytes())
    place = data.index(columns.encode()) + 64 - 3
    row = 8 + 1 + 24 + 2 + 3
    for number, time_us in enumerate(t_us.tolist()):
        start = place - 61 + 64 + number * row + 3
        data[start : start + 8] = time_us.to_bytes(8, "little")
    log = opened(tmp_path, bytes(data))
    assert len(log.context().imus[0].t_s) == 496
    assert log.notes == {"rows of IMU far from the times around them": 4}


@pytest.mark.parametrize(
    ("text", "parameter", "vehicle"),
    [
        ("ArduPlane V4.5.7 (1)", None, "fixed wing"),
        ("APM:Rover v2.50", None, "ground rover"),
        ("ArduSub V4.1.0 (1)", None, "submarine"),
        ("ArduCopter V4.5.7 (1)", ("FRAME_CLASS", 2.0), "hexarotor"),
        ("ArduCopter V4.5.7 (1)", ("FRAME_CLASS", 9.0), "coaxial"),
        ("ArduCopter V3.2.1 (1)", ("FRAME", 1.0), "quadrotor"),
        ("ArduCopter V3.2.1 (1)", ("H_COL_MAX", 1700.0), "helicopter"),
        ("something", None, ""),
    ],
)
def test_the_vehicle_is_known_by_its_firmware(
    tmp_path: Path, text: str, parameter: tuple[str, float] | None, vehicle: str
) -> None:
    writer = imu_log(START_US + np.arange(200) * 10_000)
    start = np.array([START_US])
    writer.add("MSG", "QZ", "TimeUS,Message", start, text.encode())
    if parameter is not None:
        name, value = parameter
        writer.add("PARM", "QNf", "TimeUS,Name,Value", start, name.encode(), value)
    assert opened(tmp_path, writer.bytes()).context().vehicle == vehicle


# --- ULog ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("old", [False, True])
def test_a_velocity_that_a_receiver_calls_invalid_is_none(
    tmp_path: Path, integrated: MadeFlight, old: bool
) -> None:
    has_velocity = np.arange(len(integrated.fix_us)) % 3 != 1
    log = opened(tmp_path, ulog(integrated, old=old, has_velocity=has_velocity))
    found = log.context().gps[0].v_n
    assert (np.isfinite(found).all(axis=1) == has_velocity).all()
    np.testing.assert_allclose(found[has_velocity], integrated.v_n[has_velocity], atol=1e-5)


@pytest.mark.parametrize("old", [False, True])
def test_a_ulog_file_says_the_same_under_all_names(
    tmp_path: Path, integrated: MadeFlight, old: bool
) -> None:
    log = opened(tmp_path, ulog(integrated, old=old))
    context = log.context()
    assert context.firmware == "PX4 v1.15.2"
    assert context.vehicle == "quadrotor"
    assert context.missing == ()
    assert context.notes == {}
    assert [span.name for span in context.modes] == ["POSCTL"]
    assert [round(span.from_s, 1) for span in context.armed] == [3.0]
    assert [track.source for track in context.imus] == (
        ["sensor_combined"] if old else ["vehicle_imu"] * 2
    )
    for track, made in zip(context.imus, integrated.imus, strict=False):
        np.testing.assert_allclose(track.w_b, made.w_b, atol=1e-5)
        np.testing.assert_allclose(track.f_b, made.f_b, atol=1e-4)
        has_field = np.isfinite(track.m_b_ut[:, 0])
        np.testing.assert_allclose(track.m_b_ut[has_field], made.m_b_ut[has_field], atol=1e-4)
    np.testing.assert_allclose(context.gps[0].v_n, integrated.v_n, atol=1e-5)
    np.testing.assert_allclose(context.gps[0].latitude_deg, integrated.place[:, 0], atol=1e-6)
    assert context.truth is not None
    assert context.attitudes[0].name == "EKF2"
    # Values are as old as their time of integration says, a field as the sample that brings it.
    readings = [reading for _, reading in of_kind(log, ImuReading) if reading.imu == 0]
    first = 0 if old else 1  # the first one is older than the first message
    assert readings[0].time == integrated.t_us[first]
    step_s = float(np.median(np.diff(integrated.t_us))) * 1e-6
    assert readings[0].ages == pytest.approx((0.5 * step_s, 0.0))
    assert isinstance(next(iter(log.events()))[1], Heartbeat)
    assert [fix.time_us for _, fix in of_kind(log, GpsFix)] == integrated.fix_us.tolist()


def test_rare_vehicle_imus_leave_the_combined_sensor(
    tmp_path: Path, integrated: MadeFlight
) -> None:
    extra = ULogWriter()
    rare_us = integrated.t_us[::100]
    fields = "float[3] delta_angle;float[3] delta_velocity;uint32_t delta_angle_dt"
    for number in range(2):
        values = (np.zeros((len(rare_us), 3)), np.ones((len(rare_us), 3)), 5000)
        extra.add("vehicle_imu", fields, rare_us, *values, number=number)
    context = opened(tmp_path, ulog(integrated, old=True, extra=extra)).context()
    assert [track.source for track in context.imus] == ["sensor_combined"]
    assert context.missing == ("only one IMU, because the others were logged too seldom",)


def test_the_sensors_own_buffers_become_bursts(tmp_path: Path, integrated: MadeFlight) -> None:
    extra = ULogWriter()
    t_us = START_US + 1_000_000 + np.arange(100) * 1000
    fields = "float dt;float scale;uint8_t samples;int16_t[32] x;int16_t[32] y;int16_t[32] z"
    wave = np.arange(3200).reshape(100, 32) % 50
    extra.add("sensor_gyro_fifo", fields, t_us, 125.0, 0.01, 8, wave, -wave, 7)
    shorter = "float dt;float scale;uint8_t samples;int16_t[32] x;int16_t[8] y;int16_t[7] z"
    extra.add("sensor_accel_fifo", shorter, t_us, 125.0, 0.01, 8, wave, 0, 7)
    burst, of_seven = opened(tmp_path, ulog(integrated, extra=extra)).context().bursts
    assert (of_seven.sensor, len(of_seven.values)) == ("accelerometer", 700)
    assert (burst.sensor, burst.rate_hz, len(burst.values)) == ("gyro", 8000.0, 800)
    np.testing.assert_allclose(burst.values[:, 0], 0.01 * wave[:, :8].ravel(), atol=1e-9)


# --- through the service ------------------------------------------------------------------------


class Listener:
    """Estimates and notices."""

    message_ids = frozenset[int]()

    def __init__(self) -> None:
        self.estimates: list[EstimateRecord] = []

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Nothing comes as frames."""

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """Keeps it."""
        self.estimates.append(estimate_record(estimate, late_ns))

    def notice(self, t_ns: int, severity: object, text: str) -> None:
        """Says nothing."""


def played(log: AutopilotLog) -> tuple[Listener, Any]:
    listener = Listener()
    pipeline = pipeline_for(log, inputs_for(log, PlaybackOptions()), None, listener)
    for _ in Playback(log, whole_frames=False).through(pipeline):
        pass
    return listener, pipeline.service


def errors_deg(log: AutopilotLog, listener: Listener, track: AttitudeTrack) -> tuple[float, float]:
    """Largest difference of tilt and of heading, once settled."""
    start_us = next(iter(log.events()))[0].t_ns // 1000
    times = np.array([record.t_us for record in listener.estimates])
    largest = [0.0, 0.0]
    for t_s, q_nb in zip(track.t_s.tolist(), track.q_nb.tolist(), strict=True):
        if t_s < SETTLED_S:
            continue
        place = int(np.abs(times - (start_us + 1e6 * t_s)).argmin())
        record = listener.estimates[place]
        ours = (record.q_w, record.q_x, record.q_y, record.q_z)
        turn = quaternion.multiply(ours, quaternion.conjugate(tuple(q_nb)))
        pair = quaternion.tilt_and_heading(turn)
        largest = [max(size, abs(x) / DEG) for size, x in zip(largest, pair, strict=True)]
    return largest[0], largest[1]


@pytest.mark.parametrize("old", [False, True])
@pytest.mark.parametrize("is_ulog", [False, True])
def test_a_made_flight_is_estimated_as_in_flight(
    tmp_path: Path, flown: MadeFlight, integrated: MadeFlight, old: bool, is_ulog: bool
) -> None:
    data = ulog(integrated, old=old) if is_ulog else dataflash(flown, old=old)
    log = opened(tmp_path, data)
    listener, service = played(log)
    tilt_deg, heading_deg = errors_deg(log, listener, log.context().attitudes[0])
    assert tilt_deg < 0.3
    assert heading_deg < 1.0
    assert service.findings == ()
    assert service.health.autopilot == "1/1"
    assert service.health.imu_message == "recorded IMU"


def test_a_real_copter_agrees_with_its_own_estimators() -> None:
    """Its cores differ by 7.7 deg of heading, and so do its compasses; ours lies between."""
    log = open_dataflash(shared_data("imu/ardupilot_spark404_log.bin"))
    listener, service = played(log)
    for track in log.context().attitudes:
        tilt_deg, heading_deg = errors_deg(log, listener, track)
        assert tilt_deg < 6.0
        assert heading_deg < 8.0
    assert service.findings == ()


@pytest.mark.thorough
def test_a_real_px4_on_the_bench_agrees_with_its_own_estimator() -> None:
    log = open_ulog(shared_data("imu/px4_pyulog_sample.ulg"))
    listener, service = played(log)
    track = log.context().attitudes[0]
    tilt_deg, heading_deg = errors_deg(log, listener, track)
    assert track.name == "attitude_estimator_q"
    assert tilt_deg < 0.3
    assert heading_deg < 1.0
    assert service.findings == ()
    assert log.context().missing == ("no GPS fix", "no date")


# --- damage -------------------------------------------------------------------------------------


@pytest.mark.parametrize("is_ulog", [False, True])
def test_damaged_logs_are_read_as_far_as_they_go(tmp_path: Path, is_ulog: bool) -> None:
    short = made_flight(duration_s=4.0, sampling=GyroSampling.MEAN)
    data = ulog(short) if is_ulog else dataflash(short)
    rng = np.random.default_rng(3)
    for turn in range(40):
        size = int(rng.integers(16, len(data)))
        damaged = bytearray(data[:size] if turn % 2 else data)
        for place in rng.integers(16, len(damaged), int(rng.integers(0, 200))).tolist():
            damaged[place] ^= 1 << int(rng.integers(8))
        log = opened(tmp_path, bytes(damaged))
        before_ns = 0
        for envelope, message in log.events():
            assert envelope.t_ns >= before_ns
            before_ns = envelope.t_ns
            if isinstance(message, ImuReading):
                assert 0 <= (message.imu or 0) < MAX_IMUS
                assert all(map(math.isfinite, (*message.w_b, *message.f_b)))
        assert log.context().duration_s < 20.0

"""Variants of logs, and what `tools/review_variants.py` makes of their reviews."""

import made_logs
import pytest
from needs import REPOSITORY, tool
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from fuzz.log_variants import Names, variants
from fuzz.worn_logs import Log, Row, log_of, time_of

TAKEOFF = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"


@pytest.fixture(scope="module")
def logs():
    flight = made_logs.made_flight(duration_s=4.0, rate_hz=50.0, imus=2)
    return {
        ".bin": log_of("a.bin", made_logs.dataflash(flight)),
        ".ulg": log_of("a.ulg", made_logs.ulog(flight)),
        ".tlog": log_of("a.tlog", TAKEOFF.read_bytes()[: 100 * 1024]),
    }


@pytest.mark.parametrize("ending", [".bin", ".ulg", ".tlog"])
def test_a_variant_keeps_what_every_reader_needs_and_leaves_out_what_it_is_named_for(logs, ending):
    log = logs[ending]
    names, made = Names(log), dict(variants(log))
    gps = "GPS|sensor_gps|vehicle_gps_position|GPS_RAW_INT"
    assert any(names.fits(row, gps) for row in log.rows)
    assert not any(names.fits(row, gps) for row in made["no_gps"].rows)
    assert all(one.head == log.head and len(one.rows) < len(log.rows) for one in (
        made["begins"], made["ends"], made["half_rate"], made["no_gps"]
    ))  # fmt: skip
    first, last = time_of(log.rows[0]), max(time_of(row) or 0.0 for row in log.rows)
    assert max(time_of(row) or 0.0 for row in made["ends"].rows) < last
    begun = [time_of(row) for row in made["begins"].rows if names.fits(row, f"{gps}|IMU|RAW_IMU")]
    assert min(begun) > first


def test_a_variant_of_an_unknown_vehicle_or_place_has_no_message_that_tells_it(logs):
    for ending, log in logs.items():
        names, made = Names(log), dict(variants(log))
        assert not any(names.fits(row, "GPS|POS|GPS_RAW_INT") for row in made["no_place"].rows)
        bare = {row.kind for row in made["bare"].rows}
        assert bare < {row.kind for row in log.rows}
        if ending != ".ulg":  # its parameters and texts are in its head
            told = "MSG|PARM|STATUSTEXT|PARAM_VALUE"
            kept = [row for row in log.rows if not names.fits(row, told)]
            assert made.get("unknown", log).rows == kept


def test_a_logger_pauses_and_loses_blocks(logs):
    for log in logs.values():
        made = dict(variants(log))
        count = len(log.rows)
        assert len(made["lossy"].rows) == pytest.approx(0.9 * count, abs=40)
        assert len(made["paused"].rows) < 0.9 * count
        assert made["paused"].rows[-1] == log.rows[-1]
        assert len(made["short"].rows) == round(0.1 * count)


def test_a_binary_log_is_written_as_text_without_its_torn_end(logs):
    text = dict(variants(logs[".bin"]))["as_text"]
    assert text.ending == ".log"
    assert len(text.rows) == len(logs[".bin"].rows)
    *whole, last = logs[".bin"].rows
    torn = logs[".bin"]._replace(rows=[*whole, last._replace(data=last.data[:-1])])
    assert dict(variants(torn))["as_text"].rows == text.rows[:-1]


def test_motors_that_were_armed_are_not():
    log = log_of("a.tlog", TAKEOFF.read_bytes())
    link, armed = mavlink.MAVLink(None), {}
    for name, one in (("own", log), ("disarmed", dict(variants(log))["disarmed"])):
        frames = link.parse_buffer(b"".join(row.data[8:] for row in one.rows if row.kind == "0"))
        flags = [frame.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED for frame in frames]
        armed[name] = sum(map(bool, flags)), len(flags)
    assert armed["own"][0] > 0
    assert armed["disarmed"] == (0, armed["own"][1])
    events = [Row("EV", b"\xa3\x95\x01\x0a"), Row("ARM", bytes(11) + b"\1\0"), Row("X", b"\x0a")]
    made = dict(variants(Log(".bin", b"", events * 20)))["disarmed"].rows[:3]
    assert [row.data[-1] for row in made] == [11, 0, 10]
    assert made[1].data == bytes(13)


def test_of_several_imus_the_first_is_left(logs):
    for ending in (".bin", ".ulg"):
        names, made = Names(logs[ending]), dict(variants(logs[ending]))
        imus = "IMU|vehicle_imu|sensor_accel|sensor_gyro"
        assert any(names.instance(row) for row in logs[ending].rows if names.fits(row, imus))
        assert not any(names.instance(r) for r in made["first_only"].rows if names.fits(r, imus))


def test_a_link_is_slow_but_for_what_is_sent_seldom(logs):
    log = logs[".tlog"]
    names, made = Names(log), dict(variants(log))
    counts = [
        sum(names.fits(row, "RAW_IMU|SCALED_IMU\\d?") for row in one.rows)
        for one in (log, made["slow"], made["slowest"])
    ]
    assert counts[1] == pytest.approx(counts[0] / 4.0, abs=3)
    assert counts[2] == pytest.approx(counts[0] / 25.0, abs=3)
    beats = [row for row in log.rows if names.fits(row, "HEARTBEAT")]
    assert [row for row in made["slowest"].rows if names.fits(row, "HEARTBEAT")] == beats


def test_another_component_adds_to_a_link(logs):
    made = dict(variants(logs[".tlog"]))
    others = log_of("a.tlog", made["other_component"].bytes()).rows
    assert len(others) == len(made["other_component"].rows) > len(logs[".tlog"].rows)


def finding(kind, from_s, to_s, *, severity="warning", number=1):
    sensor = {"kind": "imu", "number": number, "others": []}
    words = {"source": f"IMU {number}", "text": kind, "evidence": "made"}
    return {
        "kind": kind,
        "severity": severity,
        "from_s": from_s,
        "to_s": to_s,
        "sensor": sensor,
        **words,
    }


def said(*findings, duration_s=100.0, looked_at=("GPS",)):
    return {"findings": list(findings), "duration_s": duration_s, "looked_at": looked_at}


def test_what_a_variant_is_told_otherwise_is_a_suspect():
    suspects = tool("review_variants").suspects
    own = said(finding("vibration", 10.0, 20.0), finding("clipping", 60.0, 70.0))
    same = said(finding("vibration", 12.0, 20.0), finding("clipping", 60.0, 70.0))
    assert not list(suspects(own, same, "half_rate"))
    new = said(
        *own["findings"],
        finding("gyro_bias", 5.0, 6.0),
        finding("noise", 5.0, 6.0, severity="notice"),
    )
    assert [line[:10] for line in suspects(own, new, "half_rate")] == ["+ warning:"]
    # It begins 40 s later, and tells its own times.
    later = said(finding("clipping", 20.0, 30.0), duration_s=60.0)
    assert not list(suspects(own, later, "begins"))
    gone = list(suspects(own, said(duration_s=60.0), "begins"))
    assert gone == ["- warning: 60.0 to 70.0 s: IMU 1: clipping (made)"]
    assert list(suspects(said(), said(), "no_gps")) == ["? GPS"]
    assert list(suspects(said(), {"failure": "x"}, "ends")) == ["! x"]

"""Logs without place: what gives it away although it is no coordinate, searched for in bytes."""

import math
import struct

import numpy as np
import pytest
from made_logs import START_US, DataflashWriter, ULogWriter
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.files.earth_field import earth_field_at
from h2nav.recordings.anonymous import DEGREE_M, Coordinates, Replacement
from h2nav.recordings.anonymous_field import BothFields, declination, states, vector_ut
from h2nav.recordings.anonymous_frames import anonymise_frames
from h2nav.recordings.anonymous_logs import anonymise_dataflash, anonymise_ulog
from h2nav.recordings.anonymous_place import Elsewhere, fields_of, middle_of
from h2nav.recordings.dataflash_tables import read_dataflash
from h2nav.recordings.recording import open_recording
from h2nav.recordings.ulog_tables import read_ulog
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer

OLD, NEW = Coordinates(47.397742, 8.545594), Coordinates(46.150321, 6.912345)
UNIX_S, WEEKS = 1_700_000_000.0, 7
FIELDS = fields_of(OLD, Elsewhere(NEW, WEEKS), UNIX_S)
BY = Replacement(OLD, NEW, WEEKS, b"salt", FIELDS)
NOWHERE = Replacement(None, Coordinates(0.0, 0.0), WEEKS, b"salt")
OLD_DECLINATION_DEG = math.degrees(FIELDS.old.declination_rad)
NEW_DECLINATION_DEG = math.degrees(FIELDS.new.declination_rad)
# As an autopilot's table has it, which is not quite the model.
HELD_UT = vector_ut(FIELDS.old) + np.array([0.21, -0.17, 0.33])
HELD_MGAUSS = np.rint(HELD_UT * 10.0).astype("<i2")
AT_US = START_US + np.arange(3) * 100_000


def traces(*values):
    """Numbers as a log may hold them: float, double, whole units from 1e-2 to 1e-7, text."""
    found = []
    for value in values:
        found += [struct.pack("<f", value), struct.pack("<d", value)]
        for digits in (4, 5, 6, 7):
            scaled = round(value * 10**digits)
            found += [scaled.to_bytes(4, "little", signed=True), f"{value:.{digits}f}".encode()]
            found.append(struct.pack("<f", scaled))
    return [trace for trace in found if len(set(trace)) > 3]


def field_traces():
    """The old field, in every unit and in a row as the states of a filter."""
    triples = [HELD_MGAUSS.tobytes(), (HELD_UT / 100.0).astype("<f4").tobytes()]
    angles = [OLD_DECLINATION_DEG, math.degrees(FIELDS.old.dip_rad), FIELDS.old.norm_ut / 100.0]
    return triples + traces(*angles, *(math.radians(angle) for angle in angles[:2]))


def assert_lacks(data, wanted):
    assert [trace for trace in wanted if trace in data] == []


def written(tmp_path, data, anonymise, by=BY):
    path, output = tmp_path / "old", tmp_path / "new"
    path.write_bytes(data)
    anonymise(path, output, by)
    return output


# --- dataflash ------------------------------------------------------------------------------------


def dataflash_log():
    writer = DataflashWriter()
    names = [b"COMPASS_DEC", b"LOITER_LAT_P", b"BRD_RTC_TZ_MIN", b"BATT_SERIAL_NUM", b"NET_P1_IP0"]
    values = [math.radians(OLD_DECLINATION_DEG), 1.0, 120.0, -1.0, 192.0]
    at = np.full(len(names), START_US)
    writer.add("PARM", "QNff", "TimeUS,Name,Value,Default", at, names, values, values)
    writer.add("XKF2", "QBhhh", "TimeUS,C,MN,ME,MD", AT_US, 0, *HELD_MGAUSS)
    writer.add("TERR", "QLLff", "TimeUS,Lat,Lng,TerrH,CHeight", AT_US, *OLD, 431.25, 17.5)
    writer.add("CTUN", "Qff", "TimeUS,Alt,TAlt", AT_US, 17.5, 17.5)
    e7 = [round(value * 1e7) for value in OLD]
    writer.add("MAVC", "QHii", "TimeUS,Cmd,X,Y", AT_US, 16, *e7)
    writer.add("GUID", "QBff", "TimeUS,Type,pX,pY", AT_US, 1, *e7)
    # Filters that began at 0 deg, before the receiver had a fix.
    metres = [OLD.latitude_deg * DEGREE_M, OLD.longitude_deg * DEGREE_M]
    north = np.array([2.5, 1_000_000.0, metres[0]])
    writer.add("EKF1", "Qff", "TimeUS,PN,PE", AT_US, north, np.array([1.5, 1_000_000.0, metres[1]]))
    latitudes = np.array([2e-5, -0.05, OLD.latitude_deg])
    longitudes = np.array([1e-5, 0.02, OLD.longitude_deg])
    writer.add("AHR2", "QLL", "TimeUS,Lat,Lng", AT_US, latitudes, longitudes)
    # A mission that was flown elsewhere.
    writer.add("CMD", "QLL", "TimeUS,Lat,Lng", AT_US, [-35.363261, 0.0, OLD.latitude_deg], 149.165)
    return writer.bytes(), metres


def test_of_a_dataflash_log_no_field_of_the_old_place_is_left(tmp_path):
    log, metres = dataflash_log()
    output = written(tmp_path, log, anonymise_dataflash)
    data = output.read_bytes()
    wanted = field_traces() + traces(*OLD) + [struct.pack("<f", 431.25)]
    wanted += [struct.pack("<f", value) for value in metres]
    assert len([trace for trace in wanted if trace in log]) > 8  # what is searched for was there
    assert_lacks(data, wanted)
    tables = read_dataflash(output)
    names = tables.find("PARM").texts("Name")
    values, defaults = (tables.find("PARM").numbers(name) for name in ("Value", "Default"))
    parameters = dict(zip(names, values.tolist(), strict=True))
    assert defaults.tolist() == values.tolist()
    shown_deg = math.degrees(parameters.pop("COMPASS_DEC"))
    assert shown_deg == pytest.approx(NEW_DECLINATION_DEG, abs=0.051)
    assert shown_deg * 10.0 == pytest.approx(round(shown_deg * 10.0), abs=1e-4)
    assert parameters == {
        "LOITER_LAT_P": 1.0,
        "BRD_RTC_TZ_MIN": 0.0,
        "BATT_SERIAL_NUM": -1.0,
        "NET_P1_IP0": 0.0,
    }
    shown = tables.find("XKF2").numbers("MN", "ME", "MD")
    assert shown == pytest.approx(np.tile(np.rint(vector_ut(FIELDS.new) * 10.0), (3, 1)))
    assert not tables.find("TERR").numbers("Lat", "Lng", "TerrH", "CHeight").any()
    assert tables.find("CTUN").numbers("Alt", "TAlt").tolist() == [[17.5, 0.0]] * 3
    for message, columns in (("MAVC", ("X", "Y")), ("GUID", ("pX", "pY"))):
        shown = tables.find(message).numbers(*columns) / 1e7
        assert shown == pytest.approx(np.tile(NEW, (3, 1)), abs=4e-6)


def test_what_is_far_from_the_flight_does_not_show_how_far_it_moved(tmp_path):
    log, _ = dataflash_log()
    tables = read_dataflash(written(tmp_path, log, anonymise_dataflash))
    north, east = tables.find("EKF1").numbers("PN", "PE").T
    assert north[:2].tolist() == [2.5, 1_000_000.0]
    assert east[:2].tolist() == [1.5, 1_000_000.0]
    shown = np.array([north[2], east[2]]) / DEGREE_M
    assert shown == pytest.approx(NEW, abs=1e-4)
    begun, drifted, placed = tables.find("AHR2").numbers("Lat", "Lng")
    assert begun.tolist() == drifted.tolist()
    assert begun == pytest.approx(np.array(NEW) + 5.0 * np.array([1.0, SHRUNK]), abs=1e-6)
    assert placed == pytest.approx(NEW, abs=1e-6)
    missions = tables.find("CMD").numbers("Lat", "Lng")
    assert missions[0] == pytest.approx((NEW[0] - 5.0, NEW[1] + 5.0 * SHRUNK), abs=1e-6)
    assert missions[1, 0] == 0.0
    assert missions[2, 0] == pytest.approx(NEW[0], abs=1e-6)


SHRUNK = math.cos(math.radians(OLD[0])) / math.cos(math.radians(NEW[0]))


def test_without_a_place_the_declination_goes_and_the_gains_stay(tmp_path):
    log, _ = dataflash_log()
    tables = read_dataflash(written(tmp_path, log, anonymise_dataflash, NOWHERE))
    table = tables.find("PARM")
    values = table.numbers("Value")
    parameters = dict(zip(table.texts("Name"), values.tolist(), strict=True))
    assert parameters["COMPASS_DEC"] == 0.0
    assert parameters["LOITER_LAT_P"] == 1.0
    assert not tables.find("XKF2").numbers("MN", "ME", "MD").any()


# --- ULog -----------------------------------------------------------------------------------------


def ulog_log():
    writer = ULogWriter()
    writer.parameter("EKF2_MAG_DECL", OLD_DECLINATION_DEG)
    writer.parameter("SDLOG_UTC_OFFSET", 120.0)
    writer.info("int32_t time_ref_utc", (7200).to_bytes(4, "little"))
    writer.info("uint32_t ver_sw_release", (0x010E02FF).to_bytes(4, "little"))
    filter_states = np.zeros((3, 24))
    filter_states[:, 0] = 1.0
    filter_states[1:, 16:19] = HELD_UT / 100.0
    writer.add("estimator_states", "float[24] states;uint8_t n_states", AT_US, filter_states, 24)
    names = "float mag_inclination_ref_deg;float mag_strength_ref_gs;float mag_strength_gs"
    references = (math.degrees(FIELDS.old.dip_rad), FIELDS.old.norm_ut / 100.0)
    writer.add("estimator_status", names, AT_US, *references, 0.4321)
    writer.add("satellite_info", "uint8_t[4] elevation", AT_US, [[57, 41, 33, 29]])
    names = "uint16_t serial_number;uint16_t manufacture_date;float voltage_v"
    writer.add("battery_status", names, AT_US, 0x4711, 0x4712, 12.5)
    writer.add("mission_result", "uint32_t mission_id;uint8_t valid", AT_US, 0x12345678, 1)
    # In metres, near to what the latitude is in degrees.
    writer.add("estimator_aid_src_gnss_pos", "float[2] observation", AT_US, [[46.0, 8.0]])
    return writer.bytes()


def test_of_a_ulog_file_no_field_of_the_old_place_is_left(tmp_path):
    log = ulog_log()
    output = written(tmp_path, log, anonymise_ulog)
    wanted = field_traces()
    wanted += [bytes((57, 41, 33, 29)), b"\x11\x47", b"\x12\x47", b"\x78\x56\x34\x12"]
    assert len([trace for trace in wanted if trace in log]) > 7
    assert_lacks(output.read_bytes(), wanted)
    file = read_ulog(output)
    parameters = {each.name: each.value for each in file.parameters}
    assert parameters["EKF2_MAG_DECL"] == pytest.approx(NEW_DECLINATION_DEG, abs=0.051)
    assert parameters["SDLOG_UTC_OFFSET"] == 0.0
    assert file.info["time_ref_utc"] == 0
    assert file.info["ver_sw_release"] == 0x010E02FF
    columns = [f"states[{number}]" for number in (0, 16, 17, 18)]
    shown = file.tables.find("estimator_states/0", *columns).numbers(*columns)
    assert shown[:, 0].tolist() == [1.0] * 3
    assert shown[0, 1:].tolist() == [0.0] * 3  # not begun
    assert shown[1, 1:] == pytest.approx(vector_ut(FIELDS.new) / 100.0)
    status = file.tables.find("estimator_status/0")
    shown = status.numbers("mag_inclination_ref_deg", "mag_strength_ref_gs", "mag_strength_gs")[0]
    wanted = (math.degrees(FIELDS.new.dip_rad), FIELDS.new.norm_ut / 100.0, 0.4321)
    assert shown == pytest.approx(wanted, rel=1e-6)
    battery = file.tables.find("battery_status/0").numbers("serial_number", "voltage_v")[0]
    assert battery.tolist() == [0.0, 12.5]
    local = file.tables.find("estimator_aid_src_gnss_pos/0").numbers("observation[0]")
    assert local.tolist() == [46.0] * 3


# --- telemetry ------------------------------------------------------------------------------------


def frames():
    e7 = [round(value * 1e7) for value in OLD]
    metres = [value * DEGREE_M for value in OLD]
    declination_rad = math.radians(OLD_DECLINATION_DEG)
    offsets = mavlink.MAVLink_sensor_offsets_message(1, 2, 3, declination_rad, *[0] * 8)
    return [
        mavlink.MAVLink_param_value_message(b"COMPASS_DEC", declination_rad, 9, 1, 0),
        offsets,
        mavlink.MAVLink_local_position_ned_message(5, *metres, 1.0, 0.0, 0.0, 0.0),
        mavlink.MAVLink_ahrs2_message(0.1, 0.2, 0.3, 4.0, 200, -300),
        mavlink.MAVLink_terrain_report_message(*e7, 100, 431.25, 17.5, 0, 0),
        mavlink.MAVLink_flight_information_message(5, 0, 0, 0x1122334455667788),
        mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3),
    ]


def test_of_telemetry_no_field_of_the_old_place_is_left(tmp_path):
    encoder = Encoder(1, 1)
    stamp = struct.pack(">Q", 1_700_000_000_000_000)
    log = b"".join(stamp + encoder.encode(message) for message in frames())
    path, output = tmp_path / "old.tlog", tmp_path / "new.tlog"
    path.write_bytes(log)
    anonymise_frames(open_recording(path), output, BY)
    wanted = field_traces() + traces(*OLD) + [bytes((0x88, 0x77, 0x66, 0x55))]
    wanted += [struct.pack("<f", value * DEGREE_M) for value in OLD]
    assert len([trace for trace in wanted if trace in log]) > 4
    assert_lacks(output.read_bytes(), wanted)
    deframer = Deframer()
    shown = [
        decode(frame)
        for _, data in open_recording(output).received()
        for frame in deframer.feed(data)
    ]
    assert [type(message).__name__ for message in shown] == [
        "PARAM_VALUE", "SENSOR_OFFSETS", "LOCAL_POSITION_NED", "AHRS2", "FLIGHT_INFORMATION",
        "HEARTBEAT",
    ]  # fmt: skip
    for value in (shown[0].param_value, shown[1].mag_declination):
        assert math.degrees(value) == pytest.approx(NEW_DECLINATION_DEG, abs=0.051)
    assert (shown[2].x / DEGREE_M, shown[2].y / DEGREE_M) == pytest.approx(NEW, abs=1e-4)
    begun = (shown[3].lat / 1e7, shown[3].lng / 1e7)
    assert begun == pytest.approx((NEW[0] + 5.0, NEW[1] + 5.0 * SHRUNK), abs=1e-6)


# --- the rules ------------------------------------------------------------------------------------


def test_the_error_of_a_table_is_not_shown_but_a_wrong_declination_is():
    for off_deg in (-0.4, 0.0, 0.3):
        value = math.radians(OLD_DECLINATION_DEG + off_deg)
        shown_deg = math.degrees(declination(FIELDS, "COMPASS_DEC", value))
        assert shown_deg == pytest.approx(round(NEW_DECLINATION_DEG, 1), abs=1e-9)
    shown_deg = declination(FIELDS, "EKF2_MAG_DECL", OLD_DECLINATION_DEG - 12.3)
    assert shown_deg == pytest.approx(NEW_DECLINATION_DEG - 12.0, abs=0.051)
    assert declination(FIELDS, "EKF2_MAG_DECL", 0.0) == 0.0
    assert declination(FIELDS, "EKF2_DECL_TYPE", 3.0) is None


def test_states_of_the_field_are_the_new_places_with_their_errors_in_microtesla():
    old = np.rint((vector_ut(FIELDS.old) + np.array([3.2, 0.3, -2.6])) * 10.0).astype("<i2")[None]
    shown = states(FIELDS, old, 0.1)
    wanted = np.rint((vector_ut(FIELDS.new) + np.array([3.0, 0.0, -3.0])) * 10.0)
    assert shown.dtype == old.dtype
    assert shown[0].tolist() == wanted.tolist()
    nothing = np.array([[np.nan, 0.1, 0.4], [0.0, 0.0, 0.0], [3.0, 4.0, 5.0]], "<f4")
    assert states(FIELDS, nothing, 100.0) == pytest.approx(nothing, nan_ok=True)


def test_the_fields_are_those_of_both_places_and_dates():
    assert (
        BothFields(
            earth_field_at(*OLD, 0.0, UNIX_S), earth_field_at(*NEW, 0.0, UNIX_S - WEEKS * 604_800)
        )
        == FIELDS
    )
    assert fields_of(None, Elsewhere(NEW, WEEKS), UNIX_S) is None


def test_the_first_fix_may_be_an_error():
    near = Coordinates(OLD.latitude_deg + 1e-4, OLD.longitude_deg)
    assert middle_of([Coordinates(0.001, 0.002), OLD, OLD, near, near]) in (OLD, near)
    assert middle_of([]) is None

"""Logs of flights that were lost, as ArduCopter writes them with its default LOG_BITMASK."""

import math

import numpy as np
from lost_copter import FULL_V, Array, Flown
from made_logs import DataflashWriter

from h2nav.maths.units import DEG, EARTH_RADIUS_M
from h2nav.sim.vehicle import HOME

START_US = 41_000_000
SAMPLED_HZ = 100  # of the columns
MODES = {"STABILIZE": 0, "ACRO": 1, "ALT_HOLD": 2, "AUTO": 3, "GUIDED": 4, "LOITER": 5, "RTL": 6,
         "LAND": 9}  # fmt: skip
PARAMETERS = {
    "FRAME_CLASS": 1.0, "FRAME_TYPE": 0.0, "AHRS_EKF_TYPE": 3.0, "ANGLE_MAX": 3000.0,
    "BATT_LOW_VOLT": 10.5, "BATT_MONITOR": 4.0, "INS_GYRO_FILTER": 20.0, "INS_ACCEL_FILTER": 20.0,
    "MOT_PWM_MIN": 1000.0, "MOT_PWM_MAX": 2000.0, "MOT_SPIN_MIN": 0.15, "MOT_SPIN_MAX": 0.95,
    "MOT_THST_HOVER": 0.39, "RCMAP_ROLL": 1.0, "RCMAP_PITCH": 2.0, "RCMAP_THROTTLE": 3.0,
    "RCMAP_YAW": 4.0, "COMPASS_USE": 1.0, "FS_THR_ENABLE": 1.0, "FS_EKF_ACTION": 1.0,
    "LOG_BITMASK": 180222.0,
}  # fmt: skip


def log_of(flown: Flown, *, imu_hz: int = 25, without: tuple[str, ...] = ()) -> bytes:
    """The log of a flight, with IMUs at a rate, and without some messages."""
    c = flown.columns
    writer = _Writer(without)
    since = np.flatnonzero(c["armed"])
    first = max(int(since[0]) - 100, 0) if len(since) else 0

    def every(hz: float) -> tuple[Array, slice]:
        part = slice(first, None, round(SAMPLED_HZ / hz))
        return (START_US + np.round(c["t_s"][part] * 1e6)).astype(np.int64), part

    _add_head(writer, flown, first)
    _add_imus(writer, c, *every(imu_hz), np.random.default_rng(5))
    _add_control(writer, c, *every(10), flown.motors)
    _add_estimates(writer, c, *every(10))
    _add_gps(writer, c, *every(5))
    return writer.bytes()


class _Writer(DataflashWriter):
    def __init__(self, without: tuple[str, ...]) -> None:
        super().__init__()
        self._without = without

    def add(self, name, letters, columns, t_us, *values):
        if name not in self._without and len(t_us):
            super().add(name, letters, columns, t_us, *values)


def _add_head(writer: _Writer, flown: Flown, first: int) -> None:
    start = np.array([START_US + round(flown.columns["t_s"][first] * 1e6)], np.int64)
    writer.add("MSG", "QBBZ", "TimeUS,ID,Seq,Message", start, 1, 0, b"ArduCopter V4.7.0 (024669e4)")
    frame = {4: b"Frame: QUAD/PLUS", 6: b"Frame: HEXA/PLUS"}[flown.motors]
    writer.add("MSG", "QBBZ", "TimeUS,ID,Seq,Message", start, 2, 0, frame)
    parameters = PARAMETERS | {f"SERVO{n + 1}_FUNCTION": 33.0 + n for n in range(flown.motors)}
    parameters |= {f"SERVO{n}_FUNCTION": 0.0 for n in range(flown.motors + 1, 15)}
    parameters |= flown.parameters
    if flown.motors == 6:
        parameters["FRAME_CLASS"] = 2.0
    names = np.array([name.encode() for name in parameters])
    at_start = np.repeat(start, len(names))
    values = np.array(list(parameters.values()))
    writer.add("PARM", "QNff", "TimeUS,Name,Value,Default", at_start, names, values, values)
    for t_s, kind, what in flown.events:
        t_us = np.maximum(np.array([START_US + round(t_s * 1e6)], np.int64), start)
        if kind == "MSG":
            writer.add("MSG", "QBBZ", "TimeUS,ID,Seq,Message", t_us, 3, 0, what.encode())
        elif kind == "MODE":
            number = MODES[what[0]]
            writer.add("MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn", t_us, number, number, what[1])
        elif kind == "EV":
            writer.add("EV", "QB", "TimeUS,Id", t_us, what)
        elif kind == "ERR":
            writer.add("ERR", "QBB", "TimeUS,Subsys,ECode", t_us, *what)
        elif kind == "ARM":
            columns = "TimeUS,ArmState,ArmChecks,Forced,Method"
            writer.add("ARM", "QBIBB", columns, t_us, what[0], 0, 0, what[1])


def _add_imus(writer: _Writer, c: dict[str, Array], t_us: Array, part: slice, rng) -> None:
    w, f, off = c["w"][part], c["f"][part], c["off"][part]
    columns = "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"
    others = (0, 0, 45.0, 1, 1, 1000, 1000)
    for imu in range(2):
        rates = w - imu * off[:, :3] + 0.002 * rng.standard_normal(w.shape)
        force = f - imu * off[:, 3:] + 0.03 * rng.standard_normal(f.shape)
        writer.add("IMU", "QBffffffIIfBBHH", columns, t_us, imu, *rates.T, *force.T, *others)
    slow = t_us[:: max(1, round(len(t_us) * 1e5 / (t_us[-1] - t_us[0])))]
    at = np.searchsorted(t_us, slow)
    field = np.round(10.0 * c["field"][part][at]).T
    columns = "TimeUS,I,MagX,MagY,MagZ,OfsX,OfsY,OfsZ,MOX,MOY,MOZ,Health,S"
    for compass in range(2):
        values = (*(field + compass), 5, 13, -18, 0, 0, 0, 1, slow)
        writer.add("MAG", "QBhhhhhhhhhBI", columns, slow, compass, *values)
    shake, clip = c["shake"][part][at], c["clip"][part][at]
    columns = "TimeUS,IMU,VibeX,VibeY,VibeZ,Clip"
    for imu in range(2):
        level = 0.3 * shake + 0.2
        writer.add("VIBE", "QBfffI", columns, slow, imu, level, level, level, clip)


def _angles_deg(R: Array) -> Array:
    """(3, N) roll, pitch, yaw."""
    roll = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    pitch = -np.arcsin(np.clip(R[:, 2, 0], -1.0, 1.0))
    yaw = np.arctan2(R[:, 1, 0], R[:, 0, 0]) % math.tau
    return np.degrees(np.stack((roll, pitch, yaw)))


def _quaternions(R: Array) -> Array:
    """(4, N) w, x, y, z."""
    roll, pitch, yaw = 0.5 * np.radians(_angles_deg(R))
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    return np.stack((
        cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy,
    ))  # fmt: skip


def _add_control(
    writer: _Writer, c: dict[str, Array], t_us: Array, part: slice, motors: int
) -> None:
    roll, pitch, yaw = _angles_deg(c["R_est"][part])
    asked = np.degrees(c["asked"][part]).T
    columns = "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,AEKF"
    writer.add(
        "ATT", "QffffffB", columns, t_us, asked[0], roll, asked[1], pitch, asked[2] % 360.0, yaw, 3
    )
    rates, wanted = np.degrees(c["w"][part]).T, np.degrees(c["rates_asked"][part]).T
    throttle = c["throttle"][part]
    columns = "TimeUS,RDes,R,ROut,PDes,P,POut,YDes,Y,YOut,ADes,A,AOut,AOutSlew"
    writer.add(
        "RATE", "Qfffffffffffff", columns, t_us, wanted[0], rates[0], 0, wanted[1], rates[1], 0,
        wanted[2], rates[2], 0, 0, 0, throttle, 0,
    )  # fmt: skip
    pwm = np.zeros((14, len(t_us)))
    pwm[:motors] = np.round(1000.0 + 1000.0 * c["output"][part].T)
    channels = ",".join(f"C{n}" for n in range(1, 15))
    writer.add("RCOU", "QHHHHHHHHHHHHHH", f"TimeUS,{channels}", t_us, *pwm)
    sticks = c["sticks"][part].T
    pwm = np.zeros((14, len(t_us)))
    pwm[0], pwm[1], pwm[3] = (1500.0 + 500.0 * sticks[k] for k in (0, 1, 2))
    pwm[2] = 1000.0 + 1000.0 * sticks[3]
    pwm[2] = np.where(c["link"][part], pwm[2], 950.0)
    writer.add("RCIN", "QHHHHHHHHHHHHHH", f"TimeUS,{channels}", t_us, *np.round(pwm))
    height, baro = -c["p_est"][part, 2], c["baro"][part]
    columns = "TimeUS,ThI,ABst,ThO,ThH,DAlt,Alt,BAlt,DSAlt,SAlt,TAlt,DCRt,CRt"
    climb = np.round(-100.0 * c["v_est"][part, 2])
    writer.add(
        "CTUN", "Qffffffffffhh", columns, t_us, sticks[3], 0, throttle, 0.39,
        c["height_asked"][part], height, baro, np.nan, 0, np.nan,
        np.round(100.0 * c["climb_asked"][part]), climb,
    )  # fmt: skip
    volts, amps, used = c["volts"][part], c["amps"][part], c["mah"][part]
    columns = "TimeUS,Inst,Volt,VoltR,Curr,CurrTot,EnrgTot,Temp,Res,RemPct,H,SH"
    left = np.clip(100.0 - used / 33.0, 0.0, 100.0)
    writer.add(
        "BAT", "QBfffffcfBBB", columns, t_us, 0, volts, FULL_V, amps, used, 0, 0, 0.01, left, 1, 0
    )
    columns = "TimeUS,I,Alt,AltAMSL,Press,Temp,CRt,SMS,Offset,GndTemp,H,CPress"
    rate = np.gradient(baro, 1e-6 * (t_us - t_us[0]))
    writer.add(
        "BARO",
        "QBfffcfIffBf",
        columns,
        t_us,
        0,
        baro,
        baro + HOME.altitude_m,
        95000.0,
        30.0,
        rate,
        t_us // 1000,
        0,
        28.5,
        1,
        95000.0,
    )
    latitude, longitude, altitude = _place(c["p_est"][part])
    writer.add(
        "POS",
        "QLLfff",
        "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt",
        t_us,
        latitude,
        longitude,
        altitude,
        height,
        height,
    )


def _add_estimates(writer: _Writer, c: dict[str, Array], t_us: Array, part: slice) -> None:
    angles, q = _angles_deg(c["R_est"][part]), _quaternions(c["R_est"][part])
    v, p = c["v_est"][part].T, c["p_est"][part].T
    ratio, gap = np.minimum(c["ratios"][part].T, 2.5), c["innovation"][part].T
    columns = "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH"
    for core in range(2):
        writer.add(
            "XKF1",
            "QBccCfffffffccce",
            columns,
            t_us,
            core,
            *angles,
            *v,
            v[2],
            *p,
            0,
            0,
            0,
            HOME.altitude_m,
        )
        innovations = (
            *np.clip(gap[:3], -300, 300),
            *np.clip(gap[3:6], -300, 300),
            0,
            0,
            0,
            np.degrees(gap[6]),
            0,
            0.1,
            0.0,
        )
        writer.add(
            "XKF3",
            "QBcccccchhhccff",
            "TimeUS,C,IVN,IVE,IVD,IPN,IPE,IPD,IMX,IMY,IMZ,IYAW,IVT,RErr,ErSc",
            t_us,
            core,
            *innovations,
        )
        writer.add(
            "XKF4",
            "QBcccccfffHBIHb",
            "TimeUS,C,SV,SP,SH,SM,SVT,errRP,OFN,OFE,FS,TS,SS,GPS,PI",
            t_us,
            core,
            ratio[0],
            ratio[1],
            ratio[2],
            ratio[3],
            0,
            0.01,
            0,
            0,
            0,
            48,
            107327,
            0,
            0,
        )
        writer.add("XKQ", "QBffff", "TimeUS,C,Q1,Q2,Q3,Q4", t_us, core, *q)
    writer.add(
        "AHR2",
        "QccCfLLffff",
        "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4",
        t_us,
        *angles,
        0,
        0,
        0,
        *q,
    )


def _place(p: Array) -> tuple[Array, Array, Array]:
    parallel = EARTH_RADIUS_M * math.cos(HOME.latitude_deg * DEG)
    return (
        HOME.latitude_deg + p[:, 0] / EARTH_RADIUS_M / DEG,
        HOME.longitude_deg + p[:, 1] / parallel / DEG,
        HOME.altitude_m - p[:, 2],
    )


def _add_gps(writer: _Writer, c: dict[str, Array], t_us: Array, part: slice) -> None:
    latitude, longitude, altitude = _place(c["fix_p"][part])
    v, has = c["fix_v"][part], c["has_fix"][part]
    speed, course = np.hypot(v[:, 0], v[:, 1]), np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360.0
    columns = "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U"
    status, satellites = np.where(has, 3, 1), np.where(has, 12, 2)
    week_ms = 172_900_000 + (t_us - t_us[0]) // 1000
    writer.add(
        "GPS",
        "QBBIHBcLLeffffB",
        columns,
        t_us,
        0,
        status,
        week_ms,
        2446,
        satellites,
        0.9,
        latitude,
        longitude,
        altitude,
        speed,
        course,
        v[:, 2],
        0,
        1,
    )
    columns = "TimeUS,I,VDop,HAcc,VAcc,SAcc,YAcc,VV,SMS,Delta,AEl,RTCMFU,RTCMFD"
    writer.add(
        "GPA",
        "QBCCCCfBIHeHH",
        columns,
        t_us,
        0,
        1.2,
        0.5,
        0.8,
        0.3,
        0.0,
        1,
        t_us // 1000,
        200,
        altitude,
        0,
        0,
    )

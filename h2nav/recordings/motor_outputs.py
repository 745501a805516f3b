"""Finds the outputs of an autopilot that drive motors, and their range.

Sources: ArduPilot's SRV_Channel.h (functions 33 to 40 and 82 to 85) and AP_MotorsMulticopter.cpp
(`output_to_pwm`, MOT_SPIN_MAX; 2015 MOT_THST_MAX; before, MOT_TCRV_MAXPCT); PX4's output functions
(101 to 112).
"""

from collections.abc import Mapping, Sequence

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.recordings.context import Array, Motors, OutputBank, Series

# Number of motors of each MAV_TYPE that flies by motors alone.
MULTIROTORS = {
    mavlink.MAV_TYPE_TRICOPTER: 3,
    mavlink.MAV_TYPE_QUADROTOR: 4,
    mavlink.MAV_TYPE_HEXAROTOR: 6,
    mavlink.MAV_TYPE_OCTOROTOR: 8,
    mavlink.MAV_TYPE_DECAROTOR: 10,
    mavlink.MAV_TYPE_DODECAROTOR: 12,
}
# Vehicles that neither take off nor land.
ON_THE_GROUND = (
    mavlink.MAV_TYPE_GROUND_ROVER,
    mavlink.MAV_TYPE_SURFACE_BOAT,
    mavlink.MAV_TYPE_SUBMARINE,
)
ARDUPILOT_MOTORS = {**{33 + i: 1 + i for i in range(8)}, **{82 + i: 9 + i for i in range(4)}}
PX4_MOTORS = {101 + i: 1 + i for i in range(12)}
PX4_BANKS = (
    "PWM_MAIN_FUNC",
    "PWM_AUX_FUNC",
    "UAVCAN_EC_FUNC",
    "HIL_ACT_FUNC",
    "SIM_GZ_EC_FUNC",
)
# The range of outputs without a pulse width; of PX4's without parameters.
MIN_PWM_US, MAX_PWM_US = 1000.0, 2000.0
CAN_FULL = 8191.0  # of uavcan.equipment.esc.RawCommand
# Pulse widths that a motor controller accepts; unused channels show others.
NARROWEST_US, WIDEST_US = 800.0, 2300.0
# Unused channels of old logs hold random memory, and never change.
MOVING_US = 5.0


def ardupilot_channels(
    parameters: Mapping[str, float], vehicle_type: int, pwm_us: Array
) -> dict[int, int]:
    """LogColumn of the outputs, from 0 -> number of its motor, from 1; empty for other vehicles.

    Args:
        parameters: their values at the beginning.
        vehicle_type: MAV_TYPE.
        pwm_us: (N, k) all outputs.
    """
    count = MULTIROTORS.get(vehicle_type, 0)
    if not count:
        return {}
    functions = {i: parameters.get(f"SERVO{i + 1}_FUNCTION") for i in range(pwm_us.shape[1])}
    if any(function is not None for function in functions.values()):
        pairs = ((i, int(value)) for i, value in functions.items() if value is not None)
        return {i: ARDUPILOT_MOTORS[value] for i, value in pairs if value in ARDUPILOT_MOTORS}
    # Until 2016 motors used the first channels, and only the firmware knew how many.
    free = [i for i in range(count, 8) if not parameters.get(f"RC{i + 1}_FUNCTION", 0.0)]
    more = [i for i in free if i < pwm_us.shape[1] and _drives_a_motor(pwm_us[:, i])]
    known = range(min(count, pwm_us.shape[1]))
    return {i: i + 1 for i in (*known, *(more if len(more) in (2, 4) else ()))}


def _drives_a_motor(pwm_us: Array) -> bool:
    is_width = (pwm_us >= NARROWEST_US) & (pwm_us <= WIDEST_US)
    return bool(is_width.all() and len(pwm_us) and np.std(pwm_us) > MOVING_US)


def px4_channels(parameters: Mapping[str, float], vehicle_type: int) -> list[dict[int, int]]:
    """The same of PX4: one for each bank of outputs that drives motors by its parameters.

    Until 1.12 a mixer drove the motors with the first outputs, on whichever bank it was loaded.
    """
    found = []
    for bank in PX4_BANKS:
        functions = {i: int(parameters.get(f"{bank}{i + 1}", 0.0)) for i in range(16)}
        found.append({i: PX4_MOTORS[f] for i, f in functions.items() if f in PX4_MOTORS})
    by_mixer = {i: i + 1 for i in range(MULTIROTORS.get(vehicle_type, 0))}
    return [channels for channels in found if channels] or [by_mixer]


def px4_motors(
    banks: Sequence[OutputBank], parameters: Mapping[str, float], vehicle_type: int
) -> Motors | None:
    """The motors of a multirotor of PX4, from the bank of outputs that drives them.

    A log names no banks: px4io, the FMU's own pins and CAN each have one, in the order in which
    their drivers started. The bank of the motors is the first whose outputs for motors move; where
    none moves, the first with anything else than zeros.

    Args:
        banks: all outputs, in the order of their instances.
        parameters: of the autopilot.
        vehicle_type: MAV_TYPE.
    """
    choices = [
        (bank, channels)
        for bank in banks
        for channels in px4_channels(parameters, vehicle_type)
        if channels and max(channels) < bank.values.shape[1]
    ]
    moving = (each for each in choices if _moves(*each))
    filled = (each for each in choices if np.nan_to_num(each[0].values[:, list(each[1])]).any())
    chosen = next(moving, None) or next(filled, None)
    if chosen is None:
        return None
    bank, channels = chosen
    if np.nanmax(bank.values[:, list(channels)]) > WIDEST_US:  # of a motor controller on CAN
        pwm_us = MIN_PWM_US + (MAX_PWM_US - MIN_PWM_US) * bank.values / CAN_FULL
        return motors_of(channels, bank.t_s, pwm_us, (MIN_PWM_US, MAX_PWM_US))
    least = parameters.get("PWM_MAIN_MIN") or parameters.get("PWM_MIN") or MIN_PWM_US
    most = parameters.get("PWM_MAIN_MAX") or parameters.get("PWM_MAX") or MAX_PWM_US
    return motors_of(channels, bank.t_s, bank.values, (least, most))


def motors_by_share(shares: Series) -> Motors | None:
    """PX4's motors by number since 1.13: (N, k) shares of their range, NaN where there is none."""
    used = np.flatnonzero(np.isfinite(shares.values).any(axis=0)).tolist()
    pwm_us = MIN_PWM_US + (MAX_PWM_US - MIN_PWM_US) * shares.values
    return motors_of({i: i + 1 for i in used}, shares.t_s, pwm_us, (MIN_PWM_US, MAX_PWM_US))


def _moves(bank: OutputBank, channels: Mapping[int, int]) -> bool:
    values = bank.values[:, list(channels)]
    return bool((np.nanstd(values, axis=0) > MOVING_US).all())


def ardupilot_range(parameters: Mapping[str, float]) -> tuple[float, float]:
    """Pulse widths of a motor at rest and of the largest output, microseconds."""
    least = parameters.get("MOT_PWM_MIN") or parameters.get("RC3_MIN") or 1000.0
    most = parameters.get("MOT_PWM_MAX") or parameters.get("RC3_MAX") or 2000.0
    share = parameters.get("MOT_SPIN_MAX") or parameters.get("MOT_THST_MAX", 0.0)
    if not share and parameters.get("MOT_TCRV_ENABLE"):
        percent = parameters.get("MOT_TCRV_MXPCT") or parameters.get("MOT_TCRV_MAXPCT", 100.0)
        share = 0.01 * percent
    share = share if 0.5 <= share <= 1.0 else 1.0
    return least, least + share * (most - least)


def motors_of(
    channels: Mapping[int, int], t_s: Array, pwm_us: Array, ends_us: tuple[float, float]
) -> Motors | None:
    """The columns of motors, in the order of their numbers; None without any.

    Args:
        channels: column -> number of the motor.
        t_s: (N,) times.
        pwm_us: (N, k) all outputs.
    """
    chosen = sorted((n, i) for i, n in channels.items() if i < pwm_us.shape[1])
    if not chosen or not len(t_s):
        return None
    values = pwm_us[:, [i for _, i in chosen]].astype(np.float64)
    values[~((values >= 1.0) & (values <= WIDEST_US))] = np.nan
    return Motors(tuple(n for n, _ in chosen), t_s, values, *ends_us)

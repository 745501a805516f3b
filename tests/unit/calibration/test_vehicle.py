"""The document of a calibration, and who may be calibrated together."""

import math

import numpy as np
import pytest

from h2nav.calibration import vehicle
from h2nav.calibration.outcome import Calibration, Outcome, ParameterChange
from h2nav.calibration.settings import Lever
from h2nav.calibration.vehicle import document_of
from h2nav.errors import BadInput
from h2nav.recordings.context import CompassTrack, Context, GpsTrack, Series
from tests.unit.calibration.logs import evidence_of_log, imu_track

CHANGE = ParameterChange("COMPASS_OFS_X", 1.0, 2.0, 0.5)
CHOICE = ParameterChange("COMPASS_ORIENT", math.nan, 4.0)


def test_the_document_has_null_for_what_is_unknown():
    wind = Series(np.arange(501) * 0.123456, np.outer(np.arange(501), (0.001, -1.0)))
    made = Calibration(
        "ArduPilot", "V4.5", ("a.bin", "b.bin"),
        (
            Outcome("compass 1", "97539", (CHANGE, CHOICE), ("left",), ("note",), "shown",
                    {"a": 1.5, "b": math.inf}),
            Outcome("drag", wind_n_m_s=wind),
        ),
    )  # fmt: skip
    found = document_of(made)
    compass, drag = found.pop("sensors")
    assert found == {"autopilot": "ArduPilot", "firmware": "V4.5", "flights": ["a.bin", "b.bin"]}
    assert compass == {
        "sensor": "compass 1",
        "device": "97539",
        "changes": [
            {"name": "COMPASS_OFS_X", "old": 1.0, "new": 2.0, "sigma": 0.5},
            {"name": "COMPASS_ORIENT", "old": None, "new": 4.0, "sigma": None},
        ],
        "not_from_these_flights": ["left"],
        "notes": ["note"],
        "shown_by": "shown",
        "figures": {"a": 1.5, "b": None},
    }
    assert {name: len(values) for name, values in drag["wind"].items()} == {
        "t_s": 500, "north_m_s": 500, "east_m_s": 500,
    }  # fmt: skip
    assert drag["wind"]["t_s"][1] == 0.12
    assert drag["wind"]["north_m_s"][-1] == 0.5
    assert drag["wind"]["east_m_s"][-1] == -500.0


def test_a_parameter_of_several_sensors_changes_once():
    again = CHANGE._replace(new=7.0)
    made = Calibration(
        "", "", (), (Outcome("1", changes=(CHANGE, CHOICE)), Outcome("2", changes=(again,)))
    )
    assert made.changes == (again, CHOICE)


def flight(parameters, name="a.bin", kind="dataflash", context=None):
    evidence = evidence_of_log(context or Context(), parameters, kind=kind)
    return evidence._replace(flight=evidence.flight._replace(file=name))


@pytest.mark.parametrize(
    ("one", "other", "kind", "why"),
    [
        ({"COMPASS_DEV_ID": 1.0}, {"COMPASS_DEV_ID": 1.0}, "dataflash", ""),
        ({"COMPASS_DEV_ID": 1.0}, {}, "dataflash", ""),
        ({"COMPASS_OFS_X": 1.0, "X_ID": 1.0}, {"COMPASS_OFS_X": 2.0, "X_ID": 2.0}, "dataflash", ""),
        ({"INS_ACC_ID": 1.0}, {"INS_ACC_ID": 2.0}, "dataflash", ""),
        ({"CAL_MAG0_ID": 1.0}, {"CAL_MAG0_ID": 2.0}, "dataflash", "CAL_MAG0_ID differs"),
        (
            {"COMPASS_DEV_ID2": 1.0},
            {"COMPASS_DEV_ID2": 2.0},
            "dataflash",
            "COMPASS_DEV_ID2 differs",
        ),
        ({}, {}, "ulog", "their autopilots differ"),
    ],
)
def test_flights_are_of_one_vehicle(one, other, kind, why):
    flights = [flight(one), flight(other, "b.log", kind)]
    if not why:
        vehicle._need_one_vehicle(flights)
        return
    with pytest.raises(BadInput) as caught:
        vehicle._need_one_vehicle(flights)
    assert str(caught.value) == (
        f"b.log: not the vehicle of a.bin: {why}; give flights of one vehicle"
    )


def compasses(*numbers):
    nothing = np.zeros((2, 3))
    tracks = [CompassTrack(n, 0, np.zeros(2), nothing, nothing, nothing) for n in numbers]
    return Context(compasses=tuple(tracks))


@pytest.mark.parametrize(
    ("parameters", "kind", "levers"),
    [
        ({}, "dataflash", (Lever.THROTTLE, Lever.CURRENT)),
        ({"COMPASS_MOTCT": 0.0}, "dataflash", (Lever.THROTTLE, Lever.CURRENT)),
        ({"COMPASS_MOTCT": 2.0}, "dataflash", (Lever.CURRENT,)),
        ({"COMPASS_MOTCT": 1.0}, "dataflash", (Lever.THROTTLE,)),
        ({"CAL_MAG_COMP_TYP": 1.0}, "ulog", (Lever.THROTTLE,)),
        ({"CAL_MAG_COMP_TYP": 1.0}, "dataflash", (Lever.THROTTLE, Lever.CURRENT)),
    ],
)
def test_the_lever_in_use_is_that_of_all_compasses(monkeypatch, parameters, kind, levers):
    asked = []

    def calibrated(flights, number, those):
        asked.append((number, those))
        return Outcome(f"{number}")

    monkeypatch.setattr(vehicle, "calibrate_compass", calibrated)
    flights = [
        flight({"COMPASS_MOTCT": 1.0}, context=compasses(2, 0)),
        flight(parameters, kind=kind, context=compasses(0)),
    ]
    assert [one.sensor for one in vehicle._compasses(flights)] == ["0", "2"]
    assert asked == [(0, levers), (2, levers)]


def test_compasses_that_ask_for_different_levers_get_that_of_most(monkeypatch):
    wanted = {0: 1.0, 1: 2.0, 2: 2.0}
    asked = []

    def calibrated(flights, number, those):
        asked.append((number, those))
        new = wanted[number] if len(those) > 1 else float(those[0])
        return Outcome(f"{number}", changes=(ParameterChange("COMPASS_MOTCT", 0.0, new),))

    monkeypatch.setattr(vehicle, "calibrate_compass", calibrated)
    found = vehicle._compasses([flight({}, context=compasses(0, 1, 2))])
    assert {one.changes[0].new for one in found} == {2.0}
    assert [those for _, those in asked] == [(Lever.THROTTLE, Lever.CURRENT)] * 3 + [
        (Lever.CURRENT,)
    ] * 3
    asked.clear()
    wanted[0] = 2.0
    vehicle._compasses([flight({}, context=compasses(0, 1, 2))])
    assert len(asked) == 3


def test_board_and_receivers_are_by_the_surest_accelerometer(monkeypatch):
    """One that measures nothing is the SCALED_IMU3 of a lone compass."""
    sigmas = {0: 0.3, 1: 0.1}
    made = {
        "calibrate_accelerometer": lambda t: vehicle_forces(t.imu, sigmas[t.imu]),
        "calibrate_gyro": lambda t: Outcome(f"gyro {t.imu}"),
        "calibrate_level": lambda t, forces: Outcome(f"level {t.imu} {forces.sigma}"),
        "calibrate_receiver": lambda t, number: Outcome(f"receiver {number} by {t.imu}"),
    }
    for name, function in made.items():
        monkeypatch.setattr(vehicle, name, function)
    ones, zeros = np.ones((4, 3)), np.zeros((4, 3))
    imus = tuple(imu_track(ones, f_b)._replace(imu=n) for n, f_b in enumerate((ones, ones, zeros)))
    nothing = np.zeros(0)
    gps = tuple(
        GpsTrack(n, nothing, nothing > 0, *[nothing] * 3, np.zeros((0, 3)), nothing, nothing)
        for n in (1, 0)
    )
    found = vehicle._of_imus([flight({}, context=Context(imus=imus, gps=gps))])
    assert [one.sensor for one in found] == [
        "accelerometer 0", "accelerometer 1", "gyro 0", "gyro 1", "level 1 0.1",
        "receiver 0 by 1", "receiver 1 by 1",
    ]  # fmt: skip
    assert vehicle._of_imus([flight({})]) == []


def vehicle_forces(number, sigma):
    from h2nav.calibration.imu import Forces

    return Forces(Outcome(f"accelerometer {number}"), np.zeros(3), sigma)

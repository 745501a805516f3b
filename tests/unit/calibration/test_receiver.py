"""When a delay or an antenna is set, and the words where it is not."""

import numpy as np
import pytest

from h2nav.calibration import receiver
from h2nav.calibration.motion_fit import COUNT, MotionFit
from h2nav.calibration.motion_rows import Motion
from h2nav.calibration.outcome import ParameterChange
from h2nav.recordings.context import Context
from tests.unit.calibration.logs import evidence_of_log

DELAY, X, Y = range(3)


def decided(which, value, sigma=1e-3, apart=0.0, *, number=0, kind="dataflash", **parameters):
    last = evidence_of_log(Context(), parameters, kind=kind)
    quantity = receiver._quantities(last.autopilot)[which]
    return receiver._change(quantity, last, number, (value, sigma, apart))


@pytest.mark.parametrize(
    ("which", "value", "sigma", "apart", "parameters", "found"),
    [
        (DELAY, 150.0, 12.6, 0.0, {"GPS1_DELAY_MS": 90.0}, ": too uncertain"),
        (DELAY, 160.0, 12.4, 50.1, {"GPS1_DELAY_MS": 90.0}, ": the halves of the flight disagree"),
        (DELAY, 160.0, 12.4, 49.9, {"GPS1_DELAY_MS": 90.0}, 160.0),
        (DELAY, 160.0, 1.0, 0.0, {}, ": its parameters are not in the recording (--parameters)"),
        (DELAY, 139.0, 1.0, 0.0, {"GPS1_DELAY_MS": 90.0}, ": as set"),
        (DELAY, 141.0, 1.0, 0.0, {"GPS1_DELAY_MS": 90.0}, 141.0),
        # five deviations
        (DELAY, 151.0, 12.4, 0.0, {"GPS1_DELAY_MS": 90.0}, ": as set"),
        (DELAY, 153.0, 12.4, 0.0, {"GPS1_DELAY_MS": 90.0}, 153.0),
        # what ArduPilot assumes by itself
        (DELAY, 51.0, 1.0, 0.0, {"GPS1_DELAY_MS": 0.0}, ": the autopilot's default"),
        (DELAY, 249.0, 1.0, 0.0, {"GPS1_DELAY_MS": 0.0}, ": the autopilot's default"),
        (DELAY, 250.0, 1.0, 0.0, {"GPS1_DELAY_MS": 0.0}, 250.0),
        (DELAY, 50.0, 1.0, 0.0, {"GPS1_DELAY_MS": 0.0}, 50.0),
        (DELAY, 251.0, 1.0, 0.0, {"GPS1_DELAY_MS": 100.0}, ": beyond the firmware's limit"),
        (DELAY, -1.0, 1.0, 0.0, {"GPS1_DELAY_MS": 100.0}, ": beyond the firmware's limit"),
        (X, 0.3, 0.038, 0.0, {"GPS1_POS_X": 0.0}, ": too uncertain"),
        (X, 0.3, 0.037, 0.151, {"GPS1_POS_X": 0.0}, ": the halves of the flight disagree"),
        (X, 0.3, 0.037, 0.149, {"GPS1_POS_X": 0.0}, 0.3),
        (X, 0.149, 0.01, 0.0, {"GPS1_POS_X": 0.0}, ": as set"),
        (X, -0.151, 0.01, 0.0, {"GPS1_POS_X": 0.0}, -0.151),
        (Y, 1.99, 0.01, 0.0, {"GPS1_POS_Y": 0.0}, 1.99),
        (Y, -2.01, 0.01, 0.0, {"GPS1_POS_Y": 0.0}, ": beyond the firmware's limit"),
        # from where the IMU sits
        (Y, 0.3, 0.01, 0.0, {"GPS1_POS_Y": 0.0, "INS_POS1_Y": 0.2}, 0.5),
        (Y, 0.3, 0.01, 0.0, {"GPS1_POS_Y": 0.0, "INS_POS1_X": 0.2}, 0.3),
    ],
)
def test_a_value_is_set_if_it_is_certain_lasting_relevant_and_possible(
    which, value, sigma, apart, parameters, found
):
    change = decided(which, value, sigma, apart, **parameters)
    if isinstance(found, str):
        what = ("delay_ms", "antenna_x_m", "antenna_y_m")[which]
        assert change == f"{what} {value:.3g} ± {sigma:.2g}{found}"
    else:
        (name, old) = next(iter(parameters.items()))
        assert change == ParameterChange(name, old, pytest.approx(found), sigma)


def test_px4_has_names_limits_and_defaults_of_its_own():
    assert decided(DELAY, 299.0, kind="ulog", EKF2_GPS_DELAY=110.0)[0] == "EKF2_GPS_DELAY"
    beyond = decided(DELAY, 301.0, kind="ulog", EKF2_GPS_DELAY=110.0)
    assert beyond.endswith("beyond the firmware's limit")
    # its 0 is a delay of 0
    assert decided(DELAY, 110.0, kind="ulog", EKF2_GPS_DELAY=0.0).new == 110.0
    own = {"EKF2_GPS_POS_X": 0.0, "EKF2_IMU_POS_X": 0.1, "GPS1_POS_X": 7.0}
    assert decided(X, 0.4, kind="ulog", **own)[:3] == ("EKF2_GPS_POS_X", 0.0, 0.5)


@pytest.mark.parametrize(
    ("number", "known", "name"),
    [
        (0, ("GPS1_DELAY_MS", "GPS_DELAY_MS"), "GPS1_DELAY_MS"),
        (0, ("GPS_DELAY_MS", "GPS2_DELAY_MS"), "GPS_DELAY_MS"),
        (1, ("GPS_DELAY_MS", "GPS2_DELAY_MS"), "GPS2_DELAY_MS"),
        (1, ("GPS_DELAY_MS2",), "GPS_DELAY_MS2"),
        (1, ("GPS1_DELAY_MS",), None),
        (2, ("GPS1_DELAY_MS", "GPS2_DELAY_MS"), None),
    ],
)
def test_parameters_of_each_receiver_by_the_names_of_all_years(number, known, name):
    found = decided(DELAY, 200.0, number=number, **dict.fromkeys(known, 100.0))
    assert (found[0] == name) if name else found.endswith("not in the recording (--parameters)")


def test_values_are_in_the_units_of_their_parameters():
    """The delay is what was assumed and what was found beside it."""
    values, lasting = np.zeros(COUNT), np.zeros(COUNT)
    values[6:9], lasting[6:9] = (0.03, 0.4, -0.5), (0.004, 0.05, 0.06)
    fit = MotionFit(values, np.zeros((COUNT, COUNT)), lasting, np.ones(1), np.zeros((1, 3)))
    found = [receiver._of(q, Motion(None, 0.12, True), fit) for q in receiver._quantities("PX4")]
    assert found == [
        pytest.approx((150.0, 4.0)),
        pytest.approx((0.4, 0.05)),
        pytest.approx((-0.5, 0.06)),
    ]

"""Numbers of ArduPilot's errors: each concerns what its name in AP_Logger.h says."""

import pytest

from h2nav.recordings.dataflash_errors import said_of_error, subsystem_of

# LogErrorSubsystem, in its order from 1; None where ArduPilot has no error that is of use here.
NAMED = (
    None,  # MAIN
    ("radio", "radio"),
    ("compass", "compass"),
    ("optical flow", "other"),
    ("radio failsafe", "radio"),
    ("battery failsafe", "battery"),
    ("GPS failsafe", "gps"),
    ("ground station failsafe", "ground_station"),
    ("fence", "fence"),
    ("flight mode: 1", "flight_mode"),
    ("GPS", "gps"),
    ("crash detected", "crash_check"),
    ("flip", "other"),
    None,  # AUTOTUNE
    ("parachute", "other"),
    ("EKF check", "ekf"),
    ("EKF failsafe", "ekf"),
    ("barometer", "barometer"),
    ("CPU", "other"),
    ("ADSB failsafe", "other"),
    ("terrain", "terrain"),
    ("navigation", "other"),
    ("terrain failsafe", "terrain"),
    ("EKF primary changed: 1", "ekf"),
    ("thrust loss check", "thrust_loss"),
    ("sensor failsafe", "failsafe"),
    ("leak failsafe", "other"),
    ("pilot's input", "other"),
    ("vibration failsafe", "vibration"),
    ("internal error", "other"),
    ("dead reckoning failsafe", "gps"),
    None,
)


@pytest.mark.parametrize(("number", "named"), list(enumerate(NAMED, 1)))
def test_the_first_error_of_each_subsystem(number: int, named: tuple[str, str] | None):
    if named is None:
        assert (said_of_error(number, 1), subsystem_of(number)) == ("", "other")
    elif number == 3:
        assert (said_of_error(3, 2), subsystem_of(3)) == ("compass: 2", "compass")
    else:
        assert (said_of_error(number, 1), subsystem_of(number)) == named


@pytest.mark.parametrize(
    ("error", "text"),
    [
        ((3, 1), "compass failed to start"),
        ((3, 4), "compass unhealthy"),
        ((2, 2), "radio frame late"),
        ((11, 2), "GPS glitch"),
        ((11, 4), "GPS unhealthy"),
        ((12, 2), "loss of control"),
        ((13, 2), "flip abandoned"),
        ((16, 2), "EKF variance"),
        ((18, 2), "barometer glitch"),
        ((18, 4), "barometer unhealthy"),
        ((11, 0), "GPS: over"),
    ],
)
def test_errors_with_a_meaning_of_their_own(error: tuple[int, int], text: str):
    assert said_of_error(*error) == text

"""Flights that are made up here: what an autopilot sends, and what a service would say to it."""

import math
from pathlib import Path

import numpy as np
import pytest
from needs import DEG
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.errors import BadInput
from h2nav.evaluation.flights.events import parse_phase, phases_of, read_events
from h2nav.evaluation.flights.flight import FlightTask
from h2nav.evaluation.flights.heard import FromAutopilot, FromService, HeardFlight
from h2nav.evaluation.flights.scores import (
    SETTLED_S,
    FlightScore,
    flight_paths,
    mean,
    score_flight,
)
from h2nav.evaluation.flights.truth import read_truth
from h2nav.integrity.findings import Severity
from h2nav.maths import quaternion
from h2nav.wire import codec
from h2nav.wire.deframer import Deframer

START_S = 1_000.0
BOOT_S = 20.0  # the autopilot's time at the start of the recording
DURATION_S = 100.0
YAW_RATE = 5.0 * DEG
HEADER = "t_us,q_w,q_x,q_y,q_z,ekf2_q_w,ekf2_q_x,ekf2_q_y,ekf2_q_z"


class MadeUp:
    """A flight of a vehicle that turns slowly, heard message by message."""

    def __init__(self, *, has_simstate: bool = True) -> None:
        self.autopilot = FromAutopilot()
        self.runs = {"h2nav": FromService(self.autopilot, listens=True)}
        self.has_simstate = has_simstate
        self._encoder, self._deframer = codec.Encoder(1, 1), Deframer()

    def __call__(self, path: Path) -> HeardFlight:
        return HeardFlight(self.autopilot, self.runs)

    def hears(self, t_s: float, message) -> None:
        (frame,) = self._deframer.feed(self._encoder.encode(message))
        self.autopilot.frame(self.ns(t_s), frame)

    @staticmethod
    def ns(t_s: float) -> int:
        return round((START_S + t_s) * 1e9)

    def truth(self, t_s: float) -> None:
        self.autopilot.time(self.ns(t_s))
        if self.has_simstate:
            self.hears(t_s, mavlink.MAVLink_simstate_message(*true_angles(t_s), *[0] * 8))

    def ekf(self, t_s: float, error_rad: float, boot_s: float) -> None:
        roll, pitch, yaw = true_angles(t_s)
        angles = (roll, pitch, yaw + error_rad)
        self.hears(t_s, mavlink.MAVLink_attitude_message(round(boot_s * 1e3), *angles, 0, 0, 0))

    def estimate(self, t_s, rotation, *, boot_s=None, sigma_tilt=1.0, sigma_heading=1.0) -> None:
        """An estimate that is wrong by a rotation vector (NED, rad)."""
        q = quaternion.multiply(quaternion.exp(rotation), true_attitude(t_s))
        boot_us = round((BOOT_S + t_s if boot_s is None else boot_s) * 1e6)
        nothing, sigmas = (0.0, 0.0, 0.0), (math.radians(sigma_tilt), math.radians(sigma_heading))
        estimate = AttitudeEstimate(
            boot_us, q, nothing, nothing, nothing, sigmas[0], Trust(0), sigmas[1]
        )
        self.runs["h2nav"].estimate(self.ns(t_s), estimate, 0)

    def armed(self, t_s: float, is_armed: bool) -> None:
        mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if is_armed else 0
        self.hears(t_s, mavlink.MAVLink_heartbeat_message(2, 3, mode, 0, 0, 3))

    def landed(self, t_s: float, is_landed: bool) -> None:
        self.hears(t_s, mavlink.MAVLink_extended_sys_state_message(0, 1 if is_landed else 2))


def true_angles(t_s: float) -> tuple[float, float, float]:
    return 0.0, 0.0, math.remainder(YAW_RATE * t_s, 2.0 * math.pi)


def true_attitude(t_s: float):
    return quaternion.from_euler(*true_angles(t_s))


def times(step_s: float = 0.05, end_s: float = DURATION_S) -> list[float]:
    return [number * step_s for number in range(round(end_s / step_s) + 1)]


def made(rotation_at, *, sigmas=(1.0, 1.0)) -> MadeUp:
    flight = MadeUp()
    for t_s in times():
        flight.truth(t_s)
        flight.ekf(t_s, 2.0 * DEG, BOOT_S + t_s)
        flight.estimate(t_s, rotation_at(t_s), sigma_tilt=sigmas[0], sigma_heading=sigmas[1])
    return flight


def scored(flight: MadeUp, path: Path = Path("flight.tlog"), **more) -> FlightScore:
    return score_flight(FlightTask(path, path.stem, flight, **more))


def document(flight: MadeUp, path: Path = Path("flight.tlog"), **more) -> dict:
    score = scored(flight, path, **more)
    assert score.document, score.remark
    return score.document


# --- errors -----------------------------------------------------------------------------------


def test_a_known_error_is_found():
    figures = document(made(lambda t_s: (3.0 * DEG, 4.0 * DEG, 0.0)))["whole"]
    assert figures["h2nav"]["tilt"] == pytest.approx(5.0, abs=1e-4)
    assert figures["h2nav"]["total"] == pytest.approx(5.0, abs=1e-4)
    assert figures["h2nav"]["heading"] == pytest.approx(0.0, abs=1e-4)
    assert figures["ekf"]["tilt"] == pytest.approx(0.0, abs=1e-4)
    assert figures["ekf"]["heading"] == pytest.approx(2.0, abs=1e-4)
    assert figures["h2nav"]["estimates"] == len(times())


def test_the_worst_is_the_largest_of_all():
    flight = made(lambda t_s: (0.0, 0.0, -30.0 * DEG if t_s == 50.0 else 0.0))
    figures = document(flight)["whole"]["h2nav"]
    assert figures["worst_heading"] == pytest.approx(30.0, abs=1e-3)
    assert figures["heading"] < 1.0


def test_settled_begins_after_a_minute_of_recording():
    flight = made(lambda t_s: ((5.0 if t_s < SETTLED_S else 1.0) * DEG, 0.0, 0.0))
    found = document(flight)
    assert found["settled"]["h2nav"]["worst_tilt"] == pytest.approx(1.0, abs=1e-4)
    assert found["whole"]["h2nav"]["worst_tilt"] == pytest.approx(5.0, abs=1e-4)
    assert found["best"] == {"whole": "ekf", "settled": "h2nav"}


def test_a_short_flight_has_nothing_settled():
    flight = MadeUp()
    for t_s in times(end_s=10.0):
        flight.truth(t_s)
        flight.estimate(t_s, (0.0, 0.0, 0.0))
    assert document(flight)["settled"] == {}


@pytest.mark.parametrize("step_s", [0.01, 0.02, 0.025, 0.05, 0.1, 0.2])
def test_an_estimate_is_compared_with_the_truth_at_its_time(step_s):
    """Between two truths with what lies between; without one near by, not at all."""
    flight = MadeUp()
    for t_s in times(0.05):
        flight.estimate(t_s, (0.0, 0.0, 0.0))
    for t_s in times(step_s):
        flight.truth(t_s)
    figures = document(flight)["whole"]["h2nav"]
    expected = len(times(0.05)) if step_s <= 0.05 else len(times(step_s))
    assert figures["estimates"] == expected
    assert figures["worst_total"] < 0.01


# --- honesty ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("optimism", "nees"), [(1.0, 1.0), (3.0, 9.0)])
def test_an_honest_deviation_has_a_nees_of_one(optimism, nees):
    axis_deg, heading_deg = 0.5, 2.0
    draws = np.random.default_rng(1).normal(size=(len(times()), 3))
    rows = iter(draws * np.array([axis_deg, axis_deg, heading_deg]) * DEG)
    # The deviation of the tilt is that of both axes together.
    sigmas = (axis_deg * math.sqrt(2.0) / optimism, heading_deg / optimism)
    figures = document(made(lambda t_s: tuple(next(rows)), sigmas=sigmas))["whole"]["h2nav"]
    assert figures["nees_tilt"] == pytest.approx(nees, rel=0.1)
    assert figures["nees_heading"] == pytest.approx(nees, rel=0.1)
    # P(chi^2_2 > 18) = 1.2e-4 and P(chi^2_1 > 9) = 2.7e-3; of a third of the deviation, 2 and 1.
    expected = {1.0: (1.2e-4, 2.7e-3), 3.0: (math.exp(-1.0), 0.317)}[optimism]
    shares = (figures["tilt_beyond_3_sigma"], figures["heading_beyond_3_sigma"])
    assert shares == pytest.approx(expected, rel=0.1, abs=2e-3)


def test_who_predicts_nothing_is_not_judged():
    found = document(made(lambda t_s: (0.0, 0.0, DEG), sigmas=(1.0, math.nan)))["whole"]
    assert "nees_tilt" in found["h2nav"]
    assert "nees_heading" not in found["h2nav"]
    assert not any(key.startswith("nees") for key in found["ekf"])


def test_states_and_notices_of_the_service():
    flight = made(lambda t_s: (0.0, 0.0, 0.0))
    run = flight.runs["h2nav"]
    run.end({"aligning": 10.0, "active": 85.0, "degraded": 5.0})
    run.notice(flight.ns(30.0), Severity.WARNING, "late")
    found = document(flight)
    assert found["states"]["h2nav"] == {"aligning": 10.0, "active": 85.0, "degraded": 5.0}
    assert found["notices"]["h2nav"] == [{"t_s": 30.0, "severity": "warning", "text": "late"}]


# --- parts ------------------------------------------------------------------------------------


def test_airborne_is_armed_and_not_landed():
    flight = made(lambda t_s: ((1.0 if 30.0 <= t_s < 70.0 else 9.0) * DEG, 0.0, 0.0))
    flight.armed(0.0, False)
    flight.landed(1.0, True)
    flight.armed(20.0, True)
    flight.landed(30.0, False)
    flight.landed(70.0, True)
    flight.armed(80.0, False)
    airborne = document(flight)["airborne"]["h2nav"]
    assert airborne["worst_tilt"] == pytest.approx(1.0, abs=1e-4)
    assert airborne["estimates"] == 800


def test_without_a_heartbeat_nothing_is_known_to_be_airborne():
    flight = made(lambda t_s: (0.0, 0.0, 0.0))
    flight.landed(1.0, False)
    assert document(flight)["airborne"] == {}


@pytest.mark.parametrize("name", ["flight.tlog.events", "flight.events"])
def test_phases_are_in_the_time_of_the_autopilot(tmp_path, name):
    flight = made(lambda t_s: ((2.0 if 10.0 <= t_s < 40.0 else 7.0) * DEG, 0.0, 0.0))
    (tmp_path / name).write_text("    30.00 PHASE calm\n 31 MODE x\n\n    60.00 PHASE wild\n")
    phases = document(flight, tmp_path / "flight.tlog")["phases"]
    assert list(phases) == ["calm", "wild"]
    assert phases["calm"]["h2nav"]["worst_tilt"] == pytest.approx(2.0, abs=1e-4)
    assert phases["wild"]["h2nav"]["tilt"] == pytest.approx(7.0, abs=1e-4)


def test_given_phases_stand_instead_of_those_beside():
    flight = made(lambda t_s: ((2.0 if 10.0 <= t_s < 40.0 else 7.0) * DEG, 0.0, 0.0))
    found = document(flight, phases=(parse_phase("calm=30-60"),))["phases"]
    assert found["calm"]["h2nav"]["worst_tilt"] == pytest.approx(2.0, abs=1e-4)


def test_events_that_cannot_be_read_cost_the_phases_alone(tmp_path):
    (tmp_path / "flight.events").write_text("3.0 PHASE a\nsoon PHASE b\n")
    found = document(made(lambda t_s: (0.0, 0.0, 0.0)), tmp_path / "flight.tlog")
    assert found["phases"] == {}
    (note,) = found["notes"]
    assert "flight.events:2: expected a time in s and a text" in note


def test_a_phase_lasts_until_the_next(tmp_path):
    path = tmp_path / "x.events"
    path.write_text("1 PHASE a\n2 MODE b\n3.5 PHASE c\n")
    first, last = phases_of(read_events(path))
    assert first == ("a", 1.0, 3.5)
    assert last == ("c", 3.5, math.inf)


@pytest.mark.parametrize("text", ["a", "a=1", "a=2-1", "=1-2", "a=x-2", "a=-1-2"])
def test_a_phase_of_another_form_is_refused(text):
    with pytest.raises(ValueError, match="expected NAME=FROM-TO"):
        parse_phase(text)


# --- truth beside the recording ---------------------------------------------------------------


def row(boot_s: float, t_s: float, ekf_error_rad: float | None) -> str:
    q = true_attitude(t_s)
    estimate = [""] * 4
    if ekf_error_rad is not None:
        turn = quaternion.exp((0.0, 0.0, ekf_error_rad))
        estimate = [f"{value:.9f}" for value in quaternion.multiply(turn, q)]
    return ",".join([f"{boot_s * 1e6:.0f}", *(f"{value:.9f}" for value in q), *estimate])


def rebooted(folder: Path) -> tuple[MadeUp, Path]:
    """Booted again at 60 s; the clock begins at 5 s each time; each boot has its own error."""
    flight = MadeUp(has_simstate=False)
    rows: tuple[list[str], list[str]] = ([], [])
    for t_s in times():
        second = t_s >= 60.0
        boot_s = 5.0 + (t_s - 60.0 if second else t_s)
        flight.truth(t_s)
        flight.ekf(t_s, 9.0 * DEG, boot_s)
        flight.estimate(t_s, ((4.0 if second else 2.0) * DEG, 0.0, 0.0), boot_s=boot_s)
        rows[second].append(row(boot_s, t_s, None if t_s < 20.0 else 3.0 * DEG))
    for number, lines in enumerate(rows):
        path = folder / f"flight_truth_{number}.csv"
        path.write_text("\n".join([HEADER, *lines]) + "\n")
    return flight, folder / "flight.tlog"


def test_each_boot_has_its_own_truth(tmp_path):
    found = document(*rebooted(tmp_path))
    whole, settled = found["whole"], found["settled"]
    assert whole["h2nav"]["estimates"] == len(times())
    assert whole["h2nav"]["worst_tilt"] == pytest.approx(4.0, abs=1e-3)
    assert settled["h2nav"]["tilt"] == pytest.approx(4.0, abs=1e-3)
    assert found["truth"] == "flight_truth_0.csv, flight_truth_1.csv"
    assert found["notes"] == []


def test_the_estimate_beside_the_truth_is_that_of_the_autopilot(tmp_path):
    found = document(*rebooted(tmp_path))
    assert found["whole"]["ekf"]["worst_heading"] == pytest.approx(3.0, abs=1e-3)
    assert found["whole"]["ekf"]["estimates"] == sum(t_s >= 20.0 for t_s in times())
    assert found["settled"]["ekf"]["estimates"] == sum(t_s >= 60.0 for t_s in times())


def test_without_an_estimate_beside_the_truth_attitude_stands_for_it(tmp_path):
    flight, path = rebooted(tmp_path)
    for csv in tmp_path.glob("*.csv"):
        lines = csv.read_text().splitlines()
        csv.write_text("\n".join(",".join(line.split(",")[:5]) for line in lines))
    assert document(flight, path)["whole"]["ekf"]["heading"] == pytest.approx(9.0, abs=1e-2)


def test_a_boot_without_truth_is_told(tmp_path):
    flight, path = rebooted(tmp_path)
    (tmp_path / "flight_truth_1.csv").unlink()
    found = document(flight, path)
    assert found["whole"]["h2nav"]["worst_tilt"] == pytest.approx(2.0, abs=1e-3)
    assert found["notes"] == [
        "the autopilot booted 2 times, the truth is of 1 of them",
        "h2nav: 40% of the estimates have no truth near them",
    ]


def test_simstate_is_preferred_and_that_is_told(tmp_path):
    (tmp_path / "flight_truth.csv").write_text("t_boot_s,roll_deg\n1,2\n")
    found = document(made(lambda t_s: (0.0, 0.0, 0.0)), tmp_path / "flight.tlog")
    assert found["truth"] == "SIMSTATE"
    assert found["notes"] == ["flight_truth.csv: not used, the recording has SIMSTATE"]


# --- what cannot be scored --------------------------------------------------------------------


def test_a_flight_without_truth_is_left_out(tmp_path):
    flight = MadeUp(has_simstate=False)
    flight.truth(0.0)
    flight.estimate(0.0, (0.0, 0.0, 0.0))
    score = scored(flight, tmp_path / "flight.tlog")
    assert not score.document
    assert "flight.tlog: no truth; expected SIMSTATE" in score.remark
    assert "flight_truth_0.csv" in score.remark


def test_a_flight_without_estimates_is_left_out():
    flight = MadeUp()
    flight.truth(0.0)
    assert "flight.tlog: no estimate of ours" in scored(flight).remark


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("t_boot_s,roll_deg\n1,2\n", "no column t_us, q_w, q_x, q_y, q_z; expected t_us"),
        ("", "no column t_us"),
        ("t_us,q_w,q_x,q_y,q_z\n", "expected rows with a number in t_us"),
        ("t_us,q_w,q_x,q_y,q_z\n1,1,0,0,\n", "expected rows with a number in t_us"),
        ("t_us,q_w,q_x,q_y,q_z\n1,1,0,0,0\n2,one,0,0,0\n", "x.csv:3: expected numbers in t_us"),
        ("t_us,q_w,q_x,q_y,q_z\n1,1,0\n", "x.csv:2: expected numbers in t_us"),
        ("t_us,q_w,q_x,q_y,q_z\n2,1,0,0,0\n1,1,0,0,0\n", "t_us: expected times that rise"),
        ("t_us,q_w,q_x,q_y,q_z\n1,0,0,0,0\n", "expected quaternions of length 1"),
        ("t_us,q_w,q_x,q_y,q_z\n1,1e300,0,0,0\n", "expected quaternions of length 1"),
        ("t_us,q_w,q_x,q_y,q_z\n1e15,1,0,0,0\n", "t_us: expected microseconds since"),
        (f"t_us,q_w,q_x,q_y,q_z\n1,{'1' * 200_000},0,0,0\n", "x.csv:2: expected numbers in t_us"),
    ],
)
def test_a_truth_that_cannot_be_used_names_file_and_remedy(tmp_path, text, says):
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(BadInput, match=says) as caught:
        read_truth(path)
    assert str(path) in str(caught.value)


def test_zeros_are_no_estimate(tmp_path):
    path = tmp_path / "x.csv"
    rows = ("1,1,0,0,0,0,0,0,0", "2,1,0,0,0,0.999,0,0,0.01", "3,1,0,0,0,,,,")
    path.write_text("\n".join((HEADER, *rows)))
    assert np.isfinite(read_truth(path).ekf_nb).all(axis=1).tolist() == [False, True, False]


def test_another_vehicle_and_what_is_no_number_are_left_out():
    flight = made(lambda t_s: (0.0, 0.0, 0.0))
    flight.armed(0.0, True)
    expected = document(flight)
    attitude = mavlink.MAVLink_attitude_message(25_000, math.nan, 0, 0, 0, 0, 0)
    flight.hears(5.0, attitude)
    flight.hears(5.0, mavlink.MAVLink_simstate_message(math.nan, *[0] * 10))
    flight._encoder = codec.Encoder(2, 1)
    flight.ekf(5.0, 90.0 * DEG, 1.0)
    flight.armed(5.0, False)
    assert document(flight) == expected


@pytest.mark.parametrize(("system_id", "heard"), [(0, 1), (1, 1), (2, 0)])
def test_a_vehicle_may_be_chosen(system_id, heard):
    flight = MadeUp()
    flight.autopilot = FromAutopilot(system_id)
    flight.ekf(1.0, 0.0, 21.0)
    assert len(flight.autopilot.ekf.t_us) == heard


def test_a_folder_without_recordings_is_bad_input(tmp_path):
    with pytest.raises(BadInput, match=r"no recordings in this folder; expected \.tlog"):
        flight_paths(tmp_path)
    with pytest.raises(BadInput, match="no such file or folder"):
        flight_paths(tmp_path / "nowhere")


# --- all flights ------------------------------------------------------------------------------


def test_means_are_over_the_flights_that_have_an_estimator():
    first = document(made(lambda t_s: (2.0 * DEG, 0.0, 0.0)))
    second = document(made(lambda t_s: (4.0 * DEG, 0.0, 0.0)))
    del second["whole"]["ekf"]
    means = mean([first, second])
    assert means["whole"]["h2nav"]["tilt"] == pytest.approx(3.0, abs=1e-3)
    assert means["whole"]["h2nav"]["flights"] == 2
    assert means["whole"]["ekf"]["flights"] == 1
    assert means["airborne"] == {}

"""Figures of a campaign: what counts as how bad, and what is said of a fault and by when."""

from array import array
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from h2nav.evaluation.campaign import blame, scores
from h2nav.evaluation.campaign import summary as figures
from h2nav.evaluation.campaign.blame import Told
from h2nav.evaluation.campaign.draw import Draw, FlightDraw, ImuDraw
from h2nav.evaluation.campaign.shown import ShownBySensors
from h2nav.evaluation.campaign.summary import badness, summary, table, worst
from h2nav.integrity.findings import Finding, Sensor, Severity
from h2nav.integrity.kinds import Kind, SensorKind
from h2nav.sim.faults import parse_fault

GOOD = {
    "seed": 1, "length_s": 1800.0, "calm_h": 0.25, "cpu_s": 2.0, "handler_errors": 0,
    "heading_deg": {"p50": 1.0, "p95": 2.0, "p100": 3.0},
    "tilt_deg": {"p50": 0.1, "p95": 0.2, "p100": 0.3},
    "heading_wrong_s": 0.0, "tilt_wrong_s": 0.0, "heading_wrong_at_s": 50.0,
    "tilt_wrong_at_s": 60.0, "nees_tilt": 1.0, "nees_heading": 1.0,
    "false_accusations": [], "false_alarms": [], "faults": [],
}  # fmt: skip
SAID = {"kind": "gyro_frozen", "text": "gyro 1 stands still", "told_s": 71.4}


def fault(outcome, name="gyro-bias", shows=True, accused=()):
    return {"fault": name, "outcome": outcome, "shows": shows, "accused": accused}


@pytest.mark.parametrize(
    ("changes", "bad", "why"),
    [
        ({"heading_wrong_s": 1.0, "tilt_wrong_s": 1.0}, 0.0, "an exception in the service"),
        ({"heading_wrong_s": 12.4}, 11.4, "heading wrong for 12 s at 50 s"),
        ({"tilt_wrong_s": 1.5}, 0.5, "tilt wrong for 2 s at 60 s"),
        ({"false_accusations": [SAID]}, 60.0, "accused: gyro 1 stands still (71 s)"),
        ({"false_alarms": [SAID] * 4}, 80.0, "; ".join(["alarm: gyro 1 stands still (71 s)"] * 3)),
        ({"faults": [fault("wrong")]}, 60.0, "gyro-bias wrong"),
        ({"faults": [fault("missed"), fault("late")]}, 30.0, "gyro-bias missed"),
        ({"faults": [fault("undecided"), fault("right")]}, 0.0, "an exception in the service"),
        ({"handler_errors": 2}, 1e6, "an exception in the service"),
    ],
)
def test_how_bad_a_flight_is_and_why(changes, bad, why):
    row = GOOD | changes
    assert badness(row) == pytest.approx(bad)
    assert figures._reasons(row) == why


def test_a_flight_without_attitude_is_the_worst_and_next_to_nothing_is_left_out():
    none = {"seed": 4, "faults": []}
    rows = [
        GOOD | {"seed": seed, "heading_wrong_s": wrong_s}
        for seed, wrong_s in ((9, 2.0), (3, 2.0), (2, 1.99), (5, 40.0))
    ]
    assert [row["seed"] for row in worst([*rows, none])] == [4, 5, 3, 9]
    assert [row["seed"] for row in worst(rows, 2)] == [5, 3]
    assert figures._reasons(none) == "no attitude at all"
    assert len(worst([GOOD | {"tilt_wrong_s": 9.0}] * 25)) == 20


@pytest.mark.parametrize(
    ("values", "p50", "p95", "p100"),
    [
        ([None], None, None, None),
        ([2.0, None], 2.0, 2.0, 2.0),
        ([3.0, 1.0], 2.0, 3.0, 3.0),
        (list(range(100)), 49.5, 95, 99),
        (list(range(19)), 9, 18, 18),
    ],
)
def test_percentiles_over_flights(values, p50, p95, p100):
    assert figures._percentiles(values) == {"p50": p50, "p95": p95, "p100": p100}


def campaign():
    return [
        GOOD,
        GOOD
        | {
            "nees_tilt": 0.29,
            "nees_heading": None,
            "heading_wrong_s": 10.0,
            "tilt_wrong_s": 10.1,
            "false_accusations": [SAID, SAID | {"kind": "clipping"}, SAID],
            "faults": [
                fault("right"),
                fault("late", "gps-lag", accused=[SAID]),
                fault("missed", "gps-lag", shows=False),
                fault("undecided"),
            ],
        },
        GOOD | {"nees_tilt": 3.1, "nees_heading": 3.0, "false_alarms": [SAID]},
        {"seed": 7, "length_s": 600.0, "handler_errors": 1, "cpu_s": 0.5},
    ]


def test_the_figures_of_all_flights():
    found = summary(campaign())
    assert (found["flights"], found["without_attitude"], found["handler_errors"]) == (4, 1, 1)
    assert (found["hours"], found["hours_without_fault"]) == (pytest.approx(1.6667, abs=1e-4), 0.75)
    assert found["cpu_s"] == 6.5
    assert found["errors_deg"]["tilt_p95"] == {"p50": 0.2, "p95": 0.2, "p100": 0.2}
    assert found["heading_wrong_over_10_s"] == 0
    assert found["tilt_wrong_over_10_s"] == 1
    assert found["nees"] == {
        "tilt": {"median": 1.0, "flights": 3, "below": 1, "above": 1},
        "heading": {"median": 2.0, "flights": 2, "below": 0, "above": 0},
    }
    assert (found["false_accusations"], found["false_alarms"]) == (3, 1)
    assert found["false_accusations_per_100_h"] == pytest.approx(400.0)
    assert found["false_alarms_per_100_h"] == pytest.approx(100.0 / 0.75)
    assert list(found["false_accusations_by_kind"].items()) == [("gyro_frozen", 2), ("clipping", 1)]
    every = {
        "count": 4, "right": 1, "late": 1, "undecided": 1, "wrong": 0, "missed": 1,
        "accused": 1, "told_share": 0.75, "named_share": 0.5,
    }  # fmt: skip
    assert found["faults"] == every
    assert found["faults_that_show"]["count"] == 3
    assert found["faults_that_show"]["missed"] == 0
    assert {name: row["count"] for name, row in found["by_fault"].items()} == {
        "gps-lag": 2,
        "gyro-bias": 2,
    }
    none = summary([])
    assert none["false_alarms_per_100_h"] is None
    assert none["nees"]["tilt"]["median"] is none["faults"]["told_share"] is None


def test_the_table_for_people():
    rows = campaign()
    text = table({"summary": summary(rows), "worst": [rows[1]]}, lambda seed: f"fly {seed}")
    lines = text.splitlines()
    assert lines[0] == "4 flights, 1.7 h, 0.8 h of them without a fault"
    assert lines[2] == "over all flights              median    95 %   worst"
    assert lines[3] == "heading, deg, median of a flight    1.00    1.00    1.00"
    assert lines[8] == "tilt, deg, worst of a flight    0.30    0.30    0.30"
    assert "heading in 0 flights, tilt in 1" in text
    assert "NEES of tilt: median 1.00, below 0.3 in 1 flights, above 3 in 1, of 3" in text
    assert "false accusations: 3 (400.00 in 100 h) gyro_frozen 2, clipping 1" in text
    assert "false alarms: 1 (133.33 in 100 h) gyro_frozen 1" in text
    rows = {line.split()[0]: line.split()[1:] for line in lines if line.startswith(("g", "all "))}
    assert rows == {
        "gps-lag": ["2", "0", "1", "0", "0", "1", "1"],
        "gyro-bias": ["2", "1", "0", "1", "0", "0", "0"],
        "all": ["that", "show", "3", "1", "1", "1", "0", "0", "1"],
    }
    assert lines[-2].strip().startswith("228  heading wrong for 10 s at 50 s; tilt wrong")
    assert lines[-1] == "          fly 1"
    assert figures._cell(None) == "       -"


# --- what a finding is about ----------------------------------------------------------------------

IMU_1, GPS = Sensor(SensorKind.IMU, 1), Sensor(SensorKind.GPS)
AUTOPILOT = Sensor(SensorKind.AUTOPILOT)


def told(
    kind, sensor, from_s, told_s, *, to_s=None, severity=Severity.WARNING, size=1.0, backs=None
):
    end_s = from_s + 5.0 if to_s is None else to_s
    found = Finding(kind, sensor, severity, from_s, end_s, size, "", "text", "evidence")
    return Told(told_s, found._replace(backs_us=backs))


@pytest.mark.parametrize(
    ("kind", "from_s", "told_s", "is_of_it"),
    [
        (Kind.ATTITUDE_VELOCITY, 95.0, 100.0, True),
        (Kind.ATTITUDE_VELOCITY, 94.9, 101.0, False),
        (Kind.ATTITUDE_VELOCITY, 99.0, 99.9, False),
        (Kind.ATTITUDE_VELOCITY, 180.0, 190.0, True),  # a minute after it
        (Kind.ATTITUDE_VELOCITY, 180.1, 190.0, False),
        (Kind.GYRO_FROZEN, 50.0, 120.0, True),  # names what it breaks while it acts
        (Kind.GYRO_FROZEN, 50.0, 120.1, False),
    ],
)
def test_a_finding_is_of_a_fault_that_acts_when_it_begins_or_acted_a_minute_before(
    kind, from_s, told_s, is_of_it
):
    found = told(kind, IMU_1 if kind is Kind.GYRO_FROZEN else GPS, from_s, told_s)
    assert blame.overlaps(found, parse_fault("gyro-frozen@100+20/1")) is is_of_it


@pytest.mark.parametrize(("told_s", "outcome"), [(110.0, "right"), (110.1, "late")])
def test_a_fault_is_named_in_time_within_ten_seconds(told_s, outcome):
    fault_1 = parse_fault("gyro-bias=5@100+20/1")
    row = blame.fault_row(
        fault_1,
        [
            told(Kind.ATTITUDE_VELOCITY, GPS, 101.0, 102.346),
            told(Kind.GYRO_FROZEN, IMU_1, 103.0, told_s),
        ],
        (fault_1,),
    )
    assert (row["outcome"], row["after_s"]) == (outcome, 2.35)
    assert row["named_after_s"] == pytest.approx(told_s - 100.0)
    assert (row["fault"], row["argument"], row["imu"]) == ("gyro-bias", 5.0, 1)
    assert (row["from_s"], row["length_s"]) == (100.0, 20.0)


@pytest.mark.parametrize(
    ("kind", "sensor", "backs", "part"),
    [
        (Kind.AUTOPILOT_TILT, AUTOPILOT, True, "autopilot"),
        (Kind.AUTOPILOT_TILT, AUTOPILOT, False, "nobody"),
        (Kind.AUTOPILOT_HEADING, AUTOPILOT, None, "nobody"),
        (Kind.VELOCITY_LOST, GPS, None, "receiver"),
        (Kind.GPS_VELOCITY, GPS, None, "receiver"),
        (Kind.IMU_GAPS, IMU_1, None, "link"),
        (Kind.VIBRATION, IMU_1, None, "imu"),
        (Kind.COMPASS_FROZEN, IMU_1, None, "compass"),
        (Kind.COMPASSES_DIFFER, Sensor(SensorKind.COMPASS, None, (1, 2)), None, "nobody"),
        (Kind.COMPASSES_DIFFER, Sensor(SensorKind.COMPASS, 2, (1, 2)), None, "compass"),
        (Kind.GYRO_FROZEN, IMU_1, None, "gyro"),
        (Kind.ATTITUDE_GRAVITY, IMU_1, None, "nobody"),
    ],
)
def test_whom_a_finding_names(kind, sensor, backs, part):
    assert told(kind, sensor, 1.0, 2.0, backs=backs).part == part


@pytest.mark.parametrize(
    ("severity", "is_worth"),
    [(Severity.ERROR, True), (Severity.WARNING, True), (Severity.NOTICE, False)],
)
def test_a_finding_counts_from_a_warning_on(severity, is_worth):
    found = told(Kind.CLIPPING, IMU_1, 1.0, 2.0, severity=severity)
    assert blame.is_worth(found.finding) is is_worth
    row = told(Kind.CLIPPING, IMU_1, 1.04, 2.16, to_s=9.96).row()
    assert (row["from_s"], row["told_s"], row["to_s"]) == (1.0, 2.2, 10.0)
    assert (row["kind"], row["severity"]) == ("clipping", "warning")


def test_it_is_calm_from_a_minute_after_a_fault_until_a_second_before_one():
    faults = [parse_fault("gyro-bias=5@5.5+20"), parse_fault("gps-lost@100+10")]
    calm = blame.second_mask(faults, 200)
    assert np.flatnonzero(calm).tolist() == [*range(5), *range(86, 99), *range(171, 200)]
    assert blame.second_mask([], 3).all()


@pytest.mark.parametrize(("length_s", "can"), [(110.0, True), (109.9, False)])
def test_a_fault_can_be_told_ten_seconds_before_the_end(length_s, can):
    assert blame.can_be_told(parse_fault("gps-lost@100+50"), length_s) is can


def explained(found, *, receiver=(), disturbed=(), vibration=0.0, loss=0.0, count=2):
    """Whether what is said of a flight without faults is so; seconds in which it is."""
    seconds = np.arange(100)
    sensors = ShownBySensors(
        seconds >= 0, seconds >= 0,
        tuple(np.isin(seconds, own) for own in disturbed), ~np.isin(seconds, receiver),
    )  # fmt: skip
    draw = SimpleNamespace(
        scheduled=(), seed=1, length_s=100.0,
        imu=SimpleNamespace(count=count, vibration_m_s2=vibration),
        link=SimpleNamespace(loss_share=loss, gaps_per_h=0.0, gap_s=1.0),
        flight=SimpleNamespace(rest_s=10.0, length_min=100.0 / 60.0),
    )  # fmt: skip
    flight = SimpleNamespace(draw=draw)
    return not blame.false_reports([found], flight, sensors, lambda _: False).accusations


@pytest.mark.parametrize(
    ("at_s", "is_so"), [(37, False), (38, True), (46, True), (47, False)]
)  # the finding is of 40 to 45 s
def test_what_is_true_within_two_seconds_is_no_accusation(at_s, is_so):
    lost = told(Kind.GPS_VELOCITY, GPS, 40.0, 41.0)
    assert explained(lost, receiver=[at_s]) is is_so
    second = told(Kind.COMPASS_FIELD, Sensor(SensorKind.COMPASS, 2), 40.0, 41.0)
    assert explained(second, disturbed=([], [at_s])) is is_so
    assert not explained(second, disturbed=([at_s], []))
    either = told(Kind.COMPASS_FIELD, Sensor(SensorKind.COMPASS), 40.0, 41.0)
    assert explained(either, disturbed=([at_s], [])) is is_so


def test_vibration_and_losses_of_the_draw_may_be_reported():
    shaken = told(Kind.VIBRATION, IMU_1, 40.0, 41.0)
    assert explained(shaken, vibration=40.1)
    assert not explained(shaken, vibration=40.0)
    gaps = told(Kind.IMU_GAPS, IMU_1, 40.0, 41.0)
    assert explained(gaps, loss=0.01)
    assert not explained(gaps)


# --- scores ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("heading", "tilt", "at_s", "kind", "size", "is_so"),
    [
        (10.1, 0.0, 42.0, Kind.ATTITUDE_VELOCITY, 1.0, True),
        (-10.1, 0.0, 42.0, Kind.ATTITUDE_VELOCITY, 1.0, True),
        (9.9, 2.9, 42.0, Kind.ATTITUDE_VELOCITY, 1.0, False),
        (0.0, 3.1, 38.0, Kind.ATTITUDE_VELOCITY, 1.0, True),
        (0.0, 3.1, 37.9, Kind.ATTITUDE_VELOCITY, 1.0, False),
        (0.0, 3.1, 46.9, Kind.ATTITUDE_VELOCITY, 1.0, True),
        (0.0, 3.1, 47.0, Kind.ATTITUDE_VELOCITY, 1.0, False),
        (0.0, 2.1, 42.0, Kind.AUTOPILOT_TILT, 4.0, True),
        (0.0, 1.9, 42.0, Kind.AUTOPILOT_TILT, 4.0, False),
        (0.0, 3.1, 42.0, Kind.AUTOPILOT_TILT, 40.0, True),
        (5.1, 0.0, 42.0, Kind.AUTOPILOT_HEADING, 10.0, True),
        (4.9, 0.0, 42.0, Kind.AUTOPILOT_HEADING, 10.0, False),
    ],
)
def test_our_attitude_is_wrong_meanwhile(heading, tilt, at_s, kind, size, is_so):
    """By ten degrees of heading or three of tilt, or half of what a comparison says."""
    found = told(kind, AUTOPILOT, 40.0, 41.0, size=size, backs=False)
    errors = scores.Errors(np.array([at_s]), np.array([heading]), np.array([tilt]))
    assert errors.are_as(found) is is_so


def test_percentiles_of_a_flight_are_named_and_rounded():
    found = scores._percentiles(np.arange(101) + 0.00049)
    assert found == {"p50": 50.0, "p95": 95.0, "p99": 99.0, "p100": 100.0}
    assert set(scores._percentiles(np.zeros(0)).values()) == {None}


def test_an_attitude_is_held_against_us_while_something_shows_better_and_it_has_settled():
    t_s = np.arange(0.0, 100.0, 0.5)
    seen = np.arange(100) < 80
    nothing = np.zeros(100, bool)
    sensors = ShownBySensors(seen, nothing, (), nothing)
    heading = np.where((t_s < 35.0) | (t_s >= 70.0), -10.1, 9.9)
    found = scores._longest(t_s, heading, np.full(len(t_s), 9.0), sensors)
    assert found == {
        "heading_wrong_s": 9.5,
        "heading_wrong_at_s": 70.0,
        "heading_shown_share": 0.8,
        "tilt_wrong_s": 0.0,
        "tilt_wrong_at_s": 0.0,
        "tilt_shown_share": 0.0,
    }
    late = scores._longest(t_s, np.where(t_s < 60.0, 10.1, 0.0), 0.0 * t_s, sensors)
    assert (late["heading_wrong_s"], late["heading_wrong_at_s"]) == (29.0, 30.5)


def test_deviations_are_judged_after_two_minutes_where_no_fault_acts():
    t_s = np.array([120.0, 121.0, 122.0, 130.0])
    error = np.array([50.0, 2.0, 50.0, -2.0])
    calm = np.arange(125) != 122
    rows = np.tile([1.0, 0.0, 0.0, 0.0, 1.0, 2.0], (4, 1))
    found = scores._honesty(t_s, error, np.zeros(4), rows, calm)
    assert found["nees_heading"] == pytest.approx(1.0)
    assert found["nees_tilt"] == 0.0


def test_a_flight_without_estimates_has_a_head_alone():
    draw = Draw(7, flight=FlightDraw(vehicle="plane", length_min=3.0), imu=ImuDraw(2, 50.0))
    heard = scores.HeardDraw(array("q"), array("d"), (), {}, 3, 1.2345)
    found = scores._head(draw, heard)
    assert read_back(found.pop("draw")) == 7
    assert found == {
        "seed": 7, "vehicle": "plane", "length_s": 180.0, "imus": 2, "rate_hz": 50.0,
        "cpu_s": 1.23, "handler_errors": 3,
    }  # fmt: skip


def read_back(text):
    return yaml.safe_load(text)["seed"]

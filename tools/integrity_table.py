"""What the service says of each fault, after how long, and what the attitude does meanwhile.

Three tables: faults put into simulated flights, with one IMU and with three; the recorded flights
in which something fails, next to what the autopilot itself said in them; and everything that is
said while nothing is wrong, per hour. Flights are faster than real time and the same in every run.

Run: python tools/integrity_table.py [faults] [recordings] [alarms] [--flights DIR] [--hours H]
[--json FILE]
"""

import argparse
import json
import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.configuration import Configuration
from h2nav.apps.filters import FilterFactory
from h2nav.apps.pipeline import Outlets, Pipeline
from h2nav.apps.playback import Playback, PlaybackOptions, inputs_for, pipeline_for
from h2nav.evaluation.flights.heard import FromAutopilot, FromService
from h2nav.evaluation.flights.tracks import ErrorTrack, Mask, figures, track_of, tracks_of_autopilot
from h2nav.evaluation.flights.truth import Truth, truth_of
from h2nav.evaluation.parallel import results
from h2nav.files.earth_field import earth_field_at
from h2nav.integrity.findings import Severity
from h2nav.maths.attitude_errors import BEYOND
from h2nav.maths.rows import from_euler
from h2nav.maths.units import SECOND_NS
from h2nav.recordings.recording import open_recording
from h2nav.service.service import Service, Surroundings
from h2nav.service.settings import AutopilotSettings
from h2nav.sim.autopilot import AutopilotOptions, FakeAutopilot
from h2nav.sim.faults import FAULT_KINDS, parse_fault
from h2nav.sim.personalities import ARDUPILOT, PX4
from h2nav.sim.scenarios import SCENARIOS, scenario
from h2nav.wire import codec
from h2nav.wire.deframer import Deframer, Frame

START_NS = 1_000 * SECOND_NS
UNIX_S = 1_795_000_000.0
GRID_NS = 10_000_000
LOOK_NS = 50_000_000
BEGIN_S, LENGTH_S = 40.0, 60.0
SIMULATED = Configuration(autopilot=AutopilotSettings(simulation_truth=True))
# Of whatever recovers from a fault, before silence is expected of us again.
RECOVERY_S = 60.0
ALARM_FLIGHT_S = 300.0
# ArduPilot's FS_EKF_THRESH: at this its failsafe acts.
EKF_LIMIT = 0.8
ARDUPILOT_STATUS = mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT
PX4_STATUS = mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS
# A report in every flight of this make is not a reaction to a fault.
ALWAYS_TOLD = "not independent"
STATUSTEXT = mavlink.MAVLINK_MSG_ID_STATUSTEXT


class Case(NamedTuple):
    """A fault that is put into a simulated flight.

    Attributes:
        name: in the table.
        fault: NAME or NAME=ARGUMENT of ``h2nav fake-autopilot --fault``.
        flown: the scenario.
        everywhere: with several IMUs, all of them have it.
    """

    name: str
    fault: str
    flown: str = "flight"
    everywhere: bool = False

    def texts(self, imus: int) -> tuple[str, ...]:
        """The fault as on the command line, for each IMU that has it."""
        when = f"{self.fault}@{BEGIN_S:g}+{LENGTH_S:g}"
        if not FAULT_KINDS[self.fault.split("=")[0]].of_imu:
            return (when,)
        return tuple(f"{when}/{imu + 1}" for imu in range(imus if self.everywhere else 1))


MILLI_G = 9.80665e-3
CASES = (
    Case("no fault", "gyro-scale=1"),
    Case("gyro frozen", "gyro-frozen"),
    Case("whole IMU frozen", "imu-frozen"),
    Case("accelerometer frozen", "accel-frozen"),
    Case("accelerometer 2.0 m/s^2 on every axis", "accel-fixed=2"),
    Case("gyro all zero", "gyro-zero"),
    Case("gyro x and y swapped", "gyro-swap"),
    Case("gyro in deg/s", "gyro-deg"),
    Case("gyro bias step 10 deg/s", "gyro-bias=10"),
    Case("gyro scale 2 %, aggressive", "gyro-scale=1.02", "aggressive"),
    Case("accelerometer bias 31 mg", f"accel-bias={31 * MILLI_G:.4f}"),
    Case("accelerometer bias 60 mg", f"accel-bias={60 * MILLI_G:.4f}"),
    Case("accelerometer scale 5 %", "accel-scale=1.05"),
    Case("accelerometer clips at 1.2 g, aggressive", "clipping=1.2", "aggressive"),
    Case("vibration 20 m/s^2", "vibration=20", everywhere=True),
    Case("magnetometer reversed", "compass-reversed"),
    Case("compass frozen", "compass-frozen"),
    Case("hard iron 20 uT", "hard-iron=20"),
    Case("hard iron 60 uT", "hard-iron=60"),
    Case("GPS velocity ramp 3 m/s^2", "gps-ramp=3"),
    Case("GPS velocity ramp 0.5 m/s^2", "gps-ramp=0.5"),
    Case("GPS velocity ramp 0.3 m/s^2", "gps-ramp=0.3"),
    Case("GPS velocity step 5 m/s", "gps-step=5"),
    Case("GPS lag 400 ms", "gps-lag=0.4"),
    Case("GPS lost", "gps-lost"),
    Case("autopilot's heading off by 20 deg", "autopilot-heading=20"),
    Case("autopilot's tilt off by 10 deg", "autopilot-tilt=10"),
)


class Failure(NamedTuple):
    """What fails in a recording, in the autopilot's time, s."""

    name: str
    from_s: float
    to_s: float = math.inf


RECORDINGS = {
    "imu_1_fails": (
        Failure("accelerometer 1 reads 2.0 m/s^2 on every axis", 83.68, 111.23),
        Failure("accelerometer 1 has no new data", 133.28, 155.32),
        Failure("gyro 1 has no new data", 171.35, 198.95),
    ),
    "compass_1_hard_iron": (Failure("hard iron at compass 1", 76.74),),
    "gps_lost": (Failure("no GPS", 110.43, 170.44),),
    "magnet_vibration": (Failure("hard iron", 99.4, 136.2), Failure("vibration", 148.4, 184.8)),
    "px4_hard_iron": (Failure("hard iron in SCALED_IMU, calibrated away inside PX4", 20.0),),
    "plane": (Failure("no GPS", 168.40, 234.42),),
    "calm": (),
    "brisk_wind": (),
    "takeoff_40s": (),
    "px4_agile_reboot": (),
}


class Words(FromAutopilot):
    """What the autopilot says of itself as well.

    Attributes:
        texts: arrival (us), severity, text of each STATUSTEXT.
        ratios: arrival (us), test ratio of the velocity, of the field, as far as it has one (NaN):
            1 = rejected.
    """

    message_ids = FromAutopilot.message_ids | {ARDUPILOT_STATUS, PX4_STATUS, STATUSTEXT}

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[tuple[int, int, str]] = []
        self.ratios: list[tuple[int, float, float]] = []

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Takes what a frame of `message_ids` says."""
        if frame.msg_id not in (ARDUPILOT_STATUS, PX4_STATUS, STATUSTEXT):
            super().frame(t_ns, frame)
            return
        fields: Any = codec.decode(frame)
        t_us = t_ns // 1000
        if frame.msg_id == STATUSTEXT:
            self.texts.append((t_us, fields.severity, str(fields.text)))
        elif frame.msg_id == ARDUPILOT_STATUS:
            self.ratios.append((t_us, fields.velocity_variance, fields.compass_variance))
        else:
            self.ratios.append((t_us, fields.vel_ratio, fields.mag_ratio))


class Heard(FromService):
    """One run of the service, with the states in order.

    Attributes:
        changes: time (us), the state from then on.
    """

    def __init__(self, autopilot: Words) -> None:
        super().__init__(autopilot, listens=True)
        self.changes: list[tuple[int, str]] = []
        self._looked_ns = 0

    def look(self, t_ns: int, service: Service) -> None:
        """Notes the state, unless it has just been looked at."""
        if t_ns - self._looked_ns < LOOK_NS:
            return
        self._looked_ns = t_ns
        state = service.health.state
        if not self.changes or self.changes[-1][1] != state:
            self.changes.append((t_ns // 1000, state))


class Flight(NamedTuple):
    """A flight with its truth.

    Attributes:
        said: by the autopilot.
        heard: from the service.
        findings: of the service, as mappings; times in s since the start.
        ours: errors of the service.
        ekf: errors of the autopilot's own attitude; None without one.
    """

    said: Words
    heard: Heard
    findings: list[dict[str, Any]]
    ours: ErrorTrack
    ekf: ErrorTrack | None

    def since_start_s(self, t_us: int) -> float:
        """Times as `ours` has them."""
        return (t_us - self.said.start_us) * 1e-6


def flight_of(said: Words, heard: Heard, service: Service, truth: Truth) -> Flight:
    """What was heard, compared with the truth."""
    findings = [
        f._asdict() | {"severity": f.severity.name.lower()}
        for f in getattr(service, "findings", ())
    ]
    ekf = tracks_of_autopilot(truth, said).get("ekf")
    return Flight(said, heard, findings, track_of(truth, said, heard.estimates()), ekf)


def simulated(options: AutopilotOptions, seconds: float) -> Flight:
    """A simulated flight through the service, which asks for its streams and is answered."""
    autopilot = FakeAutopilot(options)
    encoders: dict[tuple[int, int], codec.Encoder] = {}
    asked = Deframer()
    t_ns = START_NS

    def obey(data: bytes) -> None:
        for frame in asked.feed(data):
            fields = codec.decode(frame)
            autopilot.on_message(t_ns, frame.sysid, frame.compid, frame.msg_id, fields)

    said = Words()
    heard = Heard(said)
    filters = FilterFactory.shipped(SIMULATED.filter, SIMULATED.autopilot.imu_rate_hz)
    service = Service(SIMULATED.service, Surroundings(filters.filter_for, earth_field_at, UNIX_S))
    outlets = Outlets(lambda now_ns: now_ns, obey, None, heard)
    pipeline = Pipeline(service, SIMULATED.output.component_id, outlets)
    pipeline.link(t_ns, True)
    for t_ns in range(START_NS, START_NS + round(seconds * SECOND_NS), GRID_NS):
        for sent_ns, *sender, message in autopilot.advance(t_ns):
            encoder = encoders.setdefault((sender[0], sender[1]), codec.Encoder(*sender))
            pipeline.received(sent_ns, encoder.encode(message))
        pipeline.tick(t_ns)
        said.time(t_ns)
        heard.look(t_ns, service)
    arrived_us, angles = said.truth.arrays()
    return flight_of(said, heard, service, Truth("SIMSTATE", arrived_us, from_euler(angles), True))


def recorded(path: Path) -> Flight:
    """A recording through the service."""
    recording = open_recording(path)
    inputs = inputs_for(recording, PlaybackOptions())
    said = Words()
    heard = Heard(said)
    pipeline = pipeline_for(recording, inputs, None, heard)
    for t_ns in Playback(recording, whole_frames=inputs.whole_frames).through(pipeline):
        said.time(t_ns)
        heard.look(t_ns, pipeline.service)
    return flight_of(said, heard, pipeline.service, truth_of(path, said)[0])


# --- what a fault does --------------------------------------------------------------------------


def told_between(flight: Flight, from_s: float, to_s: float) -> list[dict[str, Any]]:
    """The notices of a time that are more than information."""
    return [
        {"t_s": t_s, "severity": severity.name.lower(), "text": text}
        for t_us, severity, text in flight.heard.notices
        if severity < Severity.INFO
        and not text.startswith(ALWAYS_TOLD)
        and from_s <= (t_s := flight.since_start_s(t_us)) < to_s
    ]


def states_between(flight: Flight, from_s: float, to_s: float) -> dict[str, float]:
    """How long each state lasted, s, the longest first."""
    changes = [(flight.since_start_s(t_us), state) for t_us, state in flight.heard.changes]
    lasted: Counter[str] = Counter()
    for (begin_s, state), (end_s, _) in zip(changes, [*changes[1:], (to_s, "")], strict=True):
        inside_s = min(end_s, to_s) - max(begin_s, from_s)
        if inside_s > 0.0:
            lasted[state] += inside_s  # type: ignore[assignment]
    return {state: round(s, 1) for state, s in lasted.most_common()}


def deceived_share(flight: Flight, inside: Mask) -> float | None:
    """Share of a part in which all was called well, while tilt or heading was beyond 3 sigma."""
    if not inside.any():
        return None
    since_s = [flight.since_start_s(t_us) for t_us, _ in flight.heard.changes]
    is_well = np.array([False, *(state == "active" for _, state in flight.heard.changes)])
    wrong = is_well[np.searchsorted(since_s, flight.ours.t_s, side="right")]
    track = flight.ours
    beyond = np.zeros(len(wrong), dtype=bool)
    for error, sigma in ((track.tilt, track.sigma_tilt), (track.heading, track.sigma_heading)):
        if sigma is not None:
            beyond |= np.abs(error) > BEYOND * sigma
    return float(np.mean((wrong & beyond)[inside]))


def worst(track: ErrorTrack | None, from_s: float, to_s: float) -> dict[str, float] | None:
    """The largest total error and tilt, deg, of a time; None where there is nothing."""
    if track is None:
        return None
    inside = (from_s <= track.t_s) & (track.t_s < to_s)
    if not inside.any():
        return None
    return {
        name: round(float(np.abs(column[inside]).max()), 2)
        for name, column in (("total", track.total), ("tilt", track.tilt))
    }


def effect(flight: Flight, from_s: float, to_s: float) -> dict[str, Any]:
    """What a fault between two times does, and what is said of it."""
    told = told_between(flight, from_s, to_s)
    told_s = told[0]["t_s"] if told else None
    inside = (from_s <= flight.ours.t_s) & (flight.ours.t_s < to_s)
    found = figures(flight.ours, inside) or {}
    sigma = {
        name: round(float(np.nanmax(column[inside])), 2)
        for name, column in (
            ("tilt", flight.ours.sigma_tilt),
            ("heading", flight.ours.sigma_heading),
        )
        if column is not None and np.isfinite(column[inside]).any()
    }
    honesty = ("nees", "beyond_3_sigma")
    return {
        "told_after_s": None if told_s is None else round(told_s - from_s, 2),
        "told": told,
        "findings": [
            finding
            for finding in flight.findings
            if from_s <= finding["to_s"] and finding["from_s"] < to_s
        ],
        "states_s": states_between(flight, from_s, to_s),
        "worst_before": worst(flight.ours, from_s, to_s if told_s is None else told_s),
        "worst_after": None if told_s is None else worst(flight.ours, told_s, to_s),
        "worst_sigma": sigma,
        "deceived_share": deceived_share(flight, inside),
        **{key: value for key, value in found.items() if any(name in key for name in honesty)},
    }


class Task(NamedTuple):
    """A simulated flight of the first table."""

    case: Case
    imus: int


def fault_row(task: Task) -> dict[str, Any]:
    """Flies a case."""
    case, imus = task
    faults = tuple(parse_fault(text) for text in case.texts(imus))
    options = AutopilotOptions(scenario(case.flown), ARDUPILOT, 1, faults, imus=imus)
    flight = simulated(options, BEGIN_S + LENGTH_S)
    row = {"input": case.name, "flown": case.flown, "imus": imus}
    return row | effect(flight, BEGIN_S, BEGIN_S + LENGTH_S)


# --- recordings ---------------------------------------------------------------------------------


def recording_rows(path: Path) -> dict[str, Any]:
    """What each failure of a recording does, and all that is said at other times."""
    flight = recorded(path)
    offset_us = flight.said.boot_offset_us() or 0
    end_s = flight.since_start_s(flight.said.end_us)
    failures = []
    for name, from_s, to_s in RECORDINGS[path.stem]:
        begin_s, stop_s = (
            min(max(flight.since_start_s(offset_us + round(s * 1e6)), 0.0), end_s)
            if math.isfinite(s)
            else end_s
            for s in (from_s, to_s)
        )
        row = {"recording": path.stem, "input": name, "from_s": begin_s, "to_s": stop_s}
        row |= effect(flight, begin_s, stop_s)
        failures.append(row | {"autopilot": autopilot_between(flight, begin_s, stop_s)})
    return {"failures": failures, "quiet": quiet_part(flight, path.stem, failures, end_s)}


def autopilot_between(flight: Flight, from_s: float, to_s: float) -> dict[str, Any]:
    """What the autopilot said of itself, and how wrong it was."""
    ratios = [
        (t_s, velocity, field)
        for t_us, velocity, field in flight.said.ratios
        if from_s <= (t_s := flight.since_start_s(t_us)) < to_s
    ]
    beyond = next((t_s for t_s, *pair in ratios if any(x >= EKF_LIMIT for x in pair)), None)
    velocity, field = (
        max((x for x in (row[column] for row in ratios) if math.isfinite(x)), default=None)
        for column in (1, 2)
    )
    return {
        "worst": worst(flight.ekf, from_s, to_s),
        "worst_velocity_ratio": velocity,
        "worst_field_ratio": field,
        "ratio_told_after_s": None if beyond is None else round(beyond - from_s, 2),
        "texts": [
            {"after_s": round(t_s - from_s, 2), "text": text}
            for t_us, severity, text in flight.said.texts
            if severity < Severity.INFO and from_s <= (t_s := flight.since_start_s(t_us)) < to_s
        ],
    }


def quiet_part(
    flight: Flight, name: str, failures: Iterable[dict[str, Any]], end_s: float
) -> dict[str, Any]:
    """How long nothing failed, from the first attitude on, and what was said meanwhile."""
    begin_s = float(flight.ours.t_s[0]) if len(flight.ours.t_s) else end_s
    spans = []
    for failure in failures:
        spans.append((begin_s, failure["from_s"]))
        begin_s = failure["to_s"] + RECOVERY_S
    spans.append((begin_s, end_s))
    spans = [(a, b) for a, b in spans if b > a]
    told = [notice for span in spans for notice in told_between(flight, *span)]
    return {"name": name, "hours": sum(b - a for a, b in spans) / 3600.0, "told": told}


# --- false alarms in simulated flights ----------------------------------------------------------


class Quiet(NamedTuple):
    """A simulated flight without a fault."""

    flown: str
    seed: int
    imus: int
    is_px4: bool


def quiet_flights(hours: float) -> list[Quiet]:
    """So many hours of all scenarios in turn, with one IMU and three, of both makes."""
    names = tuple(SCENARIOS)
    return [
        Quiet(names[k % len(names)], k, 1 if k // len(names) % 2 else 3, k // len(names) % 3 == 2)
        for k in range(math.ceil(hours * 3600.0 / ALARM_FLIGHT_S))
    ]


def quiet_row(quiet: Quiet) -> dict[str, Any]:
    """Flies it."""
    make = PX4 if quiet.is_px4 else ARDUPILOT
    options = AutopilotOptions(scenario(quiet.flown), make, quiet.seed, imus=quiet.imus)
    flight = simulated(options, ALARM_FLIGHT_S)
    name = f"{quiet.flown}, {make.name}, {quiet.imus} IMU"
    return quiet_part(flight, name, (), ALARM_FLIGHT_S) | {"seed": quiet.seed}


# --- tables -------------------------------------------------------------------------------------


def both(values: dict[str, float] | None, names: Sequence[str] = ("total", "tilt")) -> str:
    """Two figures of a row, as in ``12.3 (4.5)``."""
    if not values:
        return "-"
    first, second = (values.get(name) for name in names)
    return f"{_figure(first)} ({_figure(second)})"


def _figure(value: float | None) -> str:
    return "-" if value is None or not math.isfinite(value) else f"{value:.3g}"


def _shared_cells(row: dict[str, Any]) -> list[str]:
    told = row["told_after_s"]
    shares = ("tilt_beyond_3_sigma", "heading_beyond_3_sigma", "deceived_share")
    tilt, heading, deceived = (
        "-" if row.get(name) is None else f"{100.0 * row[name]:.1f}" for name in shares
    )
    return [
        "never" if told is None else f"{told:.1f}",
        row["told"][0]["text"] if row["told"] else "-",
        ", ".join(f"{state} {s:g}" for state, s in row["states_s"].items()),
        f"{both(row['worst_before'])} / {both(row['worst_after'])}",
        both(row["worst_sigma"], ("tilt", "heading")),
        f"{tilt} ({heading})",
        deceived,
        both(row, ("nees_tilt", "nees_heading")),
    ]


SHARED_HEADINGS = (
    "told after, s", "text", "state, s", "worst error before / after: total (tilt), deg",
    "worst sigma: tilt (heading), deg", "beyond 3 sigma: tilt (heading), %",
    "beyond and active, %", "NEES: tilt (heading)",
)  # fmt: skip


def print_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Markdown."""
    print("| " + " | ".join(headings) + " |")
    print("|" + "---|" * len(headings))
    for row in rows:
        print("| " + " | ".join(cell.replace("|", "/") for cell in row) + " |")
    print(flush=True)


def faults(_args: argparse.Namespace) -> list[dict[str, Any]]:
    """Faults put into simulated flights."""
    rows = list(results(fault_row, [Task(case, imus) for case in CASES for imus in (1, 3)]))
    cells = [[row["input"], str(row["imus"]), *_shared_cells(row)] for row in rows]
    print_table(("input", "IMUs", *SHARED_HEADINGS), cells)
    return rows


def recordings(args: argparse.Namespace) -> list[dict[str, Any]]:
    """Recorded failures, and all that is said at other times."""
    paths = [args.flights / f"{name}.tlog" for name in RECORDINGS]
    paths = [path for path in paths if path.exists()]
    if not paths:
        raise SystemExit(f"{args.flights}: none of the recordings; name their folder by --flights")
    found = list(results(recording_rows, paths))
    rows = [row for flight in found for row in flight["failures"]]
    cells = []
    for row in rows:
        own = row["autopilot"]
        said = "; ".join(f"{text['text']} ({text['after_s']:.1f} s)" for text in own["texts"])
        ratios = both(own, ("worst_velocity_ratio", "worst_field_ratio"))
        cells.append(
            [row["recording"], row["input"], *_shared_cells(row), both(own["worst"]), ratios,
             _figure(own["ratio_told_after_s"]), said or "-"]
        )  # fmt: skip
    own_headings = (
        "autopilot's worst error: total (tilt), deg", "its worst ratio: velocity (field)",
        f"ratio above {EKF_LIMIT:g} after, s", "its texts",
    )  # fmt: skip
    print_table(("recording", "input", *SHARED_HEADINGS, *own_headings), cells)
    _print_quiet([flight["quiet"] for flight in found])
    return found


def alarms(args: argparse.Namespace) -> list[dict[str, Any]]:
    """Simulated flights in which nothing is wrong."""
    rows = list(results(quiet_row, quiet_flights(args.hours)))
    _print_quiet(rows)
    return rows


def _print_quiet(rows: Sequence[dict[str, Any]]) -> None:
    hours: Counter[str] = Counter()
    texts: dict[str, list[str]] = {}
    for row in rows:
        hours[row["name"]] += row["hours"]
        at = [f"{told['text']} ({told['t_s']:.0f} s)" for told in row["told"]]
        texts.setdefault(row["name"], []).extend(at)
    cells = [
        [name, f"{lasted:.3f}", str(len(texts[name])), "; ".join(texts[name]) or "-"]
        for name, lasted in hours.items()
    ]
    count, total = sum(map(len, texts.values())), sum(hours.values())
    cells.append(["all", f"{total:.2f}", str(count), f"{count / max(total, 1e-9):.2f} per hour"])
    print_table(("no fault in it", "hours", "notices", "texts"), cells)


TABLES: dict[str, Callable[[argparse.Namespace], list[dict[str, Any]]]] = {
    "faults": faults,
    "recordings": recordings,
    "alarms": alarms,
}


def main() -> None:
    """Prints the tables that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"of {', '.join(TABLES)}")
    parser.add_argument("--flights", type=Path, default=Path("flights"), help="recordings")
    parser.add_argument("--hours", type=float, default=1.0, help="of simulated flights (alarms)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="everything as JSON as well")
    args = parser.parse_args()
    if unknown := set(args.tables) - TABLES.keys():
        parser.error(
            f"no such table: {', '.join(sorted(unknown))}; choose from {', '.join(TABLES)}"
        )
    found = {name: TABLES[name](args) for name in args.tables or TABLES}
    if args.json is not None:
        args.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

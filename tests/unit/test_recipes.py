"""The recipes of ARCHITECTURE.md, "Where to add something": executed on a copy, and what they name.

`tests/unit/translate/test_new_state.py` executes that of a filter's state.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from needs import REPOSITORY

TOP = ("docs", "gains", "tests", "tools", "configs", "packaging", "native")
A_FILE = re.compile(r"[\w./*-]+(?:\.(?:py|md|yaml|toml|json|js|sh|css)|/)")
# What a recipe tells to create, and generated folders.
NEW = {"memory.py", "kernel/", "gains.py", "filter.py"}

SUBJECT = """
from h2nav.integrity.findings import SensorKind, Severity
from h2nav.integrity.kinds import FlightKind, Meaning
from h2nav.reviews.declared import Declared, ReviewSubject

MADE = FlightKind("made_by_a_recipe")
KINDS = (
    Declared(MADE, Meaning((SensorKind.VEHICLE,), Severity.INFO, "m", "It means.", "Nothing.")),
)
SUBJECT = ReviewSubject("a made one", KINDS, (), lambda evidence: [])
"""
COMMAND = '''
"""A made command."""


def add_arguments(parser):
    parser.add_argument("--made")


def run(arguments):
    return 0
'''
# recipe -> (files: what is replaced in them, each followed by what it becomes, or the text of a new
# one), what then holds
RECIPES = {
    "A finding of a whole flight": (
        {"h2nav/reviews/subjects/made.py": SUBJECT},
        "from h2nav.reviews.document_schema import review_schema\n"
        "from h2nav.reviews.subjects import SECTIONS, SUBJECTS\n"
        "assert SECTIONS['made_by_a_recipe'] == 'timeline'\n"
        "assert 'a made one' in [one.name for one in SUBJECTS]\n"
        "assert 'made_by_a_recipe' in str(review_schema())\n",
    ),
    "A field of a log": (
        {
            "h2nav/recordings/field_tables.py": (
                "SERIES = (\n",
                'SERIES = (\n    Field("made", "V", dataflash=(series("POWR", "VServo"),)),\n',
            )
        },
        "from h2nav.recordings.columns import Format, messages_of\n"
        "from h2nav.recordings.field_tables import FIELDS\n"
        "assert 'made' in [one.name for one in FIELDS]\n"
        "assert 'POWR' in messages_of(Format.DATAFLASH, FIELDS)\n",
    ),
    "A column of an IMU, a compass, a receiver, an attitude or a text": (
        {
            "h2nav/recordings/receiver_tables.py": (
                "    is_used: Array  #",
                "    hdop: Array  # (N,)\n    is_used: Array  #",
                '                "is_used": column("U", may_lack=True),\n',
                '                "is_used": column("U", may_lack=True),\n'
                '                "hdop": column("HDop", may_lack=True),\n',
                '                "spoofing": column("spoofing_state", may_lack=True),\n',
                '                "spoofing": column("spoofing_state", may_lack=True),\n'
                '                "hdop": column("hdop", may_lack=True),\n',
                '                    "satellites": column("satellites_visible",',
                '                    "hdop": column("eph", scale=CENTI),\n'
                '                    "satellites": column("satellites_visible",',
            )
        },
        "import numpy as np\n"
        "from h2nav.recordings.columns import Format, read\n"
        "from h2nav.recordings.log_rows import Rows\n"
        "from h2nav.recordings.receiver_tables import FIXES\n"
        "from h2nav.recordings.row_tables import Table\n"
        "class Log:\n"
        "    def instances(self, name, *columns):\n"
        "        row = [(one, 'i4') for one in {*columns, 'HDop', 'hdop', 'eph'}]\n"
        "        table = Table(name, np.arange(1), np.full(1, 120, row))\n"
        "        yield Rows(0, table, np.zeros(1, np.int64), np.zeros(1))\n"
        "log = Log()\n"
        "for log.format in Format:\n"
        "    factor = 0.01 if log.format is Format.TELEMETRY else 1.0\n"
        "    assert read(log, (FIXES,)).values['fixes'][0].hdop == [120 * factor]\n",
    ),
    "A message that is read": (
        {
            "h2nav/wire/vehicle.py": (
                "def heartbeat(m: Any)",
                "class Pressure(NamedTuple):\n"
                '    """SCALED_PRESSURE."""\n\n'
                "    air_hpa: float\n\n\n"
                "def pressure(m: Any) -> Pressure:\n"
                '    """SCALED_PRESSURE."""\n'
                "    return Pressure(m.press_abs)\n\n\n"
                "def heartbeat(m: Any)",
            ),
            "h2nav/wire/readers.py": (
                "    mavlink.MAVLINK_MSG_ID_VIBRATION: vehicle.vibration,\n",
                "    mavlink.MAVLINK_MSG_ID_VIBRATION: vehicle.vibration,\n"
                "    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: vehicle.pressure,\n",
            ),
            "h2nav/service/service.py": (
                "    ParameterValue,\n    StatusText,\n",
                "    ParameterValue,\n    Pressure,\n    StatusText,\n",
                "            case Vibration():\n",
                "            case Pressure():\n"
                "                text = f'{message.air_hpa:.0f} hPa'\n"
                "                return self._notices.report(t_ns, Severity.INFO, text, 'made')\n"
                "            case Vibration():\n",
            ),
            "h2nav/service/wanted.py": (
                "    optional += comparing.wanted_streams(",
                "    made = mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE\n"
                "    optional.append(WantedStream(made, 2.0, is_optional=True))\n"
                "    optional += comparing.wanted_streams(",
            ),
        },
        """
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from h2nav.apps.configuration import Configuration
from h2nav.apps.filters import FilterFactory
from h2nav.apps.pipeline import deliver
from h2nav.files.earth_field import earth_field_at
from h2nav.service.autopilot import Identity
from h2nav.service.service import Service, Surroundings
from h2nav.service.wanted import streams_wanted
from h2nav.wire.codec import Encoder
from h2nav.wire.deframer import Deframer

chosen = Configuration()
filters = FilterFactory.shipped(chosen.filter, chosen.autopilot.imu_rate_hz)
service = Service(chosen.service, Surroundings(filters.filter_for, earth_field_at, 1.79e9))
pilot, kind = Encoder(1, 1), (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_QUADROTOR)
beat = pilot.encode(mavlink.MAVLink_heartbeat_message(*kind[::-1], 0, 0, 4, 3))
air = pilot.encode(mavlink.MAVLink_scaled_pressure_message(1000, 1013.0, 0.0, 2500))
(beat,), (air,) = Deframer().feed(beat), Deframer().feed(air)
for second in range(5):
    deliver(service, beat, second * 10**9, second * 10**9)
told = deliver(service, air, 5 * 10**9, 5 * 10**9)
assert [one.text for one in told if hasattr(one, "text")] == ["1013 hPa"], told
asked = streams_wanted(chosen.service, Identity(1, 1, *kind), ())
assert any(one.message_id == air.msg_id for one in asked)
""",
    ),
    "A command": (
        {
            "h2nav/apps/made.py": COMMAND,
            "h2nav/cli.py": (
                '        ("demo",): CommandEntry(\n',
                '        ("made",): CommandEntry("made", "a made one", "made"),\n'
                '        ("demo",): CommandEntry(\n',
            ),
        },
        "from h2nav.cli import main\nassert main(['made', '--made', 'x']) == 0\n",
    ),
    "A configuration key": (
        {
            "h2nav/service/settings.py": (
                "    lanes: Lanes = \"auto\"\n",
                "    made_hz: RateHz = 3.0\n    lanes: Lanes = \"auto\"\n",
            )
        },
        "import contextlib, io\n"
        "from h2nav.cli import main\n"
        "out = io.StringIO()\n"
        "with contextlib.redirect_stdout(out):\n"
        "    assert main(['check-config', '--schema']) == 0\n"
        "assert '\"made_hz\"' in out.getvalue()\n",
    ),
    "A message that is sent": (
        {
            "h2nav/wire/outbound.py": (
                "def named_value_float(",
                "def made(t_us: int) -> OutMessage:\n"
                '    """VIBRATION."""\n'
                "    return mavlink.MAVLink_vibration_message(t_us, 0.0, 0.0, 0.0, 0, 0, 0)\n\n\n"
                "def named_value_float(",
            ),
            "h2nav/service/outputs.py": (
                "            mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT: _Output(\n",
                "            mavlink.MAVLINK_MSG_ID_VIBRATION: _Output(\n"
                "                lambda estimate: (outbound.made(estimate.t_us),),\n"
                "                settings.made_rate_hz,\n"
                "            ),\n"
                "            mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT: _Output(\n",
            ),
            "h2nav/service/settings.py": (
                "    difference_rate_hz: RateHz = 0.0\n",
                "    difference_rate_hz: RateHz = 0.0\n    made_rate_hz: RateHz = 5.0\n",
            ),
        },
        "from h2nav.attitude.samples import AttitudeEstimate, Trust\n"
        "from h2nav.service.outputs import Outputs\n"
        "from h2nav.service.settings import OutputSettings\n"
        "outputs, zero = Outputs(OutputSettings()), (0.0, 0.0, 0.0)\n"
        "sent = []\n"
        "for ms in range(1000, 3000, 10):\n"
        "    estimate = AttitudeEstimate(\n"
        "        1000 * ms, (1.0, 0.0, 0.0, 0.0), zero, zero, zero, 0.01, Trust.ALIGNED, 0.02\n"
        "    )\n"
        "    sent += [m for m in outputs.due(estimate) if m.get_type() == 'VIBRATION']\n"
        "assert sent[0].time_usec == 1000000\n"
        "assert 10 <= len(sent) <= 11\n"
        "assert outputs.latest(sent[0].get_msgId())[0].time_usec == 2990000\n",
    ),
    "A fault of the fake autopilot": (
        {
            "h2nav/sim/faults.py": (
                '    "gyro-bias": _of_imu(',
                '    "made": _of_imu("a made one", 2.0),\n    "gyro-bias": _of_imu(',
            ),
            "h2nav/sim/sensor_faults.py": (
                '    "gyro-bias": lambda',
                '    "made": lambda s, x: s._replace(w_b=_scaled(s.w_b, x)),\n'
                '    "gyro-bias": lambda',
            ),
        },
        "from h2nav.attitude.samples import ImuSample\n"
        "from h2nav.sim.faults import FaultSchedule, parse_fault\n"
        "from h2nav.sim.sensor_faults import SensorFaults\n"
        "faults = SensorFaults(FaultSchedule([parse_fault('made=3@2+1')]))\n"
        "sample = ImuSample(0, (0.1, 0.2, 0.3), (0.0, 0.0, -9.8))\n"
        "assert faults.apply(1.9, sample).w_b == sample.w_b\n"
        "assert faults.apply(2.5, sample).w_b[1] == 3 * 0.2\n",
    ),
}  # fmt: skip


def where_to_add() -> dict[str, str]:
    """Recipe -> its text."""
    text = (REPOSITORY / "ARCHITECTURE.md").read_text(encoding="utf-8")
    section = text[text.index("## Where to add something") : text.index("## What holds everywhere")]
    parts = re.split(r"(?:^\* |(?<=\. ))\*(An? [^*]+)\*[,:]", section, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@pytest.mark.parametrize("recipe", where_to_add())
def test_what_a_recipe_names_exists(recipe: str) -> None:
    text = where_to_add()[recipe]
    named = {
        word for quoted in re.findall(r"`([^`]+)`", text) for word in quoted.split()
        if A_FILE.fullmatch(word)
    }  # fmt: skip
    lost = {name for name in named if not exists(name)}
    assert not lost - (NEW if recipe == "A filter" else set())


def exists(name: str) -> bool:
    """At the top; inside `h2nav/`; or, where the recipe has named the room, anywhere in it."""
    if (name.partition("/")[0] in TOP or "/" not in name) and any(REPOSITORY.glob(name)):
        return True
    return any((REPOSITORY / "h2nav").glob(name)) or any((REPOSITORY / "h2nav").rglob(name))


def test_the_check_sees_a_file_that_is_gone() -> None:
    assert exists("reviews/page.py")
    assert not exists("reviews/no_such_page.py")
    assert len(where_to_add()) > 30


@pytest.mark.parametrize("recipe", RECIPES)
def test_a_recipe_does_what_it_says_and_touches_no_other_file(recipe: str, tmp_path: Path) -> None:
    changes, check = RECIPES[recipe]
    text = where_to_add()[recipe]
    ignored = shutil.ignore_patterns("__pycache__", "*.so")
    shutil.copytree(REPOSITORY / "h2nav", tmp_path / "h2nav", ignore=ignored)
    (tmp_path / "gains").symlink_to(REPOSITORY / "gains")
    for path, change in changes.items():
        place = tmp_path / path
        assert (path.removeprefix("h2nav/") in text) or (str(Path(path).parent)[6:] + "/" in text)
        if isinstance(change, str):
            assert not place.exists()
            place.write_text(change, encoding="utf-8")
        else:
            whole = place.read_text(encoding="utf-8")
            for before, after in zip(change[::2], change[1::2], strict=True):
                assert whole.count(before) == 1, path
                whole = whole.replace(before, after)
            place.write_text(whole, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", check],
        cwd=tmp_path, env={"PYTHONPATH": str(tmp_path), "PATH": "/usr/bin"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr

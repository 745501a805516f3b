"""The layouts of the viewers name what a log holds, and Rerun draws what we convert for it."""

import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from mcap.reader import make_reader
from needs import REPOSITORY, need_package, tool

from h2nav.log.schema import record_format
from h2nav.service.records import FINDING_TOPIC, FindingRecord

pytestmark = pytest.mark.thorough

TAKEOFF = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"
LAYOUTS = REPOSITORY / "packaging" / "layouts"
MESSAGE_PATH = re.compile(
    r'(?P<topic>(/\w+)+)(\{(?P<filter>\w+)=="(?P<text>\w+)"\})?(\.(?P<field>\w+))?'
)
# What Lichtblick calls them, and Foxglove.
PANELS = {"3D", "Plot", "RawMessages", "RosOut", "StateTransitions", "Tab"}


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("layouts") / "takeoff.mcap"
    command = [sys.executable, "-m", "h2nav", "replay", str(TAKEOFF), "-o", str(path)]
    subprocess.run(command, check=True, capture_output=True, cwd=REPOSITORY)
    return path


@pytest.fixture(scope="module")
def channels(log):
    """Topic -> the fields of its JSON schema (empty for protobuf): name -> JSON type."""
    with log.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    found = {
        FINDING_TOPIC: fields(record_format(FindingRecord).schema)
    }  # nothing was wrong in this flight
    for channel in summary.channels.values():
        schema = summary.schemas.get(channel.schema_id)
        is_json = schema is not None and schema.encoding == "jsonschema"
        found[channel.topic] = fields(schema.data) if is_json else {}
    return found


def fields(schema: bytes) -> dict[str, str]:
    return {name: value["type"] for name, value in json.loads(schema)["properties"].items()}


def test_the_layouts_are_those_of_the_tool():
    files = tool("layouts").FILES
    assert {path.name for path in LAYOUTS.iterdir()} == set(files)
    for name, write in files.items():
        assert (LAYOUTS / name).read_text(encoding="utf-8") == write(), "python tools/layouts.py"


def message_paths(value) -> list[str]:
    """Everything in a Foxglove layout that names a topic; reference lines are numbers."""
    if isinstance(value, list):
        return [path for each in value for path in message_paths(each)]
    if not isinstance(value, dict):
        return []
    named = [value[key] for key in ("value", "topicPath", "topicToRender") if key in value]
    named += value.get("topics", {})
    named += [path for each in value.values() for path in message_paths(each)]
    return [path for path in named if not re.fullmatch(r"[\d.]+", path)]


def test_foxglove_and_lichtblick_find_every_path(channels):
    document = json.loads((LAYOUTS / "foxglove.json").read_text())
    paths = message_paths(document["configById"])
    assert len(paths) > 20
    for path in paths:
        found = MESSAGE_PATH.fullmatch(path)
        assert found, path
        held = channels[found["topic"]]
        assert {found["filter"], found["field"]} - {None} <= set(held), path
        assert found["filter"] is None or held[found["filter"]] == "string"


def panels_in(layout) -> list[str]:
    if isinstance(layout, str):
        return [layout]
    return [*panels_in(layout["first"]), *panels_in(layout["second"])]


def test_foxglove_and_lichtblick_know_every_panel():
    document = json.loads((LAYOUTS / "foxglove.json").read_text())
    configurations = document["configById"]
    tabs = [tab for name in configurations for tab in configurations[name].get("tabs", [])]
    shown = panels_in(document["layout"]) + [
        name for tab in tabs for name in panels_in(tab["layout"])
    ]
    assert sorted(shown) == sorted(configurations)
    assert {name.partition("!")[0] for name in shown} == PANELS


def test_plotjuggler_finds_every_curve(channels):
    """It names a curve by topic and field, and draws numbers alone."""
    numbers = {
        f"{topic}/{name}"
        for topic, held in channels.items()
        for name, kind in held.items()
        if kind in {"number", "integer", "boolean"}
    }
    root = ET.parse(LAYOUTS / "plotjuggler.xml").getroot()
    curves = [curve.get("name") for curve in root.iter("curve")]
    assert len(curves) > 20
    assert set(curves) <= numbers
    for splitter in root.iter("DockSplitter"):
        plots = len(splitter.findall("DockArea"))
        assert splitter.get("count") == str(plots)
        assert len(splitter.get("sizes").split(";")) == plots


def test_rerun_reads_what_is_converted_for_it(log, tmp_path):
    need_package("rerun")
    output = tmp_path / "takeoff.rrd"
    command = [sys.executable, str(REPOSITORY / "tools" / "rerun_view.py"), str(log)]
    done = subprocess.run(
        [*command, "-o", str(output)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "RerunWarning" not in done.stderr
    rerun = str(Path(sys.executable).with_name("rerun"))
    environment = {"HOME": str(tmp_path), "PATH": "/usr/bin:/bin"}
    subprocess.run([rerun, "rrd", "verify", str(output)], check=True, env=environment)
    told = subprocess.run(
        [rerun, "rrd", "print", "-v", str(output)],
        check=True, env=environment, capture_output=True, text=True,
    ).stdout  # fmt: skip
    drawn = {
        match[2]: int(match[1])
        for match in re.finditer(r"with (\d+) rows .* - (\S+) - data columns:.*Scalars", told)
    }
    plots = [plot for _, group in tool("layouts").TABS for plot in group]
    assert set(drawn) == {f"{plot.topic}/{field}" for plot in plots for field in plot.fields}
    assert drawn["/estimate/roll_deg"] > 3000

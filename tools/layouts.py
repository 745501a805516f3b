"""Writes packaging/layouts/: what Foxglove, Lichtblick and PlotJuggler show of a log.

All of them draw the same plots, which are declared here once; `tools/rerun_view.py` draws them in
Rerun. `python tools/layouts.py` writes the files; a test holds them to it, and it to the channels.
"""

import json
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

FOLDER = Path(__file__).resolve().parents[1] / "packaging" / "layouts"
COLOURS = ("#e6550d", "#3182bd", "#31a354", "#756bb1", "#636363", "#d62728")


class Plot(NamedTuple):
    """One diagram over time.

    Attributes:
        title: what it shows, with the unit.
        topic: whose fields it draws.
        fields: of the topic's records.
        only: what a text of the records that it draws must be, such as ("source", "autopilot").
        limit: where a line is drawn across.
    """

    title: str
    topic: str
    fields: tuple[str, ...]
    only: tuple[str, str] | None = None
    limit: float | None = None


def xyz(name: str, unit: str) -> tuple[str, ...]:
    """The three components of a vector in the body frame."""
    return tuple(f"{name}_{axis}_{unit}" for axis in "xyz")


OVERVIEW = (
    Plot("Attitude [deg]", "/estimate", ("roll_deg", "pitch_deg", "yaw_deg")),
    Plot(
        "Autopilot less h2nav, and its deviation [deg]",
        "/comparison",
        ("tilt_deg", "heading_deg", "sigma_tilt_deg", "sigma_heading_deg"),
        only=("source", "autopilot"),
    ),
    Plot(
        "Test ratios (1 = the test fails)",
        "/ratios",
        ("velocity_3s", "force_10s", "field_10s", "turn_10s"),
        limit=1.0,
    ),
)
SENSORS = (
    Plot("Angular rate [rad/s]", "/imu", xyz("gyro", "rad_s")),
    Plot("Specific force [m/s^2]", "/imu", xyz("acc", "m_s2")),
    Plot("Magnetic field [microtesla]", "/imu", xyz("mag", "ut")),
)
FILTER = (
    Plot("Gyro bias [rad/s]", "/estimate", xyz("bias", "rad_s")),
    Plot("Predicted deviation [deg]", "/estimate", ("sigma_tilt_deg", "sigma_heading_deg")),
    Plot("Lateness [ms]", "/estimate", ("late_ms",)),
    Plot("Rate of the IMU message [Hz]", "/health", ("imu_rate_hz",)),
)
TABS = (("Overview", OVERVIEW), ("Sensors", SENSORS), ("Filter", FILTER))
STATES = {"state": "/health.state", "reason": "/health.reason"}


def foxglove() -> str:
    """The layout for Foxglove and Lichtblick, JSON."""
    panels: dict[str, dict[str, Any]] = {
        "3D!h2nav": _scene(),
        "RosOut!h2nav": {"topicToRender": "/log", "searchTerms": [], "minLogLevel": 1},
        "RawMessages!finding": {"topicPath": "/finding", **_titled("Newest finding")},
        "StateTransitions!h2nav": {
            "isSynced": True,
            "paths": [
                {"value": path, "label": label, "timestampMethod": "receiveTime"}
                for label, path in STATES.items()
            ],
            **_titled("State"),
        },
    }
    tabs = []
    for title, plots in TABS:
        names = [f"Plot!{title.lower()}{number}" for number in range(len(plots))]
        panels |= {name: _foxglove_plot(plot) for name, plot in zip(names, plots, strict=True)}
        shown = [*names, "StateTransitions!h2nav"] if plots is OVERVIEW else names
        tabs.append({"title": title, "layout": _split(shown, "column")})
    panels["Tab!h2nav"] = {"activeTabIdx": 0, "tabs": tabs}
    beside = _split(["3D!h2nav", "RosOut!h2nav", "RawMessages!finding"], "column")
    layout = {"first": beside, "second": "Tab!h2nav", "direction": "row", "splitPercentage": 30}
    document = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": layout,
    }
    return json.dumps(document, indent=1) + "\n"


def _titled(title: str) -> dict[str, str]:
    return {"foxglovePanelTitle": title, "lichtblickPanelTitle": title}


def _scene() -> dict[str, Any]:
    """The frames ``ned`` and ``body``, from south-west and above: z, down, points up there."""
    return {
        "followTf": "ned",
        "followMode": "follow-none",
        "cameraState": {
            "perspective": True,
            "distance": 4,
            "phi": 60,
            "thetaOffset": 45,
            "targetOffset": [0, 0, 0],
            "target": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.1,
            "far": 100,
        },
        "scene": {"transforms": {"axisScale": 6, "labelSize": 0.3}},
        "topics": {"/pose": {"visible": False}},
        **_titled("Attitude: body in north, east, down"),
    }


def _foxglove_plot(plot: Plot) -> dict[str, Any]:
    records = (
        plot.topic if plot.only is None else f'{plot.topic}{{{plot.only[0]}=="{plot.only[1]}"}}'
    )
    paths = [f"{records}.{field}" for field in plot.fields]
    labels = list(plot.fields)
    if plot.limit is not None:
        paths.append(f"{plot.limit:g}")
        labels.append("limit")
    return {
        "paths": [
            {
                "value": path,
                "label": label,
                "color": colour,
                "enabled": True,
                "timestampMethod": "receiveTime",
            }
            for path, label, colour in zip(paths, labels, COLOURS, strict=False)
        ],
        "xAxisVal": "timestamp",
        "isSynced": True,
        "showLegend": True,
        "legendDisplay": "left",
        "sidebarDimension": 230,
        "showPlotValuesInLegend": True,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        **_titled(plot.title),
    }


def _split(names: Sequence[str], direction: str) -> str | dict[str, Any]:
    """Panels side by side or one below the other, all of one size."""
    if len(names) == 1:
        return names[0]
    return {
        "first": names[0],
        "second": _split(names[1:], direction),
        "direction": direction,
        "splitPercentage": round(100.0 / len(names), 1),
    }


def plotjuggler() -> str:
    """The layout for PlotJuggler, XML; it draws all records of a topic, whatever `only` says."""
    root = ET.Element("root")
    widget = ET.SubElement(root, "tabbed_widget", name="Main Window", parent="main_window")
    for title, plots in TABS:
        tab = ET.SubElement(widget, "Tab", containers="1", tab_name=title)
        sizes = ";".join([f"{1 / len(plots):.3f}"] * len(plots))
        splitter = ET.SubElement(
            ET.SubElement(tab, "Container"),
            "DockSplitter",
            orientation="-",
            count=str(len(plots)),
            sizes=sizes,
        )
        for plot in plots:
            area = ET.SubElement(splitter, "DockArea", name=plot.title)
            element = ET.SubElement(area, "plot", mode="TimeSeries", style="Lines")
            for field, colour in zip(plot.fields, COLOURS, strict=False):
                ET.SubElement(element, "curve", name=f"{plot.topic}/{field}", color=colour)
    ET.SubElement(widget, "currentTabIndex", index="0")
    ET.SubElement(root, "use_relative_time_offset", enabled="1")
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


FILES = {"foxglove.json": foxglove, "plotjuggler.xml": plotjuggler}


def main() -> None:
    for name, write in FILES.items():
        (FOLDER / name).write_text(write(), encoding="utf-8")


if __name__ == "__main__":
    main()

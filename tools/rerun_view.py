"""Converts a log for Rerun: the attitude in space, the words, and every plot of tools/layouts.py.

Rerun reads the attitude and the words of our MCAP by itself (`rerun LOG.mcap`), but not the numbers
in JSON; here they become curves, and the arrangement of the views goes into the same file.

Run: python tools/rerun_view.py LOG.mcap -o OUT.rrd; rerun OUT.rrd   (pip install rerun-sdk)
"""

import argparse
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from layouts import COLOURS, TABS, Plot

from h2nav.recordings.mcap_recording import McapRecording
from h2nav.recordings.recording import open_recording

# The time line that Rerun gives to the messages of an MCAP.
LOG_TIME = "message_log_time"
DOWN_IS_Z = rr.components.ViewCoordinates.FRD


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path, metavar="LOG.mcap", help="a log of h2nav")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT.rrd")
    args = parser.parse_args()
    recording = open_recording(args.log)
    if not isinstance(recording, McapRecording):
        parser.error(f"{args.log}: no MCAP log; replay it first (h2nav replay)")
    stream = rr.RecordingStream("h2nav")
    stream.save(args.output, default_blueprint=blueprint())
    stream.log_file_from_path(args.log)
    add_body(stream)
    for _, plots in TABS:
        for plot in plots:
            add_curves(stream, recording, plot)
    stream.flush()


def blueprint() -> rrb.Blueprint:
    """The attitude and the words on the left, the plots on the right."""
    tabs = [rrb.Vertical(*(_view(plot) for plot in plots), name=name) for name, plots in TABS]
    space = rrb.Spatial3DView(
        contents=["/tf", "/pose", "/body"],
        name="Attitude",
        spatial_information=rrb.SpatialInformation("ned", show_axes=True, axes=DOWN_IS_Z),
    )
    words = rrb.TextLogView(origin="/log", name="What the program said")
    views = rrb.Horizontal(rrb.Vertical(space, words), rrb.Tabs(*tabs), column_shares=[1, 2])
    return rrb.Blueprint(views, rrb.TimePanel(timeline=LOG_TIME), collapse_panels=True)


def _view(plot: Plot) -> rrb.TimeSeriesView:
    contents = [f"{plot.topic}/{field}" for field in plot.fields]
    return rrb.TimeSeriesView(origin="/", contents=contents, name=plot.title)


def add_body(stream: rr.RecordingStream) -> None:
    """Its axes: forward red and longest, right green, down blue."""
    axes = [[1.0, 0.0, 0.0], [0.0, 0.7, 0.0], [0.0, 0.0, 0.4]]
    colours = [[230, 60, 40], [60, 170, 80], [60, 110, 220]]
    frame = rr.CoordinateFrame("body")
    stream.log("/body", frame, rr.Arrows3D(vectors=axes, colors=colours), static=True)


def add_curves(stream: rr.RecordingStream, recording: McapRecording, plot: Plot) -> None:
    """The numbers of a plot's records over the host's time; null is a gap."""
    records = [
        (t_ns, record)
        for t_ns, record in recording.records(plot.topic)
        if plot.only is None or record.get(plot.only[0]) == plot.only[1]
    ]
    times = np.array([t_ns for t_ns, _ in records], dtype="datetime64[ns]")
    for field, colour in zip(plot.fields, COLOURS, strict=False):
        place = f"{plot.topic}/{field}"
        stream.log(
            place, rr.SeriesLines(names=field, colors=list(bytes.fromhex(colour[1:]))), static=True
        )
        values = [record.get(field) for _, record in records]
        numbers = [np.nan if value is None else float(value) for value in values]
        index = rr.TimeColumn(LOG_TIME, timestamp=times)
        stream.send_columns(place, indexes=[index], columns=rr.Scalars.columns(scalars=numbers))


if __name__ == "__main__":
    main()

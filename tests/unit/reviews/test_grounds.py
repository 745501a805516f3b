"""Take-offs and landings, on the map and in the table of touchdowns."""

import numpy as np
import pytest
from made_flight import made_crash, page_of, text_of

from h2nav.integrity.findings import Finding, Sensor, SensorKind, Severity
from h2nav.recordings.context import Series, Span
from h2nav.reviews.pictures.grounds import contacts, take_offs
from h2nav.reviews.subjects.touchdown import TOUCHDOWN


def touched(t_s, speed):
    return Finding(
        TOUCHDOWN, Sensor(SensorKind.VEHICLE), Severity.INFO, t_s, t_s, speed, "m/s",
        f"touched down at {speed:.1f} m/s", "", f"touchdown.{t_s:.0f}",
    )  # fmt: skip


def test_each_flight_leaves_the_ground_once():
    flight, _ = made_crash()
    t_s = np.arange(0.0, 112.0, 0.1)
    height = np.interp(t_s, (0, 10, 15, 30, 35, 50, 55, 80, 90), (0, 0, 9, 9, 0, 0.2, 9, 9, 0.2))
    context = flight.context._replace(
        armed=(Span(5.0, 40.0, "armed"), Span(45.0, 100.0, "armed")),
        baro_height_m=Series(t_s, height + 431.0),
    )
    assert take_offs(context) == pytest.approx([10.1, 50.0], abs=0.15)
    found = contacts(context, (touched(35.0, 1.8), touched(90.0, 0.9)))
    assert [one.name for one in found] == ["take-off", "landing", "take-off", "landing"]
    assert [one.speed_m_s for one in found if one.name == "landing"] == [1.8, 0.9]


def test_a_height_that_drifts_on_a_bench_is_no_take_off():
    flight, _ = made_crash()
    assert contacts(flight.context, ()) == ()


def test_a_crash_is_its_own_touchdown_and_the_map_shows_both():
    flight, analysis = made_crash()
    flight = flight._replace(findings=(*flight.findings, touched(60.0, 0.8), touched(104.5, 6.6)))
    found = contacts(flight.context, flight.findings)
    assert [(one.name, round(one.t_s)) for one in found] == [
        ("take-off", 8), ("landing", 60), ("crash", 104),
    ]  # fmt: skip
    assert found[-1].speed_m_s == 6.6
    html = page_of(flight, analysis)
    drawing = html[html.index('<svg class="track"') :]
    assert drawing.count('class="take-off"') == drawing.count('class="landing"') == 1
    assert "landing at 60 s, 0.8 m/s downward" in drawing
    assert 'class="ink impact"' in drawing
    assert 'class="lost"' in drawing
    assert "take-off at 8 s, landing at 60 s, crash at 104 s" in drawing[:600]
    assert "60.0 landing 0.8 104.0 crash 6.6" in text_of(html)

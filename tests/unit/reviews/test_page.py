"""The page and its document: what is told, in which order, how large, and hostile texts."""

import itertools
import json
import math
import re

import numpy as np
import pytest
from known_evidence import imu_track
from made_flight import (
    FINDINGS,
    GPS_LOST,
    MAGNET_S,
    made_analysis,
    made_crash,
    made_flight,
    page_of,
    shown_by,
    text_of,
)

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import Context, Said, Series, Span
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.document import document
from h2nav.reviews.flight import EarthFields, Flight, Ratios
from h2nav.reviews.page import duration, page
from h2nav.reviews.pictures.columns import COARSE, Columns
from h2nav.reviews.pictures.control import rate_lines
from h2nav.reviews.subjects import KINDS

NOTHING = np.zeros(0)
HOSTILE = "<script>alert('x')</script><img src=x onerror=alert(1)>\u202e"


def empty_flight(why="the recording holds no IMU messages"):
    """What a recording without anything gives."""
    return Flight(
        name="empty",
        file="empty.tlog",
        kind="tlog",
        autopilot="",
        context=Context(missing=("IMU messages", "GPS")),
        estimates=None,
        smoothed=None,
        why_no_estimate=why,
        imu_message="",
        ratios=Ratios(NOTHING, (), np.zeros((0, 0))),
        earth=EarthFields(NOTHING, NOTHING, NOTHING, NOTHING),
        states=(),
        lanes=(),
        notices=(),
        findings=(),
        rejected={},
    )


@pytest.fixture(scope="module")
def made():
    flight = made_flight()
    return flight, made_analysis(flight)


def test_findings_come_first_and_the_worst_of_them_first(made):
    text = text_of(page_of(*made))
    places = [
        text.index(part)
        for part in (
            "Flight review: made",
            "No crash. The compass was disturbed",
            "240 to 360 s: compass disturbed",
            "autopilot heading off 14 deg",
            "no fix for 50 s",
            "1 note",
            "gyro vibrates at 84 Hz",
            "What was checked, and what could not be",
            "Checked:",
            "The flight",
            "Time line",
            "Bank: positive is right wing down",
            "Angle between the autopilot's vertical",
            "Other attitudes against h2nav",
        )
    ]
    assert places == sorted(places)


def test_a_finding_has_span_size_evidence_and_what_to_check(made):
    text = text_of(page_of(*made))
    finding, advice = FINDINGS[0], KINDS[FINDINGS[0].kind].meaning
    start = text.index("240 to 360 s: compass disturbed")
    item = text[start : text.index("244 to 362 s")]
    assert "14 deg" in item
    assert finding.evidence in item
    assert advice.check in item


def test_nothing_wrong_is_said_with_what_was_and_what_was_not_checked(made):
    flight = made[0]._replace(findings=())
    text = text_of(page_of(flight, made[1]._replace(findings=())))
    assert "Nothing was found wrong" in text
    assert "Checked: our attitude against the GPS velocity" in text
    assert "Missing in the recording: no temperatures" in text


def test_without_an_estimate_the_page_says_why_below_the_verdict():
    text = text_of(page_of(empty_flight(), Analysis()))
    why = text.index("the recording holds no IMU messages")
    assert why < text.index("What was checked")
    assert "Nothing was found wrong in what could be looked at." in text
    assert "Missing in the recording: IMU messages; GPS" in text
    assert "Our own attitude" not in text


def test_a_crash_is_one_picture_before_all_others():
    html = page_of(*made_crash())
    text = text_of(html)
    places = [
        text.index(part)
        for part in (
            "pitch -60 deg where -5 was demanded",
            "it led to: impact at 104.0 s",
            "Control lost at 100.0 s, impact at 104.0 s",
            "Time line",
            "Above the start",
            "Motors and throttle",
            "It sags under load",
            "From above, north up; the part of the flight",
        )
    ]
    assert places == sorted(places)
    told = shown_by(html)
    lanes = [one for one in told["pictures"] if one.get("window")]
    assert [one.get("title") for one in lanes] == [
        "Roll", "Pitch", "Heading", "Sticks", "Motors", "Height", "Battery", None,
    ]  # fmt: skip
    assert {tuple(one["window"]) for one in lanes} == {(89.0, 109.0)}
    names = [trace["label"] for trace in lanes[4]["traces"]]
    assert names == ["motor 1", "motor 2", "motor 3", "motor 4", "throttle"]
    assert lanes[0]["traces"][0]["label"] == "demand"
    rows = {label: [span[2] for span in spans] for label, spans, _ in lanes[-1]["rows"]}
    assert rows == {
        "flight mode": ["LOITER", "LAND"],
        "autopilot reports: battery": ["low"],
        "autopilot says": ["Battery Failsafe - Land"],
    }
    assert [(t_s, text) for t_s, text, _ in told["marks"]] == [
        (100.0, "control lost"), (102.0, "low"), (104.0, "impact"),
    ]  # fmt: skip
    track = html[html.index('<svg class="track"') :]
    assert "impact at 104 s" in track
    assert "low at 102 s" in track


def test_what_follows_stands_once_beneath_its_cause():
    flight, analysis = made_crash()

    def listed(findings):
        html = page_of(flight._replace(findings=findings), analysis)
        return text_of(html[html.index('class="findings"') - 5 : html.index('id="timeline"')])

    text = listed(flight.findings)
    assert text.count("came down hard") == 1
    assert text.index("pitch -60 deg") < text.index("came down hard")
    lost, crash = flight.findings
    circle = listed((lost._replace(cause=crash.id), crash))
    assert circle.count("came down hard") == circle.count("pitch -60 deg") == 1
    assert listed((crash._replace(cause="nothing.1"),)).count("came down hard") == 1


def test_what_our_own_attitude_says_of_itself_stands_under_how_sure_we_are(made):
    told = document(*made)
    told["findings"][0]["about"] = "h2nav"
    html = page(*made, told)
    found = html[html.index('id="findings"') : html.index('id="timeline"')]
    sure = html[html.index('id="sure"') :]
    assert "heading +14 deg, dip -9 deg" not in found
    assert "autopilot heading off 14 deg" in found
    assert "heading +14 deg, dip -9 deg" in sure


def test_what_comes_again_and_again_is_one_card(made):
    again = [GPS_LOST._replace(from_s=10.0 * k, to_s=10.0 * k + 1.0, id="") for k in range(8)]
    html = page_of(made[0]._replace(findings=(*FINDINGS[:2], *again)), made[1])
    found = html[html.index('id="findings"') : html.index('id="timeline"')]
    assert "8 more findings of this kind" in found  # one is of the analysis
    assert found.count('class="finding ') == 2 + 9
    assert found.count('<ol class="findings">') == 2


def test_a_second_crash_is_seen_on_demand():
    flight, analysis = made_crash()
    again = [one._replace(from_s=one.from_s - 70.0, to_s=one.to_s - 70.0, id="") for one in
             flight.findings]  # fmt: skip
    html = page_of(flight._replace(findings=(*flight.findings, *again)), analysis)
    event = html[html.index('<section id="event"') : html.index('<section id="timeline"')]
    assert event.count('class="whole stack"') == 2
    first, later = event.index("impact at 34.0 s"), event.index("later: control lost at 100.0 s")
    assert first < later < event.rindex("impact at 104.0 s")


def test_the_deviation_at_the_end_is_of_the_armed_time_like_the_others(made):
    flight, analysis = made
    sigma = np.linspace(0.01, 0.02, len(flight.estimates.t_s))
    armed = (Span(0.0, 300.0, "armed"),)
    flight = flight._replace(
        context=flight.context._replace(armed=armed),
        estimates=flight.estimates._replace(sigma_tilt_rad=sigma),
    )
    tilt = document(flight, analysis)["certainty"]["h2nav"]["tilt"]
    assert tilt["last_deg"] == tilt["largest_deg"] == pytest.approx(math.degrees(0.015), rel=1e-3)


def test_what_a_recording_shows_without_an_estimate_is_shown(made):
    flight = made[0]._replace(
        estimates=None, smoothed=None, why_no_estimate="IMU at 2 Hz", findings=()
    )
    html = page_of(flight, made[1])
    assert 'id="attitude"' in html
    assert 'id="difference"' not in html
    assert 'id="track"' in html


def test_neighbouring_sensors_that_show_the_same_are_told_once(made):
    shaken = [
        Finding(Kind.VIBRATION_LEVEL, Sensor(SensorKind.IMU, k), Severity.WARNING,
                50.0 + k, 90.0, 40.0 + k, "m/s^2", f"vibration up to {40 + k} m/s^2", f"VIBE {k}")
        for k in (1, 2)
    ]  # fmt: skip
    flight = made[0]._replace(findings=tuple(shaken))
    text = text_of(page_of(flight, Analysis()))
    assert "more thing" not in text
    assert "IMU 1, IMU 2: vibration up to 42 m/s^2" in text
    (told,) = document(flight, Analysis())["findings"]
    assert told["evidence"] == "IMU 1: VIBE 1; IMU 2: VIBE 2"
    assert told["sensor"] == {"kind": "imu", "number": 1, "others": [2]}


def test_hostile_texts_stay_texts(made):
    flight, analysis = made
    finding = FINDINGS[0]._replace(text=HOSTILE, evidence=HOSTILE, unit=HOSTILE)
    context = flight.context._replace(
        firmware=HOSTILE,
        vehicle=HOSTILE,
        modes=(Span(0.0, 600.0, HOSTILE),),
        attitudes=tuple(track._replace(name=HOSTILE) for track in flight.context.attitudes),
        said=(Said(3.0, Severity.INFO, HOSTILE),),
        missing=(HOSTILE,),
        notes={HOSTILE: 1},
    )
    html = page_of(
        flight._replace(
            name=HOSTILE, file=HOSTILE, kind=HOSTILE, context=context, findings=(finding,),
            states=(Span(0.0, 600.0, HOSTILE),), notices=((1.0, "INFO", HOSTILE),),
            why_no_estimate=HOSTILE, rejected={HOSTILE: 2},
        ),
        analysis,
    )  # fmt: skip
    assert "<script>alert" not in html
    assert "<img" not in html
    assert "\u202e" not in html
    assert html.count("&lt;script&gt;alert(&#x27;x&#x27;)") > 10


def test_nothing_outside_of_the_file_is_asked_for(made):
    html = page_of(*made)
    assert not re.search(r"<link(?! rel=\"icon\" href=\"data:,\")", html)
    assert not re.search(r"<script[^>]*\bsrc\b|@import|url\(|<iframe|<img", html)
    addresses = {match[0] for match in re.finditer(r"https?://[\w./-]+", html)}
    assert addresses == {"https://github.com/leeoniya/uPlot"}  # the library's own name, a comment


@pytest.mark.thorough
def test_half_an_hour_of_three_imus_at_400_hz_is_below_5_mb():
    flight = made_flight(1800.0, 400.0, imus=3)
    assert len(page_of(flight, made_analysis(flight)).encode()) <= 5_000_000


def test_the_document_holds_what_the_page_tells(made):
    flight, analysis = made
    found = json.loads(json.dumps(document(flight, analysis), allow_nan=False))
    assert found["name"] == "made"
    assert found["start_utc"] == "2023-11-14T22:13:20Z"
    assert [one["kind"] for one in found["findings"]] == [
        "compass_field", "autopilot_heading", "gps_lost", "vibration_line",
    ]  # fmt: skip
    assert found["findings"][0]["from_s"] == MAGNET_S[0]
    assert found["findings"][2]["text"] == GPS_LOST.text
    assert found["certainty"]["smoothed"]["tilt"]["median_deg"] == pytest.approx(0.15)
    assert found["certainty"]["states_s"]["degraded: attitude contradicts field"] == 110.0
    tested = found["certainty"]["tested"]["attitude by GPS velocity"]
    assert len(tested["spans"]) == 2
    assert tested["share_percent"] == pytest.approx(90.3, abs=0.2)
    assert [one["imu"] for one in found["imus"]] == [1, 2]
    assert found["compasses"][0]["throttle_percent"][-1] == 100.0


def test_parameters_are_told_as_they_were_set_those_of_the_attitude_first(made):
    flight, analysis = made
    own = {
        "WPNAV_SPEED": 500.0,
        "EK3_ENABLE": 1.0,
        "COMPASS_DEV_ID": 658953.0,
        "COMPASS_OFS_X": float(np.float32(12.3)),
        "ATC_RAT_RLL_P": math.nan,
        HOSTILE: 1.0,
    }
    flight = flight._replace(context=flight.context._replace(parameters=own))
    found = document(flight, analysis)["parameters"]
    assert list(found.items()) == [
        ("COMPASS_DEV_ID", 658953),
        ("COMPASS_OFS_X", 12.3),
        ("EK3_ENABLE", 1),
        (HOSTILE, 1),
        ("ATC_RAT_RLL_P", None),
        ("WPNAV_SPEED", 500),
    ]
    html = page_of(flight, analysis)
    places = [html.index(f"<td>{text}</td>") for text in ("658953", "12.3", "no number", "500")]
    assert places == sorted(places)
    assert "<script>alert" not in html


def test_however_many_parameters_a_recording_names_the_page_stays_small(made):
    flight, analysis = made
    many = {f"P{number:07}": 1.0 for number in range(100_000)}
    flight = flight._replace(context=flight.context._replace(parameters=many))
    assert len(document(flight, analysis)["parameters"]) == 4000


def test_differences_are_those_that_were_made(made):
    rows = {one["name"]: one for one in document(*made)["differences"]}
    assert rows["EKF3"]["heading"]["largest_deg"] == pytest.approx(14.2, abs=0.1)
    assert rows["EKF3"]["heading"]["beyond_limit_percent"] == pytest.approx(19.7, abs=0.5)
    assert rows["EKF3"]["tilt"]["largest_deg"] < 0.15
    assert rows["AHRS2"]["tilt"]["median_deg"] == pytest.approx(1.5, abs=0.05)
    assert rows["truth"]["is_truth"]
    assert rows["truth"]["heading"]["beyond_limit_percent"] == 0.0


def test_what_has_no_figure_is_null(made):
    flight, analysis = made
    nan = np.full(len(flight.estimates.t_s), np.nan)
    estimates = flight.estimates._replace(sigma_tilt_rad=nan, sigma_heading_rad=nan)
    found = document(flight._replace(estimates=estimates, smoothed=None), analysis)
    assert found["certainty"]["h2nav"]["tilt"]["median_deg"] is None
    assert found["certainty"]["smoothed"] is None
    assert found["differences"][0]["tilt"]["beyond_limit_percent"] is None
    json.dumps(found, allow_nan=False)


def test_the_document_of_an_empty_recording_has_the_same_keys(made):
    assert document(empty_flight(), Analysis()).keys() == document(*made).keys()


@pytest.mark.parametrize(
    ("seconds", "told"),
    [(0.0, "0 s"), (119.4, "119 s"), (725.0, "12 min 5 s"), (3725.0, "1 h 2 min")],
)
def test_durations_are_told_as_people_do(seconds, told):
    assert duration(seconds) == told


def test_sticks_and_rates_stand_against_what_followed():
    flight, analysis = made_crash()
    html = page_of(flight, analysis)
    section = html[html.index('<section id="control"') : html.index('<section id="height"')]
    assert re.findall(r"<h3>(.*?)</h3>", section) == [
        "Sticks", "Roll rate", "Pitch rate", "Yaw rate",
    ]  # fmt: skip
    told = shown_by(html)["pictures"]
    place = int(re.search(r'data-picture="(\d+)"', section)[1])
    assert [one["label"] for one in told[place]["traces"]] == ["roll", "pitch", "yaw", "throttle"]
    assert [one["label"] for one in told[place + 1]["traces"]] == ["gyro 1", "demand"]
    titles = [one.get("title") for one in told if one.get("window")]
    assert titles[3:5] == ["Sticks", "Motors"]


def test_motors_have_their_numbers_beside_their_lines():
    lanes = [one for one in shown_by(page_of(*made_crash()))["pictures"] if one.get("window")]
    motors = next(one for one in lanes if one.get("title") == "Motors")
    assert [one["tag"] for one in motors["traces"]] == ["1", "2", "3", "4", ""]


def test_the_wind_is_a_track_over_time(made):
    flight, analysis = made
    html = page_of(flight, analysis)
    section = html[html.index('<section id="wind"') :]
    assert "Wind speed" in section
    # 3 m/s to the south and 2 to the east: from 326 deg.
    assert "from 326 to 326 deg" in section[:2000]
    calm = flight.context._replace(wind_n_m_s=None)
    assert 'id="wind"' not in page_of(flight._replace(context=calm), analysis)


def test_an_attitude_from_a_gyro_that_turns_at_rest_is_not_shown(made):
    flight, analysis = made
    turned = Finding(
        Kind.GYRO_BIAS, Sensor(SensorKind.IMU, 1), Severity.ERROR, 0.0, 599.0, 32.0, "deg/s",
        "gyro turns at 32 deg/s at rest", "", "gyro_bias.imu1.1",
    )  # fmt: skip
    spins = page_of(flight._replace(findings=(turned,)), analysis)
    assert "Our own attitude is not shown" in text_of(spins)
    assert 'id="attitude"' in spins  # the autopilot's
    assert 'id="difference"' not in spins
    assert 'id="certainty"' not in spins
    labels = {t["label"] for p in shown_by(spins)["pictures"] for t in p.get("traces", ())}
    assert not any(label.startswith("h2nav") for label in labels)
    alone = flight._replace(
        findings=(turned,), lanes=(), context=flight.context._replace(imus=flight.context.imus[:1])
    )
    assert "Our own attitude is not shown" in text_of(page_of(alone, analysis))
    # Another IMU's gyro, or a small one, takes nothing away; half a flight only that half.
    for harmless in (turned._replace(sensor=Sensor(SensorKind.IMU, 2)), turned._replace(size=3.0)):
        html = page_of(flight._replace(findings=(harmless,)), analysis)
        assert 'id="difference"' in html
        assert "is not shown" not in text_of(html)
    half = page_of(flight._replace(findings=(turned._replace(to_s=300.0),)), analysis)
    assert 'id="difference"' in half


@pytest.mark.parametrize(("step_s", "is_shown"), [(0.1, True), (0.2, False)])
def test_rates_are_drawn_beside_their_demand_if_they_are_logged_often(step_s, is_shown):
    t_s = np.arange(0.0, 20.0, step_s)
    t_s[t_s > 10.0] += 1000.0  # two flights in one log
    demand = Series(t_s, np.zeros((len(t_s), 3)))
    context = Context(duration_s=1020.0, imus=(imu_track(t_s),), demanded_rates=demand)
    for picture in rate_lines(context, Columns(context.duration_s, COARSE)):
        assert [one.label for one in picture.traces] == ["gyro 1"] * is_shown + ["demand"]


def test_what_was_not_looked_at_stands_apart_below_the_verdict():
    html = page_of(empty_flight(), Analysis(blind=(("GPS", "no receiver"),)))
    assert '<span class="blind"><b>Not looked at:</b> GPS (no receiver).</span>' in html


def test_pictures_have_words_and_headings_have_an_order(made):
    for html in (page_of(*made), page_of(*made_crash())):
        places = re.findall(r'<div class="plot"([^>]*)>', html)
        words = [re.search(r'role="img" aria-label="([^"]+)"', place)[1] for place in places]
        assert any(re.search(r"Height over time: height -?\d.* to \d+", one) for one in words) or (
            "Height" not in html
        )
        assert all(len(one) > 12 for one in words)
        levels = [int(level) for level in re.findall(r"<h([1-6])", html)]
        assert levels[0] == 1
        assert levels.count(1) == 1
        assert all(after - before <= 1 for before, after in itertools.pairwise(levels))

"""The section of a review that says what could be set better."""

from h2nav.reviews.calibration import calibration_section

SENSOR = {
    "sensor": "compass 1",
    "device": "97539",
    "changes": [{"name": "COMPASS_OFS_X", "old": 5.0, "new": 50.26, "sigma": 1.7}],
    "not_from_these_flights": [],
    "notes": ["it lies turned: <yaw 90>"],
    "shown_by": "residual 73 -> 2 mG rms",
    "figures": {},
}
TOLD = {
    "sensors": [SENSOR],
    "file_name": 'a".param',
    "file": "# flight</pre>\nCOMPASS_OFS_X,50.26\n",
}


def test_old_and_new_stand_side_by_side():
    shown = calibration_section(TOLD)
    assert "<td>COMPASS_OFS_X</td><td>5</td><td>50.26</td><td>1.7</td>" in shown
    assert "Shown by: residual 73 -&gt; 2 mG rms." in shown
    assert "&lt;yaw 90&gt;" in shown


def test_the_file_can_be_saved_and_copied():
    shown = calibration_section(TOLD)
    assert 'download="a&quot;.param"' in shown
    assert "COMPASS_OFS_X%2C50.26%0A" in shown
    assert "# flight&lt;/pre&gt;<br>COMPASS_OFS_X,50.26" in shown


def test_a_reason_stands_where_there_is_nothing_to_set():
    nothing = SENSOR | {"changes": [], "notes": [], "not_from_these_flights": ["no turns"]}
    shown = calibration_section({"sensors": [nothing], "file": ""})
    assert "Nothing to set: no turns." in shown
    assert "download" not in shown


def test_without_sensors_there_is_no_section():
    assert not calibration_section({})

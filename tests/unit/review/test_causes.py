"""What follows from what, and where a chain begins."""

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.review.causes import first_causes, with_causes
from h2nav.review.verdict import verdict


def found(kind, from_s, cause=None, sensor=SensorKind.VEHICLE, severity=Severity.ERROR):
    text = f"{kind} happened"
    return Finding(
        kind, Sensor(sensor), severity, from_s, from_s + 1.0, 1.0, "", text, "", kind.value, True,
        cause,
    )  # fmt: skip


CRASH = found(Kind.CRASH, 100.0, severity=Severity.CRITICAL)
CLIPPED = found(Kind.CLIPPING, 100.5, sensor=SensorKind.IMU)
BEFORE = found(Kind.GPS_LOST, 20.0, sensor=SensorKind.GPS)
LONG_AFTER = found(Kind.GYRO_FROZEN, 130.0, sensor=SensorKind.IMU)


def test_what_begins_with_an_impact_follows_from_it():
    some = with_causes([CRASH, CLIPPED, BEFORE, LONG_AFTER])
    assert [one.cause for one in some] == [None, "crash", None, None]


def test_a_chain_leads_to_its_beginning_and_a_circle_ends():
    chain = [BEFORE, CRASH._replace(cause="gps_lost"), CLIPPED._replace(cause="crash")]
    assert first_causes(chain) == {"gps_lost": None, "crash": "gps_lost", "clipping": "gps_lost"}
    circle = [CRASH._replace(cause="clipping"), CLIPPED._replace(cause="crash")]
    assert set(first_causes(circle)) == {"crash", "clipping"}


def test_the_sentence_begins_with_a_cause_and_counts_the_others():
    assert verdict([]) == "Nothing was found wrong."
    assert verdict([CRASH]) == "At 100 s: vehicle: crash happened."
    said = verdict(with_causes([CRASH, CLIPPED]))
    assert said == "At 100 s: vehicle: crash happened; 1 more thing was found wrong."

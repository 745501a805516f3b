"""Where a chain of causes begins."""

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.reviews.causes import first_causes


def found(kind, cause=None):
    return Finding(
        kind, Sensor(SensorKind.VEHICLE), Severity.ERROR, 100.0, 101.0, 1.0, "", "text", "",
        kind.value, True, cause,
    )  # fmt: skip


def test_a_chain_leads_to_its_beginning_and_a_circle_ends():
    before, crash = found(Kind.GPS_LOST), found(Kind.CRASH, "gps_lost")
    chain = [before, crash, found(Kind.CLIPPING, "crash")]
    assert first_causes(chain) == {"gps_lost": None, "crash": "gps_lost", "clipping": "gps_lost"}
    circle = [found(Kind.CRASH, "clipping"), found(Kind.CLIPPING, "crash")]
    assert set(first_causes(circle)) == {"crash", "clipping"}

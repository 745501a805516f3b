"""What is published of findings, events and reviews is what they are."""

import io
import json

import jsonschema
import pytest
from live_records import finding as finding_record
from made_flight import made_analysis, made_flight
from needs import REPOSITORY
from simulated_flight import SimulatedFlight

from h2nav.apps.console import Console
from h2nav.apps.event_schema import event_schema
from h2nav.apps.panel import Sight
from h2nav.cli import main
from h2nav.integrity.finding_schema import finding_schema, report_schema
from h2nav.integrity.findings import (
    Alarm,
    Finding,
    Findings,
    Kind,
    Phase,
    Sensor,
    SensorKind,
    Severity,
    as_mapping,
)
from h2nav.integrity.kinds import MEANINGS, AnyKind
from h2nav.reviews.document import document
from h2nav.reviews.document_schema import review_schema
from h2nav.reviews.subjects import KINDS
from h2nav.service.records import finding_mapping
from h2nav.service.records import finding_record as flattened

PUBLISHED = {"review": ["review", "--schema"], "event": ["run", "--schema"]}
SECOND = 1_000_000_000


def validator(schema):
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def a_finding(kind: AnyKind) -> Finding:
    meaning = KINDS[kind].meaning
    alarm = Alarm(
        kind, Sensor(meaning.sensors[0], 1), meaning.worst, 2.5, meaning.unit, "text", "shown"
    )
    ledger = Findings()
    ledger.update(1.0, [alarm])
    return ledger.all[0]


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_published_schema_is_the_one_that_is_printed(name, capsys):
    assert main(PUBLISHED[name]) == 0
    published = (REPOSITORY / "docs" / "schema" / f"{name}.json").read_text(encoding="utf-8")
    words = " ".join(PUBLISHED[name])
    assert published == capsys.readouterr().out, f"h2nav {words} > docs/schema/{name}.json"


@pytest.mark.parametrize("kind", KINDS)
def test_a_finding_of_any_kind_is_as_the_schema_says(kind):
    finding = a_finding(kind)
    reviewed = {"consequence_of": None, "about": "vehicle", "means": "", "check": ""}
    schema = review_schema()["$defs"]["finding"]
    validator(schema).validate(as_mapping(finding) | reviewed)


@pytest.mark.parametrize("kind", MEANINGS)
def test_a_finding_in_flight_is_as_the_schema_says(kind):
    finding = a_finding(kind)
    validator(finding_schema()).validate(as_mapping(finding))
    for phase in Phase:
        validator(report_schema()).validate(finding_mapping(flattened(phase, finding)))


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": "unheard_of"},
        {"severity": "fatal"},
        {"severity": 3},
        {"sensor": "imu"},
        {"is_open": None},
        {"to_s": "late"},
    ],
)
def test_the_schema_refuses_what_is_no_finding(wrong):
    mapping = {**as_mapping(a_finding(Kind.VIBRATION)), **wrong}
    assert list(validator(finding_schema()).iter_errors(mapping))


def test_the_live_page_is_sent_the_same_object():
    mapping = finding_mapping(finding_record())
    validator(report_schema()).validate(mapping)
    assert mapping["sensor"] == {"kind": "gps", "number": None, "others": []}


def test_a_flat_record_has_all_of_a_finding():
    finding = a_finding(Kind.GYRO_FROZEN)._replace(cause="crash.vehicle.1")
    assert finding_mapping(flattened(Phase.END, finding)) == {
        **as_mapping(finding),
        "phase": "end",
    }


def test_a_review_is_as_the_schema_says():
    flight = made_flight(120.0, 50.0)
    found = json.loads(json.dumps(document(flight, made_analysis(flight))))
    validator(review_schema()).validate(found)
    assert found["findings"]
    for each in found["findings"]:
        meaning = KINDS[each["kind"]].meaning
        assert each["unit"] in meaning.unit.split(" | ")
        assert SensorKind(each["sensor"]["kind"]) in meaning.sensors
        assert Severity.of(each["severity"]) >= meaning.worst


def test_events_are_as_the_schema_says(capsys):
    console = Console(events_as_json=True, stream=io.StringIO())
    for phase in Phase:
        console.finding(SECOND, phase, a_finding(Kind.GPS_VELOCITY))
    console.notice(SECOND, Severity.NOTICE, "hello")
    flight = SimulatedFlight("hover").run(2.0)
    service = flight.pipeline.service
    sight = Sight(service.health, service.status(flight.t_ns), None)
    console.started(SECOND, {"version": "1", "kernels": "native", "link": "udpin:", "log": ""})
    late = console.catch_up(SECOND, sight, [a_finding(Kind.GPS_VELOCITY)])
    lines = [*capsys.readouterr().out.splitlines(), *late]
    events = [json.loads(line) for line in lines]
    kinds = [event.get("phase", event["event"]) for event in events]
    assert kinds == [
        *("begin", "update", "end", "notice", "started"),
        *("started", "status", "update"),
    ]
    check = validator(event_schema())
    for event in events:
        check.validate(event)

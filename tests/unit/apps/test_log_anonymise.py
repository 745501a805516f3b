"""The command `h2nav log anonymise`."""

import json
import secrets
from types import SimpleNamespace

import numpy as np
import pytest
from made_logs import DataflashWriter
from replayed import rewritten

from h2nav.apps import log_anonymise
from h2nav.apps.log_anonymise import differences
from h2nav.cli import BAD_INPUT, SUCCESS, main
from h2nav.errors import BadInput
from h2nav.recordings import anonymous_place
from h2nav.recordings.anonymous import Coordinates


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    return rewritten(tmp_path_factory.mktemp("flight") / "short.tlog", first_s=12.0)


def test_a_flight_elsewhere_has_the_same_findings(flight, tmp_path, capsys):
    output = tmp_path / "new.tlog"
    assert main(["log", "anonymise", str(flight), "-o", str(output), "--json"]) == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert found["remains"] == []
    assert found["differences"] == []
    assert found["moved"]
    assert found["weeks"] >= 1
    assert found["replaced"]["places"] > 50
    assert main(["log", "anonymise", str(flight), "-o", str(output)]) == BAD_INPUT
    assert "exists" in capsys.readouterr().err


def test_a_place_of_ones_own(flight, tmp_path, capsys):
    output = tmp_path / "new.tlog"
    words = ["log", "anonymise", str(flight), "-o", str(output), "--no-check", "--keep-date"]
    assert main([*words, "--to", "47.4"]) == BAD_INPUT
    assert "expected LAT,LON" in capsys.readouterr().err
    assert main([*words, "--to", "47.4,8.5", "--far"]) == BAD_INPUT
    assert not output.exists()
    capsys.readouterr()
    assert main([*words, "--to", "47.4,8.5"]) == SUCCESS
    assert "not reviewed" in capsys.readouterr().out


ONE, OTHER = (
    {
        "kind": kind, "source": "IMU 1", "severity": "warning", "from_s": 1.0, "to_s": 2.0,
        "text": "near a magnet",
    }
    for kind in ("magnet", "iron")
)  # fmt: skip


@pytest.fixture
def reviewed(monkeypatch):
    """Reviews that find what a test puts into the list; the bytes that they were given."""
    found, given = [], []

    def review(path):
        given.append(path.read_bytes())
        return {"airframe": {"uid": ""}, "findings": found[len(given) - 1]}

    monkeypatch.setattr(log_anonymise, "_reviewed", review)
    return found, given


@pytest.mark.thorough
def test_another_place_is_drawn_where_a_finding_is_at_its_limit(flight, tmp_path, capsys, reviewed):
    found, given = reviewed
    found += [[ONE], [], [ONE]]
    output = tmp_path / "new.tlog"
    words = ["log", "anonymise", str(flight), "-o", str(output), "--json"]
    assert main(words) == SUCCESS
    document = json.loads(capsys.readouterr().out)
    assert document["draws"] == 2
    assert document["differences"] == document["remains"] == []
    assert document["path"] == str(output)
    assert output.read_bytes() == given[2] != given[1]
    assert list(tmp_path.iterdir()) == [output]


@pytest.mark.thorough
def test_of_places_that_all_differ_the_best_is_kept(flight, tmp_path, capsys, reviewed):
    found, given = reviewed
    found += [[ONE, OTHER], [], [], [ONE], [], [OTHER]]
    output = tmp_path / "new.tlog"
    words = ["log", "anonymise", str(flight), "-o", str(output), "--json"]
    assert main(words) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["draws"] == 5
    assert document["differences"] == ["no longer found: warning: 1.0 s: IMU 1: near a magnet"]
    assert output.read_bytes() == given[3]
    assert list(tmp_path.iterdir()) == [output]


def test_a_place_of_ones_own_is_drawn_once(flight, tmp_path, capsys, reviewed):
    found, given = reviewed
    found += [[ONE], []]
    output = tmp_path / "new.tlog"
    words = ["log", "anonymise", str(flight), "-o", str(output), "--json", "--to", "47.4,8.5"]
    assert main(words) == 1
    assert len(given) == 2


def test_what_cannot_be_done_is_named(tmp_path, capsys):
    path = tmp_path / "x.bin"
    path.write_bytes(b"nothing")
    assert main(["log", "anonymise", str(path), "-o", str(tmp_path / "y")]) == BAD_INPUT
    assert "not a recording" in capsys.readouterr().err


def test_findings_that_differ_are_told():
    one = {
        "kind": "magnet", "source": "IMU 1", "severity": "warning", "from_s": 1.0, "to_s": 2.0,
        "text": "near a magnet",
    }  # fmt: skip
    assert differences([one], [one]) == []
    assert differences([one], [{**one, "from_s": 1.3}]) == []
    assert len(differences([one], [{**one, "from_s": 3.0}])) == 2
    assert differences([one], []) == ["no longer found: warning: 1.0 s: IMU 1: near a magnet"]


@pytest.mark.parametrize("kind", ["kind", "source", "severity"])
def test_a_finding_of_another_kind_is_another_one(kind):
    assert len(differences([ONE], [{**ONE, kind: "other"}])) == 2


@pytest.mark.parametrize("name", ["from_s", "to_s"])
@pytest.mark.parametrize(("later_s", "count"), [(0.5, 0), (-0.5, 0), (0.51, 2), (-0.51, 2)])
def test_findings_are_the_same_within_half_a_second(name, later_s, count):
    assert len(differences([ONE], [{**ONE, name: ONE[name] + later_s}])) == count


def test_each_finding_has_one_counterpart():
    late = {**ONE, "from_s": 1.4}
    assert differences([ONE, ONE], [late]) == [
        "no longer found: warning: 1.0 s: IMU 1: near a magnet"
    ]
    assert differences([ONE], [OTHER, late, late]) == [
        "newly found: warning: 1.0 s: IMU 1: near a magnet",
        "newly found: warning: 1.4 s: IMU 1: near a magnet",
    ]


DOCUMENT = {
    "path": "new.tlog", "moved": True, "weeks": 3, "draws": 1, "signatures_dropped": 0,
    "replaced": {"places": 5, "dates": 0, "other_bytes": 7}, "remains": [], "findings": 2,
    "differences": [],
}  # fmt: skip
REPLACED = "new.tlog: 5 places, 7 other bytes replaced or removed"
SAME = "the reviews of both have the same findings (2)"


@pytest.mark.parametrize(
    ("changes", "out", "err", "status"),
    [
        ({}, [REPLACED, SAME], [], 0),
        (
            {"replaced": {"places": 0}, "moved": False},
            [
                "new.tlog: nothing replaced or removed",
                "it holds no position, so nothing was moved",
                SAME,
            ],
            [],
            0,
        ),
        (
            {"signatures_dropped": 4, "draws": 2},
            [
                REPLACED,
                "4 frames were signed: their signatures are dropped",
                SAME,
                "2 places were tried",
            ],
            [],
            0,
        ),
        ({"differences": None, "findings": None}, [REPLACED, "not reviewed"], [], 0),
        ({"remains": ["a", "b"]}, [REPLACED, SAME], ["remained: a", "remained: b"], 1),
        ({"differences": ["newly found: x"]}, [REPLACED], ["newly found: x"], 1),
    ],
)
def test_what_was_done_and_what_is_wrong_are_told(
    tmp_path, monkeypatch, capsys, changes, out, err, status
):
    document = {**DOCUMENT, **changes}
    monkeypatch.setattr(log_anonymise, "_best", lambda _: document)
    args = SimpleNamespace(output=tmp_path / "new.tlog", to=None, far=False, json=False)
    assert log_anonymise.run(args) == status
    told = capsys.readouterr()
    assert told.out.splitlines() == out
    assert told.err.splitlines() == [f"h2nav: {line}" for line in err]
    args.json = True
    assert log_anonymise.run(args) == status
    told = capsys.readouterr()
    assert (json.loads(told.out), told.err) == (document, "")


def asked(**words):
    return SimpleNamespace(**{"to": None, "far": False, "keep_date": False, **words})


@pytest.mark.parametrize(
    ("to", "place"),
    [
        ("47.4,8.5", (47.4, 8.5)),
        (" 89 , -180 ", (89.0, -180.0)),
        ("-89,180", (-89.0, 180.0)),
        ("89.1,0", "expected at most 89 and 180 degrees"),
        ("-89.1,0", "expected at most 89 and 180 degrees"),
        ("0,180.1", "expected at most 89 and 180 degrees"),
        ("nan,0", "expected at most 89 and 180 degrees"),
        ("0,nan", "expected at most 89 and 180 degrees"),
        ("47.4", "expected LAT,LON in degrees, such as 47.4,8.5"),
        ("1,2,3", "expected LAT,LON in degrees, such as 47.4,8.5"),
        ("north,east", "expected LAT,LON in degrees, such as 47.4,8.5"),
    ],
)
def test_a_place_that_is_named_is_on_the_earth(to, place):
    if isinstance(place, str):
        with pytest.raises(BadInput) as caught:
            log_anonymise._target(asked(to=to), None, None)
        assert str(caught.value) == f"--to {to}: {place}"
    else:
        found = log_anonymise._target(asked(to=to), Coordinates(1.0, 2.0), 1e9)
        assert tuple(found.place) == place


@pytest.mark.parametrize(("words", "weeks"), [({}, range(1, 401)), ({"keep_date": True}, range(1))])
def test_dates_go_back_by_up_to_400_weeks(monkeypatch, words, weeks):
    drawn = []

    def choice(allowed):
        drawn.append(allowed)
        return allowed[-1]

    monkeypatch.setattr(secrets, "choice", choice)
    found = log_anonymise._target(asked(to="47.4,8.5", **words), None, None)
    assert (drawn, found.weeks) == ([weeks], weeks[-1])


@pytest.mark.parametrize(
    ("words", "origin", "unix_s", "called"),
    [
        ({}, None, 1e9, None),
        ({"far": True}, (1.0, 2.0), 1e9, ("random", (1.0, 2.0), 5)),
        ({}, (1.0, 2.0), 1e9, ("similar", (1.0, 2.0), 1e9, range(1, 401), 5)),
        ({"keep_date": True}, (1.0, 2.0), 1e9, ("similar", (1.0, 2.0), 1e9, range(1), 5)),
        ({}, (1.0, 2.0), None, ("similar", (1.0, 2.0), 1_735_689_600.0, range(1), 5)),
    ],
)
def test_a_place_is_drawn_with_a_field_like_the_old_one_unless_it_may_be_anywhere(
    monkeypatch, words, origin, unix_s, called
):
    calls = []

    def noted(name):
        return lambda *args: calls.append((name, *args)) or name

    monkeypatch.setattr(secrets, "randbits", lambda bits: 5 if bits == 64 else None)
    monkeypatch.setattr(anonymous_place, "random_place", noted("random"))
    monkeypatch.setattr(anonymous_place, "similar_place", noted("similar"))
    found = log_anonymise._target(asked(**words), origin, unix_s)
    assert calls == ([] if called is None else [called])
    if called is None:
        assert tuple(found.place) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("differing", "words", "draws", "kept"),
    [
        ([0], {}, 1, 0),
        ([2, 2, 1, 3, 1, 0], {}, 5, 2),
        ([1, 0], {}, 2, 1),
        ([1, 0], {"to": "1,2"}, 1, 0),
        ([1, 0], {"far": True}, 1, 0),
    ],
)
def test_up_to_five_places_are_drawn_and_the_best_is_kept(
    tmp_path, monkeypatch, differing, words, draws, kept
):
    made = []

    def drawn(args, kind, fixes, unix_s, output):
        output.write_text(str(len(made)))
        document = {"path": str(output), "moved": True, "draws": 1, "remains": []}
        made.append(document)
        return document

    def checked(document, fixes, old):
        document["differences"] = ["x"] * differing[made.index(document)]

    monkeypatch.setattr(log_anonymise, "_kind", lambda path: "frames")
    monkeypatch.setattr(log_anonymise, "_facts", lambda kind, path: ([], None))
    monkeypatch.setattr(log_anonymise, "_reviewed", lambda path: {})
    monkeypatch.setattr(log_anonymise, "_drawn", drawn)
    monkeypatch.setattr(log_anonymise, "_check", checked)
    output = tmp_path / "new.tlog"
    found = log_anonymise._best(asked(log="in", output=output, no_check=False, **words))
    assert (found["draws"], len(found["differences"])) == (draws, differing[kept])
    assert found["path"] == str(output)
    assert output.read_text() == str(kept)
    assert list(tmp_path.iterdir()) == [output]


def test_the_kind_is_that_of_the_content(tmp_path):
    path, dataflash = tmp_path / "flight.x", DataflashWriter()
    dataflash.add("GPS", "QB", "TimeUS,Status", np.arange(3), 3)
    for content, kind in (dataflash.bytes(), "dataflash"), (b"ULog\x01\x12\x35\x01", "ulog"):
        path.write_bytes(content)
        assert log_anonymise._kind(path) == kind


def test_a_dataflash_log_as_text_is_refused_with_what_is_expected(tmp_path):
    path = tmp_path / "flight.log"
    path.write_text("FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n")
    with pytest.raises(BadInput) as caught:
        log_anonymise._kind(path)
    said = f"{path}: a dataflash log as text; expected the binary one (.bin)"
    assert str(caught.value) == said

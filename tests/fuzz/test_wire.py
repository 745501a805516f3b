"""A fixed part of the fuzzing of the wire, and every input that once broke something.

``make fuzz`` does the same for as long as one likes.
"""

import contextlib
from pathlib import Path

import pytest

from fuzz import wire_targets
from fuzz.attacks import Attacker, Written
from fuzz.clean_sessions import CONFIGURATIONS
from fuzz.wire_targets import begun

CORPUS = Path(__file__).parent / "corpus"
KEPT = [(path.parent.name, path) for path in sorted(CORPUS.glob("*/*"))]
ATTACK_FRAMES = 600
INPUTS = {"deframer": 60, "codec": 12}


@pytest.mark.parametrize(
    ("target", "path"),
    [(target, path) for target, path in KEPT if target in wire_targets.TARGETS],
    ids=lambda value: value.name if isinstance(value, Path) else value,
)
def test_what_once_broke_something_does_not_any_more(target, path, tmp_path):
    wire_targets.run(target, path.read_bytes(), tmp_path)


@pytest.mark.parametrize("target", INPUTS)
def test_the_rules_hold_on_made_up_input(target, tmp_path):
    for seed in range(INPUTS[target]):
        wire_targets.explore(target, seed, tmp_path)


@pytest.mark.parametrize("seed", range(len(CONFIGURATIONS)), ids=list(CONFIGURATIONS))
def test_the_service_survives_an_attack_and_is_active_after_it(seed, tmp_path):
    wire_targets.explore("service", seed, tmp_path, ATTACK_FRAMES)


def test_a_written_session_feeds_the_same_again():
    """Else the file of a failure would not repeat it."""
    name = "default-float-twist"
    session = begun(name, is_active_first=True)
    for _ in range(300):
        session.frame(session.honest())
    written = Written.from_text(Written(name, True, session.events).as_text())
    again = begun(name, is_active_first=True)
    for event in written.events:
        again.repeat(event)
    assert again.pipeline.service.health == session.pipeline.service.health
    assert again.pipeline.service.rejected == session.pipeline.service.rejected


def test_the_same_seed_attacks_in_the_same_way():
    """Whether the service survives it or not."""
    name = "default-float-wheels"
    texts = []
    for _ in range(2):
        session = begun(name, is_active_first=False)
        with contextlib.suppress(Exception):
            Attacker(session, 3).attack(300)
        texts.append(Written(name, False, session.events).as_text())
    assert texts[0] == texts[1]

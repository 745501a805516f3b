"""The recipes of ARCHITECTURE.md, "Where to add something": executed on a copy, and what they name.

`tests/unit/translate/test_new_state.py` executes that of a filter's state.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from needs import REPOSITORY

TOP = ("docs", "gains", "tests", "tools", "configs", "packaging", "native")
A_FILE = re.compile(r"[\w./*-]+(?:\.(?:py|md|yaml|toml|json|js|sh|css)|/)")
# What a recipe tells to create, and generated folders.
NEW = {"memory.py", "kernel/", "gains.py", "filter.py"}

SUBJECT = """
from h2nav.integrity.findings import SensorKind, Severity
from h2nav.integrity.kinds import FlightKind, Meaning
from h2nav.reviews.declared import Declared, ReviewSubject

MADE = FlightKind("made_by_a_recipe")
KINDS = (
    Declared(MADE, Meaning((SensorKind.VEHICLE,), Severity.INFO, "m", "It means.", "Nothing.")),
)
SUBJECT = ReviewSubject("a made one", KINDS, (), lambda evidence: [])
"""
COMMAND = '''
"""A made command."""


def add_arguments(parser):
    parser.add_argument("--made")


def run(arguments):
    return 0
'''
# recipe -> (files: what is replaced in them and by what, or the text of a new one), what then holds
RECIPES = {
    "A finding of a whole flight": (
        {"h2nav/reviews/subjects/made.py": SUBJECT},
        "from h2nav.reviews.document_schema import review_schema\n"
        "from h2nav.reviews.subjects import SECTIONS, SUBJECTS\n"
        "assert SECTIONS['made_by_a_recipe'] == 'timeline'\n"
        "assert 'a made one' in [one.name for one in SUBJECTS]\n"
        "assert 'made_by_a_recipe' in str(review_schema())\n",
    ),
    "A field of a log": (
        {
            "h2nav/recordings/field_tables.py": (
                "SERIES = (\n",
                'SERIES = (\n    Field("made", "V", dataflash=(series("POWR", "VServo"),)),\n',
            )
        },
        "from h2nav.recordings.columns import Format, messages_of\n"
        "from h2nav.recordings.field_tables import FIELDS\n"
        "assert 'made' in [one.name for one in FIELDS]\n"
        "assert 'POWR' in messages_of(Format.DATAFLASH, FIELDS)\n",
    ),
    "A command": (
        {
            "h2nav/apps/made.py": COMMAND,
            "h2nav/cli.py": (
                '        ("demo",): CommandEntry(\n',
                '        ("made",): CommandEntry("made", "a made one", "made"),\n'
                '        ("demo",): CommandEntry(\n',
            ),
        },
        "from h2nav.cli import main\nassert main(['made', '--made', 'x']) == 0\n",
    ),
    "A configuration key": (
        {
            "h2nav/service/settings.py": (
                "    lanes: Lanes = \"auto\"\n",
                "    made_hz: RateHz = 3.0\n    lanes: Lanes = \"auto\"\n",
            )
        },
        "import contextlib, io\n"
        "from h2nav.cli import main\n"
        "out = io.StringIO()\n"
        "with contextlib.redirect_stdout(out):\n"
        "    assert main(['check-config', '--schema']) == 0\n"
        "assert '\"made_hz\"' in out.getvalue()\n",
    ),
}  # fmt: skip


def where_to_add() -> dict[str, str]:
    """Recipe -> its text."""
    text = (REPOSITORY / "ARCHITECTURE.md").read_text(encoding="utf-8")
    section = text[text.index("## Where to add something") : text.index("## What holds everywhere")]
    parts = re.split(r"(?:^\* |(?<=\. ))\*(An? [^*]+)\*[,:]", section, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@pytest.mark.parametrize("recipe", where_to_add())
def test_what_a_recipe_names_exists(recipe: str) -> None:
    text = where_to_add()[recipe]
    named = {
        word for quoted in re.findall(r"`([^`]+)`", text) for word in quoted.split()
        if A_FILE.fullmatch(word)
    }  # fmt: skip
    lost = {name for name in named if not exists(name)}
    assert not lost - (NEW if recipe == "A filter" else set())


def exists(name: str) -> bool:
    """At the top; inside `h2nav/`; or, where the recipe has named the room, anywhere in it."""
    if (name.partition("/")[0] in TOP or "/" not in name) and any(REPOSITORY.glob(name)):
        return True
    return any((REPOSITORY / "h2nav").glob(name)) or any((REPOSITORY / "h2nav").rglob(name))


def test_the_check_sees_a_file_that_is_gone() -> None:
    assert exists("reviews/page.py")
    assert not exists("reviews/no_such_page.py")
    assert len(where_to_add()) > 30


@pytest.mark.parametrize("recipe", RECIPES)
def test_a_recipe_does_what_it_says_and_touches_no_other_file(recipe: str, tmp_path: Path) -> None:
    changes, check = RECIPES[recipe]
    text = where_to_add()[recipe]
    ignored = shutil.ignore_patterns("__pycache__", "*.so")
    shutil.copytree(REPOSITORY / "h2nav", tmp_path / "h2nav", ignore=ignored)
    for path, change in changes.items():
        place = tmp_path / path
        assert (path.removeprefix("h2nav/") in text) or (str(Path(path).parent)[6:] + "/" in text)
        if isinstance(change, str):
            assert not place.exists()
            place.write_text(change, encoding="utf-8")
        else:
            before, after = change
            whole = place.read_text(encoding="utf-8")
            assert whole.count(before) == 1, path
            place.write_text(whole.replace(before, after), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", check],
        cwd=tmp_path, env={"PYTHONPATH": str(tmp_path), "PATH": "/usr/bin"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr

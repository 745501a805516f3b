"""tools/mutants.py: faults are what they say, and what notices one is told from what does not."""

import importlib.util
import sys

import pytest
from needs import REPOSITORY

TOOLS = REPOSITORY / "tools"
MODULE = "h2nav/sums.py"
SOUND = b"""def clipped(value, most=3):
    if value > most:
        return most
    return value


def unheard(value):
    return value + 1
"""
TESTS = """import pytest

from h2nav.sums import clipped, unheard


@pytest.mark.parametrize("value", [2, 3])
def test_what_is_small_stays(value):
    assert clipped(value) == value


def test_what_is_large_is_clipped():
    assert clipped(7) == 3


def test_it_is_called():
    unheard(1)
"""


@pytest.fixture(scope="module")
def tool():
    sys.path.insert(0, str(TOOLS))
    spec = importlib.util.spec_from_file_location("mutants", TOOLS / "mutants.py")
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.path.remove(str(TOOLS))


@pytest.fixture
def operators(tool):
    return sys.modules["mutation.operators"]


@pytest.fixture
def trial(tool):
    return sys.modules["mutation.trial"]


@pytest.fixture
def tree(tmp_path, trial):
    """A repository with one module and its tests."""
    tree = tmp_path / "tree"
    for name in trial.COPIED:
        if name != "pyproject.toml":
            (tree / name).mkdir(parents=True)
    (tree / "pyproject.toml").write_text(
        '[tool.pytest.ini_options]\nmarkers = ["thorough: long"]\n'
    )
    (tree / "h2nav" / "__init__.py").touch()
    (tree / MODULE).write_bytes(SOUND)
    (tree / "tests" / "test_sums.py").write_text(TESTS)
    return tree


def faults(operators, text):
    """The texts that one text may become."""
    source = text.encode()
    return {found.applied(source).decode() for found in operators.mutants("m.py", source)}


@pytest.mark.parametrize(
    ("text", "becomes"),
    [
        ("a = b + c", {"a = b - c"}),
        ("a = (b) * (c)", {"a = (b) / (c)"}),
        ("a = b < c", {"a = b <= c", "a = b > c"}),
        ("a = b < c <= d", {"a = b <= c <= d", "a = b > c <= d", "a = b < c < d", "a = b < c > d"}),
        ("a = b is not None", {"a = b is None"}),
        ("a = b and c", {"a = b or c"}),
        ("a = not b", {"a = b"}),
        ("a = -b", {"a = b"}),
        ("a = True", {"a = False"}),
        ("a = 7", {"a = 8"}),
        ("a = 999", {"a = 1000"}),
        ("a = 1_000", {"a = 2000"}),  # one more of many is no fault that anybody calls one
        ("a = 0.5", {"a = 1.0", "a = 0.25"}),
        ("a = 0.0", {"a = 1.0", "a = -1.0"}),
        ("f(a)", {"pass"}),
        ("a += b", {"a -= b", "pass"}),
        ("a.b = c", set()),  # outside of a function nothing would run without it
        ("def f(a):\n    a.b = c", {"def f(a):\n    pass"}),
        ("def f():\n    return a", {"def f():\n    return None"}),
        ("def f(a=1):\n    return None", {"def f(a=2):\n    return None"}),
        ("if a:\n    raise B", {"if (not a):\n    raise B", "if a:\n    pass"}),
        ("for a in b:\n    continue", {"for a in b:\n    pass"}),
        ("for a in b:\n    break", {"for a in b:\n    continue"}),
    ],
)
def test_a_fault_is_one_operator_number_or_statement(operators, text, becomes):
    assert faults(operators, text) == becomes


@pytest.mark.parametrize(
    "text",
    [
        '"""A text."""',
        "assert a > 1",
        "a: Literal[3]",
        'a = f"{b + 1}"',
        'a = "b" + c',
        "a = [b] + c",
        "def f(a: Literal[3]) -> Literal[4]:\n    return None",
        "@dataclass(frozen=True)\nclass A:\n    b: int",
        "a = zip(b, c, strict=True)",
        "a = known(b, 0, 5)",
    ],
)
def test_what_no_reader_calls_behaviour_is_left_alone(operators, text):
    assert faults(operators, text) == set()


def test_a_fault_knows_its_line_and_function(operators):
    of_line = {each.line: each.within for each in operators.mutants(MODULE, SOUND)}
    assert of_line == {1: "clipped", 2: "clipped", 3: "clipped", 4: "clipped", 8: "unheard"}


def test_equal_lines_are_drawn_apart(tool, tree, monkeypatch):
    lines = 40
    text = "def f(a):\n" + "    a.b = 1\n" * lines
    (tree / MODULE).write_text(text)
    monkeypatch.setattr(tool, "REPOSITORY", tree)
    room = tool.Room(("h2nav/*.py",), ("tests",))
    drawn = tool.draw([room], lines, seed=1)
    assert sorted(each.line for each in drawn) == list(range(2, lines + 2))
    assert {each.kind for each in drawn} == {"statement", "constant"}
    assert drawn[:5] == tool.draw([room], 5, seed=1)
    assert drawn[:5] != tool.draw([room], 5, seed=2)


def test_what_is_in_reach_begins_with_the_rooms_own(tool, tree):
    files = {
        "h2nav/__init__.py": "",
        "h2nav/deep.py": "",
        "h2nav/above.py": "from h2nav import deep",
        "tests/own/test_long.py": "from h2nav.deep import a" + "  # long" * 100,
        "tests/own/test_short.py": "import h2nav.deep",
        "tests/own/test_deep.py": "",
        "tests/own/test_deeper.py": "from h2nav.deep import a" + "  # long" * 100,
        "tests/own/test_above.py": "from h2nav import above",
        "tests/own/test_else.py": "",
        "tests/other/test_guest.py": "from h2nav.deep import a",
        "tests/other/test_above.py": "from h2nav import above",
    }
    for name, text in files.items():
        (tree / name).parent.mkdir(exist_ok=True)
        (tree / name).write_text(text)
    own, everywhere = (tool.test_files(tree, [suite]) for suite in ("tests/own", "tests"))
    assert tool.in_reach(tree, "h2nav/deep.py", own, everywhere) == (
        "tests/own/test_deeper.py",
        "tests/own/test_deep.py",
        "tests/own/test_short.py",
        "tests/own/test_long.py",
        "tests/other/test_guest.py",
        "tests/own/test_above.py",
    )


def verdicts(operators, trial, tree, tmp_path, judged):
    """Line and new text of every fault of the small tree -> verdict."""
    place = trial.Workplace(tree, tmp_path / "copy", compiled=True)
    found = operators.mutants(MODULE, SOUND)
    told = judged(place, found)
    assert (place.folder / MODULE).read_bytes() == SOUND
    return {(each.line, each.text): one for each, one in zip(found, told, strict=True)}


def told_apart(told):
    """Asserts what the tests of the small tree notice."""
    assert {place for place, one in told.items() if one.fate == "survived"} == {
        (2, ">="),  # 3 or 3
        (8, "-"),
        (8, "2"),
        (8, "None"),
    }
    killed = {place: one.by for place, one in told.items() if one.fate == "killed"}
    assert killed[3, "None"] == "tests/test_sums.py::test_what_is_large_is_clipped"
    assert killed[4, "None"] == "tests/test_sums.py::test_what_is_small_stays[2]"
    assert len(told) == len(killed) + 4


def test_in_forks_what_is_noticed_is_told_from_what_is_not(operators, trial, tree, tmp_path):
    def judged(place, found):
        told = list(place.judge_forked([(each, ["tests/test_sums.py"]) for each in found]))
        # A default value is worked out at import.
        apart = [each.line for each, one in zip(found, told, strict=True) if one is None]
        assert apart == [1]
        return [one or trial.Verdict("killed") for one in told]

    told_apart(verdicts(operators, trial, tree, tmp_path, judged))


@pytest.mark.thorough
def test_in_processes_what_is_noticed_is_told_from_what_is_not(operators, trial, tree, tmp_path):
    chosen = sys.modules["mutation.line_map"].Chosen(("tests/test_sums.py",), budget_s=10.0)
    told_apart(
        verdicts(
            operators, trial, tree, tmp_path,
            lambda place, found: [place.judge(each, chosen) for each in found],
        )
    )  # fmt: skip


def test_a_test_that_fails_without_the_fault_is_no_judge(operators, trial, tree, tmp_path):
    (tree / "tests" / "test_sums.py").write_text("def test_it_fails():\n    assert False\n")
    place = trial.Workplace(tree, tmp_path / "copy", compiled=True)
    fault = operators.mutants(MODULE, SOUND)[-1]
    # The small tree is imported by no test: the file is changed, no function.
    assert [one.fate for one in place.judge_forked([(fault, ["tests/test_sums.py"])])] == [
        "untested"
    ]


def test_what_a_module_uses_at_import_is_left_to_a_process(tool):
    source = b"""
def row(a): return unit(a)
def unit(a): return 2 * a
def form(a): return unit(a) + other(a)
def other(a): return a
def late(a): return a
class Kept:
    def method(self): return other(1)
ROWS = {n: row(n) for n in (1, 2)}
FORMS = sorted((1, 2), key=form)
"""
    assert sys.modules["mutation.forks"].used_at_import(source) == {"row", "unit", "form", "other"}


def test_every_equivalent_is_in_the_source(tool):
    """A row whose line is gone explains nothing any more."""
    gone = []
    for module, within, was, becomes in tool.equivalents():
        source = (REPOSITORY / module).read_bytes()
        lines = source.decode().splitlines()
        near = (
            each
            for each in tool.mutants(module, source)
            if each.within == within and lines[each.line - 1].strip() in was
        )
        if (was, becomes) not in (tool.change(source, each) for each in near):
            gone.append((module, was, becomes))
    assert not gone


def test_a_run_that_was_broken_off_while_it_wrote_goes_on(
    tool, tree, operators, tmp_path, monkeypatch
):
    monkeypatch.setattr(tool, "REPOSITORY", tree)
    one, other = operators.mutants(MODULE, SOUND)[:2]
    path = tmp_path / "results.jsonl"
    killed = tool.Verdict("killed", "a test")
    tool.Results(path).keep(one, killed, tool.NEAR)
    path.write_text(path.read_text() + '{"key": "cut o')
    tool.Results(path).keep(other, killed, tool.NEAR)
    again = tool.Results(path)
    assert [again.verdict(each, tool.NEAR) for each in (one, other)] == [killed, killed]

"""Rules of the code that neither ruff nor import-linter can hold."""

import ast
import functools
import re
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from needs import REPOSITORY

SOURCES = {
    path.relative_to(REPOSITORY).as_posix(): path.read_text(encoding="utf-8")
    for path in sorted((REPOSITORY / "h2nav").rglob("*.py"))
}

# Every kernel declares its records under the same names; `import h2nav` has names for its users.
KERNEL_RECORDS = {"State", "Workspace", "Gains", "Sample"}
FACE = "h2nav/library/"

# Fields that are meant for people.
TEXTS = {"text", "evidence", "notice", "reason", "remark", "source_text"}
PARSERS = {"startswith", "endswith", "split", "partition", "rpartition", "find", "index", "replace"}
# Texts of autopilots and of a simulator's events say what nothing else of theirs does.
OF_OTHERS = {"said", "event"}
OF_AUTOPILOTS = {
    "h2nav/recordings/dataflash.py",  # the version of its firmware
    "h2nav/recordings/telemetry.py",  # the same
}

COUNT = r"\d+|two|three|four|five|ten|hundred"
SPEED = re.compile(rf"\b({COUNT}) (x|times) (as fast|faster|slower|quicker|as long|as quick)")
FIGURE = re.compile(r"\(figure (\w+)\.(\w+)\)")


# Words that were used for what the words of deciding say (ARCHITECTURE.md), and for other things
# that have plain names; patterns of what is not written any more, with the word instead.
PLAIN_WORDS = {
    r"acquit": "clear",
    r"misjudg": "clear",
    r"vouch": "accept",
    r"spoil": "damage, restart",
    r"\bheed": "use, need",
    r"wish": "want, request, option",
    r"\blook_at_\w": "detect",
    r"\.considers\(": "is_candidate",
    r"\b_?led\(": "extrapolated",
    r"\bunled": "filtered",
}
# The bound of a constant is called so; the header of the exported filter keeps its public name.
OLD_BOUND = re.compile(r"(?<!H2NAV_)(?<![A-Za-z0-9])(?:FEWEST|LEAST|MOST)(?![A-Za-z0-9])")
# These say nothing of what they bound or count.
NAMELESS = {"MIN", "MAX", "WINDOW_S", "WINDOW_US", "WINDOW_NS", "NS", "NS_PER_S"}
UNITS = "h2nav/maths/units.py"

# What runs kernels fills their records, which are plain data.
KERNELS_RUN_IN = ("h2nav/attitude/", "h2nav/integrity/watch.py")


@functools.cache
def trees() -> dict[str, ast.Module]:
    """The syntax of every module; not parsed where the tests are only collected."""
    return {path: ast.parse(text) for path, text in SOURCES.items()}


def classes(path: str) -> Iterator[ast.ClassDef]:
    return (node for node in trees()[path].body if isinstance(node, ast.ClassDef))


def test_a_public_class_has_a_name_of_its_own() -> None:
    places = defaultdict(list)
    for path in SOURCES:
        for node in classes(path):
            is_kernels = path.endswith("/memory.py") and node.name in KERNEL_RECORDS
            if not (node.name.startswith("_") or path.startswith(FACE) or is_kernels):
                places[node.name].append(path)
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


@pytest.mark.parametrize("path", [path for path in SOURCES if path.endswith("/memory.py")])
def test_state_and_workspace_share_no_field(path: str) -> None:
    fields = {
        node.name: {
            item.target.id
            for item in node.body
            if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name)
        }
        for node in classes(path)
    }
    assert fields, "a memory declares records"
    assert not fields.get("State", set()) & fields.get("Workspace", set())


def test_nothing_parses_a_text_meant_for_people() -> None:
    found = [
        f"{path}:{node.lineno}: {ast.unparse(node)}"
        for path, tree in trees().items()
        if path not in OF_AUTOPILOTS
        for node in ast.walk(tree)
        if is_parsed(node)
    ]
    assert found == []


def is_text(node: ast.AST) -> bool:
    """Whether it is such a field; `said` and `event` are names of what others have written."""
    if not isinstance(node, ast.Attribute) or node.attr not in TEXTS:
        return False
    return not (isinstance(node.value, ast.Name) and node.value.id in OF_OTHERS)


def is_parsed(node: ast.AST) -> bool:
    """Whether an expression looks into such a text: a method, a comparison, a pattern."""
    match node:
        case ast.Call(func=ast.Attribute(value=value, attr=attr)) if attr in PARSERS:
            return is_text(value)
        case ast.Call(func=ast.Attribute(attr="search" | "match" | "fullmatch" | "sub"), args=args):
            return any(map(is_text, args))
        case ast.Compare(left=left, ops=[ast.In() | ast.NotIn()], comparators=[right]):
            return is_text(right) and isinstance(left, ast.Constant)
        case ast.Subscript(value=value):
            return is_text(value)
    return False


def test_the_rule_sees_a_text_that_is_parsed() -> None:
    parsed = ("a.text.split()", "'IMU' in a.evidence", "re.sub('x', '#', a.reason)", "a.notice[:5]")
    for expression in parsed:
        assert is_parsed(ast.parse(expression, mode="eval").body), expression
    for expression in ("a.text + b", "write(a.text)", "a.cause.split()", "a.text in seen"):
        assert not is_parsed(ast.parse(expression, mode="eval").body), expression


def test_no_object_sets_an_attribute_of_another_one_that_it_holds() -> None:
    found = [
        f"{path}:{target.lineno}: {ast.unparse(target)}"
        for path, tree in trees().items()
        if not path.startswith(KERNELS_RUN_IN)
        for node in ast.walk(tree)
        for target in targets(node)
        if is_of_a_part(target)
    ]
    assert found == []


def targets(node: ast.AST) -> Iterator[ast.expr]:
    """What a statement assigns to."""
    assigned = getattr(node, "targets", []) if isinstance(node, ast.Assign) else []
    if isinstance(node, ast.AugAssign | ast.AnnAssign):
        assigned = [node.target]
    for target in assigned:
        yield from target.elts if isinstance(target, ast.Tuple | ast.List) else (target,)


def is_of_a_part(target: ast.expr) -> bool:
    """Whether it is ``self.part.attribute`` or ``self.parts[i].attribute``."""
    if not isinstance(target, ast.Attribute) or isinstance(target.value, ast.Name):
        return False
    inner = target.value
    while isinstance(inner, ast.Attribute | ast.Subscript):
        inner = inner.value
    return isinstance(inner, ast.Name) and inner.id == "self"


def test_the_rule_sees_an_attribute_of_a_part() -> None:
    def seen(text: str) -> bool:
        return any(is_of_a_part(target) for target in targets(ast.parse(text).body[0]))

    for text in ("self.a.b = 1", "self.a[0].b += 1", "x, self.a.b = 1, 2", "self.a.b: int = 1"):
        assert seen(text), text
    for text in ("self.a = 1", "self.a[0] = 1", "made.a = 1", "self.a.use(b)"):
        assert not seen(text), text


def test_a_claim_of_speed_in_a_docstring_has_a_figure() -> None:
    with Path(REPOSITORY / "docs" / "figures.toml").open("rb") as file:
        figures = tomllib.load(file)
    for path, text in SOURCES.items():
        for claim in SPEED.finditer(text):
            mark = FIGURE.match(text[claim.end() :].lstrip(" ,.\n#"))
            assert mark is not None, f"{path}: {claim[0]!r} quotes no figure of docs/figures.toml"
            assert mark[2] in figures[mark[1]]["figures"], f"{path}: {mark[0]}"


def test_one_word_is_used_for_each_meaning() -> None:
    old = {re.compile(pattern, re.IGNORECASE): word for pattern, word in PLAIN_WORDS.items()}
    found = [
        f"{path}: {text[max(0, place.start() - 20) : place.end() + 20]!r}; say {word}"
        for path, text in written()
        for pattern, word in old.items()
        for place in pattern.finditer(text)
    ]
    assert found == []


def test_bounds_are_called_min_and_max() -> None:
    found = [f"{path}: {name[0]}" for path, text in written() for name in OLD_BOUND.finditer(text)]
    assert found == []


def written() -> Iterator[tuple[str, str]]:
    """What people write here: code, tests, tools and documents, but this file."""
    patterns = ("h2nav/**/*.py", "tests/**/*.py", "tools/**/*.py", "docs/**/*.md", "*.md")
    for path in (path for pattern in patterns for path in sorted(REPOSITORY.glob(pattern))):
        name = path.relative_to(REPOSITORY).as_posix()
        # the history of changes says what things were called
        if path != Path(__file__) and name != "CHANGELOG.md":
            yield name, path.read_text(encoding="utf-8")


def test_a_constant_says_of_what() -> None:
    found = [f"{path}: {name}" for path in SOURCES for name in constants(path) if name in NAMELESS]
    assert found == []


def test_a_constant_of_units_is_declared_once() -> None:
    shared = set(constants(UNITS))
    assert {"DEG", "GRAVITY_M_S2", "SECOND_NS", "EARTH_RADIUS_M"} <= shared
    found = [
        f"{path}: {name} is in {UNITS}"
        for path in SOURCES
        if path != UNITS
        for name in constants(path)
        if name in shared
    ]
    assert found == []


def constants(path: str) -> Iterator[str]:
    """The names that a module assigns at its top."""
    for node in trees()[path].body:
        for target in targets(node):
            if isinstance(target, ast.Name):
                yield target.id

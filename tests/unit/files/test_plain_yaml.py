"""YAML from others: plain data at a bounded cost, anything else refused by line."""

import pytest
import yaml

from h2nav.errors import BadInput
from h2nav.files import gain_files
from h2nav.files.plain_yaml import (
    DEEPEST,
    LARGEST_BYTES,
    LONGEST_NUMBER,
    parse_bytes,
    parse_mapping,
    read_bytes,
    read_mapping,
)


def refusal(data):
    with pytest.raises(BadInput) as caught:
        parse_bytes(data if isinstance(data, bytes) else data.encode(), "file.yaml")
    (line,) = caught.value.lines
    assert line.startswith("file.yaml:")
    assert len(line) < 400
    assert line.isprintable()
    return line


def laughs(levels: int) -> str:
    """Nine aliases a level: nine to the power of the levels values."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    for level in range(levels):
        aliases = ", ".join([f"*a{level}"] * 9)
        lines.append(f"a{level + 1}: &a{level + 1} [{aliases}]")
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: [1, 2", "not YAML"),
        ("- 1\n- 2\n", "expected keys and values, found list"),
        ("\x00", "not YAML"),
        ("a: b\x00c", "not YAML"),
        ("a: 1\n--- \nb: 2", "not YAML"),
        (b"a: \xff\xfe", "not UTF-8"),
        (b"a: 1\nb: \xff", "file.yaml:2: not UTF-8"),
        ("a: 1\nb: 2\na: 3\n", "file.yaml:3: a occurs here and in line 1; remove one of them"),
        ("s:\n  a: 1\n  a: 1\n", "file.yaml:3: a occurs here and in line 2"),
        ("a: &x 1\nb: *x\n", "file.yaml:2: an alias (*x); write the value itself"),
        ("<<: {a: 1}\n", "expected text as key"),
        (laughs(9), "an alias (*a0)"),
        ("a: 2026-13-45", "2026-13-45 reads as a timestamp; put it in quotes"),
        ("a: 2026-01-02", "2026-01-02 reads as a timestamp; put it in quotes"),
        ("1: a", "expected text as key; put it in quotes"),
        ("true: a", "expected text as key"),
        ("? [a, b]\n: c", "expected text as key"),
        ("a: !!int ''", "a tag (tag:yaml.org,2002:int); leave it out"),
        ("a: !!python/object:os.system {}", "a tag"),
        ("a: 0x_", "0x_: not a number"),
        (f"a: {'9' * 400}", "more digits than any setting has"),
        (f"a: {'9' * 5000}", "more digits than any setting has"),
        (f"a: 1{':59' * 5000}", "more digits than any setting has"),
        ("a: 1.0e+999", "1.0e+999: beyond the largest number"),
        (f"a: {'[' * (DEEPEST + 1)}", f"nested more than {DEEPEST} deep"),
        (f"a: {'[' * 100_000}", f"nested more than {DEEPEST} deep"),
        ("a: " + "x" * LARGEST_BYTES, "longer than 1 MiB"),
    ],
)
def test_what_is_not_plain_data_is_one_line_with_its_place(text, says):
    assert says in refusal(text)


def test_scalars_lists_and_mappings_are_read_as_yaml_says():
    text = "a: {b: [1, -2.5, 'x', yes, ~, .inf]}\nc: |\n  two\n  lines\n"
    assert parse_mapping(text, "file.yaml") == yaml.safe_load(text)


@pytest.mark.parametrize("name", gain_files.shipped())
def test_shipped_files_read_as_with_the_usual_loader(name):
    path = gain_files.shipped()[name]
    assert read_mapping(path) == yaml.safe_load(path.read_text())


def test_an_empty_text_is_an_empty_mapping():
    assert parse_mapping("# nothing\n", "file.yaml") == {}


def test_a_missing_file_is_one_line(tmp_path):
    with pytest.raises(BadInput) as caught:
        read_mapping(tmp_path / "nowhere.yaml")
    assert "No such file" in str(caught.value)


def nested(depth):
    """A list in a list ..., in the value of a mapping, which is one more."""
    return "a: " + "[" * depth + "]" * depth


@pytest.mark.parametrize(
    ("just_enough", "too_much", "says"),
    [
        (nested(31), nested(32), "file.yaml:1: nested more than 32 deep"),
        (f"a: {'1' * 64}", f"a: {'1' * 65}", "more digits than any setting has"),
        (f"a: 0.{'1' * 62}", f"a: 0.{'1' * 63}", "more digits than any setting has"),
        ("a: 1.7e+308", "a: 1.8e+308", "file.yaml:1: 1.8e+308: beyond the largest number"),
        ("a: -1.7e+308", "a: -1.8e+308", "file.yaml:1: -1.8e+308: beyond the largest number"),
    ],
)
def test_a_limit_is_reached_and_not_passed(just_enough, too_much, says):
    assert (DEEPEST, LONGEST_NUMBER) == (32, 64)
    assert parse_bytes(just_enough.encode(), "file.yaml") == yaml.safe_load(just_enough)
    assert says in refusal(too_much)


def test_a_file_may_have_a_mebibyte_and_no_byte_more(tmp_path):
    path = tmp_path / "a.yaml"
    text = b"a: 1\n#".ljust(1 << 20, b"x")
    path.write_bytes(text)
    assert read_mapping(path) == {"a": 1}
    assert refusal(text + b"x") == "file.yaml: longer than 1 MiB; expected far less"
    path.write_bytes(text * 3)
    assert len(read_bytes(path)) == (1 << 20) + 1  # as much as shows that it is too long
    with pytest.raises(BadInput, match="longer than 1 MiB"):
        read_mapping(path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: 1\n\nb: &x [1]\nc:\n- *x\n", "file.yaml:5: an alias (*x); write the value itself"),
        ("a: 1\nb: !t 2\n", "file.yaml:2: a tag (!t); leave it out"),
        ("a: 1\nb: !t {}\n", "file.yaml:2: a tag (!t); leave it out"),
        ("a: 1\nb:\n  c: 1\n  2: 1\n", "file.yaml:4: expected text as key; put it in quotes"),
        ("a: 1\n\nb: 2026-01-02\n", "file.yaml:3: 2026-01-02 reads as a timestamp"),
        ("a: 1\nb: [1, =]\n", "file.yaml:2: = reads as a value; put it in quotes"),
        ("a:\n- b: 1\n  b: 2\n", "file.yaml:3: b occurs here and in line 2; remove one of them"),
        ("5", "file.yaml: expected keys and values, found int"),
        ("text", "file.yaml: expected keys and values, found str"),
    ],
)
def test_the_line_is_that_of_the_fault(text, says):
    assert refusal(text).startswith(says)


def test_one_key_in_two_mappings_is_no_repetition():
    text = "a: {x: 1}\nb: {x: 2}\nx: [{x: 3}, {x: 4}]\n"
    assert parse_mapping(text, "file.yaml") == yaml.safe_load(text)


@pytest.mark.parametrize("word", [".inf", "-.inf", "+.INF", ".Inf"])
def test_an_infinity_that_is_meant_is_read(word):
    assert parse_mapping(f"a: {word}", "f") == yaml.safe_load(f"a: {word}")

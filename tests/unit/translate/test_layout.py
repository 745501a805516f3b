"""Layout of the C on small texts: breaks, comments, homes of declarations, what a call writes."""

import ast

import pytest

from h2nav.attitude.record import Row
from h2nav.translate.facts import (
    FLOAT,
    FunctionFacts,
    ScopeState,
    join_scalars,
    join_states,
)
from h2nav.translate.intervals import Interval
from h2nav.translate.layout import (
    broken,
    comment_lines,
    home_blocks,
    inner_blocks,
    mentioned,
    written_arguments,
    written_at_once,
)
from h2nav.translate.runtime import RUNTIME, operations
from h2nav.translate.structs import constant_text, meaning, struct_text


def body(text):
    return ast.parse(text).body


@pytest.mark.parametrize(
    ("line", "lines"),
    [
        ("    " + "a" * 96, ["    " + "a" * 96]),
        ("    " + "a" * 97, ["    " + "a" * 97]),  # nowhere to break
        (
            "    x = " + "a" * 80 + " + " + "b" * 8 + ";",
            ["    x = " + "a" * 80 + " + " + "b" * 8 + ";"],
        ),
        (
            "    x = " + "a" * 80 + " + " + "b" * 9 + ";",
            ["    x = " + "a" * 80 + " +", "        " + "b" * 9 + ";"],
        ),
        # as late as it fits, whatever the operator
        (
            "  f(" + "a" * 40 + " * " + "b" * 40 + ", " + "c" * 40 + " ? " + "d" * 40 + " : e);",
            [
                "  f(" + "a" * 40 + " * " + "b" * 40 + ",",
                "      " + "c" * 40 + " ? " + "d" * 40 + " : e);",
            ],
        ),
        # nothing is broken at the very beginning of a line
        ("    x + " + "a" * 97, ["    x + " + "a" * 97]),
        (
            "    " + " + ".join(["a" * 45] * 5),
            ["    " + "a" * 45 + " + " + "a" * 45 + " +",
             "        " + "a" * 45 + " +", "        " + "a" * 45 + " +", "        " + "a" * 45]
        ),
    ],
)  # fmt: skip
def test_a_line_of_c_has_a_hundred_columns_where_it_can(line, lines):
    assert list(broken(line)) == lines


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("one", ["  /* one */"]),
        ("  one */ two \n", ["  /* one * / two */"]),
        ("one\n\ntwo \nthree", ["  /* one", "   *", "   * two", "   * three", "   */"]),
    ],
)
def test_a_comment_of_c_ends_only_where_it_ends(text, lines):
    assert comment_lines(text, "  ") == lines


BRANCHES = """\
a = 1
if a:
    b = a
    if b:
        c = b
    else:
        c = 2
    d = c
else:
    e = 3
for i in range(n):
    f = e
"""


def test_a_name_is_declared_in_the_innermost_block_that_holds_it():
    whole = body(BRANCHES)
    first, _ = inner_blocks(whole[1])
    (loop,) = inner_blocks(whole[2])
    homes = home_blocks(whole)
    expected = {
        "a": whole, "b": first, "c": first, "d": first, "e": whole, "n": whole, "f": loop,
    }  # fmt: skip
    assert {name: homes[name] for name in expected} == {k: id(v) for k, v in expected.items()}
    assert inner_blocks(whole[0]) == []
    assert mentioned(whole[1]) == {"a", "b", "c", "d", "e"}


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("a[0] = 1", {"a"}),
        ("a.b.c = d[1]", {"a"}),
        ("a.b[2] = c", {"a"}),
        ("a = b", set()),
        ("a = b[0] + c.d", set()),
        ("first(a, b, c)", {"b"}),
        ("first(a, b.c[0], d)", {"b"}),
        ("unknown(a, b)", set()),
        ("x = first(a, b, c)", {"b"}),
    ],
)
def test_what_a_function_writes_itself_and_through_others(text, written):
    function = body(f"def f(a, b, c):\n    {text}")[0]
    assert written_arguments(function, {"first": [False, True, False]}) == written


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("x = reads(a) + reads(b)", 0),
        ("x = writes(a) + reads(b)", 1),
        ("x = writes(a) + writes(b)", 2),
        ("x = writes(writes(a))", 1),
        ("x = reads(writes(a), writes(b))", 2),
        ("x = writes(a) and writes(b)", 1),
        ("if writes(a) > 0:\n    x = writes(a) + writes(b)", 1),
        ("for i in range(writes(a)):\n    writes(b)", 1),
        ("x = unknown(a)", 0),
    ],
)
def test_calls_that_write_side_by_side_are_counted(text, count):
    writers = {"writes": [False, True], "reads": [False]}
    assert written_at_once(body(text)[0], writers) == count


# --- records --------------------------------------------------------------------------------------

ROWS = (
    Row("x", None, None, "m/s", "speed"),
    Row("n", 3, (0, 9), "64 uT", "field", 14),
    Row("flag", None, (0, 1), "", ""),
    Row("q", 2, (-5, 5), "", "plain", 30),
)


@pytest.mark.parametrize(
    ("row", "says"),
    [
        (ROWS[0], "speed; m/s"),
        (ROWS[1], "field; 2^14 = 64 uT"),
        (ROWS[2], ""),
        (ROWS[3], "plain; 2^30 = 1"),
    ],
)
def test_what_a_field_is_and_in_which_format(row, says):
    assert meaning(row) == says


def test_a_struct_has_its_members_in_order_with_what_they_are():
    assert struct_text("Of a test.", ROWS, "Some").splitlines() == [
        "/* Of a test. */",
        "typedef struct {",
        "    double x;     /* speed; m/s */",
        "    int32_t n[3]; /* field; 2^14 = 64 uT */",
        "    int32_t flag; /*  */",
        "    int32_t q[2]; /* plain; 2^30 = 1 */",
        "} Some;",
    ]
    # a remark that leaves the line stands before its member
    for length, lines in ((80, 4), (81, 5)):
        text = struct_text("s", [Row("x", None, None, "", "a" * length)], "S")
        assert len(text.splitlines()) == lines


def test_a_constant_has_each_number_at_its_member():
    text = constant_text(ROWS[1:], [1, 2, -3, 1, 4, 5], "static const Some SOME")
    assert text.splitlines() == [
        "static const Some SOME = {",
        "    .n = {INT32_C(1), INT32_C(2), (-INT32_C(3))},",
        "    .flag = INT32_C(1),",
        "    .q = {INT32_C(4), INT32_C(5)},",
        "};",
    ]


# --- operations and facts -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "texts"),
    [
        ([], []),
        (["shift_right_32"], ["shift_right_32"]),
        (["clamp_64"], ["shift_right_64", "clamp_64"]),
        (["at_least_32", "magnitude_64"], ["shift_right_32", "at_least_32", "shift_right_64",
                                           "magnitude_64"]),
    ],
)  # fmt: skip
def test_an_operation_comes_with_those_that_it_calls_before_it(names, texts):
    assert operations(names) == [RUNTIME[name] for name in texts]
    for name in names:
        bits = name[-2:]
        assert f"int{bits}_t {name}(int{bits}_t x" in RUNTIME[name]
        assert f"{int(bits) - 1})" in RUNTIME[name] or name.startswith("shift")


def test_kinds_and_ranges_join():
    assert join_scalars(Interval(1, 3), Interval(-2, 2)) == Interval(-2, 3)
    assert join_scalars(FLOAT, FLOAT) == FLOAT
    assert join_scalars(FLOAT, Interval(1, 2)) is join_scalars(Interval(1, 2), FLOAT) is None
    facts = FunctionFacts()
    assert facts.returns(Interval(1, 2))
    assert facts.returns(Interval(5, 6))
    assert facts.result == Interval(1, 6)
    assert not facts.returns(FLOAT)


def test_after_either_path_only_what_both_have_set_is_known():
    one = ScopeState({"a": Interval(1, 1), "b": FLOAT, "c": FLOAT}, {1: {0: Interval(1, 1)}})
    other = one.copy()
    other.scalars |= {"a": Interval(4, 5), "b": Interval(0, 0), "d": FLOAT}
    other.put(1, 0, Interval(9, 9))
    other.put(1, 7, Interval(0, 0))
    other.cells[2] = {}
    assert one.cells == {1: {0: Interval(1, 1)}}  # a copy changes nothing
    both = join_states(one, other)
    assert both.scalars == {"a": Interval(1, 5), "c": FLOAT}
    assert both.cells == {1: {0: Interval(1, 9)}}
    assert join_states(None, other) is join_states(other, None) is other
    assert join_states(None, None) is None
    assert join_states(one, one.copy()).cells == one.cells

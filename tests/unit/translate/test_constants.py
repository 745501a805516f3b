"""Constants of a kernel have the value that Python gives them."""

import ast
import math

import pytest

from h2nav.translate.source import Constant, Untranslatable, constant_value

NAMES = {"SIZE": 24, "SHARE": 0.75}


def value(text: str) -> object:
    known = {name: Constant(name, number, "") for name, number in NAMES.items()}
    return constant_value(known, "made.py", ast.parse(text, mode="eval").body)


@pytest.mark.parametrize(
    "text",
    [
        "SIZE + 5", "SIZE - 5", "SIZE * 5", "SIZE / 5", "SIZE // 5", "SIZE << 5", "SIZE >> 2",
        "SIZE | 5", "SIZE ** 2", "SHARE ** 2", "-SIZE + 1", "SHARE - SIZE", "2.0 * math.pi",
        "math.tau - math.pi", "(1, SIZE - 1, -SHARE)", "(1 << 31) - 1",
    ],
)  # fmt: skip
def test_an_expression_of_constants_is_worked_out(text: str) -> None:
    expected = eval(text, {"math": math, **NAMES})
    found = value(text)
    assert found == expected
    assert type(found) is type(expected)


@pytest.mark.parametrize("text", ["SIZE % 5", "2 ** -1", "UNKNOWN", "True", "SIZE + (1, 2)"])
def test_others_are_refused(text: str) -> None:
    with pytest.raises(Untranslatable):
        value(text)

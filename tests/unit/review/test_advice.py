"""Every kind of finding has words for a pilot, and leads to pictures that exist."""

import ast
import re

from made_flight import made_analysis, made_flight, page_of
from needs import REPOSITORY

from h2nav.review.advice import ADVICE, advice

ROOMS = ("integrity", "review")
MAKERS = {"Finding", "Alarm", "_error", "_standstill"}


def kinds_in_the_code():
    """First arguments of what makes findings and alarms, where they are plain words."""
    return {
        call.args[0].value
        for room in ROOMS
        for path in sorted((REPOSITORY / "h2nav" / room).glob("*.py"))
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Name | ast.Attribute)
        and (call.func.id if isinstance(call.func, ast.Name) else call.func.attr) in MAKERS
        and call.args
        and isinstance(call.args[0], ast.Constant)
    }


def test_every_kind_is_explained():
    kinds = kinds_in_the_code()
    assert len(kinds) > 15  # they are still made in this way
    unexplained = {kind for kind in kinds if not advice(kind).check}
    assert not unexplained


def test_pictures_of_an_advice_are_in_the_page():
    flight = made_flight(60.0, 50.0)
    sections = set(re.findall(r'<section id="(\w+)">', page_of(flight, made_analysis(flight))))
    assert {one.place for one in ADVICE.values()} <= sections
    assert advice("said_crash").place in sections
    assert advice("unheard_of").place in sections

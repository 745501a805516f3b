"""The frame of the pages: text from files stays text, scripts are those that the page names."""

import base64
import hashlib
import json
import re

from h2nav.reviews.html import data_block, escape, frame, table


def test_markup_and_quotes_are_text():
    assert escape("<script>alert('x')</script>") == (
        "&lt;script&gt;alert(&#x27;x&#x27;)&lt;/script&gt;"
    )
    assert '"' not in escape('" onmouseover="x')
    assert "<td>&lt;b&gt;</td>" in table(["what"], [["<b>"]])


def test_marks_that_turn_the_direction_of_writing_are_seen():
    assert escape("a\u202egnp.exe\x00\n") == "a\ufffdgnp.exe\ufffd\ufffd"


def test_data_cannot_end_its_block():
    value = {"mode": "</script><script>alert(1)</script><!--"}
    block = data_block("review", value)
    inner = re.fullmatch(r'<script type="application/json" id="review">(.*)</script>', block)
    assert inner is not None
    assert "<" not in inner[1]
    assert json.loads(inner[1]) == value


def test_only_the_scripts_of_the_page_may_run_and_nothing_is_loaded():
    page = frame("t", "<p>x</p>", scripts=["let a = 1;"])
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)
    assert policy is not None
    digest = base64.b64encode(hashlib.sha256(b"let a = 1;").digest()).decode()
    assert "default-src 'none'" in policy[1]
    assert f"script-src 'sha256-{digest}';" in policy[1]


def test_a_page_without_scripts_allows_none():
    assert "script-src 'none'" in frame("t", "")


def test_the_title_is_text():
    assert "<title>a &lt;b&gt;</title>" in frame("a <b>", "")

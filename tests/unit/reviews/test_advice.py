"""What shows a finding is a section of pictures that exists."""

import re

from made_flight import made_analysis, made_flight, page_of

from h2nav.integrity.findings import Kind
from h2nav.reviews.advice import place


def test_every_kind_leads_to_pictures_that_are_in_the_page():
    flight = made_flight(60.0, 50.0)
    sections = set(re.findall(r'<section id="(\w+)">', page_of(flight, made_analysis(flight))))
    assert {place(kind) for kind in Kind} <= sections
    assert place(Kind.SAID_CRASH) == "timeline"

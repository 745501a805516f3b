"""A picture of the review"""

CHANGES = {
    "h2nav/reviews/pictures/made.py": '''\
"""A made one."""

from h2nav.reviews.flight import Flight
from h2nav.reviews.pictures import attitude
from h2nav.reviews.pictures.picture import Section


def made(flight: Flight) -> Section:
    """The attitude once more."""
    return attitude.attitude(flight)._replace(name="made", title="A made one")
''',
    "h2nav/reviews/page.py": (
        (
            "        vehicle.battery(flight),\n",
            "        vehicle.battery(flight),\n        made(flight),\n",
        ),
        (
            "from h2nav.reviews.pictures.picture import",
            "from h2nav.reviews.pictures.made import made\n"
            "from h2nav.reviews.pictures.picture import",
        ),
    ),
}

if __name__ == "__main__":
    from made_flight import made_analysis, made_flight, page_of

    flown = made_flight(60.0, 50.0)
    page = page_of(flown, made_analysis(flown))
    assert '<section id="made">' in page
    assert "A made one" in page

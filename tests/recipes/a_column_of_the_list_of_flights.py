"""A column of the list of flights"""

CHANGES = {
    "h2nav/flights/summary.py": (
        (
            '        "kind": document["kind"],\n',
            '        "kind": document["kind"],\n        "made": len(document["kind"]),\n',
        ),
    ),
    "h2nav/flights/index.py": (
        ("FORMAT = 1  #", "FORMAT = 2  #"),
        ('    "error", "size",', '    "made", "error", "size",'),
    ),
    "h2nav/live/assets/flights.js": (
        (
            '  ["Files", "size",',
            '  ["Made", "size", "down", "number", (row) => [`${row.made}`]],\n  ["Files", "size",',
        ),
    ),
}

if __name__ == "__main__":
    import tempfile
    from pathlib import Path

    import flight_folders

    from h2nav.flights.index import FlightIndex, Question

    usual = flight_folders.summary
    flight_folders.summary = lambda number: {**usual(number), "made": 7}
    with tempfile.TemporaryDirectory() as place:
        index = FlightIndex(flight_folders.add_flights(Path(place), 2))
        index.refresh()
        rows = index.page(Question())["flights"]
        index.close()
    assert [row["made"] for row in rows] == [7, 7]

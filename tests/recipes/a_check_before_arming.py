"""A check before arming"""

CHANGES = {
    "h2nav/integrity/preflight.py": (
        ('    GPS = "gps"\n', '    GPS = "gps"\n    MADE = "made"\n'),
        (
            '    Item.GPS: "GPS{} moves by {} at rest",\n',
            '    Item.GPS: "GPS{} moves by {} at rest",\n    Item.MADE: "a made fault{} of {}",\n',
        ),
        (
            "        sound = self._of_imus(at_rest, faults, judged)\n",
            """\
        sound = self._of_imus(at_rest, faults, judged)
        judged.add(Item.MADE)
        faults.append(GroundFault(Item.MADE, "vehicle", 2.0, "m", MADE_M))
""",
        ),
        ("# The unit of a compass that", "MADE_M = 1.0\n# The unit of a compass that"),
    ),
}

if __name__ == "__main__":
    from h2nav.integrity.preflight import Preflight

    (fault,) = Preflight().verdict.faults
    assert fault.text == "a made fault of 2.0 m"

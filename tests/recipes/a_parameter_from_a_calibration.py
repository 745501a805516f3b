"""A parameter from a calibration"""

CHANGES = {
    "h2nav/calibration/made.py": '''\
"""A made parameter: the mean throttle, in whole percent."""

from collections.abc import Sequence

from h2nav.calibration.evidence import Evidence
from h2nav.calibration.outcome import Outcome, ParameterChange

NAME = "MADE_PCT"


def calibrate_made(flights: Sequence[Evidence]) -> Outcome:
    """The throttle of all flights."""
    own, in_use = Outcome("made"), flights[-1].parameters
    found = [one.context.throttle for one in flights if one.context.throttle is not None]
    if NAME not in in_use or not found:
        return own._replace(left=("its parameter or the throttle is not in the recording",))
    new = float(round(100.0 * sum(one.values.mean() for one in found) / len(found)))
    if new == in_use[NAME]:
        return own
    return own._replace(changes=(ParameterChange(NAME, in_use[NAME], new, 1.0),))
''',
    "h2nav/calibration/vehicle.py": (
        (
            "from h2nav.calibration.notch import calibrate_notch\n",
            """\
from h2nav.calibration.made import calibrate_made
from h2nav.calibration.notch import calibrate_notch
""",
        ),
        (
            "            calibrate_drag(flights),\n",
            "            calibrate_drag(flights),\n            calibrate_made(flights),\n",
        ),
    ),
    "h2nav/calibration/files.py": (('"INS_HNTCH_MODE")', '"INS_HNTCH_MODE", "MADE_PCT")'),),
    "docs/calibrate.md": (("| notch |", "| made | `MADE_PCT` | - | the throttle |\n| notch |"),),
}

if __name__ == "__main__":
    import numpy as np
    from unit.calibration.logs import evidence_of_log

    from h2nav.calibration.files import ParameterFormat, written
    from h2nav.calibration.vehicle import calibrate, document_of
    from h2nav.recordings.context import Context, Series

    t_s = np.arange(0.0, 100.0)
    context = Context(throttle=Series(t_s, np.where(t_s < 50.0, 0.2, 0.4)))
    found = calibrate([evidence_of_log(context, {"MADE_PCT": 25.0})])
    (change,) = found.changes
    assert (change.name, change.old, change.new) == ("MADE_PCT", 25.0, 30.0)
    assert document_of(found)["sensors"][-1]["sensor"] == "made"
    # ArduPilot's own form has no types; QGroundControl's 2 is an INT8.
    assert "\tMADE_PCT\t30\t2\n" in written(found, ParameterFormat.QGROUNDCONTROL)
    # Nothing to change, and no parameter: neither is a change.
    for parameters in ({"MADE_PCT": 30.0}, {}):
        assert not calibrate([evidence_of_log(context, parameters)]).changes

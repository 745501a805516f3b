"""Where the earth field is asked for."""

from h2nav.attitude.samples import EarthField
from h2nav.service.aiding import FieldOfTheEarth
from h2nav.service.settings import NorthSettings
from h2nav.wire.position import Place

FIELD = EarthField(50.0, 1.0, 0.1)


def test_no_field_is_asked_for_at_the_place_of_an_autopilot_without_a_fix():
    asked = []

    def field_at(*place):
        asked.append(place)
        return FIELD

    field = FieldOfTheEarth(NorthSettings(), field_at, 1_795_000_000.0)
    # A simulated plane said -0.0000017 deg before its first fix.
    assert field.at(0, Place(-1.7e-6, 0.0, 0.0)) is None
    assert not asked
    assert field.at(1, Place(-35.36, 149.17, 584.0)) == FIELD

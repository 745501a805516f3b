"""Where the earth field is asked for, and which airspeed is used."""

import math
from types import SimpleNamespace

import pytest

from h2nav.attitude.samples import EarthField, VehicleState, VelocityFix
from h2nav.integrity.gnss import SignalState
from h2nav.service.aiding import (
    DEFAULT_SIGMA_M_S,
    Aiding,
    FieldOfTheEarth,
    autopilot_velocity,
    gps_velocity,
)
from h2nav.service.settings import AidingSettings, NorthSettings
from h2nav.wire.position import EstimatedVelocity, GpsFix, Place
from h2nav.wire.vehicle import Airspeed

FIELD = EarthField(50.0, 1.0, 0.1)


def test_the_velocity_of_the_autopilots_estimator_is_marked_as_dependent():
    found = autopilot_velocity(EstimatedVelocity(5_000_000, (1.0, -2.0, 0.5)), 5_100_000)
    assert found == VelocityFix(5_000_000, (1.0, -2.0, 0.5), DEFAULT_SIGMA_M_S, False)
    # A time of another clock is none: the newest sample's stands in.
    other = EstimatedVelocity(9_000_000_000, (1.0, -2.0, 0.5))
    assert autopilot_velocity(other, 5_100_000).t_us == 5_100_000


def test_a_fix_gives_velocity_and_altitude_of_one_time():
    fix = GpsFix(5_000_000, HOME, (1.0, 2.0, math.nan), 0.2)
    found = gps_velocity(fix, 5_100_000)
    assert (found.t_us, found.v_n[:2], found.altitude_m) == (5_000_000, (1.0, 2.0), 584.0)
    assert gps_velocity(fix._replace(v_n=None), 5_100_000) is None


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


def field_of(asked=None, **chosen):
    """A model that gives the same field everywhere; `asked` gets the questions."""

    def field_at(*question):
        if asked is not None:
            asked.append(question)
        return FIELD

    return FieldOfTheEarth(NorthSettings(**chosen), field_at, 1_795_000_000.0)


HOME = Place(-35.36, 149.17, 584.0)
FAR = Place(47.4, 8.5, 400.0)


def test_a_far_place_counts_when_it_alone_was_told_for_three_seconds():
    field = field_of()
    assert field.at(0, HOME) == FIELD
    told = [field.at(t_ns, FAR) for t_ns in range(10**9, 4 * 10**9, 5 * 10**8)]
    assert told == [None] * 6
    assert field.at(4 * 10**9, FAR) == FIELD


def test_a_place_that_is_told_once_between_others_changes_nothing():
    asked = []
    field = field_of(asked)
    field.at(0, HOME)
    for second in range(1, 20):
        assert field.at(second * 10**9, FAR if second % 2 else HOME) is None
    assert len(asked) == 1


def test_the_model_is_asked_with_the_date_that_the_autopilot_told():
    asked = []
    field = field_of(asked)
    field.use_date(1_800_000_000.0)
    field.at(0, HOME)
    assert asked == [(*HOME, 1_800_000_000.0)]


def test_the_declination_is_the_models_the_chosen_one_or_none():
    assert field_of().at(0, HOME).declination_rad == FIELD.declination_rad
    chosen = field_of(declination="fixed", declination_deg=12.0).at(0, HOME)
    assert chosen.declination_rad == pytest.approx(math.radians(12.0))
    assert chosen[:2] == FIELD[:2]
    assert field_of(declination="none").at(0, HOME).declination_rad == 0.0


def airspeeds_used(*told, altitude_m=0.0, is_fixed_wing=True, **settings):
    """The true airspeeds that reach the filter, by what is told second by second."""
    used = []
    autopilot = SimpleNamespace(
        identity=SimpleNamespace(is_fixed_wing=is_fixed_wing), on_ground=False, is_armed=True
    )
    estimation = SimpleNamespace(
        use=lambda what: used.append(what.airspeed_m_s) if isinstance(what, VehicleState) else None,
        use_gravity=lambda _: None,
    )
    aiding = Aiding(AidingSettings(**settings), field_of(), autopilot, estimation, None)
    aiding.on_place(0, HOME._replace(altitude_m=altitude_m))
    for second, speed in enumerate(told):
        aiding.on_airspeed((second + 3) * 10**9, speed)
    return used


def test_an_airspeed_is_corrected_by_the_density_unless_it_is_true_already():
    assert airspeeds_used(Airspeed(20.0)) == [pytest.approx(20.0)]
    assert airspeeds_used(Airspeed(20.0), altitude_m=2000.0) == [pytest.approx(22.06, abs=0.01)]
    assert airspeeds_used(Airspeed(20.0, is_true=True), altitude_m=2000.0) == [20.0]


def test_without_a_measurement_an_airspeed_is_used_for_two_seconds():
    nothing = [Airspeed(None)] * 4
    assert airspeeds_used(Airspeed(20.0), *nothing) == [pytest.approx(20.0), None]


def test_an_airspeed_is_used_on_fixed_wings_and_where_it_is_wanted():
    assert airspeeds_used(Airspeed(20.0), is_fixed_wing=False) == [None]
    assert airspeeds_used(Airspeed(20.0), airspeed=False) == [None]


@pytest.mark.parametrize(("heard_us", "alarms"), [(10_999_999, 1), (11_000_000, 0), (None, 1)])
def test_what_a_receiver_said_counts_for_ten_seconds_of_the_autopilots_clock(heard_us, alarms):
    estimation = SimpleNamespace(heard_t_us=heard_us)
    aiding = Aiding(AidingSettings(), field_of(), None, estimation, None)
    aiding.gnss.state(1_000_000, SignalState(0, jamming=1, spoofing=3))
    assert len(aiding.alarms()) == alarms

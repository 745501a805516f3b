"""Where the earth field is asked for, and which airspeed is used."""

import math
from types import SimpleNamespace

import pytest

from h2nav.attitude.samples import MAX_FIX_SIGMA_M_S, EarthField, VehicleState, VelocityFix
from h2nav.integrity.gnss import SignalState
from h2nav.service.aiding import (
    DEFAULT_SIGMA_M_S,
    Aiding,
    FieldOfTheEarth,
    autopilot_velocity,
    gps_velocity,
)
from h2nav.service.records import AidingRecord
from h2nav.service.settings import AidingSettings, NorthSettings
from h2nav.wire.position import EstimatedVelocity, GpsFix, Origin, Place
from h2nav.wire.vehicle import Airspeed, LandedState, SystemTime

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


@pytest.mark.parametrize(("years", "is_asked_again"), [(0.9, False), (-1.1, True), (15.0, True)])
def test_another_year_than_the_computers_is_asked_for_at_the_next_place(years, is_asked_again):
    asked = []
    field = field_of(asked)
    field.at(0, HOME)
    date_s = asked[0][-1] + years * 365.25 * 86_400.0
    field.use_date(date_s)
    told = [field.at(second * 10**9, HOME) for second in (1, 2)]
    assert told == [FIELD if is_asked_again else None, None]
    assert [one[-1] for one in asked[1:]] == [date_s] * is_asked_again


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


S = 10**9
UNIX_S = 1_795_000_000.0


@pytest.mark.parametrize(
    ("place", "is_asked"),
    [
        (Place(0.0099, 0.0, 0.0), False),
        (Place(0.0101, 0.0, 0.0), True),
        (Place(0.0, -0.0101, 0.0), True),
        (Place(-0.008, 0.008, 0.0), True),
    ],
)
def test_a_kilometre_from_0_n_0_e_is_a_place(place, is_asked):
    asked = []
    assert (field_of(asked).at(0, place) is not None) is is_asked
    assert asked == ([(*place, UNIX_S)] if is_asked else [])


@pytest.mark.parametrize(
    ("moved", "is_asked"),
    [
        ({"latitude_deg": -35.36 + 0.49}, False),
        ({"latitude_deg": -35.36 + 0.51}, True),
        ({"longitude_deg": 149.17 - 0.51}, True),
        ({"latitude_deg": -35.36 + 0.4, "longitude_deg": 149.17 + 0.4}, True),
        ({"altitude_m": 9_000.0}, False),
    ],
)
def test_half_a_degree_away_is_another_field(moved, is_asked):
    asked = []
    field = field_of(asked)
    field.at(0, HOME)
    assert field.is_known
    for t_s in (1.0, 2.0, 4.0):
        field.at(round(t_s * S), HOME._replace(**moved))
    assert len(asked) == 1 + is_asked


def test_the_first_place_makes_the_field_known_though_there_is_none():
    field = FieldOfTheEarth(NorthSettings(), lambda *_: None, UNIX_S)
    assert not field.is_known
    assert field.at(0, HOME) is None
    assert field.is_known


@pytest.mark.parametrize(("above_m_s", "is_used"), [(0.0, True), (0.01, False)])
def test_a_velocity_is_as_good_as_the_filter_needs(above_m_s, is_used):
    fix = GpsFix(5_000_000, HOME, (1.0, 2.0, math.nan), MAX_FIX_SIGMA_M_S + above_m_s)
    assert (gps_velocity(fix, 5_000_000) is not None) is is_used


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("apart_us", "is_own"), [(1_999_999, True), (2_000_000, False)])
def test_a_time_two_seconds_away_is_of_another_clock(sign, apart_us, is_own):
    fix = GpsFix(9_000_000 + sign * apart_us, HOME, (1.0, 2.0, 0.0), 0.2)
    assert gps_velocity(fix, 9_000_000).t_us == (fix.time_us if is_own else 9_000_000)


class Vehicle:
    """What an `Aiding` passes on, of a vehicle that flies."""

    def __init__(self, *, heard_us=10_000_000, is_armed=True, is_fixed_wing=True, **settings):
        self.used, self.gravity, self.witnessed, self.landed = [], [], [], []
        self.autopilot = SimpleNamespace(
            identity=SimpleNamespace(is_fixed_wing=is_fixed_wing),
            on_ground=False,
            is_armed=is_armed,
            take_landed_state=lambda *said: self.landed.append(said),
        )
        estimation = SimpleNamespace(
            heard_t_us=heard_us,
            corrected="corrected",
            use=self.used.append,
            use_gravity=self.gravity.append,
            doubt="doubt",
            velocity_is_false=False,
        )
        witness = SimpleNamespace(fix=lambda *said: self.witnessed.append(said))
        self.aiding = Aiding(
            AidingSettings(**settings), field_of(), self.autopilot, estimation, witness
        )


FIX = GpsFix(10_000_000, HOME, (1.0, -2.0, 0.5), 0.25, 11)
VELOCITY = VelocityFix(10_000_000, (1.0, -2.0, 0.5), 0.25, altitude_m=584.0)


def test_a_fix_gives_field_gravity_velocity_and_their_records():
    vehicle = Vehicle()
    field, velocity = vehicle.aiding.on_receiver(S, FIX)
    assert vehicle.used == [FIELD, VELOCITY]
    assert vehicle.witnessed == [(VELOCITY, "doubt", "corrected")]
    assert vehicle.gravity == [pytest.approx(9.7966, abs=1e-3)]  # 35 deg S, 584 m
    assert (field.topic, field.t_us) == ("/aiding", None)
    assert (velocity.topic, velocity.t_us) == ("/aiding", 10_000_000)
    assert field.record == AidingRecord(
        "field",
        field_norm_ut=50.0,
        field_dip_deg=pytest.approx(math.degrees(1.0)),
        declination_deg=pytest.approx(math.degrees(0.1)),
    )
    assert velocity.record == AidingRecord("velocity", 1.0, -2.0, 0.5, 0.25, True)


@pytest.mark.parametrize(
    ("how", "passes", "is_witnessed"),
    [({}, True, True), ({"gps_velocity": False}, False, True), ({"heard_us": None}, False, False)],
)
def test_where_no_velocity_is_wanted_the_witness_still_takes_it(how, passes, is_witnessed):
    vehicle = Vehicle(**how)
    vehicle.aiding.on_receiver(S, FIX)
    assert (VELOCITY in vehicle.used) is passes
    assert bool(vehicle.witnessed) is is_witnessed


def test_fifty_velocities_at_once_and_fifty_a_second():
    vehicle = Vehicle()
    fixes = [FIX._replace(time_us=10_000_000 + i) for i in range(62)]

    def used() -> int:
        return sum(isinstance(one, VelocityFix) for one in vehicle.used)

    for i, fix in enumerate(fixes[:60]):
        vehicle.aiding.on_receiver(S, fix._replace(v_n=(1.0, 0.01 * i, 0.0)))
    assert used() == 50
    vehicle.aiding.on_receiver(S + 20_000_000 - 1, fixes[60])
    assert used() == 50
    vehicle.aiding.on_receiver(S + 20_000_000, fixes[61]._replace(v_n=(2.0, 0.0, 0.0)))
    assert used() == 51


def test_a_velocity_that_only_repeats_reaches_nobody():
    vehicle = Vehicle()
    vehicle.aiding.on_receiver(S, FIX)
    assert vehicle.aiding.on_receiver(2 * S, FIX._replace(time_us=10_200_000)) == []
    assert vehicle.used == [FIELD, VELOCITY]
    assert len(vehicle.witnessed) == 1


def test_a_velocity_that_its_places_deny_is_passed_so_and_is_no_witness():
    vehicle = Vehicle()
    for i in range(10):
        place = HOME._replace(latitude_deg=HOME.latitude_deg + 1e-5 * i)  # 5.6 m/s
        fix = FIX._replace(
            time_us=10_000_000 + 200_000 * i, v_n=(-2.0, 0.001 * i, 0.0), place=place
        )
        vehicle.aiding.on_receiver(S * (1 + i), fix)
    velocities = [one for one in vehicle.used if isinstance(one, VelocityFix)]
    assert [one.is_denied for one in velocities] == [False] * 5 + [True] * 5
    assert len(vehicle.witnessed) == 5


@pytest.mark.parametrize(
    ("heard_us", "is_wanted", "passes"),
    [(10_000_000, True, True), (10_000_000, False, False), (None, True, False)],
)
def test_the_autopilots_own_velocity_is_used_on_request(heard_us, is_wanted, passes):
    vehicle = Vehicle(heard_us=heard_us, autopilot_velocity=is_wanted)
    said = EstimatedVelocity(9_900_000, (1.0, 2.0, 3.0))
    effects = vehicle.aiding.on_autopilot_velocity(S, said)
    expected = VelocityFix(9_900_000, (1.0, 2.0, 3.0), 0.5, False)
    assert vehicle.used == ([expected] if passes else [])
    assert [effect.record for effect in effects] == (
        [AidingRecord("velocity", 1.0, 2.0, 3.0, 0.5, False)] if passes else []
    )


def test_a_vehicle_is_passed_when_it_has_changed():
    vehicle = Vehicle()
    (effect,) = vehicle.aiding.on_landed_state(3 * S, LandedState(True))
    assert vehicle.landed == [(3 * S, True)]
    assert vehicle.used == [VehicleState(False, None, is_armed=True)]
    assert effect.record == AidingRecord("vehicle", on_ground=False)
    assert vehicle.aiding.pass_vehicle(4 * S) == []
    vehicle.autopilot.is_armed = False
    assert vehicle.aiding.pass_vehicle(5 * S)
    assert vehicle.used[1:] == [VehicleState(False, None, is_armed=False)]


@pytest.mark.parametrize(("later_ns", "is_fresh"), [(2 * S, True), (2 * S + 1, False)])
def test_an_airspeed_is_fresh_for_two_seconds(later_ns, is_fresh):
    vehicle = Vehicle()
    (effect,) = vehicle.aiding.on_airspeed(9 * S, Airspeed(20.0))
    assert effect.record.airspeed_m_s == pytest.approx(20.0)
    assert (vehicle.aiding.pass_vehicle(9 * S + later_ns) == []) is is_fresh


def test_the_place_of_the_start_is_used_until_another_is_known():
    vehicle = Vehicle()
    assert not vehicle.aiding.knows_field
    assert vehicle.aiding.on_origin(0, Origin(HOME))
    assert vehicle.aiding.knows_field
    for t_s in range(1, 9):
        assert vehicle.aiding.on_origin(t_s * S, Origin(FAR)) == []
    assert vehicle.used == [FIELD]


def test_a_date_that_is_unknown_changes_nothing():
    asked, nothing = [], SimpleNamespace(use=lambda _: None, use_gravity=lambda _: None)
    aiding = Aiding(AidingSettings(), field_of(asked), None, nothing, None)
    assert aiding.on_system_time(SystemTime(1_800_000_000.0)) == []
    assert aiding.on_system_time(SystemTime(None)) == []
    aiding.on_place(0, HOME)
    assert asked == [(*HOME, 1_800_000_000.0)]

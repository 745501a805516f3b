"""What a field shows of an attitude and of a gyro: tables of just enough and just too little."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.samples import EarthField
from h2nav.integrity.bent import BentAttitude
from h2nav.integrity.causes import Cause
from h2nav.integrity.field_evidence import FieldEvidence
from h2nav.integrity.findings import Kind, Sensor, SensorKind, Severity
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.strapdown import Moment

DEG = math.pi / 180.0
S = 1_000_000
EARTH = EarthField(50.0, 60.0 * DEG, 4.0 * DEG)
LEVEL = Rotation.identity()
ABOUT_X, ABOUT_Y, ABOUT_Z = np.eye(3)


def turn(axis, angle_deg):
    return Rotation.from_rotvec(np.asarray(axis) * angle_deg * DEG)


class Bench:
    """One compass; rows are made as they would come out of the kernel, one a second."""

    def __init__(self, reference=EARTH):
        self.memory, self.now = SimpleNamespace(), SimpleNamespace(newest=None, t_us=None)
        self.evidence = FieldEvidence(SimpleNamespace(memory=self.memory), self.now)
        self.windows = self.evidence.windows
        self.windows.use_field(reference)
        self.t_us = 0

    def row(
        self,
        heading_deg=0.0,
        dip_deg=60.0,
        norm=1.0,
        attitude=LEVEL,
        sigmas_deg=(0.0, 0.0),
        path=0.0,
        variance_deg2=0.0,
        turned=LEVEL,
        force_turned=None,
    ):
        """Takes a row.

        Args:
            heading_deg: of the field, from magnetic north.
            norm: of the earth's.
            attitude: from the strapdown's frame.
            sigmas_deg: of tilt and heading.
            turned: field, and force unless it turns otherwise, in the strapdown's frame.
        """
        self.t_us += S
        azimuth, dip = heading_deg * DEG + EARTH.declination_rad, dip_deg * DEG
        level = math.cos(dip)
        field_n = (level * math.cos(azimuth), level * math.sin(azimuth), math.sin(dip))
        force_turned = turned if force_turned is None else force_turned
        sum_of_fields = 40.0 * norm * EARTH.norm_ut
        self.memory.row_field_s = list(sum_of_fields * turned.apply(attitude.inv().apply(field_n)))
        self.memory.row_force_s = list(force_turned.apply(attitude.inv().apply((0.0, 0.0, -9.81))))
        self.memory.row_norm = norm * EARTH.norm_ut
        x, y, z, w = attitude.as_quat()
        self.now.newest = Moment(
            self.t_us,
            (0.0, 0.0, 0.0),
            (w, x, y, z),
            sigmas_deg[0] * DEG,
            sigmas_deg[1] * DEG,
            path,
            variance_deg2 * DEG**2,
            0.0,
        )
        self.now.t_us = self.t_us
        return self.evidence.end_row(InnovationRatios(velocity_1s=0.25))


@pytest.mark.parametrize("seed", range(5))
def test_heading_and_dip_are_of_the_field_by_the_attitude(seed):
    random = np.random.default_rng(seed)
    heading_deg, dip_deg = random.uniform(-180.0, 180.0), random.uniform(-80.0, 80.0)
    bench = Bench()
    bench.row(heading_deg, dip_deg, attitude=Rotation.random(random_state=seed))
    windows = bench.windows
    assert windows.heading_error_rad / DEG == pytest.approx(heading_deg)
    assert windows.dip_error_rad / DEG == pytest.approx(dip_deg - 60.0)
    assert windows.norm_share == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("row", "ratio"),
    [
        ({}, 0.0),
        # three deviations of a calibrated compass, whose heading turns by 1 / cos(dip) of it
        ({"heading_deg": 18.0}, 1.0),
        ({"heading_deg": -18.0}, 1.0),
        ({"dip_deg": 69.0}, 1.0),
        ({"dip_deg": 51.0}, 1.0),
        ({"norm": 1.21}, 1.0),
        ({"norm": 0.79}, 1.0),
        # of all three together
        ({"heading_deg": 10.8, "dip_deg": 67.2}, 1.0),
        ({"heading_deg": 10.8, "norm": 1.168}, 1.0),
        # an attitude that is itself uncertain
        ({"heading_deg": 30.0, "sigmas_deg": (0.0, 8.0)}, 1.0),
        ({"heading_deg": 30.0, "sigmas_deg": (8.0 / math.sqrt(3.0), 0.0)}, 1.0),
        ({"dip_deg": 75.0, "sigmas_deg": (4.0, 0.0)}, 1.0),
        ({"dip_deg": 69.0, "sigmas_deg": (0.0, 50.0)}, 1.0),
    ],
)
def test_the_ratio_of_a_row(row, ratio):
    bench = Bench()
    found = bench.row(**row)
    assert found.field_1s == pytest.approx(ratio, abs=1e-12)
    assert math.isnan(found.field_10s)
    assert found.velocity_1s == 0.25


def test_near_the_pole_a_field_has_nearly_no_heading():
    bench = Bench(EARTH._replace(dip_rad=89.0 * DEG))
    assert bench.row(90.0, 89.0).field_1s == pytest.approx(0.5)
    bench.row(1.0, 88.0)
    assert bench.windows.worst_heading_rad / DEG == pytest.approx(1.0 + 1.0 / 0.05)


def test_the_ratio_of_ten_rows_is_that_of_the_best():
    bench = Bench()
    for heading_deg in (*[36.0] * 3, 27.0, *[36.0] * 5):
        found = bench.row(heading_deg)
        assert math.isnan(found.field_10s)
    assert bench.row(36.0).field_10s == pytest.approx(1.5)
    for _ in range(3):
        assert bench.row(36.0).field_10s == pytest.approx(1.5)
    assert bench.row(36.0).field_10s == pytest.approx(2.0)
    bench.windows.restart()
    assert math.isnan(bench.windows.field_ratio(1))


def test_without_a_reference_or_a_row_nothing_is_known():
    for bench in (Bench(), Bench(None)):
        windows = bench.windows
        assert math.isnan(windows.field_ratio(1))
        assert (windows.heading_error_rad, windows.dip_error_rad, windows.norm_share) == (0, 0, 1)
        assert windows.worst_heading_rad == 0.0
        assert not windows.is_plausible
        assert windows.is_stale(0)
    bench.row(20.0, 80.0, 1.5)
    assert math.isnan(windows.field_ratio(1))
    assert windows.heading_error_rad / DEG == pytest.approx(24.0)  # from true north
    assert (windows.dip_error_rad, windows.norm_share, windows.worst_heading_rad) == (0, 1, 0)
    assert not windows.is_plausible
    assert bench.evidence.fits is None


@pytest.mark.parametrize(
    ("row", "is_plausible"),
    [
        ({"dip_deg": 68.9}, True),
        ({"dip_deg": 69.1}, False),
        ({"norm": 1.209}, True),
        ({"norm": 1.211}, False),
        ({"norm": 0.791}, True),
        ({"norm": 0.789}, False),
        ({"heading_deg": 170.0}, True),
    ],
)
def test_a_plausible_field_has_dip_and_norm_of_the_earth(row, is_plausible):
    bench = Bench()
    bench.row()
    assert bench.windows.is_plausible
    bench.row(**row)
    assert bench.windows.is_plausible == is_plausible
    assert bench.evidence.fits == is_plausible
    assert bench.windows.has_norm == (is_plausible or "norm" not in row)
    bench.windows.use_field(EARTH._replace(norm_ut=500.0))
    assert not bench.windows.is_plausible


def test_a_field_is_stale_after_two_rows():
    bench = Bench()
    bench.row()
    assert not bench.windows.is_stale(3 * S)
    assert bench.windows.is_stale(3 * S + 1)
    bench.now.t_us = 3 * S + 1
    assert bench.evidence.fits is None
    bench.now.t_us = None
    assert bench.evidence.fits is None


@pytest.mark.parametrize(
    ("heading_deg", "dip_deg", "worst_deg"),
    [(10.0, 60.0, 10.0), (-10.0, 55.0, 20.0), (10.0, 65.0, 20.0), (170.0, 70.0, 180.0)],
)
def test_what_a_field_may_have_done_to_the_heading(heading_deg, dip_deg, worst_deg):
    bench = Bench()
    bench.row(heading_deg, dip_deg)
    assert bench.windows.worst_heading_rad / DEG == pytest.approx(worst_deg)


@pytest.mark.parametrize(
    ("row", "turn_deg"),
    [
        ({}, 0.0),
        ({"heading_deg": 40.0}, 0.0),
        ({"dip_deg": 65.0}, 10.05),
        ({"dip_deg": 55.0}, 10.05),
        ({"norm": 1.07}, 8.05),
        ({"dip_deg": 55.0, "norm": 0.93}, 12.93),
        ({"norm": 1.49}, 78.5),
        ({"norm": 1.51}, 180.0),
    ],
)
def test_iron_that_shows_along_the_field_may_be_as_large_across_it(row, turn_deg):
    """The level field is half of it."""
    bench = Bench()
    assert bench.windows.turn_by_iron_rad == 0.0
    bench.row(**row)
    assert bench.windows.turn_by_iron_rad / DEG == pytest.approx(turn_deg, abs=0.05)
    bench.windows.use_field(None)
    assert bench.windows.turn_by_iron_rad == 0.0


def turned_ratio(angle_deg, rows=1, path=0.0, offset=0.0, variance_deg2=0.0, reference=None):
    """The ratio of a turn of field and force about an axis across both."""
    bench = Bench(reference)
    bench.windows.use_offset(offset)
    bench.row(heading_deg=-4.0, path=2.0, variance_deg2=3.0)
    for i in range(1, rows + 1):
        bench.row(
            heading_deg=-4.0,
            turned=turn(ABOUT_Y, angle_deg * i / rows),
            path=2.0 + path * i / rows,
            variance_deg2=3.0 + variance_deg2 * i / rows,
        )
    turned_rad, ratio = bench.windows.turn(rows)
    assert turned_rad / DEG == pytest.approx(angle_deg)
    return ratio


@pytest.mark.parametrize(
    ("how", "limit_deg"),
    [
        # noise of both rows, and a bias of 0.05 deg/s
        ({}, 3.0 * math.sqrt(2.0 + 0.05**2)),
        ({"rows": 10}, 3.0 * math.sqrt(2.0 + 0.5**2)),
        ({"variance_deg2": 7.0}, 3.0 * math.sqrt(9.0 + 0.05**2)),
        # direction of the field by half of the turn, scale 1 %, delay 20 ms
        (
            {"path": 0.5},
            3.0 * math.sqrt(2.0 + 0.05**2 + 4.5 + 0.005**2 / DEG**2 + 0.01**2 / DEG**2),
        ),
        # by the whole of it, and no more
        (
            {"path": 2.0},
            3.0 * math.sqrt(2.0 + 0.05**2 + 18.0 + 0.02**2 / DEG**2 + 0.04**2 / DEG**2),
        ),
        (
            {"path": 2.0, "rows": 10},
            3.0 * math.sqrt(2.0 + 0.5**2 + 18.0 + 0.02**2 / DEG**2 + 0.004**2 / DEG**2),
        ),
        # with the compass's own offset, which may turn the field by so much
        (
            {"path": 1.0, "offset": 4.0 * DEG},
            3.0 * math.sqrt(2.0 + 0.05**2 + 50.0 + 0.01**2 / DEG**2 + 0.02**2 / DEG**2),
        ),
    ],
)
def test_a_turn_counts_beyond_what_field_and_gyro_may_err(how, limit_deg):
    assert turned_ratio(limit_deg, **how) == pytest.approx(1.0)
    assert turned_ratio(0.4 * limit_deg, **how) == pytest.approx(0.4)


def test_a_turn_needs_rows():
    bench = Bench(None)
    for _ in range(10):
        assert bench.windows.turn(10)[0] == 0.0
        assert math.isnan(bench.windows.turn(10)[1])
        assert not bench.windows.turned_level(10)
        bench.row()
    found = bench.row()
    assert (found.turn_1s, found.turn_10s) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("first", "last", "is_of_gyro"),
    [
        ({}, {}, True),
        # the force has turned by less, by up to a quarter of it
        ({}, {"force_turned": turn(ABOUT_Y, 31.0)}, True),
        ({}, {"force_turned": turn(ABOUT_Y, 29.0)}, False),
        ({}, {"force_turned": LEVEL}, False),
        ({}, {"norm": 1.09}, True),
        ({}, {"norm": 0.91}, True),
        ({}, {"norm": 1.11}, False),
        ({}, {"norm": 0.89}, False),
        # of a field that has been the earth's, and is
        ({"norm": 0.85}, {"norm": 0.80}, True),
        ({"norm": 0.85}, {"norm": 0.78}, False),
        ({"heading_deg": 17.0}, {}, True),
        ({"heading_deg": 19.0}, {}, False),
        ({"force_turned": turn(ABOUT_Y, 14.0)}, {"force_turned": turn(ABOUT_Y, 54.0)}, True),
        ({"force_turned": turn(ABOUT_Y, 16.0)}, {"force_turned": turn(ABOUT_Y, 54.0)}, False),
        ({"force_turned": turn(ABOUT_Y, 14.0)}, {"force_turned": turn(ABOUT_Y, 56.0)}, False),
    ],
)
def test_a_gyro_turns_field_and_force_together(first, last, is_of_gyro):
    bench = Bench()
    bench.row(attitude=turn(ABOUT_Z, 4.0), **first)
    bench.row(attitude=turn(ABOUT_Z, 4.0), **{"turned": turn(ABOUT_Y, 40.0), **last})
    assert bench.windows.turn(1)[0] > 35.0 * DEG
    assert math.isnan(bench.windows.turn(1)[1]) != is_of_gyro


@pytest.mark.parametrize(("rows_since", "is_of_gyro"), [(0, False), (2, False), (3, True)])
def test_over_a_take_off_steel_may_have_turned_the_field(rows_since, is_of_gyro):
    """The first of the two rows begins two seconds after the take-off, or earlier."""
    bench = Bench()
    bench.row()
    bench.windows.change_surroundings()
    for _ in range(rows_since):
        bench.row()
    bench.row(turned=turn(ABOUT_Y, 40.0))
    assert bench.windows.turn(1)[0] > 35.0 * DEG
    assert math.isnan(bench.windows.turn(1)[1]) != is_of_gyro


def test_over_a_take_off_a_field_that_stands_still_shows_no_turn():
    bench = Bench()
    bench.row()
    bench.windows.change_surroundings()
    bench.row()
    assert bench.windows.turn(1)[1] < 0.1


@pytest.mark.parametrize(
    ("tilt_deg", "heading_deg", "is_level"),
    [
        (0.0, 30.0, True),
        (0.0, -30.0, True),
        (10.0, 20.5, True),
        (10.0, -20.5, True),
        (10.0, 19.5, False),
        (30.0, 0.0, False),
    ],
)
def test_a_turn_about_the_vertical(tilt_deg, heading_deg, is_level):
    bench = Bench()
    bench.row(heading_deg=-4.0)
    turned = (turn(ABOUT_Z, heading_deg) * turn(ABOUT_Y, tilt_deg)).inv()
    bench.row(heading_deg=-4.0, turned=turned)
    assert bench.windows.turned_level(1) == is_level
    assert not bench.windows.turned_level(2)


# --- what follows from it -------------------------------------------------------------------------


def judged(bench, ratios, seconds=3, start_us=0):
    for t_us in range(start_us, start_us + (seconds + 1) * S, S):
        bench.evidence.judge(t_us, ratios)


def told(bench, on_ground=False, bent=None, ratios=None):
    """The alarms after ten seconds."""
    bent, ratios = bent or BentAttitude(), ratios or InnovationRatios(field_1s=3.0)
    return bench.evidence.alarms(10 * S, ratios, bent, on_ground=on_ground)


@pytest.mark.parametrize(
    ("confirmed", "seconds", "ratio", "is_open"),
    [
        ("", 3, 1.01, True),
        ("", 3, 0.99, False),
        ("", 0, 1.01, False),
        ("by velocities", 3, 1.01, False),
        ("by ten seconds", 3, 1.01, False),
    ],
)
def test_only_a_field_that_was_sound_once_has_shown_a_heading(confirmed, seconds, ratio, is_open):
    bench = Bench()
    if confirmed == "by velocities":
        bench.evidence.confirm()
    elif confirmed:
        for _ in range(10):
            bench.row()
            bench.evidence.end_row(InnovationRatios())
    bench.row(dip_deg=40.0)
    judged(bench, InnovationRatios(field_1s=1.5), seconds)
    found_rad = bench.evidence.unknown_heading_rad(InnovationRatios(field_1s=ratio))
    assert found_rad / DEG == pytest.approx(44.3 if is_open else 0.0, abs=0.1)


def test_a_field_that_is_in_use_holds_the_heading_for_a_second():
    bench = Bench()
    assert not bench.evidence.holds
    bench.evidence.use(5 * S)
    assert not bench.evidence.holds
    for now_us, holds in ((6 * S - 1, True), (6 * S, False)):
        bench.now.t_us = now_us
        assert bench.evidence.holds == holds


@pytest.mark.parametrize(
    ("confirmed", "is_used", "on_ground", "degrades"),
    [
        ("", False, False, True),
        ("", False, True, False),
        ("by velocities", False, False, False),
        ("by velocities", True, False, True),
        ("by ten seconds", False, False, False),
        ("by ten seconds", True, False, True),
        ("by ten seconds", True, True, False),
        ("by nine seconds", False, False, True),
        ("by a worse field", False, False, True),
    ],
)
def test_a_contradicting_field_matters_if_it_holds_the_heading(
    confirmed, is_used, on_ground, degrades
):
    bench = Bench()
    if confirmed == "by velocities":
        bench.evidence.confirm()
    elif confirmed:
        for _ in range(8 if "nine" in confirmed else 10):
            bench.row(heading_deg=9.5 if "worse" in confirmed else 8.5)
    bench.row(heading_deg=40.0)
    if is_used:
        bench.evidence.use(bench.t_us)
    judged(bench, InnovationRatios(field_1s=3.0))
    (alarm,) = told(bench, on_ground)
    assert (alarm.kind, alarm.sensor) == (Kind.COMPASS_FIELD, Sensor(SensorKind.COMPASS))
    assert alarm.degrades == degrades
    assert alarm.severity is (Severity.ERROR if degrades else Severity.WARNING)
    assert alarm.text == ("attitude contradicts field" if degrades else "compass disturbed")
    assert alarm.since_s == 9.0
    assert alarm.size == pytest.approx(40.0)
    assert alarm.evidence == "heading +40 deg, dip +0 deg, norm 100% of the earth's"
    tilts, headings = bench.evidence.shown_errors(
        InnovationRatios(field_1s=3.0), on_ground=on_ground
    )
    assert tilts == []
    assert headings == pytest.approx([40.0 * DEG if degrades else 20.0 * DEG])


def test_a_dip_or_norm_that_is_not_the_earths_is_told():
    bench = Bench()
    bench.row(heading_deg=10.0, dip_deg=25.0, norm=1.3)
    judged(bench, InnovationRatios(field_10s=3.0))
    (alarm,) = told(bench)
    assert alarm.text == "compass disturbed"
    assert alarm.size == pytest.approx(35.0)
    assert alarm.evidence == "heading +10 deg, dip -35 deg, norm 130% of the earth's"


@pytest.mark.parametrize(
    ("ratio", "row", "shown_deg"),
    [
        (0.55, {"heading_deg": 16.0}, [8.0]),
        (0.55, {"heading_deg": -16.0}, [8.0]),
        (0.45, {"heading_deg": 16.0}, []),
        (0.55, {"heading_deg": 16.0, "norm": 1.3}, []),
    ],
)
def test_half_of_a_heading_error_is_shown_before_it_is_sure(ratio, row, shown_deg):
    bench = Bench()
    bench.row(**row)
    found = bench.evidence.shown_errors(InnovationRatios(field_1s=ratio), on_ground=False)
    assert found == ([], pytest.approx([deg * DEG for deg in shown_deg]))


def turning(axis, angle_deg=40.0, seconds=11):
    """A field and a force that turn once, in the last second."""
    bench = Bench(None)
    for _ in range(seconds - 1):
        bench.row(heading_deg=-4.0)
    return bench, bench.row(heading_deg=-4.0, turned=turn(axis, angle_deg))


def test_a_tilting_gyro_is_told_and_shown():
    bench, found = turning(ABOUT_Y)
    assert min(found.turn_1s, found.turn_10s) > 5.0
    judged(bench, found)
    (alarm,) = told(bench, ratios=found)
    assert (alarm.kind, alarm.sensor) == (Kind.GYRO_FIELD, Sensor(SensorKind.GYRO))
    assert (alarm.severity, alarm.degrades, alarm.unit) == (Severity.ERROR, True, "deg")
    assert alarm.size == pytest.approx(40.0)
    assert alarm.evidence == "by the gyro, both have turned by 40 deg in space in 10 s"
    shown = bench.evidence.shown_errors(found, on_ground=False)
    assert shown == (pytest.approx([40.0 * DEG]), pytest.approx([40.0 * DEG]))
    for ratio, is_shown in ((0.45, False), (0.55, True)):
        shown = bench.evidence.shown_errors(InnovationRatios(turn_10s=ratio), on_ground=True)
        assert list(map(len, shown)) == [is_shown, is_shown]


def test_a_turn_in_one_second_is_told_before_ten_are_over():
    bench, found = turning(ABOUT_Y, seconds=5)
    assert math.isnan(found.turn_10s)
    judged(bench, found)
    (alarm,) = told(bench, ratios=found)
    assert alarm.evidence.endswith("turned by 40 deg in space in 1 s")


def test_a_turn_about_the_vertical_may_be_of_the_field():
    bench, found = turning(ABOUT_Z)
    judged(bench, found)
    (alarm,) = told(bench, ratios=found)
    assert (alarm.kind, alarm.degrades) == (Kind.COMPASS_FIELD, True)
    assert alarm.evidence.startswith("by the gyro, the field has turned by 20 deg in space in 10 s")
    tilts, headings = bench.evidence.shown_errors(found, on_ground=False)
    assert tilts == []
    assert len(headings) == 1
    # once about the vertical, the contradiction stays doubtful
    again = bench.row(heading_deg=-4.0, turned=turn(ABOUT_Y, 90.0))
    assert again.turn_1s > 1.0
    assert [one.kind for one in told(bench, ratios=again)] == [Kind.COMPASS_FIELD]


def test_one_that_is_over_does_not_make_the_next_one_doubtful():
    bench, found = turning(ABOUT_Z)
    for _ in range(12):
        bench.row(heading_deg=-4.0)
    found = bench.row(heading_deg=-4.0, turned=turn(ABOUT_Y, 40.0))
    judged(bench, found)
    assert [one.kind for one in told(bench, ratios=found)] == [Kind.GYRO_FIELD]


@pytest.mark.parametrize(("norm", "is_told"), [(1.2, False), (1.22, True)])
def test_an_attitude_that_is_bent_explains_a_field_of_the_earths_size(norm, is_told):
    bench = Bench()
    bench.row(heading_deg=40.0, norm=norm)
    judged(bench, InnovationRatios(field_1s=3.0))
    bent = BentAttitude()
    bent.decide(Cause.GYRO, 9 * S)
    assert bool(told(bench, bent=bent)) == is_told
    assert told(bench)


def test_what_a_frozen_compass_has_shown_is_forgotten():
    bench, found = turning(ABOUT_Y)
    judged(bench, found._replace(field_1s=3.0))
    assert len(told(bench)) == 2
    bench.evidence.forget()
    assert told(bench) == []
    assert bench.windows.is_stale(bench.t_us)

"""What a field says of heading and gyro, by ratios and a field that are made by hand."""

import math
from types import SimpleNamespace

import pytest

from h2nav.integrity.bent import BentAttitude
from h2nav.integrity.causes import Cause
from h2nav.integrity.field_evidence import FieldEvidence
from h2nav.integrity.findings import Kind
from h2nav.integrity.ratios import InnovationRatios

NOTHING = InnovationRatios()


class Field:
    """The windows of a field."""

    reference = SimpleNamespace(declination_rad=0.0)
    heading_error_rad, dip_error_rad, norm_share = -0.4, 0.1, 1.2
    worst_heading_rad, turn_by_iron_rad = 0.6, 0.3

    def __init__(self, ratios=None, level=(), **known):
        self._ratios, self._level = ratios or {}, level
        self.is_plausible = known.get("is_plausible", True)
        self.has_norm = known.get("has_norm", True)

    def field_ratio(self, rows):
        return self._ratios.get(f"field_{rows}s", math.nan)

    def turn(self, rows):
        return 0.1 * rows, self._ratios.get(f"turn_{rows}s", math.nan)

    def turned_level(self, rows):
        return rows in self._level

    def is_stale(self, _t_us):
        return False

    def end_row(self):
        """Nothing is to be worked out."""

    def restart(self):
        """Nothing is kept."""


class Bench:
    def __init__(self):
        self.strapdown = SimpleNamespace(t_us=None)
        self.evidence = FieldEvidence(None, self.strapdown)
        self.t_us = 0

    def rows(self, seconds, level=(), is_plausible=True, has_norm=True, **ratios):
        """Some seconds of such a field, which is judged at each; the ratios."""
        evidence = self.evidence
        evidence.windows = Field(ratios, level, is_plausible=is_plausible, has_norm=has_norm)
        found = evidence.end_row(NOTHING)
        for _ in range(seconds):
            self.t_us += 1_000_000
            self.strapdown.t_us = self.t_us
            evidence.judge(self.t_us, found)
        return found

    def alarms(self, ratios, on_ground=False, bent=None):
        bent = bent or BentAttitude()
        return self.evidence.alarms(self.t_us, ratios, bent, on_ground=on_ground)


@pytest.mark.parametrize(
    ("in_10s", "is_unknown"), [(0.49, False), (0.51, True), (1.1, True), (math.nan, True)]
)
def test_a_heading_of_a_field_that_never_fitted_may_be_off_by_iron(in_10s, is_unknown):
    bench = Bench()
    bench.rows(1, field_10s=in_10s)
    wrong = bench.rows(3, field_1s=2.0)
    assert (bench.evidence.unknown_heading_rad(wrong) > 0.0) == is_unknown
    assert bench.evidence.unknown_heading_rad(NOTHING) == 0.0
    bench.evidence.confirm()
    assert bench.evidence.unknown_heading_rad(wrong) == 0.0


@pytest.mark.parametrize(
    ("late_us", "was_confirmed", "on_ground", "matters"),
    [
        (999_999, True, False, True),
        (1_000_000, True, False, False),
        (None, True, False, False),
        (None, False, False, True),
        (999_999, False, True, False),
    ],
)
def test_a_field_matters_in_the_air_while_it_holds_the_heading_or_was_never_right(
    late_us, was_confirmed, on_ground, matters
):
    bench = Bench()
    wrong = bench.rows(3, is_plausible=False, field_1s=2.0)
    if was_confirmed:
        bench.evidence.confirm()
    if late_us is not None:
        bench.evidence.use(bench.t_us - late_us)
    (alarm,) = bench.alarms(wrong, on_ground)
    assert (alarm.kind, alarm.degrades) == (Kind.COMPASS_FIELD, matters)
    tilts, headings = bench.evidence.shown_errors(wrong, on_ground=on_ground)
    assert (tilts, headings) == ([], [Field.worst_heading_rad] * matters)


@pytest.mark.parametrize(
    ("ratio", "is_plausible", "shown"), [(0.51, True, [0.2]), (0.49, True, []), (0.51, False, [])]
)
def test_a_field_of_the_earth_shows_half_of_a_heading_error(ratio, is_plausible, shown):
    bench = Bench()
    ratios = bench.rows(1, is_plausible=is_plausible, field_1s=ratio)
    assert bench.evidence.shown_errors(ratios, on_ground=False) == ([], shown)


@pytest.mark.parametrize(
    ("ratio", "level", "shown"),
    [(0.49, (), ([], [])), (0.51, (), ([1.0], [1.0])), (0.51, (10,), ([], [1.0]))],
)
def test_a_turn_of_the_field_shows_in_heading_and_tilt(ratio, level, shown):
    bench = Bench()
    ratios = bench.rows(1, level, turn_10s=ratio)
    assert bench.evidence.shown_errors(ratios, on_ground=False) == (
        pytest.approx(shown[0]),
        pytest.approx(shown[1]),
    )


@pytest.mark.parametrize(
    ("failed", "level", "kind", "in_s"),
    [
        ({"turn_1s": 2.0}, (), Kind.GYRO_FIELD, 1),
        ({"turn_10s": 2.0}, (), Kind.GYRO_FIELD, 10),
        ({"turn_1s": 2.0, "turn_10s": 2.0}, (), Kind.GYRO_FIELD, 10),
        # about the vertical it is a wrong yaw rate or iron
        ({"turn_1s": 2.0, "turn_10s": 2.0}, (1,), Kind.COMPASS_FIELD, 10),
        ({"turn_1s": 2.0}, (10,), Kind.GYRO_FIELD, 1),
        ({"turn_1s": 0.9}, (), None, 0),
    ],
)
def test_a_field_that_turns_accuses_the_gyro_unless_it_turns_about_the_vertical(
    failed, level, kind, in_s
):
    bench = Bench()
    ratios = bench.rows(3, level, **failed)
    alarms = bench.alarms(ratios)
    assert [alarm.kind for alarm in alarms] == ([kind] if kind else [])
    assert all(f"in space in {in_s} s" in alarm.evidence for alarm in alarms)
    assert all(alarm.degrades for alarm in alarms)


def test_once_about_the_vertical_a_contradiction_is_doubtful_until_it_is_over():
    bench = Bench()
    bench.rows(3, (1,), turn_1s=2.0)
    again = bench.rows(1, turn_1s=2.0)
    assert [alarm.kind for alarm in bench.alarms(again)] == [Kind.COMPASS_FIELD]
    assert bench.alarms(bench.rows(5, turn_1s=0.1)) == []
    bench.rows(1, turn_1s=0.1)
    gyro = bench.rows(3, turn_1s=2.0)
    assert [alarm.kind for alarm in bench.alarms(gyro)] == [Kind.GYRO_FIELD]


@pytest.mark.parametrize(("has_norm", "alarms"), [(True, 0), (False, 1)])
def test_an_attitude_that_is_bent_explains_a_field_of_the_right_size(has_norm, alarms):
    bench, bent = Bench(), BentAttitude()
    wrong = bench.rows(3, has_norm=has_norm, field_1s=2.0)
    bent.decide(Cause.GYRO, bench.t_us)
    assert len(bench.alarms(wrong, bent=bent)) == alarms


def test_what_a_frozen_compass_has_shown_is_forgotten():
    bench = Bench()
    wrong = bench.rows(3, field_1s=2.0, turn_1s=2.0)
    assert len(bench.alarms(wrong)) == 2
    bench.evidence.forget()
    assert bench.alarms(wrong) == []

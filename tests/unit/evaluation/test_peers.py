"""What third-party filters are given, and what becomes of their answers: units, times, axes."""

import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from h2nav.errors import TaskFailed
from h2nav.evaluation import imufusion
from h2nav.evaluation.dataset import peers
from h2nav.evaluation.dataset.filters import Conditions, FilterTrack
from h2nav.evaluation.dataset.peers import SMOOTHED, installed
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.trials import Trial

LEVEL = (1.0, 0.0, 0.0, 0.0)
EAST_UP = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
CONDITIONS = Conditions("multirotor")


def trial(**changes):
    """Upright, the sensor's z up, nose to magnetic north; 10 ms, then 20 ms apart."""
    up = np.tile((0.0, 0.0, GRAVITY_M_S2), (3, 1))
    field = np.array([(20.0, 0.0, -40.0), (np.nan,) * 3, (21.0, 0.0, -40.0)])
    own = Trial(
        "t", 100.0, np.array((0, 10_000, 30_000)), np.full((3, 3), math.pi), up, field, None,
        np.ones(3, bool), True, None,
    )  # fmt: skip
    return own._replace(**changes)


class Ahrs:
    """Remembers what it is given, and answers with where it was started."""

    def __init__(self):
        self.calls = []
        self.q = LEVEL

    def set_quaternion(self, q):
        self.q = q

    def set_sample_period(self, step_s):
        self.calls.append(step_s)

    def update(self, *sample):
        self.calls.append(sample)

    def update_no_magnetometer(self, *sample):
        self.calls.append(sample)

    def get_quaternion(self):
        return self.q


@pytest.fixture
def ahrs(monkeypatch):
    made = Ahrs()
    monkeypatch.setitem(sys.modules, "imufusion", SimpleNamespace(Ahrs=lambda: made))
    return made


@pytest.mark.parametrize("has_field", [True, False])
def test_imufusion_gets_degrees_a_second_and_g_and_the_times_of_the_samples(ahrs, has_field):
    own = trial() if has_field else trial(m_s=None)
    track = peers._imufusion(own, CONDITIONS)
    assert ahrs.calls[::2] == pytest.approx([0.01, 0.01, 0.02])
    for row, (rate, force, *field) in enumerate(ahrs.calls[1::2]):
        assert rate == pytest.approx([180.0] * 3)
        assert force == pytest.approx([0.0, 0.0, 1.0])
        expected = [(20.0, 0.0, -40.0), (20.0, 0.0, -40.0), (21.0, 0.0, -40.0)][row]
        assert [tuple(one) for one in field] == [expected] * has_field
    assert track.backend == "native, called per sample"
    # the world of imufusion is north-west-up: it starts there as the samples say
    if has_field:
        assert rotated(track.q_es[0], (1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)
    assert rotated(track.q_es[0], (0.0, 0.0, 1.0)) == pytest.approx((0.0, 0.0, 1.0), abs=1e-9)


def rotated(q, vector):
    w, axis = q[0], np.array(q[1:])
    turned = np.array(vector)
    return turned + 2.0 * np.cross(axis, np.cross(axis, turned) + w * turned)


def test_an_attitude_of_north_west_up_becomes_one_of_north_east_down(ahrs):
    found = imufusion.attitudes(np.zeros((1, 3)), np.zeros((1, 3)), None, [0.01])
    # level in north-west-up: x north, y west, z up
    for axis, seen in (((1, 0, 0), (1, 0, 0)), ((0, 1, 0), (0, -1, 0)), ((0, 0, 1), (0, 0, -1))):
        assert rotated(found[0], axis) == pytest.approx(seen, abs=1e-12)


def test_a_peers_heading_is_turned_to_true_north_and_its_exceptions_cost_one_trial():
    def level(own, conditions):
        return FilterTrack(np.array([LEVEL]), 1.0, "native")

    found = peers._guarded("some", level)(trial(declination_rad=10.0 * DEG), CONDITIONS)
    assert 2.0 * math.atan2(found.q_es[0, 3], found.q_es[0, 0]) == pytest.approx(-10.0 * DEG)
    for error in (ValueError("a"), TypeError("a"), ZeroDivisionError("a")):

        def fails(own, conditions, error=error):
            raise error

        with pytest.raises(TaskFailed, match="some failed: a"):
            peers._guarded("some", fails)(trial(), CONDITIONS)


@pytest.mark.parametrize(("has_field", "key"), [(True, "quat9D"), (False, "quat6D")])
def test_vqf_takes_all_samples_at_once_and_the_field_held(monkeypatch, has_field, key):
    given = []

    def update(*arrays):
        given.extend(arrays)
        return {key: np.tile(EAST_UP, (3, 1)), "bias": np.zeros((3, 3))}

    steps = []
    vqf = SimpleNamespace(
        VQF=lambda step_s: steps.append(step_s) or SimpleNamespace(updateBatch=update)
    )
    monkeypatch.setitem(sys.modules, "vqf", vqf)
    own = trial() if has_field else trial(m_s=None)
    track = peers._vqf(own, CONDITIONS)
    assert steps == [0.01]
    assert np.array_equal(given[0], own.w_s)
    assert np.array_equal(given[1], own.f_s)
    assert len(given) == 2 + has_field
    if has_field:
        assert given[2][:, 0].tolist() == [20.0, 20.0, 21.0]
    assert track.q_es == pytest.approx(np.tile(EAST_UP, (3, 1)))
    assert (track.backend, track.bias.shape) == ("native", (3, 3))


def test_who_starts_with_a_loose_sensor_starts_with_its_first_force():
    f_s = trial().f_s.copy()
    f_s[0] = 0.0
    assert peers._start_nwu(trial(f_s=f_s)) == pytest.approx(peers._start_nwu(trial()))


@pytest.mark.parametrize("missing", ["vqf", "ahrs", "scipy"])
def test_who_is_not_installed_is_not_offered(monkeypatch, missing):
    monkeypatch.setattr(
        peers.importlib.util, "find_spec", lambda name: None if name == missing else object()
    )
    found = installed()
    gone = {
        "vqf": {"vqf", "vqf_offline"}, "ahrs": {"ahrs.madgwick", "ahrs.ekf"}, "scipy": {"paper"},
    }  # fmt: skip
    for package, names in gone.items():
        assert (not names & set(found)) is (package == missing)
    assert list(found)[:2] == ["default", "default_fixed"]
    assert found["default"] is found["velocity_aided"]
    assert found["default_fixed"] is found["velocity_aided_integer"]
    assert found[SMOOTHED["default"]] is found["velocity_aided_smoothed"]
    assert found[SMOOTHED["default_fixed"]] is found["velocity_aided_integer_smoothed"]

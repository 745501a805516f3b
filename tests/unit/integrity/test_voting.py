"""Gyros and accelerometers of several IMUs vote, and so do compasses that stand still."""

import math
import random
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest
from lanes import few

from h2nav.attitude.samples import ImuSample
from h2nav.integrity.field_voting import FieldVoting
from h2nav.integrity.findings import Kind
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.sensor_pairs import HEARING_US, InertialSensor
from h2nav.integrity.voting import Suspicion, Voting
from h2nav.maths.quaternion import IDENTITY, conjugate, rotate, turned
from h2nav.maths.units import DEG, GRAVITY_M_S2

NOBODY = frozenset()
FAULT_S = 40.0


def rate(t_s):
    """A brisk flight, rad/s: turns of up to 60 deg/s, never the same again."""
    return tuple(
        0.5 * math.sin(a * t_s + b) + 0.5 * math.sin(1.7 * a * t_s)
        for a, b in ((1.1, 0.0), (0.9, 1.0), (0.5, 2.0))
    )


def force(t_s):
    return (
        math.sin(0.7 * t_s),
        1.5 * math.sin(0.4 * t_s + 1.0),
        math.sin(1.3 * t_s) - GRAVITY_M_S2,
    )


@dataclass
class Imu:
    """A sensor with what sound ones differ by, and a fault from `FAULT_S` on."""

    seed: int
    hz: float = 100.0
    bias: tuple = (0.0, 0.0, 0.0)
    drift: float = 0.0  # rad/s per second
    turned: float = 0.0  # about its x axis, rad
    scale: float = 1.0
    late_s: float = 0.0
    lever_m: float = 0.0
    shaken_m_s2: float = 0.0
    gyro_fault: object = None  # from the true rate, and the time, to what is read
    force_fault: object = None
    _random: random.Random = field(init=False)

    def __post_init__(self):
        self._random = random.Random(self.seed)
        self._still = None

    def sample(self, t_s):
        true_s = t_s - self.late_s
        w, f = rate(true_s), force(true_s)
        if self.lever_m:
            f = add(f, *self._swept(w, true_s))
        if self.turned or self.scale != 1.0:
            w, f = self._as_read(w), self._as_read(f)
        w = add(w, self.bias, 3 * (self.drift * t_s,))
        if t_s >= FAULT_S:
            w = self.gyro_fault(w, t_s) if self.gyro_fault else w
            f = self.force_fault(f, t_s) if self.force_fault else f
        noise, shaken_m_s2 = self._random.gauss, 0.05 + self.shaken_m_s2
        w = tuple([round(x + noise(0.0, 0.003), 3) for x in w])
        f = tuple([round(x + noise(0.0, shaken_m_s2), 2) for x in f])
        if t_s >= FAULT_S and self.gyro_fault is frozen:
            w = self._still = self._still or w
        return ImuSample(round(t_s * 1e6), w, f)

    def _swept(self, w, t_s):
        before, after = rate(t_s - 1e-3), rate(t_s + 1e-3)
        w_dot = tuple((a - b) * 500.0 for a, b in zip(after, before, strict=True))
        r = (self.lever_m, 0.0, 0.0)
        return cross(w_dot, r), cross(w, cross(w, r))

    def _as_read(self, v):
        x, y, z = (self.scale * each for each in v)
        c, s = math.cos(self.turned), math.sin(self.turned)
        return x, c * y - s * z, s * y + c * z


def add(*vectors):
    return tuple(map(sum, zip(*vectors, strict=True)))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def frozen(w, _t_s):
    return w


def off(*offset):
    return lambda v, _t_s: add(v, offset)


def scaled(share):
    return lambda v, _t_s: tuple(share * x for x in v)


def skewed(angle):
    return lambda v, _t_s: (v[0], v[1] - angle * v[2], v[2] + angle * v[1])


def late(seconds):
    return lambda _v, t_s: rate(t_s - seconds)


def suspected(velocity=math.nan, turn=math.nan, *, in_1s=math.nan, force_is_wrong=False):
    """What contradicts an attitude over 10 s, and over 1 s."""
    ratios = InnovationRatios(velocity_1s=in_1s, velocity_10s=velocity, turn_10s=turn)
    return Suspicion(ratios, force_is_wrong)


def fly(imus, end_s, suspicions=None, begin_s=0.0, voting=None, excluded=lambda t_s: NOBODY):
    """The alarms that begin, with their times: [(s, alarm)]."""
    voting, told, known = voting or Voting(), [], set()
    times = sorted(
        (begin_s + k / imu.hz, number)
        for number, imu in enumerate(imus)
        for k in range(round((end_s - begin_s) * imu.hz))
    )
    looked_s = begin_s
    for t_s, number in times:
        voting.take(number, imus[number].sample(t_s))
        if t_s - looked_s >= 0.05:
            looked_s = t_s
            shown = suspicions(t_s) if callable(suspicions) else suspicions or {}
            voting.look(shown if t_s > FAULT_S + 0.5 else {}, excluded(t_s))
            for alarm in voting.alarms():
                if (alarm.kind, alarm.sensor) not in known:
                    known.add((alarm.kind, alarm.sensor))
                    told.append((t_s, alarm))
    return told, voting


GYRO_FAULTS = {
    "zero": (off(3.0 * DEG, 0.0, 0.0), Kind.GYRO_BIAS_STEP),
    "scale": (scaled(1.06), Kind.GYRO_SCALE),
    # In the second that it takes, these look like a wrong zero.
    "misalignment": (skewed(0.1), Kind.GYRO_BIAS_STEP),
    "delay": (late(0.1), Kind.GYRO_BIAS_STEP),
    "frozen": (frozen, Kind.GYRO_FROZEN),
}


@pytest.mark.parametrize("fault", GYRO_FAULTS)
def test_of_three_gyros_the_one_that_fails_is_named_and_no_other(fault):
    does, kind = GYRO_FAULTS[fault]
    imus = [Imu(1), Imu(2, gyro_fault=does), Imu(3)]
    told, voting = fly(imus, FAULT_S + 10.0)
    assert [(alarm.kind, alarm.sensor.numbers) for _, alarm in told] == [(kind, (2,))]
    assert FAULT_S < told[0][0] < FAULT_S + 2.0
    assert voting.verdict(1).wrong == {InertialSensor.GYRO}
    assert voting.verdict(0).agreed == set(InertialSensor)


@pytest.mark.parametrize("size", [1.0, 3.0])
def test_of_three_accelerometers_the_one_that_fails_is_named(size):
    told, _ = fly([Imu(1, force_fault=off(size, 0.0, 0.0)), Imu(2), Imu(3)], FAULT_S + 10.0)
    ((t_s, alarm),) = told
    assert t_s < FAULT_S + 2.0
    assert (alarm.kind, alarm.sensor.numbers) == (Kind.ACCELEROMETER_BIAS_STEP, (1,))
    assert alarm.size == pytest.approx(size, rel=0.1)


SOUND = {
    "biases": Imu(3, bias=(0.02, -0.04, 0.03)),
    "a drift": Imu(3, drift=0.5 * DEG / 60.0),
    "mounting": Imu(3, turned=3.0 * DEG),
    "scale": Imu(3, scale=1.02),
    "delay": Imu(3, late_s=0.01),
    "rate": Imu(3, hz=40.0),
    "lever": Imu(3, lever_m=0.1),
    "vibration": Imu(3, shaken_m_s2=25.0),
}


@pytest.mark.parametrize("what", few(3, SOUND))
def test_what_sound_sensors_differ_by_accuses_nobody(what):
    told, _ = fly([Imu(1), Imu(2), SOUND[what]], 120.0)
    assert told == []


@pytest.mark.parametrize("imus", [2, 3])
def test_a_sensor_that_was_stuck_and_is_sound_again_differs_from_nobody(imus):
    """What it differed by meanwhile is no part of any mean afterwards."""
    sound_s = FAULT_S + 10.0

    def stuck(f, t_s):
        return (3.0, -4.0, -9.0) if t_s < sound_s else f

    def excluded(t_s):
        is_stuck = FAULT_S + 0.2 < t_s < sound_s + 0.2
        return frozenset({(InertialSensor.ACCELEROMETER, 1)}) if is_stuck else NOBODY

    flown = [Imu(n, force_fault=stuck if n == 1 else None) for n in range(imus)]
    told, _ = fly(flown, sound_s + 10.0, excluded=excluded)
    assert told == []


def shaken(phase, size_m_s2=20.0, until_s=math.inf):
    """Lines that alias, of this amplitude."""

    def read(f, t_s):
        size = size_m_s2 if t_s < until_s else 0.0
        lines = (size * math.sin(2.0 * math.pi * f_hz * t_s + phase) for f_hz in (87, 113, 71))
        return add(f, tuple(lines))

    return read


def test_of_a_sensor_that_stands_still_in_vibration_nothing_is_learnt():
    """What it is off by, once it moves again, is told all the same."""
    stuck_s, sound_s = FAULT_S + 25.0, FAULT_S + 45.0
    shakes = shaken(2.0)

    def stuck(f, t_s):
        if stuck_s < t_s < sound_s:
            return -4.0, -7.0, -20.0
        return add(shakes(f, t_s), (0.0, 0.0, -2.5 if t_s > stuck_s else 0.0))

    def excluded(t_s):
        is_stuck = stuck_s + 0.2 < t_s < sound_s + 0.2
        return frozenset({(InertialSensor.ACCELEROMETER, 1)}) if is_stuck else NOBODY

    imus = [Imu(1, 50.0, force_fault=shaken(0.3)), Imu(2, 50.0, force_fault=stuck)]
    ((_, alarm),), _ = fly(imus, sound_s + 8.0, begin_s=FAULT_S, excluded=excluded)
    assert (alarm.kind, alarm.sensor.others) == (Kind.ACCELEROMETER_APART, (1, 2))


def test_vibration_that_ends_leaves_no_difference():
    first, second = (shaken(phase, 60.0, until_s=48.0) for phase in (0.3, 2.0))
    imus = [Imu(1, 50.0, force_fault=first), Imu(2, 50.0, force_fault=second)]
    assert fly(imus, 52.0)[0] == []


@pytest.mark.parametrize("hz", [50.0, 100.0, 200.0])
def test_two_in_vibration_whose_lines_alias_are_sound_and_a_step_of_one_is_told(hz):
    """They leave up to 3 m/s^2 in a mean of 0.2 s, where the step is 2.5."""
    shakes = shaken(2.0)

    def steps(f, t_s):
        return add(shakes(f, t_s), (2.5 if t_s >= 2.0 * FAULT_S else 0.0, 0.0, 0.0))

    imus = [Imu(1, hz, force_fault=shaken(0.3)), Imu(2, hz, force_fault=steps)]
    ((t_s, alarm),), _ = fly(imus, 2.0 * FAULT_S + 10.0)
    assert (alarm.kind, alarm.sensor.others) == (Kind.ACCELEROMETER_APART, (1, 2))
    assert 2.0 * FAULT_S < t_s < 2.0 * FAULT_S + 6.0


def test_lines_that_alias_alike_on_all_axes_teach_no_turn():
    """Minutes of steady flight, then it brakes: what vibration left in both was no mounting."""

    def shaken(*phases):
        def read(_f, t_s):
            lines = (
                12.0 * math.sin(2.0 * math.pi * (f_hz * t_s + phase))
                for f_hz, phase in zip((87, 113, 71), phases, strict=True)
            )
            brakes = -2.5 if t_s > 240.0 else 0.0
            return add((brakes, brakes, -GRAVITY_M_S2), tuple(lines))

        return read

    first, second = shaken(0.98, 0.87, 0.29), shaken(0.96, 0.54, 0.68)
    assert fly([Imu(1, force_fault=first), Imu(2, force_fault=second)], 250.0)[0] == []


def test_of_a_scale_no_zero_is_learnt(monkeypatch):
    """It circles: what a scale adds has a mean, which is gone when the scale is right again."""
    swings, moved = rate, []
    monkeypatch.setitem(globals(), "rate", lambda t_s: add(swings(t_s), (0.0, 0.0, 0.3)))

    class Heard(Voting):
        def look(self, *told):
            found = super().look(*told)
            moved.extend(found.values())
            return found

    def scaled_for_a_while(w, t_s):
        return scaled(1.25 if t_s < FAULT_S + 60.0 else 1.0)(w, t_s)

    imus = [Imu(1, gyro_fault=scaled_for_a_while), Imu(2)]
    fly(imus, FAULT_S + 90.0, {0: suspected(turn=3.0), 1: suspected(0.1, 0.1)}, voting=Heard())
    assert moved
    assert max(math.hypot(*each) for each in moved) < 0.1 * DEG


def test_of_two_that_differ_neither_is_named_and_the_attitude_is_doubted():
    told, voting = fly([Imu(1, gyro_fault=off(0.0, 0.0, 5.0 * DEG)), Imu(2)], FAULT_S + 6.0)
    ((_, alarm),) = told
    assert (alarm.kind, alarm.sensor.number, alarm.sensor.others) == (Kind.GYRO_APART, None, (1, 2))
    assert not alarm.is_decided
    assert voting.verdict(0).open_rad > 10.0 * DEG
    assert voting.verdict(0).wrong == voting.verdict(1).wrong == NOBODY


class Compass(Imu):
    """An IMU with a compass, whose field is fixed in space."""

    def sample(self, t_s):
        while self._turned_s < t_s:
            self._q_nb = turned(self._q_nb, tuple(0.005 * w for w in rate(self._turned_s)))
            self._turned_s += 0.005
        field_ut = rotate(conjugate(self._q_nb), (20.0, 1.0, 42.0))
        return super().sample(t_s)._replace(m_b_ut=add(field_ut, (1.0, -1.0, 0.5)))

    def __post_init__(self):
        super().__post_init__()
        self._q_nb, self._turned_s = IDENTITY, FAULT_S - 10.0


@pytest.mark.parametrize(
    ("fault", "kind"),
    [(scaled(1.15), Kind.GYRO_SCALE), (off(0.0, 0.0, 5.0 * DEG), Kind.GYRO_BIAS_STEP)],
)
@pytest.mark.parametrize("wrong", [0, 1])
def test_of_two_gyros_the_one_that_turns_as_no_field_does_is_named(fault, kind, wrong):
    """The only compass stands beside the wrong one."""
    imus = [Compass(1, gyro_fault=fault), Imu(2)]
    known = dict.fromkeys((0, 1), Suspicion(gyro_zero=(0.0, 0.0, 0.0)))
    told, voting = fly(imus[:: 1 - 2 * wrong], FAULT_S + 20.0, known, begin_s=FAULT_S - 10.0)
    (_, first), (_, second) = told
    assert (first.kind, first.is_decided) == (Kind.GYRO_APART, False)
    assert (second.kind, second.sensor.numbers) == (kind, (wrong + 1,))
    assert voting.verdict(wrong).wrong == {InertialSensor.GYRO}


def test_a_field_has_seen_nothing_of_a_difference_that_is_past():
    """What it saw of the first gyro, which is sound again, says nothing of the second."""
    imus = [
        Compass(1, gyro_fault=lambda w, t_s: scaled(1.15 if t_s < FAULT_S + 15.0 else 1.0)(w, t_s)),
        Imu(2, gyro_fault=lambda w, t_s: scaled(1.15 if t_s > FAULT_S + 40.0 else 1.0)(w, t_s)),
    ]
    known = dict.fromkeys((0, 1), Suspicion(gyro_zero=(0.0, 0.0, 0.0)))
    told, _ = fly(imus, FAULT_S + 60.0, known, begin_s=FAULT_S - 10.0)
    named = [(alarm.kind, alarm.sensor.numbers) for _, alarm in told if alarm.is_decided]
    assert named == [(Kind.GYRO_SCALE, (1,)), (Kind.GYRO_SCALE, (2,))]


def test_of_two_of_which_one_is_heard_no_more_the_other_is_not_accused_and_the_doubt_fades():
    one = Imu(1, force_fault=off(0.8, 0.0, 0.0), gyro_fault=off(0.0, 0.0, 5.0 * DEG))
    _, voting = fly([one, Imu(2)], FAULT_S + 4.0, begin_s=FAULT_S - 10.0)
    assert voting.verdict(0).apart == set(InertialSensor)
    opened_rad = voting.verdict(0).open_rad
    fly([one], FAULT_S + 4.8, begin_s=FAULT_S + 4.0, voting=voting)
    assert voting.verdict(0).open_rad == opened_rad
    fly([one], FAULT_S + 14.1, begin_s=FAULT_S + 4.8, voting=voting)
    assert voting.verdict(0).open_rad == pytest.approx(opened_rad / math.e, rel=0.05)
    shown = {0: suspected(2.0, 2.0), 1: suspected(0.1, 0.1)}
    told, _ = fly([one], FAULT_S + 16.0, shown, FAULT_S + 14.1, voting)
    assert told == []
    assert not voting.verdict(0).wrong | voting.verdict(0).apart


def test_once_a_sensor_is_known_to_be_faulty_the_doubt_that_it_brought_fades():
    def excluded(t_s):
        return frozenset({(InertialSensor.GYRO, 0)}) if t_s > FAULT_S + 6.0 else NOBODY

    imus = [Imu(1, gyro_fault=off(0.0, 0.0, 5.0 * DEG)), Imu(2)]
    _, voting = fly(imus, FAULT_S + 26.0, excluded=excluded)
    assert 0.0 < voting.verdict(1).open_rad < 10.0 * DEG


@pytest.mark.parametrize(
    ("faults", "suspicions", "kind", "number"),
    [
        ({"gyro_fault": off(0.0, 0.0, 0.1)}, suspected(turn=2.0), Kind.GYRO_BIAS_STEP, 1),
        ({"gyro_fault": off(0.0, 0.0, 0.1)}, suspected(velocity=2.0), Kind.GYRO_BIAS_STEP, 1),
        ({"force_fault": off(3.0, 0.0, 0.0)}, suspected(2.0), Kind.ACCELEROMETER_BIAS_STEP, 1),
    ],
)
def test_of_two_the_one_whose_attitude_is_contradicted_is_named(faults, suspicions, kind, number):
    told, _ = fly(
        [Imu(1, **faults), Imu(2)], FAULT_S + 6.0, {0: suspicions, 1: suspected(0.1, 0.1)}
    )
    ((t_s, alarm),) = told
    assert t_s < FAULT_S + 2.0
    assert (alarm.kind, alarm.sensor.numbers) == (kind, (number,))


@pytest.mark.parametrize(
    ("lasts_s", "others_in_1s", "is_named"),
    # What scatters from fix to fix contradicts both attitudes of a moment.
    [(0.5, 0.1, False), (4.0, 0.9, True), (4.0, 1.1, False)],
)
def test_of_two_a_contradiction_that_may_be_chance_names_nobody_until_it_lasts(
    lasts_s, others_in_1s, is_named
):
    def shown(t_s):
        lasts = FAULT_S + 4.0 < t_s < FAULT_S + 4.0 + lasts_s
        mine = suspected(1.2 if lasts else 0.6, in_1s=others_in_1s)
        return {0: mine, 1: suspected(0.1, in_1s=others_in_1s)}

    told, _ = fly([Imu(1, force_fault=off(3.0, 0.0, 0.0)), Imu(2)], FAULT_S + 12.0, shown)
    assert any(alarm.sensor.number == 1 for _, alarm in told) == is_named


@pytest.mark.parametrize(("wrong", "named"), [((1,), {2}), ((0, 1), set())])
def test_of_two_accelerometers_the_one_whose_force_has_the_wrong_size_is_wrong(wrong, named):
    shown = {number: suspected(0.6, force_is_wrong=number in wrong) for number in (0, 1)}
    told, _ = fly([Imu(1), Imu(2, force_fault=scaled(1.2))], FAULT_S + 6.0, shown)
    assert {alarm.sensor.number for _, alarm in told if alarm.sensor.number} == named


def test_a_gyro_and_the_other_imus_accelerometer_fail_at_once():
    imus = [Imu(1, gyro_fault=off(0.0, 0.0, 0.1)), Imu(2, force_fault=off(3.0, 0.0, 0.0))]
    both = {0: suspected(velocity=2.0, turn=2.0), 1: suspected(velocity=3.0, turn=0.1)}
    told, _ = fly(imus, FAULT_S + 6.0, both)
    assert {(alarm.kind, alarm.sensor.numbers) for _, alarm in told} == {
        (Kind.GYRO_BIAS_STEP, (1,)),
        (Kind.ACCELEROMETER_BIAS_STEP, (2,)),
    }


def test_a_velocity_decides_of_no_sensor_while_both_kinds_differ():
    """It contradicts one attitude by the accelerometer of the one or the gyro of the other."""
    imus = [Imu(1, force_fault=off(3.0, 0.0, 0.0)), Imu(2, gyro_fault=off(0.0, 0.0, 0.1))]
    told, _ = fly(imus, FAULT_S + 6.0, {0: suspected(3.0, 0.1), 1: suspected(0.1, 0.1)})
    assert {(alarm.kind, alarm.sensor.numbers) for _, alarm in told} == {
        (Kind.GYRO_APART, (1, 2)),
        (Kind.ACCELEROMETER_APART, (1, 2)),
    }


def differing(is_raised):
    """Two sensors apart by 0.1 rad/s or m/s^2, or no more."""
    shape = SimpleNamespace(
        windows=5, constant=0.1, is_frozen=lambda place: False, unexplained=lambda: (0.0, 1.0)
    )
    return SimpleNamespace(
        is_raised=is_raised, raised_us=0, shape=shape, is_fresh=lambda t_us: True,
        test=SimpleNamespace(since_s=lambda t_us: 3.0),
    )  # fmt: skip


GYRO, ACCELEROMETER = InertialSensor.GYRO, InertialSensor.ACCELEROMETER


@pytest.mark.parametrize(
    ("part", "wrong", "apart", "evidence"),
    [
        (GYRO, 1, [(0, 1), (1, 2)], "it differs from the gyro of IMU 1 and 3, which agree"),
        (GYRO, 0, [(0, 1), (0, 2)], "it differs from the gyro of IMU 2 and 3, which agree"),
        (GYRO, 2, [(1, 2), (0, 1)],
         "it differs from the gyro of IMU 2, whose attitude is not contradicted"),
        (ACCELEROMETER, 0, [(0, 1)],
         "it differs from the accelerometer of IMU 2, whose attitude is not contradicted"),
        (ACCELEROMETER, 1, [(0, 1)],
         "it differs from the accelerometer of IMU 1, whose attitude is not contradicted"),
    ],
)  # fmt: skip
def test_the_evidence_against_a_sensor_numbers_imus_as_people_do(part, wrong, apart, evidence):
    """From 1, in order, and those alone that it differs from."""
    voting = Voting()
    voting._wrong = {(part, wrong): 0}
    pairs = [(0, 1), (0, 2), (1, 2)]
    voting._pairs = {(part, *both): differing(both in apart) for both in pairs}
    (alarm,) = [one for one in voting.alarms() if one.is_decided]
    assert alarm.sensor.numbers == (wrong + 1,)
    assert alarm.evidence == evidence


def test_a_zero_that_stays_is_learnt_and_the_gyro_heard_again():
    imus = [Imu(1, gyro_fault=off(0.05, 0.0, 0.0)), Imu(2), Imu(3)]
    end_s = FAULT_S + 1e-6 * HEARING_US
    _, voting = fly(imus, end_s)
    assert voting.verdict(0).wrong == {InertialSensor.GYRO}
    moved = {}
    for t_s in range(60):
        for tick in range(100):
            for number, imu in enumerate(imus):
                voting.take(number, imu.sample(end_s + t_s + 0.01 * tick))
        moved |= voting.look({}, NOBODY)
    assert voting.verdict(0).wrong == NOBODY
    assert moved[0] == pytest.approx((0.05, 0.0, 0.0), abs=0.02)


def test_a_sensor_known_to_be_faulty_has_no_vote():
    imus = [Imu(1, gyro_fault=off(0.1, 0.0, 0.0)), Imu(2), Imu(3)]
    voting = Voting()
    for t_ms in range(0, 50_000, 10):
        for number, imu in enumerate(imus):
            voting.take(number, imu.sample(1e-3 * t_ms))
        voting.look({}, {(InertialSensor.GYRO, 0)})
    assert voting.alarms() == []


def test_samples_of_other_times_are_not_compared():
    voting, one, other = Voting(), Imu(1), Imu(2)
    for t_ms in range(0, 5_000, 10):
        voting.take(0, one.sample(1e-3 * t_ms))
        voting.take(1, other.sample(1e-3 * t_ms)._replace(t_us=1000 * t_ms + 10**9))
    assert voting.verdict(0) == voting.verdict(1)
    assert voting.verdict(0).agreed == NOBODY


def field_of(heading):
    return (20.0 * math.cos(heading), -20.0 * math.sin(heading), 45.0)


def test_a_compass_that_repeats_itself_while_two_others_turn_is_frozen():
    votes, found = FieldVoting(), None
    for tick in range(100):
        heading = 0.0 if tick < 50 else 0.04 * (tick - 50)
        fields = {0: field_of(0.0), 1: field_of(heading), 2: field_of(heading + 0.1)}
        votes.look(100_000 * tick, fields)
        if votes.frozen and found is None:
            found = heading
    assert votes.frozen == {0}
    assert found < 0.2
    votes.look(10_100_000, {0: field_of(0.3), 1: field_of(2.0), 2: field_of(2.1)})
    assert votes.frozen == NOBODY


def test_compasses_that_stand_still_together_or_change_differently_are_not_frozen():
    votes = FieldVoting()
    for tick in range(50):
        fields = {0: field_of(0.0), 1: field_of(0.05 * tick), 2: field_of(-0.05 * tick)}
        votes.look(100_000 * tick, fields)
        assert votes.frozen == NOBODY

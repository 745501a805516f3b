"""The integer filters that are exported: their gains as integers, and what they are tested with."""

import pytest

from h2nav.apps.export_forms import (
    FORMS,
    constant_gain_samples,
    step_of_any_length,
    velocity_aided_samples,
)
from h2nav.attitude.constant_gain import memory as constant_gain
from h2nav.attitude.record import rows, values
from h2nav.attitude.velocity_aided.integer import memory as velocity_aided
from h2nav.attitude.velocity_aided.integer.kernel import start
from h2nav.files import gain_files

VELOCITY_AIDED, CONSTANT_GAIN = FORMS
EXAMPLES = {"velocity_aided": "multirotor_100hz", "constant_gain": "mpu9250_100hz"}


def integers(record):
    return [int(number) for number in values(record, type(record))]


def image_of(form):
    return form.image(gain_files.load(EXAMPLES[form.text.name]), "place")


def test_the_names_and_the_kinds_that_they_are_made_of():
    assert [(form.text.name, form.former_name, form.kinds) for form in FORMS] == [
        ("velocity_aided", "flight", ("velocity_aided",)),
        ("constant_gain", "lean", ("two_stage", "velocity_aided")),
    ]


def test_only_the_filter_with_a_velocity_has_words_for_an_unknown_vehicle():
    assert image_of(CONSTANT_GAIN).constants == ()
    names = [name for name, _, _ in image_of(VELOCITY_AIDED).constants]
    assert names == ["REST_UNKNOWN", "SPEED_UNKNOWN"]


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.text.name)
def test_integers_are_the_gains_but_for_rounding(form):
    image = image_of(form)
    assert 0.0 < image.rounding_error < 1e-3
    assert any(integers(image.gains))


@pytest.mark.parametrize(
    ("samples", "record", "count"),
    [
        (constant_gain_samples, constant_gain.Sample, 400),
        (velocity_aided_samples, velocity_aided.Sample, 208),
    ],
)
def test_samples_are_the_same_each_time_and_within_their_formats(samples, record, count):
    made = samples()
    assert len(made) == count
    assert [integers(one) for one in made] == [integers(one) for one in samples()]
    for one in made:
        for field in rows(record):
            value = getattr(one, field.name)
            low, high = field.range or (0, 0)
            each = value if isinstance(value, list) else [value]
            if field.range is not None and field.name != "dt_us":
                assert all(low <= number <= high for number in each), field.name


def test_the_first_half_is_of_ordinary_motion_with_every_second_field():
    made = constant_gain_samples()[:200]
    for number, one in enumerate(made):
        assert bool(one.has_mag) == bool(number % 2)
        assert one.dt_us == 10_000
        assert max(map(abs, one.gyro)) <= 1_100_000
    means = [sum(one.gravity[axis] for one in made) / 200 for axis in range(3)]
    assert means == pytest.approx([0.0, 0.0, 16_384.0], abs=60.0)
    means = [sum(one.mag[axis] for one in made) / 200 for axis in range(3)]
    assert means == pytest.approx([8192.0, 0.0, 14_189.0], abs=60.0)


def test_velocity_comes_after_a_quarter_and_fixes_every_twentieth_sample():
    made = velocity_aided_samples()
    aided = [number for number, one in enumerate(made[:156]) if one.aided]
    assert aided == list(range(52, 156))
    fixes = [number for number, one in enumerate(made[:156]) if one.has_fix]
    assert fixes == [60, 80, 100, 120, 140]
    fields = [number for number, one in enumerate(made[:156]) if one.has_mag]
    assert fields == list(range(1, 156, 2))
    lengths = {number: one.dt_us for number, one in enumerate(made) if one.dt_us != 10_000}
    assert lengths == {37: 30_000, 90: 100_001, 130: 200_000}
    assert {(one.parts, one.fix_variance, one.fix_period_us) for one in made[:156]} == {
        (1, 170_000, 200_000)
    }
    forces = [sum(one.accel[axis] for one in made[:156]) / 156 for axis in range(3)]
    assert forces == pytest.approx([0.0, 0.0, -(1 << 20)], abs=4000.0)
    field = [sum(one.mag[axis] for one in made[:156]) / 156 for axis in range(3)]
    assert field == pytest.approx([6400.0, 0.0, 11_085.0], abs=20.0)


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.text.name)
def test_vectors_have_a_result_for_each_sample_and_the_memory_at_the_end(form):
    gains = image_of(form).gains
    found = form.vectors(gains)
    assert len(found.samples) == len(found.bits)
    assert len(set(found.bits)) > 1
    assert any(found.final)


def test_a_sample_of_any_length_is_left_as_it_was():
    gains = image_of(VELOCITY_AIDED).gains
    memory = velocity_aided.State()
    start.reset(memory, gains)
    for sample in velocity_aided_samples()[:156]:
        before = integers(sample)
        step_of_any_length(memory, gains, sample)
        assert integers(sample) == before

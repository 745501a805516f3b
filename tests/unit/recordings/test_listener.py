"""What the service gives to its filter, with the place of each input among the samples."""

from h2nav.attitude.samples import EarthField, ImuSample, SensorDelays, VehicleState, VelocityFix
from h2nav.recordings.listener import Listener
from h2nav.recordings.trials import FilterInput

SAMPLE = ImuSample(0, (0.1, 0.2, 0.3), (1.0, 2.0, -9.8), (20.0, 1.0, 40.0), False)
FIELD = EarthField(48.0, 1.1, 0.05)
VEHICLE = VehicleState(on_ground=False)
DELAYS = SensorDelays(0.003, 0.011)
FIX = VelocityFix(15_000, (1.0, 2.0, 0.1), 0.3)


def test_every_input_is_kept_with_the_number_of_the_sample_that_follows() -> None:
    listener = Listener()
    listener.use_field(FIELD)
    listener.use_vehicle(VEHICLE)
    listener.update(SAMPLE)
    listener.update(SAMPLE._replace(t_us=10_000))
    listener.use_velocity(FIX)
    listener.use_delays(DELAYS)
    (stretch,) = listener.stretches
    kept = [(0, FIELD), (0, VEHICLE), (2, FIX), (2, DELAYS)]
    assert stretch.inputs == [FilterInput(*pair) for pair in kept]
    assert list(stretch.samples.records()) == [SAMPLE, SAMPLE._replace(t_us=10_000)]


def test_a_restart_begins_a_stretch_in_which_state_field_and_delays_still_hold() -> None:
    listener = Listener()
    for tell, what in (
        (listener.use_delays, DELAYS),
        (listener.use_field, FIELD),
        (listener.use_vehicle, VEHICLE),
        (listener.use_velocity, FIX),
    ):
        tell(what)
    listener.arrives(7_000)
    listener.update(SAMPLE)
    listener.restart()
    listener.restart()  # of an empty stretch there is nothing to keep apart
    first, second = listener.stretches
    assert first.arrived_us == [7]
    assert second.inputs == [FilterInput(0, what) for what in (VEHICLE, FIELD, DELAYS)]
    assert list(second.samples.records()) == []

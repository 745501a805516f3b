"""An input that aids the filter"""

CHANGES = {
    "h2nav/attitude/samples.py": (
        (
            "class SensorDelays(NamedTuple):\n",
            '''\
class HeadingFix(NamedTuple):
    """A heading from outside the inertial sensors."""

    t_us: int  # time of validity on the clock of `ImuSample.t_us`
    heading_rad: float  # of the nose, from true north
    sigma_rad: float

    def backward(self) -> "HeadingFix":
        """The same."""
        return self


class SensorDelays(NamedTuple):
''',
        ),
    ),
    "h2nav/attitude/filter.py": (
        ("    EarthField,\n    ImuSample,\n", "    EarthField,\n    HeadingFix,\n    ImuSample,\n"),
        (
            "TimedInput = VelocityFix\n",
            "TimedInput = VelocityFix | HeadingFix\n",
        ),
        (
            '        """Takes one velocity fix; filters without velocity aiding ignore it."""\n',
            '''\
        """Takes one velocity fix; filters without velocity aiding ignore it."""

    def use_heading(self, fix: HeadingFix) -> None:
        """Takes a heading."""
''',
        ),
        (
            "        self.take_input(fix)\n",
            '''\
        self.take_input(fix)

    def use_heading(self, fix: HeadingFix) -> None:
        """See `AttitudeFilter`."""
        self.take_input(fix)
''',
        ),
        (
            "    if isinstance(what, VelocityFix):\n",
            """\
    if isinstance(what, HeadingFix):
        chosen.use_heading(what)
    elif isinstance(what, VelocityFix):
""",
        ),
    ),
    "h2nav/attitude/velocity_aided/shell.py": (
        ("    EarthField,\n    ImuSample,\n", "    EarthField,\n    HeadingFix,\n    ImuSample,\n"),
        ("import exp, multiply, rotate\n", "import exp, multiply, rotate, to_euler\n"),
        (
            "    def use_velocity(self, fix: VelocityFix) -> None:\n",
            '''\
    def use_heading(self, fix: HeadingFix) -> None:
        """Turns to it; see `AttitudeFilter`."""
        if self._aligned:
            yaw_rad = to_euler(self._attitude())[2]
            turn_rad = math.remainder(fix.heading_rad - yaw_rad, 2.0 * math.pi)
            self._find_heading(turn_rad, fix.sigma_rad)

    def use_velocity(self, fix: VelocityFix) -> None:
''',
        ),
    ),
    "h2nav/service/aiding.py": (
        (
            "import MAX_FIX_SIGMA_M_S, EarthField, VehicleState, VelocityFix\n",
            "import MAX_FIX_SIGMA_M_S, EarthField, HeadingFix, VehicleState, VelocityFix\n",
        ),
        (
            "        if self._settings.gps_velocity:\n",
            """\
        if velocity is not None and math.hypot(*velocity.v_n[:2]) > FAST_M_S:
            north, east, _ = velocity.v_n
            course_rad = math.atan2(east, north)
            self._estimation.use(HeadingFix(velocity.t_us, course_rad, 0.1))
        if self._settings.gps_velocity:
""",
        ),
        ("FIELD_STEP_DEG = 0.5\n", "FIELD_STEP_DEG = 0.5\nFAST_M_S = 10.0\n"),
    ),
}

if __name__ == "__main__":
    import math

    from filters import FILTERS, new_filter
    from pymavlink.dialects.v20 import ardupilotmega as mavlink
    from synthetic_imu import fly, still

    from h2nav.apps.configuration import Configuration
    from h2nav.apps.filters import FilterFactory
    from h2nav.apps.pipeline import deliver
    from h2nav.attitude.filter import pass_on
    from h2nav.attitude.samples import HeadingFix
    from h2nav.attitude.smoothing import Given, smooth
    from h2nav.files.earth_field import earth_field_at
    from h2nav.maths.quaternion import to_euler
    from h2nav.recordings.listener import Listener
    from h2nav.service.service import Service, Surroundings
    from h2nav.wire.codec import Encoder
    from h2nav.wire.deframer import Deframer

    # Each filter takes it, in either arithmetic, or ignores it.
    *before, last = fly(still, 2.0, 1, bias_b=(0.0, 0.0, 0.0)).samples
    for name in FILTERS:
        chosen = new_filter(name)
        for sample in before:
            chosen.update(sample)
        pass_on(chosen, HeadingFix(last.t_us, 0.5, 0.1))
        heading_rad = to_euler(chosen.update(last._replace(m_b_ut=None)).q_nb)[2]
        assert abs(heading_rad - (0.0 if name == "constant_gain" else 0.5)) < 0.05, name

    # From the receiver's message to the filter, and what is recorded of it to the smoother.
    chosen = Configuration()
    filters = FilterFactory.shipped(chosen.filter, chosen.autopilot.imu_rate_hz)
    listener = Listener(filters.filter_for)
    service = Service(chosen.service, Surroundings(listener.filter_for, earth_field_at, 1.79e9))
    pilot = Encoder(1, 1)
    copter = (mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    for t_ms in range(1000, 9000, 20):
        x, y, z = (round(20.0 * math.sin(k * t_ms)) for k in (1.0, 2.0, 3.0))
        t_us = t_ms * 1000
        sent = [mavlink.MAVLink_raw_imu_message(t_us, x, y, z - 1000, z, x, y, 200, 0, 400)]
        if t_ms % 1000 == 0:
            sent.insert(0, mavlink.MAVLink_heartbeat_message(*copter, 0, 0, 4, 3))
        if t_ms % 200 == 0:
            place = (470000000, 80000000, 500000)
            east = (100, 100, 2000 + t_ms // 200 % 2, 9000, 12)
            sent.append(mavlink.MAVLink_gps_raw_int_message(t_us, 3, *place, *east, 0, 0, 0, 300))
        for frame in Deframer().feed(b"".join(map(pilot.encode, sent))):
            deliver(service, frame, t_ms * 10**6, t_ms * 10**6)
    (stretch,) = listener.stretches
    headings = [one.what for one in stretch.inputs if isinstance(one.what, HeadingFix)]
    assert len(headings) > 20
    assert all(abs(one.heading_rad - math.pi / 2.0) < 0.01 for one in headings)
    others = [one for one in stretch.inputs if one.what not in headings]
    for inputs, is_told in ((stretch.inputs, True), (others, False)):
        given = Given(stretch.samples, inputs)
        (found,) = smooth([given], lambda: filters.filter_for(listener.identity))
        off_rad = abs(to_euler(found.q_nb[:, -1].tolist())[2] - math.pi / 2.0)
        assert off_rad < 0.1 if is_told else off_rad > 0.5, off_rad

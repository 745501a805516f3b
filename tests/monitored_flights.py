"""The default filter and its monitor over a seeded flight, as a lane runs them."""

import math

from synthetic_imu import FIELD
from velocity_flights import FLYING, PERIOD, new_filter

from h2nav.attitude.samples import VelocityFix
from h2nav.integrity.findings import Sensor, SensorKind
from h2nav.integrity.monitor import Monitor, Speeds
from h2nav.integrity.sensor_checks import Use
from h2nav.service.own_bias import OwnBias

REST = (0.0, 0.0, 0.0)


def flown(
    drive,
    velocity_at=lambda t_s, v_n: v_n,
    gps=True,
    altitudes=None,
    gps_until_s=math.inf,
    seen=None,
):
    """(time, use, estimate or None, monitor) of each sample.

    Args:
        altitudes: that the receiver measures, m; None if it does not.
        seen: what the monitor is given instead of the estimate at a sample's index.
    """
    filter_, monitor = (
        new_filter(knows_field=True),
        Monitor(Sensor(SensorKind.IMU, 1), Speeds(10.0)),
    )
    bias = OwnBias()
    monitor.use_vehicle(FLYING)
    monitor.use_field(FIELD)
    for i, sample in enumerate(drive.flight.samples):
        t_s = sample.t_us * 1e-6
        if gps and i % PERIOD == 0 and t_s < gps_until_s:
            fix = VelocityFix(sample.t_us, velocity_at(t_s, drive.v_n[i]), 0.3)
            if altitudes is not None:
                fix = fix._replace(altitude_m=altitudes[i])
            doubt = monitor.fix(fix, bias.errors(filter_.sensor_errors))
            if doubt is not None:
                if doubt.correction is not None:
                    bias.correct(doubt.correction)
                filter_.doubt(doubt)
            if not monitor.velocity_is_false:
                filter_.use_velocity(fix)
        use = monitor.check(sample)
        known = sample._replace(f_b=REST) if monitor.force_is_withheld else bias.felt(sample)
        estimate = None if use is Use.NONE else bias.update(filter_, known)
        if estimate is not None:
            estimate = estimate if seen is None else seen(i, estimate)
            monitor.add(sample, estimate)
        yield t_s, use, estimate, monitor
